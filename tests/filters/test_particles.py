"""The particle filter against the exact one and the Kalman filter, within its Monte Carlo error."""

import numpy as np
import pytest
from scipy import stats

from kfcourse import Model, ModelError, load_variants, run, simulate
from kfcourse.filters import kalman_filter, particle, pointmass
from kfcourse.filters.densities import likelihood

pytestmark = pytest.mark.quick

PARTICLES, REPLICAS = 1000, 100


@pytest.fixture(scope="module")
def variants():
    return {name: variant.model for name, variant in load_variants().items()}


def replicas(model, y, seed=5):
    """Estimates (steps, runs, REPLICAS, n) and variances: each trajectory filtered many times with its own particles."""
    runs = y.shape[1]
    mean, cov = run(particle(model, PARTICLES, seed), np.repeat(y, REPLICAS, axis=1))
    shape = (len(y), runs, REPLICAS)
    return mean.reshape(*shape, model.n), np.diagonal(cov, axis1=-2, axis2=-1).reshape(*shape, model.n)


def agree(sample, expected, unit):
    """Mean over replicas (axis 2) equals the expected within 4 standard errors, and the bias of a ratio of sums over particles.

    The estimate is such a ratio, so its bias is a few 1/particles; "few" is the particles over the effective ones, below 10 here.
    """
    error = sample.mean(axis=2) - expected
    standard = sample.std(axis=2, ddof=1) / np.sqrt(REPLICAS)
    np.testing.assert_array_less(np.abs(error), 4 * standard + 10 / PARTICLES * unit)


@pytest.mark.parametrize("name", ["2", "5", "11"])
def test_it_equals_the_exact_filter_within_monte_carlo_error(variants, name):
    x, y = simulate(variants[name], 30, 6, seed=1)
    y = y[:, np.argsort(np.abs(x[0, :, 0]))[:5]]  # where the prior has particles: far out, few would be effective
    exact = run(pointmass(variants[name]), y)
    variance = exact.cov[..., 0]
    mean, own = replicas(variants[name], y)
    agree(mean, exact.mean, np.sqrt(variance))
    agree(own, variance, variance)


def test_on_a_linear_vector_model_it_is_the_kalman_filter_within_monte_carlo_error():
    model = Model.define(
        ["x1 + 0.2*x2 + 0.1*v1", "0.9*x2 - 0.1*x1 + 0.3*v2"],
        ["x1 + 0.5*w1", "x2 + 0.3*x1 + 0.6*w2 + 0.2*w1"],
        prior={"mean": [1.0, -1.0], "variance": [[0.5, 0.1], [0.1, 0.4]]},
    )
    _, y = simulate(model, 4, 6, seed=3)
    y[1, :, 0] = y[2, 1:3, 1] = y[4] = np.nan  # one of two measured, the other, none
    expected = run(kalman_filter(model), y)
    variance = np.diagonal(expected.cov, axis1=-2, axis2=-1)
    mean, own = replicas(model, y)
    agree(mean, expected.mean, np.sqrt(variance))
    agree(own, variance, variance)


def test_the_likelihood_is_the_normal_density_with_its_constant():
    x = np.array([[0.3, -1.0], [2.0, 0.5]])
    for meter, y in ((["x1*x2 + (1 + x2**2)*w1"], [0.7]), (["x1 + 0.5*w1", "x2**2 + x1*w2 + 0.2*w1"], [0.7, -0.4])):
        model = Model.define(["x1 + v1", "x2 + v2"], meter, meter_noise={"mean": 0.2, "variance": 1.5})
        found = likelihood(model)(np.array(y), x)
        for one, value in zip(x, found, strict=True):
            if len(y) == 1:
                mean, B = np.array([one[0] * one[1]]), np.array([[1 + one[1] ** 2]])
            else:
                mean, B = np.array([one[0], one[1] ** 2]), np.array([[0.5, 0], [0.2, one[0]]])
            expected = stats.multivariate_normal(mean + B @ np.full(len(B), 0.2), 1.5 * B @ B.T).logpdf(y)
            assert value == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("angles", [[], ["y1", "y2"]])
def test_of_a_measurement_with_a_missing_component_it_is_the_density_of_the_others(angles):
    state, meter, x = ["x1 + v1", "x2 + v2"], ["x1 + 2*w1", "x2**2 + x1*w2 + 0.2*w1"], np.array([[0.3, -1.0], [2.0, 0.5]])
    both = likelihood(Model.define(state, meter, angles=angles))
    for i, y in enumerate(([0.7, np.nan], [np.nan, -0.4])):
        kept = [f"y{i + 1}"] if angles else []
        names = {"w": ["w1", "w2"]}
        alone = likelihood(Model.define(state, [meter[i]], symbols=names, angles={"y": ["y"] if kept else []}))
        np.testing.assert_allclose(both(np.array(y), x), alone(np.array([y[i]]), x), rtol=1e-12)
    np.testing.assert_array_equal(both(np.full(2, np.nan), x), 0.0)


