"""What runs through a legend is found, in the pictures that a page shows."""

import sys
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import nbformat.v4 as notebook
import numpy as np
import pytest
from IPython.core.interactiveshell import InteractiveShell

from kfcourse.pages import book_style

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "book"))
import figures

MIDDLE = {"loc": "center"}
STRIKES = {
    "a curve": lambda ax: ax.plot([0, 1], [0.5, 0.5]),
    "a curve beside a gap": lambda ax: ax.plot([0, 0.2, 0.4, 0.6], [np.nan, np.nan, 0.5, 0.5]),
    "a straight line": lambda ax: ax.axvline(0.5),
    "a point": lambda ax: ax.plot([0.5], [0.5], "o"),
    "half of a point": lambda ax: ax.plot([0.5], [0.58], "o", markersize=30),
    "a dot": lambda ax: ax.scatter([0.5], [0.5]),
    "half of a dot": lambda ax: ax.scatter([0.1, 0.5], [0.1, 0.58], [1, 900]),
    "an error bar": lambda ax: ax.errorbar([0.5], [0.1], [0.6], fmt="."),
    "a curve to the border": lambda ax: ax.plot([0.5, 0.5], [0, 1]),
    "a contour": lambda ax: ax.contour([0, 1], [0, 1], [[0, 0], [1, 1]], levels=[0.5]),
    "a step": lambda ax: ax.plot([0, 0.5, 1], [0.1, 0.9, 0.9], drawstyle="steps-post"),
    "other words": lambda ax: ax.text(0.5, 0.5, "here"),
}
LEAVES_FREE = {
    "a curve beside": lambda ax: ax.plot([0, 1], [0.2, 0.2]),
    "a gap": lambda ax: ax.plot([0, 0.2, 0.5, 0.8, 1], [0.5, 0.5, np.nan, 0.5, 0.5]),
    "nothing but gaps": lambda ax: ax.plot([0, 1], [np.nan, np.nan]),
    "points without a line": lambda ax: ax.plot([0.1, 0.9], [0.5, 0.5], "o"),
    "no point, no line": lambda ax: ax.plot([0.5], [0.5], " "),
    "dots": lambda ax: ax.scatter([0.1, 0.9, np.nan], [0.5, 0.5, 0.5]),
    "a step": lambda ax: ax.plot([0, 1], [0, 1], drawstyle="steps-post"),
    "a band": lambda ax: ax.fill_between([0, 1], 0, 1, alpha=0.2),
    "no words": lambda ax: ax.text(0.5, 0.5, ""),
    "what is not shown": lambda ax: ax.plot([0, 1], [0.5, 0.5], visible=False),
}


@pytest.fixture
def struck(monkeypatch):
    """The words that are struck in a panel with a legend, as the metadata of its picture say."""
    monkeypatch.setattr(InteractiveShell, "_instance", None)

    def found(draw, **legend):
        figure, ax = plt.subplots()
        draw(ax)
        ax.plot([], [], label="words")
        ax.set(xlim=(0, 1), ylim=(0, 1))
        ax.legend(**legend)
        _, metadata = InteractiveShell.instance().display_formatter.formatters["image/png"](figure)
        output = notebook.new_output("display_data", metadata={"image/png": metadata})
        return figures.struck(notebook.new_code_cell(outputs=[output, notebook.new_output("stream")]))

    with matplotlib.rc_context():
        book_style()
        yield found
    plt.close("all")
    InteractiveShell.clear_instance()


@pytest.mark.parametrize("draw", STRIKES.values(), ids=STRIKES)
def test_what_runs_through_a_legend_is_told(struck, draw):
    assert struck(draw, **MIDDLE) == ["words", "words (on a telephone)"]


@pytest.mark.parametrize("draw", LEAVES_FREE.values(), ids=LEAVES_FREE)
def test_what_leaves_it_free_is_not(struck, draw):
    assert struck(draw, **MIDDLE) == []


def test_a_sample_belongs_to_its_words(struck):
    assert struck(lambda ax: ax.axvline(0.45), handlelength=20, **MIDDLE) == ["words", "words (on a telephone)"]


def test_a_curve_ends_where_its_panel_does(struck):
    assert struck(lambda ax: ax.plot([0.5, 0.5], [0, 2]), loc="lower center", bbox_to_anchor=(0.5, 1)) == []
    assert struck(lambda ax: ax.plot([0.5, 0.5], [0, 2]), loc="center", bbox_to_anchor=(0.5, 1))


def test_one_that_has_less_room_is_struck_on_a_telephone_only(struck):
    assert struck(lambda ax: ax.axvline(0.43), **MIDDLE) == ["words (on a telephone)"]
