"""Legends that a curve, a point or other words run through."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cbook import STEP_LOOKUP_MAP
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.contour import ContourSet
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.transforms import Bbox


def struck(figure: Figure) -> list[str]:
    """The words of legends that are struck, themselves or the sample beside them, in a picture just made, of twice the pixels.

    Bands may lie behind words.  A text without a legend may touch its own curve and is not looked at.
    """
    usual, figure.dpi = figure.dpi, 2 * figure.dpi  # legends keep the places where they were drawn
    entries = [entry for legend in figure.findobj(Legend) for entry in _entries(legend)]
    found = [words for words, box in entries if any(_strikes(ax, box) for ax in figure.axes)]
    figure.dpi = usual
    return found


def _entries(legend: Legend) -> Iterator[tuple[str, Bbox]]:
    for text in legend.get_texts():
        box = text.get_window_extent()
        sample = _pixels(text, (legend.handlelength + legend.handletextpad) * float(text.get_fontsize()))
        yield text.get_text(), Bbox.from_extents(box.x0 - sample, box.y0, box.x1, box.y1)


def _strikes(ax: Axes, box: Bbox) -> bool:
    """Does anything touch the part of the box that is inside `ax`, where curves end?"""
    inside = Bbox.intersection(box, ax.bbox)
    return inside is not None and any(_touches(one, inside) for one in ax.get_children() if one.get_visible())


def _touches(one: Artist, box: Bbox) -> bool:
    if isinstance(one, Line2D):
        corners = STEP_LOOKUP_MAP[one.get_drawstyle()](*np.transpose(one.get_xydata()))
        points = one.get_transform().transform(np.transpose(corners))
        line, marks = (look not in ("None", " ", "", None) for look in (one.get_linestyle(), one.get_marker()))
        return (line and _crosses(points, box)) or (marks and _near(points, _pixels(one, one.get_markersize()) / 2, box))
    if isinstance(one, PathCollection):
        points = one.get_offset_transform().transform(np.ma.filled(one.get_offsets(), np.nan))
        return _near(points, np.resize(_pixels(one, np.sqrt(one.get_sizes())) / 2, len(points)), box)
    if isinstance(one, LineCollection) or (isinstance(one, ContourSet) and not one.filled):
        paths = map(one.get_transform().transform_path, one.get_paths())
        return any(_crosses(part, box) for path in paths for part in map(np.asarray, path.to_polygons(closed_only=False)))
    return isinstance(one, Text) and bool(one.get_text()) and Text.get_window_extent(one).overlaps(box)


def _crosses(points: np.ndarray, box: Bbox) -> bool:
    """Is a piece between neighbouring points in the box?  None is beside NaN (`Path.intersects_bbox` would go on across it)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = (np.array([box.min, box.max])[:, None] - points[:-1]) / np.diff(points, axis=0)  # in parts of the pieces
    begin, end = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
    return bool((np.maximum(begin, 0) <= np.minimum(end, 1)).any())


def _near(points: np.ndarray, radius: np.ndarray | float, box: Bbox) -> bool:
    """Does a disc around one of the points reach into the box?"""
    beyond = np.maximum(np.maximum(box.min - points, points - box.max), 0)
    return bool((np.hypot(*beyond.T) <= radius).any())


def _pixels(one: Any, points: Any) -> Any:
    return points * one.get_figure(root=True).dpi / 72
