// A displayed formula takes the focus, so that the keyboard can scroll it where it is wider than the screen; MathJax puts each into
// a box of its own, which is the one that scrolls.
addEventListener("load", async () => {
  await window.MathJax?.startup?.promise;
  for (const formula of document.querySelectorAll("div.math[tabindex]")) {
    const box = formula.querySelector("mjx-container");
    if (!box) continue;
    for (const name of ["tabindex", "role", "aria-label"]) {
      box.setAttribute(name, formula.getAttribute(name));
      formula.removeAttribute(name);
    }
  }
  document.documentElement.dataset.formulas = "ready";
});
