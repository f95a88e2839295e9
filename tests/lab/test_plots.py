"""Figures: labelled axes, one colour a family, bands that are confidence intervals."""

from itertools import combinations

import numpy as np
import pytest
from colours import apart, contrast, shown
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal

from kfcourse import compare, lab_filters, load_variants
from kfcourse.lab import FILTERS, LAB, plots, title
from kfcourse.lab.families import FAMILIES, look

SIDE_BY_SIDE = [  # the bound, the AOF, the DUOF, and what stands beside them
    ("kalman", "aof", "duof", "fos", "mfos", "fos3", "mfos3"),
    ("kalman", "aof", "duof", "fos", "mfos", "dfmp", "mdfmp"),
    ("kalman", "aof", "duof", "fos", "mfos", "particle"),
    ("kalman", "aof", "iterated", "particle"),
]
DRAW = [plots.accuracy, plots.relative_accuracy, plots.ranking, plots.consistency]


def comparison(name, names, runs=200):
    model = load_variants()[name].model
    return compare(lab_filters(model, names), model, runs, 7, 1)


@pytest.fixture(scope="module")
def results():
    return {
        "scalar": comparison("53", [*LAB, "aof-exact"]),
        "vector": comparison("20", [*LAB, "particle"], 20),
        "one filter": comparison("53", ["duof"]),
    }


@pytest.fixture
def ax():
    return Figure().add_subplot()


@pytest.mark.parametrize("kind", ["scalar", "vector", "one filter"])
@pytest.mark.parametrize("draw", DRAW)
# the control relative to itself is not drawn
@pytest.mark.filterwarnings("ignore:No artists with labels")
def test_a_figure_draws_on_the_axes_given_labels_them_and_gives_each_filter_its_style(
    results, ax, draw, kind
):
    result = results[kind]
    assert draw(result, ax) is ax and ax.get_xlabel()
    ax.figure.canvas.draw()  # labels and formulas can be typeset
    if draw is plots.ranking:  # one row a filter
        rows = [label.get_text() for label in ax.get_yticklabels()][::-1]
        assert rows == [title(name) for name, _ in result.ranking()]
        return
    assert ax.get_xlabel() == "step $k$" and ax.get_ylabel()
    lines = {line.get_label(): line for line in ax.lines if not line.get_label().startswith("_")}
    zero = "aof-exact" if result.has_bound else result.control
    left_out = {plots.relative_accuracy: zero, plots.consistency: "aof-exact"}.get(draw)
    expected = [name for name in result.names if name != left_out]
    axis = [title(zero)] if draw is plots.relative_accuracy else []
    assert list(lines) == [title(name) for name in expected] + axis
    for name in expected:
        line, style = lines[title(name)], plots.style(name)
        assert to_hex(line.get_color()) == to_hex(style["color"])
        assert line.get_linestyle() == style["linestyle"]


def test_a_family_has_one_colour_and_an_approximation_its_dashes():
    for family in ("aof", "fos", "mfos"):
        first, two = plots.style(f"{family}-gaussian"), plots.style(f"{family}-linearised")
        assert first["color"] == two["color"]
        assert first["marker"] == two["marker"]
        assert first["linestyle"] != two["linestyle"]


def test_no_two_filters_look_the_same():
    looks = {(s["color"], s["linestyle"], s["marker"]) for s in map(plots.style, FILTERS)}
    assert len(looks) == len(FILTERS) and plots.style("mine")["label"] == "mine"


def band(ax, index):
    """Lower and upper edge of a filled band, by step."""
    points = ax.collections[index].get_paths()[0].vertices
    steps = np.unique(points[:, 0])
    columns = [points[points[:, 0] == k, 1] for k in steps]
    return np.array([c.min() for c in columns]), np.array([c.max() for c in columns])


def test_the_bands_are_confidence_intervals(results):
    result = results["vector"]
    ax = plots.relative_accuracy(result, Figure().add_subplot())
    for i, name in enumerate(name for name in result.entrants if name != result.reference):
        low, high = result.gap(name).interval()
        assert_allclose(band(ax, i), [100 * low, 100 * high], rtol=1e-9, atol=1e-9)
    assert len(ax.collections) == len(result.entrants) - 1  # the control is the axis
    ax = plots.consistency(result, Figure().add_subplot())
    for i, name in enumerate(result.entrants):
        interval = result.normalised_error(name).interval()
        assert_allclose(band(ax, i), interval, rtol=1e-12)


def test_the_bars_of_the_ranking_are_confidence_intervals(results, ax):
    result = results["scalar"]
    plots.ranking(result, ax)
    for bars, (_, score) in zip(ax.containers, result.ranking()[::-1], strict=True):
        (segment,) = bars.lines[2][0].get_segments()
        assert_allclose(
            segment[:, 0], [100 * limit for limit in score.interval(0.95)], rtol=1e-9, atol=1e-12
        )


def test_the_lines_are_the_numbers(results, ax):
    result = results["vector"]
    plots.accuracy(result, ax)
    for line, name in zip(ax.lines, result.names, strict=True):
        assert_array_equal(line.get_ydata(), result.error_variance(name).value)
    assert ax.get_yscale() == "log"


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_a_filter_s_line_is_seen_on_the_page(name, theme):
    """WCAG 2 wants 3 of what is no text."""
    assert contrast(*shown(look(name)[0], theme)) >= 3


@pytest.mark.parametrize("names", SIDE_BY_SIDE)
def test_the_colour_blind_tell_filters_of_a_figure_apart(names):
    """By their colours alone, at seven times what is just noticed; each has a marker of its own
    besides."""
    assert (
        min(apart(look(first)[0], look(other)[0]) for first, other in combinations(names, 2))
        > 7 * 2.3
    )
    assert len({look(name)[1] for name in names if name != "iterated"}) == len(
        {*names} - {"iterated"}
    )
