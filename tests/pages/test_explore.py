"""Figures that answer, in a real browser: by keyboard, mouse and finger; from a file, offline;
still without scripts."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from answering import BEATS, MADE, drag, fragment, said, state_of, x, y

# ---------------------------------------------------------------- every figure


@pytest.mark.parametrize("name", MADE)
def test_first_frame_paper_and_no_scripts(opened, name):
    tab = opened(name)
    assert not tab.locator("img").is_visible()  # the figure took its place, within the same figure
    assert tab.locator(f"#{name} svg.kf-chart").first.is_visible()
    assert tab.locator(f"#{name} figcaption").is_visible()
    tab.emulate_media(media="print")
    assert tab.locator("img").is_visible() and not tab.locator(".kf-explore").is_visible()
    still = opened(name, java_script_enabled=False)
    assert still.locator("img").is_visible() and still.locator(".kf-explore svg").count() == 0


@pytest.mark.parametrize("name", MADE)
def test_it_fits_a_phone_and_says_what_it_is(opened, name):
    tab = opened(name, viewport={"width": 390, "height": 800})
    assert not tab.evaluate("document.documentElement.scrollWidth > innerWidth")
    for control in tab.locator(".kf-explore :is(input, select, button, [role=slider])").all():
        assert control.get_attribute("aria-label") or control.inner_text()
    for chart in tab.locator("svg.kf-chart").all():
        assert len(chart.get_attribute("aria-label")) > 30


# ---------------------------------------------------------------- the live lab


def rounds(tab) -> str:
    """The live lab's bound stands: its table as text."""
    tab.wait_for_selector(".kf-explore[data-done='400']", timeout=60_000)
    return tab.locator(".kf-numbers").inner_text()


def test_the_lab_is_compared_and_a_link_keeps_it(opened):
    tab = opened("fig-live-lab", "#fig-live-lab?53.f=0.2&step=5")
    first = rounds(tab)
    rows = {row.split("\t")[0]: row.split("\t")[1:] for row in first.splitlines()[1:]}
    assert set(rows) == {"GAOF", "LAOF", "DUOF", "GFOS", "LFOS", "GMFOS", "LMFOS"}
    above = {name: float(cells[1].split(" ± ")[0]) for name, cells in rows.items()}
    # what the page tells to look for
    assert min(above, key=above.get) == "DUOF" and above["DUOF"] > 0
    assert "10,000 trajectories of 30 steps" in tab.get_by_role("status").inner_text()

    slider = tab.get_by_role("slider", name="f", exact=True)
    slider.press("Home")
    tab.wait_for_function("!document.querySelector('[data-done]').dataset.done.match('400')")
    assert rounds(tab) != first
    tab.wait_for_function("location.hash.includes('f=0.002')")
    again = opened("fig-live-lab", fragment(tab))
    assert rounds(again) == rounds(tab)  # the same numbers, from the link alone
    assert "step=5" in fragment(tab)


def test_the_step_is_dragged_and_moved_by_keys(opened):
    tab = opened("fig-live-lab")
    rounds(tab)
    handle = tab.get_by_role("slider", name="Step to look at")
    before = tab.locator(".kf-numbers").inner_text()
    handle.press("ArrowRight")
    assert state_of(tab, handle) == 5 and tab.locator(".kf-numbers").inner_text() != before
    handle.press("End")
    assert state_of(tab, handle) == 29
    handle.press("Home")
    assert state_of(tab, handle) == 0
    handle.scroll_into_view_if_needed()
    drag(tab, handle, 100, 0)
    assert 5 < state_of(tab, handle) < 15


# ---------------------------------------------------------------- correction and prediction


def by_quadrature(measured: float) -> list[float]:
    t = np.linspace(-6, 6, 20_001)
    density = sp.lambdify(x, BEATS[0])(t) * sp.lambdify((x, y), BEATS[1])(t, measured)
    density /= density.sum() * (t[1] - t[0])
    mean = (t * density).sum() * (t[1] - t[0])
    return [
        measured,
        100 * density[t < 0].sum() * (t[1] - t[0]),
        mean,
        np.interp(mean, t, density),
        density.max(),
    ]


def test_the_measurement_is_moved_and_the_posterior_is_bayes(opened):
    tab = opened("fig-two-beats")
    handle = tab.get_by_role("slider", name="Measured distance")
    assert said(tab)[0] == pytest.approx(2.2, abs=0.005)
    for key, times in (("ArrowLeft", 3), ("PageUp", 4), ("Home", 1), ("End", 1), ("PageDown", 10)):
        for _ in range(times):
            handle.press(key)
        found, place = said(tab), state_of(tab, handle)
        # printed to 0.01, to a percent and to three digits; the mean's density is read at the
        # nearest of nodes 0.0375 apart, and changes by 1/sd times its top over a deviation of 0.2:
        # by a tenth of the top at most
        expected = by_quadrature(float(np.hypot(place, 1)))
        assert found[0] == pytest.approx(expected[0], abs=0.0051)
        assert found[1] == pytest.approx(expected[1], abs=1.0)
        assert found[2] == pytest.approx(expected[2], abs=0.011)
        assert found[3] == pytest.approx(expected[3], abs=0.1 * expected[4])
        assert found[4] == pytest.approx(expected[4], rel=0.02)
    drag(tab, handle, -60, 0)
    assert said(tab)[0] == pytest.approx(np.hypot(state_of(tab, handle), 1), abs=0.0051)
    tab.wait_for_function(
        "place => location.hash.endsWith(`place=${place}`)",
        arg=handle.get_attribute("aria-valuenow"),
    )
    assert said(opened("fig-two-beats", fragment(tab))) == said(tab)


