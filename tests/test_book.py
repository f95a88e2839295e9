"""The built book: complete, executed, and readable without a network.

`make test` builds the book first and sets KFCOURSE_BOOK=required; elsewhere a missing book skips
these tests.
"""

import itertools
import os
import re
from functools import cache
from html import unescape
from html.parser import HTMLParser
from importlib import resources
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit

import nbformat
import pytest
import yaml
from browsers import chromium
from bs4 import BeautifulSoup

ROOT = Path(__file__).resolve().parent.parent
HTML = ROOT / "_build" / "html"
EXECUTED = ROOT / "_build" / "jupyter_execute"
TOC = yaml.safe_load((ROOT / "book" / "_toc.yml").read_text(encoding="utf-8"))
CHAPTERS = [chapter for part in TOC["parts"] for chapter in part["chapters"]]
SHELF = [TOC["root"], *(chapter["file"] for chapter in CHAPTERS)]
PAGES = [
    *SHELF,
    *(section["file"] for chapter in CHAPTERS for section in chapter.get("sections", [])),
]
SOURCES = {page: ROOT / "book" / f"{page}.md" for page in SHELF}  # some are made with the book
NOTEBOOKS = [
    page
    for page, source in SOURCES.items()
    if source.exists() and "{code-cell}" in source.read_text(encoding="utf-8")
]
LOCAL = ("file:", "data:", "blob:")
LOADS = {
    "script": "src",
    "link": "href",
    "img": "src",
    "iframe": "src",
    "source": "src",
    "object": "data",
    "image": "href",
}


@pytest.fixture(autouse=True)
def built() -> None:
    if not (HTML / "index.html").exists():
        if os.environ.get("KFCOURSE_BOOK") == "required":
            pytest.fail("the book is not built, and KFCOURSE_BOOK=required; run `make book`")
        pytest.skip("the book is not built; run `make book`")


class Resources(HTMLParser):
    """Addresses of everything a page loads by itself, and of what it loads when it is opened, but
    fonts of its style sheets."""

    def __init__(self) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.opened: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        named = dict(attributes)
        address, link = named.get(LOADS.get(tag, "")), named.get("rel") if tag == "link" else None
        if address and link not in ("canonical", "license"):
            self.loads.append(address)
            if link in (None, "stylesheet", "icon") and named.get("loading") != "lazy":
                self.opened.append(address)


@cache
def loaded(page: str) -> Resources:
    parser = Resources()
    parser.feed((HTML / f"{page}.html").read_text(encoding="utf-8"))
    return parser


@pytest.mark.parametrize("page", PAGES)
def test_page_exists_and_loads_only_local_files(page: str):
    matched = loaded(page).loads
    assert matched, "no style sheet and no script: not a page of this book"
    for address in matched:
        if address.startswith("data:"):
            continue
        assert not re.match(r"([a-z]+:)?//", address), f"{page} loads {address} from the network"
        assert ((HTML / f"{page}.html").parent / re.split("[?#]", address)[0]).exists(), (
            f"{page} loads {address}, which is not there"
        )


def test_style_sheets_load_only_local_files():
    for sheet in (HTML / "_static").rglob("*.css"):
        assert not re.search(
            r"(@import\s+|url\()\s*[\"']?(https?:)?//", sheet.read_text(encoding="utf-8")
        ), sheet


@pytest.mark.parametrize(
    ("old", "new"), [("stratonovich", "course/stratonovich"), ("particles", "beyond/grid")]
)
def test_an_old_address_leads_on(old: str, new: str) -> None:
    page = (HTML / f"{old}.html").read_text(encoding="utf-8")
    assert f'location.replace("{new}.html" + location.hash)' in page


