"""The interacting-multiple-model filter against one model, a slow loop, filterpy, and the truth."""

import math

import numpy as np
import pytest
from filterpy.kalman import IMMEstimator, KalmanFilter

from kfcourse import Gaussian, JumpModel, Model, likelihood, linearised, run, simulate
from kfcourse.filters import aof, gpb2, logic_dynamic
from kfcourse.filters.multiple_models import imm, mixture
from kfcourse.laws import log_density
from kfcourse.linear.system import linear_system

pytestmark = pytest.mark.quick

ROUNDING = 1e-10  # relative; some tens of steps, with likelihoods in between

PRIOR = {"mean": [1.0, -0.5], "variance": [[2.0, 0.3], [0.3, 1.0]]}
PI = np.array([[0.9, 0.07, 0.03], [0.2, 0.7, 0.1], [0.05, 0.15, 0.8]])
START = np.array([0.5, 0.2, 0.3])


def model(decay, noise, meter=1.0, meter_noise=0.6):
    return Model.define(
        ["x1 + 0.5*x2 + 0.1*v1", f"{decay}*x2 + {noise}*v2"],
        [f"{meter}*x1 + {meter_noise}*w1", "x1 - x2 + 0.8*w2"],
        prior=PRIOR,
    )


MODELS = [model(1.0, 0.05), model(0.6, 1.5), model(-0.8, 0.4, meter=1.1, meter_noise=0.9)]
NONLINEAR = Model.define(
    ["x1 + 0.3*x2 + 0.1*v1", "x2 - 0.2*sin(x1) + 0.3*v2"], ["sin(x1) + 0.5*w1", "x2*x1 + 0.4*w2"], prior=PRIOR
)


def data(runs=6, steps=25, seed=1, gaps=False):
    y = simulate(MODELS[1], runs, steps, seed).y
    if gaps:
        y[3, 0] = y[0, 1] = np.nan
        y[7, 2, 1] = y[8:11, 3, 0] = np.nan
    return y


def follow(one, y):
    """Means, covariances, probabilities, predicted probabilities, and predictions of each step."""
    state, found = one.init(y.shape[1]), []
    for measurement in y:
        state = one.step(state, measurement)
        found.append((*state.posterior, state.memory.probability, state.memory.expected, *state.predicted))
    return [np.stack(column) for column in zip(*found, strict=True)]


# --- special cases


def test_without_mixing_it_is_a_bank_of_filters_weighted_by_all_their_likelihoods():
    y = data()
    structures = [linearised(m) for m in MODELS]
    mean, cov, probability, *_ = follow(imm(structures, np.eye(3), START), y)
    weights, laws = [], []
    for j, structure in enumerate(structures):
        one = aof(structure)
        state, total, posterior = one.init(y.shape[1]), np.log(START[j]), []
        for measurement in y:
            total = total + log_density(structure.measure(*state.predicted), measurement)
            state = one.step(state, measurement)
            weights.append((j, np.broadcast_to(total, y.shape[1])))
            posterior.append(state.posterior.mean)
        laws.append(np.stack(posterior))
    logs = np.stack([[value for mode, value in weights if mode == j] for j in range(3)], axis=-1)
    expected = np.exp(logs - logs.max(axis=-1, keepdims=True))
    expected /= expected.sum(axis=-1, keepdims=True)
    np.testing.assert_allclose(probability, expected, atol=1e-9)
    records = likelihood(imm(structures, np.eye(3), START), y).sum(axis=0)
    np.testing.assert_allclose(records, np.logaddexp.reduce(logs[-1], axis=-1), rtol=1e-12)
    np.testing.assert_allclose(mean, sum(expected[..., j, None] * laws[j] for j in range(3)), atol=1e-9)
    assert np.linalg.eigvalsh(cov).min() > 0


# --- independent references


