"""The exact AOF where the noise is small, vanishes at a state or everywhere, and where only the noise tells of the state."""

import time
from functools import partial

import numpy as np
import pytest

from kfcourse import Model, ModelError, filters, load_variants, run, simulate
from kfcourse.filters import adaptive_pointmass, kalman_filter
from kfcourse.scenarios.benchmarks import inverse_cube_root

# What these tests compare with is known to far more digits than a comparison needs.
ACCURACY = 1e-6
pointmass = partial(filters.pointmass, accuracy=ACCURACY)

# Interpolation over 129 nodes, 8 of them at a time, has an error of about 1e-9 where a posterior is nearly normal.
INTERPOLATED = 1e-8


@pytest.mark.parametrize(
    ("state", "options"),
    [
        ("0.9*x + 0.001*v", {}),
        ("31*x + 0.1*v", {}),
        ("-0.9*x + 1e-6*v + 2", {}),
        ("0.9*x", {}),  # no noise: the density is only stretched
        ("x", {"prior": {"mean": 3.0, "variance": 4.0}}),  # a constant is estimated
        ("c*x + e*v", {"parameters": {"c": 0.9, "e": 0.0}}),
        ("0.9*x + v", {"state_noise": {"variance": 0.0}}),
    ],
)
def test_narrow_kernels_give_the_kalman_filter(state, options):
    model = Model.define(state, "x + 0.5*w", **options)
    _, y = simulate(model, 3, 5, seed=1)
    exact, kalman = pointmass(model), kalman_filter(model)
    a, b = exact.init(3), kalman.init(3)
    for measurement in y:
        a, b = exact.step(a, measurement), kalman.step(b, measurement)
        sigma = np.sqrt(b.posterior.cov[..., 0, 0])
        allowed = INTERPOLATED + a.memory.error
        assert (a.memory.error < 10 * ACCURACY).all()
        assert (np.abs(a.posterior.mean - b.posterior.mean)[:, 0] <= allowed * sigma).all()
        assert (np.abs(a.posterior.cov[:, 0, 0] / b.posterior.cov[..., 0, 0] - 1) <= allowed).all()


def test_a_state_that_is_known_at_first_stays_known_until_noise_comes():
    model = Model.define("0.9*x + 0.3*v", "x + 0.5*w", prior={"mean": 2.0, "variance": 0.0})
    _, y = simulate(model, 3, 4, seed=1)
    ours, theirs = run(pointmass(model), y), run(kalman_filter(model), y)
    np.testing.assert_allclose(ours.mean, theirs.mean, rtol=0, atol=INTERPOLATED)
    np.testing.assert_allclose(ours.cov[1:], theirs.cov[1:], rtol=INTERPOLATED)
    assert (ours.cov[0] == 0).all()


@pytest.mark.parametrize(("c", "e"), [(1.05, 0.01), (1.0, 0.001)])
def test_a_noise_that_vanishes_at_a_state_has_the_moments_of_the_closed_form(c, e):
    # x' = c x + e x^2 v.  Without measurements M x' = 0, M x'^2 = c^2 M x^2 + e^2 M x^4, and of x_1 ~ c x + e x^2 v
    # M x_1^4 = c^4 M x^4 + 6 c^2 e^2 M x^6 + 3 e^4 M x^8, where M x^2, x^4, x^6, x^8 = 1, 3, 15, 105.
    model = Model.define("c*x + e*x**2*v", "x + w", {"c": c, "e": e})
    exact = pointmass(model)
    first = exact.step(exact.init(1), np.full((1, 1), np.nan))
    second = exact.step(first, np.full((1, 1), np.nan))
    square = c**2 + 3 * e**2
    fourth = 3 * c**4 + 90 * c**2 * e**2 + 315 * e**4
    np.testing.assert_allclose(first.predicted.cov[0, 0, 0], square, rtol=INTERPOLATED)
    # The noises that fold the state, up to 1e-7 of the mass, are left out, and far in the tails they count: x^2 = 50 there.
    np.testing.assert_allclose(second.posterior.cov[0, 0, 0], square, rtol=50 * 1e-7)
    np.testing.assert_allclose(second.predicted.cov[0, 0, 0], c**2 * square + e**2 * fourth, rtol=50 * 1e-7)


