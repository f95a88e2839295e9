// Light or dark from the first line on: the theme decides once the page is there, and then all of it would get its style anew.
const documentRoot = document.documentElement;
if (documentRoot.dataset.theme === "auto") documentRoot.dataset.theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";

// Sections out of sight are not laid out (book.css), so nobody knows yet how high they are.  Who comes to a place, or comes back
// to one, needs the heights of all above it: then the whole page is laid out.
const whole = () => documentRoot.classList.add("kf-whole");
if (location.hash || performance.getEntriesByType("navigation")[0]?.type !== "navigate") whole();
addEventListener("click", (event) => event.target.closest?.('a[href*="#"]') && whole(), { capture: true });
addEventListener("hashchange", () => { // without a click
  if (documentRoot.matches(".kf-whole")) return;
  whole();
  document.getElementById(decodeURIComponent(location.hash.slice(1)))?.scrollIntoView();
});

// The contents at the right show where the reader is: the last section that has come to the upper part of the screen.
addEventListener("DOMContentLoaded", () => {
  const links = document.querySelectorAll("#pst-page-toc-nav a"), here = new Set();
  const mark = (changes) => {
    for (const { target, isIntersecting } of changes) isIntersecting ? here.add(target.id) : here.delete(target.id);
    const last = [...links].filter((link) => here.has(decodeURIComponent(link.hash.slice(1)))).pop();
    const above = last?.closest("ul ul")?.previousElementSibling; // the section that it is part of
    for (const link of links) link.classList.toggle("active", link === last || link === above);
  };
  const seen = new IntersectionObserver(mark, { rootMargin: "-20% 0px -79%" });
  for (const link of links) seen.observe(document.getElementById(decodeURIComponent(link.hash.slice(1))));
});

// On a narrow screen the contents lie over the page, as a dialog: a link in it leads to the page below.
addEventListener("DOMContentLoaded", () => {
  const drawer = document.getElementById("pst-secondary-sidebar-modal");
  drawer?.addEventListener("click", (event) => event.target.closest("a") && drawer.close());
});

// Who turns back, far down a page, may want its top; the theme shows the button where there is no room for the contents.
addEventListener("DOMContentLoaded", () => {
  const top = document.getElementById("pst-back-to-top");
  let before = scrollY;
  addEventListener("scroll", () => {
    top.style.display = scrollY < before && scrollY > innerHeight ? "block" : "none";
    before = scrollY;
  });
  top.addEventListener("click", () => scrollTo(0, 0));
});

// What is wider than its box, the keyboard reaches and scrolls: asked once it is laid out, as sections out of sight are not.
addEventListener("DOMContentLoaded", () => {
  const measured = new ResizeObserver((changes) => {
    for (const { target: e } of changes) e.tabIndex = e.scrollWidth > e.clientWidth || e.scrollHeight > e.clientHeight ? 0 : -1;
  });
  const boxes = "pre, .cell_output > .output, .pst-scrollable-table-container";
  for (const box of document.querySelectorAll(boxes)) measured.observe(box);
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
