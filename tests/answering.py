"""Figures that answer, for tests: each figure of the book on a page of its own, and what is done
with it."""

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import sympy as sp

from kfcourse import Model, gaussian, linearised, load_variants, simulate
from kfcourse.pages import explore, scenes
from kfcourse.pages.exponents import log_normal

SCALAR = {
    name: variant
    for name, variant in load_variants().items()
    if variant.model.n == 1 == variant.model.p
}
STILL = (
    "data:image/svg+xml," + "%3Csvg xmlns='http://www.w3.org/2000/svg' width='300' height='100'/%3E"
)
ALONE = """<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>Figure</title></head><body>
<figure id="{name}"><img src="{still}" alt="still">{html}<figcaption>Caption</figcaption></figure></body></html>"""


x, y, following = sp.symbols("x y x_next", real=True)
PLACE = sp.sqrt(x**2 + 1)


def bell(at, mean, sd):
    return sp.exp(-((at - mean) ** 2) / (2 * sd**2)) / (sp.sqrt(2 * sp.pi) * sd)


BEATS = (bell(x, -1, sp.sqrt(2)), bell(y, PLACE, 0.2), bell(following, x + 0.5, 0.3))


def sine_and_lines() -> str:
    """As in the chapter on better lines."""
    model = Model.define("x + 0.1*v", "sin(x) + 0.05*w")
    first = dict(mean=1, variance=0.4)
    return explore.two_lines("fig-better-line", linearised(model), gaussian(model), first)


def lab_gains() -> str:
    """Three estimates at once, in the letters of the chapter on the lab's filters, with T = 0.001
    and H = 0.8."""
    lam, y, p = sp.symbols("lambda y p", real=True)
    Psi = sp.Rational("0.8125") * p + sp.Rational("0.0025") * (lam / sp.Rational("0.9")) ** 2
    F = Psi + sp.Rational("0.0004") * (lam**4 + 6 * lam**2 * Psi + 3 * Psi**2)
    best = lam + Psi / F * (y - lam)
    estimates = {
        "aof-gaussian": best,
        "fos-gaussian": best.subs(p, 0.001),
        "duof": lam + 0.8 * (y - lam) + 0.01,
    }
    return explore.gains(
        "fig-lab-gains",
        lam,
        y,
        p,
        estimates,
        [[0, 1], [1, 0.9]],
        (1e-5, 0.02),
        {"lambda": 2, "y": 3, "p": 0.006},
    )


def kalman_step(lam, Psi, y, Q=0.25, R=1):
    """As in the first chapter."""
    K = Psi / (Psi + R)
    z, p = lam + K * (y - lam), (1 - K) * Psi
    return z, p, 0.9 * z, 0.81 * p + Q


# states and measurements; any numbers will do
RECORD = np.random.default_rng(5).standard_normal((2, 60)).round(3)
WALK = Model.define(
    "c*x + e*v", "g*x + f*w", dict(c=0.95, e=0.3, g=1, f=1), prior=dict(variance=0.92)
)
WALKED = simulate(WALK, 50, 40, seed=3)
Delta, n, v = sp.symbols("Delta n v", real=True)
sigma = sp.Symbol("sigma", real=True)
SHAKEN = Delta - sp.sin(Delta) / (sigma**2 + 1) + n / 5 + v * sigma / 10
HILLS = (1 - sp.cos(Delta)) / sigma
DRAWS = np.random.default_rng(8).standard_normal((3, 2, 100)).round(3)
ONE_DISTANCE = sp.exp(log_normal(x, -1, 2) + log_normal(1.85, PLACE, sp.Rational(1, 100)))
MAP = json.loads(
    (Path(explore.__file__).parents[2] / "book" / "front-map.json").read_text(encoding="utf-8")
)

MADE = {
    "fig-live-lab": lambda: explore.live_lab(
        "fig-live-lab", {name: SCALAR[name] for name in ("53", "2", "3")}
    ),
    "fig-two-beats": lambda: explore.drawn(
        "fig-two-beats",
        "Correction and prediction",
        "two-beats",
        [
            explore.printed("prior", {"x": x}, BEATS[0]),
            explore.printed("likelihood", {"x": x}, BEATS[1], {y: "y"}),
            explore.printed("transition", {"x": x, "next": following}, BEATS[2]),
            explore.printed("place", {"x": x}, PLACE),
        ],
        2.2,
    ),
    "fig-better-line": sine_and_lines,
    "fig-lab-gains": lab_gains,
    "fig-ten-minutes": lambda: scenes.one_measurement(
        "fig-ten-minutes", kalman_step, *RECORD, 1, 5.0, (0, 1), (0.25, 1)
    ),
    "fig-consistency-faults": lambda: scenes.hidden_fault(
        "fig-consistency-faults", WALK, WALKED.x[..., 0], WALKED.y[..., 0]
    ),
    "fig-slips-ball": lambda: explore.drawn(
        "fig-slips-ball",
        "A ball on the potential",
        "slip",
        [
            explore.printed(
                "step", {"Delta": Delta, "n": n, "v": v}, {"Delta": SHAKEN}, {sigma: "sigma"}
            ),
            explore.printed("potential", {"Delta": Delta}, HILLS, {sigma: "sigma"}),
        ],
        {
            "noises": DRAWS.tolist(),
            "first": {"sigma": 2.0, "draw": 1, "k": 30},
            "range": (0.5, 4.0),
        },
    ),
    "fig-grid-nodes": lambda: explore.drawn(
        "fig-grid-nodes",
        "Masses on a grid",
        "grid-step",
        [explore.printed("density", {"x": x}, ONE_DISTANCE)],
        {"first": 1.0, "low": -5, "high": 5, "least": 0.05, "most": 2.0},
    ),
    "front": lambda: scenes.who_leads("front", MAP, (2, 0.4)),
}


@cache
def html(name: str) -> str:
    """A figure of the book as a piece of HTML."""
    return MADE[name]()


def fragment(tab) -> str:
    return tab.evaluate("decodeURIComponent(location.hash)")


def drag(tab, handle, dx: float, dy: float) -> None:
    box = handle.locator("circle").last.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    tab.mouse.move(x, y)
    tab.mouse.down()
    tab.mouse.move(x + dx, y + dy, steps=4)
    tab.mouse.up()


def state_of(tab, handle_or_slider) -> float:
    return float(handle_or_slider.get_attribute("aria-valuenow") or handle_or_slider.input_value())


def numbers_of(tab) -> list[float]:
    """The numbers of the status line: in their order."""
    text = tab.get_by_role("status").inner_text().replace("−", "-")
    return [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", text)]
