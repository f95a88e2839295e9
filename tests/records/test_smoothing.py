"""Smoothers and likelihoods: one dense regression on linear models, the likeliest trajectory, angles."""

import numpy as np
import oracles
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import least_squares

from kfcourse import (
    Ensemble,
    Gaussian,
    Model,
    design,
    gauss_hermite,
    gaussian,
    likelihood,
    linearised,
    simulate,
    smooth,
    unscented,
)
from kfcourse.filters import aof, duof, imm, iterated, kalman_filter, pointmass
from kfcourse.records import smooth_iterated
from kfcourse.symbolic.equations import compile_noiseless

STRUCTURES = {
    "linearised": linearised,
    "gaussian": gaussian,
    "unscented": unscented,
    "cubature": lambda model: unscented(model, kappa=0),
    "gauss-hermite": lambda model: gauss_hermite(model, 3),
}
FILTERS = {
    name: lambda model, build=build: aof(build(model)) for name, build in STRUCTURES.items()
} | {
    "kalman": kalman_filter,
    "iterated": lambda model: iterated(linearised(model), 3),
}
STEPS = 9


@pytest.fixture(scope="module")
def changing() -> Model:
    return oracles.Changing().model()


def with_gaps(y):
    """Whole measurements and components missing, others in each run; one run's first and another's
    last."""
    y = y.copy()
    y[3, 1] = y[5, 2, 0] = y[0, 3] = y[-1, 0, 1] = y[6:8, 4] = np.nan
    return y


@pytest.fixture(scope="module")
def record(changing):
    """Measurements with gaps (9, 5, 2), and what one dense regression finds in them: the law of the
    states, and the log density of each run."""
    y = with_gaps(simulate(changing, 5, STEPS, seed=2).y)
    each = oracles.Changing()
    smoothed = [
        oracles.joint_posterior(each.steps(STEPS), each.laws["prior"], y[:, run])
        for run in range(5)
    ]
    return (
        y,
        Gaussian(
            np.stack([each[0] for each in smoothed], axis=1),
            np.stack([each[1] for each in smoothed], axis=1),
        ),
        [each[2] for each in smoothed],
    )


