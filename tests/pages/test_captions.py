"""What a caption says of a picture is compared with the picture."""

import json

import pytest
from matplotlib.figure import Figure

from kfcourse.pages.captions import contradicted, drawn

pytestmark = pytest.mark.quick

RIGHT = [
    "The DUOF (orange) falls, the dashed bound stays.",
    "Two panels. Left, the error of the DUOF (orange); right, a grey dotted gain over the frequency.",
    "Left: error. Right: gain at each frequency (dotted).",
    "The error (left) and the gain (right).",
]
WRONG = [
    "The DUOF (blue) falls.",
    "The solid bound stays.",
    "The bound filter (orange, dashed) stays.",
    "A green curve falls.",
    "Three panels.",
    "Left, the error; right, a dashed gain.",
    "Left: gain at each frequency. Right: error.",
    "The gain (left) and the error (right).",
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
