// What a reference to an equation or a figure of this page leads to, shown beside it: under the mouse, or when the keyboard comes
// to the link.  Escape closes it.  A finger follows the link, as without this script.
addEventListener("DOMContentLoaded", () => {
  const box = document.createElement("div");
  box.className = "kf-preview";
  box.id = "kf-preview";
  box.setAttribute("role", "tooltip");
  box.hidden = true;
  document.body.append(box);
  let shown = null, waiting = 0;

  const target = (link) => {
    const found = document.getElementById(decodeURIComponent(link.hash.slice(1)));
    return found?.closest("figure") ?? found?.closest("div.math") ?? found?.querySelector(":scope > div.math");
  };
  const close = () => {
    clearTimeout(waiting);
    shown?.removeAttribute("aria-describedby");
    box.hidden = true;
    shown = null;
  };
  const open = (link) => {
    close();
    const copy = target(link).cloneNode(true);
    for (const one of [copy, ...copy.querySelectorAll("*")])
      for (const name of ["id", "tabindex", "role", "aria-label"]) one.removeAttribute(name);
    for (const one of copy.querySelectorAll("button, details, .headerlink")) one.remove();
    for (const one of copy.querySelectorAll("a")) one.replaceWith(...one.childNodes);
    box.replaceChildren(copy);
    box.hidden = false;
    link.setAttribute("aria-describedby", box.id);
    shown = link;
    place();
  };
  const place = () => {
    const at = shown.getBoundingClientRect(), { width, height } = box.getBoundingClientRect(), page = document.documentElement;
    const below = at.bottom + 6 + height <= page.clientHeight || at.top < height + 6;
    box.style.left = `${Math.max(8, Math.min(at.left, page.clientWidth - width - 8))}px`;
    box.style.top = `${below ? at.bottom + 6 : at.top - height - 6}px`;
  };
  const later = (what, delay) => {
    clearTimeout(waiting);
    waiting = setTimeout(what, delay);
  };

  for (const link of document.querySelectorAll('article a.reference.internal[href^="#"]')) {
    if (!target(link)) continue;
    link.addEventListener("pointerenter", (event) => event.pointerType === "mouse" && later(() => open(link), 150));
    link.addEventListener("pointerleave", () => later(close, 250)); // time to go over to the box, to read or to copy
    link.addEventListener("focus", () => link.matches(":focus-visible") && open(link));
    link.addEventListener("blur", close);
  }
  box.addEventListener("pointerenter", () => clearTimeout(waiting));
  box.addEventListener("pointerleave", () => later(close, 250));
  addEventListener("keydown", (event) => event.key === "Escape" && close());
  addEventListener("scroll", () => shown && place(), { passive: true }); // the focus itself may have moved the page
});
