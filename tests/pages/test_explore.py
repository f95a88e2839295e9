"""Figures that answer, in a real browser: by keyboard, mouse and finger; from a file, offline;
still without scripts; their numbers are the package's or NumPy's, and a link keeps them."""

import gzip

import numpy as np
import pytest
import sympy as sp
from answering import (
    BEATS,
    DRAWS,
    MADE,
    MAP,
    RECORD,
    WALK,
    WALKED,
    drag,
    fragment,
    html,
    numbers_of,
    state_of,
    x,
    y,
)
from scipy.stats import norm

from kfcourse import Model, linearised, predictions, run
from kfcourse.filters import aof, kalman_filter
from kfcourse.lab import title
from kfcourse.linear.consistency import autocorrelation, innovations, nees, nis
from kfcourse.pages.scenes import FAULTS, HIDDEN

# ---------------------------------------------------------------- every figure


@pytest.mark.parametrize("name", MADE)
def test_first_frame_on_a_phone_and_on_paper_and_without_scripts(opened, name):
    # at most 150 kB more for its page, compressed; these are read without compression too
    assert len(gzip.compress(html(name).encode())) < 60_000
    tab = opened(name, viewport={"width": 390, "height": 800})
    assert not tab.evaluate("document.documentElement.scrollWidth > innerWidth")
    for control in tab.locator(".kf-explore :is(input, select, button, [role=slider])").all():
        assert control.get_attribute("aria-label") or control.inner_text()
    for chart in tab.locator("svg.kf-chart").all():
        assert len(chart.get_attribute("aria-label")) > 30
    assert not tab.locator("img").is_visible()  # the figure took its place, within the same figure
    assert tab.locator(f"#{name} svg.kf-chart").first.is_visible()
    assert tab.locator(f"#{name} figcaption").is_visible()
    tab.emulate_media(media="print")
    assert tab.locator("img").is_visible() and not tab.locator(".kf-explore").is_visible()
    still = opened(name, java_script_enabled=False)
    assert still.locator("img").is_visible() and still.locator(".kf-explore svg").count() == 0


# ---------------------------------------------------------------- what the status line must show


def by_quadrature(place: float) -> list[float]:
    """Measured distance, per cent of a state below 0, mean, its density and the highest one."""
    t, measured = np.linspace(-6, 6, 20_001), float(np.hypot(place, 1))
    density = sp.lambdify(x, BEATS[0])(t) * sp.lambdify((x, y), BEATS[1])(t, measured)
    density /= density.sum() * (t[1] - t[0])
    mean = (t * density).sum() * (t[1] - t[0])
    below = 100 * density[t < 0].sum() * (t[1] - t[0])
    return [measured, below, mean, np.interp(mean, t, density), density.max()]


def lines_by_quadrature(mean: float, variance: float) -> list[float]:
    """The tangent of the sine, and its best line by the normal equations."""
    t, weights = np.polynomial.hermite_e.hermegauss(60)
    u, of = np.sqrt(variance) * t, weights / weights.sum()
    signal = np.sin(mean + u)
    level, slope = np.linalg.lstsq(
        np.sqrt(of)[:, None] * np.c_[u**0, u], np.sqrt(of) * signal, rcond=None
    )[0]
    size = np.sqrt(of @ (signal - level - slope * u) ** 2)
    return [mean, variance, np.sin(mean), np.cos(mean), level, slope, size]


def gains_and_estimates(lam: float, measured: float, p: float) -> list[float]:
    """One step of the AOF from the estimate and its variance p before, of the FOS with T, and of
    the DUOF."""
    z, gains = lam / 0.9, []
    for spread in (p, 0.001):
        Psi = 0.81 * spread + 0.05**2 * (z**2 + spread)
        t, weights = np.polynomial.hermite_e.hermegauss(20)
        F = Psi + 0.02**2 * ((lam + np.sqrt(Psi) * t) ** 4 @ weights) / weights.sum()
        gains.append(Psi / F)
    gains.append(0.8)
    estimates = lam + np.array(gains) * (measured - lam) + [0, 0, 0.01]
    return [lam, measured, *gains, *estimates]


