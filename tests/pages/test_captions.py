"""What a caption says of a picture is compared with the picture."""

import json
import sys
from pathlib import Path

import nbformat.v4 as notebook
import pytest
from matplotlib.figure import Figure

from kfcourse.pages.captions import contradicted, drawn

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "book"))
import figures

pytestmark = pytest.mark.quick

RIGHT = [
    "The DUOF (orange) rises, the dashed bound stays.",
    "Two panels. Left, the error of the DUOF (orange); right, a grey dotted gain over the frequency.",
    "Left: error. Right: gain at each frequency (dotted).",
    "The error (left) and the gain (right).",
    "The DUOF rises, from below the dashed bound; that of the DUOF (orange) lies below the bound.",
]
WRONG = [
    "The DUOF (blue) rises.",
    "The solid bound stays.",
    "The bound filter (orange, dashed) stays.",
    "A green curve stays.",
    "Three panels.",
    "Left, the error; right, a dashed gain.",
    "Left: gain at each frequency. Right: error.",
    "The gain (left) and the error (right).",
    "The DUOF falls.",
    "Left, the error. Left, the gain (dotted).",
    "The orange curve falls.",
    "The DUOF lies far above the bound.",
    "The dashed line stays below the orange one.",
]


@pytest.fixture(scope="module")
def panels():
    figure = Figure()
    left, right = figure.subplots(1, 2)
    left.plot([1, 2], color="#D55E00", label="DUOF")
    left.plot([2, 2], "--", color="#000000", label="bound")
    left.set(title="error", xlabel="step $k$")
    right.plot([1, 2], ":", color="#999999")
    right.set(ylabel="gain", xlabel="frequency, rad a step")
    return json.loads(json.dumps(drawn(figure)))  # as a notebook keeps it


@pytest.mark.parametrize("words", RIGHT)
def test_what_is_seen_may_be_said(panels, words):
    assert contradicted(words, panels) == []


@pytest.mark.parametrize("words", WRONG)
def test_what_is_not_seen_may_not(panels, words):
    assert contradicted(words, panels) != []


def test_of_a_figure_above_another_too():
    figure = Figure()
    above, below = figure.subplots(2, 1)
    above.set_title("$k=1$")
    below.set_title("$k=2$")
    assert contradicted("Who leads at $k=1$ (above) and $k=2$ (below).", drawn(figure)) == []
    assert contradicted("Who leads at $k=2$ (above) and $k=1$ (below).", drawn(figure)) != []


def test_a_paragraph_about_one_figure_is_compared_with_it(panels):
    both = {"fig-errors": panels, "fig-gains": panels}
    said = notebook.new_markdown_cell("Rest.\n\nIn {numref}`fig-errors` the green DUOF falls.")
    assert len(list(figures.wrong(said, both))) == 2
    for text in (
        "In {numref}`fig-other` the green DUOF falls.",
        "{numref}`fig-errors` and {numref}`fig-gains`: green.",
        "Green.",
    ):
        assert list(figures.wrong(notebook.new_markdown_cell(text), both)) == []
