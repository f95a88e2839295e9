"""The exact AOF on equidistant nodes: against panels, against closed forms, and whether its error estimates hold."""

import numpy as np
import pytest

from kfcourse import Model, load_variants, run, simulate
from kfcourse.filters import adaptive_pointmass, kalman_filter, particle, pointmass
from kfcourse.filters.exact import ACCURACY

SHIPPED = {name: variant.model for name, variant in load_variants().items() if variant.model.n == 1}
MODELS = SHIPPED | {"53, f=0.2": SHIPPED["53"].replace(f=0.2)}
# Rounding: the nodes, hundreds of them, have masses with errors of some eps each, and so have the kernels.
ROUNDING = 1000 * np.finfo(float).eps
# Kernels of nodes lighter than 1e-9, and of panels lighter than 1e-10, need not overlap; a few of them lie side by side.
LEFT_OUT = 1e-8


def followed(one, y):
    """The states of a filter after each of the measurements (steps, runs, 1)."""
    state = one.init(y.shape[1])
    for measurement in y:
        state = one.step(state, measurement)
        yield state


@pytest.mark.parametrize("name", MODELS)
def test_it_equals_the_adaptive_filter_within_the_errors_that_both_report(name):
    model = MODELS[name]
    _, y = simulate(model, 3, 6, seed=11)
    for ours, theirs in zip(
        followed(pointmass(model), y), followed(adaptive_pointmass(model, order=12, tolerance=1e-9), y), strict=True
    ):
        sigma = np.sqrt(theirs.posterior.cov[:, 0, 0])
        # The adaptive filter reports the change from a rule three orders lower, relative to which its error is negligible.
        allowed = ours.memory.error + theirs.memory.discretisation_error() / sigma + LEFT_OUT
        assert (np.abs(ours.posterior.mean - theirs.posterior.mean)[:, 0] <= allowed * sigma).all()
        assert (np.abs(np.sqrt(ours.posterior.cov[:, 0, 0]) / sigma - 1) <= allowed).all()


@pytest.mark.parametrize("name", MODELS)
def test_the_error_of_a_step_is_rarely_above_the_accuracy(name):
    model = MODELS[name]
    _, y = simulate(model, 60, 8, seed=12)
    errors = np.array([state.memory.error for state in followed(pointmass(model), y)])
    own = np.diff(errors, axis=0, prepend=0)
    # More nodes and the adaptive filter keep below the accuracy what new nodes can mend.  Where kernels are narrow, interpolation
    # comes on top; one step in five of f = 0.2 needs it.
    assert np.quantile(own, 0.8) <= ACCURACY
    assert own.max() <= 1e-2


def test_variant_53_rarely_needs_the_adaptive_filter():
    # One such step costs as much as fifty others; 30 times its rate bears one in a hundred.
    _, y = simulate(MODELS["53"], 400, 12, seed=13)
    states = list(followed(pointmass(MODELS["53"]), y))
    assert np.mean([state.memory.adaptive for state in states]) < 0.01
    assert np.mean([len(grid.x) for state in states for grid in state.memory.fine]) < 50


def test_every_step_is_the_kalman_filters_on_a_linear_model():
    model = Model.define("0.95*x + 0.3*v - 1", "2*x + 0.4*w", prior={"mean": 5.0, "variance": 4.0})
    _, y = simulate(model, 300, 30, seed=14)
    for ours, theirs in zip(followed(pointmass(model), y), followed(kalman_filter(model), y), strict=True):
        allowed = ours.memory.error + ROUNDING * (1 + np.abs(theirs.posterior.mean[:, 0]))
        sigma = np.sqrt(theirs.posterior.cov[..., 0, 0])
        assert (ours.memory.error < 30 * ACCURACY).all()
        assert (np.abs(ours.posterior.mean - theirs.posterior.mean)[:, 0] <= allowed * sigma).all()
        np.testing.assert_allclose(ours.predicted.cov[:, 0, 0], theirs.predicted.cov[..., 0, 0] * np.ones(300), rtol=1e-5)


def test_a_measurement_far_beyond_the_prediction_is_followed():
    # 30 sigmas of the prediction: exp(-450) is a number still.
    model = Model.define("0.9*x + 0.3*v", "x + 0.01*w")
    y = np.array([[[30.0]], [[26.0]]])
    ours, theirs = (list(followed(one(model), y)) for one in (pointmass, kalman_filter))
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(a.posterior.mean, b.posterior.mean, rtol=1e-6)


@pytest.mark.parametrize(
    ("state", "mean", "variance"),
    [
        ("x**2 + v", 1.0, 3.0),
        ("sin(x) + 0.5*v", 0.0, (1 - np.exp(-2)) / 2 + 0.25),
        ("exp(x/4) + 0.3*v", np.exp(1 / 32), np.exp(1 / 8) - np.exp(1 / 16) + 0.09),
        ("9*x + 0.2*v", 0.0, 81.04),
        ("x + x*v", 0.0, 2.0),
    ],
)
def test_a_prediction_has_the_moments_of_the_closed_form(state, mean, variance):
    # The density of the next state, not only the moments of the map: the second state without a measurement is drawn from it.
    model = Model.define(state, "x + w")
    first, second = followed(pointmass(model), np.full((2, 1, 1), np.nan))
    sigma = np.sqrt(variance)
    # x + x v has a logarithmic singularity at 0, which panels follow to the share that they may leave out.
    assert abs(first.predicted.mean[0, 0] - mean) <= 1e-8 * sigma
    assert abs(first.predicted.cov[0, 0, 0] / variance - 1) <= 1e-8
    assert abs(second.posterior.mean[0, 0] - mean) <= 1e-6 * sigma
    assert abs(second.posterior.cov[0, 0, 0] / variance - 1) <= 1e-6


# --- a static parameter, and stochastic volatility


def test_a_parameter_that_stands_still_is_estimated():
    """y_i = exp(x/2) w: p(x | y) = C exp(-x^2/2 - n x/2 - exp(-x) sum y^2 / 2), not normal; by quadrature at every step."""
    model = Model.define("x", "exp(x/2)*w")
    _, y = simulate(model, 3, 6, seed=5)
    found = run(pointmass(model), y)
    x = np.linspace(-9, 9, 20_001)
    for i in range(3):
        for n in range(1, 7):
            logs = -0.5 * x**2 - 0.5 * n * x - 0.5 * np.exp(-x) * (y[:n, i, 0] ** 2).sum()
            weight = np.exp(logs - logs.max())
            mean = weight @ x / weight.sum()
            variance = weight @ (x - mean) ** 2 / weight.sum()
            assert abs(found.mean[n - 1, i, 0] - mean) < 1e-6 * np.sqrt(variance)
            assert found.cov[n - 1, i, 0, 0] == pytest.approx(variance, rel=1e-6)


def test_stochastic_volatility_is_what_many_particles_find():
    """Twenty clouds of 10,000 particles that do not look at the measurement: within 4 of their standard errors."""
    model = Model.define("0.95*x + 0.3*v", "exp(x/2)*w")
    _, y = simulate(model, 2, 6, seed=4)
    expected = run(pointmass(model), y)
    found = [run(particle(model, 10_000, seed, guided=False), y) for seed in range(20)]
    for kind in ("mean", "cov"):
        values = np.stack([getattr(one, kind).reshape(6, 2) for one in found])
        error = values.std(axis=0, ddof=1) / np.sqrt(20)
        assert (abs(values.mean(axis=0) - getattr(expected, kind).reshape(6, 2)) < 4 * error).all(), kind
