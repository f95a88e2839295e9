"""Block diagrams: arrows end at the blocks, nothing leaves the axes, a wrong description is refused with its reason."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle

from kfcourse.pages.diagram import Arrow, Block, block_diagram, route

pytestmark = pytest.mark.quick

# A loop with every kind of block, corners, a sign, a dashed arrow and an oblique one; no two sizes are equal.
BLOCKS = {
    "in": Block("$y$", 0, 3, 0.6, 0.5, kind="text"),
    "difference": Block("", 2, 3, height=0.8, kind="adder"),
    "gain": Block("$K$", 5, 3.1, 1.7, 1.2),
    "out": Block("$z$", 8, 3, kind="node"),
    "delay": Block("delay", 4.5, 0, 1.5, 0.9),
    "tuning": Block("tuning", 7.5, 1, 1.4, 0.7),
    "frame": Block("discriminator", 2.2, 3, 2.4, 2.2, kind="frame"),
}
ARROWS = [
    Arrow("in", "difference", sign="+"),
    Arrow("difference", "gain", "$u$"),
    Arrow("gain", "out"),
    Arrow("out", "delay", via=[(8, 0)]),
    Arrow("delay", "difference", r"$\lambda$", via=[(2, 0)], sign="-"),
    Arrow("tuning", "gain", dashed=True),
]


@pytest.fixture
def ax():
    figure = Figure(figsize=(9, 4), layout="constrained")
    FigureCanvasAgg(figure)
    return figure.add_subplot()


def on_border(block, point):
    """Whether a point is on the border of a block; to rounding of coordinates of size 10."""
    dx, dy = abs(point[0] - block.x), abs(point[1] - block.y)
    if block.kind == "node":
        return max(dx, dy) < 1e-12
    if block.kind == "adder":
        return abs(np.hypot(dx, dy) - block.height / 2) < 1e-12
    inside = dx < block.width / 2 + 1e-12 and dy < block.height / 2 + 1e-12
    return inside and (abs(dx - block.width / 2) < 1e-12 or abs(dy - block.height / 2) < 1e-12)


@pytest.mark.parametrize("arrow", ARROWS, ids=lambda arrow: f"{arrow.start}-{arrow.end}")
def test_an_arrow_starts_and_ends_on_the_border_of_its_blocks(arrow):
    points = route(BLOCKS, arrow)
    assert on_border(BLOCKS[arrow.start], points[0])
    assert on_border(BLOCKS[arrow.end], points[-1])
    assert points[1:-1] == list(arrow.via)


def test_points_of_an_arrow_computed_by_hand():
    assert route(BLOCKS, ARROWS[0]) == [(0.3, 3), (1.6, 3)]
    assert route(BLOCKS, ARROWS[3]) == [(8, 3), (8, 0), (5.25, 0)]
    assert route(BLOCKS, ARROWS[4]) == [(3.75, 0), (2, 0), (2, 2.6)]
    # At a right angle to the side of a box, though its centre is higher than the node.
    assert route(BLOCKS, ARROWS[2]) == [(5.85, 3), (8, 3)]
    # Two corners, the last below the box and not below its centre.
    points = route(BLOCKS, Arrow("tuning", "gain", via=[(7.5, -1), (5.5, -1)]))
    assert points == [(7.5, 0.65), (7.5, -1), (5.5, -1), (5.5, 2.5)]


def test_an_oblique_arrow_points_from_centre_to_centre():
    (x0, y0), (x1, y1) = route(BLOCKS, ARROWS[5])
    direction = np.array([5 - 7.5, 3.1 - 1])
    # Cross product of unit vectors: zero to rounding.
    assert abs((x1 - x0) * direction[1] - (y1 - y0) * direction[0]) < 1e-12
    # From the top of the one, whose slope width/height is flatter, into the side of the other.
    assert (y0, y1) == (pytest.approx(1 + 0.35, abs=1e-12), pytest.approx(3.1 - 0.6, abs=1e-12))


def test_what_is_drawn_are_the_blocks_and_the_routes(ax):
    assert block_diagram(BLOCKS, ARROWS, ax) is ax
    rectangles = [p for p in ax.patches if isinstance(p, Rectangle)]
    boxes = [b for b in BLOCKS.values() if b.kind in ("box", "frame")]
    drawn = [(*np.add(p.get_xy(), (p.get_width() / 2, p.get_height() / 2)), p.get_width(), p.get_height()) for p in rectangles]
    np.testing.assert_allclose(drawn, [(b.x, b.y, b.width, b.height) for b in boxes], rtol=0, atol=1e-12)
    (circle,) = (p for p in ax.patches if isinstance(p, Circle))
    assert (*circle.center, circle.radius) == (2, 3, 0.4)
    (node,) = ax.lines
    assert (*node.get_xdata(), *node.get_ydata()) == (8, 3)
    arrows = [p for p in ax.patches if isinstance(p, FancyArrowPatch)]
    assert len(arrows) == len(ARROWS)
    ax.figure.canvas.draw()
    pixel = np.abs(ax.transData.inverted().transform((1, 0)) - ax.transData.inverted().transform((0, 0)))[0]
    for arrow, patch in zip(ARROWS, arrows, strict=True):
        points = route(BLOCKS, arrow)
        vertices = patch.get_path().vertices
        np.testing.assert_allclose(vertices[0], points[0], rtol=0, atol=1e-9)
        # The tip of the head is the vertex nearest to the end.  Matplotlib sets it back by the mitre of the line, half of its
        # 1.8 pixels over the sine of half the head's angle (0.44): 2.1 pixels.
        assert np.hypot(*(vertices - points[-1]).T).min() < 2.5 * pixel
        assert (patch.get_linestyle() != "-") == arrow.dashed


def test_a_line_into_a_node_has_no_head(ax):
    block_diagram(BLOCKS, ARROWS, ax)
    heads = [p.get_arrowstyle().__class__.__name__ for p in ax.patches if isinstance(p, FancyArrowPatch)]
    assert [arrow.end for arrow, head in zip(ARROWS, heads, strict=True) if head == "Curve"] == ["out"]


def test_everything_is_inside_the_axes_and_every_label_is_there(ax):
    block_diagram(BLOCKS, ARROWS, ax)
    ax.figure.canvas.draw()
    renderer, box = ax.figure.canvas.get_renderer(), ax.get_window_extent()
    for artist in [*ax.patches, *ax.texts, *ax.lines]:
        extent = artist.get_window_extent(renderer)
        if extent.width > 0:  # not an empty label
            assert box.x0 <= extent.x0 and extent.x1 <= box.x1, artist
            assert box.y0 <= extent.y0 and extent.y1 <= box.y1, artist
    written = [text.get_text() for text in ax.texts]
    for label in [*(b.label for b in BLOCKS.values()), *(a.label for a in ARROWS), *(a.sign for a in ARROWS)]:
        assert label in written or not label
    assert ax.get_aspect() == 1  # circles are round


def test_a_diagram_may_be_frames_alone(ax):
    block_diagram({"all": BLOCKS["frame"]}, [], ax)
    assert ax.get_xlim()[0] < 1.0 and ax.get_xlim()[1] > 3.4


def test_a_corner_outside_all_blocks_widens_the_axes(ax):
    block_diagram(BLOCKS, [Arrow("out", "in", via=[(8, 7), (0, 7)])], ax)
    assert ax.get_ylim()[1] > 7


@pytest.mark.parametrize(
    "blocks, arrows, message",
    [
        ({}, [], "at least one block"),
        (BLOCKS, [Arrow("gian", "out")], "'gian'.*the blocks are in, difference, gain"),
        (BLOCKS, [Arrow("gain", "Out")], "'Out'"),
        ({"a": Block("", 0, 0, kind="circle")}, [], "'a' is of the kind 'circle'; the kinds are box, adder"),
        ({"a": Block("", np.nan, 0)}, [], r"'a' has the position \(nan, 0\)"),
        ({"a": Block("", 0, 0, width=0)}, [], "size 0 x 0.9"),
        ({"a": Block("", 0, 0, height=-1)}, [], "size above 0"),
        (BLOCKS, [Arrow("gain", "out", via=[(5.1, 3.2)])], "inside the block"),
        (BLOCKS, [Arrow("gain", "gain")], "inside the block"),
        (BLOCKS, [Arrow("out", "out")], "inside the block"),
        (BLOCKS, [Arrow("gain", "out", via=[(6, np.inf)])], "corner that is not finite"),
    ],
)
def test_a_wrong_description_is_refused_with_its_reason(ax, blocks, arrows, message):
    with pytest.raises(ValueError, match=message):
        block_diagram(blocks, arrows, ax)
    assert not ax.patches  # nothing half drawn
