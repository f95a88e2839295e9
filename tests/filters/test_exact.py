"""The exact AOF against the Kalman filter, against dense grids and quadratures written here, and against itself."""

from functools import partial

import mpmath
import numpy as np
import pytest

from kfcourse import Model, ModelError, compare, filters, lab_filters, load_variants, run, simulate
from kfcourse.filters import adaptive_pointmass, aof, kalman_filter
from kfcourse.filters.exact.kernels import Unresolved
from kfcourse.filters.exact.panels import Rule
from kfcourse.lab.short_names import LAB, has_exact
from kfcourse.symbolic.structure import gaussian

# What these tests compare with is known to far more digits than a comparison needs.
ACCURACY = 1e-6
pointmass = partial(filters.pointmass, accuracy=ACCURACY)

# A panel is resolved when its last Legendre coefficients are below `tolerance` (1e-5) of the mass.  A Gauss rule of q nodes
# integrates degree 2q - 1 exactly, so the masses are then wrong by about tolerance^2, on some tens of panels.
RESOLVED = 100 * 1e-5**2


def follow(model, y, **options):
    """Means, standard deviations and reported errors (steps, runs) of the exact filter along measurements y (steps, runs, 1)."""
    exact = adaptive_pointmass(model, **options) if options else pointmass(model)
    state, found = exact.init(y.shape[1]), []
    for measurement in y:
        state = exact.step(state, measurement)
        found.append((state.posterior.mean[:, 0], np.sqrt(state.posterior.cov[:, 0, 0]), state.memory.discretisation_error()))
    return tuple(np.array(values) for values in zip(*found, strict=True))


def normal(x, mean, sigma):
    return np.exp(-0.5 * ((x - mean) / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi))


@pytest.fixture(scope="module")
def variants():
    return {name: variant.model for name, variant in load_variants().items()}


@pytest.fixture(scope="module", params=[0.02, 0.2], ids=["f=0.02", "f=0.2"])
def followed53(request, variants):
    """Variant 53, the lab's meter and one ten times worse: model, true states, measurements, what the filter found."""
    model = variants["53"].replace(f=request.param)
    x, y = simulate(model, 250, 12, 3)
    return model, x[:, :, 0], y, follow(model, y)


# --- against the Kalman filter


@pytest.mark.parametrize(
    ("state", "meter", "prior"),
    [
        ("0.9*x + 0.3*v", "x + 0.5*w", {}),
        ("-1.1*x + 2 + 0.5*v", "3*x - 1 + 0.4*w", {"mean": 40.0, "variance": 9.0}),
        ("x + 0.001*v", "1000*x + 2*w", {"mean": -0.3, "variance": 1e-4}),
    ],
)
def test_on_a_linear_gaussian_model_it_is_the_kalman_filter(state, meter, prior):
    model = Model.define(state, meter, prior=prior)
    _, y = simulate(model, 8, 12, seed=4)
    exact, expected = run(pointmass(model), y), run(kalman_filter(model), y)
    sigma = np.sqrt(expected.cov[..., 0, 0])
    assert (np.abs(exact.mean - expected.mean)[..., 0] <= RESOLVED * sigma).all()
    np.testing.assert_allclose(exact.cov, expected.cov, rtol=2 * RESOLVED)


@pytest.mark.parametrize("exact_filter", [pointmass, adaptive_pointmass])
def test_its_prediction_is_the_kalman_filters_too(exact_filter):
    model = Model.define("0.9*x + 1 + 0.3*v", "x + 0.5*w")
    exact, expected = exact_filter(model), kalman_filter(model)
    a, b = exact.init(1), expected.init(1)
    for y in (0.3, -1.2, 2.0):
        a, b = exact.step(a, np.array([[y]])), expected.step(b, np.array([[y]]))
        np.testing.assert_allclose(a.predicted.mean, b.predicted.mean, rtol=0, atol=RESOLVED)
        np.testing.assert_allclose(a.predicted.cov[0], b.predicted.cov, rtol=RESOLVED)


# --- against other integrations of the same equation


def on_a_uniform_grid(y, a, q, b, r, mean, variance, half_width, nodes=2001):
    """The Stratonovich equation with rectangles: a(x), b(x) and sigmas q, r(x) of both noises; means and sigmas (steps,).

    The narrowest density here spans more than ten nodes per sigma: rectangles then err by exp(-2 pi^2 10^2), that is not at all.
    """
    x = np.linspace(-half_width, half_width, nodes)
    kernel = normal(x[:, None], a(x), q)
    density, found = normal(x, mean, np.sqrt(variance)), []
    for value in y:
        density = density * normal(value, b(x), r(x))
        density /= density.sum()
        centre = density @ x
        found.append((centre, np.sqrt(density @ (x - centre) ** 2)))
        density = kernel @ density
    return np.array(found).T


