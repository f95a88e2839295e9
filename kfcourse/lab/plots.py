"""Figures of the lab: functions (result, ax) -> ax, with one colour and one name for each filter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from kfcourse.lab.families import look
from kfcourse.lab.short_names import title
from kfcourse.laws import CONFIDENCE, Array
from kfcourse.montecarlo.comparison import Comparison
from kfcourse.montecarlo.modes import Recognised


class Words(NamedTuple):
    """What the figures say: the names of filters and the axes, {name} for the filter that is the zero line."""

    title: Callable[[str], str] = title
    step: str = "step $k$"
    variance: str = "error variance $D_k$ (units of $x^2$)"
    above: str = "$D_k$ above {name} (%)"
    mean_above: str = "mean of $D_k$ above {name} (%)"
    normalised: str = r"normalised squared error $\mathsf{M}[e^2/p]$"
    mode: str = "probability of the mode"


ENGLISH = Words()


def style(name: str) -> dict[str, Any]:
    """Line style of a filter: colour by family, dashes for the linearised approximation, black for the exact."""
    approximation = name.partition("-")[2].removeprefix("jump-")
    if approximation == "exact":
        return {"color": "black", "linestyle": "-", "marker": "*", "label": title(name)}
    colour, marker = look(name)
    dashes = {"linearised": "--", "unscented": ":", "gauss-hermite": "-.", "averaged": ":"}.get(approximation, "-")
    return {"color": colour, "linestyle": dashes, "marker": marker, "label": title(name)}


def _steps(ax: Axes, label: str = "step $k$") -> None:
    """The axis of steps: whole numbers."""
    ax.set_xlabel(label)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))


def accuracy(result: Comparison, ax: Axes, names: Sequence[str] | None = None, words: Words = ENGLISH) -> Axes:
    """Error variance D_k of every filter against the step, on a logarithmic scale."""
    steps = np.arange(result.steps)
    for name in names or result.names:
        line = style(name) | {"label": words.title(name), "markersize": 4, "markevery": max(1, result.steps // 10)}
        ax.semilogy(steps, result.error_variance(name).value, **line)
    _steps(ax, words.step)
    ax.set_ylabel(words.variance)
    ax.grid(True, which="major", alpha=0.3)
    ax.legend(fontsize="small", ncols=2)
    return ax


def relative_accuracy(
    result: Comparison,
    ax: Axes,
    names: Sequence[str] | None = None,
    steps: slice = slice(None),
    confidence: float = CONFIDENCE,
    words: Words = ENGLISH,
) -> Axes:
    """How far D_k of every filter is above the exact AOF's, the zero line, in per cent, with bands of confidence.

    Without the exact AOF the control (the Gaussian AOF) is the zero line.
    """
    k = np.arange(result.steps)[steps]
    zero = result.reference
    for name in result.entrants if names is None else names:
        if name == zero:
            continue
        gap = result.gap(name)[steps]
        low, high = gap.interval(confidence)
        line = style(name) | {"label": words.title(name)}
        ax.plot(k, 100 * gap.value, markersize=4, markevery=max(1, len(k) // 12), **line)
        ax.fill_between(k, 100 * low, 100 * high, color=line["color"], alpha=0.15, linewidth=0)
    ax.axhline(0, color="black", linewidth=0.8, label=words.title(zero))
    _steps(ax, words.step)
    ax.set_ylabel(words.above.replace("{name}", words.title(zero)))
    ax.grid(True, alpha=0.3)
    ax.legend(fontsize="small", ncols=2)
    return ax


def ranking(
    result: Comparison, ax: Axes, steps: slice = slice(None), confidence: float = CONFIDENCE, words: Words = ENGLISH
) -> Axes:
    """Mean over steps of how far D_k is above the exact AOF's (without it, the control's), the best on top, with intervals."""
    ranked = result.ranking(steps)[::-1]
    for row, (name, gap) in enumerate(ranked):
        line = style(name)
        low, high = gap.interval(confidence)
        middle = float(gap.value)
        ends = 100 * np.array([[middle - low], [high - middle]])
        ax.errorbar(100 * middle, row, xerr=ends, fmt=line["marker"], color=line["color"], capsize=3)
    ax.set_yticks(range(len(ranked)), [words.title(name) for name, _ in ranked])
    ax.axvline(0, color="black", linewidth=0.8)
    ax.set_xlabel(words.mean_above.replace("{name}", words.title(result.reference)))
    ax.grid(True, axis="x", alpha=0.3)
    return ax


def consistency(
    result: Comparison, ax: Axes, names: Sequence[str] | None = None, confidence: float = CONFIDENCE, words: Words = ENGLISH
) -> Axes:
    """Normalised squared error M[e^T p^-1 e]/n per step: 1 if the filter's own covariance is right."""
    steps = np.arange(result.steps)
    for name in names or result.names:
        value = result.normalised_error(name)
        line = style(name) | {"label": words.title(name)}
        ax.plot(steps, value.value, markersize=4, markevery=max(1, result.steps // 10), **line)
        ax.fill_between(steps, *value.interval(confidence), color=line["color"], alpha=0.15, linewidth=0)
    ax.axhline(1, color="black", linewidth=0.8)
    ax.set_yscale("log")
    _steps(ax, words.step)
    ax.set_ylabel(words.normalised)
    ax.grid(True, alpha=0.3)
    ax.legend(fontsize="small", ncols=2)
    return ax


OF_MODES = "Probabilities of the modes on one trajectory; grey: the true mode (of two modes: where the second is in force)."


def mode_probabilities(modes: Recognised, ax: Axes, words: Words = ENGLISH) -> Axes:
    """Probabilities of all modes but the first against the step, on one trajectory, and the true mode."""
    steps, size = np.arange(len(modes.mode)), next(iter(modes.probability.values())).shape[1]
    dashes = ("-", "--", ":", "-.")
    ax.fill_between(steps, modes.mode / (size - 1) if size > 1 else 0 * steps, step="mid", color="#dddddd", linewidth=0)
    for name, probability in modes.probability.items():
        for j in range(1, size):
            label = words.title(name) + (f", $j={j + 1}$" if size > 2 else "")
            ax.plot(steps, probability[:, j], color=style(name)["color"], linestyle=dashes[(j - 1) % 4], label=label)
    _steps(ax, words.step)
    ax.set_ylabel(words.mode)
    ax.set_ylim(-0.02, 1.02)
    ax.legend(fontsize="small", ncols=2)
    return ax


def trajectory(x: Array, y: Array, estimates: dict[str, Array], ax: Axes) -> Axes:
    """One trajectory: true state x (steps,), measurements y (steps,), and estimates by filter name."""
    steps = np.arange(len(x))
    ax.plot(steps, x, color="black", linewidth=1.5, label="state $x_k$")
    ax.plot(steps, y, ".", color="#999999", label="measurement $y_k$")
    for name, estimate in estimates.items():
        ax.plot(steps, estimate, markersize=0, **style(name))
    _steps(ax)
    ax.set_ylabel("state (units of $x$)")
    ax.grid(True, alpha=0.3)
    ax.legend(fontsize="small")
    return ax
