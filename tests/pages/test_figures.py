"""The style of the figures."""

import logging

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
from IPython.core.interactiveshell import InteractiveShell
from matplotlib import font_manager
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend

from kfcourse.pages import book_style, label_ends
from kfcourse.pages.figures import FONTS


@pytest.fixture
def style(monkeypatch):
    monkeypatch.setattr(InteractiveShell, "_instance", None)  # as the first in a kernel of its own
    with matplotlib.rc_context():
        book_style()
        yield
    InteractiveShell.clear_instance()


def test_labels_are_in_the_font_of_the_pages_whatever_their_letters(style, caplog):
    assert font_manager.findfont("Source Sans 3") in map(str, FONTS)
    figure = Figure()
    ax = figure.subplots()
    ax.semilogy(
        [1e-3, 1e3],
        label=r"$\hat x_k$, $\mathsf{M}[\varepsilon^2]/\Psi$, $\mathcal{N}$, $\pm\pi/2$",
    )
    ax.set(title="погрешность ω ≤ −1 °", xlabel=r"$\lambda_k^{(i)}$, с")
    ax.legend()
    with caplog.at_level(logging.WARNING):
        FigureCanvasAgg(figure).draw()
    assert caplog.messages == []


@pytest.mark.parametrize("label", ["steps apart $l$", "step $k$ (5 ms each)"])
def test_marks_of_an_axis_that_counts_steps_are_whole_numbers(style, label):
    """Also above a shared axis; an axis of time keeps its halves, and chosen marks stay."""
    figure, axes = plt.subplots(2, sharex=True)
    other, (time, chosen) = plt.subplots(1, 2)
    for ax in (*axes, time, chosen):
        ax.plot(range(4), range(4))
    axes[1].set_xlabel(label)
    time.set_xlabel("step $T$ (s)")
    chosen.set(xlabel=label, xticks=[0.5, 2.5])
    for each in (figure, other):
        InteractiveShell.instance().display_formatter.format(each)
    marks = [ax.get_xticks() for ax in (*axes, time, chosen)]
    assert [bool((each == each.round()).all()) for each in marks] == [True, True, False, False]
    plt.close("all")


def test_labels_at_the_ends_are_apart_and_in_order():
    _, ax = plt.subplots()
    for end, name in ((1.0, "low"), (1.01, "middle"), (1.02, "high"), (5.0, "far")):
        ax.plot([0, 1], [0, end], label=name)
    label_ends(ax, least=0.1, lowest=0)
    labels = [each for each in ax.get_children() if isinstance(each, Legend)]
    heights = {
        each.get_texts()[0].get_text(): each.get_bbox_to_anchor().y0 / ax.bbox.height
        for each in labels
    }
    heights = {name: height - ax.bbox.y0 / ax.bbox.height for name, height in heights.items()}
    assert list(sorted(heights, key=heights.__getitem__)) == ["low", "middle", "high", "far"]
    assert np.diff(sorted(heights.values())).min() > 0.1 - 1e-9
    assert (
        heights["low"]
        >= ax.transAxes.inverted().transform(ax.transData.transform((0, 0)))[1] - 1e-9
    )
    plt.close()
