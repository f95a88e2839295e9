"""The exact AOF against the Kalman filter, against closed forms, and against plain fine grids
written here."""

from functools import partial

import mpmath
import numpy as np
import pytest
from scipy import stats

from kfcourse import Model, ModelError, filters, load_variants, run, simulate
from kfcourse.filters import kalman_filter, particle
from kfcourse.filters.exact import panels, pointmasses
from kfcourse.filters.exact.pointmasses import Unresolved
from kfcourse.lab.short_names import has_exact
from kfcourse.scenarios.benchmarks import inverse_cube_root

# What these tests compare with is known to far more digits than a comparison needs.
ACCURACY = 1e-6
pointmass = partial(filters.pointmass, accuracy=ACCURACY)

# What the accuracy does not rule, in deviations: kernels widened to 1 % of a panel, which is up to
# seven deviations long, err by the fourth power of that, 2e-5, and its fourth derivative, an
# eighth.
FLOOR = 1e-5


def followed(model, y, accuracy=ACCURACY):
    """Means, deviations and stated errors in deviations, (steps, runs), along y (steps, runs,
    1)."""
    exact = filters.pointmass(model, accuracy)
    state, found = exact.init(y.shape[1]), []
    for measurement in y:
        state = exact.step(state, measurement)
        found.append(
            (state.posterior.mean[:, 0], np.sqrt(state.posterior.cov[:, 0, 0]), state.memory.error)
        )
    return tuple(np.array(values) for values in zip(*found, strict=True))


def agrees(found, mean, sd, allowed=FLOOR, times=1.0):
    """Whether means and deviations err by no more than so many times what is stated, and is
    allowed."""
    ours, deviation, stated = found
    off = np.maximum(np.abs(ours - mean) / sd, np.abs(deviation / sd - 1))
    assert (off <= times * stated + allowed).all(), (off / stated).max()


def normal(x, mean, sigma):
    return np.exp(-0.5 * ((x - mean) / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi))


@pytest.fixture(scope="module")
def variants():
    return {name: variant.model for name, variant in load_variants().items()}


# --- against the Kalman filter


@pytest.mark.parametrize(
    ("state", "meter", "prior"),
    [
        ("0.9*x + 0.3*v", "x + 0.5*w", {}),
        ("-1.1*x + 2 + 0.5*v", "3*x - 1 + 0.4*w", {"mean": 40.0, "variance": 9.0}),
        ("x + 0.001*v", "1000*x + 2*w", {"mean": -0.3, "variance": 1e-4}),
        ("0.9*x + 0.001*v", "x + 0.5*w", {}),  # kernels far narrower than panels
        ("-0.9*x + 1e-6*v + 2", "x + 0.5*w", {}),
        ("0.9*x + 0.3*v", "x + 0.5*w", {"mean": 2.0, "variance": 0.0}),
        ("31*x + 0.1*v", "x + 0.5*w", {}),
        ("(0.5 + k/9)*x + (1 + k)*v/9 + cos(k)", "(1 + k)*x + k + 0.5*w", {}),
    ],
)
def test_on_a_linear_gaussian_model_it_is_the_kalman_filter(state, meter, prior):
    model = Model.define(state, meter, prior=prior)
    _, y = simulate(model, 8, 6, seed=4)
    y[2, 3] = np.nan
    exact, kalman = filters.pointmass(model, 1e-5), kalman_filter(model)
    a, b, total = exact.init(8), kalman.init(8), 0.0
    for k, measured in enumerate(y):
        a, b = exact.step(a, measured), kalman.step(b, measured)
        sd, sd_ahead = (np.sqrt(law.cov[..., 0, 0]) for law in (b.posterior, b.predicted))
        if sd.min() > 0:  # else a prior without variance, which is one of 1e-7 here
            allowed = a.memory.error + FLOOR
            assert (np.abs(a.posterior.mean - b.posterior.mean)[:, 0] <= allowed * sd).all(), k
            assert (np.abs(np.sqrt(a.posterior.cov[:, 0, 0]) / sd - 1) <= allowed).all(), k
        assert (
            np.abs(a.predicted.mean - b.predicted.mean)[:, 0] <= (a.memory.error + FLOOR) * sd_ahead
        ).all(), k
        assert (
            np.abs(np.sqrt(a.predicted.cov[:, 0, 0]) / sd_ahead - 1) <= a.memory.error + FLOOR
        ).all(), k
        total = a.memory.error.max()
    assert total < 1e-3