DENSE = {
    "5": (lambda x: 0.95 * x, 0.2, np.sin, lambda x: 0.3, 1.0, 9.0),
    "7": (lambda x: 0.9 * x, 0.3, lambda x: x, lambda x: 0.3 * (1 + x**2), 1.0, 9.0),
    "11": (lambda x: x + 0.1 * (x - x**3), 0.15, lambda x: x, lambda x: 0.5, 0.3, 5.0),
}


@pytest.mark.parametrize("name", DENSE)
def test_it_equals_a_dense_uniform_grid(variants, name):
    a, q, b, r, variance, half_width = DENSE[name]
    _, y = simulate(variants[name], 5, 10, seed=8)
    mean, sigma, reported = follow(variants[name], y)
    for i in range(y.shape[1]):
        expected_mean, expected_sigma = on_a_uniform_grid(y[:, i, 0], a, q, b, r, 0.0, variance, half_width)
        assert (np.abs(mean[:, i] - expected_mean) <= reported[:, i] + RESOLVED * expected_sigma).all()
        # the variance is resolved as the mean is
        assert (np.abs(sigma[:, i] / expected_sigma - 1) <= reported[:, i] / expected_sigma + RESOLVED).all()


@pytest.mark.parametrize("f", [0.02, 0.2])
@pytest.mark.parametrize("y", [2.0, -1.3, 0.4, 0.01])
def test_on_variant_53_the_first_posterior_is_prior_times_likelihood(variants, f, y):
    mean, sigma, reported = follow(variants["53"].replace(f=f), np.array([[[y]]]))
    width = f * y * y

    def density(x):
        x = mpmath.mpf(x)
        return mpmath.exp(-x * x / 2 - ((y - x) / (f * x * x)) ** 2 / 2) / (x * x) if x else mpmath.mpf(0)

    steps = [width * 2.0**j for j in range(-2, 40) if width * 2.0**j < 40]
    points = sorted({-40.0, 0.0, y, 40.0, *(y + s for s in steps), *(y - s for s in steps)})
    with mpmath.workdps(30):
        total = mpmath.quad(density, points)
        expected = mpmath.quad(lambda x: x * density(x), points) / total
        variance = mpmath.quad(lambda x: (x - expected) ** 2 * density(x), points) / total
    expected, variance = float(expected), float(variance)
    # 8 sigmas of the prior hold all but 1e-15 of it; the meter may weigh what is left out, but these measurements do not
    tolerance = reported[0, 0] + RESOLVED * np.sqrt(variance) + 1e-15 * abs(y)
    assert abs(mean[0, 0] - expected) <= tolerance
    assert abs(sigma[0, 0] / np.sqrt(variance) - 1) <= tolerance / np.sqrt(variance)


def test_on_variant_53_it_equals_a_grid_that_moves_with_the_measurement(variants):
    # Away from 0 the posterior lies within a few f y^2 of y: 2001 nodes over 15 of them, rectangles as above.
    c, e, f = 0.9, 0.05, 0.02
    rng = np.random.default_rng(2)
    x, y = 1.5, []
    for _ in range(6):
        y.append(x + f * x * x * rng.normal())
        x = x * (c + e * rng.normal())
    mean, sigma, reported = follow(variants["53"], np.array(y)[:, None, None])
    before, masses = None, None
    for k, value in enumerate(y):
        x = value + np.linspace(-15, 15, 2001) * f * value * value
        predicted = normal(x, 0, 1) if before is None else normal(x[:, None], c * before, e * np.abs(before)) @ masses
        masses = predicted * normal(value, x, f * x * x)
        masses /= masses.sum()
        before, centre = x, masses @ x
        spread = np.sqrt(masses @ (x - centre) ** 2)
        assert abs(mean[k, 0] - centre) <= reported[k, 0] + RESOLVED * spread
        assert abs(sigma[k, 0] / spread - 1) <= reported[k, 0] / spread + RESOLVED


# --- against itself


def test_its_variance_is_its_mean_square_error(followed53):
    _, x, _, (mean, sigma, _) = followed53
    # M[e^2 / p] = 1 at every step; trajectories are independent, steps of one are not.
    ratio = (((x - mean) / sigma) ** 2).mean(axis=0)
    assert abs(ratio.mean() - 1) <= 4 * ratio.std(ddof=1) / np.sqrt(len(ratio))


def test_its_error_is_centred(followed53):
    _, x, _, (mean, sigma, _) = followed53
    normalised = ((x - mean) / sigma).mean(axis=0)
    assert abs(normalised.mean()) <= 4 * normalised.std(ddof=1) / np.sqrt(len(normalised))