@pytest.mark.parametrize("page", NOTEBOOKS)
def test_notebook_is_executed_without_errors(page: str):
    notebook = nbformat.read(EXECUTED / f"{page}.ipynb", as_version=4)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code" and cell.source.strip()]
    assert cells
    for cell in cells:
        assert cell.execution_count, f"never executed:\n{cell.source}"
        for output in cell.outputs:
            allowed = "raises-exception" in cell.metadata.get("tags", [])
            assert output.output_type != "error" or allowed, f"{output.ename}: {output.evalue}"


def test_no_notebook_is_left_out():
    assert NOTEBOOKS
    assert {
        path.relative_to(EXECUTED).with_suffix("").as_posix() for path in EXECUTED.rglob("*.ipynb")
    } == set(NOTEBOOKS)


@pytest.fixture(scope="module")
def browser():
    with chromium() as each:
        yield each


@pytest.fixture(scope="module")
def only_tab(browser):
    """One tab for all pages, without a network, and what it complains of."""
    problems: list[str] = []
    with browser.new_context(offline=True) as context:
        tab = context.new_page()
        tab.on(
            "console",
            lambda message: (
                problems.append(message.text) if message.type in ("error", "warning") else None
            ),
        )
        tab.on("pageerror", lambda error: problems.append(str(error)))
        tab.on("requestfailed", lambda request: problems.append(f"failed: {request.url}"))
        tab.on(
            "request",
            lambda request: (
                request.url.startswith(LOCAL) or problems.append(f"external: {request.url}")
            ),
        )
        yield tab, problems


@pytest.fixture
def window(only_tab):
    """The tab, empty, and what it complained of since: what fails when a page is left is no
    complaint of the next one."""
    tab, problems = only_tab
    tab.goto("about:blank")
    problems.clear()
    return tab, problems


# What is out of sight, too (page.js).
LAY_OUT = "document.documentElement.classList.add('kf-whole'); document.body.offsetHeight"


def laid_out(tab, page) -> None:
    """Open the page, laid out to its end: what the mouse is sent to stays where it was found."""
    tab.goto((HTML / f"{page}.html").as_uri())
    tab.evaluate(LAY_OUT)


def hover(tab, link) -> None:
    """The mouse goes to the link until what it leads to is shown: on a busy machine the page may
    move under it the first time."""
    from playwright.sync_api import TimeoutError as Late

    for attempt in range(4):
        link.hover()
        try:
            return tab.locator("#kf-preview").wait_for(timeout=5_000)
        except Late:
            if attempt == 3:
                raise
            tab.mouse.move(0, 0)


# Pictures that are shown wider or higher than they are, by more than the rounding of small ones.
SQUEEZED = """() => [...document.querySelectorAll("article img")]
  .filter(e => Math.abs(e.clientWidth / e.clientHeight / (e.naturalWidth / e.naturalHeight) - 1) > 0.05).map(e => e.src)"""
# Folds with something of their cell below them, or with another fold right below; and icons that
# the theme did not get from us.
FOLDS = """() => [...document.querySelectorAll("article details.below-output")]
  .filter(e => e.nextElementSibling || e.parentElement.nextElementSibling?.querySelector(":scope > details.below-output"))
  .map(e => e.textContent)"""
ICONS = """() => [...document.querySelectorAll(".fa-solid")]
  .filter(e => getComputedStyle(e).maskImage === "none").map(e => e.outerHTML)"""
