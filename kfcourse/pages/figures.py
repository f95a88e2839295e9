"""One style for the figures of the book, and labels at the ends of curves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.font_manager import fontManager
from matplotlib_inline.backend_inline import set_matplotlib_formats

# Fixed colours (Okabe and Ito's, distinguishable by the colour-blind); those of the filters are in kfcourse.lab.plots.
COLOURS = {"truth": "#000000", "measurement": "#999999", "estimate": "#0072B2", "band": "#56B4E9", "warning": "#D55E00"}

# Inches: the column of a page.  A figure of this width is shown at its own size, its labels as large as the page's notes.
WIDTH = 7.2

FONTS = sorted((Path(__file__).parent / "data").glob("*.ttf"))  # the pages' own, Source Sans 3 (OFL.txt)

_STYLE: dict[Any, Any] = {
    "figure.figsize": (WIDTH, 3.4),
    "figure.facecolor": "none",  # the page shows through, light or dark
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
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


def book_style() -> None:
    """Figures of this notebook in the style of the book: its font, twice the pixels, transparent, no frame above and right."""
    for font in FONTS:
        fontManager.addfont(font)
    # The whole figure, as wide as it says: constrained layout has found room for everything.
    set_matplotlib_formats("retina", bbox_inches=None)
    rcParams.update(_STYLE)


def label_ends(ax: Axes, least: float = 0.07, **text: Any) -> None:
    """Write each curve's label at its right end, in its colour; labels are at least the fraction `least` of the height apart."""
    lines = [line for line in ax.get_lines() if not str(line.get_label()).startswith("_")]
    ends = []
    for line in lines:
        points = np.asarray(line.get_xydata())
        points = points[np.isfinite(points).all(axis=1)]
        if len(points):
            ends.append((line, *points[-1]))
    ax.autoscale_view()  # limits are final
    heights = [ax.transAxes.inverted().transform(ax.transData.transform((x, y)))[1] for _, x, y in ends]
    places = dict(zip(np.argsort(heights), _apart(np.sort(heights), least), strict=True))
    for number, (line, _, _) in enumerate(ends):
        style = {"color": line.get_color(), "va": "center", "ha": "left", "clip_on": False} | text
        ax.text(1.01, places[number], str(line.get_label()), transform=ax.transAxes, **style)


def _apart(heights: np.ndarray, least: float) -> np.ndarray:
    """Ascending heights moved as little as it takes to be `least` apart."""
    steps = least * np.arange(len(heights))
    free = heights - steps  # must not descend: pool neighbours that do
    pools: list[tuple[float, int]] = []
    for value in free:
        pools.append((float(value), 1))
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            (one, n), (other, m) = pools[-2], pools[-1]
            pools[-2:] = [((one * n + other * m) / (n + m), n + m)]
    return np.concatenate([np.full(n, mean) for mean, n in pools]) + steps if pools else free
