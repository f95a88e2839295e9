"""A browser for the tests of pages."""

import shutil
from contextlib import contextmanager

import pytest

from kfcourse.exercises.notebooks.execution import BROWSERS

# The suggestions of the address bar, which nobody sees here, are two pages of their own in each
# window: a CPU-second.
WITHOUT = "--disable-features=WebUIOmniboxPopup,WebUIOmniboxAimPopup"


@contextmanager
def chromium():
    """Chromium or a kin of it, without a window; skips where there is none."""
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        pytest.skip("no Chromium or Chrome on this machine")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=[WITHOUT])
        yield browser
        browser.close()


@contextmanager
def offline(browser):
    """new_tab(path, text, **options) -> a tab for the page of that text, in the file `path`, from
    which alone it may load.

    What the page complains of, or loads from elsewhere, fails the test at its end.
    """
    contexts, problems = [], []

    def new_tab(path, text, **options):
        path.write_text(text, encoding="utf-8")
        context = browser.new_context(
            offline=True, **({"viewport": {"width": 900, "height": 1000}} | options)
        )
        contexts.append(context)
        tab = context.new_page()
        tab.set_default_timeout(20_000)
        tab.on("console", lambda message: problems.append(message.text))
        tab.on("pageerror", lambda error: problems.append(str(error)))
        own = (path.as_uri(), "blob:", "data:")
        tab.on(
            "request",
            lambda request: request.url.startswith(own) or problems.append(f"loads {request.url}"),
        )
        return tab

    yield new_tab
    for context in contexts:
        context.close()
    assert problems == []