def test_the_discretisation_is_far_finer_than_the_posterior(followed53):
    _, _, _, (_, sigma, reported) = followed53
    assert np.median(reported / sigma) < 1e-4
    # and nowhere does it reach what 250 trajectories could see of the error: sigma / sqrt(250)
    assert (reported / sigma).max() < 1 / np.sqrt(250)


def test_refining_changes_less_than_the_reported_error(followed53):
    model, _, y, (mean, sigma, reported) = followed53
    some = np.s_[:, :30]
    finer, _, _ = follow(model, y[some], order=12, tolerance=1e-8)
    assert (np.abs(finer - mean[some]) <= reported[some] + RESOLVED * sigma[some]).all()


def test_a_posterior_at_a_border_of_the_prediction_is_seen(variants):
    # The measurement falls two sigmas from a very narrow posterior's prediction, where a panel border is: its neighbour is a
    # thousand times wider than the posterior, which must not be missed.  Found among 3000 random steps.
    _, y = simulate(variants["53"], 250, 5, 3)
    mean, sigma, _ = follow(variants["53"], y[:, 201:202])
    finer, _, _ = follow(variants["53"], y[:, 201:202], order=24, tolerance=1e-10)
    assert (np.abs(finer - mean) <= 1e-4 * sigma).all()


@pytest.mark.parametrize("name", ["53", "2", "5", "7", "10"])
def test_no_filter_beats_it(variants, name):
    model = variants[name]
    result = compare(lab_filters(model, [*LAB, "aof-exact"]), model, 200, 8, seed=6, design_runs=20_000)
    for other in LAB:
        excess = result.difference(other, "aof-exact")
        assert (excess.value >= -4 * excess.standard_error).all(), other


# --- measurements that are missing, odd or impossible


def test_a_missing_measurement_is_a_prediction(variants):
    for name in ("53", "5"):
        exact = pointmass(variants[name])
        _, y = simulate(variants[name], 6, 4, seed=2)
        state = exact.init(6)
        nothing = exact.step(state, np.full((6, 1), np.nan))
        prior = variants[name].prior
        sigma = np.sqrt(prior.cov[0, 0])
        assert np.abs(nothing.posterior.mean[:, 0] - prior.mean[0]).max() <= RESOLVED * sigma
        np.testing.assert_allclose(nothing.posterior.cov[:, 0, 0], prior.cov[0, 0], rtol=RESOLVED)
        for measurement in y:
            state = exact.step(state, measurement)
        after = exact.step(state, np.full((6, 1), np.nan))
        error = after.memory.discretisation_error() + RESOLVED * np.sqrt(state.predicted.cov[:, 0, 0])
        assert (np.abs(after.posterior.mean - state.predicted.mean)[:, 0] <= error).all()
        np.testing.assert_allclose(after.posterior.cov, state.predicted.cov, rtol=1e-4)  # the coarser rule's, at worst


def test_a_measurement_missing_in_one_trajectory_leaves_the_others(variants):
    _, y = simulate(variants["2"], 3, 3, seed=2)
    gap = y.copy()
    gap[1, 0] = np.nan
    a, b = run(pointmass(variants["2"]), y), run(pointmass(variants["2"]), gap)
    assert np.array_equal(a.mean[:, 1:], b.mean[:, 1:])
    assert a.mean[1, 0, 0] != b.mean[1, 0, 0]


@pytest.mark.parametrize("name", ["53", "1", "2", "5", "7", "10", "11", "12"])
@pytest.mark.parametrize("value", [0.0, -0.0, 1e3, -1e3, 1e-12])
def test_no_measurement_makes_nan(variants, name, value):
    model = variants[name]
    _, y = simulate(model, 2, 4, seed=1)
    y = y.copy()
    y[1] = value
    estimates = run(pointmass(model), y)
    assert np.isfinite(estimates.mean).all()
    assert np.isfinite(estimates.cov).all()
    assert (estimates.cov >= 0).all()


def test_one_trajectory_gives_the_same_numbers_as_many(variants):
    _, y = simulate(variants["5"], 4, 5, seed=1)
    together = run(pointmass(variants["5"]), y)
    alone = run(pointmass(variants["5"]), y[:, 2:3])
    assert np.array_equal(together.mean[:, 2:3], alone.mean)


# --- models it is not for


def test_a_vector_model_is_refused_with_advice(variants):
    with pytest.raises(ModelError, match=r"scalar.*dimension 2.*particle"):
        pointmass(variants["20"])
    assert not has_exact(variants["20"])
    two = Model.define(["x"], ["x + w1", "x + w2"])
    with pytest.raises(ModelError, match="state has dimension 1, the measurement 2: use particle"):
        pointmass(two)


@pytest.mark.parametrize(("state", "meter"), [("x + v**2", "x + w"), ("x + v", "x + w**3"), ("x*exp(v)", "x + w")])
def test_a_nonlinear_noise_is_refused_with_advice(state, meter):
    model = Model.define(state, meter)
    with pytest.raises(ModelError, match=r"noise enters nonlinearly.*gauss_hermite"):
        pointmass(model)
    assert not has_exact(model)


