"""Proposals that look at the measurement, against the posteriors they approximate; particles as the bound of vector models."""

import numpy as np
import pytest
from scipy import stats

from kfcourse import Model, compare, load_variants, run, simulate
from kfcourse.filters import aof, kalman_filter, particle, pointmass
from kfcourse.filters.proposals import Look
from kfcourse.lab.short_names import LAB, exact, has_bound, lab_filters
from kfcourse.symbolic.structure import gaussian

SIGMA = 4


@pytest.fixture(scope="module")
def variants():
    return {name: variant.model for name, variant in load_variants().items()}


@pytest.fixture(scope="module")
def linear():
    return Model.define(
        ["x1 + 0.2*x2 + 0.1*v1", "0.9*x2 - 0.1*x1 + 0.3*v2"],
        ["x1 + 0.5*w1", "x2 + 0.3*x1 + 0.6*w2 + 0.2*w1"],
        prior={"mean": [1.0, -1.0], "variance": [[0.5, 0.1], [0.1, 0.4]]},
    )


# --- the proposal


def test_of_an_affine_meter_it_is_the_posterior(linear):
    look, y = Look.at_start(linear), np.array([[0.3, 1.2]])
    assert look.affine
    found = look.proposal(np.zeros((1, 2)), y, look.starts(), 0)
    posterior = kalman_filter(linear).step(kalman_filter(linear).init(1), y).posterior
    L = np.linalg.eigh(linear.prior.cov)
    L = L.eigenvectors * np.sqrt(L.eigenvalues)
    np.testing.assert_allclose(look.noise_of(found.mean)[0], posterior.mean, rtol=1e-10)
    np.testing.assert_allclose(L @ found.root[0, 0] @ found.root[0, 0].T @ L.T, posterior.cov.reshape(2, 2), rtol=1e-9)


def test_a_measurement_that_does_not_see_the_noise_leaves_it_alone(variants):
    """The oscillator's position is moved by its speed, and the noise by neither: y of the next step tells nothing of it."""
    assert Look.ahead(variants["20"]).blind
    assert not Look.ahead(variants["21"]).blind
    assert Look.ahead(variants["21"]).affine
    assert not Look.at_start(variants["21"]).affine
    assert not Look.ahead(variants["53"]).affine


@pytest.mark.parametrize("meter", ["x1 + 0.02*x1**2*w", "x1**2 + 0.3*w", "x1 + x2 + x1*x2 + 0.5*w"])
def test_draws_come_with_the_density_they_are_drawn_from(meter):
    """M of N(s; 0, I) / q(s) over draws from q is 1, and of that times s^2 it is 1, whatever q is."""
    n = 2 if "x2" in meter else 1
    model = Model.define([f"x{i + 1} + v{i + 1}" for i in range(n)], [meter.replace("w", "w1")])
    look = Look.at_start(model)
    y = np.array([[0.7]])
    found = look.proposal(np.zeros((1, n)), y, look.starts(), 0)
    count = 40_000
    s, logs = look.draw(found, np.random.default_rng(1), count)
    ratios = np.exp(logs[0])
    for values in (ratios, *(ratios[:, None] * s[0] ** 2).T):
        assert abs(values.mean() - 1) < SIGMA * values.std() / np.sqrt(count)
    assert ratios.max() <= 10 * (1 + 1e-12)  # a tenth is drawn from N(0, I) itself


# --- the filter


def error_variances(model, particles, runs, steps, seed=1, **options):
    """Mean square distance from the exact estimates over the exact variance, (steps,), and median effective numbers."""
    _, y = simulate(model, runs, steps, seed)
    expected = run(pointmass(model), y)
    one = particle(model, particles, **options)
    state, found, effective = one.init(runs), [], []
    for k in range(steps):
        state = one.step(state, y[k])
        found.append(((state.posterior.mean - expected.mean[k]) ** 2).mean() / expected.cov[k].mean())
        effective.append(np.median(state.memory.effective))
    return np.array(found), np.array(effective)


def test_on_variant_53_its_error_variance_is_within_5_per_cent_of_the_exact_one(variants):
    """By orthogonality D / D_exact - 1 = M|z - z_exact|^2 / D_exact.  The bootstrap filter's is hundreds at step 0."""
    found, effective = error_variances(variants["53"], 4000, 200, 4)
    assert (found < 0.05).all()
    assert (effective > 2000).all()
    plain, few = error_variances(variants["53"], 4000, 200, 1, guided=False)
    assert plain[0] > 1
    assert few[0] < 200


@pytest.mark.parametrize("name", ["2", "3", "5", "6", "7", "9", "10", "11"])
def test_it_is_near_the_exact_filter_on_every_scalar_variant(variants, name):
    """1000 particles, of which hundreds count: the median trajectory's distance is a few 1/1000 of its variance.

    Not the mean: a measurement that contradicts nearly all particles of the step before leaves few of them.
    """
    _, y = simulate(variants[name], 60, 5, 1)
    expected = run(pointmass(variants[name]), y)
    found = run(particle(variants[name], 1000), y)
    assert np.median((found.mean - expected.mean) ** 2 / expected.cov[..., 0]) < 0.005
    ratios = (found.cov / expected.cov).ravel()  # the mean is 1 up to the bias of a ratio, a few 1/1000
    assert abs(ratios.mean() - 1) < SIGMA * ratios.std() / np.sqrt(60) + 10 / 1000


