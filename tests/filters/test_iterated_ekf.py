"""The iterated filter: Gauss and Newton's method, and the printed equations at the tangent and with
sigma points."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_filters import Interpreter

from kfcourse import Model, linearised, run, simulate, unscented
from kfcourse.filters import iterated
from kfcourse.filters import notation as s
from kfcourse.filters.iterated_ekf import EQUATIONS

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


# a place z^(i) with its covariance, the next, and the structural functions there
Z, P = s.matrix(r"z^{(i)}", s.n, s.ONE), s.matrix(r"p^{(i)}", s.n, s.n)
Z_NEXT, P_NEXT = s.matrix(r"z^{(i+1)}", s.n, s.ONE), s.matrix(r"p^{(i+1)}", s.n, s.n)
THERE = [
    s.matrix(rf"{letter}(z^{{(i)}}, p^{{(i)}})", *shape)
    for letter, shape in (("h", (s.p, s.ONE)), ("G", (s.p, s.n)), ("F", (s.p, s.p)))
]


@pytest.mark.parametrize("build", [linearised, unscented])
def test_the_printed_equations_are_the_filter(ranges, build):
    """Gauss and Newton's method at the tangent, iterated posterior linearisation with sigma
    points."""
    y, rounds, structure = simulate(ranges, 3, 1, seed=8).y, 3, build(ranges)
    prior = {s.lam: np.tile(PRIOR_MEAN[:, None], (3, 1, 1)), s.Psi: np.tile(PRIOR_COV, (3, 1, 1))}
    z, p = prior.values()
    for _ in range(rounds):
        h, G, F, _ = structure.measure(z[..., 0], p)
        values = prior | {s.y: y[0][..., None], Z: z, P: p}
        for symbol, value in zip(THERE, (h[..., None], G, F), strict=True):
            values[symbol] = np.broadcast_to(value, (3, *value.shape[-2:]))
        printed = Interpreter(values, {}).execute(EQUATIONS)
        z, p = printed[Z_NEXT], printed[P_NEXT]
    law = run(iterated(structure, rounds), y)
    # the printed forms lose a few digits where the meter is sharper than the prior
    assert_allclose(law.mean[0], z[..., 0], rtol=1e-10)
    assert_allclose(law.cov[0], p, rtol=1e-9, atol=1e-12)
