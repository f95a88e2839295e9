"""The style of the figures."""

import logging

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
from IPython.core.interactiveshell import InteractiveShell
from matplotlib import font_manager
from matplotlib.figure import Figure

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
    ax.semilogy([1e-3, 1e3], label=r"$\hat x_k$, $\mathsf{M}[\varepsilon^2]/\Psi$, $\mathcal{N}$, $\pm\pi/2$")
    ax.set(title="погрешность ω ≤ −1 °", xlabel=r"$\lambda_k^{(i)}$, с")
    ax.legend()
    with caplog.at_level(logging.WARNING):
        figure.canvas.draw()
    assert caplog.messages == []


def test_labels_at_the_ends_are_apart_and_in_order() -> None:
    _, ax = plt.subplots()
    for end, name in ((1.0, "low"), (1.01, "middle"), (1.02, "high"), (5.0, "far")):
        ax.plot([0, 1], [0, end], label=name)
    label_ends(ax, least=0.1)
    heights = {text.get_text(): text.get_position()[1] for text in ax.texts}
    assert list(sorted(heights, key=heights.__getitem__)) == ["low", "middle", "high", "far"]
    assert np.diff(sorted(heights.values())).min() > 0.1 - 1e-9
    plt.close()
