"""The posterior bound: the Kalman covariance on linear models, an integral, below the exact filter,
and where there is none."""

from contextlib import nullcontext

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import norm

from kfcourse import Model, ModelError, run, simulate
from kfcourse.filters import kalman_filter
from kfcourse.lab import find_variant
from kfcourse.montecarlo.cramer_rao import _mean, posterior_bound


def test_on_a_linear_model_it_is_the_kalman_filter_s_covariance():
    """Matrices that change with the step, correlated noises with means; no trajectory enters."""
    model = Model.define(
        ["(0.9 + 0.05*k)*x1 + 0.4*x2 + v1", "0.8*x2 - 0.3*x1 + v2 + 1"],
        ["x1 + 2*x2 + w1 - k", "x2 - (0.5 + 0.1*k)*x1 + w2"],
        prior={"mean": [1.0, -2.0], "variance": [[2.0, 0.5], [0.5, 1.0]]},
        state_noise={"variance": [[1.0, 0.3], [0.3, 2.0]]},
        meter_noise={"mean": [0.4, 0], "variance": [[1.0, 0.6], [0.6, 2.0]]},
    )
    expected = run(kalman_filter(model), simulate(model, 1, 8, seed=1).y).cov[:, 0]
    assert_allclose(posterior_bound(model, 3, 8, seed=2).value, expected, rtol=1e-10)


def test_the_first_step_is_an_integral():
    """Meter and noise both depend on x: 1 + M(b'^2/s + s'^2/(2 s^2)), by a fine sum."""
    model = Model.define("0.9*x + v", "sin(x) + 0.5*exp(0.3*x)*w")
    x = np.linspace(-8, 8, 4001)
    sd = 0.5 * np.exp(0.3 * x)
    information = (np.cos(x) / sd) ** 2 + (2 * 0.3) ** 2 / 2
    expected = 1 + (norm.pdf(x) * information).sum() * (x[1] - x[0])
    runs = 40_000
    error = np.sqrt((norm.pdf(x) * information**2).sum() * (x[1] - x[0]) / runs)
    bound = posterior_bound(model, runs, 1, seed=3)
    assert 1 / bound.value.item() == pytest.approx(expected, abs=4 * error)
    # by the delta method; 64 batches tell an error to 9 %
    spread = (
        np.sqrt((norm.pdf(x) * (information - expected + 1) ** 2).sum() * (x[1] - x[0]) / runs)
        / expected**2
    )
    assert bound.standard_error.item() == pytest.approx(spread, rel=4 * 0.09)


def test_two_steps_are_the_corner_of_the_inverse_information_of_both_states():
    """By derivatives of ln p(x_0, x_1, y_0, y_1) along the same trajectories, state noise and meter
    noise of varying size."""
    model = Model.define(
        "x + 0.2*sin(x) + 0.4*exp(0.2*x)*v",
        "x + 0.1*x**2 + 0.5*exp(0.3*x)*w",
        prior={"mean": 0.5, "variance": 0.3},
    )
    runs, h = 100_000, 1e-3
    (x0, x1), (y0, y1) = (part[..., 0] for part in simulate(model, runs, 2, seed=4))

    def density(a, b):
        def meter(y, x):
            return norm.logpdf(y, x + 0.1 * x**2, 0.5 * np.exp(0.3 * x))

        start = norm.logpdf(a, 0.5, np.sqrt(0.3))
        return (
            start
            + meter(y0, a)
            + meter(y1, b)
            + norm.logpdf(b, a + 0.2 * np.sin(a), 0.4 * np.exp(0.2 * a))
        )

    slopes = np.stack(
        [density(x0 + h, x1) - density(x0 - h, x1), density(x0, x1 + h) - density(x0, x1 - h)]
    ) / (2 * h)
    expected = np.linalg.inv(slopes @ slopes.T / runs)[1, 1]
    # a mean of squares of scores: its spread over tenths of the runs gives the error
    tenths = [
        np.linalg.inv(part @ part.T / part.shape[1])[1, 1] for part in np.split(slopes, 10, axis=1)
    ]
    assert posterior_bound(model, runs, 2, seed=4).value[1].item() == pytest.approx(
        expected, abs=4 * np.std(tenths) / np.sqrt(10)
    )


def test_a_noise_that_vanishes_tells_everything_and_so_bounds_nothing():
    with pytest.raises(ValueError, match=r"information is infinite, .* hangs on one trajectory"):
        posterior_bound(find_variant("6").model, 1000, 2, seed=1)


def test_what_jumps_tells_more_than_its_slopes():
    jumping = "(x if x > 0 else 5) + w"
    for state, meter in (
        ("x + v", jumping),
        ("sign(x) + v", "x + w"),
        ("(2*x if x > 1 else x) + v", "x + w"),
    ):
        with pytest.raises(ValueError, match="it jumps, and a jump has no slope"):
            posterior_bound(Model.define(state, meter), 100, 2, seed=1)
    kinked = posterior_bound(Model.define("(2*x - 1 if x > 1 else x) + v", "x + w"), 100, 2, seed=1)
    assert kinked.value[0].item() == pytest.approx(0.5)


def test_what_jumps_with_the_step_alone_is_known():
    free, driven = (
        posterior_bound(Model.define(f"0.9*x {known}+ v", "x + 2*w"), 10, 4, seed=1)
        for known in ("", "+ Heaviside(k - 2) + sign(k - 1) + (3 if k > 2 else 1) ")
    )
    # the same slopes and noises: by rounding only
    assert_allclose(driven.value, free.value, rtol=1e-12)


def test_an_infinite_mean_is_seen_in_several_dimensions_too():
    model = Model.define(["x1 + v1", "x2 + v2"], ["x1 + x2*w1", "x2 + w2"])
    with pytest.raises(
        ValueError,
        match=r"meter equation's information is infinite.* step 0 it hangs on one trajectory in "
        r"5000",
    ):
        posterior_bound(model, 5000, 2, seed=1)
    for share, infinite in ((0.04, False), (0.06, True)):  # of one of a thousand
        information = np.ones((1000, 1, 1))
        information[7] = 999 * share / (1 - share)
        with pytest.raises(ValueError, match="hangs on") if infinite else nullcontext():
            _mean(information, "meter", 0)


@pytest.mark.parametrize(
    ("state", "meter", "message"),
    [
        (["x1 + x2", "x2 + v1"], ["x1 + w1"], "state equation leaves a component without noise"),
        (
            ["x1 + v1", "x2 + v2"],
            ["x1 + w1", "x2"],
            "meter equation leaves a component without noise",
        ),
        ("x + exp(v)", "x + w", "the noise enters nonlinearly"),
    ],
)
def test_without_a_normal_density_there_is_none(state, meter, message):
    with pytest.raises(ValueError, match=message):
        posterior_bound(Model.define(state, meter), 10, 2, seed=1)


@pytest.mark.parametrize("variance", [[1, 0], [[1, 1], [1, 1]]])
def test_a_prior_without_a_density_is_refused_and_units_do_not_matter(variance):
    state, meter = ["x1 + v1", "x2 + v2"], ["x1 + w1", "x2 + w2"]
    with pytest.raises(ModelError, match="the prior leaves a component"):
        posterior_bound(Model.define(state, meter, prior={"variance": variance}), 10, 2, seed=1)
    tiny = posterior_bound(
        Model.define(state, meter, prior={"variance": [1, 1e-30]}), 10, 1, seed=1
    )
    assert_allclose(tiny.value[0], np.diag([0.5, 1e-30]), rtol=1e-12)
