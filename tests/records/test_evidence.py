"""The likelihood of a record: a dense normal density, the Nile's figure, brute force, and what has none."""

from dataclasses import replace

import numpy as np
import oracles
import pytest

from kfcourse import Model, gaussian, likelihood, linearised, run, simulate, unscented
from kfcourse.filters import aof, duof, iterated, kalman_filter
from kfcourse.montecarlo.designing import design
from kfcourse.montecarlo.ensemble import Ensemble
from kfcourse.scenarios.benchmarks import local_level, nile

pytestmark = pytest.mark.quick

FILTERS = {
    "kalman": kalman_filter,
    "linearised": lambda model: aof(linearised(model)),
    "gaussian": lambda model: aof(gaussian(model)),
    "unscented": lambda model: aof(unscented(model)),
    "iterated": lambda model: iterated(gaussian(model), 3),
}


@pytest.mark.parametrize("kind", FILTERS)
def test_on_a_linear_model_it_is_the_density_of_the_whole_record(kind):
    """Matrices that change with the step, noises with means and correlations, whole measurements and components missing."""
    prior = np.array([1.0, -2.0]), np.array([[2.0, 0.5], [0.5, 1.0]])
    V, W = np.array([[1.0, 0.3], [0.3, 2.0]]), np.array([[1.0, 0.6], [0.6, 2.0]])
    model = Model.define(
        ["(0.9 + 0.05*k)*x1 + 0.4*x2 + v1", "0.8*x2 - 0.3*x1 + v2 + 1"], ["x1 + 2*x2 + w1 - k", "x2 - (0.5 + 0.1*k)*x1 + w2"],
        prior={"mean": prior[0], "variance": prior[1]}, state_noise={"variance": V},
        meter_noise={"mean": [0.4, 0], "variance": W},
    )  # fmt: skip
    steps = [
        (
            np.array([[0.9 + 0.05 * k, 0.4], [-0.3, 0.8]]), np.array([0, 1.0]), V,
            np.array([[1, 2], [-0.5 - 0.1 * k, 1]]), np.array([0.4 - k, 0]), W,
        )
        for k in range(8)
    ]  # fmt: skip
    y = simulate(model, 3, 8, seed=3).y.copy()
    y[2, 1] = y[4, 2, 0] = y[7, 2, 1] = y[0, 1] = np.nan
    found = likelihood(FILTERS[kind](model), y)
    assert found.shape == (8, 3)
    assert found[2, 1] == found[0, 1] == 0
    expected = [oracles.joint_posterior(steps, prior, y[:, i])[2] for i in range(3)]
    np.testing.assert_allclose(found.sum(axis=0), expected, rtol=1e-11)  # a 16 x 16 determinant against eight of 2 x 2


def test_the_flow_of_the_nile_has_its_likelihood():
    for build in FILTERS.values():
        assert likelihood(build(local_level()), nile()).sum() == pytest.approx(-641.5856, abs=5e-5)


def test_an_angle_s_innovation_goes_the_short_way_round():
    model = Model.define("x + 0.1*v", "x + 0.3*w", angles={"x": ["x"], "y": ["y"]}, prior={"mean": 3.1, "variance": 0.01})
    plain = Model.define("x + 0.1*v", "x + 0.3*w", prior={"mean": 3.1, "variance": 0.01})
    y = 3.1 + 0.2 * np.sin(np.arange(9.0))
    wrapped = y - 2 * np.pi * np.round(y / (2 * np.pi))
    assert wrapped.min() < -3 < 3 < wrapped.max()
    for build in FILTERS.values():
        np.testing.assert_allclose(likelihood(build(model), wrapped), likelihood(kalman_filter(plain), y), rtol=1e-9)


def brute_force(e, y):
    """ln p(y_0), ln p(y_1 | y_0) of the curved model below: sums over both states."""

    def density(value, mean, sigma):
        return np.exp(-0.5 * ((value - mean) / sigma) ** 2) / (np.sqrt(2 * np.pi) * sigma)

    x = np.linspace(-3, 5, 1601)
    step = x[1] - x[0]
    first = density(x, 1.0, 0.5) * density(y[0], x + e * x**2, 0.3 * np.exp(e * x))
    second = (first @ density(x[None], 0.9 * x[:, None] + e * x[:, None] ** 2, 0.2)) * density(
        y[1], x + e * x**2, 0.3 * np.exp(e * x)
    )
    return np.log([first.sum() * step, second.sum() / first.sum() * step])


@pytest.mark.parametrize("kind", ["gaussian", "linearised", "unscented"])
def test_under_a_mild_curvature_each_part_is_the_density_but_for_the_curvature(kind):
    off, y = [], np.array([1.6, 0.5])
    for e in (0.05, 0.025):
        model = Model.define(
            "0.9*x + e*x**2 + 0.2*v", "x + e*x**2 + 0.3*exp(e*x)*w", {"e": e}, prior={"mean": 1.0, "variance": 0.25}
        )
        off.append(likelihood(FILTERS[kind](model), y).ravel() - brute_force(e, y))
    assert np.abs(off[0]).max() < 0.06
    np.testing.assert_allclose(off[1], off[0] / 2, rtol=0, atol=0.2 * np.abs(off[0]).max())


def test_nothing_is_computed_where_nobody_asks():
    """The lab's run pays nothing for likelihood and looking back: both are found from the states afterwards."""
    calls = []
    structure = linearised(local_level())
    counted = replace(
        structure,
        measure=lambda m, d: calls.append("measure") or structure.measure(m, d),
        transition=lambda z, p: calls.append("transition") or structure.transition(z, p),
    )
    run(aof(counted), nile())
    assert calls == ["measure"] * 100


def test_what_has_no_density_is_told():
    model = Model.define("0.9*x + v", "x + w")
    (designed,) = design([duof(model)], Ensemble(model, 100, 3, seed=1).by_step())
    with pytest.raises(ValueError, match=f"the likelihood needs the structural functions.*{designed.name} has none"):
        likelihood(designed, np.zeros((3, 1, 1)))
    known = Model.define(["x1"], ["x1", "x1"], prior={"mean": [1.0]}, symbols={"x": ["x1"]})
    with pytest.raises(
        ValueError, match=r"no density for the measurement of step 0, run 0: .* give every component of the meter"
    ):
        likelihood(kalman_filter(known), np.ones((2, 1, 2)))
    with pytest.raises(ValueError, match="measurements must have the shape"):
        likelihood(kalman_filter(model), np.zeros((3, 2)))