def estimates(y1: float, Q: float, R: float) -> list[float]:
    """By the package: the estimate at step 1, which has not forgotten the first law, and the half
    width of its band; then the same with the measurement as it was."""
    model, numbers = Model.define("c*x + e*v", "x + f*w", dict(c=0.9, e=Q**0.5, f=R**0.5)), [1]
    for measured in (y1, RECORD[1, 1]):
        record = np.concatenate([RECORD[1, :1], [measured], RECORD[1, 2:]])
        law = run(kalman_filter(model), record[:, None, None])
        band = norm.ppf(0.975) * law.cov[1, 0, 0, 0] ** 0.5
        numbers += [measured, law.mean[1, 0, 0], band]
    return numbers


def three_tests(q: float, r: float) -> list[float]:
    """By the package: means of NEES and NIS, and the correlation of neighbours."""
    structure = linearised(WALK.replace(e=0.3 * q**0.5, f=r**0.5))
    seen = innovations(structure.measure, predictions(aof(structure), WALKED.y), WALKED.y)
    size = nis(seen).mean()
    error = nees(WALKED.x, run(aof(structure), WALKED.y)).mean()
    return [error, size, autocorrelation(seen, 1).value[0] / size]


def the_loop(k: float, draw: float, sigma: float) -> list[float]:
    way = [0.0]
    for n, v in DRAWS[int(draw) - 1].T:
        way.append(way[-1] - np.sin(way[-1]) / (sigma**2 + 1) + n / 5 + v * sigma / 10)
    lost = abs(round(way[-1] / (2 * np.pi)))
    return [k, way[int(k)] / (2 * np.pi), 2 / sigma, *([lost] if lost > 1 else [])]


def on_nodes(h: float) -> list[float]:
    """Distance and number of nodes, per cent on the heaviest, mean and standard deviation; and
    those of the finest nodes."""
    numbers = [h]
    for step in (h, 0.05):
        j = np.arange(-200, 201)
        node = step * j[np.abs(step * j) <= 5 + 1e-9]
        mass = norm.pdf(node, -1, 2**0.5) * norm.pdf(1.85, np.hypot(node, 1), 0.1)
        mass /= mass.sum()
        mean = mass @ node
        numbers += [len(node), 100 * mass.max()] if step == h and len(numbers) == 1 else []
        numbers += [mean, np.sqrt(mass @ (node - mean) ** 2)]
    return numbers