# What sticks out of the page, or out of its own box, and by how much.
FIT = """() => {
    const width = document.documentElement.clientWidth;
    const out = (selector) => [...document.querySelectorAll(selector)]
        .filter((e) => e.checkVisibility() && e.scrollWidth > e.clientWidth + 1)
        .map((e) => `${e.textContent.trim().slice(0, 60)} (+${e.scrollWidth - e.clientWidth})`);
    return {
        page: document.documentElement.scrollWidth - width,
        code: out(".cell_input pre, section > [class*=highlight-] pre"),
        boxes: out("div.math, .pst-scrollable-table-container, pre, .cell_output .output"),
        pictures: [...document.querySelectorAll(".bd-article :is(img, svg, table, mjx-math)")]
            .filter((e) => e.checkVisibility() && e.getBoundingClientRect().right > width + 1)
            .map((e) => e.outerHTML.slice(0, 80)),
    };
}"""
# Words and formulas under the mark that opens the code, which stands on the last line of what the
# code shows.
UNDER_A_MARK = """() => [...document.querySelectorAll("article details.below-output:not([open]) > summary")]
  .filter((mark) => mark.checkVisibility()).flatMap((mark) => {
    const { left, top, bottom } = mark.getBoundingClientRect(), shown = mark.parentElement.previousElementSibling;
    const all = document.createRange();
    return (shown ? [...shown.querySelectorAll(":scope > p, mjx-container > :first-child")] : []).filter((e) => {
      all.selectNodeContents(e);
      return [...all.getClientRects()].some((box) => box.right > left && box.top < bottom - 2 && box.bottom > top + 2);
    }).map((e) => e.textContent.slice(-60));
  })"""
# Set formulas wider than their column, those in folds too.
TOO_WIDE = """() => {
    const folds = [...document.querySelectorAll("article details:not([open])")];
    for (const fold of folds) fold.open = true;
    const wide = [...document.querySelectorAll("article div.math mjx-container")]
        .filter((e) => e.scrollWidth > e.clientWidth + 1)
        .map((e) => `${e.textContent.slice(0, 60)} (+${e.scrollWidth - e.clientWidth})`);
    for (const fold of folds) fold.open = false;
    return wide;
}"""
# Figures in sight whose letters of 10 pt are smaller than 10 px.
TOO_SMALL = """() => [...document.querySelectorAll("article .cell_output figure img")].filter((e) => e.checkVisibility())
    .map((e) => [e.currentSrc.slice(-30), e.clientWidth / (e.naturalWidth / 2) * 10 * 96 / 72])
    .filter(([, size]) => size < 10)"""
