"""The built book: complete, executed, and readable without a network.

`make test` builds the book first and sets KFCOURSE_BOOK=required; elsewhere a missing book skips these tests.
"""

from __future__ import annotations

import os
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import nbformat
import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent
HTML = ROOT / "_build" / "html"
EXECUTED = ROOT / "_build" / "jupyter_execute"
TOC = yaml.safe_load((ROOT / "book" / "_toc.yml").read_text(encoding="utf-8"))
PAGES = [TOC["root"], *(chapter["file"] for part in TOC["parts"] for chapter in part["chapters"])]
NOTEBOOKS = [page for page in PAGES if "{code-cell}" in (ROOT / "book" / f"{page}.md").read_text(encoding="utf-8")]
BROWSER = next(filter(None, map(shutil.which, ("chromium", "google-chrome", "chromium-browser"))), None)
LOCAL = ("file:", "data:", "blob:")
LOADS = {"script": "src", "link": "href", "img": "src", "iframe": "src", "source": "src", "object": "data", "image": "href"}


@pytest.fixture(autouse=True)
def built() -> None:
    if not (HTML / "index.html").exists():
        if os.environ.get("KFCOURSE_BOOK") == "required":
            pytest.fail("the book is not built, and KFCOURSE_BOOK=required; run `make book`")
        pytest.skip("the book is not built; run `make book`")


class Resources(HTMLParser):
    """Addresses of everything a page loads by itself."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        address = dict(attributes).get(LOADS.get(tag, ""))
        if address and not (tag == "link" and dict(attributes).get("rel") in ("canonical", "license")):
            self.found.append(address)


@pytest.mark.parametrize("page", PAGES)
def test_page_exists_and_loads_only_local_files(page: str) -> None:
    path = HTML / f"{page}.html"
    parser = Resources()
    parser.feed(path.read_text(encoding="utf-8"))
    assert parser.found, "no style sheet and no script: not a page of this book"
    for address in parser.found:
        if address.startswith("data:"):
            continue
        assert not re.match(r"([a-z]+:)?//", address), f"{page} loads {address} from the network"
        assert (path.parent / re.split("[?#]", address)[0]).exists(), f"{page} loads {address}, which is not there"


def test_style_sheets_load_only_local_files() -> None:
    for sheet in (HTML / "_static").rglob("*.css"):
        assert not re.search(r"(@import\s+|url\()\s*[\"']?(https?:)?//", sheet.read_text(encoding="utf-8")), sheet


@pytest.mark.parametrize("page", NOTEBOOKS)
def test_notebook_is_executed_without_errors(page: str) -> None:
    notebook = nbformat.read(EXECUTED / f"{page}.ipynb", as_version=4)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code" and cell.source.strip()]
    assert cells
    for cell in cells:
        assert cell.execution_count, f"never executed:\n{cell.source}"
        for output in cell.outputs:
            allowed = "raises-exception" in cell.metadata.get("tags", [])
            assert output.output_type != "error" or allowed, f"{output.ename}: {output.evalue}"


def test_no_notebook_is_left_out() -> None:
    assert NOTEBOOKS
    assert {path.relative_to(EXECUTED).with_suffix("").as_posix() for path in EXECUTED.rglob("*.ipynb")} == set(NOTEBOOKS)


@pytest.fixture(scope="module")
def browser():
    if BROWSER is None:
        pytest.skip("no Chromium or Chrome on this machine")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER)
        yield browser
        browser.close()


@pytest.mark.parametrize("page", PAGES)
def test_page_in_a_browser_without_network(browser, page: str) -> None:
    path = HTML / f"{page}.html"
    problems: list[str] = []
    with browser.new_context(offline=True) as context:
        tab = context.new_page()
        tab.on("console", lambda message: problems.append(message.text) if message.type in ("error", "warning") else None)
        tab.on("pageerror", lambda error: problems.append(str(error)))
        tab.on("requestfailed", lambda request: problems.append(f"failed: {request.url}"))
        tab.on("request", lambda request: request.url.startswith(LOCAL) or problems.append(f"external: {request.url}"))
        tab.goto(path.as_uri(), wait_until="load")
        if 'class="math' in path.read_text(encoding="utf-8"):
            tab.wait_for_function("window.MathJax?.startup?.promise")
            tab.evaluate("MathJax.startup.promise")
            assert tab.locator("mjx-container").count() > 0
            assert tab.locator("mjx-merror, [data-mjx-error]").count() == 0, "a formula that MathJax cannot read"
        tab.wait_for_load_state("networkidle")
    assert problems == []


def test_the_live_chapter_prints_what_its_page_shows(browser):
    notebook = nbformat.read(EXECUTED / "live-track.ipynb", as_version=4)
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    printed = "\n".join(output.text for output in outputs if output.output_type == "stream")
    with browser.new_context(offline=True) as context:
        tab = context.new_page()
        tab.clock.install(time=0)  # time stands still but for run_for(ms)
        tab.goto((HTML / "live-track.html").as_uri())
        tab.clock.pause_at(1000)
        tab.get_by_role("button", name="Play the recorded track").press("Enter")
        tab.clock.run_for(60_000)
        for name in ("noisy", "filtered", "inside", "nis"):
            value = tab.locator(f"[data-show={name}-all]").inner_text()
            assert re.search(rf"^{name} +{re.escape(value)}$", printed, re.MULTILINE), (name, value, printed)