def test_a_meter_without_noise_has_no_density_but_an_exact_filter():
    model = Model.define("0.9*x + v", "x**2")
    assert has_exact(model)
    with pytest.raises(ModelError, match=r"without noise.*pointmass"):
        adaptive_pointmass(model)


def test_a_posterior_between_two_doubles_is_not_resolved():
    """Where the spacing of doubles is above the meter's noise no node is left: an error that names the cure, no IndexError."""
    model = Model.define("1e18*v", "x + w")
    exact, y = pointmass(model), simulate(model, 20, 2, 1)[1]
    first = exact.step(exact.init(20), y[0])
    with pytest.raises(Unresolved, match=r"step 1 of .*--slow-runs 0"):
        exact.step(first, y[1])


@pytest.mark.parametrize("options", [{"order": 5}, {"tolerance": 0}, {"tolerance": 1}, {"tolerance": float("nan")}])
def test_impossible_rules_are_refused(variants, options):
    with pytest.raises(ModelError, match="order >= 6 and 0 < tolerance < 1"):
        adaptive_pointmass(variants["53"], **options)


@pytest.mark.parametrize("accuracy", [0, 1, -1e-3, float("nan")])
def test_an_impossible_accuracy_is_refused(variants, accuracy):
    with pytest.raises(ModelError, match="0 < accuracy < 1"):
        filters.pointmass(variants["53"], accuracy)


def test_its_state_is_never_changed(variants):
    exact = pointmass(variants["2"])
    _, y = simulate(variants["2"], 2, 2, seed=1)
    before = exact.step(exact.init(2), y[0])
    kept = [grid.mass.copy() for grid in before.memory.fine]
    first = exact.step(before, y[1])
    assert all(np.array_equal(grid.mass, mass) for grid, mass in zip(before.memory.fine, kept, strict=True))
    assert np.array_equal(exact.step(before, y[1]).posterior.mean, first.posterior.mean)


@pytest.mark.parametrize("filter_of", [pointmass, adaptive_pointmass])
def test_the_masses_are_a_distribution(variants, filter_of):
    exact = filter_of(variants["53"])
    _, y = simulate(variants["53"], 3, 3, seed=1)
    state = exact.init(3)
    for measurement in y:
        state = exact.step(state, measurement)
        for grid in state.memory.fine:
            assert (np.diff(grid.x) >= 0).all()
            assert (grid.mass >= 0).all()
            assert abs(grid.mass.sum() - 1) <= len(grid.mass) * np.finfo(float).eps


def test_the_gaussian_aof_differs_where_the_posterior_is_not_gaussian(variants):
    # A sine meter: the estimates are apart by more than the exact filter's own error, or nothing was tested here.
    _, y = simulate(variants["5"], 5, 5, seed=8)
    mean, _, reported = follow(variants["5"], y)
    assert (np.abs(run(aof(gaussian(variants["5"])), y).mean[..., 0] - mean) > reported).mean() > 0.9


@pytest.mark.parametrize("order", [3, 8])
def test_the_tail_of_a_rule_is_the_last_two_legendre_coefficients(order):
    """A rule of q nodes finds the coefficients of any polynomial below degree q; small last ones say that q is enough."""
    coefficients = np.arange(1.0, order + 1)
    rule = Rule.of_order(order, 1e-5)
    np.testing.assert_allclose(rule.tail @ np.polynomial.legendre.legval(rule.nodes, coefficients), coefficients[-2:], rtol=1e-12)


def test_panels_are_split_where_no_state_explains_the_measurement():
    """y = x^2 + 0.001 w came out at -0.0005: no zero of y - x^2 leads to the posterior, 70 times narrower than a panel.

    Prior times likelihood by the trapezium rule, which for a smooth density that vanishes at the ends converges faster than
    any power of the step; here 0.02 wide, with steps of 1e-5.
    """
    model = Model.define("x + v", "x**2 + 0.001*w", prior={"mean": 0.3})
    found = run(pointmass(model), np.array([[[-0.0005]]]))
    x = np.linspace(-0.3, 0.3, 60_001)
    density = np.exp(-0.5 * (x - 0.3) ** 2 - 0.5 * ((-0.0005 - x**2) / 0.001) ** 2)
    mean = (density @ x) / density.sum()
    variance = density @ (x - mean) ** 2 / density.sum()
    # Unresolved parts of up to 1e-5 of the mass a panel, within some sigmas: the filter's own tolerance.
    assert found.mean.item() == pytest.approx(mean, abs=1e-4 * np.sqrt(variance))
    assert found.cov.item() == pytest.approx(variance, rel=1e-4)
