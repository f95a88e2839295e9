"""The net: numbers and formulas that must stay when code is rewritten, as they were before.

`golden.json` was written once, by `python tests/golden/test_golden.py` (this file), with the code
of version 0.2.0; whoever changes a number on purpose writes its part anew and says why.
Measurements are stored with the results, so that a simulator may change; ensembles for designs are
drawn here.
"""

import json
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from kfcourse import (
    JumpModel,
    ModelError,
    NoClosedForm,
    compare,
    design,
    gaussian,
    lab_filters,
    likelihood,
    linearised,
    load_variants,
    run,
    simulate,
    smooth,
)
from kfcourse.filters import EQUATIONS, Design, aof, latex, pointmass
from kfcourse.lab import FILTERS, LAB, Structures, find_variant
from kfcourse.lab.short_names import JUMP_FILTERS
from kfcourse.montecarlo.ensemble import Instant

PATH = Path(__file__).with_name("golden.json")
STEPS, RUNS = 6, 3
NAMES = [
    *load_variants(),
    "D1",
    "D2",
    "D3",
    "J1",
    "J1-lasting",
    "J1-overload",
    "J2",
    "J-switching",
    "J3",
    "J4",
]
VARIANTS = {name: find_variant(name).model for name in NAMES}
PLAIN = {name: model for name, model in VARIANTS.items() if not isinstance(model, JumpModel)}
JUMPS = {name: model for name, model in VARIANTS.items() if isinstance(model, JumpModel)}
SCALAR = [name for name, model in PLAIN.items() if model.n == model.p == 1]
KINDS = {"linearised": linearised, "gaussian": gaussian}
COMPARED = ("53", "5", "20")