@pytest.mark.parametrize("meter", ["exp(x/2)*w", "x*w + 1", "(1 + x**2)*w"])
def test_a_meter_whose_signal_lacks_the_state(meter):
    # Stochastic volatility and its like: only the size of the measurement tells.
    model = Model.define("0.95*x + 0.3*v", meter)
    _, y = simulate(model, 2, 4, seed=3)
    ours, theirs = pointmass(model), adaptive_pointmass(model, order=12, tolerance=1e-9)
    a, b = ours.init(2), theirs.init(2)
    for measurement in y:
        a, b = ours.step(a, measurement), theirs.step(b, measurement)
        sigma = np.sqrt(b.posterior.cov[:, 0, 0])
        allowed = a.memory.error + b.memory.discretisation_error() / sigma + INTERPOLATED
        assert (a.memory.error < 100 * ACCURACY).all()
        assert (np.abs(a.posterior.mean - b.posterior.mean)[:, 0] <= allowed * sigma).all()


@pytest.mark.parametrize(
    ("state", "meter"), [("0.9*x + 0.3*v", "sin(1000*x) + 0.01*w"), ("x**3 + 1e-6*v", "x + w"), ("1e5*x + 0.1*v", "x + w")]
)
def test_beyond_the_budget_there_is_a_message_within_seconds(state, meter):
    model = Model.define(state, meter)
    with np.errstate(over="ignore"):  # a cube six times over
        _, y = simulate(model, 4, 6, seed=1)
    exact = pointmass(model)
    state, start = exact.init(4), time.process_time()
    with pytest.raises(ModelError, match=r"step \d of Model.*narrow|step \d of Model.*nodes"):
        for measurement in y:
            state = exact.step(state, measurement)
    assert time.process_time() - start < 20  # it takes up to 6 on a slow processor; minutes would be what the budget is against


@pytest.mark.parametrize("state", ["x**2 - 1 + 0.01*v", "x**2 + 0.01*v", "31*x + 0.1*v", "sin(3*x) + 0.01*v"])
def test_a_step_without_measurement_keeps_the_moments(state):
    """The prediction's moments are sums over the masses; the next posterior has gone through kernels, folds and new nodes."""
    exact, nothing = pointmass(Model.define(state, "x + w")), np.full((1, 1), np.nan)
    first = exact.step(exact.init(1), nothing)
    second = exact.step(first, nothing)
    sigma = np.sqrt(first.predicted.cov[0, 0, 0])
    assert abs(second.posterior.mean - first.predicted.mean)[0, 0] < INTERPOLATED * sigma
    assert abs(second.posterior.cov[0, 0, 0] / sigma**2 - 1) < INTERPOLATED


def test_kernels_that_vanish_between_two_nodes_are_followed():
    """Variant 6, x' = 0.9 x + 0.3 (1 + x/2) v: the noise vanishes at -2, and the second posterior has its nodes around -1.8."""
    model = load_variants()["6"].model
    y = np.array([[[-0.641512489785]], [[-2.130603651626]]])
    ours, theirs = pointmass(model), adaptive_pointmass(model, order=16, tolerance=1e-11)
    a, b = ours.init(1), theirs.init(1)
    for measurement in y:
        a, b = ours.step(a, measurement), theirs.step(b, measurement)
    assert abs(a.posterior.mean - b.posterior.mean)[0, 0] < INTERPOLATED * np.sqrt(b.posterior.cov[0, 0, 0])
    assert abs(a.posterior.cov / b.posterior.cov - 1)[0, 0, 0] < INTERPOLATED


def test_a_kernel_that_is_narrow_here_and_folds_there():
    """x' = 0.9 x + 0.05 x^2 v: narrow near 0, and far out the noise turns f(., v) back.  Against a sum over a million states."""
    model = Model.define("0.9*x + 0.05*x**2*v", "x + 0.5*w")
    exact, y = pointmass(model), np.array([[0.4], [1.3]])
    state = exact.init(1)
    state = exact.step(state, y[:1])
    state = exact.step(state, y[1:])
    # The second posterior's moments: x' = f(x, u), over x of the first posterior, N(0.32, 0.2), and u; trapezoidal in both.
    x = 0.32 + np.sqrt(0.2) * np.linspace(-9, 9, 2001)[:, None]
    u = np.linspace(-8, 8, 801)
    weight = np.exp(-0.5 * ((x - 0.32) ** 2 / 0.2 + u**2))
    after = 0.9 * x + 0.05 * x**2 * u
    weight *= np.exp(-0.5 * ((1.3 - after) / 0.5) ** 2)
    mean = (weight * after).sum() / weight.sum()
    variance = (weight * (after - mean) ** 2).sum() / weight.sum()
    assert abs(state.posterior.mean[0, 0] - mean) < 10 * INTERPOLATED * np.sqrt(variance)
    assert abs(state.posterior.cov[0, 0, 0] / variance - 1) < 10 * INTERPOLATED
    assert state.memory.error[0] < 10 * INTERPOLATED


