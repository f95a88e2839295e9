"""A browser for the tests of pages."""

import shutil
from contextlib import contextmanager

import pytest

from kfcourse.notebooks.execution import BROWSERS


@contextmanager
def chromium():
    """Chromium or a kin of it, without a window; skips where there is none."""
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        pytest.skip("no Chromium or Chrome on this machine")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path)
        yield browser
        browser.close()