# --- against other integrations of the same equation


def on_points(model, y, x, move, spread, see, noise):
    """Means and deviations, (2, steps, runs), of x' = move(x) + spread(x) v, y = see(x) + noise(x) w:
    the Stratonovich equation by sums over points at equal distances."""
    kernel = normal(x[:, None], move(x), spread(x))
    density, found = normal(x, model.prior.mean, np.sqrt(model.prior.cov[0]))[:, None], []
    for measured in y[:, :, 0]:
        density = density * normal(measured, see(x)[:, None], noise(x)[:, None])
        density /= density.sum(axis=0)
        mean = x @ density
        found.append((mean, np.sqrt(x**2 @ density - mean**2)))
        density = kernel @ density
    return np.moveaxis(found, 1, 0)


def always(value):
    return lambda x: np.full_like(x, value)


def same(x):
    return x


SMOOTH = {  # of variants: object, its noise; meter, its noise
    "5": (lambda x: 0.95 * x, always(0.2), np.sin, always(0.3)),
    "7": (lambda x: 0.9 * x, always(0.3), same, lambda x: 0.3 * (1 + x**2)),
    "11": (lambda x: x + 0.1 * (x - x**3), always(0.15), same, always(0.5)),
}


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("accuracy", [1e-3, ACCURACY])
def test_it_equals_a_dense_uniform_grid(variants, name, accuracy):
    """The narrowest density here spans more than ten nodes per sigma: the sums then err by exp(-2
    pi^2 10^2), that is not at all."""
    y = simulate(variants[name], 5, 10, seed=8).y
    expected = on_points(variants[name], y, np.linspace(-9, 9, 2001), *SMOOTH[name])
    agrees(followed(variants[name], y, accuracy), *expected)


JUMPING = {
    # dry friction
    "x - 0.5*sign(x) + v": (lambda x: x - 0.5 * np.sign(x), always(1), same, always(1)),
    "0.8*x + 3*sign(x) + v": (lambda x: 0.8 * x + 3 * np.sign(x), always(1), same, always(1)),
    "Heaviside(x) + v": (lambda x: np.heaviside(x, 0.5), always(1), same, always(1)),
    "0.9*x + (1 if x < 0 else 2)*v": (
        lambda x: 0.9 * x,
        lambda x: np.where(x < 0, 1.0, 2.0),
        same,
        always(1),
    ),
    "0.9*x + v": (lambda x: 0.9 * x, always(1), lambda x: 2 * np.sign(x), always(1)),
}


@pytest.mark.parametrize("state", JUMPING)
def test_panels_are_split_where_the_object_or_the_meter_jumps(state):
    """Midpoints of cells 1/50 of the meter's deviation wide, none of which holds the jump at 0, err
    by some 1e-5; across a jump they would by 1e-2."""
    meter = "2*sign(x) + w" if state == "0.9*x + v" else "x + w"
    model = Model.define(state, meter, prior={"mean": 0.5, "variance": 2.0})
    y = simulate(model, 12, 5, seed=1).y
    expected = on_points(model, y, np.arange(-40, 40, 0.02) + 0.01, *JUMPING[state])
    agrees(followed(model, y, 1e-3), *expected, allowed=1e-4)


@pytest.mark.parametrize("f", [0.02, 0.2])
@pytest.mark.parametrize("y", [2.0, -1.3, 0.4, 0.01, -0.055])
def test_on_variant_53_the_first_posterior_is_prior_times_likelihood(variants, f, y):
    width = f * y * y

    def density(x):
        x = mpmath.mpf(x)
        return (
            mpmath.exp(-x * x / 2 - ((y - x) / (f * x * x)) ** 2 / 2) / (x * x)
            if x
            else mpmath.mpf(0)
        )

    steps = [width * 2.0**j for j in range(-2, 40) if width * 2.0**j < 40]
    points = sorted({-40.0, 0.0, y, 40.0, *(y + s for s in steps), *(y - s for s in steps)})
    with mpmath.workdps(30):
        total = mpmath.quad(density, points)
        expected = mpmath.quad(lambda x: x * density(x), points) / total
        variance = mpmath.quad(lambda x: (x - expected) ** 2 * density(x), points) / total
    agrees(
        followed(variants["53"].replace(f=f), np.array([[[y]]])),
        float(expected),
        float(variance) ** 0.5,
    )