# Figures with sliders: the sliders, where they are first, which is moved by which key and to what,
# which is dragged how far, the numbers of the status line, and how far off these may be as printed.
ANSWERING = {
    "fig-two-beats": (
        ["Measured distance"],
        (1.96,),
        [(0, "ArrowLeft", 1.94), (0, "End", 5.5), (0, "PageDown", 5.3)],
        [(0, -60, 0, "place")],
        by_quadrature,
        # the mean's density is read at the nearest of nodes 0.0375 apart, and changes by 1/sd times
        # its top over a deviation of 0.2: by a tenth of the top at most
        lambda expected: [0.0051, 1.0, 0.011, 0.1 * expected[4], 0.02 * expected[4]],
    ),
    "fig-better-line": (
        ["λ, mean of x", "Ψ, variance of x (rad²)"],
        (1, 0.4),
        [
            (1, "ArrowRight", 0.42),
            (0, "PageUp", 1.5),
            (1, "Home", 0.02),
            (0, "End", 3.5),
        ],
        [(0, -150, 40, "mean")],
        lines_by_quadrature,
        0.00051,
    ),
    "fig-lab-gains": (
        ["Prediction λ", "Measurement y", "p before, of the GAOF"],
        (2, 3, 0.006),
        [
            (1, "PageDown", 2.5),
            (2, "End", 0.02),
            (0, "Home", -2.8),
        ],
        [(0, 90, 0, "lambda"), (1, 60, 0, "y")],
        gains_and_estimates,
        0.00051,
    ),
    "fig-ten-minutes": (
        ["Measurement at step 1", "Q, of the kicks", "R, of the meter"],
        (5, 0.25, 1),
        [
            (0, "Home", -6),
            (1, "End", 100),
            (2, "Home", 0.01),
        ],
        [(0, 30, -80, "y")],
        estimates,
        0.0056,  # the record is rounded to four digits
    ),
    "fig-consistency-faults": (
        ["Multiply its Q by", "Multiply its R by"],
        (0.1, 1),
        [(0, "End", 1), (1, "Home", 0.1)],  # of the fault, a tenth: ten times is the cure
        [],
        three_tests,
        0.011,
    ),
    "fig-slips-ball": (
        ["Step to look at", "Random numbers", "σ of the meter (V)"],
        (30, 1, 2),
        [(0, "ArrowLeft", 29), (2, "End", 4), (1, "ArrowRight", 2), (0, "End", 100)],
        [(0, -100, 30, "k")],
        the_loop,
        0.0051,
    ),
    "fig-grid-nodes": (
        ["Distance of the nodes"],
        (1,),
        [(0, "ArrowRight", 1.05), (0, "End", 2), (0, "Home", 0.05)],
        [(0, 40, -30, "h")],
        on_nodes,
        lambda expected: [0.0051, 0.0051, 0.51, *[0.0051] * 4],
    ),
}


@pytest.mark.parametrize("name", ANSWERING)
def test_numbers_follow_the_sliders(opened, name):
    sliders, start, moves, dragged, numbers, allowed = ANSWERING[name]
    tab, place = opened(name), list(start)
    handles = [tab.get_by_role("slider", name=label) for label in sliders]

    def holds():
        expected = numbers(*place)
        error = np.abs(np.array(numbers_of(tab)[: len(expected)]) - expected)
        assert (error < (allowed(expected) if callable(allowed) else allowed)).all(), place

    holds()
    for i, key, value in moves:
        handles[i].press(key)
        place[i] = value
        holds()
    for i, dx, dy, parameter in dragged:
        before = place[i]
        drag(tab, handles[i], dx, dy)
        place[i] = state_of(tab, handles[i])
        assert abs(place[i] - before) > 0.2
        holds()
        part = f"{parameter}={handles[i].get_attribute('aria-valuenow')}"
        tab.wait_for_function("part => decodeURIComponent(location.hash).includes(part)", arg=part)
    if dragged:
        assert numbers_of(opened(name, fragment(tab))) == numbers_of(tab)


# ---------------------------------------------------------------- figures of their own kind


def rounds(tab) -> str:
    """The live lab's bound stands: its table as text."""
    tab.wait_for_selector(".kf-explore[data-done='400']", timeout=60_000)
    return tab.locator(".kf-numbers").inner_text()


