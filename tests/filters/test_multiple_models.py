"""The interacting-multiple-model filter against a slow loop."""

import numpy as np
import oracles
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import multivariate_normal

from kfcourse import Model, linearised, run, simulate
from kfcourse.filters import gpb2, imm, logic_dynamic
from kfcourse.linear.system import linear_system
from kfcourse.montecarlo.experiment import states

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


def follow(filter_, y):
    """Means, covariances and probabilities of each step."""
    rows = ((*state.posterior, state.memory.probability) for state in states(filter_, y)[1:])
    return [np.stack(column) for column in zip(*rows, strict=True)]


# --- independent references


def slow_imm(y, systems, pi, start, prior):
    """Blom and Bar-Shalom's algorithm for one trajectory, straight from the page; `systems`: (A, a,
    Q, H, b, R) of each mode."""
    c, predicted, rows = start, [prior] * len(systems), []
    for measured in y:
        seen, corrected, likelihood = ~np.isnan(measured), [], []
        for system, law in zip(systems, predicted, strict=True):
            ((_, posterior),) = oracles.kalman_loop([system], law, [measured])
            corrected.append(posterior)
            H, R = system[3][seen], system[5][np.ix_(seen, seen)]
            expected = multivariate_normal(H @ law[0], H @ law[1] @ H.T + R) if seen.any() else None
            likelihood.append(expected.pdf(measured[seen]) if expected else 1.0)
        mu = c * likelihood / (c @ likelihood)
        rows.append((*oracles.mixture(mu, corrected), mu))
        c = mu @ pi
        mixed = [oracles.mixture(mu * pi[:, j] / c[j], corrected) for j in range(len(systems))]
        predicted = [
            (A @ x, A @ P @ A.T + Q) for (A, _, Q, *_), (x, P) in zip(systems, mixed, strict=True)
        ]
    return rows


def matrices(m):
    system, a, b = linear_system(m)
    return system.A, a, system.Q, system.H, b, system.R


def test_against_a_slow_loop():
    y = simulate(MODELS[1], 6, 25, seed=1).y
    y[3, 0] = y[0, 1] = np.nan
    y[7, 2, 1] = y[8:11, 3, 0] = np.nan
    columns = follow(imm([linearised(m) for m in MODELS], PI, START), y)
    systems = [matrices(m) for m in MODELS]
    for trajectory in range(y.shape[1]):
        expected = slow_imm(y[:, trajectory], systems, PI, START, MODELS[0].prior)
        for ours, wanted in zip(columns, zip(*expected, strict=True), strict=True):
            assert_allclose(ours[:, trajectory], wanted, rtol=0, atol=ROUNDING)


# --- bad input


SCALAR = Model.define("x + v", "x + w")
NAMED = Model.define(["r + s", "s + v1"], ["r + w1", "s + w2"], symbols={"x": ["r", "s"]})
OTHER_PRIOR = Model.define(["x1 + x2", "x2 + v1"], ["x1 + w1", "x2 + w2"])
TWO = [[0.9, 0.1], [0.1, 0.9]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"transition": TWO}, r"transition must be probabilities of the shape \(3, 3\)"),
        ({"transition": PI.T}, "are no probabilities"),
        ({"transition": 2 * np.eye(3) - np.ones((3, 3)) / 3}, "are no probabilities"),
        ({"probabilities": [0.5, 0.5]}, r"probabilities must be probabilities of the shape \(3,\)"),
        ({"probabilities": [0.5, 0.6, -0.1]}, "probabilities: .* are no probabilities"),
        *(
            ({"structures": [linearised(MODELS[0]), linearised(other)], "transition": TWO}, message)
            for other, message in (
                (SCALAR, "need the same state"),
                (NAMED, "need the same state"),
                (OTHER_PRIOR, r"need the same state, .* and prior"),
            )
        ),
    ],
)
def test_what_does_not_fit_together_is_refused(change, message):
    given = {"structures": [linearised(m) for m in MODELS], "transition": PI}
    with pytest.raises(ValueError, match=message):
        imm(**(given | change))


@pytest.mark.parametrize("build", [imm, logic_dynamic, gpb2])
def test_without_first_probabilities_all_modes_have_the_same(build):
    """Those of a model that jumps: test_jumps."""
    filter_ = build([linearised(SCALAR)] * 2, TWO)
    assert_array_equal(filter_.init(2).memory.probability, 0.5)


@pytest.mark.parametrize("build", [imm, logic_dynamic, gpb2])
def test_what_is_no_list_of_structures_is_refused(build):
    model = Model.define("x + v", "x + w")
    with pytest.raises(TypeError, match=f"^{build.__name__} expects a Structure, got Model"):
        build([model], [[1.0]])
    with pytest.raises(
        TypeError, match=f"^{build.__name__} expects a list of structures, one a mode"
    ):
        build(linearised(model), [[1.0]])


def test_probabilities_that_are_none_at_a_later_step_are_refused():
    model = Model.define("x + v", "x + w")
    filter_ = imm([linearised(model)] * 2, lambda k: [[0.9, 0.1], [0.1, 0.9 + 0.1 * (k == 2)]])
    run(filter_, np.zeros(2))
    with pytest.raises(ValueError, match=r"transition: .* are no probabilities"):
        run(filter_, np.zeros(3))
