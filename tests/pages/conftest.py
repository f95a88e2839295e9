"""A browser for the tests of pages that compute, and figures that answer opened in it."""

import sys
from pathlib import Path

import pytest
from answering import ALONE, STILL, html
from browsers import chromium, offline

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "book"))  # its extensions and its gate


@pytest.fixture(scope="package")
def browser():
    with chromium() as started:
        yield started


@pytest.fixture
def opened(browser, tmp_path):
    """open_page(name, fragment, **options) -> a page opened from a file, without a network."""
    with offline(browser) as new_tab:

        def open_page(name: str, fragment: str = "", **options):
            path = tmp_path / f"{name}.html"
            tab = new_tab(path, ALONE.format(html=html(name), name=name, still=STILL), **options)
            tab.goto(path.as_uri() + fragment)
            if options.get("java_script_enabled", True):
                tab.wait_for_selector(".kf-explore[data-ready]")
            return tab

        yield open_page
