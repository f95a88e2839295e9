"""Figures that answer, each of one chapter, made as those of `explore`.

one_measurement    ten minutes: the band of a filter does not depend on what is measured
hidden_fault       consistency: three tests of a filter, and what is wrong with it
who_leads          the front page: the order of the lab's filters over the step and the noises
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import sympy as sp

from kfcourse.filters import aof
from kfcourse.lab.short_names import LAB
from kfcourse.laws import Array
from kfcourse.linear.consistency import autocorrelation, chi_squared_bounds, innovations
from kfcourse.montecarlo.comparison import Comparison
from kfcourse.montecarlo.experiment import predictions
from kfcourse.pages.browser import model_source
from kfcourse.pages.explore import drawn, look, printed, rounded
from kfcourse.records.examination import normal_bound
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import linearised

Z_95 = normal_bound()
FAULTS = {  # multiples of Q and R that a wrong filter has
    "Q is too small": (0.1, 1.0),
    "Q is too large": (10.0, 1.0),
    "R is too small": (1.0, 0.25),
    "R is too large": (1.0, 4.0),
    "nothing is": (1.0, 1.0),
}
HIDDEN = ("R is too small", "Q is too large", "nothing is", "R is too large", "Q is too small")
EXAMPLE = "Q is too small"
LAGS = 10  # steps between the innovations that are compared


def one_measurement(
    name: str,
    step: Callable[..., tuple[sp.Expr, ...]],
    x: Sequence[float],
    y: Sequence[float],
    at: int,
    first: float,
    prior: tuple[float, float],
    noises: tuple[float, float],
) -> str:
    """A filter over a record of which one measurement can be moved, and the noises that it believes
    in.

    Parameters
    ----------
    name : str
        Of the figure.
    step : function
        (lambda, Psi, y, Q, R) -> (z, p, next lambda, next Psi), also of SymPy's symbols: what the
        page shows is what runs.
    x, y : sequence of float
        States and measurements.
    at : int
        The step whose measurement is moved.
    first : float
        Where that measurement is shown first.
    prior : (float, float)
        Mean and variance before the first measurement.
    noises : (float, float)
        Variances of the noises by which the sliders of Q and R begin.
    """
    lam, Psi, measured, Q, R = sp.symbols("lambda Psi y Q R")
    z, p, lam_next, Psi_next = step(lam, Psi, measured, Q, R)
    given = {"lambda": lam, "Psi": Psi, "y": measured}
    made = {"z": z, "half": sp.Float(Z_95) * sp.sqrt(p), "lambda": lam_next, "Psi": Psi_next}
    loop = printed("step", given, made, {Q: "Q", R: "R"})
    settings = {
        "x": rounded([x])[0],
        "y": rounded([y])[0],
        "at": at,
        "prior": prior,
        "first": {"y": first, "Q": noises[0], "R": noises[1]},
        "noises": (0.01, 100.0),
    }
    return drawn(name, "A filter and one measurement", "one-measurement", [loop], settings)


def hidden_fault(name: str, model: Model, x: Array, y: Array) -> str:
    """Tests of a filter that has wrong noises, for a reader who says which.

    Parameters
    ----------
    name : str
        Of the figure.
    model : Model
        c x + e v, g x + f w, of which the records are.
    x, y : ndarray (steps, runs)
        States and measurements.
    """
    steps, runs = x.shape
    state, z, p, measured, h, F = sp.symbols("x z p y h F")
    parts = [
        f"const model = {model_source(model, ['aof-linearised'])};\n",
        printed("nees", {"x": state, "z": z, "p": p}, (state - z) ** 2 / p),
        printed("white", {"y": measured, "h": h, "F": F}, (measured - h) / sp.sqrt(F)),
    ]
    right, seen = linearised(model), y[..., None]
    white = autocorrelation(innovations(right.measure, predictions(aof(right), seen), seen), LAGS)
    by_lag = Z_95 * white.standard_deviation
    one_step = [[limit] * steps for limit in chi_squared_bounds(1, runs)]
    shown = [("example", f"Example: its {EXAMPLE}", EXAMPLE)]
    settings = {
        "x": rounded(x),
        "y": rounded(y),
        "faults": FAULTS,
        "hidden": shown
        + [
            (letter, f"Hidden {letter}", kind) for letter, kind in zip("ABCDE", HIDDEN, strict=True)
        ],
        "bounds": {
            "nees": one_step,
            "nis": one_step,
            "correlation": [(-by_lag).tolist(), by_lag.tolist()],
        },
    }
    return drawn(name, "Which noise is wrong?", "faults", parts, settings)


def leading(cells: dict[tuple[float, float], Comparison]) -> dict[str, Any]:
    """What `who_leads` shows of a map whose first parameter has one value: in per cent, with 95 %
    intervals.

    Returns
    -------
    dict
        "trajectories" that the exact filter had; "ratios" of the second parameter to the first;
        "gaps", of each ratio and step [value, low, high] by filter; "leaders", of each ratio and
        step the most accurate filter and how many others are not significantly worse.
    """
    ratios, gaps, leaders = [], [], []
    for (first, second), result in cells.items():
        ratios.append(float(f"{second / first:.3g}"))
        steps = range(len(result.gap(LAB[0]).value))
        of = {name: (result.gap(name).value, *result.gap(name).interval()) for name in LAB}
        gaps.append(
            [
                {
                    name: [round(100 * float(part[k]), 4) for part in parts]
                    for name, parts in of.items()
                }
                for k in steps
            ]
        )
        order = [result.leaders(k) for k in steps]
        leaders.append([(best, len(others)) for best, *others in order])
    exact = min(result.runs for result in cells.values())
    return {"trajectories": exact, "ratios": ratios, "gaps": gaps, "leaders": leaders}


def who_leads(name: str, leaders: Mapping[str, Any], first: tuple[int, float]) -> str:
    """The order of filters over the step and a ratio of noises.

    Parameters
    ----------
    name : str
        Of the figure.
    leaders : dict
        As `leading` returns it.
    first : (int, float)
        Step and ratio shown first.
    """
    looks = {name: look(name) for name in leaders["gaps"][0][0]}
    kinds = {look["colour"]: look["label"].lstrip("GL") for look in looks.values()}
    settings = {
        **leaders,
        "looks": looks,
        "kinds": [
            {"label": label, "colour": colour, "width": 9} for colour, label in kinds.items()
        ],
        "first": {"k": first[0], "ratio": leaders["ratios"].index(first[1])},
    }
    return drawn(name, "Which filter is the most accurate", "who-leads", [], settings)
