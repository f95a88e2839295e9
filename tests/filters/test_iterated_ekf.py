"""The iterated filter: Gauss and Newton's method, and the printed equations at the tangent and with
sigma points."""

import re

import numpy as np
import pytest
import sympy as sp

from kfcourse.filters import notation as s
from kfcourse.filters.iterated_ekf import EQUATIONS, iterated
from kfcourse.montecarlo.ensemble import simulate
from kfcourse.montecarlo.experiment import run
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.quadrature import unscented
from kfcourse.symbolic.structure import linearised

PRIOR_MEAN, PRIOR_COV = np.array([3.0, 1.0]), np.array([[0.9, 0.3], [0.3, 0.6]])
NOISE = np.array([[0.04, 0.01], [0.01, 0.05]])


@pytest.fixture(scope="module")
def ranges() -> Model:
    """Range and a product, both curved over the prior; correlated noises."""
    return Model.define(
        ["x1 + 0.2*x2 + 0.1*v1", "0.9*x2 + 0.2*sin(x1) + 0.1*v2"],
        ["sqrt(x1**2 + x2**2) + w1", "x1*x2 + w2"],
        prior={"mean": PRIOR_MEAN, "variance": PRIOR_COV},
        meter_noise={"variance": NOISE},
    )


def meter(x):
    return np.array([np.hypot(*x), x[0] * x[1]])


def jacobian(x):
    return np.array([x / np.hypot(*x), [x[1], x[0]]])


# ---------------------------------------------------------------- linearised: Gauss-Newton


def gauss_newton(y, rounds):
    """Gauss-Newton for the MAP in the information form, one measurement, plain NumPy."""
    x = PRIOR_MEAN
    for _ in range(rounds):
        H, inverse = jacobian(x), np.linalg.inv(NOISE)
        information = np.linalg.inv(PRIOR_COV) + H.T @ inverse @ H
        slope = H.T @ inverse @ (y - meter(x)) + np.linalg.inv(PRIOR_COV) @ (PRIOR_MEAN - x)
        x = x + np.linalg.solve(information, slope)
    return x, np.linalg.inv(information)


def measured(model, runs, seed):
    """First measurements (1, runs, 2)."""
    return simulate(model, runs, 1, seed=seed).y


@pytest.mark.parametrize("rounds", [1, 2, 3, 6])
def test_each_round_is_a_step_of_gauss_and_newton(ranges, rounds):
    y = measured(ranges, 6, seed=4)
    found = run(iterated(linearised(ranges), rounds), y)
    for i in range(6):
        mean, cov = gauss_newton(y[0, i], rounds)
        # a few rounds of 2 x 2 solutions with condition below 1e3
        np.testing.assert_allclose(found.mean[0, i], mean, rtol=1e-10)
        np.testing.assert_allclose(found.cov[0, i], cov, rtol=1e-9, atol=1e-12)


# ---------------------------------------------------------------- moments: posterior linearisation


@pytest.mark.parametrize("build", [linearised, unscented])
def test_the_printed_equations_are_the_filter(ranges, build):
    """Gauss and Newton's method at the tangent, iterated posterior linearisation with sigma
    points."""
    y, rounds = measured(ranges, 1, seed=8), 3
    structure = build(ranges)
    values = {s.y: y[0, 0][:, None], s.lam: PRIOR_MEAN[:, None], s.Psi: PRIOR_COV}
    z_i, P_i = (symbol(name) for name in (r"z^{(i)}", r"p^{(i)}"))
    values |= {z_i: values[s.lam], P_i: values[s.Psi]}
    for _ in range(rounds):
        measurement = structure.measure(values[z_i][:, 0], values[P_i])
        values |= {
            symbol("h("): measurement.h[:, None],
            symbol("G("): measurement.G,
            symbol("F("): measurement.F,
        }
        for equation in EQUATIONS:
            arguments = sorted(equation.rhs.atoms(sp.MatrixSymbol), key=str)
            dummies = [
                sp.MatrixSymbol(f"M{j}", *argument.shape) for j, argument in enumerate(arguments)
            ]
            function = sp.lambdify(
                dummies, equation.rhs.xreplace(dict(zip(arguments, dummies, strict=True))), "numpy"
            )
            values[equation.lhs] = function(*(values[argument] for argument in arguments))
        values |= {z_i: values[symbol(r"z^{(i+1)}")], P_i: values[symbol(r"p^{(i+1)}")]}
    found = run(iterated(structure, rounds), y)
    # the printed forms lose a few digits where the meter is sharper than the prior
    np.testing.assert_allclose(found.mean[0, 0], values[z_i][:, 0], rtol=1e-10)
    np.testing.assert_allclose(found.cov[0, 0], values[P_i], rtol=1e-9, atol=1e-12)


def symbol(start):
    """The symbol of the printed equations whose LaTeX starts so."""
    every = set().union(
        *(q.lhs.atoms(sp.MatrixSymbol) | q.rhs.atoms(sp.MatrixSymbol) for q in EQUATIONS)
    )
    (one,) = [q for q in every if re.sub(r"^\{(.*)\}$", r"\1", q.name).startswith(start)]
    return one


# ---------------------------------------------------------------- missing measurements, shapes,
# errors


@pytest.mark.parametrize("iterations", [0, -1, 1.5, 2.0, True, "3", None, float("nan")])
def test_rounds_that_are_no_number_of_rounds_are_refused(ranges, iterations):
    with pytest.raises(ValueError, match="iterations must be a whole number, at least 1"):
        iterated(linearised(ranges), iterations)
