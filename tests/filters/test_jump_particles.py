"""Particles of models that jump, against sums over all histories and the exact filter."""

import math
from itertools import product

import numpy as np
import pytest

from kfcourse import JumpModel, Model, ModelError, compare, likelihood, linearised, simulate
from kfcourse.filters import densities, jump_particle, kalman_filter, logic_dynamic, pointmass
from kfcourse.lab.short_names import exact
from kfcourse.lab.variants import find_variant
from kfcourse.linear.system import linear_system
from kfcourse.montecarlo.experiment import run

REPLICAS, SOME = 60, 3  # each trajectory filtered many times with its own particles
PRIOR = {"mean": [1.0, -0.5], "variance": [[1.0, 0.3], [0.3, 0.8]]}
METERS = {"sound": {}, "faulty": {"parameters": {"f": 4.0}}}


def moving(modes=None, transition=((0.8, 0.2), (0.4, 0.6))):
    """Two states, two meters; one mode fails in its meter, the other turns, too."""
    return JumpModel.define(
        ["x1 + 0.4*x2 + 0.3*v1", "c*x2 + 0.6*v2"],
        ["x1 + f*w1", "x1 - x2 + f*w2"],
        {"c": 0.9, "f": 0.5},
        modes=modes or {"sound": {}, "thrown": {"parameters": {"c": -0.7, "f": 1.5}}},
        transition=[list(row) for row in transition],
        first=[0.7, 0.3],
        prior=PRIOR,
    )


def histories(model, y):
    """Posterior of one trajectory, y (steps, p), by a Kalman filter for each of the J^steps histories of modes."""
    systems = [linear_system(mode) for mode in model.modes]
    logs, laws, last = [], [], []
    for modes in product(range(len(systems)), repeat=len(y)):
        log, (mean, cov) = math.log(model.first[modes[0]]), model.prior
        for k, (mode, value) in enumerate(zip(modes, y, strict=True)):
            system, a0, b0 = systems[mode]
            if k:
                log += math.log(model.transition_at(k - 1)[modes[k - 1], mode])
                mean, cov = system.A @ mean + a0, system.A @ cov @ system.A.T + system.Q
            S = system.H @ cov @ system.H.T + system.R
            nu = value - system.H @ mean - b0
            log += -0.5 * (nu @ np.linalg.solve(S, nu) + math.log(np.linalg.det(2 * math.pi * S)))
            K = cov @ system.H.T @ np.linalg.inv(S)
            mean, cov = mean + K @ nu, cov - K @ S @ K.T
        logs.append(log)
        laws.append((mean, cov))
        last.append(modes[-1])
    weights = np.exp(np.array(logs) - max(logs))
    evidence = max(logs) + math.log(weights.sum())
    weights /= weights.sum()
    means = np.array([mean for mean, _ in laws])
    z = weights @ means
    cov = sum(w * (one + np.outer(mean - z, mean - z)) for w, (mean, one) in zip(weights, laws, strict=True))
    return z, cov, np.bincount(last, weights, len(systems)), evidence


def follow(one, y):
    """Means, covariances, probabilities of modes, half the clouds' distance, and both halves of each step."""
    state, found = one.init(y.shape[1]), []
    for measured in y:
        state = one.step(state, measured)
        memory = state.memory
        found.append((*state.posterior, memory.probability, memory.apart(), np.moveaxis(memory.halves, 0, 1)))
    return [np.stack(column) for column in zip(*found, strict=True)]


def agree(sample, expected, unit, particles):
    """The mean over replicas (axis 1) is what is expected, within 5 standard errors and the bias of a ratio of sums.

    Five, as some hundred numbers are compared with standard errors known from 60.

    That is a few 1/particles; "few" is the particles over the effective ones, below 10 here.
    """
    error = sample.mean(axis=1) - expected
    standard = sample.std(axis=1, ddof=1) / np.sqrt(REPLICAS)
    np.testing.assert_array_less(np.abs(error), 5 * standard + 10 / particles * unit)


# --- against the exact posterior