def test_on_variant_53_it_equals_a_grid_that_moves_with_the_measurement(variants):
    # Away from 0 the posterior lies within a few f y^2 of y: 2001 nodes over 15 of them, rectangles
    # as above.
    c, e, f = 0.9, 0.05, 0.02
    rng = np.random.default_rng(2)
    x, y, expected = 1.5, [], []
    for _ in range(6):
        y.append(x + f * x * x * rng.normal())
        x = x * (c + e * rng.normal())
    before, masses = None, None
    for value in y:
        x = value + np.linspace(-15, 15, 2001) * f * value * value
        predicted = (
            normal(x, 0, 1)
            if before is None
            else normal(x[:, None], c * before, e * np.abs(before)) @ masses
        )
        masses = predicted * normal(value, x, f * x * x)
        masses /= masses.sum()
        before, centre = x, masses @ x
        expected.append((centre, np.sqrt(masses @ (x - centre) ** 2)))
    agrees(followed(variants["53"], np.array(y)[:, None, None]), *np.array(expected).T[:, :, None])


def test_panels_are_split_where_no_state_explains_the_measurement():
    """y = x^2 + 0.001 w came out at -0.0005: no zero of y - x^2 leads to the posterior, 70 times
    narrower than a panel.

    Prior times likelihood by the trapezium rule, which for a smooth density that vanishes at the
    ends converges faster than any power of the step; here 0.02 wide, with steps of 1e-5.
    """
    model = Model.define("x + v", "x**2 + 0.001*w", prior={"mean": 0.3})
    x = np.linspace(-0.3, 0.3, 60_001)
    density = np.exp(-0.5 * (x - 0.3) ** 2 - 0.5 * ((-0.0005 - x**2) / 0.001) ** 2)
    mean = (density @ x) / density.sum()
    sd = np.sqrt(density @ (x - mean) ** 2 / density.sum())
    agrees(followed(model, np.array([[[-0.0005]]])), mean, sd)


@pytest.mark.parametrize(
    ("state", "mean", "variance"),
    [
        ("x**2 + v", 1.0, 3.0),
        ("sin(x) + 0.5*v", 0.0, (1 - np.exp(-2)) / 2 + 0.25),
        ("exp(x/4) + 0.3*v", np.exp(1 / 32), np.exp(1 / 8) - np.exp(1 / 16) + 0.09),
        ("9*x + 0.2*v", 0.0, 81.04),
        ("x + x*v", 0.0, 2.0),
        ("sin(3*x) + 0.1*v", 0.0, (1 - np.exp(-18)) / 2 + 1e-2),
        ("x**2 - 1 + 0.01*v", 0.0, 2 + 1e-4),
    ],
)
def test_a_prediction_has_the_moments_of_the_closed_form(state, mean, variance):
    """The density of the next state, not only the moments: the second state without a measurement
    is drawn from it."""
    exact, nothing = pointmass(Model.define(state, "x + w")), np.full((1, 1), np.nan)
    first = exact.step(exact.init(1), nothing)
    second = exact.step(first, nothing)
    for law in (first.predicted, second.posterior):
        assert abs(law.mean[0, 0] - mean) <= (second.memory.error[0] + FLOOR) * np.sqrt(variance)
        assert abs(law.cov[0, 0, 0] / variance - 1) <= 2 * (second.memory.error[0] + FLOOR)


