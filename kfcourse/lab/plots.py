"""Figures of the lab: functions (result, ax) -> ax, with one colour and one name for each
filter."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from kfcourse.lab.families import WORDS, look
from kfcourse.lab.short_names import entry, title
from kfcourse.montecarlo.comparison import Comparison
from kfcourse.montecarlo.modes import Recognised
from kfcourse.montecarlo.statistics import Estimate

ENGLISH = WORDS["en"]
DASHES = {"linearised": "--", "unscented": ":", "gauss-hermite": "-.", "averaged": ":"}


def style(name: str) -> dict[str, Any]:
    """Line style of a filter: colour and marker by family, dashes by structural functions, black
    for the exact."""
    known = entry(name)
    colour, marker = ("black", "*") if known.functions == "exact" else look(name)
    return {
        "color": colour,
        "linestyle": DASHES.get(known.functions, "-"),
        "marker": marker,
        "label": known.title,
    }


def _labelled(ax: Axes, ylabel: str, words: Mapping[str, str] = ENGLISH) -> Axes:
    """Axes of steps, which are whole numbers, with their legend."""
    ax.set_xlabel(words["axis_step"])
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_ylabel(ylabel)
    ax.legend(fontsize="small", ncols=2)
    return ax


def _curve(
    ax: Axes,
    name: str,
    estimate: Estimate,
    words: Mapping[str, str],
    band: bool = False,
    scale: float = 1,
) -> None:
    """A filter's estimates over the steps, with a band of confidence if wanted."""
    line, k = style(name) | {"label": title(name, words)}, np.arange(len(estimate.value))
    ax.plot(k, scale * estimate.value, markersize=4, markevery=max(1, len(k) // 10), **line)
    if band:
        low, high = estimate.interval()
        ax.fill_between(k, scale * low, scale * high, color=line["color"], alpha=0.15, linewidth=0)


def accuracy(result: Comparison, ax: Axes, words: Mapping[str, str] = ENGLISH) -> Axes:
    """Error variance D_k of every filter against the step, on a logarithmic scale."""
    ax.set_yscale("log")
    for name in result.names:
        _curve(ax, name, result.error_variance(name), words)
    ax.grid(True, which="major", alpha=0.3)
    return _labelled(ax, words["axis_variance"], words)


def relative_accuracy(result: Comparison, ax: Axes, words: Mapping[str, str] = ENGLISH) -> Axes:
    """How far D_k of every filter is above the exact AOF's, the zero line, in per cent, with bands
    of confidence.

    Without the exact AOF the control (the Gaussian AOF) is the zero line.
    """
    zero = title(result.reference, words)
    for name in result.entrants:
        if name != result.reference:
            _curve(ax, name, result.gap(name), words, True, 100)
    ax.axhline(0, color="black", linewidth=0.8, label=zero)
    ax.grid(True, alpha=0.3)
    return _labelled(ax, words["axis_above"].replace("{name}", zero), words)


def ranking(result: Comparison, ax: Axes, words: Mapping[str, str] = ENGLISH) -> Axes:
    """Mean over steps of how far D_k is above the exact AOF's (without it, the control's), the best
    on top, with intervals."""
    ranked = result.ranking()[::-1]
    for row, (name, gap) in enumerate(ranked):
        line, half = style(name), 100 * float(gap.half_width())
        form, color = line["marker"], line["color"]
        ax.errorbar(100 * float(gap.value), row, xerr=half, fmt=form, color=color, capsize=3)
    ax.set_yticks(range(len(ranked)), [title(name, words) for name, _ in ranked])
    ax.axvline(0, color="black", linewidth=0.8)
    ax.set_xlabel(words["axis_mean_above"].replace("{name}", title(result.reference, words)))
    ax.grid(True, axis="x", alpha=0.3)
    return ax


def consistency(result: Comparison, ax: Axes, words: Mapping[str, str] = ENGLISH) -> Axes:
    """Normalised squared error M[e^T p^-1 e]/n per step: 1 if the filter's own covariance is
    right; between a half and two, as rare far trajectories reach beyond."""
    for name in result.entrants:
        _curve(ax, name, result.normalised_error(name), words, True)
    ax.axhline(1, color="black", linewidth=0.8)
    ax.set_yscale("log")
    ax.grid(True, alpha=0.3)
    _labelled(ax, words["axis_normalised"], words).set_ylim(0.5, 2)
    ax.set_yticks([0.5, 1, 2], ["0.5", "1", "2"])
    ax.set_yticks([], minor=True)
    return ax


def mode_probabilities(modes: Recognised, ax: Axes, words: Mapping[str, str] = ENGLISH) -> Axes:
    """Probabilities of all modes but the first against the step, on one trajectory, and the true
    mode."""
    steps, size = np.arange(len(modes.mode)), next(iter(modes.probability.values())).shape[1]
    dashes = ("-", "--", ":", "-.")
    ax.fill_between(
        steps,
        modes.mode / (size - 1) if size > 1 else 0 * steps,
        step="mid",
        color="#dddddd",
        linewidth=0,
    )
    for name, probability in modes.probability.items():
        for j in range(1, size):
            label = title(name, words) + (f", $j={j + 1}$" if size > 2 else "")
            ax.plot(
                steps,
                probability[:, j],
                color=style(name)["color"],
                linestyle=dashes[(j - 1) % 4],
                label=label,
            )
    ax.set_ylim(-0.02, 1.02)
    return _labelled(ax, words["axis_mode"], words)


# Of a comparison, by name.
FIGURES: dict[str, Callable[..., Axes]] = {
    "accuracy": accuracy,
    "relative": relative_accuracy,
    "ranking": ranking,
    "consistency": consistency,
}