@pytest.mark.parametrize(
    ("build", "model", "particles"),
    [(jump_particle, moving(), 1000), (jump_particle, moving(METERS), 1000)],
    ids=["both change", "meters"],
)
def test_on_linear_modes_it_is_the_sum_over_all_histories(build, model, particles):
    """Estimates, covariances, probabilities of modes; and the stated error is the error, of each cloud by itself, too."""
    y = simulate(model, SOME, 6, seed=3).y
    mean, cov, probability, stated, halves = follow(build(model, particles, seed=5), np.repeat(y, REPLICAS, axis=1))
    wrong, said, together = [], [], []
    for trajectory in range(SOME):
        some = slice(trajectory * REPLICAS, (trajectory + 1) * REPLICAS)
        for k in (0, 2, 5):
            z, variance, expected, _ = histories(model, y[: k + 1, trajectory])
            sd = np.sqrt(np.diagonal(variance))
            agree(mean[k, None, some], z, sd, particles)
            agree(cov[k, None, some], variance, np.outer(sd, sd), particles)
            agree(probability[k, None, some], expected, 0.5, particles)
            scale = np.linalg.norm(sd)
            wrong.append(((mean[k, some] - z) ** 2).sum(axis=1) / scale**2)
            said.append(stated[k, some] ** 2 / scale**2)
            a, b = np.moveaxis(halves[k, some] - z, 1, 0)
            together.append((a * b).sum(axis=1) / scale**2)
    wrong, said, together = (np.array(one) for one in (wrong, said, together))
    # 9 * 60 squares of one or two normal numbers on either side: 7 % of each, of which 4 are allowed
    assert said.mean() / wrong.mean() == pytest.approx(1, abs=0.35)
    # errors of the clouds do not know of each other: their product is 0 on the average, within 4 standard errors
    assert abs(together.mean()) < 4 * together.std() / np.sqrt(together.size) + (10 / particles) ** 2


def test_the_evidence_is_that_of_all_histories():
    model = moving()
    y = simulate(model, 3, 5, seed=8).y
    found = likelihood(jump_particle(model, 4000), y).sum(axis=0)
    for trajectory in range(3):
        # some 600 of 4000 weights count: 4 %, at some steps of the first anew
        assert abs(found[trajectory] - histories(model, y[:, trajectory])[3]) < 4 * 0.05


@pytest.mark.parametrize("name", ["J1-lasting", "J1-overload", "J-switching"])
def test_of_a_scalar_model_it_is_the_exact_filter(name):
    """Also with transitions that depend on the state."""
    model, particles = find_variant(name).model, 500
    y = simulate(model, 3, 8, seed=2).y
    mean, _, probability, *_ = follow(jump_particle(model, particles, seed=4), np.repeat(y, REPLICAS, axis=1))
    exactly, cov, of_modes = by_point_masses(model, y)
    for trajectory in range(3):
        some = slice(trajectory * REPLICAS, (trajectory + 1) * REPLICAS)
        for k in (0, 3, 7):
            sd = np.sqrt(cov[k, trajectory, 0])
            agree(mean[k, None, some], exactly[k, trajectory], sd, particles)
            agree(probability[k, None, some], of_modes[k, trajectory], 0.5, particles)


def by_point_masses(model, y):
    one, found = pointmass(model), []
    state = one.init(y.shape[1])
    for measured in y:
        state = one.step(state, measured)
        found.append((*state.posterior, state.memory.probability))
    return [np.stack(column) for column in zip(*found, strict=True)]


# --- as the bound of a comparison


def test_the_gap_found_by_particles_is_the_gap_to_the_sum_over_all_histories():
    model = moving()
    filters = [logic_dynamic([linearised(mode) for mode in model.modes], model, model.first)]
    result = compare([*filters, jump_particle(model, 200, name="aof-exact")], model, 2000, 5, 3, slow_runs=200, threads=1)
    y = simulate(model, 150, 4, seed=9).y
    z = np.stack([[histories(model, y[: k + 1, i])[0] for i in range(150)] for k in (1, 3)])
    own = run(filters[0], y).mean[[1, 3]]
    terms = ((own - z) ** 2).sum(axis=-1)
    excess = result.excess(filters[0].name)
    for place, k in enumerate((1, 3)):
        error = math.hypot(terms[place].std() / math.sqrt(150), float(excess.standard_error[k]))
        assert abs(float(excess.value[k]) - terms[place].mean()) < 4 * error


