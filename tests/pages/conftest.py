"""A browser for the tests of pages that compute, and figures that answer opened in it."""

import pytest
from answering import ALONE, STILL, html
from browsers import chromium


@pytest.fixture(scope="package")
def browser():
    with chromium() as one:
        yield one


@pytest.fixture
def opened(browser, tmp_path):
    """open_page(name, fragment, **options) -> a page opened from a file, without a network."""
    contexts, problems = [], []

    def open_page(name: str, fragment: str = "", **options):
        path = tmp_path / f"{name}.html"
        path.write_text(ALONE.format(html=html(name), name=name, still=STILL), encoding="utf-8")
        context = browser.new_context(offline=True, **({"viewport": {"width": 900, "height": 1000}} | options))
        contexts.append(context)
        tab = context.new_page()
        tab.set_default_timeout(20_000)
        tab.on("console", lambda message: problems.append(message.text))
        tab.on("pageerror", lambda error: problems.append(str(error)))
        tab.on(
            "request", lambda one: one.url.startswith((path.as_uri(), "blob:", "data:")) or problems.append(f"loads {one.url}")
        )
        tab.goto(path.as_uri() + fragment)
        if options.get("java_script_enabled", True):
            tab.wait_for_selector(".kf-explore[data-ready]")
        return tab

    yield open_page
    for context in contexts:
        context.close()
    assert problems == []