def test_both_clouds_err_independently(variants):
    """The mean of (z* - z_a)(z* - z_b) is 0 within its error, while each cloud's own square is not."""
    model = variants["4"]
    _, y = simulate(model, 1000, 4, seed=3)
    expected = run(pointmass(model), y).mean
    one = particle(model, 100)
    state = one.init(1000)
    for k in range(4):
        state = one.step(state, y[k])
        a, b = ((expected[k] - half)[:, 0] for half in state.memory.halves)
        error = SIGMA * (a * b).std() / np.sqrt(1000)
        # a self-normalised estimate from 50 particles has a bias of at most 1/50 of its deviations, which counts squared
        assert abs((a * b).mean()) < error + (a * a).mean() / 50
        assert (a * a).mean() > error


# --- the bound of vector models


def test_the_gap_from_particles_is_that_of_the_exact_filter(variants):
    """Variant 5 with both: the gaps of all filters agree within 4 standard errors, although each cloud errs by some per cent."""
    model = variants["5"]
    filters = lab_filters(model)
    results = [
        compare([*filters, one], model, 1000, 6, 3, progress=False)
        for one in (pointmass(model), particle(model, 100, name="aof-exact"))
    ]
    for name in LAB:
        near, sampled = (result.gap(name) for result in results)
        paired = np.hypot(near.standard_error, sampled.standard_error)
        assert (abs(near.value - sampled.value) < SIGMA * paired).all(), name
    exact, by_particles = (result.bound() for result in results)
    assert (abs(exact.value - by_particles.value) < SIGMA * np.hypot(exact.standard_error, by_particles.standard_error)).all()


def test_on_a_linear_vector_model_the_gap_of_the_kalman_filter_is_nothing(linear):
    filters = [aof(gaussian(linear)), particle(linear, 200, name="aof-exact")]
    result = compare(filters, linear, 800, 6, 1, progress=False)
    gap, bound = result.gap("aof-gaussian"), result.bound()
    # 100 particles a cloud: a bias of 1/100 of a deviation, squared
    assert (abs(gap.value) < SIGMA * gap.standard_error + 1e-3).all()
    truth = np.trace(run(kalman_filter(linear), np.zeros((6, 1, 2))).cov[:, 0], axis1=1, axis2=2)
    assert (abs(bound.value - truth) < SIGMA * bound.standard_error).all()


def test_vector_variants_have_a_bound(variants):
    for name in ("20", "21"):
        assert has_bound(variants[name])
        filters = [*lab_filters(variants[name], ["aof-gaussian", "duof"]), exact(variants[name])]
        result = compare(filters, variants[name], 112, 5, 1, progress=False)
        assert result.has_bound
        for one in result.entrants:
            gap = result.gap(one)
            assert (gap.value > -SIGMA * gap.standard_error).all(), (name, one)
    assert not has_bound(Model.define("x + v", "x + w**2"))


def test_the_variance_claimed_is_unbiased(linear):
    """The posterior's covariance is the same for all y: the mean over runs within 4 standard errors, 20 particles a cloud."""
    _, y = simulate(linear, 2000, 1, seed=2)
    claimed = run(particle(linear, 40), y).cov[0]
    expected = run(kalman_filter(linear), y).cov[0, 0]
    error = stats.sem(claimed, axis=0)
    # importance weights of the first step are constant here: no bias but that of rounding
    assert (abs(claimed.mean(axis=0) - expected) < SIGMA * error).all()


def test_it_is_guided_in_models_that_depend_on_the_step_too():
    """Meter and noise change with k: the Kalman filter's estimates within 4 errors of the sampling; most particles count."""
    model = Model.define("0.9*x + (1 + 0.2*k)*v", "(2 - 0.3*k)*x + 0.05*(1 + k)*w")
    _, y = simulate(model, 50, 4, 1)
    expected = run(kalman_filter(model), y)
    one = particle(model, 1000)
    state = one.init(50)
    for k in range(4):
        state = one.step(state, y[k])
        distance = (state.posterior.mean - expected.mean[k])[:, 0] / np.sqrt(expected.cov[k, :, 0, 0])
        assert (state.memory.effective > 500).all()
        assert (abs(distance) < SIGMA * np.sqrt(1.5 / state.memory.effective)).all()


def test_an_angle_that_is_measured_is_found_the_short_way_round():
    """A direction near pi, measured sharply as one near -pi: guided particles find it, and most of them count."""
    model = Model.define("x + 0.3*v", "x + 0.01*w", prior={"mean": 3.0, "variance": 0.04}, angles={"x": ["x"], "y": ["y"]})
    one = particle(model, 400)
    state = one.step(one.init(3), np.full((3, 1), -3.1))
    turned = 2 * np.pi - 3.1
    expected = 3.0 + 0.04 / (0.04 + 1e-4) * (turned - 3.0) - 2 * np.pi
    assert (state.memory.effective > 200).all()
    assert (abs(state.posterior.mean - expected) < SIGMA * 0.01 / np.sqrt(200)).all()
    state = one.step(state, np.full((3, 1), 3.1))
    assert (state.memory.effective > 200).all()
    assert (abs(state.posterior.mean - 3.1) < 0.005).all()