def test_a_finger_moves_it_and_does_not_scroll(opened):
    tab = opened(
        "fig-two-beats", has_touch=True, is_mobile=True, viewport={"width": 390, "height": 500}
    )
    session, handle = (
        tab.context.new_cdp_session(tab),
        tab.get_by_role("slider", name="Measured distance"),
    )
    box, before = handle.locator("circle").last.bounding_box(), said(tab)[0]
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
    assert said(tab)[0] > before + 0.3
    assert tab.evaluate("scrollY") == 0


# ---------------------------------------------------------------- the tangent and the best line


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


def test_the_law_is_moved_and_the_line_is_of_least_squares(opened):
    tab = opened("fig-better-line")
    mean, variance = (
        tab.get_by_role("slider", name="λ, mean of x"),
        tab.get_by_role("slider", name="Ψ, variance of x (rad²)"),
    )
    assert said(tab)[:2] == [1, 0.4]
    for moved, key, place in [
        (mean, "ArrowLeft", (0.95, 0.4)),
        (variance, "ArrowRight", (0.95, 0.42)),
        (mean, "PageUp", (1.45, 0.42)),
        (variance, "End", (1.45, 1)),
        (mean, "Home", (-2, 1)),
        (variance, "Home", (-2, 0.02)),
        (mean, "End", (3.5, 0.02)),
    ]:
        moved.press(key)
        assert (state_of(tab, mean), state_of(tab, variance)) == place
        # printed to 0.001
        np.testing.assert_allclose(said(tab), lines_by_quadrature(*place), rtol=0, atol=0.00051)
    drag(tab, mean, -150, 40)
    assert 1 < state_of(tab, mean) < 3
    assert said(tab) == pytest.approx(lines_by_quadrature(state_of(tab, mean), 0.02), abs=0.00051)
    tab.wait_for_function(
        "place => location.hash.includes(`mean=${place}`)", arg=mean.get_attribute("aria-valuenow")
    )
    assert said(opened("fig-better-line", fragment(tab))) == said(tab)


# ---------------------------------------------------------------- gains


def gains_and_estimates(lam: float, measured: float, p: float) -> list[float]:
    """One step of the AOF from the estimate and its variance p before, of the FOS with T, and of
    the DUOF."""
    z = lam / 0.9
    found = []
    for spread in (p, 0.001):
        Psi = 0.81 * spread + 0.05**2 * (z**2 + spread)
        t, weights = np.polynomial.hermite_e.hermegauss(20)
        F = Psi + 0.02**2 * ((lam + np.sqrt(Psi) * t) ** 4 @ weights) / weights.sum()
        found.append(Psi / F)
    found.append(0.8)
    return [
        lam,
        measured,
        *found,
        *(lam + gain * (measured - lam) + e for gain, e in zip(found, (0, 0, 0.01), strict=True)),
    ]


def test_gains_follow_the_prediction_but_the_duofs_does_not(opened):
    tab = opened("fig-lab-gains")
    lam, measured = (
        tab.get_by_role("slider", name="Prediction λ"),
        tab.get_by_role("slider", name="Measurement y"),
    )
    variance = tab.get_by_role("slider", name="p before, of the GAOF")
    assert said(tab)[:2] == [2, 3]
    for moved, key, place in [
        (lam, "ArrowRight", (2.05, 3, 0.006)),
        (measured, "PageDown", (2.05, 2.5, 0.006)),
        (variance, "End", (2.05, 2.5, 0.02)),
        (lam, "Home", (-2.8, 2.5, 0.02)),
        (variance, "Home", (-2.8, 2.5, 1e-5)),
        (measured, "Home", (-2.8, -3.8, 1e-5)),
    ]:
        before = said(tab)
        moved.press(key)
        # printed to 0.001
        assert said(tab) == pytest.approx(gains_and_estimates(*place), abs=0.00051)
        assert said(tab)[4] == before[4] == 0.8
        if moved is measured:
            assert said(tab)[2:5] == before[2:5]
    drag(tab, lam, 90, 0)
    assert -2.5 < state_of(tab, lam) < 0
    assert said(tab) == pytest.approx(
        gains_and_estimates(state_of(tab, lam), -3.8, 1e-5), abs=0.00051
    )
    drag(tab, measured, 60, 0)
    assert said(tab) == pytest.approx(
        gains_and_estimates(state_of(tab, lam), state_of(tab, measured), 1e-5), abs=0.00051
    )
    tab.wait_for_function(
        "place => location.hash.includes(`y=${place}`)", arg=measured.get_attribute("aria-valuenow")
    )
    assert said(opened("fig-lab-gains", fragment(tab))) == said(tab)