# Ten screens of a chapter, as it is opened, in px, and half a screen for other fonts.
LONGEST = 10_500
# A sheet of A4 less its margins, in px of CSS.
PAPER = 673
AXE = resources.files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8")
VIOLATIONS = """async (context, rules) => {
    const { violations } = await axe.run(context, { resultTypes: ["violations"], ...rules });
    const serious = violations.filter(({ impact }) => impact !== "minor");
    return serious.flatMap(({ id, impact, nodes }) => nodes.map((node) => `${impact} ${id}: ${node.html.slice(0, 200)}`));
}"""
# Thins out the page, as axe takes as long as there are elements: the insides of formulas, which
# keep their size and have no text of their own, and spans that only colour code and signatures,
# beyond those marked.  A few texts of each kind are marked, on all pages of the tab together: what
# has the same colours, in both themes, and the same size has the same contrast.
THIN = """(themes) => {
    const formulas = [...document.querySelectorAll("mjx-container")].map((e) => [e, e.getBoundingClientRect()]);
    for (const [e, { width, height }] of formulas) {
        Object.assign(e.style, { display: "inline-block", width: `${width}px`, height: `${height}px` });
        e.replaceChildren();
    }
    const texts = [...document.body.querySelectorAll("*")]
        .filter((e) => [...e.childNodes].some((node) => node.nodeType === Node.TEXT_NODE && node.data.trim()));
    const looks = new Map(texts.map((e) => [e, ""]));
    for (const theme of themes) {
        document.documentElement.dataset.theme = document.documentElement.dataset.mode = theme;
        const under = new Map([[null, ""]]);  // all that is painted under an element's text
        const ground = (e) => {
            if (!under.has(e)) {
                const { backgroundColor, backgroundImage, opacity } = getComputedStyle(e);
                const own = `${backgroundColor} ${backgroundImage} ${opacity}`.replace("rgba(0, 0, 0, 0) none 1", "");
                under.set(e, [ground(e.parentElement), own].filter(Boolean).join("; "));
            }
            return under.get(e);
        };
        for (const e of texts) {
            const { color, fontSize, fontWeight, textShadow } = getComputedStyle(e), link = e.closest("a");
            const around = link ? getComputedStyle(link.parentElement).color : "";  // what a link differs from
            looks.set(e, [looks.get(e), color, around, fontSize, fontWeight, textShadow, ground(e)].join("; "));
        }
    }
    const seen = JSON.parse(sessionStorage.seen ?? "{}");
    for (const [e, look] of looks) {
        if (!e.checkVisibility()) continue;
        seen[look] = (seen[look] ?? 0) + 1;
        if (seen[look] <= 2) e.dataset.marked = true;
    }
    for (const e of document.querySelectorAll("pre span, .sig span")) {
        if (e.querySelector("[data-marked], a") || e.getAttributeNames().join() !== "class") continue;
        e.replaceWith(e.closest("pre") ? e.textContent : "");
    }
    sessionStorage.seen = JSON.stringify(seen);
}"""
# Blocks of an article without a marked text keep their size alone, where contrast is all that is
# asked: axe places every element of the page, for each theme. What has parts out of the flow, which
# may lie over a marked text, stays whole.
ONLY_MARKED = """() => {
    const blocks = [], flows = (e) => ["static", "relative"].includes(getComputedStyle(e).position);
    const visit = (e) => {
        if (e.matches("[data-marked]") || e.querySelector("[data-marked]")) [...e.children].forEach(visit);
        else if (getComputedStyle(e).display === "block" && [e, ...e.querySelectorAll("*")].every(flows)) blocks.push(e);
        else [...e.children].forEach(visit);
    };
    document.querySelectorAll("article").forEach(visit);
    for (const [e, { width, height }] of blocks.map((e) => [e, e.getBoundingClientRect()])) {
        Object.assign(e.style, { boxSizing: "border-box", width: `${width}px`, height: `${height}px` });
        e.replaceChildren();
    }
}"""
THEMES = ["light", "dark"]
COLOURS = ["color-contrast", "link-in-text-block"]
# has formulas and code of all kinds, and is looked at before it is thinned out, too
WHOLE = "course/stratonovich"
AUDIT = (
    f"(colours) => ({VIOLATIONS})(document, {{ rules: Object.fromEntries(colours.map((id) => [id, "
    f"{{ enabled: false }}])) }})"
)
CONTRAST = f"""([theme, colours]) => {{
    document.documentElement.dataset.theme = document.documentElement.dataset.mode = theme;
    const include = [...document.querySelectorAll("[data-marked]")];
    return include.length ? ({VIOLATIONS})({{ include }}, {{ runOnly: colours }}) : [];
}}"""


def show_on(tab, media: str, width: int) -> None:
    """Lay the page out for another medium and width: once, as it is hidden while they change."""
    tab.evaluate("document.body.style.contentVisibility = 'hidden'")
    tab.emulate_media(media=media)
    tab.set_viewport_size({"width": width, "height": 1000})
    # colours of a theme, not those on the way to it
    tab.add_style_tag(content="* { transition: none !important; }")
    tab.evaluate("document.body.style.contentVisibility = ''")


# One page of each kind is looked at with every change, all of them every night.
KINDS = [
    "intro",
    WHOLE,
    "course/comparison",
    "course/consistency",
    "manual/b-aof",
    "reference/glossary",
    "package/kfcourse.filters",
    "search",
    "404",
]
OTHERS = [
    pytest.param(page, marks=pytest.mark.slow)
    for page in (*PAGES, "genindex", "py-modindex")
    if page not in KINDS
]


