// What a reference to an equation, a figure or a term leads to, shown beside it: under the mouse, or when the keyboard comes to
// the link.  Escape closes it.  A finger follows the link, as without this script.  What stands on another page, the build has
// printed into this one (previews.py).
addEventListener("DOMContentLoaded", () => {
  const box = document.createElement("div");
  box.className = "kf-preview";
  box.id = "kf-preview";
  box.setAttribute("role", "tooltip");
  box.hidden = true;
  document.body.append(box);
  const elsewhere = JSON.parse(document.getElementById("kf-previews")?.textContent ?? "{}");
  let shown = null, waiting = 0;

  const target = (link) => {
    const address = link.getAttribute("href");
    if (!address.startsWith("#")) return Object.hasOwn(elsewhere, address) && elsewhere[address];
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
    const found = target(link);
    if (typeof found === "string") print(found);
    else box.replaceChildren(found.cloneNode(true));
    bare();
    box.hidden = false;
    link.setAttribute("aria-describedby", box.id);
    shown = link;
    place();
  };
  const bare = () => { // no second element of a name, nothing to press, no links
    for (const one of box.querySelectorAll("*"))
      for (const name of ["id", "tabindex", "role", "aria-label"]) one.removeAttribute(name);
    for (const one of box.querySelectorAll("button, details, .headerlink, .kf-where")) one.remove();
    for (const one of box.querySelectorAll("a")) one.replaceWith(...one.childNodes);
  };
  const print = (html) => {
    box.innerHTML = html;
    for (const picture of box.querySelectorAll("img")) picture.onload = () => shown && place(); // only now it has its height
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

  const left = () => later(() => shown !== document.activeElement && close(), 250); // time to go over to the box, to read or to copy
  for (const link of document.querySelectorAll('article a.reference.internal[href*="#"]')) {
    if (!target(link)) continue;
    link.addEventListener("pointerenter", (event) => event.pointerType === "mouse" && later(() => open(link), 150));
    link.addEventListener("pointerleave", left);
    link.addEventListener("focus", () => link.matches(":focus-visible") && open(link));
    link.addEventListener("blur", close);
  }
  box.addEventListener("pointerenter", () => clearTimeout(waiting));
  box.addEventListener("pointerleave", left);
  addEventListener("keydown", (event) => event.key === "Escape" && close());
  addEventListener("scroll", () => shown && place(), { passive: true }); // the focus itself may have moved the page
});