def slow_imm(y, systems, pi, start, mean, cov):
    """Blom and Bar-Shalom's algorithm for one trajectory, straight from the page: loops, and inverses of numbers."""
    modes = len(systems)
    c = list(start)
    predicted = [(np.array(mean), np.array(cov)) for _ in range(modes)]
    found = []
    for measurement in y:
        kept = [i for i, value in enumerate(measurement) if not math.isnan(value)]
        corrected, likelihood = [], []
        for (_, H, _, R), (x, P) in zip(systems, predicted, strict=True):
            if kept:
                h, r = H[kept], R[np.ix_(kept, kept)]
                nu, S = measurement[kept] - h @ x, h @ P @ h.T + r
                K = P @ h.T @ np.linalg.inv(S)
                corrected.append((x + K @ nu, P - K @ S @ K.T))
                exponent = -0.5 * nu @ np.linalg.inv(S) @ nu
                likelihood.append(math.exp(exponent) / math.sqrt((2 * math.pi) ** len(kept) * np.linalg.det(S)))
            else:
                corrected.append((x, P))
                likelihood.append(1.0)
        total = sum(c[j] * likelihood[j] for j in range(modes))
        mu = [c[j] * likelihood[j] / total for j in range(modes)]
        z = sum(mu[j] * corrected[j][0] for j in range(modes))
        p = sum(mu[j] * (corrected[j][1] + np.outer(corrected[j][0] - z, corrected[j][0] - z)) for j in range(modes))
        found.append((z, p, np.array(mu)))
        c = [sum(pi[i][j] * mu[i] for i in range(modes)) for j in range(modes)]
        predicted = []
        for j, (A, _, Q, _) in enumerate(systems):
            weight = [pi[i][j] * mu[i] / c[j] for i in range(modes)]
            x = sum(weight[i] * corrected[i][0] for i in range(modes))
            P = sum(weight[i] * (corrected[i][1] + np.outer(corrected[i][0] - x, corrected[i][0] - x)) for i in range(modes))
            predicted.append((A @ x, A @ P @ A.T + Q))
    return found


def matrices(m):
    system, _, _ = linear_system(m)
    return system.A, system.H, system.Q, system.R


@pytest.mark.parametrize("gaps", [False, True])
def test_against_a_slow_loop(gaps):
    y = data(gaps=gaps)
    mean, cov, probability, *_ = follow(imm([linearised(m) for m in MODELS], PI, START), y)
    law = MODELS[0].prior
    for trajectory in range(y.shape[1]):
        expected = slow_imm(y[:, trajectory], [matrices(m) for m in MODELS], PI, START, law.mean, law.cov)
        for k, (z, p, mu) in enumerate(expected):
            np.testing.assert_allclose(mean[k, trajectory], z, rtol=0, atol=ROUNDING)
            np.testing.assert_allclose(cov[k, trajectory], p, rtol=0, atol=ROUNDING)
            np.testing.assert_allclose(probability[k, trajectory], mu, rtol=0, atol=ROUNDING)


def test_against_filterpy():
    y = data()
    mean, cov, probability, *_ = follow(imm([linearised(m) for m in MODELS], PI, START), y)
    for trajectory in range(y.shape[1]):
        filters = []
        for m in MODELS:
            A, H, Q, R = matrices(m)
            one = KalmanFilter(dim_x=2, dim_z=2)
            one.F, one.H, one.Q, one.R, one.x, one.P = A, H, Q, R, m.prior.mean.copy(), m.prior.cov.copy()
            filters.append(one)
        # filterpy multiplies its first probabilities by the chain before it uses them, and predicts after the correction
        reference = IMMEstimator(filters, START @ np.linalg.inv(PI), PI)
        for k, measurement in enumerate(y[:, trajectory]):
            reference.update(measurement)
            np.testing.assert_allclose(mean[k, trajectory], reference.x, rtol=0, atol=ROUNDING)
            np.testing.assert_allclose(cov[k, trajectory], reference.P, rtol=0, atol=ROUNDING)
            np.testing.assert_allclose(probability[k, trajectory], reference.mu, rtol=0, atol=ROUNDING)
            reference.predict()


