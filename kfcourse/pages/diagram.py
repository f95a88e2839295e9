"""Block diagrams (структурные схемы) from a description: boxes, adders, nodes and arrows drawn with matplotlib.

::

    block_diagram({"gain": Block("$p_k$", 0, 0), "sum": Block("", 2, 0, kind="adder")}, [Arrow("gain", "sum", "$u_k$")], ax)

Positions and sizes are in units of the axes, which `block_diagram` fits to the drawing; labels may be LaTeX.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import copysign, hypot, isfinite
from typing import Any, NamedTuple, TypeAlias

from matplotlib.axes import Axes
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle
from matplotlib.path import Path

Point: TypeAlias = tuple[float, float]

KINDS = ("box", "adder", "node", "text", "frame")
FRAME = "#0072B2"


class Block(NamedTuple):
    """A part of a diagram, centred at (x, y).

    Attributes
    ----------
    label : str
    x, y, width, height : float
        In units of the axes.  An adder is a circle of this height; a node has no size.
    kind : {"box", "adder", "node", "text", "frame"}
        A box; a circle with the sign of a sum; a point where a line branches; a label without border, for what
        enters and leaves; a dashed frame behind other blocks, its label in the upper left corner.
    """

    label: str
    x: float
    y: float
    width: float = 1.6
    height: float = 0.9
    kind: str = "box"


class Arrow(NamedTuple):
    """A line from block to block, with a head unless it ends in a node.

    Attributes
    ----------
    start, end : str
        Names of blocks.
    label : str
        Written at the middle of the longest segment: above it, or to the right of a vertical one.
    via : sequence of (x, y)
        Corners on the way.
    sign : str
        Written beside the head, for adders.
    dashed : bool
        For what sets a block's coefficients rather than passes through it.
    """

    start: str
    end: str
    label: str = ""
    via: Sequence[Point] = ()
    sign: str = ""
    dashed: bool = False


def block_diagram(blocks: Mapping[str, Block], arrows: Sequence[Arrow], ax: Axes, fontsize: float = 12) -> Axes:
    """Draw a block diagram on the axes, and fit their limits to it.

    Parameters
    ----------
    blocks : dict
        Name to `Block`.
    arrows : sequence of Arrow
    ax : matplotlib Axes
    fontsize : float
        Of all labels, in points.

    Raises
    ------
    ValueError
        No blocks, an unknown kind of block, an unknown name in an arrow, a position or size that is not a
        finite number, a size that is not positive, a corner of an arrow inside the block it starts or ends at.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from kfcourse.pages.diagram import Arrow, Block, block_diagram
    >>> parts = {"x": Block("$x$", 0, 0, 0.5, kind="text"), "gain": Block("$K$", 2, 0)}
    >>> ax = block_diagram(parts, [Arrow("x", "gain")], Figure().add_subplot())
    """
    _check(blocks)
    routes = [route(blocks, arrow) for arrow in arrows]
    for block in blocks.values():
        _draw_block(block, ax, fontsize)
    for arrow, points in zip(arrows, routes, strict=True):
        _draw_arrow(arrow, points, blocks[arrow.end].kind != "node", ax, fontsize)
    corners = [(b.x + s * w, b.y + s * h) for b in blocks.values() for w, h in [_half(b)] for s in (-1, 1)]
    xs, ys = zip(*corners, *(point for points in routes for point in points), strict=True)
    margin = 0.4 * max((block.height for block in blocks.values() if block.kind != "frame"), default=1.0)
    ax.set_xlim(min(xs) - margin, max(xs) + margin)
    ax.set_ylim(min(ys) - margin, max(ys) + margin)
    ax.set_aspect("equal")
    ax.set_axis_off()
    return ax


def route(blocks: Mapping[str, Block], arrow: Arrow) -> list[Point]:
    """The points of an arrow's line: from the border of its first block, over its corners, to the border of the last.

    It leaves a side of a box at a right angle where the next point allows, and a circle along its radius.
    """
    for name in (arrow.start, arrow.end):
        if name not in blocks:
            raise ValueError(f"{arrow} names the block {name!r}, which is not there; the blocks are {', '.join(blocks)}")
    start, end = blocks[arrow.start], blocks[arrow.end]
    corners = [(float(x), float(y)) for x, y in arrow.via]
    if not all(isfinite(number) for corner in corners for number in corner):
        raise ValueError(f"{arrow} has a corner that is not finite; give every corner as two finite numbers")
    try:
        first = _border(start, corners[0] if corners else (end.x, end.y))
        return [first, *corners, _border(end, corners[-1] if corners else (start.x, start.y))]
    except ValueError as error:
        raise ValueError(f"{arrow}: {error}") from None


def _border(block: Block, towards: Point) -> Point:
    """The point of the block's border where a line that comes from outside ends."""
    dx, dy = towards[0] - block.x, towards[1] - block.y
    half_width, half_height = _half(block)
    if abs(dx) <= half_width and abs(dy) <= half_height:
        raise ValueError(f"the point {towards} is inside the block {block.label!r}; move the corner, or the blocks apart")
    if block.kind in ("adder", "node"):
        share = half_width / max(hypot(dx, dy), half_width) if half_width else 0.0
        return block.x + share * dx, block.y + share * dy
    if abs(dx) <= half_width:
        return towards[0], block.y + copysign(half_height, dy)
    if abs(dy) <= half_height:
        return block.x + copysign(half_width, dx), towards[1]
    share = min(half_width / abs(dx), half_height / abs(dy))
    return block.x + share * dx, block.y + share * dy