@pytest.mark.parametrize(("c", "e"), [(1.05, 0.01), (1.0, 0.001)])
def test_a_noise_that_vanishes_at_a_state_has_the_moments_of_the_closed_form(c, e):
    """x' = c x + e x^2 v.  Without measurements M x' = 0, M x'^2 = c^2 M x^2 + e^2 M x^4, and of
    x_1 ~ c x + e x^2 v

    M x_1^4 = c^4 M x^4 + 6 c^2 e^2 M x^6 + 3 e^4 M x^8, where M x^2, x^4, x^6, x^8 = 1, 3, 15, 105.
    """
    exact, nothing = (
        pointmass(Model.define("c*x + e*x**2*v", "x + w", {"c": c, "e": e})),
        np.full((1, 1), np.nan),
    )
    first = exact.step(exact.init(1), nothing)
    second = exact.step(first, nothing)
    square = c**2 + 3 * e**2
    fourth = 3 * c**4 + 90 * c**2 * e**2 + 315 * e**4
    np.testing.assert_allclose(first.predicted.cov[0, 0, 0], square, rtol=1e-6)
    np.testing.assert_allclose(second.posterior.cov[0, 0, 0], square, rtol=1e-5)
    # x^2 = 50 where the density has 1e-11 of its mass, which may be cut off
    np.testing.assert_allclose(
        second.predicted.cov[0, 0, 0], c**2 * square + e**2 * fourth, rtol=1e-5
    )


def test_a_kernel_that_is_narrow_here_and_folds_there():
    """x' = 0.9 x + 0.05 x^2 v: narrow near 0, and far out the noise turns f(., v) back.  Against a
    sum over a million states."""
    model = Model.define("0.9*x + 0.05*x**2*v", "x + 0.5*w")
    # The second posterior's moments: x' = f(x, u), over x of the first posterior, N(0.32, 0.2), and
    # u; trapezoidal in both.
    x = 0.32 + np.sqrt(0.2) * np.linspace(-9, 9, 2001)[:, None]
    u = np.linspace(-8, 8, 801)
    weight = np.exp(-0.5 * ((x - 0.32) ** 2 / 0.2 + u**2))
    after = 0.9 * x + 0.05 * x**2 * u
    weight *= np.exp(-0.5 * ((1.3 - after) / 0.5) ** 2)
    mean = (weight * after).sum() / weight.sum()
    sd = np.sqrt((weight * (after - mean) ** 2).sum() / weight.sum())
    found = [part[1:] for part in followed(model, np.array([[[0.4]], [[1.3]]]))]
    agrees(found, mean, sd)


def test_a_state_that_comes_from_beside_a_pole_is_followed_far_out():
    """x' = x^(-1/3) + v with the odd root: few of x come to 20, from 1/8000.  Particles have none
    there.

    The oracle takes cells 1/500 of their distance from the pole: so many that their midpoints, at
    20, are 1/75 apart.
    """
    first, then = 0.5, np.array([20.0, -30.0, 1.0, 7.0])
    edge = np.geomspace(1e-6, 12.0, 8000)
    x, length = 0.5 * (edge[1:] + edge[:-1]), np.diff(edge)
    x, length = np.concatenate([-x, x]), np.concatenate([length, length])
    mass = length * np.exp(-0.5 * (x - 3.01) ** 2 - 0.5 * (x - first) ** 2)
    expected = []
    for measured in then:
        there = measured + np.linspace(-8, 8, 161)
        p = (
            np.exp(-0.5 * (there[:, None] - 1 / np.cbrt(x)) ** 2)
            @ mass
            * np.exp(-0.5 * (measured - there) ** 2)
        )
        p /= p.sum()
        expected.append((p @ there, np.sqrt(p @ (there - p @ there) ** 2)))
    found = followed(inverse_cube_root(), np.stack([np.full(4, first), then])[:, :, None], 1e-3)
    agrees([part[1] for part in found], *np.array(expected).T, allowed=1e-3)


# --- rough densities: a finer filter, and many particles


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
def test_where_densities_are_rough_the_stated_error_holds(state, meter):
    model = Model.define(state, meter)
    _, y = simulate(model, 60, 4, seed=1)
    ours, (mean, sd, _) = followed(model, y, 1e-3), followed(model, y)
    agrees(ours, mean, sd, allowed=1e-4)
    assert ours[2].max() < 0.02


def test_stochastic_volatility_is_what_many_particles_find():
    """Twenty clouds of 10,000 particles that do not look at the measurement: within 4 of their
    standard errors."""
    model = Model.define("0.95*x + 0.3*v", "exp(x/2)*w")
    _, y = simulate(model, 2, 6, seed=4)
    expected = run(pointmass(model), y)
    found = [run(particle(model, 10_000, seed, guided=False), y) for seed in range(20)]
    for kind in ("mean", "cov"):
        values = np.stack([getattr(law, kind).reshape(6, 2) for law in found])
        error = values.std(axis=0, ddof=1) / np.sqrt(20)
        assert (
            abs(values.mean(axis=0) - getattr(expected, kind).reshape(6, 2)) < 4 * error
        ).all(), kind


