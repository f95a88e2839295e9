"""The interacting-multiple-model filter against a slow loop."""

import math

import numpy as np
import pytest

from kfcourse import JumpModel, Model, linearised, run, simulate
from kfcourse.filters import gpb2, logic_dynamic
from kfcourse.filters.multiple_models import imm
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
        found.append(
            (*state.posterior, state.memory.probability, state.memory.expected, *state.predicted)
        )
    return [np.stack(column) for column in zip(*found, strict=True)]


# --- independent references


def slow_imm(y, systems, pi, start, mean, cov):
    """Blom and Bar-Shalom's algorithm for one trajectory, straight from the page: loops, and
    inverses of numbers."""
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
                likelihood.append(
                    math.exp(exponent) / math.sqrt((2 * math.pi) ** len(kept) * np.linalg.det(S))
                )
            else:
                corrected.append((x, P))
                likelihood.append(1.0)
        total = sum(c[j] * likelihood[j] for j in range(modes))
        mu = [c[j] * likelihood[j] / total for j in range(modes)]
        z = sum(mu[j] * corrected[j][0] for j in range(modes))
        p = sum(
            mu[j] * (corrected[j][1] + np.outer(corrected[j][0] - z, corrected[j][0] - z))
            for j in range(modes)
        )
        found.append((z, p, np.array(mu)))
        c = [sum(pi[i][j] * mu[i] for i in range(modes)) for j in range(modes)]
        predicted = []
        for j, (A, _, Q, _) in enumerate(systems):
            weight = [pi[i][j] * mu[i] / c[j] for i in range(modes)]
            x = sum(weight[i] * corrected[i][0] for i in range(modes))
            P = sum(
                weight[i] * (corrected[i][1] + np.outer(corrected[i][0] - x, corrected[i][0] - x))
                for i in range(modes)
            )
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
        expected = slow_imm(
            y[:, trajectory], [matrices(m) for m in MODELS], PI, START, law.mean, law.cov
        )
        for k, (z, p, mu) in enumerate(expected):
            np.testing.assert_allclose(mean[k, trajectory], z, rtol=0, atol=ROUNDING)
            np.testing.assert_allclose(cov[k, trajectory], p, rtol=0, atol=ROUNDING)
            np.testing.assert_allclose(probability[k, trajectory], mu, rtol=0, atol=ROUNDING)


# --- what it is for


def test_probabilities_sum_to_one_even_where_likelihoods_underflow():
    y = data(runs=3, steps=10)
    # hundreds of standard deviations from every mode: exp(-nu^2/2) is 0 in floating point
    y[4:] += 1e4
    mean, cov, probability, expected, *_ = follow(
        imm([linearised(m) for m in MODELS], PI, START), y
    )
    for table in (probability, expected):
        np.testing.assert_allclose(table.sum(axis=-1), 1.0, atol=1e-12)
        assert (table >= 0).all()
    assert np.isfinite(mean).all() and np.isfinite(cov).all()


# --- bad input


@pytest.mark.parametrize(
    ("change", "message"),
    [
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
    other_names = linearised(
        Model.define(
            ["r + s", "s + v1"], ["r + w1", "s + w2"], symbols={"x": ["r", "s"]}, prior=PRIOR
        )
    )
    other_prior = linearised(Model.define(["x1 + x2", "x2 + v1"], ["x1 + w1", "x2 + w2"]))
    for other in (scalar, other_names, other_prior):
        with pytest.raises(ValueError, match=r"need the same state, .* and prior"):
            imm([first, other], [[0.9, 0.1], [0.1, 0.9]])
    with pytest.raises(TypeError, match="expects a list of structures"):
        imm([], PI)


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
    np.testing.assert_array_equal(
        build(structures, jump.transition_at).init(2).memory.probability, 0.5
    )


@pytest.mark.parametrize("build", [imm, logic_dynamic, gpb2])
def test_what_is_no_list_of_structures_is_told(build):
    model = Model.define("x + v", "x + w")
    with pytest.raises(TypeError, match=f"^{build.__name__} expects a Structure, got Model"):
        build([model], [[1.0]])
    with pytest.raises(
        TypeError, match=f"^{build.__name__} expects a list of structures, one a mode"
    ):
        build(linearised(model), [[1.0]])


def test_probabilities_that_are_none_at_a_later_step_are_refused():
    model = Model.define("x + v", "x + w")
    one = imm([linearised(model)] * 2, lambda k: [[0.9, 0.1], [0.1, 0.9 + 0.1 * (k == 2)]])
    run(one, np.zeros(2))
    with pytest.raises(
        ValueError, match="transition must be probabilities that sum to 1 in each row"
    ):
        run(one, np.zeros(3))
