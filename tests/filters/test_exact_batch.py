"""The exact AOF on equidistant nodes: against panels, against closed forms, and whether its error estimates hold."""

import tracemalloc
from functools import partial

import numpy as np
import pytest
from scipy import stats

from kfcourse import Model, filters, load_variants, run, simulate
from kfcourse.filters import adaptive_pointmass, kalman_filter, particle

# What these tests compare with is known to far more digits than a comparison needs.
ACCURACY = 1e-6
ACCURATE = 1e-3  # and what one needs
pointmass = partial(filters.pointmass, accuracy=ACCURACY)

SHIPPED = {name: variant.model for name, variant in load_variants().items() if variant.model.n == 1}
MODELS = SHIPPED | {"53, f=0.2": SHIPPED["53"].replace(f=0.2)}
# Rounding: the nodes, hundreds of them, have masses with errors of some eps each, and so have the kernels.
ROUNDING = 1000 * np.finfo(float).eps
# Kernels of nodes lighter than 1e-9, and of panels lighter than 1e-10, need not overlap; a few of them lie side by side.
LEFT_OUT = 1e-8
WORKING = 1.2e8  # bytes that a step takes for a while: 2^19 nodes that are refined, in some 25 arrays


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
    states = list(followed(filters.pointmass(MODELS["53"]), y))
    assert np.mean([state.memory.adaptive for state in states]) < 0.01
    assert np.mean([len(grid.x) for state in states for grid in state.memory.fine]) < 50


def test_a_narrow_hump_at_the_middle_of_its_prediction_is_seen():
    """A thousandth as wide, between two nodes of a first look: what is as wide as the prediction hid it."""
    _, y = simulate(MODELS["53"], 512, 51, seed=1)
    for state in followed(filters.pointmass(MODELS["53"]), y[:20, [396]]):
        assert not state.memory.adaptive.any()


def test_after_panels_nodes_do_again():
    """Kernels far from the measurement are no humps beside the root that explains it, though the likeliest among kernels."""
    one, (_, y) = filters.pointmass(MODELS["53"]), simulate(MODELS["53"], 20, 9, seed=1)
    *_, state = followed(one, y[:8])
    memory = state.memory._replace(fine=[grid._replace(uniform=False) for grid in state.memory.fine])
    expected, found = (one.step(each, y[8]) for each in (state, state._replace(memory=memory.without_predictions())))
    assert not found.memory.adaptive.any()
    np.testing.assert_allclose(found.memory.variance, expected.memory.variance, rtol=1e-3)


@pytest.mark.parametrize(
    ("state", "meter"),
    [
        # where the noise vanishes, the prediction has a logarithmic spike
        ("0.9*x + 0.5*sin(x)*v", "x + 0.3*w"),
        ("0.9*x + 0.3*x*v", "x + 0.3*(1 + x**2)*w"),
        ("0.95*x + 0.3*v", "0.1*x + sin(x)*w"),
        ("0.45*(x - 1 + Abs(x + 1)) + 0.4*v", "x + 0.5*w"),
    ],
)
def test_where_densities_are_rough_the_error_that_is_told_is_that_of_the_step(state, meter):
    model = Model.define(state, meter)
    _, y = simulate(model, 60, 4, seed=1)
    for ours, truth in zip(followed(filters.pointmass(model), y), followed(pointmass(model), y), strict=True):
        error = np.abs(ours.posterior.mean - truth.posterior.mean)[:, 0] / np.sqrt(truth.posterior.cov[:, 0, 0])
        # Wherever the spike lies; by chance an estimate is somewhat low.  Without `roughness` it is so 500 times.
        assert (error <= 5 * ours.memory.error + 0.1 * ACCURATE).all()
        assert (error <= 1e-2).all()


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


