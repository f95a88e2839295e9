"""One style for the figures of the book, each also as a telephone shows it, and labels at the ends of curves."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

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

from kfcourse.pages.captions import drawn
from kfcourse.pages.legends import struck
from kfcourse.pages.units import in_brackets
from kfcourse.symbolic.writing import by_thousands

# Fixed colours (Okabe and Ito's, distinguishable by the colour-blind); those of the filters are in kfcourse.lab.plots.
COLOURS = {"truth": "#000000", "measurement": "#999999", "estimate": "#0072B2", "band": "#56B4E9", "warning": "#D55E00"}

# Inches: the column of a page.  A figure of this width is shown at its own size, its labels as large as the page's notes.
WIDTH = 7.2
# A column of 338 px, on a screen of 390, shows a figure of this width with letters of 10 pt as 10.2 px, one of 7.2 as 6.3.
NARROW = 4.4

# Labels of axes that count steps; "step $T$ (s)" measures one.
COUNTED = re.compile(r"steps?( apart)?( \$[kl]\$)?( \(.* each\))?")

FONTS = sorted((Path(__file__).parent / "data").glob("*.ttf"))  # the pages' own, Source Sans 3 (OFL.txt)

_STYLE: dict[Any, Any] = {
    "figure.figsize": (WIDTH, 3.4),
    "figure.constrained_layout.use": True,
    "font.family": ["Source Sans 3", "DejaVu Sans"],  # the second has the signs that the first lacks
    "mathtext.fontset": "custom",
    "mathtext.rm": "Source Sans 3",
    "mathtext.it": "Source Sans 3:italic",
    "mathtext.sf": "Source Sans 3",
    "mathtext.cal": "Source Sans 3:italic",
    "mathtext.bf": "Source Sans 3",
    "font.size": 10,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.6,
    "legend.frameon": False,
    "legend.fontsize": 9.5,
}


def book_style(ground: str = "none") -> None:
    """Figures of this notebook in the style of the book: its font, twice the pixels, transparent, no frame above and right.

    A `ground`, "white" say, makes them readable wherever a notebook is opened, also where the page is dark.

    The picture of each wider than `NARROW` carries a second one, for telephones, in its output's metadata (book/narrow.py), and
    each carries there what it shows, with which its caption is compared, and what is struck in its legends (book/figures.py).
    One with the label "time, s" raises ValueError: units stand in brackets.
    """
    for font in FONTS:
        fontManager.addfont(font)
    # The whole figure, as wide as it says: constrained layout has found room for everything.
    set_matplotlib_formats("retina", bbox_inches=None)
    rcParams.update(_STYLE | {f"{of}.facecolor": ground for of in ("figure", "axes", "savefig")})
    formatter = InteractiveShell.instance().display_formatter.formatters["image/png"]  # type: ignore[union-attr]
    wide = formatter.lookup_by_type(Figure)

    def both(figure: Figure) -> Any:
        in_brackets(text.get_text() for text in figure.findobj(Text))
        whole_steps(figure)
        part_thousands(figure)
        if not (made := wide(figure)):  # of a figure without axes
            return None
        data, metadata = made[0], made[1] | {"drawn": drawn(figure), "struck": struck(figure)}
        if lay_narrow(figure):
            metadata |= {"narrow": wide(figure)[0]}
            metadata["struck"] += [f"{words} (on a telephone)" for words in struck(figure)]
        return data, metadata

    formatter.for_type(Figure, both)


def whole_steps(figure: Figure) -> None:
    """Marks at steps, by 1, 2, 5, 10, on axes that count them: "step", "step $k$", "steps apart", "step $k$ (5 ms each)"."""
    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis):
            locator = axis.get_major_locator()
            if isinstance(locator, MaxNLocator) and COUNTED.fullmatch(axis.get_label_text()):
                locator.set_params(integer=True, steps=[1, 2, 5, 10])


def part_thousands(figure: Figure) -> None:
    """10,000 in whatever a figure says, at its marks and elsewhere."""
    for text in figure.findobj(Text):
        text.set_text(by_thousands(text.get_text()))
    for axis in figure.findobj(Axis):
        formatter: Any
        for formatter in (axis.get_major_formatter(), axis.get_minor_formatter()):
            formatter.format_ticks = partial(_parted, formatter.format_ticks)


def _parted(said: Callable[..., list[str]], marks: Sequence[float]) -> list[str]:
    return [by_thousands(str(one)) for one in said(marks)]  # marks set by hand may be numbers


def lay_narrow(figure: Figure) -> bool:
    """Make a figure `NARROW`, its panels one under the other, in their order; False if it is not wider than that already."""
    width, height = figure.get_size_inches()
    if width <= NARROW:
        return False
    panels = [(ax, spec) for ax in figure.axes if (spec := ax.get_subplotspec()) is not None]
    grids = {spec.get_gridspec() for _, spec in panels}
    columns = grids.pop().ncols if len(grids) == 1 else 1
    if columns > 1:
        first_ax, first_spec = panels[0]
        stacked = figure.add_gridspec(first_spec.get_gridspec().nrows * columns, 1)
        for ax, spec in panels:
            first = min(spec.rowspan) * columns + min(spec.colspan)
            ax.set_subplotspec(stacked[first : first + len(spec.rowspan) * len(spec.colspan)])
            if ax is not first_ax and ax.get_shared_y_axes().joined(ax, first_ax):  # which stood at the left and said it for both
                ax.tick_params(labelleft=True)
                ax.set_ylabel(ax.get_ylabel() or first_ax.get_ylabel())
    for legend in list(figure.legends):  # below all panels, in more columns than there is room for
        handles = [handle for handle in legend.legend_handles if handle is not None]
        labels = [text.get_text() for text in legend.get_texts()]
        legend.remove()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
    figure.set_size_inches(NARROW, 0.9 * height * columns if columns > 1 else height)
    return True


def label_ends(ax: Axes, least: float = 0.07, lowest: float = -np.inf, **text: Any) -> None:
    """Write each curve's label at its right end, with a piece of the curve: its colour, dashes and marker.

    Labels are at least the fraction `least` of the height apart, a thin line leads to each that stands beside its curve's end,
    and none stands below the value `lowest` (a line of zero that all curves are above, say).
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
    found = np.array([corner.transform(ax.transData.transform((x, y))) for _, x, y in ends]).reshape(-1, 2)
    floor = corner.transform(ax.transData.transform((0, lowest)))[1] if np.isfinite(lowest) else -np.inf
    heights = found[:, 1]
    places = dict(zip(np.argsort(heights), _apart(np.sort(heights), least, floor), strict=True))
    for number, (line, _, _) in enumerate(ends):
        place = places[number]
        if abs(place - heights[number]) > 0.01:
            leader = {"color": line.get_color(), "linewidth": 0.6, "alpha": 0.6, "transform": ax.transAxes, "clip_on": False}
            ax.add_line(Line2D([found[number, 0], 1.02], [heights[number], place], label="_leader", **leader))
        label = Legend(
            ax, [line], [line.get_label()], loc="center left", bbox_to_anchor=(1.02, place), frameon=False, borderpad=0,
            borderaxespad=0, handlelength=2.2, handletextpad=0.4, labelcolor="linecolor", prop=text or None,
        )  # fmt: skip
        ax.add_artist(label).set_clip_on(False)  # else constrained layout leaves it no room


def _apart(heights: np.ndarray, least: float, floor: float) -> np.ndarray:
    """Ascending heights moved as little as it takes to be `least` apart, the first not below `floor`."""
    steps = least * np.arange(len(heights))
    free = heights - steps  # must not descend: pool neighbours that do
    pools: list[tuple[float, int]] = []
    for value in free:
        pools.append((float(value), 1))
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            (one, n), (other, m) = pools[-2], pools[-1]
            pools[-2:] = [((one * n + other * m) / (n + m), n + m)]
    return np.maximum(np.concatenate([np.full(n, mean) for mean, n in pools]), floor) + steps if pools else free