def test_a_precision_with_a_chi_square_prior_has_a_gamma_posterior():
    """y = w / x: p(x | y) = C |x| exp(-x^2 (1 + y^2) / 2), so that x^2 ~ Gamma(1, scale 2 / (1 +
    y^2)), and two humps."""
    y = np.array([0.7, -1.2, 0.1, 2.0, 0.3])
    expected = [np.sqrt(stats.gamma(1, scale=2 / (1 + value**2)).mean()) for value in y]
    agrees(
        [part[0] for part in followed(Model.define("x + v", "w/x"), y[None, :, None], 1e-4)],
        0.0,
        np.array(expected),
    )


@pytest.mark.parametrize("f", [0.02, 0.2])  # the lab's meter, and one ten times worse
def test_what_it_states_is_far_finer_than_what_trajectories_could_see(variants, f):
    model = variants["53"].replace(f=f)
    _, _, stated = followed(model, simulate(model, 250, 12, 3).y)
    assert np.median(stated) < 1e-4 and stated.max() < 1 / np.sqrt(250)
    assert (np.diff(stated, axis=0, prepend=0.0) >= 0).all()  # as if it never forgot an error


# --- measurements that are odd or impossible, threads


@pytest.mark.parametrize("name", ["53", "1", "2", "5", "7", "10", "11", "12"])
@pytest.mark.parametrize("value", [0.0, -0.0, 1e3, -1e3, 1e-12])
def test_an_odd_measurement_is_followed_or_refused(variants, name, value):
    """What is stated holds against a filter of a thousandth of the error, or there is a
    sentence."""
    _, y = simulate(variants[name], 2, 4, seed=1)
    y = y.copy()
    y[1] = value
    try:
        found = followed(variants[name], y, 1e-3)
        mean, sd, _ = followed(variants[name], y)
    except Unresolved as error:
        assert "step 1" in str(error) or "step 2" in str(error)
        return
    agrees(found, mean, sd)


@pytest.mark.parametrize("y", [-1000.0, -100.0, -20.0, -6.0, -3.0, -1.0])
def test_a_record_that_contradicts_the_model_has_the_right_answer_or_none(variants, y):
    """Variant 11, x' = x + .1 (x - x^3) + .15 v, y = x + .5 w, after a first y of .9: a grid of
    logarithms cannot underflow."""
    x = np.linspace(-12, 6, 3601)
    first = -0.5 * x**2 / 0.3 - 0.5 * ((0.9 - x) / 0.5) ** 2
    moved = first - 0.5 * ((x[:, None] - (x + 0.1 * (x - x**3))) / 0.15) ** 2
    top = moved.max(axis=1)
    logs = top + np.log(np.exp(moved - top[:, None]).sum(axis=1)) - 0.5 * ((y - x) / 0.5) ** 2
    p = np.exp(logs - logs.max())
    p /= p.sum()
    sd = np.sqrt(p @ (x - p @ x) ** 2)
    try:
        found = [part[1] for part in followed(variants["11"], np.array([[[0.9]], [[y]]]), 1e-3)]
    except Unresolved as error:
        assert y <= -6 and (
            "contradicts the model" in str(error) or "no state explains" in str(error)
        )
    else:
        agrees(found, p @ x, sd, allowed=1e-5)
        assert y >= -6


def test_it_knows_where_a_linear_record_leaves_its_prediction():
    """Measurements 4 to 11 deviations from where the state was predicted; the Kalman filter has the
    truth."""
    model, refused = Model.define("x + 0.1*v", "x + 0.5*w"), []
    for level in np.arange(2.0, 12.0, 0.5):
        y = np.array([0.0, 0.0, *4 * [level]])[:, None, None]
        expected = run(kalman_filter(model), y)
        try:
            agrees(
                followed(model, y, 1e-3),
                expected.mean[..., 0],
                np.sqrt(expected.cov[..., 0, 0]),
                times=3,
            )
        except Unresolved:
            refused.append(level)
    # beyond a level all, and none before
    assert refused and refused == list(np.arange(refused[0], 12.0, 0.5))
    assert 3 <= refused[0] < 8