@pytest.mark.parametrize("page", [*KINDS, *OTHERS])
def test_page_in_a_browser_without_network(window, page: str):
    """Loads without a complaint; fits screens and paper; axe-core finds nothing, light and dark;
    code is folded."""
    tab, problems = window
    path = HTML / f"{page}.html"
    tab.set_viewport_size({"width": 390, "height": 1000})
    tab.goto(path.as_uri(), wait_until="load")
    tab.evaluate(LAY_OUT)
    tab.evaluate("for (const picture of document.images) picture.loading = 'eager'")
    tab.wait_for_function("[...document.images].every((picture) => picture.complete)")
    tab.wait_for_load_state("networkidle")
    assert problems == []

    assert tab.evaluate(FOLDS) == [], "code folded away twice in a row, or above what it shows"
    assert tab.evaluate(ICONS) == [], "an icon that _static/icons.css does not draw"

    if page in NOTEBOOKS:
        assert tab.evaluate(TOO_SMALL) == [], (
            "letters in figures too small to be read on a telephone"
        )
    for width in (390, 768):
        tab.set_viewport_size({"width": width, "height": 1000})
        assert tab.evaluate(FIT)["page"] <= 0, f"the page scrolls sideways at {width} px"
        assert tab.evaluate(SQUEEZED) == [], f"pictures out of proportion at {width} px"
    show_on(tab, "print", PAPER)
    printed = tab.evaluate(FIT)
    assert printed["boxes"] == [] and printed["pictures"] == [], "cut on paper"
    show_on(tab, "screen", 1280)
    wide = tab.evaluate(FIT)
    assert wide["page"] <= 0 and wide["code"] == [], "at 1280 px a page scrolls, or a code cell"
    if page in NOTEBOOKS:
        assert tab.evaluate("document.querySelector('article').scrollHeight") <= LONGEST, (
            "fold what a first reader may pass over"
        )
    assert tab.evaluate(UNDER_A_MARK) == [], "the mark of the code lies on text"
    assert tab.evaluate(TOO_WIDE) == [], (
        "a formula scrolls sideways at 1280 px: break it, or name its parts"
    )
    tab.evaluate(AXE)
    whole = tab.evaluate(AUDIT, COLOURS) if page == WHOLE else []
    tab.evaluate(THIN, THEMES)
    whole += tab.evaluate(AUDIT, COLOURS)
    tab.evaluate(ONLY_MARKED)
    assert [
        *whole,
        *itertools.chain(*(tab.evaluate(CONTRAST, [theme, COLOURS]) for theme in THEMES)),
    ] == []


def test_the_keyboard_reaches_the_text_first(window):
    tab, _ = window
    tab.goto((HTML / "course/linearisation.html").as_uri())
    tab.keyboard.press("Tab")
    assert tab.evaluate("document.activeElement.getAttribute('href')") == "#main-content"
    assert tab.evaluate("document.activeElement.checkVisibility()")
    assert tab.locator("main#main-content").count() == 1
    formulas = tab.locator("div.math")
    assert (
        formulas.count()
        == tab.locator("div.math mjx-container[tabindex='0'][aria-label]").count()
        > 0
    )


def test_a_reference_shows_what_it_leads_to(window):
    """Under the mouse and on the keyboard's way, not under a finger; Escape closes it, and the link
    stays a link."""
    tab, problems = window
    show_on(tab, "screen", 1280)
    laid_out(tab, "course/comparison")
    box = tab.locator("#kf-preview")
    formula = tab.locator('article a.reference.internal[href^="#equation-"]').first
    figure = tab.locator('article a.reference.internal[href^="#fig-"]').first
    hover(tab, formula)
    box.locator("mjx-container").wait_for()
    assert "#" not in box.inner_text()  # the mark beside a number, which is a link
    tab.keyboard.press("Escape")
    assert not box.is_visible()
    tab.mouse.move(0, 0)  # or it enters what the focus, as it moves the page, brings under it
    figure.focus()
    tab.keyboard.press("Shift+Tab")
    tab.keyboard.press("Tab")
    assert box.locator("img").is_visible()
    assert figure.get_attribute("aria-describedby") == "kf-preview"
    assert (
        tab.evaluate("new Set([...document.querySelectorAll('[id]')].map((e) => e.id)).size")
        == tab.locator("[id]").count()
    )
    left, right = box.evaluate(
        "e => [e.getBoundingClientRect().left, e.getBoundingClientRect().right]"
    )
    assert 0 <= left < right <= 1280
    tab.keyboard.press("Escape")
    assert not box.is_visible() and figure.get_attribute("aria-describedby") is None
    figure.dispatch_event("pointerenter", {"pointerType": "touch"})
    tab.wait_for_timeout(300)  # twice as long as the mouse has to wait
    assert not box.is_visible()
    figure.click()
    assert urlsplit(tab.url).fragment.startswith("fig-")
    assert problems == []


