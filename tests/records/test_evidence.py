"""The likelihood of a record: a dense normal density, the Nile's figure, brute force, and what has none."""

from collections import Counter
from dataclasses import replace

import numpy as np
import oracles
import pytest

from kfcourse import Model, gaussian, likelihood, linearised, run, simulate, smooth, unscented
from kfcourse.filters import aof, duof, iterated, kalman_filter, particle, pointmass, robust
from kfcourse.lab.variants import find_variant
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


# ---------------------------------------------------------------- the exact filter, and particles


def test_the_exact_filter_s_is_the_kalman_filter_s_on_linear_models():
    for name in ("1", "k"):
        model = find_variant("1").model if name == "1" else Model.define("0.9*x + (0.3 + 0.1*k)*v", "x + k/10 + 0.5*w")
        y = simulate(model, 20, 20, seed=1).y.copy()
        y[3, 4] = y[5:8, 2] = np.nan
        found = likelihood(pointmass(model), y)
        assert np.abs(found - likelihood(kalman_filter(model), y)).max() < 1e-3  # the accuracy that was asked for
        assert (found[5:8, 2] == 0).all() and found[3, 4] == 0


def on_dense_grids(y):
    """ln p(y_k | y_0..k-1) on variant 53: 2,001 points over 16 standard deviations of the meter to both sides, at each step."""

    def density(value, mean, sigma):
        return np.exp(-0.5 * ((value - mean) / sigma) ** 2) / (np.sqrt(2 * np.pi) * sigma)

    mass, before, found = None, None, []
    for value in y:
        x = np.linspace(-1, 1, 2001) * 16 * 0.02 * value**2 + value
        predicted = density(x, 0, 1) if mass is None else density(x[:, None], 0.9 * before, 0.05 * np.abs(before)) @ mass
        joint = predicted * density(value, x, 0.02 * x**2) * (x[1] - x[0])
        found.append(np.log(joint.sum()))
        mass, before = joint / joint.sum(), x
    return np.array(found)


def test_on_variant_53_it_is_that_of_a_dense_grid():
    model = find_variant("53").model
    y = simulate(model, 6, 4, seed=3).y
    dense = np.stack([on_dense_grids(one) for one in y[:, :, 0].T], axis=1)
    assert np.abs(likelihood(pointmass(model), y) - dense).max() < 1e-3  # the accuracy that was asked for
    aside = np.abs(likelihood(aof(gaussian(model)), y) - dense).max()
    assert aside > 0.01  # the normal law's is another


def test_a_refined_exact_filter_moves_it_by_no_more_than_the_accuracy():
    for name in ("2", "6", "53"):
        model = find_variant(name).model
        y = simulate(model, 40, 8, seed=5).y
        rough, fine = (likelihood(pointmass(model, accuracy=accuracy), y) for accuracy in (1e-3, 1e-6))
        assert np.abs(rough - fine).max() < 40 * 1e-3, name  # 1e-3 a step, carried on over 40


def test_particles_estimate_it_without_bias():
    model = find_variant("1").model
    y = simulate(model, 200, 10, seed=1).y.copy()
    y[3, 4] = np.nan
    exact = likelihood(kalman_filter(model), y)
    for guided in (True, False):
        off = likelihood(particle(model, 400, seed=2, guided=guided), y) - exact
        assert off[3, 4] == 0
        # each record's mean weight is unbiased: M exp(off) = 1
        ratio = np.exp(off[0])
        assert abs(ratio.mean() - 1) < 4 * ratio.std() / np.sqrt(200)


@pytest.mark.parametrize("build", [aof, iterated, robust])
def test_nothing_is_computed_where_nobody_asks_and_nothing_twice(build):
    """The lab's run pays nothing for likelihood and looking back: both are found from the states afterwards.

    A likelihood takes what the filter expected anyway; a smoother A and Q of all steps but the last.
    """
    calls = []
    structure = linearised(local_level())
    counted = replace(
        structure,
        predict=lambda z, p: calls.append("predict") or structure.predict(z, p),
        measure=lambda m, d: calls.append("measure") or structure.measure(m, d),
        transition=lambda z, p: calls.append("transition") or structure.transition(z, p),
    )
    once = Counter(predict=100, measure=500 if build is iterated else 100)
    for what, more in ((run, {}), (likelihood, {}), (smooth, {"transition": 99})):
        calls.clear()
        what(build(counted), nile())
        assert Counter(calls) == once + Counter(more)


def test_what_has_no_density_is_told():
    model = Model.define("0.9*x + v", "x + w")
    (designed,) = design([duof(model)], Ensemble(model, 100, 3, seed=1))
    with pytest.raises(ValueError, match=f"the likelihood needs the structural functions.*{designed.name} has none"):
        likelihood(designed, np.zeros((3, 1, 1)))
    known = Model.define(["x1"], ["x1", "x1"], prior={"mean": [1.0]}, symbols={"x": ["x1"]})
    with pytest.raises(
        ValueError, match=r"no density for the measurement of step 0, run 0: .* give every component of the meter"
    ):
        likelihood(kalman_filter(known), np.ones((2, 1, 2)))
    with pytest.raises(ValueError, match="measurements must have the shape"):
        likelihood(kalman_filter(model), np.zeros((3, 2)))