def laws(n: int, count: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """Means (count, n) near the origin and covariances (count, n, n) of all sizes, for a look at
    structural functions."""
    rng = np.random.default_rng(53)
    roots = rng.standard_normal((count, n, n)) * np.exp(rng.uniform(-2, 0.5, (count, 1, 1)))
    return rng.standard_normal((count, n)), roots @ np.swapaxes(roots, -1, -2) + 1e-3 * np.eye(n)


@cache
def measurements(name: str) -> np.ndarray:
    """The stored record (STEPS, RUNS, p) of a variant; drawn where there is none yet."""
    known = stored().get(f"record {name}")
    return (
        simulate(VARIANTS[name], RUNS, STEPS, seed=1).y if known is None else np.array(known["y"])
    )


@cache
def drawn(name: str, runs: int = 2000) -> list[Instant]:
    """The trajectories of a variant on which its filters are designed."""
    model, rng = VARIANTS[name], np.random.default_rng(1)
    state, meter = (
        sp.lambdify(
            [*model.x, *noises, *model.known.symbols], list(equation.subs(model.values)), "numpy"
        )
        for equation, noises in ((model.state_equation, model.v), (model.meter_equation, model.w))
    )

    def draw(law):
        root = np.linalg.cholesky(law.cov + 0) if np.any(law.cov) else law.cov
        return law.mean + rng.standard_normal((runs, len(law.mean))) @ root.T

    def evaluate(function, x, noise, k):
        values = function(*x.T, *noise.T, *model.known.at(k))
        return np.stack([np.broadcast_to(value, (runs,)) for value in values], axis=-1)

    x, instants = draw(model.prior), []
    for k in range(STEPS):
        y, x_next = (
            evaluate(meter, x, draw(model.meter_noise), k),
            evaluate(state, x, draw(model.state_noise), k),
        )
        instants.append(Instant(x, y, x_next))
        x = x_next
    return instants


def record(name):
    return {"y": measurements(name)}


def structures(name):
    """tau, Theta; h, G, F, R; A, Q at twenty laws, and the formulas as they are printed."""
    model = PLAIN[name]
    z, p = laws(model.n)
    values = {}
    for kind, build in KINDS.items():
        try:
            structure = build(model)
        except (NoClosedForm, ModelError):
            continue
        values[f"{kind} latex"] = structure.latex()
        now = structure.at(2)
        for parts in (now.predict(z, p), now.measure(z, p)[:4], now.transition(z, p)):
            for i, part in enumerate(parts):
                values[f"{kind} {type(parts).__name__} {i}"] = part
    return values | {"latex": model.latex()}


def filters(name):
    """Estimates and variances of every filter, after the last two measurements; designed where they
    must be."""
    model, values = VARIANTS[name], {}
    for short in FILTERS:
        if short in ("aof-exact", "particle"):
            continue
        try:
            (built,) = lab_filters(model, [short])
        except (NoClosedForm, ModelError):
            continue
        if isinstance(built, Design):
            (built,) = design([built], drawn(name))
        posterior = run(built, measurements(name))
        values[f"{short} mean"], values[f"{short} cov"] = posterior.mean[-2:], posterior.cov[-2:]
    return values


def modes(name):
    """The same of filters with modes that need no design."""
    built_of = Structures(VARIANTS[name])
    values = {}
    for short in ("aof-jump-gaussian", "aof-jump-linearised", "imm", "gpb2", "aof-averaged"):
        try:
            posterior = run(JUMP_FILTERS[short].build(built_of), measurements(name))
        except (NoClosedForm, ModelError):
            continue
        values[f"{short} mean"], values[f"{short} cov"] = posterior.mean[-2:], posterior.cov[-2:]
    return values


def looking_back(name):
    """Smoother and likelihood of the extended Kalman filter."""
    ekf = aof(linearised(PLAIN[name]))
    smoothed = smooth(ekf, measurements(name))
    return {
        "mean": smoothed.mean,
        "cov": smoothed.cov,
        "likelihood": likelihood(ekf, measurements(name)),
    }


def exact(name):
    """Exact filter and smoother at their best accuracy."""
    filtered = pointmass(PLAIN[name], accuracy=1e-6)
    posterior, smoothed = run(filtered, measurements(name)), smooth(filtered, measurements(name))
    return {
        "mean": posterior.mean,
        "deviation": np.sqrt(posterior.cov[..., 0]),
        "smoothed mean": smoothed.mean,
        "smoothed deviation": np.sqrt(smoothed.cov[..., 0]),
    }


def comparison(name):
    """Error variances of the lab's filters, and their standard errors."""
    model = PLAIN[name]
    result = compare(lab_filters(model), model, 20_000, 10, seed=1)
    variances = {short: result.error_variance(short) for short in LAB}
    return {short: np.array([each.value, each.standard_error]) for short, each in variances.items()}


def equations(_):
    return {family: latex(printed) for family, printed in EQUATIONS.items()}


PARTS = {
    "record": (record, VARIANTS, 0.0),
    "structures": (structures, PLAIN, 1e-10),
    # regressions on windows of measurements lose some eight of sixteen digits
    "filters": (filters, PLAIN, 1e-8),
    "modes": (modes, JUMPS, 1e-9),
    "looking_back": (looking_back, PLAIN, 1e-9),
    "exact": (exact, SCALAR, 3e-3),
    "comparison": (comparison, COMPARED, 3.0),
    "equations": (equations, ["all"], 0.0),
}
# Four estimates of an object without noise tell one another to fifteen digits: measurements changed
# by 1e-15 move the filter by 2e-5, and its covariance by half a hundredth.  The Gaussian functions
# of the lander with a fault are quadratures, whose points are chosen for 1e-5 deviations.
LOOSE = {("filters D3", "fbp4-linearised"): 0.02}
LOOSE |= {("modes J3", name): 1e-4 for name in ("aof-jump-gaussian", "imm", "gpb2", "aof-averaged")}
CASES = [f"{part} {name}" for part, (_, names, _) in PARTS.items() for name in names]


@cache
def stored() -> dict:
    return json.loads(PATH.read_text(encoding="utf-8")) if PATH.exists() else {}


@pytest.mark.parametrize("case", CASES)
def test_what_was_so_is_so(case):
    part, _, name = case.partition(" ")
    compute, _, tolerance = PARTS[part]
    values, expected = compute(name), stored()[case]
    assert set(expected) <= set(values)
    for key, before in expected.items():
        if isinstance(before, str):
            assert values[key] == before, key
            continue
        now, before = np.asarray(values[key], dtype=float), np.array(before, dtype=float)
        # (error variance, standard error), of other trajectories than then
        if part == "comparison":
            assert np.all(abs(now[0] - before[0]) < tolerance * np.hypot(now[1], before[1])), key
            continue
        scale = before_deviation(expected, key) if part == "exact" else size_of(before, key)
        tolerance = LOOSE.get((case, key.split()[0]), PARTS[part][2])
        assert np.all(abs(now - before) <= tolerance * scale + 1e-300), (
            key,
            np.max(abs(now - before) / (scale + 1e-300)),
        )


def size_of(before, key):
    """Units of rounding: deviations for covariances, else the number itself or a part of the
    largest."""
    if key.endswith("cov"):
        deviation = np.sqrt(np.diagonal(before, axis1=-2, axis2=-1))
        return deviation[..., :, None] * deviation[..., None, :]
    return np.maximum(abs(before), 1e-3 * np.max(abs(before)))


def before_deviation(expected, key):
    """The posterior deviations in whose units the exact filter's numbers are compared."""
    smoothed = "smoothed " if key.startswith("smoothed") else ""
    return np.array(expected[f"{smoothed}deviation"])


def rounded(value):
    """What is stored: strings as they are, numbers with thirteen digits."""
    if isinstance(value, str):
        return value
    digits = [float(f"{number:.13g}") for number in np.ravel(value)]
    return np.reshape(digits, np.shape(value)).tolist()


if __name__ == "__main__":
    chosen = sys.argv[1:] or CASES  # such as "filters 53"
    written = dict(stored())
    for case in chosen:
        part, _, name = case.partition(" ")
        written[case] = {key: rounded(value) for key, value in PARTS[part][0](name).items()}
        print(case, flush=True)
    lines = [
        f"{json.dumps(case)}: {json.dumps(written[case])}" for case in CASES if case in written
    ]
    PATH.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
