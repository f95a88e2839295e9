"""Figures of chapters that answer, by keyboard and pointer: their numbers are the package's or
NumPy's; a link keeps them."""

from __future__ import annotations

import gzip

import numpy as np
import pytest
from answering import DRAWS, MADE, MAP, RECORD, WALK, WALKED, drag, fragment, html, said, state_of
from scipy.stats import norm

from kfcourse import Model, linearised, predictions, run
from kfcourse.filters import aof, kalman_filter
from kfcourse.lab.short_names import title
from kfcourse.linear.consistency import autocorrelation, innovations, nees, nis
from kfcourse.pages.scenes import FAULTS, HIDDEN


@pytest.mark.parametrize("name", MADE)
def test_a_figure_is_small(name):
    """At most 150 kB more for its page, compressed; these are read without compression too."""
    assert len(gzip.compress(html(name).encode())) < 60_000


def link_keeps(opened, tab, name: str, part: str) -> None:
    """The address has this of the state, and another page opened with it says the same."""
    tab.wait_for_function("part => decodeURIComponent(location.hash).includes(part)", arg=part)
    assert said(opened(name, fragment(tab))) == said(tab)


# ---------------------------------------------------------------- ten minutes


def estimates(y1: float, Q: float, R: float) -> tuple[float, float]:
    """By the package: the estimate at step 1, which has not forgotten the first law, and the half
    width of its band."""
    model = Model.define("c*x + e*v", "x + f*w", dict(c=0.9, e=Q**0.5, f=R**0.5))
    y = RECORD[1].copy()
    y[1] = y1
    law = run(kalman_filter(model), y[:, None, None])
    return law.mean[1, 0, 0], norm.ppf(0.975) * law.cov[1, 0, 0, 0] ** 0.5


def test_one_measurement_moves_the_estimate_and_not_the_band(opened):
    tab = opened("fig-ten-minutes")
    ring = tab.get_by_role("slider", name="Measurement at step 1")
    Q, R = (
        tab.get_by_role("slider", name="Q, of the kicks"),
        tab.get_by_role("slider", name="R, of the meter"),
    )

    def holds(measured, q, r):
        numbers = said(tab)
        moved, before = estimates(measured, q, r), estimates(RECORD[1, 1], q, r)
        # printed to 0.01; the record is rounded to four digits
        assert numbers == pytest.approx([1, measured, *moved, RECORD[1, 1], *before], abs=0.0056)
        assert numbers[3] == numbers[6]

    holds(5, 0.25, 1)
    ring.press("ArrowDown")
    holds(4.9, 0.25, 1)
    ring.press("Home")
    holds(-6, 0.25, 1)
    Q.press("End")
    holds(-6, 100, 1)
    R.press("Home")
    holds(-6, 100, 0.01)
    R.press("End")
    holds(-6, 100, 100)
    drag(tab, ring, 30, -80)
    assert -4 < state_of(tab, ring) < 2
    holds(state_of(tab, ring), 100, 100)
    link_keeps(opened, tab, "fig-ten-minutes", f"y={ring.get_attribute('aria-valuenow')}")


# ---------------------------------------------------------------- consistency


def three_tests(q: float, r: float) -> list[float]:
    """By the package: means of NEES and NIS, and the correlation of neighbours."""
    one = linearised(WALK.replace(e=0.3 * q**0.5, f=r**0.5))
    seen = innovations(one.measure, predictions(aof(one), WALKED.y), WALKED.y)
    size = nis(seen).mean()
    return [
        nees(WALKED.x, run(aof(one), WALKED.y)).mean(),
        size,
        autocorrelation(seen, 1).value[0] / size,
    ]


def test_the_three_tests_are_the_package_s(opened):
    tab = opened("fig-consistency-faults")
    Q, R = (
        tab.get_by_role("slider", name="Multiply its Q by"),
        tab.get_by_role("slider", name="Multiply its R by"),
    )
    # printed to 0.01; four digits of the records
    assert said(tab) == pytest.approx(three_tests(0.1, 1), abs=0.0052)
    Q.press("End")
    assert said(tab) == pytest.approx(three_tests(1, 1), abs=0.0052)  # the cure
    R.press("Home")
    assert said(tab) == pytest.approx(three_tests(1, 0.1), abs=0.011)
    link_keeps(opened, tab, "fig-consistency-faults", "q=10&r=0.1")


@pytest.mark.parametrize("letter", "AC")
def test_a_hidden_fault_is_guessed(opened, letter):
    tab = opened("fig-consistency-faults")
    which, guess = (
        tab.get_by_role("combobox", name="Filter"),
        tab.get_by_role("combobox", name="Which is wrong?"),
    )
    right = dict(zip("ABCDE", HIDDEN, strict=True))[letter]
    wrong = next(one for one in FAULTS if one != right)
    which.select_option(letter)
    assert said(tab) == pytest.approx(three_tests(*FAULTS[right]), abs=0.011)
    status = tab.get_by_role("status")
    assert right not in status.inner_text()
    guess.select_option(wrong)
    assert "No: with" in status.inner_text() and right not in status.inner_text().replace(wrong, "")
    guess.select_option(right)
    assert status.inner_text().endswith(f"Yes: {right}.")
    which.select_option("example")
    assert guess.input_value() == "–" and "Yes" not in status.inner_text()


