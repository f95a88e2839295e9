"""Pictures and tables of a flight and its estimates, for the radar chapters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from kfcourse.lab.plots import style
from kfcourse.laws import Array
from kfcourse.montecarlo.statistics import Estimate
from kfcourse.pages.figures import COLOURS, WIDTH
from kfcourse.pages.tables import table
from kfcourse.pages.verification import Shown
from kfcourse.scenarios.flight import Track

# One colour for each part of the flight, one look for each filter.
PARTS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
LOOKS: dict[str, dict[str, Any]] = {
    "Kalman": {"color": style("kalman")["color"]},
    "alpha-beta": {"color": style("alpha-beta")["color"], "linestyle": "--"},
    "extended": {"color": "#CC79A7"},
}


def flight_and_errors(track: Track, estimates: Mapping[str, Array], shown: str) -> Figure:
    """The flight in space with the estimate `shown` of one run; RMS errors (m) of all estimates
    (steps, runs, 3) over time."""
    fig = plt.figure(figsize=(WIDTH, 3.5))
    grid = fig.add_gridspec(1, 2, width_ratios=[1.2, 1])
    space: Any = fig.add_subplot(grid[0], projection="3d")
    ax = fig.add_subplot(grid[1])
    for part, colour in enumerate(PARTS, start=1):
        inside = track.part == part
        x, y, z = (track.position[inside] / 1000).T
        space.plot(x, y, z, color=colour, linewidth=2)
        # the shadow on the ground
        space.plot(x, y, 0 * z, color=COLOURS["measurement"], linewidth=0.7)
        ax.axvline(track.time[inside][0], color=COLOURS["measurement"], linewidth=0.6)
        ax.text(track.time[inside].mean(), 1500, str(part), color=colour, ha="center")
    space.plot(*(estimates[shown][5:, 0] / 1000).T, "--", color="black", linewidth=1)
    space.set(xlabel="east (km)", ylabel="north (km)", zlim=(0, 10), title="flight, altitude in km")
    for name, positions in estimates.items():
        squares = ((positions - track.position[:, None]) ** 2).sum(axis=-1)
        ax.semilogy(
            track.time, np.sqrt(squares.mean(axis=1)), linewidth=1.2, label=name, **LOOKS[name]
        )
    ax.set(xlabel="time (s)", title="RMS error (m)", ylim=(25, 2000))
    fig.legend(loc="outside lower center", ncols=2)
    return fig


def in_plan(track: Track, y: Array, estimates: Mapping[str, Array]) -> Figure:
    """Truth, measurements (steps, runs, 3) and estimates of one run, in plan, on pieces of parts 1
    to 4."""
    second, third, fourth = (track.time[track.part == part][0] for part in (2, 3, 4))
    pieces = {
        "part 1": (60.0, 75.0),
        "part 2": (second + 40, second + 100),
        "part 3": (third + 15, third + 45),
        "part 4": (fourth + 80, fourth + 140),
    }
    fig, axes = plt.subplots(1, len(pieces), figsize=(WIDTH, 2.9), width_ratios=[1.2, 1, 0.7, 1.2])
    for ax, (title, (start, end)) in zip(axes, pieces.items(), strict=True):
        inside = (track.time >= start) & (track.time <= end)
        ax.plot(*(y[inside, 0, :2] / 1000).T, ".", color=COLOURS["measurement"], markersize=3)
        ax.plot(*(track.position[inside, :2] / 1000).T, color=COLOURS["estimate"])
        for name, positions in estimates.items():
            ax.plot(*(positions[inside, 0, :2] / 1000).T, linewidth=1.3, label=name, **LOOKS[name])
        ax.set(title=title, xlabel="east (km)")
        ax.set_aspect("equal", adjustable="datalim")
        ax.locator_params(axis="x", nbins=3)
    axes[0].set_ylabel("north (km)")
    fig.legend(
        *axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(estimates)
    )
    return fig


def by_part(
    parts: Sequence[str], columns: Mapping[str, Estimate], heading: str = "RMS error (m)"
) -> Shown:
    """A table with a row for each part of the flight; columns of `rms_by_part` or `rms_difference`,
    value ± standard error."""
    rows: dict[str, list[Any]] = {heading: list(parts)}
    for name, estimate in columns.items():
        # no "-0.0"
        rows[name] = list(zip(estimate.value.round(1) + 0.0, estimate.standard_error, strict=True))
    return table(rows, ".1f")
