"""One style for the figures of the book, and labels at the ends of curves."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib.style
import numpy as np
from IPython.core.interactiveshell import InteractiveShell
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.font_manager import fontManager
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator
from matplotlib_inline.backend_inline import set_matplotlib_formats
from scipy.optimize import isotonic_regression

from kfcourse.symbolic.writing import by_thousands

# Okabe and Ito's, distinguishable by the colour-blind; those of the filters are in
# kfcourse.lab.plots.
COLOURS = {
    "truth": "#000000",
    "measurement": "#999999",
    "estimate": "#0072B2",
    "band": "#56B4E9",
    "warning": "#D55E00",
}

# Labels of axes that count steps; "step $T$ (s)" measures one.
COUNTED = re.compile(r"steps?( apart)?( \$[kl]\$)?( \(.* each\))?")

WIDTH = 7.2  # inches: the column of a page
DATA = Path(__file__).parent / "data"
FONTS = sorted(DATA.glob("*.ttf"))  # the pages' own, Source Sans 3 (OFL.txt)


def book_style(ground: str = "none") -> None:
    """Set the style of the book (data/book.mplstyle) for the figures of this notebook.

    A `ground`, "white" say, makes them readable wherever a notebook is opened, also where the
    page is dark.
    """
    for font in FONTS:
        fontManager.addfont(font)
    # The whole figure, as wide as it says: constrained layout has found room for everything.
    set_matplotlib_formats("retina", bbox_inches=None)
    matplotlib.style.use(DATA / "book.mplstyle")
    grounds: dict[Any, Any] = dict.fromkeys(
        ("figure.facecolor", "axes.facecolor", "savefig.facecolor"), ground
    )
    rcParams.update(grounds)
    shell: Any = InteractiveShell.instance()
    formatter = shell.display_formatter.formatters["image/png"]
    picture = formatter.lookup_by_type(Figure)

    def finished(figure: Figure) -> Any:
        whole_steps(figure)
        part_thousands(figure)
        return picture(figure)

    formatter.for_type(Figure, finished)


def whole_steps(figure: Figure) -> None:
    """Set marks at steps, by 1, 2, 5, 10, on axes that count them ("step", "steps apart")."""
    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis):
            locator = axis.get_major_locator()
            if isinstance(locator, MaxNLocator) and COUNTED.fullmatch(axis.get_label_text()):
                locator.set_params(integer=True, steps=[1, 2, 5, 10])


def part_thousands(figure: Figure) -> None:
    """Write 10,000 in the texts of a figure, at its marks and elsewhere."""
    for text in figure.findobj(Text):
        text.set_text(by_thousands(text.get_text()))
    for axis in figure.findobj(Axis):
        formatter: Any
        for formatter in (axis.get_major_formatter(), axis.get_minor_formatter()):
            formatter.format_ticks = partial(_parted, formatter.format_ticks)


def _parted(format_ticks: Callable[..., list[str]], marks: Sequence[float]) -> list[str]:
    return [by_thousands(str(mark)) for mark in format_ticks(marks)]  # chosen marks may be numbers


def label_ends(ax: Axes, least: float = 0.07, lowest: float = -np.inf, **text: Any) -> None:
    """Write each curve's label at its right end, with a piece of the curve: its colour, dashes and
    marker.

    Labels are at least the fraction `least` of the height apart, a thin line leads to each that
    stands beside its curve's end, and none stands below the value `lowest` (a line of zero that all
    curves are above, say).
    """
    lines = [line for line in ax.get_lines() if not str(line.get_label()).startswith("_")]
    ends = []
    for line in lines:
        points = np.asarray(line.get_xydata())
        points = points[np.isfinite(points).all(axis=1)]
        if len(points):
            ends.append((line, *points[-1]))
    ax.autoscale_view()  # limits are final
    corner = ax.transAxes.inverted()
    points = np.array([corner.transform(ax.transData.transform((x, y))) for _, x, y in ends])
    floor = (
        corner.transform(ax.transData.transform((0, lowest)))[1] if np.isfinite(lowest) else -np.inf
    )
    heights = points[:, 1]
    places = dict(zip(np.argsort(heights), _apart(np.sort(heights), least, floor), strict=True))
    for number, (line, _, _) in enumerate(ends):
        place = places[number]
        if abs(place - heights[number]) > 0.01:
            leader = {
                "color": line.get_color(),
                "linewidth": 0.6,
                "alpha": 0.6,
                "transform": ax.transAxes,
                "clip_on": False,
            }
            ax.add_line(
                Line2D(
                    [points[number, 0], 1.02], [heights[number], place], label="_leader", **leader
                )
            )
        label = Legend(
            ax,
            [line],
            [line.get_label()],
            loc="center left",
            bbox_to_anchor=(1.02, place),
            frameon=False,
            borderpad=0,
            borderaxespad=0,
            handlelength=2.2,
            handletextpad=0.4,
            labelcolor="linecolor",
            prop=text or None,
        )
        ax.add_artist(label).set_clip_on(False)  # else constrained layout leaves it no room


def _apart(heights: np.ndarray, least: float, floor: float) -> np.ndarray:
    """Ascending heights moved as little as it takes to be `least` apart, the first not below
    `floor`."""
    steps = least * np.arange(len(heights))
    return np.maximum(isotonic_regression(heights - steps).x, floor) + steps