# ---------------------------------------------------------------- cycle slips


def trace(sigma: float, draw: int) -> np.ndarray:
    way = [0.0]
    for n, v in DRAWS[draw - 1].T:
        way.append(way[-1] - np.sin(way[-1]) / (sigma**2 + 1) + n / 5 + v * sigma / 10)
    return np.array(way) / (2 * np.pi)


def test_the_ball_is_the_loop(opened):
    tab = opened("fig-slips-ball")
    step, draw = (
        tab.get_by_role("slider", name="Step to look at"),
        tab.get_by_role("slider", name="Random numbers"),
    )
    noise = tab.get_by_role("slider", name="σ of the meter (V)")

    def holds(sigma, which, k):
        way = trace(sigma, which)
        status = tab.get_by_role("status").inner_text()
        assert said(tab)[:3] == pytest.approx([k, way[k], 2 / sigma], abs=0.0051)
        lost = abs(round(way[-1]))
        assert {0: "no cycle is", 1: "one cycle is"}.get(lost, f"{lost} cycles are") in status

    holds(2, 1, 30)
    step.press("ArrowLeft")
    holds(2, 1, 29)
    noise.press("End")
    holds(4, 1, 29)
    draw.press("ArrowRight")
    holds(4, 2, 29)
    step.press("End")
    holds(4, 2, 100)
    drag(tab, step, -100, 30)
    assert 30 < state_of(tab, step) < 90
    holds(4, 2, int(state_of(tab, step)))
    link_keeps(opened, tab, "fig-slips-ball", f"k={step.get_attribute('aria-valuenow')}")


# ---------------------------------------------------------------- the grid


def on_nodes(h: float) -> list[float]:
    """Nodes, per cent on the heaviest, mean and standard deviation."""
    j = np.arange(-200, 201)
    x = h * j[np.abs(h * j) <= 5 + 1e-9]
    mass = norm.pdf(x, -1, 2**0.5) * norm.pdf(1.85, np.hypot(x, 1), 0.1)
    mass /= mass.sum()
    mean = mass @ x
    return [len(x), 100 * mass.max(), mean, np.sqrt(mass @ (x - mean) ** 2)]


def test_the_step_of_the_grid_is_dragged(opened):
    tab = opened("fig-grid-nodes")
    node = tab.get_by_role("slider", name="Distance of the nodes")
    exact = on_nodes(0.05)[2:]

    def holds(h):
        found, expected = said(tab), [h, *on_nodes(h), *exact]
        assert found[:2] == pytest.approx(expected[:2], abs=0.0051)
        assert found[2] == pytest.approx(expected[2], abs=0.51)
        assert found[3:] == pytest.approx(expected[3:], abs=0.0051)

    holds(1)
    node.press("ArrowRight")
    holds(1.05)
    node.press("End")
    holds(2)
    node.press("Home")
    holds(0.05)
    drag(tab, node, 40, -30)
    assert 0.5 < state_of(tab, node) < 2
    holds(state_of(tab, node))
    link_keeps(opened, tab, "fig-grid-nodes", f"h={node.get_attribute('aria-valuenow')}")


# ---------------------------------------------------------------- the front page


def test_the_bars_reorder(opened):
    tab = opened("front")
    ring = tab.get_by_role("slider", name="Step and ratio f/e")

    def holds(k, row):
        cell, (best, more) = MAP["gaps"][row][k], MAP["leaders"][row][k]
        order = sorted(cell, key=lambda name: cell[name][0])
        labels = tab.evaluate("""[...document.querySelectorAll("svg.kf-chart")[0].querySelectorAll("text[aria-hidden]")]
            .filter((one) => /^[A-Z]+$/.test(one.textContent)).map((one) => [Number(one.getAttribute("y")), one.textContent])""")
        assert [text for _, text in sorted(labels)] == [title(name) for name in order]
        status = tab.get_by_role("status").inner_text()
        assert status.startswith(f"Step {k}, f/e = {MAP['ratios'][row]:g}: {title(best)} leads")
        assert (f"{more} not significantly worse" in status) == (more > 0)

    holds(2, 2)
    for key, place in [
        ("ArrowUp", (2, 3)),
        ("ArrowRight", (3, 3)),
        ("Home", (0, 3)),
        ("ArrowUp", (0, 4)),
        ("End", (10, 4)),
    ]:
        ring.press(key)
        holds(*place)
    drag(tab, ring, -100, 60)
    k, row = (
        int(state_of(tab, ring)),
        MAP["ratios"].index(float(ring.get_attribute("aria-valuetext").split("= ")[1])),
    )
    assert k < 9 and row < 4
    holds(k, row)
    link_keeps(opened, tab, "front", f"k={k}")