def test_a_link_to_what_is_folded_opens_the_fold(window):
    """From another page, and on the same one; on paper all is open (below)."""
    tab, problems = window
    show_on(tab, "screen", 1280)
    page, name = (HTML / "beyond/literature.html").as_uri(), "fig-literature-bearings"
    tab.goto(page)
    folds = tab.locator("details.kf-more")
    assert folds.count() == 4 and not any(folds.evaluate_all("all => all.map((e) => e.open)"))
    assert not tab.locator(f"#{name}").is_visible()
    tab.evaluate("name => { location.hash = name; }", name)
    tab.locator(f"#{name}").wait_for()
    assert problems == []
    tab.goto("about:blank")
    # pictures or the page's icon, asked for and not there yet when the page was left
    problems.clear()
    tab.goto(f"{page}#{name}")
    tab.locator(f"#{name}").wait_for()
    assert folds.evaluate_all("all => all.map((e) => e.open)") == [False, False, True, False]
    assert problems == []


@pytest.mark.parametrize("page", PAGES)
def test_figures_are_counted_on_their_page(page):
    """By the chapter's number and theirs, or from one where a page has no number."""
    text = (HTML / f"{page}.html").read_text(encoding="utf-8")
    chapter = re.search(r"<title>(\d+)\. ", text)
    counted = re.findall(r'caption-number">Figure ([\d.]+?)\.? ?<', text)
    assert counted == [
        f"{chapter[1]}.{place}" if chapter else f"{place}" for place in range(1, len(counted) + 1)
    ]


# How far an element is from the upper edge of what may be read: asked until it stays there, or for
# ten seconds.
COME_TO_REST = """(name) => new Promise((rest) => {
    let there = 0, asked = 0;
    const ask = () => {
        const padding = parseFloat(getComputedStyle(document.documentElement).scrollPaddingTop);
        const off = document.getElementById(name).getBoundingClientRect().top - padding;
        there = Math.abs(off) < 3 ? there + 1 : 0;
        if (there === 3 || ++asked === 50) rest(off); else setTimeout(ask, 200);
    };
    ask();
})"""


@pytest.mark.parametrize("page", ["course/comparison", "manual/b-aof"])
def test_contents_on_a_telephone(browser, page):
    """They cover the text, a link closes them, and it arrives."""
    with browser.new_context(offline=True, viewport={"width": 390, "height": 844}) as context:
        tab = context.new_page()
        tab.goto((HTML / f"{page}.html").as_uri())
        tab.locator(".secondary-toggle").click()
        drawer = tab.locator("#pst-secondary-sidebar-modal")
        assert drawer.evaluate("e => getComputedStyle(e).backgroundColor") == "rgb(255, 255, 255)"
        link = tab.locator("#pst-page-toc-nav > ul > li > a").nth(-2)
        link.click()
        assert abs(tab.evaluate(COME_TO_REST, urlsplit(link.get_attribute("href")).fragment)) < 3
        assert not drawer.is_visible()


