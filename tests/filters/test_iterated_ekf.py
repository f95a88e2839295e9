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


# ---------------------------------------------------------------- linearised: Gauss-Newton


def measured(model, runs, seed):
    """First measurements (1, runs, 2)."""
    return simulate(model, runs, 1, seed=seed).y


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
