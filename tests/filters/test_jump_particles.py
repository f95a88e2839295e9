"""Particles of models that jump, and initial states of objects without noise, against sums over all histories and plain grids."""

import math
from itertools import product

import numpy as np
import pytest
import sympy as sp

from kfcourse import JumpModel, Model, ModelError, compare, likelihood, linearised, simulate
from kfcourse.filters import densities, jump_particle, jump_pointmass, kalman_filter, logic_dynamic, undisturbed
from kfcourse.filters.initial_states import is_undisturbed
from kfcourse.lab.short_names import exact
from kfcourse.lab.variants import find_variant
from kfcourse.laws import normalised_square
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


def still(transition=((0.8, 0.2), (0.4, 0.6))):
    """The same without a noise in the object."""
    return JumpModel.define(
        ["x1 + 0.4*x2", "0.9*x2"],
        ["x1 + f*w1", "x1 - x2 + f*w2"],
        {"f": 0.5},
        modes=METERS,
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
    [(jump_particle, moving(), 1000), (jump_particle, moving(METERS), 1000), (undisturbed, still(), 512)],
    ids=["both change", "meters", "no noise"],
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


@pytest.mark.parametrize(("build", "model"), [(jump_particle, moving()), (undisturbed, still())], ids=["noise", "no noise"])
def test_the_evidence_is_that_of_all_histories(build, model):
    y = simulate(model, 3, 5, seed=8).y
    found = likelihood(build(model, 4000), y).sum(axis=0)
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
    one, found = jump_pointmass(model), []
    state = one.init(y.shape[1])
    for measured in y:
        state = one.step(state, measured)
        found.append((*state.posterior, state.memory.probability))
    return [np.stack(column) for column in zip(*found, strict=True)]


def test_of_an_object_without_noise_it_is_a_plain_grid_of_initial_states():
    """Thirty measurements, after which the law is hundreds of times narrower than the prior: no particle of it is left."""
    model = JumpModel.define(
        "1.02*x - 0.1*sin(x)",
        "x + 0.2*x**2 + f*w",
        {"f": 0.05},
        modes={"sound": {}, "faulty": {"parameters": {"f": 1.0}}},
        transition=[[0.8, 0.2], [0.3, 0.7]],
        first=[0.9, 0.1],
        prior={"mean": 1.0, "variance": 1.0},
    )
    y = simulate(model, 2, 30, seed=1).y
    mean, cov, probability, stated, _ = follow(undisturbed(model, 512, seed=3), np.repeat(y, REPLICAS, axis=1))
    x0 = np.linspace(-5, 7, 200_001)
    for trajectory in range(2):
        x, logs, c = x0, -0.5 * (x0 - 1) ** 2, np.array([[0.9], [0.1]])
        some = slice(trajectory * REPLICAS, (trajectory + 1) * REPLICAS)
        for k, value in enumerate(y[:, trajectory, 0]):
            each = c * np.stack([np.exp(-0.5 * ((value - x - 0.2 * x * x) / f) ** 2) / f for f in (0.05, 1.0)]) + 1e-300
            logs, alpha = logs + np.log(each.sum(axis=0)), each / each.sum(axis=0)
            weights = np.exp(logs - logs.max())
            weights /= weights.sum()
            z = weights @ x
            variance = weights @ (x - z) ** 2
            if k in (0, 5, 29):
                agree(mean[k, None, some], z, math.sqrt(variance), 512)
                agree(cov[k, None, some, 0], variance, variance, 512)
                agree(probability[k, None, some], alpha @ weights, 0.5, 512)
                wrong = np.sqrt(np.mean((mean[k, some, 0] - z) ** 2))
                assert np.sqrt(np.mean(stated[k, some] ** 2)) == pytest.approx(
                    wrong, rel=0.5
                )  # 60 squares each: 13 % of the root of their quotient
            x, c = 1.02 * x - 0.1 * np.sin(x), np.array([[0.8, 0.3], [0.2, 0.7]]) @ alpha
        assert math.sqrt(variance) < 0.02


SPIKES = {
    "spike": ("0.95*x + 0.1*x**2*exp(-x**2)", "x + f*w", 0.002, 1.0),  # a sound meter 500 times as sharp as the prior
    "two spikes": ("0.95*x", "x**2 + 0.2*x + f*w", 0.005, 2.0),
    "kink": ("0.98*x + 0.05", "abs(x) + f*w", 0.05, 1.0),
    "many humps": ("1.05*x", "sin(3*x) + f*w", 0.1, 1.0),
}


@pytest.mark.parametrize("name", SPIKES)
def test_what_is_stated_of_the_error_holds_at_nearly_every_trajectory(name):
    """Against a plain grid of initial states.

    Stated for 99 of 100; some 150 of the 1,500 corrections are independent, so that .975 is two standard errors below.  Where all
    laws of the mixture were as wide as the whole the mean square error was .7 to 28 variances here, and half the distance of
    the clouds a hundredth of it; five times that held at .56 to .96.
    """
    state, meter, sharp, dull = SPIKES[name]
    chain, first = np.array([[0.8, 0.2], [0.4, 0.6]]), np.array([0.7, 0.3])
    modes = {"sound": {}, "faulty": {"parameters": {"f": dull}}}
    model = JumpModel.define(state, meter, {"f": sharp}, modes=modes, transition=chain.tolist(), first=first.tolist())
    y = simulate(model, 150, 10, seed=11).y
    one, mean, stated, apart, variance = undisturbed(model, seed=5), [], [], [], []
    now = one.init(150)
    for measured in y:
        now = one.step(now, measured)
        mean.append(now.posterior.mean[:, 0])
        stated.append(now.memory.discretisation_error())
        apart.append(now.memory.apart())
        variance.append(now.posterior.cov[:, 0, 0])
    (x,) = sp.symbols("x,")
    moved, measured_by = (sp.lambdify(x, sp.sympify(one.split(" + f*w")[0]), "numpy") for one in (state, meter))
    error = np.array(mean) - _on_a_grid(y[..., 0], moved, measured_by, (sharp, dull), chain, first)
    assert (np.abs(error) <= stated).mean() >= 0.975
    assert (error**2 / variance).mean() < 0.1
    assert np.mean(np.square(apart) / variance) > 0.2 * (error**2 / variance).mean()


def _on_a_grid(y, moved, measured_by, sizes, chain, first):
    """Posterior means (steps, runs) by 40,001 initial states: two or more in each standard deviation of the sharpest law."""
    x = [np.linspace(-7, 7, 40_001)]
    for _ in y[1:]:
        x.append(moved(x[-1]))
    shown = [measured_by(one) for one in x]
    found = np.empty(y.shape)
    for i, record in enumerate(y.T):
        logs, c, here = -0.5 * x[0] ** 2, first[:, None], np.arange(len(x[0]))
        for k, value in enumerate(record):
            halves = 0.5 * (value - shown[k][here]) ** 2
            each = c * np.exp(-np.minimum([halves / f**2 for f in sizes], 200)) / np.array(sizes)[:, None]
            total = each.sum(axis=0)
            logs += np.log(total)
            weights = np.exp(logs - logs.max())
            found[k, i] = weights @ x[k][here] / weights.sum()
            left = weights > 1e-30  # of what is less probable than that, as many records would have to come true
            here, logs, c = here[left], logs[left], chain.T @ (each / total)[:, left]
    return found


def test_a_model_without_slopes_has_its_estimate_all_the_same():
    model = Model.define("0.9*x", "x + sign(x) + 0.5*w")
    y = simulate(model, 40, 4, seed=2).y
    x0 = np.linspace(-6, 6, 20_001)
    logs = -0.5 * x0**2
    for k in range(4):
        logs = logs - 2 * (y[k] - 0.9**k * x0 - np.sign(x0)) ** 2
    weights = np.exp(logs - logs.max(axis=1, keepdims=True))
    expected = 0.9**3 * (weights @ x0) / weights.sum(axis=1)
    assert np.sqrt(np.mean((run(undisturbed(model, 512, seed=1), y).mean[-1, :, 0] - expected) ** 2)) < 0.1


def test_a_start_that_only_rare_draws_find_is_found():
    """A sound meter and a start three deviations out, which the last measurement makes likely: one draw of the prior in hundreds.

    If only as many were drawn at first as are kept, both clouds missed it: a mean square error of 1.05 of the variance (.46 now),
    where their distance said .04 (.10).
    """
    y = np.array([[4.112, 0.683], [5.183, 1.592], [0.657, -1.824], [7.124, 5.207]])
    z, cov, _, _ = histories(still(), y)
    mean = follow(undisturbed(still(), 256, seed=5), np.repeat(y[:, None], 200, axis=1))[0]
    assert ((mean[-1] - z) ** 2).sum(axis=1).mean() < 0.75 * np.trace(cov)


def test_without_modes_an_object_without_noise_has_its_kalman_filter():
    model = Model.define(["x1 + 0.3*x2", "x2 - 0.1*x1"], ["x1 + 0.05*w"], prior=PRIOR)
    y = simulate(model, 3, 12, seed=6).y
    expected = run(kalman_filter(model), y)
    mean, cov = run(undisturbed(model, 512, seed=1), np.repeat(y, REPLICAS, axis=1))
    for trajectory in range(3):
        some = slice(trajectory * REPLICAS, (trajectory + 1) * REPLICAS)
        for k in (0, 4, 11):
            sd = np.sqrt(np.diagonal(expected.cov[k, trajectory]))
            agree(mean[k, None, some], expected.mean[k, trajectory], sd, 512)
            agree(cov[k, None, some], expected.cov[k, trajectory], np.outer(sd, sd), 512)


# --- as the bound of a comparison


def test_the_gap_found_by_particles_is_the_gap_to_the_sum_over_all_histories():
    model = moving()
    filters = [logic_dynamic([linearised(mode) for mode in model.modes], model, model.first)]
    result = compare([*filters, jump_particle(model, 200, name="aof-exact")], model, 200, 5, 3, jobs=1)
    y = simulate(model, 150, 4, seed=9).y
    z = np.stack([[histories(model, y[: k + 1, i])[0] for i in range(150)] for k in (1, 3)])
    own = run(filters[0], y).mean[[1, 3]]
    terms = ((own - z) ** 2).sum(axis=-1)
    excess = result.excess(filters[0].name)
    for place, k in enumerate((1, 3)):
        error = math.hypot(terms[place].std() / math.sqrt(150), float(excess.standard_error[k]))
        assert abs(float(excess.value[k]) - terms[place].mean()) < 4 * error


@pytest.mark.parametrize("name", ["J2", "J3", "J4", "D3"])
def test_the_tasks_with_vector_states_have_a_bound(name):
    model = find_variant(name).model
    assert is_undisturbed(model) == (name != "J2")
    one = exact(model)
    assert one.name == "aof-exact" and one.slow


@pytest.mark.parametrize("name", ["J3", "J4"])
def test_initial_states_of_the_landing_are_found_where_the_prior_has_none(name):
    """M e^T P^-1 e = n for the true states, within 4 standard errors: the law is neither off nor narrow."""
    model, runs = find_variant(name).model, {"J3": 40, "J4": 16}[name]
    x, y, _ = simulate(model, runs, 40, seed=7)
    one = undisturbed(model, seed=2)
    state = one.init(runs)
    for measured in y:
        state = one.step(state, measured)
    assert (state.memory.effective > 0.05 * 256).mean() > 0.9
    mean, cov = state.posterior
    sd = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    standard, scale = (x[-1] - mean) / sd, sd[:, :, None] * sd[:, None, :]
    squares = normalised_square(standard, cov / scale)
    assert abs(squares.mean() / model.n - 1) < 4 * math.sqrt(2 / model.n / runs)  # of chi-squares


# --- behaviour


@pytest.mark.parametrize(("build", "model"), [(jump_particle, moving()), (undisturbed, still())], ids=["noise", "no noise"])
def test_a_step_is_reproducible_and_changes_no_state(build, model):
    one, y = build(model, 64), simulate(model, 5, 3, seed=1).y
    state = one.step(one.init(5), y[0])
    kept = state.memory.x.copy()
    first, second = one.step(state, y[1]), one.step(state, y[1])
    assert np.array_equal(first.posterior.mean, second.posterior.mean) and np.array_equal(state.memory.x, kept)
    other = build(model, 64, seed=1)
    assert not np.array_equal(other.step(other.init(5), y[0]).posterior.mean, state.posterior.mean)


@pytest.mark.parametrize(("build", "model"), [(jump_particle, moving()), (undisturbed, still())], ids=["noise", "no noise"])
def test_a_missing_measurement_tells_nothing(build, model):
    one = build(model, 2000)
    state = one.step(one.init(50), np.full((50, 2), np.nan))
    sd = np.sqrt(np.diagonal(model.prior.cov))
    # 50 * 2000 draws from the prior
    np.testing.assert_allclose(state.posterior.mean.mean(axis=0), model.prior.mean, atol=float(4 * sd.max() / np.sqrt(1e5)))
    np.testing.assert_allclose(state.memory.probability.mean(axis=0), model.first, atol=4 * 0.5 / np.sqrt(1e5))
    after = one.step(state, simulate(model, 50, 1, seed=1).y[0])
    assert np.isfinite(after.posterior.mean).all()


@pytest.mark.parametrize(("build", "noise"), [(jump_particle, "v"), (undisturbed, "0")])
def test_of_a_measurement_with_a_missing_component_the_other_counts(build, noise):
    """One mode: the Kalman filter's estimate and likelihood, within Monte Carlo error."""
    state, meter = f"0.9*x + {noise}", ["x + w1", "x + 0.3*w2"]
    y = np.array([[0.5, 0.1], [np.nan, 1.0], [1.2, np.nan], [np.nan, np.nan]])[:, None]
    exactly = kalman_filter(Model.define(state, meter))
    one = build(JumpModel.define(state, meter, modes={"a": {}}, transition=[1.0]), 1000)
    many = np.repeat(y, REPLICAS, axis=1)
    for found, expected, unit in (
        (run(one, many).mean[..., 0], run(exactly, y).mean[..., 0], 1.0),
        (likelihood(one, many), likelihood(exactly, y), 1.0),
    ):
        agree(found[:, :, None], expected, unit, 1000)


@pytest.mark.parametrize("value", [0.0, 1e3, -1e8])
def test_no_measurement_makes_nan(value):
    for one in (jump_particle(moving(), 100), undisturbed(still(), 128), undisturbed(find_variant("J3").model, 128)):
        state = one.init(3)
        for _ in range(4):
            state = one.step(state, np.full((3, 2), value))
            assert np.isfinite(state.posterior.mean).all() and np.isfinite(state.posterior.cov).all()
            assert np.allclose(state.memory.probability.sum(axis=1), 1)


def test_what_they_cannot_do_is_refused():
    with pytest.raises(ModelError, match="even number of at least 2 particles, got 3"):
        jump_particle(moving(), 3)
    with pytest.raises(ModelError, match="the initial state must tell all that follows"):
        undisturbed(moving())
    with pytest.raises(ModelError, match="the initial state must tell all that follows"):
        undisturbed(Model.define("x + v", "x + w"))
    parted = JumpModel.define("c*x", "x + w", {"c": 1}, modes={"a": {}, "b": {"parameters": {"c": 0.5}}}, transition=[0.5, 0.5])
    assert not is_undisturbed(parted)
    with pytest.raises(ModelError, match="noise enters nonlinearly"):
        jump_particle(JumpModel.define(["x1 + v1", "x2 + v2"], ["x1 + w1**2", "x2 + w2"], modes={"a": {}}, transition=[1.0]))


def test_its_covariance_is_on_average_the_posteriors():
    """A bound is the mean of these: with uncorrected weights it was up to 2 % too high here, six standard errors."""
    model = Model.define(
        ["x1 + 0.2*x2", "0.95*x2 - 0.1*x1"],
        ["x1 + 0.5*w1"],
        symbols={"x": ["x1", "x2"], "w": ["w1"]},
        prior={"mean": [0, 0], "variance": [1, 1]},
    )
    _, y = simulate(model, 2000, 7, seed=5)
    parts = [run(undisturbed(model, 256, seed=i), part).cov for i, part in enumerate(np.split(y, 20, axis=1))]  # little memory
    own, exact = (np.trace(cov, axis1=-2, axis2=-1) for cov in (np.hstack(parts), run(kalman_filter(model), y).cov))
    for k in range(7):
        found, known = own[k], exact[k].mean()
        assert abs(found.mean() - known) < 4 * found.std() / np.sqrt(len(found)), k


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
