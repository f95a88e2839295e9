"""The benchmarks of the field: their models and data against what the sources print and say."""

import numpy as np
import oracles
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from kfcourse import linearised, run, simulate
from kfcourse.filters import aof, kalman_filter
from kfcourse.scenarios.benchmarks import (
    PUBLISHED,
    bearings,
    bearings_data,
    car,
    car_data,
    cubic_sensor,
    inverse_cube_root,
    logistic,
    lorenz,
    lorenz_data,
    reentry,
)
from kfcourse.symbolic.equations import compile_noiseless


@pytest.mark.quick
def test_the_attractor_is_that_of_lorenz():
    """One step of Heun's rule against SciPy's: it errs by some hundredths here, as its error is of
    third order; Euler's by .3."""

    def slope(t, u):
        return [10 * (u[1] - u[0]), 28 * u[0] - u[1] - u[0] * u[2], u[0] * u[1] - 8 * u[2] / 3]

    step, _ = compile_noiseless(lorenz(0.3))
    for u in ([1.509, -1.531, 25.46], [-8.0, -3.0, 30.0], [5.0, 9.0, 15.0]):
        after = solve_ivp(slope, (0, 0.01), u, rtol=1e-10, atol=1e-12).y[:, -1]
        assert np.abs(step(np.array([u]))[0] - after).max() < 0.02
    x, y = lorenz_data(200, 12, seed=1)
    assert x.shape == y.shape == (301, 200, 3)
    seen = ~np.isnan(y).any(axis=(1, 2))
    assert np.flatnonzero(seen).tolist() == list(range(25, 301, 25))
    noise = (y - x)[seen]
    assert abs(noise.std() / np.sqrt(2) - 1) < 4 / np.sqrt(2 * noise.size)
    assert_allclose(x[1:], step(x[:-1]), rtol=1e-9, atol=1e-9)  # nothing disturbs it


def test_the_extended_filter_has_the_published_errors():
    """Means of roots of mean square errors over runs, within four standard errors of both
    simulations and the printed digits."""
    x, y = bearings_data(200, 1)
    error = run(aof(linearised(bearings())), y).mean[1:, :, :2] - x
    each = np.sqrt((error**2).sum(axis=-1).mean(axis=0))
    assert (
        abs(each.mean() - PUBLISHED["bearings_errors"]["EKF"])
        < 4 * each.std() * np.sqrt(1 / 200 + 1 / 1000) + 5e-4
    )


def test_the_reentry_of_the_source():
    """Newton's law and the drag, in plain numbers."""
    x, _ = simulate(reentry(known=True), 20, 2, seed=1)
    r, speed = np.hypot(x[0, 0, 0], x[0, 0, 1]), np.hypot(x[0, 0, 2], x[0, 0, 3])
    drag = -0.59783 * np.exp(0.6932) * np.exp((6374 - r) / 13.406) * speed
    following = x[0, 0, 2:4] + 0.1 * (drag * x[0, 0, 2:4] - 3.986e5 / r**3 * x[0, 0, :2])
    assert (np.abs(x[1, 0, 2:4] - following) < 5 * np.sqrt(2.4064e-5)).all()
    assert (x[:, :, 4] == 0.6932).all() and np.ptp(x[-1, :, 0]) > 0


@pytest.mark.slow
def test_the_reentry_s_extended_filter_has_the_published_error():
    """Of positions, in km; the chapter on the literature has more filters."""
    x, y = simulate(reentry(known=True), 20, 2001, seed=1)
    y[0] = np.nan  # the source predicts before its first correction
    error = (run(aof(linearised(reentry(known=False))), y).mean - x)[1:, :, :2]
    each = np.sqrt((error**2).sum(axis=-1).mean(axis=0))
    assert (
        abs(each.mean() - PUBLISHED["reentry_errors"]["EKF"])
        < 4 * each.std() * np.sqrt(1 / 20 + 1 / 100) + 5e-5
    )


@pytest.mark.quick
def test_the_car_of_the_source():
    """The book's Kalman filter, and its two published figures."""
    x, y = car_data()
    assert x.shape == (100, 4) and y.shape == (101, 1, 2) and np.isnan(y[0]).all()
    A, H = np.eye(4) + 0.1 * np.eye(4, k=2), np.eye(2, 4)
    Q = np.kron([[0.1**3 / 3, 0.1**2 / 2], [0.1**2 / 2, 0.1]], np.eye(2))
    step = (A, np.zeros(4), Q, H, np.zeros(2), 0.25 * np.eye(2))
    prior = np.array([0, 0, 1, -1.0]), np.eye(4)
    means = [mean for _, (mean, _) in oracles.kalman_loop([step] * 101, prior, y[:, 0])]
    # 100 steps of rounding
    assert_allclose(run(kalman_filter(car()), y).mean[:, 0], means, rtol=0, atol=1e-10)
    for name, place in (("measurements", y[1:, 0]), ("Kalman", np.array(means)[1:, :2])):
        error = np.sqrt(((place - x[:, :2]) ** 2).sum(axis=1).mean())
        assert abs(error - PUBLISHED["car_errors"][name]) < 1e-12


def test_the_conditionally_minimax_models_are_those_of_the_source():
    """Their equations typed apart: without noise, at states on both sides of every border."""
    x = np.array([-300.0, -8.0, -0.001, 1e-7, 0.001, 0.4, 1.0, 27.0, 200.0])
    for model, following, seen in (
        (cubic_sensor(), x / (1 + x**2), x**3 + x),
        (logistic(), np.maximum(-1e4, np.minimum(1e4, x * (1 - x))), x),
        (inverse_cube_root(), np.minimum(100, 1 / np.cbrt(x)), x),
    ):
        a, b = compile_noiseless(model)
        assert_allclose(a(x[:, None])[:, 0], following, rtol=1e-12)
        assert_allclose(b(x[:, None])[:, 0], seen, rtol=1e-12)
        for law in (model.state_noise, model.meter_noise):
            assert (law.mean, law.cov) == (0, 1)