@pytest.mark.parametrize("name", ["J3", "J4", "D3"])
def test_an_object_without_noise_has_no_bound(name):
    with pytest.raises(ModelError, match="no noise enters the object"):
        exact(find_variant(name).model)
    assert exact(find_variant("J2").model).name == "aof-exact"


# --- behaviour


def test_a_step_is_reproducible_and_changes_no_state():
    model = moving()
    one, y = jump_particle(model, 64), simulate(model, 5, 3, seed=1).y
    state = one.step(one.init(5), y[0])
    kept = state.memory.x.copy()
    first, second = one.step(state, y[1]), one.step(state, y[1])
    assert np.array_equal(first.posterior.mean, second.posterior.mean) and np.array_equal(state.memory.x, kept)
    other = jump_particle(model, 64, seed=1)
    assert not np.array_equal(other.step(other.init(5), y[0]).posterior.mean, state.posterior.mean)


def test_a_missing_measurement_tells_nothing():
    model = moving()
    one = jump_particle(model, 2000)
    state = one.step(one.init(50), np.full((50, 2), np.nan))
    sd = np.sqrt(np.diagonal(model.prior.cov))
    # 50 * 2000 draws from the prior
    np.testing.assert_allclose(state.posterior.mean.mean(axis=0), model.prior.mean, atol=float(4 * sd.max() / np.sqrt(1e5)))
    np.testing.assert_allclose(state.memory.probability.mean(axis=0), model.first, atol=4 * 0.5 / np.sqrt(1e5))
    after = one.step(state, simulate(model, 50, 1, seed=1).y[0])
    assert np.isfinite(after.posterior.mean).all()


def test_of_a_measurement_with_a_missing_component_the_other_counts():
    """One mode: the Kalman filter's estimate and likelihood, within Monte Carlo error."""
    state, meter = "0.9*x + v", ["x + w1", "x + 0.3*w2"]
    y = np.array([[0.5, 0.1], [np.nan, 1.0], [1.2, np.nan], [np.nan, np.nan]])[:, None]
    exactly = kalman_filter(Model.define(state, meter))
    one = jump_particle(JumpModel.define(state, meter, modes={"a": {}}, transition=[1.0]), 1000)
    many = np.repeat(y, REPLICAS, axis=1)
    for found, expected, unit in (
        (run(one, many).mean[..., 0], run(exactly, y).mean[..., 0], 1.0),
        (likelihood(one, many), likelihood(exactly, y), 1.0),
    ):
        agree(found[:, :, None], expected, unit, 1000)


@pytest.mark.parametrize("value", [0.0, 1e3, -1e8])
def test_no_measurement_makes_nan(value):
    one = jump_particle(moving(), 100)
    state = one.init(3)
    for _ in range(4):
        state = one.step(state, np.full((3, 2), value))
        assert np.isfinite(state.posterior.mean).all() and np.isfinite(state.posterior.cov).all()
        assert np.allclose(state.memory.probability.sum(axis=1), 1)


def test_what_they_cannot_do_is_refused():
    with pytest.raises(ModelError, match="even number of at least 2 particles, got 3"):
        jump_particle(moving(), 3)
    with pytest.raises(ModelError, match="noise enters nonlinearly"):
        jump_particle(JumpModel.define(["x1 + v1", "x2 + v2"], ["x1 + w1**2", "x2 + w2"], modes={"a": {}}, transition=[1.0]))


def test_densities_of_many_are_those_of_each():
    """Many covariances are factored entry by entry, few by LAPACK: rounding apart; what is missing or infinite apart, too."""
    model = find_variant("D3").model
    density, rng = densities.likelihood(model), np.random.default_rng(4)
    x = model.prior.mean + rng.standard_normal((3, 400, 3)) * np.sqrt(np.diagonal(model.prior.cov))
    y = 1e-3 * rng.standard_normal((3, 1, 2))
    y[1] = np.nan
    together = density(y, x, 2)
    one_by_one = np.array([[density(y[i, 0], x[i, j], 2) for j in range(400)] for i in range(3)])
    # the covariance is nearly singular where the air is thin: its condition, 1e4, times rounding, times squares up to 1e9
    np.testing.assert_allclose(together, one_by_one, rtol=1e-10)
    assert (together[1] == 0).all()
    x[0, 0] = np.nan  # one that has left the numbers
    np.testing.assert_allclose(density(y, x, 2)[2], together[2], rtol=1e-10)