BEYOND = 40.0  # the states of the oracles below lie within


def by_midpoints(y, prior, mean, deviation):
    """Means and deviations of p(x_k | y_0..k), y = x + w, with the midpoint rule on cells none of which holds the jump at 0."""
    x = np.arange(-BEYOND, BEYOND, 0.02) + 0.01
    kernel = np.exp(-0.5 * ((x[:, None] - mean(x)) / deviation(x)) ** 2) / deviation(x)
    ahead = np.exp(-0.5 * (x - prior.mean) ** 2 / prior.cov[0, 0])[:, None]
    for measured in y[:, :, 0]:
        p = ahead * np.exp(-0.5 * (measured - x[:, None]) ** 2)
        p /= p.sum(axis=0)
        found = x @ p
        yield found, np.sqrt(x**2 @ p - found**2)
        ahead = kernel @ p


@pytest.mark.parametrize(
    ("state", "mean", "deviation"),
    [
        ("x - 0.5*sign(x) + v", lambda x: x - 0.5 * np.sign(x), np.ones_like),  # dry friction
        ("0.8*x + 3*sign(x) + v", lambda x: 0.8 * x + 3 * np.sign(x), np.ones_like),
        ("Heaviside(x) + v", lambda x: np.heaviside(x, 0.5), np.ones_like),
        ("0.9*x + (1 if x < 0 else 2)*v", lambda x: 0.9 * x, lambda x: np.where(x < 0, 1.0, 2.0)),
    ],
)
def test_nodes_are_split_where_the_object_jumps(state, mean, deviation):
    """A midpoint rule of cells 1/50 of the meter's deviation wide errs by some 1e-5; across a jump it would by 1e-2."""
    model = Model.define(state, "x + w", prior={"mean": 0.5, "variance": 2.0})
    _, y = simulate(model, 12, 5, seed=1)
    exact = filters.pointmass(model)
    ours = exact.init(12)
    for measured, (middle, sd) in zip(y, by_midpoints(y, model.prior, mean, deviation), strict=True):
        ours = exact.step(ours, measured)
        assert (ours.memory.error < 1e-3).all()
        assert (np.abs(ours.posterior.mean[:, 0] - middle) / sd <= 1e-4).all()
        assert (np.abs(np.sqrt(ours.posterior.cov[:, 0, 0]) / sd - 1) <= 1e-4).all()


def test_a_state_that_comes_from_beside_a_pole_is_followed_far_out():
    """x' = x^(-1/3) + v with the odd root: few of x come to 20, from 1/8000.  Particles have none there.

    The oracle takes cells 1/500 of their distance from the pole: so many that their midpoints, at 20, are 1/75 apart.
    """
    model = inverse_cube_root()
    first, then = 0.5, np.array([20.0, -30.0, 1.0, 7.0])
    exact = filters.pointmass(model)
    ours = exact.step(exact.step(exact.init(4), np.full((4, 1), first)), then[:, None])
    edge = np.geomspace(1e-6, 12.0, 8000)
    x, length = 0.5 * (edge[1:] + edge[:-1]), np.diff(edge)
    x, length = np.concatenate([-x, x]), np.concatenate([length, length])
    mass = length * np.exp(-0.5 * (x - 3.01) ** 2 - 0.5 * (x - first) ** 2)
    for row, measured in enumerate(then):
        there = measured + np.linspace(-8, 8, 161)
        p = np.exp(-0.5 * (there[:, None] - 1 / np.cbrt(x)) ** 2) @ mass * np.exp(-0.5 * (measured - there) ** 2)
        p /= p.sum()
        middle = p @ there
        sd = np.sqrt(p @ (there - middle) ** 2)
        assert abs(ours.posterior.mean[row, 0] - middle) <= 1e-3 * sd
        assert abs(np.sqrt(ours.posterior.cov[row, 0, 0]) / sd - 1) <= 1e-3