@pytest.mark.slow
def test_the_lab_is_compared_and_a_link_keeps_it(opened):
    tab = opened("fig-live-lab", "#fig-live-lab?53.f=0.2&step=5")
    first = rounds(tab)
    rows = {row.split("\t")[0]: row.split("\t")[1:] for row in first.splitlines()[1:]}
    assert set(rows) == {"GAOF", "LAOF", "DUOF", "GFOS", "LFOS", "GMFOS", "LMFOS"}
    above = {name: float(cells[1].split(" ± ")[0]) for name, cells in rows.items()}
    # what the page tells to look for
    assert min(above, key=above.get) == "DUOF" and above["DUOF"] > 0
    assert "10,000 trajectories of 30 steps" in tab.get_by_role("status").inner_text()

    tab.get_by_role("slider", name="f", exact=True).press("Home")
    tab.wait_for_function("!document.querySelector('[data-done]').dataset.done.match('400')")
    assert rounds(tab) != first
    tab.wait_for_function("location.hash.includes('f=0.002')")
    again = opened("fig-live-lab", fragment(tab))
    assert rounds(again) == rounds(tab)  # the same numbers, from the link alone
    assert "step=5" in fragment(tab)

    handle, before = tab.get_by_role("slider", name="Step to look at"), rounds(tab)
    handle.press("ArrowRight")
    assert state_of(tab, handle) == 6 and rounds(tab) != before
    for key, step in (("End", 29), ("Home", 0)):
        handle.press(key)
        assert state_of(tab, handle) == step
    handle.scroll_into_view_if_needed()
    drag(tab, handle, 100, 0)
    assert 5 < state_of(tab, handle) < 15


def test_a_finger_moves_it_and_does_not_scroll(opened):
    tab = opened(
        "fig-two-beats", has_touch=True, is_mobile=True, viewport={"width": 390, "height": 500}
    )
    session, handle = (
        tab.context.new_cdp_session(tab),
        tab.get_by_role("slider", name="Measured distance"),
    )
    box, before = handle.locator("circle").last.bounding_box(), numbers_of(tab)[0]
    at = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    for kind, points in [
        ("touchStart", [at]),
        *[("touchMove", [(at[0] + 4 * i, at[1] + i)]) for i in range(10)],
        ("touchEnd", []),
    ]:
        session.send(
            "Input.dispatchTouchEvent",
            {"type": kind, "touchPoints": [{"x": a, "y": b} for a, b in points]},
        )
    tab.wait_for_function(
        "before => !document.querySelector('[role=status]').textContent.startsWith(`y = "
        "${before}`)",
        arg=f"{before:.2f}",
    )
    assert numbers_of(tab)[0] > before + 0.3
    assert tab.evaluate("scrollY") == 0


def test_a_hidden_fault_is_guessed(opened):
    letter, tab = "C", opened("fig-consistency-faults")
    which, guess = (
        tab.get_by_role("combobox", name="Filter"),
        tab.get_by_role("combobox", name="Which is wrong?"),
    )
    right = dict(zip("ABCDE", HIDDEN, strict=True))[letter]
    wrong = next(fault for fault in FAULTS if fault != right)
    which.select_option(letter)
    assert numbers_of(tab) == pytest.approx(three_tests(*FAULTS[right]), abs=0.011)
    status = tab.get_by_role("status")
    assert right not in status.inner_text()
    guess.select_option(wrong)
    assert "No: with" in status.inner_text() and right not in status.inner_text().replace(wrong, "")
    guess.select_option(right)
    assert status.inner_text().endswith(f"Yes: {right}.")
    which.select_option("example")
    assert guess.input_value() == "–" and "Yes" not in status.inner_text()


def test_the_bars_reorder(opened):
    tab = opened("front")
    ring = tab.get_by_role("slider", name="Step and ratio f/e")

    def holds(k, row):
        cell, (best, more) = MAP["gaps"][row][k], MAP["leaders"][row][k]
        order = sorted(cell, key=lambda name: cell[name][0])
        labels = tab.evaluate("""[...document.querySelectorAll("svg.kf-chart")[0].querySelectorAll("text[aria-hidden]")]
            .filter((e) => /^[A-Z]+$/.test(e.textContent)).map((e) => [Number(e.getAttribute("y")), e.textContent])""")
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
    k = int(state_of(tab, ring))
    row = MAP["ratios"].index(float(ring.get_attribute("aria-valuetext").split("= ")[1]))
    assert k < 9 and row < 4
    holds(k, row)
    tab.wait_for_function("k => location.hash.includes(`k=${k}`)", arg=k)
    assert numbers_of(opened("front", fragment(tab))) == numbers_of(tab)
