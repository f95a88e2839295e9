"""No filter knows in which units the state and the measurement are written."""

from functools import partial

import numpy as np
import pytest
import sympy as sp

from kfcourse import Model, design, gauss_hermite, gaussian, likelihood, linearised, run, simulate, smooth, unscented
from kfcourse.filters import adaptive, aof, duof, fkp, fos, gated, iterated, mfos, pointmass, robust
from kfcourse.lab.variants import find_variant
from kfcourse.montecarlo.ensemble import Instant

pytestmark = pytest.mark.quick

# Old units in new ones.  They are powers of two: each number then rounds as before.
OF_STATE, OF_METER = np.array([2.0**20, 2.0**-30]), np.array([2.0**-11, -(2.0**16)])
ROUNDING = 1e-9  # in standard deviations, and of ln p: SymPy may order the terms of a formula otherwise
FILTERS = {
    **{f"aof({of.__name__})": lambda model, of=of: aof(of(model)) for of in (linearised, gaussian, unscented, gauss_hermite)},
    "iterated": lambda model: iterated(linearised(model)),
    "robust": lambda model: robust(linearised(model)),
    "gated": lambda model: gated(aof(linearised(model))),
    "adaptive": lambda model: adaptive(linearised(model)),
}
DESIGNS = [duof, *(lambda model, of=of: of(gaussian(model)) for of in (fos, mfos, partial(fkp, memory=2)))]


def in_units(model: Model) -> Model:
    """z = S x and u = T y in place of x and y, S and T diagonal."""
    s, t = OF_STATE[: model.n], OF_METER[: model.p]
    S, T = (sp.diag(*map(sp.Rational, some.tolist())) for some in (s, t))
    state, meter = model.state_equation.subs(model.values), model.meter_equation.subs(model.values)
    old = dict(zip(model.x, S.inv() * sp.Matrix(model.x), strict=True))
    return Model.define(
        list(S * state.subs(old)),
        list(T * meter.subs(old)),
        symbols={name: [str(one) for one in getattr(model, name)] for name in "xvw"},
        prior={"mean": s * model.prior.mean, "variance": s[:, None] * model.prior.cov * s},
        state_noise=dict(zip(("mean", "variance"), model.state_noise, strict=True)),
        meter_noise=dict(zip(("mean", "variance"), model.meter_noise, strict=True)),
    )


def assert_same(found, expected):
    """Laws in new units and in old ones: both as in old ones, in standard deviations."""
    s = OF_STATE[: expected.mean.shape[-1]]
    sd = np.sqrt(np.diagonal(expected.cov, axis1=-2, axis2=-1))
    np.testing.assert_allclose(found.mean / s / sd, expected.mean / sd, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(
        found.cov / s / s[:, None] / sd[..., None] / sd[..., None, :],
        expected.cov / sd[..., None] / sd[..., None, :],
        rtol=0,
        atol=ROUNDING,
    )


@pytest.mark.parametrize("name", ["3", "9", "20", "21"])
def test_filters_smoothers_and_likelihoods_are_the_same_in_other_units(name):
    model = find_variant(name).model
    other, y = in_units(model), simulate(model, 20, 8, seed=1).y.copy()
    y[3, ::3] = np.nan
    seen, log_of_units = OF_METER[: model.p] * y, np.log(np.abs(OF_METER[: model.p])).sum()
    exact = {"pointmass": lambda one: pointmass(one, accuracy=1e-6)} if model.n == model.p == 1 else {}
    for build in {**FILTERS, **exact}.values():
        assert_same(run(build(other), seen), run(build(model), y))
        assert_same(smooth(build(other), seen), smooth(build(model), y))
        expected = likelihood(build(model), y) - np.where(np.isnan(y[..., 0]), 0, log_of_units)
        np.testing.assert_allclose(likelihood(build(other), seen), expected, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("name", ["53", "9", "20"])
def test_designs_from_the_same_trajectories_are_the_same_in_other_units(name):
    model, steps = find_variant(name).model, 5
    other, s, t = in_units(model), OF_STATE, OF_METER
    x, y = simulate(model, 400, steps + 1, seed=2)
    z, u = s[: model.n] * x, t[: model.p] * y
    here = design([of(model) for of in DESIGNS], (Instant(x[k], y[k], x[k + 1]) for k in range(steps)))
    there = design([of(other) for of in DESIGNS], (Instant(z[k], u[k], z[k + 1]) for k in range(steps)))
    for one, another in zip(here, there, strict=True):
        assert_same(run(another, u[:steps, :50]), run(one, y[:steps, :50]))