def test_the_prediction_is_the_law_of_the_predicted_particles():
    """Resampled, they all weigh the same: their mean, and their covariance with the divisor M."""
    model = Model.define(["x1 + 0.2*x2 + v1", "0.9*x2 + 1 + v2"], "x1 + 0.5*w", state_noise={"variance": [[0, 0], [0, 0]]})
    one = particle(model, 30)
    state = one.step(one.init(2), np.array([[0.4], [-0.7]]))
    for both, mean, cov in zip(state.memory.x, *state.predicted, strict=True):
        particles = both.reshape(30, 2) @ np.array([[1, 0.2], [0, 0.9]]).T + [0, 1]
        np.testing.assert_allclose(mean, particles.mean(axis=0), rtol=1e-13)
        np.testing.assert_allclose(cov, np.cov(particles.T, bias=True), rtol=1e-12)


def test_the_same_state_and_measurement_give_the_same_result(variants):
    one = particle(variants["2"], 50)
    _, y = simulate(variants["2"], 7, 2, seed=1)
    state = one.step(one.init(7), y[0])
    kept = state.memory.x.copy()
    first, second = one.step(state, y[1]), one.step(state, y[1])
    assert np.array_equal(first.posterior.mean, second.posterior.mean)
    assert np.array_equal(first.memory.x, second.memory.x)
    assert np.array_equal(state.memory.x, kept)


def test_it_is_reproducible_from_its_seed(variants):
    _, y = simulate(variants["20"], 3, 4, seed=1)
    again = [run(particle(variants["20"], 40, seed), y).mean for seed in (1, 1, 2)]
    assert np.array_equal(again[0], again[1])
    assert not np.array_equal(again[0], again[2])


def test_trajectories_have_particles_of_their_own(variants):
    one = particle(variants["2"], 30)
    state = one.step(one.init(2), np.array([[0.3], [0.3]]))
    assert not np.array_equal(state.memory.x[0], state.memory.x[1])


@pytest.mark.parametrize("name", ["53", "5", "20"])
def test_the_effective_number_is_between_one_and_all(variants, name):
    one = particle(variants[name], 64)
    _, y = simulate(variants[name], 20, 8, seed=2)
    state = one.init(20)
    assert np.array_equal(state.memory.effective, np.full(20, 64.0))
    for measurement in y:
        state = one.step(state, measurement)
        rounding = 64 * np.finfo(float).eps
        assert (state.memory.effective >= 1 - rounding).all()
        assert (state.memory.effective <= 64 * (1 + rounding)).all()


def test_a_missing_measurement_weighs_nothing(variants):
    one = particle(variants["2"], 64)
    state = one.step(one.init(3), np.full((3, 1), np.nan))
    np.testing.assert_allclose(state.memory.effective, 64, rtol=64 * np.finfo(float).eps)
    # equal weights: systematic resampling keeps every particle once
    np.testing.assert_allclose(state.posterior.mean, state.memory.x.mean(axis=(1, 2)), rtol=0, atol=1e-14)
    after = one.step(state, np.full((3, 1), np.nan))
    np.testing.assert_allclose(after.memory.effective, 64, rtol=64 * np.finfo(float).eps)


@pytest.mark.parametrize("value", [0.0, 1e3, -1e3, 1e150])
def test_no_measurement_makes_nan(variants, value):
    for name in ("53", "7", "12", "20"):
        y = np.full((3, 2, variants[name].p), value)
        estimates = run(particle(variants[name], 100), y)
        assert np.isfinite(estimates.mean).all(), name
        assert np.isfinite(estimates.cov).all(), name


def test_impossible_requests_are_refused(variants):
    for number in (1, 10.0):
        with pytest.raises(ModelError, match=f"at least 2 particles, got {number}"):
            particle(variants["2"], number)
    with pytest.raises(ModelError, match="noise enters nonlinearly"):
        particle(Model.define("x + v", "x + w**2"))


def test_a_nonlinear_noise_of_the_object_is_admitted():
    model = Model.define("0.5*x + v**2", "x + w")
    _, y = simulate(model, 2, 3, seed=1)
    assert np.isfinite(run(particle(model, 50), y).mean).all()