@pytest.mark.filterwarnings("ignore:divide by zero")  # the noise is infinite at x = 0
def test_a_precision_with_a_chi_square_prior_has_a_gamma_posterior():
    """y_i = w / x: p(x | y) = C |x|^n exp(-x^2 (1 + S) / 2), S = sum y^2, x^2 ~ Gamma((n + 1) / 2, scale 2 / (1 + S))."""
    y = np.array([0.7, -1.2, 0.1, 2.0, 0.3])
    for n, state in enumerate(followed(filters.pointmass(Model.define("x", "w/x"), 1e-4), y[:, None, None]), start=1):
        gamma = stats.gamma((n + 1) / 2, scale=2 / (1 + (y[:n] ** 2).sum()))
        grid, error = state.memory.fine[0], state.memory.error[0]
        # |x|^n has a kink at 0 for odd n, and interpolation across it is no better than the rule.
        allowed = error + LEFT_OUT
        assert error < 1e-3
        assert abs(grid.mean()) <= allowed * np.sqrt(gamma.mean())
        assert abs(state.posterior.cov[0, 0, 0] / gamma.mean() - 1) <= allowed
        assert abs(grid.mass @ grid.x**4 / gamma.moment(2) - 1) <= 4 * allowed  # d x^4 / x^4 = 2 d x^2 / x^2, and the tails


def test_a_share_has_a_beta_type_posterior():
    """y_i = w / (u^2 (1 - u)), u = (1 + tanh x) / 2, always 0: p(x | y) = C exp(-x^2/2) u^(2n) (1 - u)^n, by rectangles."""
    model = Model.define("x", "8*w/((1 + tanh(x))**2*(1 - tanh(x)))")
    x = np.linspace(-9, 9, 2001)  # some 50 nodes a deviation: rectangles do not err on smooth humps
    u = (1 + np.tanh(x)) / 2
    for n, state in enumerate(followed(pointmass(model), np.zeros((6, 1, 1))), start=1):
        weight = np.exp(-0.5 * x * x) * u ** (2 * n) * (1 - u) ** n
        mean = weight @ x / weight.sum()
        variance = weight @ (x - mean) ** 2 / weight.sum()
        allowed = state.memory.error[0] + LEFT_OUT
        assert state.memory.error[0] < 100 * ACCURACY
        assert abs(state.posterior.mean[0, 0] - mean) <= allowed * np.sqrt(variance)
        assert abs(state.posterior.cov[0, 0, 0] / variance - 1) <= allowed


def test_predictions_keep_within_their_room_and_change_nothing():
    """Noise that vanishes at 0 wants thousands of kernels a trajectory.  What finds no room is made again in the next step."""
    model, room = Model.define("0.9*x + 0.05*x*v", "x + w"), 5e5
    _, y = simulate(model, 24, 2, seed=5)
    free = list(followed(pointmass(model), y))
    held = sum(kernels.bytes() for _, kernels in free[0].memory.groups)
    assert held > 3 * room
    assert not len(free[0].memory.later)
    tracemalloc.start()
    tight = list(followed(pointmass(model, memory=room), y))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < room + WORKING
    assert len(tight[0].memory.later)
    for a, b in zip(free, tight, strict=True):
        assert sum(kernels.bytes() for _, kernels in b.memory.groups) <= room
        # sums over the same kernels, with more or fewer zeros behind them
        np.testing.assert_allclose(b.posterior.mean, a.posterior.mean, rtol=1e-10)
        np.testing.assert_allclose(b.predicted.cov, a.predicted.cov, rtol=1e-10)


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


def test_the_error_that_is_told_is_that_of_all_steps_so_far():
    """As if the filter never forgot one: it never falls, on any trajectory."""
    model = Model.define("0.9*x + 0.3*sin(x) + 0.2*v", "x + 0.1*x**2 + 0.3*w")
    _, y = simulate(model, 12, 12, seed=4)
    errors = np.array([state.memory.error for state in followed(pointmass(model), y)])
    assert (np.diff(errors, axis=0, prepend=0.0) >= 0).all() and (errors[-1] > 0).all()