def _half(block: Block) -> Point:
    """Half of the width and of the height."""
    if block.kind == "node":
        return 0.0, 0.0
    return (block.height if block.kind == "adder" else block.width) / 2, block.height / 2


def _check(blocks: Mapping[str, Block]) -> None:
    if not blocks:
        raise ValueError("a block diagram needs at least one block, got none")
    for name, block in blocks.items():
        if block.kind not in KINDS:
            raise ValueError(f"block {name!r} is of the kind {block.kind!r}; the kinds are {', '.join(KINDS)}")
        if not all(map(isfinite, block[1:5])) or min(block.width, block.height) <= 0:
            raise ValueError(
                f"block {name!r} has the position ({block.x}, {block.y}) and the size {block.width} x {block.height}; "
                "expected finite numbers, and a size above 0"
            )


def _draw_block(block: Block, ax: Axes, fontsize: float) -> None:
    half_width, half_height = _half(block)
    corner = (block.x - half_width, block.y - half_height)
    line: dict[str, Any] = {"facecolor": "white", "edgecolor": "black", "linewidth": 1.3, "zorder": 3}
    place: dict[str, Any] = {"textcoords": "offset points", "fontsize": fontsize}
    if block.kind == "frame":
        line |= {"edgecolor": FRAME, "linestyle": "--", "zorder": 0}
        ax.add_patch(Rectangle(corner, block.width, block.height, **line))
        upper_left = (corner[0], corner[1] + block.height)
        ax.annotate(block.label, upper_left, (5, -4), ha="left", va="top", color=FRAME, **place)
        return
    if block.kind == "node":
        ax.plot(block.x, block.y, "o", color="black", markersize=5, zorder=4)
        ax.annotate(block.label, (block.x, block.y), (0, 6), ha="center", va="bottom", **place)
        return
    if block.kind == "box":
        ax.add_patch(Rectangle(corner, block.width, block.height, **line))
    elif block.kind == "adder":
        ax.add_patch(Circle((block.x, block.y), half_width, **line))
    label = block.label or (r"$\Sigma$" if block.kind == "adder" else "")
    ax.text(block.x, block.y, label, ha="center", va="center", fontsize=fontsize, zorder=4)


def _draw_arrow(arrow: Arrow, points: list[Point], head: bool, ax: Axes, fontsize: float) -> None:
    style = "-|>,head_width=3.2,head_length=6.5" if head else "-"
    line: dict[str, Any] = {"color": "black", "linewidth": 1.3, "linestyle": (0, (4, 2)) if arrow.dashed else "-", "zorder": 2}
    ax.add_patch(FancyArrowPatch(path=Path(points), arrowstyle=style, joinstyle="miter", capstyle="butt", **line))
    segments = list(pairwise(points))
    (x0, y0), (x1, y1) = max(segments, key=lambda s: hypot(s[1][0] - s[0][0], s[1][1] - s[0][1]))
    place: dict[str, Any] = {"textcoords": "offset points", "fontsize": fontsize, "zorder": 4}
    if abs(y1 - y0) > abs(x1 - x0):
        place |= {"xytext": (5, 0), "ha": "left", "va": "center"}
    else:
        place |= {"xytext": (0, 4), "ha": "center", "va": "bottom"}
    ax.annotate(arrow.label, ((x0 + x1) / 2, (y0 + y1) / 2), **place)
    if arrow.sign:
        (x0, y0), (x1, y1) = segments[-1]
        length = hypot(x1 - x0, y1 - y0)
        along, across = ((x1 - x0) / length, (y1 - y0) / length), (-(y1 - y0) / length, (x1 - x0) / length)
        # Back from the head and to its left.
        offset = (-10 * along[0] + 8 * across[0], -10 * along[1] + 8 * across[1])
        ax.annotate(arrow.sign, (x1, y1), **place | {"xytext": offset, "ha": "center", "va": "center"})