def test_a_measurement_far_beyond_the_prior_is_followed():
    model, y = Model.define("0.9*x + 0.3*v", "x + 0.01*w"), np.array([[[30.0]], [[26.0]]])
    expected = run(kalman_filter(model), y)
    agrees(followed(model, y), expected.mean[..., 0], np.sqrt(expected.cov[..., 0, 0]))


def test_one_trajectory_gives_the_same_numbers_as_many_and_as_in_threads(variants, monkeypatch):
    _, y = simulate(variants["5"], 150, 5, seed=1)
    together = run(pointmass(variants["5"]), y)
    alone = run(pointmass(variants["5"]), y[:, 140:141])
    assert np.array_equal(together.mean[:, 140:141], alone.mean)
    for threads in (1, 3):
        monkeypatch.setattr("numba.config.NUMBA_NUM_THREADS", threads)
        again = run(pointmass(variants["5"]), y)
        assert np.array_equal(again.mean, together.mean) and np.array_equal(again.cov, together.cov)


# --- models it is not for


@pytest.mark.parametrize(
    ("state", "meter", "problem"),
    [
        (["x1 + v1", "x2 + v2"], "x1 + w", "scalar.*dimension 2.*particle"),
        (["x"], ["x + w1", "x + w2"], "state has dimension 1, the measurement 2: use particle"),
        ("x + v**2", "x + w", "noise enters nonlinearly.*gauss_hermite"),
        ("x + v", "x + w**3", "noise enters nonlinearly.*gauss_hermite"),
        ("x*exp(v)", "x + w", "noise enters nonlinearly.*gauss_hermite"),
        ("0.9*x + v", "x**2", "no noise enters the meter"),
        ("0.9*x", "x + w", "no noise enters the object"),
        ("0.9*x + e*v", "x + w", "no noise enters the object"),
    ],
)
def test_what_it_cannot_filter_is_refused_with_advice(state, meter, problem):
    model = Model.define(state, meter, {"e": 0.0} if "e*v" in state else {})
    with pytest.raises(ModelError, match=problem):
        pointmass(model)
    assert not has_exact(model)


@pytest.mark.parametrize(
    ("state", "meter"),
    [
        ("1e18*v", "x + w"),
        ("0.9*x + 0.3*v", "sin(1000*x) + 0.01*w"),
        ("x**3 + 1e-6*v", "x + w"),
        ("1e5*x + 0.1*v", "x + w"),
    ],
)
def test_what_cannot_be_resolved_is_refused_in_words(state, meter):
    model = Model.define(state, meter)
    with np.errstate(over="ignore"):  # a cube six times over
        _, y = simulate(model, 4, 6, seed=1)
    with pytest.raises(Unresolved, match=r"step \d of Model.*run \d: .*leave the exact filter out"):
        run(pointmass(model), y)


def test_what_its_memory_shows_is_a_density(variants):
    exact = pointmass(variants["53"])
    _, y = simulate(variants["53"], 3, 3, seed=1)
    state = exact.init(3)
    for measurement in y:
        state = exact.step(state, measurement)
    for i in range(3):
        x, p = state.memory.density(i)
        assert (np.diff(x) >= 0).all() and (p >= 0).all()
        # by trapezia between eight Lobatto points of a panel
        assert np.trapezoid(p, x) == pytest.approx(1, abs=0.02)
        assert np.trapezoid(p * x, x) == pytest.approx(state.posterior.mean[i, 0], rel=0.02)


# --- its parts


def test_the_last_coefficients_of_legendre_tell_how_a_panel_is_resolved():
    coefficients = np.arange(1.0, panels.Q + 1)
    values = np.polynomial.legendre.legval(panels.POINT, coefficients)
    np.testing.assert_allclose(
        [panels.LAST_BUT_ONE @ values, panels.LAST @ values], coefficients[-2:], rtol=1e-12
    )
    np.testing.assert_allclose(
        np.polynomial.polynomial.polyval(panels.POINT, panels.POWER @ values), values, rtol=1e-12
    )
    np.testing.assert_allclose(panels.SLOPE @ panels.POINT**3, 3 * panels.POINT**2, atol=1e-12)


def test_a_law_is_printed_once_for_all_numbers(variants):
    model = variants["53"]
    assert pointmasses.printed(model) == pointmasses.printed(model.replace(f=0.3))