@pytest.mark.parametrize("page", [WHOLE, "course/comparison", "manual/r-loop"])
def test_a_formula_stays_with_its_comma(page):
    """And with its bracket: no text that begins behind a formula begins with a mark."""
    html = BeautifulSoup((HTML / f"{page}.html").read_text(encoding="utf-8"), "html.parser")
    alone = [
        formula
        for formula in html.select("article span.math")
        if "kf-together" not in formula.parent.get("class", [])
    ]
    assert alone and html.select("article .kf-together > span.math")
    for formula in alone:
        before, after = formula.previous_sibling, formula.next_sibling
        assert not (isinstance(after, str) and re.match(r"[,.;:!?)\]]", after)), after
        assert not (isinstance(before, str) and re.search(r"[(\[]$", before)), before


def test_formulas_are_there_without_scripts(browser):
    """All of them, set and with fonts of the book, displayed ones on the keyboard's way."""
    with browser.new_context(offline=True, java_script_enabled=False) as context:
        tab = context.new_page()
        tab.goto((HTML / f"{WHOLE}.html").as_uri())
        assert (
            tab.locator(".math").count()
            == tab.locator(".math > mjx-container > mjx-math").count()
            > 100
        )
        assert (
            tab.locator("div.math").count()
            == tab.locator("div.math > mjx-container[tabindex='0'][aria-label]").count()
        )
        box = tab.locator("div.math mjx-math").first.bounding_box()
        assert box["width"] > 100 and box["height"] > 10


def weight(page: str) -> int:
    """Bytes that a page loads when it is opened, but fonts of its style sheets."""
    path = HTML / f"{page}.html"
    named = [name for name in loaded(page).opened if not name.startswith("data:")]
    files = {path, *((path.parent / re.split("[?#]", name)[0]).resolve() for name in named)}
    return sum(file.stat().st_size for file in files if file.is_file())