def test_the_prediction_is_the_mixture_over_the_modes_to_come():
    y = data()
    structures = [linearised(m) for m in MODELS]
    one = imm(structures, PI, START)
    state = one.init(y.shape[1])
    for measurement in y[:5]:
        state = one.step(state, measurement)
    np.testing.assert_allclose(state.memory.expected, state.memory.probability @ PI, atol=1e-15)
    expected = mixture(state.memory.predicted, state.memory.expected)
    np.testing.assert_array_equal(state.predicted.mean, expected.mean)
    np.testing.assert_array_equal(state.predicted.cov, expected.cov)
    assert state.step == 5


# --- what it is for


def test_probabilities_sum_to_one_even_where_likelihoods_underflow():
    y = data(runs=3, steps=10)
    y[4:] += 1e4  # hundreds of standard deviations from every mode: exp(-nu^2/2) is 0 in floating point
    mean, cov, probability, expected, *_ = follow(imm([linearised(m) for m in MODELS], PI, START), y)
    for table in (probability, expected):
        np.testing.assert_allclose(table.sum(axis=-1), 1.0, atol=1e-12)
        assert (table >= 0).all()
    assert np.isfinite(mean).all() and np.isfinite(cov).all()


def test_a_missing_measurement_leaves_everything_as_predicted():
    y = data(runs=2, steps=6)
    one = imm([linearised(m) for m in MODELS], PI, START)
    state = one.init(2)
    for measurement in y:
        state = one.step(state, measurement)
    after = one.step(state, np.full((2, 2), np.nan))
    np.testing.assert_allclose(after.memory.probability, state.memory.expected, atol=1e-15)
    np.testing.assert_allclose(after.posterior.mean, state.predicted.mean, atol=1e-14)
    np.testing.assert_allclose(after.posterior.cov, state.predicted.cov, atol=1e-14)


def test_it_notices_a_switch_and_beats_each_model_alone():
    quiet, agile = model(1.0, 0.01), model(1.0, 3.0)
    runs, steps = 300, 60
    calm, wild = simulate(quiet, runs, steps, seed=2), simulate(agile, runs, steps, seed=3)
    # the agile motion goes on from where the quiet one ended; both models are the same but for the noise of x2
    A, H, _, _ = matrices(quiet)
    x = calm.x.copy()
    for k in range(steps // 2, steps):
        x[k] = x[k - 1] @ A.T + (wild.x[k] - wild.x[k - 1] @ A.T)
    y = x @ H.T + (wild.y - wild.x @ H.T)
    structures = [linearised(quiet), linearised(agile)]
    mean, _, probability, *_ = follow(imm(structures, [[0.95, 0.05], [0.05, 0.95]]), y)
    before, after = slice(steps // 4, steps // 2), slice(3 * steps // 4, steps)
    assert probability[before, :, 0].mean() > 0.75 > 0.25 > probability[after, :, 0].mean()
    squares = {
        name: ((m - x) ** 2).sum(axis=-1)
        for name, m in zip(
            ("imm", "quiet", "agile"), (mean, run(aof(structures[0]), y).mean, run(aof(structures[1]), y).mean), strict=True
        )
    }
    for other in ("quiet", "agile"):
        difference = (squares[other] - squares["imm"])[steps // 4 :].mean(axis=0)  # one number a run
        assert difference.mean() > 4 * difference.std(ddof=1) / np.sqrt(runs)


def test_a_mode_that_cannot_be_reached_keeps_probability_zero():
    y = data()
    pi = np.array([[0.8, 0.2, 0.0], [0.3, 0.7, 0.0], [0.5, 0.5, 0.0]])
    three = follow(imm([linearised(m) for m in MODELS], pi, [0.6, 0.4, 0.0]), y)
    two = follow(imm([linearised(m) for m in MODELS[:2]], pi[:2, :2], [0.6, 0.4]), y)
    assert (three[2][..., 2] == 0).all()
    np.testing.assert_allclose(three[0], two[0], rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(three[1], two[1], rtol=0, atol=ROUNDING)


# --- its parts


def test_a_mixture_has_the_moments_of_its_sample():
    rng = np.random.default_rng(4)
    laws = [
        Gaussian(np.array([[1.0, 2.0]]), np.diag([1.0, 0.5])),
        Gaussian(np.array([[-2.0, 0.5]]), np.array([[2.0, 0.7], [0.7, 1.0]])),
    ]
    weights, size = np.array([[0.3, 0.7]]), 200_000
    found = mixture(laws, weights)
    choice = rng.random(size) < 0.3
    sample = np.where(choice[:, None], *(rng.multivariate_normal(law.mean[0], law.cov, size) for law in laws))
    sd = np.sqrt(np.diag(found.cov[0]))
    assert (np.abs(sample.mean(axis=0) - found.mean[0]) < 4 * sd / np.sqrt(size)).all()
    # fourth moments of this mixture are below those of a normal law, so sqrt(2/size) bounds the relative error
    assert (np.abs(np.cov(sample.T) - found.cov[0]) < 4 * np.sqrt(2 / size) * np.outer(sd, sd)).all()


# --- bad input


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"structures": []}, "at least one structure"),
        ({"transition": [[0.9, 0.1], [0.1, 0.9]]}, r"transition must have the shape \(3, 3\)"),
        ({"transition": PI.T}, "sum to 1 in each row"),
        ({"transition": 2 * np.eye(3) - np.ones((3, 3)) / 3}, "must be probabilities"),
        ({"probabilities": [0.5, 0.5]}, r"probabilities must have the shape \(3,\)"),
        ({"probabilities": [0.5, 0.6, -0.1]}, "probabilities must be probabilities"),
        ({"probabilities": [np.nan, 0.5, 0.5]}, "probabilities must be probabilities"),
    ],
)
def test_numbers_that_are_no_probabilities_are_refused(change, message):
    good = {"structures": [linearised(m) for m in MODELS], "transition": PI, "probabilities": START}
    with pytest.raises(ValueError, match=message):
        imm(**(good | change))


