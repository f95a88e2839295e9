// A formula and the punctuation beside it stay on one line; browsers break lines around the boxes of formulas.
addEventListener("DOMContentLoaded", () => {
  for (const formula of document.querySelectorAll("span.math")) {
    const after = formula.nextSibling, before = formula.previousSibling;
    const mark = after?.nodeType === Node.TEXT_NODE && after.data.match(/^[,.;:!?)\]”’]+/)?.[0];
    const bracket = before?.nodeType === Node.TEXT_NODE && before.data.match(/[(\[“‘]+$/)?.[0];
    if (!mark && !bracket) continue;
    const together = document.createElement("span");
    together.className = "kf-together";
    formula.replaceWith(together);
    together.append(bracket || "", formula, mark || "");
    if (mark) after.data = after.data.slice(mark.length);
    if (bracket) before.data = before.data.slice(0, -bracket.length);
  }
});

// A link to something that is folded opens the fold.
function unfold() {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  const folds = [...document.querySelectorAll("article details:not([open])")].filter((fold) => fold.contains(target));
  for (const fold of folds) fold.open = true;
  if (folds.length) target.scrollIntoView();
}
addEventListener("DOMContentLoaded", unfold);
addEventListener("hashchange", unfold);

// On paper hints are open: nobody can click there.  What the reader had closed is closed again.
let opened = [];
addEventListener("beforeprint", () => {
  opened = [...document.querySelectorAll("article details:not([open], .hide, .kf-code)")];
  for (const one of opened) one.open = true;
});
addEventListener("afterprint", () => {
  for (const one of opened) one.open = false;
  opened = [];
});