def test_pages_are_light():
    """Half of them below 2 MB, fonts and formulas included, and none above 3."""
    weights = sorted((weight(page), page) for page in PAGES)
    assert weights[len(weights) // 2][0] < 2_000_000 and weights[-1][0] < 3_000_000, weights[-10:]


@pytest.mark.slow
def test_hints_are_open_on_paper_and_the_code_of_pictures_is_not_there(window):
    tab, _ = window
    tab.goto((HTML / "manual/b-aof.html").as_uri())
    closed = (
        "() => [...document.querySelectorAll('article details:not(.kf-code)')].map((e) => e.open)"
    )
    assert not any(tab.evaluate(closed))
    tab.evaluate("addEventListener('beforeprint', () => { window.atPrint = (" + closed + ")(); })")
    tab.pdf()
    at_print = tab.evaluate("window.atPrint")
    assert len(at_print) > 3 and all(at_print)
    assert not any(tab.evaluate(closed)), "closed again on the screen"
    show_on(tab, "print", PAPER)
    assert (
        tab.locator("details.kf-code").count() == 1
        and not tab.locator("details.kf-code").is_visible()
    )


@pytest.mark.parametrize("page", NOTEBOOKS)
def test_the_number_of_verified_equations_leads_to_them(page):
    matched = re.search(
        r'class="kf-count" href="([^"#]*equations[^"#]*.html)#([^"]+)"',
        (HTML / f"{page}.html").read_text(encoding="utf-8"),
    )
    if matched:
        assert f'id="{matched[2]}"' in (HTML / page).parent.joinpath(matched[1]).read_text(
            encoding="utf-8"
        )


def displayed(page: str) -> list[str]:
    """The displayed formulas of a page in the letters of their MathML, without what only aligns or
    numbers them."""
    matched = re.findall(
        r'<math display="block".*?</math>',
        (HTML / f"{page}.html").read_text(encoding="utf-8"),
        re.DOTALL,
    )
    return [
        "".join(unescape(each).strip() for each in re.split("<[^>]*>", formula))
        for formula in matched
    ]


def test_the_pages_of_all_equations_have_them_all():
    """Whether typed, verified, or printed from the package: numbered or not."""
    known = set(displayed("reference/equations")) | set(displayed("reference/equations-beyond"))
    assert [
        (page, each) for page in NOTEBOOKS for each in displayed(page) if each not in known
    ] == []
    assert any("Lk+1=Cov(" in each for each in known)  # of the modified filter of optimal structure
    assert len(known) > 250


def test_a_chapter_is_downloaded_as_a_notebook(window):
    tab, _ = window
    tab.goto((HTML / "course/ten-minutes.html").as_uri())
    with tab.expect_download() as started:
        tab.get_by_role("link", name="notebook").click()
    notebook = nbformat.read(started.value.path(), as_version=4)
    nbformat.validate(notebook)
    assert started.value.suggested_filename == "ten-minutes.ipynb"
    text = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    assert text.startswith("# Ten minutes") and not re.search(
        r"\{[a-z.][\w:-]*\}|^:\w+:", text, re.MULTILINE
    ), "words only the book knows"
    code = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    assert code == [
        cell.source
        for cell in nbformat.read(EXECUTED / "course" / "ten-minutes.ipynb", 4).cells
        if cell.cell_type == "code"
    ]


@pytest.mark.parametrize(
    ("words", "page", "section"),
    [
        ("stratonovich equation", "course/stratonovich.html", ""),
        ("variant 53 Russian report", "sample-report.html", ""),
        ("что такое невязки", "reference/glossary.html", "term-innovation"),  # which says "невязка"
        (
            "what is the DUOF",
            "reference/glossary.html",
            "term-two-step-conditionally-optimal-filter",
        ),
        ("why does the EKF diverge", "reference/glossary.html", "term-extended-kalman-filter"),
        ("alpha-beta", "course/radar-tracking.html", "experiment-1-kalman-against-alpha-beta"),
        ("likelihood", "beyond/what-the-data-say.html", "likelihood-from-innovations"),
        ("smooth_iterated", "package/kfcourse.records.html", "module-kfcourse.records.smoothing"),
    ],
)
def test_search_finds_sections_and_quotes_them(window, words, page, section):
    """Among the best five; each quoted, the words marked, and led to a page that is there."""
    tab, problems = window
    tab.goto((HTML / "search.html").as_uri() + f"?q={quote(words)}")
    rows = tab.locator("#search-results li")
    rows.first.wait_for()
    matched = [
        urlsplit(address)
        for address in rows.locator("a").evaluate_all("links => links.map((link) => link.href)")
    ]
    assert (page, section) in [
        (place.path.partition("/html/")[2], place.fragment) for place in matched[:5]
    ]
    assert all((HTML / unquote(place.path).partition("/html/")[2]).exists() for place in matched)
    assert all(row.locator("p").inner_text() for row in rows.all()[:5])
    # of five: not where only a title has the words
    assert tab.locator("#search-results mark").count() > 1
    assert problems == []


def test_the_address_of_a_chapter_that_another_has_taken_in(window):
    """It leads on, to the same section."""
    tab, _ = window
    tab.goto(f"{(HTML / 'derive-it.html').as_uri()}#derive-it")
    tab.wait_for_url("**/live-lab.html#derive-it")
    assert tab.locator("#derive-it h2").count() == 1


def test_an_address_that_does_not_exist(window):
    tab, _ = window
    tab.goto((HTML / "404.html").as_uri())
    links = tab.locator("nav a")
    assert links.count() == len(SHELF) - 1
    for address in links.evaluate_all("links => links.map((link) => link.href)"):
        assert Path(unquote(urlsplit(address).path)).exists(), address


@pytest.mark.parametrize("page", ["intro", "course/stratonovich", "manual/b-aof"])
def test_descriptions_and_icon(page):
    head = (HTML / f"{page}.html").read_text(encoding="utf-8").split("</head>")[0]
    for name in ("description", "og:title", "og:description", "og:type"):
        assert len(re.findall(rf'<meta (?:name|property)="{name}" content="[^"]', head)) == 1, name
    assert len(re.findall(r'<link [^>]*rel="[^"]*\bicon"', head)) == 1
