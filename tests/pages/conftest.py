"""A browser for the tests of pages that compute."""

import pytest
from browsers import chromium


@pytest.fixture(scope="package")
def browser():
    with chromium() as one:
        yield one