def test_models_that_do_not_fit_together_are_refused():
    first = linearised(MODELS[0])
    scalar = linearised(Model.define("x + v", "x + w"))
    other_names = linearised(Model.define(["r + s", "s + v1"], ["r + w1", "s + w2"], symbols={"x": ["r", "s"]}, prior=PRIOR))
    other_prior = linearised(Model.define(["x1 + x2", "x2 + v1"], ["x1 + w1", "x2 + w2"]))
    for other, message in ((scalar, "same state"), (other_names, "same state"), (other_prior, "same prior")):
        with pytest.raises(ValueError, match=message):
            imm([first, other], [[0.9, 0.1], [0.1, 0.9]])


@pytest.mark.parametrize("build", [imm, logic_dynamic, gpb2])
def test_a_model_that_jumps_gives_the_first_probabilities_too(build):
    jump = JumpModel.define(
        "x + v",
        "x + C*w",
        modes={"a": {"parameters": {"C": 1}}, "b": {"parameters": {"C": 9}}},
        transition=[[0.9, 0.1], [0.2, 0.8]],
        first=[1, 0],
    )
    structures = [linearised(mode) for mode in jump.modes]
    np.testing.assert_array_equal(build(structures, jump).init(2).memory.probability, [[1, 0]] * 2)
    np.testing.assert_array_equal(build(structures, jump.transition_at).init(2).memory.probability, 0.5)


@pytest.mark.parametrize("build", [imm, logic_dynamic, gpb2])
def test_what_is_no_list_of_structures_is_told(build):
    model = Model.define("x + v", "x + w")
    with pytest.raises(TypeError, match=f"^{build.__name__} expects a Structure, got Model"):
        build([model], [[1.0]])
    with pytest.raises(TypeError, match=f"^{build.__name__} expects a list of structures, one a mode"):
        build(linearised(model), [[1.0]])


def test_probabilities_that_are_none_at_a_later_step_are_refused():
    model = Model.define("x + v", "x + w")
    one = imm([linearised(model)] * 2, lambda k: [[0.9, 0.1], [0.1, 0.9 + 0.1 * (k == 2)]])
    run(one, np.zeros(2))
    with pytest.raises(ValueError, match="transition must be probabilities that sum to 1 in each row"):
        run(one, np.zeros(3))