def same(smoothed, expected):
    # nine steps of well-conditioned 2 x 2 solutions, and one 18 x 18
    assert_allclose(smoothed.mean, expected.mean, rtol=1e-10, atol=1e-10)
    assert_allclose(smoothed.cov, expected.cov, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("kind", FILTERS)
def test_on_a_linear_model_smoothers_and_likelihoods_are_the_regression_on_the_whole_record(
    changing, record, kind
):
    """The structural functions of a linear model are exact whatever the approximation, and all laws
    are normal."""
    y, expected, density = record
    filter_ = FILTERS[kind](changing)
    same(smooth(filter_, y), expected)
    logs = likelihood(filter_, y)
    assert not logs[np.isnan(y).all(axis=-1)].any()
    # an 18 x 18 determinant against nine of 2 x 2
    assert_allclose(logs.sum(axis=0), density, rtol=1e-11)


@pytest.mark.parametrize("kind", STRUCTURES)
def test_on_a_linear_model_it_does_not_matter_where_it_is_linearised(changing, record, kind):
    y, expected, _ = record
    same(smooth_iterated(STRUCTURES[kind](changing), y, rounds=3), expected)


@pytest.mark.parametrize("lag", [0, 2, STEPS])
def test_with_a_lag_it_is_the_smoother_of_what_is_known_then(changing, record, lag):
    y, each = record[0], aof(linearised(changing))
    smoothed = smooth(each, y, lag)
    for k in range(STEPS):
        shorter = smooth(each, y[: k + 1 + lag])
        assert_allclose(smoothed.mean[k], shorter.mean[k], rtol=1e-10, atol=1e-10)
        assert_allclose(smoothed.cov[k], shorter.cov[k], rtol=1e-10, atol=1e-10)


# ---------------------------------------------------------------- nonlinear


def test_the_iterated_extended_smoother_finds_the_likeliest_trajectory():
    model = Model.define(
        ["x1 + 0.3*sin(x2) + 0.2*v1", "0.9*x2 + 0.2*x1*x2 + 0.3*v2"], ["x1**2/2 + x2 + 0.3*w1"],
        prior={"mean": [0.8, 0.5], "variance": [[0.2, 0.05], [0.05, 0.3]]},
    )  # fmt: skip
    y = simulate(model, 4, 5, seed=3).y.copy()
    y[2, 1] = np.nan
    move, see = compile_noiseless(model)
    prior_root = np.linalg.cholesky(np.linalg.inv(model.prior.cov))
    smoothed, once = (
        smooth_iterated(linearised(model), y, rounds=60),
        smooth(aof(linearised(model)), y),
    )
    for i in range(4):

        def residuals(flat, i=i):
            x = flat.reshape(5, 2)
            return np.concatenate(
                [
                    prior_root.T @ (x[0] - model.prior.mean),
                    ((x[1:] - move(x[:-1])) / [0.2, 0.3]).ravel(),
                    np.nan_to_num((y[:, i] - see(x)) / 0.3).ravel(),
                ]
            )

        minimum = least_squares(
            residuals,
            once.mean[:, i].ravel(),
            method="lm",
            jac="3-point",
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
        )
        # 3-point differences and the search are right to some 1e-8 of a standard deviation, times
        # the condition
        assert_allclose(smoothed.mean[:, i].ravel(), minimum.x, rtol=0, atol=1e-6)
        cov = np.linalg.inv(minimum.jac.T @ minimum.jac)
        blocks = np.stack([cov[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] for k in range(5)])
        assert_allclose(smoothed.cov[:, i], blocks, rtol=1e-4, atol=1e-7)
    assert np.abs(smoothed.mean - once.mean).max() > 0.01  # one round is not the maximum


def test_angles_go_the_short_way_round_in_the_past_too():
    """A heading that wanders about pi, and the same one seen from a zero that lies elsewhere: only
    whole turns differ."""

    def turned(by):
        model = Model.define(
            ["x1 + 0.5*x2 + 0.1*v1", "x2 + 0.2*v2"],
            ["x1 + 0.3*w"],
            angles=["x1", "y"],
            prior={"mean": [3.0 + by, 0.1], "variance": 0.2},
        )
        y = np.pi + by + 0.3 * np.sin(np.arange(40.0) ** 2)
        return model, (y - 2 * np.pi * np.round(y / (2 * np.pi)))[:, None, None]

    for build in (
        lambda model: aof(linearised(model)),
        lambda model: aof(unscented(model)),
        kalman_filter,
    ):
        smoothed, other = (smooth(build(model), y) for model, y in (turned(0.0), turned(-2.5)))
        assert np.abs(smoothed.mean[..., 0]).max() <= np.pi
        assert_allclose(smoothed.cov, other.cov, rtol=1e-9)
        apart = smoothed.mean - other.mean - [2.5, 0]
        assert_allclose(np.cos(apart[..., 0]), 1, rtol=1e-12)
        assert_allclose(apart[..., 1], 0, atol=1e-9)
    model, y = turned(0.0)
    again, lagged = (
        smooth_iterated(linearised(model), y, rounds=3),
        smooth(kalman_filter(model), y, lag=len(y)),
    )
    for other in (again, lagged):
        assert_allclose(other.mean, smooth(kalman_filter(model), y).mean, atol=1e-9)


# ---------------------------------------------------------------- what is refused


SCALAR = Model.define("0.9*x + v", "x + w")
KNOWN = Model.define(["x1"], ["x1", "x1"], prior={"mean": [1.0]}, symbols={"x": ["x1"]})


def designed():
    return design([duof(SCALAR)], Ensemble(SCALAR, 100, 3, seed=1))[0]


@pytest.mark.parametrize(
    ("call", "problem"),
    [
        *(
            (
                lambda lag=lag: smooth(aof(linearised(SCALAR)), np.zeros(3), lag=lag),
                "lag must be a whole number of steps, at least 0",
            )
            for lag in (-1, 1.5, True, "2", np.nan)
        ),
        *(
            (
                lambda rounds=rounds: smooth_iterated(linearised(SCALAR), np.zeros(3), rounds),
                "rounds must be a positive whole number",
            )
            for rounds in (0, -1, 1.5, True, None)
        ),
        (
            lambda: smooth(pointmass(SCALAR), np.ones(3), lag=-1),
            "lag must be a whole number of steps, at least 0",
        ),
        (
            lambda: smooth(imm([linearised(SCALAR)], [[1.0]]), np.zeros(3)),
            "looking back needs the structural functions.*imm has none.*take one",
        ),
        (
            lambda: smooth(designed(), np.zeros(3)),
            "looking back needs the structural functions.*duof has none.*take one",
        ),
        (
            lambda: likelihood(designed(), np.zeros(3)),
            "the likelihood needs the structural functions.*duof has none",
        ),
        (
            lambda: likelihood(kalman_filter(KNOWN), np.ones((2, 1, 2))),
            "no density for the measurement of step 0, run 0: .* give every component of the meter",
        ),
    ],
)
def test_what_cannot_be_smoothed_or_has_no_density_is_refused(call, problem):
    with pytest.raises(ValueError, match=problem):
        call()
