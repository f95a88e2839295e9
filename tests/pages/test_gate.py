"""The checks of the chapters stop the build: with one sign changed, a chapter fails where it prints the equation."""

from __future__ import annotations

from pathlib import Path

import jupytext
import pytest
from matplotlib import pyplot as plt

from kfcourse.pages import Unverified

BOOK = Path(__file__).resolve().parents[2] / "book"

# One change in each chapter that derives something.
CHANGES = {
    "structural-functions": ("a.diff(x) ** 2 * p + a.diff(v) ** 2", "a.diff(x) ** 2 * p - a.diff(v) ** 2"),
}


@pytest.mark.parametrize("chapter", CHANGES)
def test_a_changed_sign_stops_the_chapter(chapter: str, monkeypatch: pytest.MonkeyPatch) -> None:
    right, wrong = CHANGES[chapter]
    text = (BOOK / f"{chapter}.md").read_text(encoding="utf-8")
    assert text.count(right) == 1, "the line to be changed has gone, or is there twice: choose another"
    monkeypatch.setattr(plt, "show", lambda: plt.close("all"))
    with pytest.raises(Unverified):
        run(text.replace(right, wrong))


def run(chapter: str) -> None:
    """Execute the code of a chapter."""
    names: dict = {}
    for cell in jupytext.reads(chapter, fmt="md:myst").cells:
        if cell.cell_type == "code":
            exec(cell.source, names)
