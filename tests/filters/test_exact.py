"""The exact AOF against the Kalman filter, closed forms, and sums over plain fine grids."""

from functools import partial

import numpy as np
import pytest
import scipy
import sympy as sp

from kfcourse import Gaussian, Model, ModelError, filters, load_variants, run, simulate
from kfcourse.filters import kalman_filter
from kfcourse.filters.exact import pointmasses
from kfcourse.filters.exact.pointmasses import Unresolved
from kfcourse.lab import has_exact
from kfcourse.montecarlo.experiment import predictions, states, walk
from kfcourse.scenarios.benchmarks import inverse_cube_root
from kfcourse.symbolic.equations import compile_model

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
    rows = (
        (state.posterior.mean[:, 0], np.sqrt(state.posterior.cov[:, 0, 0]), state.memory.error)
        for state in states(exact, y)[1:]
    )
    return tuple(np.array(values) for values in zip(*rows, strict=True))


def agrees(ours, mean, sd, allowed=FLOOR, times=1.0):
    """Whether means and deviations err by no more than so many times what is stated, and is
    allowed."""
    centre, deviation, stated = ours
    off = np.maximum(np.abs(centre - mean) / sd, np.abs(deviation / sd - 1))
    assert (off <= times * stated + allowed).all(), (off / stated).max()


def normal(x, mean, sigma):
    return np.exp(-0.5 * ((x - mean) / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi))


VARIANTS = {name: variant.model for name, variant in load_variants().items()}


# --- against the Kalman filter


@pytest.mark.parametrize(
    ("numbers", "prior", "shift"),
    [
        ((0.9, 0, 0.3, 1, 0, 0.5, 0), {}, 0),
        ((-1.1, 2, 0.5, 3, -1, 0.4, 0), {"mean": 40.0, "variance": 9.0}, 0),
        ((1, 0, 0.001, 1000, 0, 2, 0), {"mean": -0.3, "variance": 1e-4}, 0),
        ((0.9, 0, 0.001, 1, 0, 0.5, 0), {}, 0),  # kernels far narrower than panels
        ((-0.9, 2, 1e-6, 1, 0, 0.5, 0), {}, 0),
        ((0.9, 0, 0.3, 1, 0, 0.5, 0), {"mean": 2.0, "variance": 0.0}, 0),
        ((31, 0, 0.1, 1, 0, 0.5, 0), {}, 0),
        ((0.5, 1, 0.1, 1, 0, 0.5, 1), {}, 0),
        ((1, 0, 0.3, 1, 0, 0.01, 0), {}, 30),  # far beyond the prior
    ],
)
def test_on_a_linear_gaussian_model_it_is_the_kalman_filter(numbers, prior, shift):
    """One law for all numbers, which is compiled once; the last lets all change with time."""
    model = Model.define(
        "(a + c*k/9)*x + r*cos(c*k) + (1 + 9*c*k)*s*v",
        "(h + c*k)*x + b + c*k + q*w",
        dict(zip("arshbqc", numbers, strict=True)),
        prior=prior,
    )
    y = simulate(model, 8, 6, seed=4).y + shift
    y[2, 3] = np.nan
    exact, kalman = filters.pointmass(model, 1e-5), kalman_filter(model)
    *_, stated = followed(model, y, 1e-5)
    assert stated[-1].max() < 1e-3
    for laws in (run, predictions):
        # a prior without variance is one of 1e-7 here
        ours, right = (Gaussian(*(part[1:] for part in laws(each, y))) for each in (exact, kalman))
        sd = np.sqrt(ours.cov[..., 0, 0])
        agrees(
            (ours.mean[..., 0], sd, stated[1:]), right.mean[..., 0], np.sqrt(right.cov[..., 0, 0])
        )


# --- against other integrations of the same equation


def parts(model, x):
    """f(x), |g(x)|, S(x), |r(x)| of x' = f(x) + g(x) v, y = S(x) + r(x) w."""
    for equation in compile_model(model):
        without, noisy = (equation(x[:, None], np.full((len(x), 1), noise)) for noise in (0.0, 1.0))
        yield from (without[:, 0], np.abs(noisy - without)[:, 0])


def on_points(model, y, x, length):
    """Means and deviations, (2, steps, runs): the Stratonovich equation by sums over points, each
    of which has a length."""
    move, spread, see, noise = parts(model, x)
    kernel = normal(x[:, None], move, spread) * length[:, None] if len(y) > 1 else None
    mass, rows = (length * normal(x, model.prior.mean, np.sqrt(model.prior.cov[0])))[:, None], []
    for k, measured in enumerate(y[:, :, 0]):
        mass = (kernel @ mass if k else mass) * normal(measured, see[:, None], noise[:, None])
        mass /= mass.sum(axis=0)
        mean = x @ mass
        rows.append((mean, np.sqrt((mass * (x[:, None] - mean) ** 2).sum(axis=0))))
    return np.moveaxis(rows, 1, 0)


def evenly(least, most, step):
    x = np.arange(least, most, step)
    return x, np.full_like(x, step)


def graded(*places, least, most, count):
    """Midpoints and lengths of cells that grow in proportion to their distance from each place."""
    way = np.append(0, np.geomspace(least, most, count))
    edge = np.unique([place + side * way for place in places for side in (-1, 1)])
    return 0.5 * (edge[1:] + edge[:-1]), np.diff(edge)


# The narrowest density spans more than ten points per sigma: the sums then err by exp(-2 pi^2
# 10^2), that is not at all.
FINE = evenly(-9, 9, 0.009), FLOOR, (1e-3, ACCURACY)
# Midpoints of cells 1/50 of the meter's deviation wide, none of which holds a jump, err by some
# 1e-5; across a jump they would by 1e-2.
MIDPOINTS = evenly(-39.99, 40, 0.02), 1e-4, (1e-3,)
# away from 0 all is in proportion to x
IN_PROPORTION = graded(0, least=1e-2, most=12, count=3000), FLOOR, (ACCURACY,)
DISPLACED = {"mean": 0.5, "variance": 2.0}
ON_POINTS = {
    "11": FINE,
    "53": IN_PROPORTION,
    ("0.95*x + 0.3*v", "exp(x/2)*w"): FINE,  # stochastic volatility
    ("0.45*(x - 1 + Abs(x + 1)) + 0.4*v", "x + 0.5*w"): MIDPOINTS,
    ("x - 0.5*sign(x) + v", "x + w"): MIDPOINTS,  # dry friction
    ("0.9*x + (1 if x < 0 else 2)*v", "x + w"): MIDPOINTS,
    ("0.9*x + v", "2*sign(x) + w"): MIDPOINTS,
    # far out many turns of the sine are possible, and panels must not go there
    ("0.93*x - 0.021*x**3 + 0.21*v", "1.4*sin(x) + 0.63*w"): FINE,
}


@pytest.mark.parametrize("case", ON_POINTS)
def test_it_equals_a_dense_grid(case):
    """Panels are split where the object or the meter jumps."""
    model = VARIANTS[case] if isinstance(case, str) else Model.define(*case, prior=DISPLACED)
    y, (points, allowed, accuracies) = simulate(model, 60, 6, seed=8).y, ON_POINTS[case]
    # the grid of variant 53 ends before 0
    y = y[:, np.abs(y[..., 0]).min(axis=0) > 0.4][:, :4] if case == "53" else y[:, :8]
    expected = on_points(model, y, *points)
    for accuracy in accuracies:
        agrees(followed(model, y, accuracy), *expected, allowed=allowed)


@pytest.mark.parametrize(
    ("model", "values"),
    [
        (VARIANTS["53"].replace(f=0.02), [2.0, -1.3, 0.4, 0.01, -0.055]),
        (VARIANTS["53"].replace(f=0.2), [2.0, -1.3, 0.4, 0.01, -0.055]),
        # no state explains it: no zero of y - x^2 leads to the posterior, 70 times narrower than a
        # panel
        (Model.define("x + v", "x**2 + 0.001*w", prior={"mean": 0.3}), [-0.0005]),
        (Model.define("x + v", "w/x"), [0.7, -1.2, 0.1, 2.0]),  # two humps
    ],
)
def test_the_first_posterior_is_prior_times_likelihood(model, values):
    """By midpoints of cells a thousandth as long as their distance from 0 and from y."""
    for y in np.reshape(values, (-1, 1, 1, 1)):
        points = graded(0.0, y.item(), least=1e-9, most=40, count=20_000)
        agrees(followed(model, y), *on_points(model, y, *points))


def of_squares(c, e):
    """Variances of the second and third state of x' = c x + e x^2 v, a noise that vanishes:
    M x'^2 = c^2 M x^2 + e^2 M x^4, and M x'^4 = c^4 M x^4 + 6 c^2 e^2 M x^6 + 3 e^4 M x^8, where of
    the first state M x^2, x^4, x^6, x^8 = 1, 3, 15, 105."""
    square, fourth = c**2 + 3 * e**2, 3 * c**4 + 90 * c**2 * e**2 + 315 * e**4
    return square, c**2 * square + e**2 * fourth


@pytest.mark.parametrize(
    ("state", "mean", "variance", "second"),
    [
        ("x**2 + v", 1.0, 3.0, None),
        ("sin(x) + 0.5*v", 0.0, (1 - np.exp(-2)) / 2 + 0.25, None),
        ("exp(x/4) + 0.3*v", np.exp(1 / 32), np.exp(1 / 8) - np.exp(1 / 16) + 0.09, None),
        ("9*x + 0.2*v", 0.0, 81.04, 6564.28),
        ("x + x*v", 0.0, 2.0, 4.0),
        ("sin(3*x) + 0.1*v", 0.0, (1 - np.exp(-18)) / 2 + 1e-2, None),
        ("x**2 - 1 + 0.01*v", 0.0, 2 + 1e-4, None),
        ("1.05*x + 0.01*x**2*v", 0.0, *of_squares(1.05, 0.01)),
        ("x + 0.001*x**2*v", 0.0, *of_squares(1.0, 0.001)),
    ],
)
def test_a_prediction_has_the_moments_of_the_closed_form(state, mean, variance, second):
    """The density of the next state, not only the moments: the second state without a measurement
    is drawn from it, and the variance of the third where it is known."""
    exact, nothing = pointmass(Model.define(state, "x + w")), np.full((1, 1), np.nan)
    first = exact.step(exact.init(1), nothing)
    then = exact.step(first, nothing)
    allowed = then.memory.error[0] + FLOOR
    assert abs(then.posterior.mean[0, 0] - mean) <= allowed * np.sqrt(variance)
    assert abs(then.posterior.cov[0, 0, 0] / variance - 1) <= 2 * allowed
    if second:
        third = exact.step(then, nothing)
        allowed = third.memory.error[0] + FLOOR
        assert abs(third.posterior.cov[0, 0, 0] / second - 1) <= 2 * allowed


def test_a_state_that_comes_from_beside_a_pole_is_followed_far_out():
    """x' = x^(-1/3) + v with the odd root: few of x come to 20, from 1/8000.  Particles have none
    there.

    The oracle takes cells 1/500 of their distance from the pole: so many that their midpoints, at
    20, are 1/75 apart.
    """
    first, then = 0.5, np.array([20.0, -30.0, 1.0, 7.0])
    x, length = graded(0, least=1e-6, most=12.0, count=8000)
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
    y = np.stack([np.full(4, first), then])[:, :, None]
    ours = [part[1] for part in followed(inverse_cube_root(), y, 1e-3)]
    agrees(ours, *np.array(expected).T, allowed=1e-3)


# --- rough densities: a finer filter


@pytest.mark.parametrize(
    ("state", "meter"),
    [
        # where the noise vanishes, the prediction has a logarithmic spike
        ("0.9*x + 0.5*sin(x)*v", "x + 0.3*w"),
        ("0.9*x + 0.3*x*v", "x + 0.3*(1 + x**2)*w"),
        ("0.95*x + 0.3*v", "0.1*x + sin(x)*w"),
    ],
)
def test_where_densities_are_rough_the_stated_error_holds(state, meter):
    model = Model.define(state, meter)
    _, y = simulate(model, 60, 4, seed=1)
    ours, (mean, sd, _) = followed(model, y, 1e-3), followed(model, y)
    agrees(ours, mean, sd, allowed=1e-4)
    assert ours[2].max() < 0.02


@pytest.mark.parametrize("f", [0.02, 0.2])  # the lab's meter, and one ten times worse
def test_what_it_states_is_far_finer_than_what_trajectories_could_see(f):
    model = VARIANTS["53"].replace(f=f)
    _, _, stated = followed(model, simulate(model, 250, 12, 3).y)
    assert np.median(stated) < 1e-4 and stated.max() < 1 / np.sqrt(250)
    assert (np.diff(stated, axis=0, prepend=0.0) >= 0).all()  # as if it never forgot an error


# --- measurements that are odd or impossible, threads


@pytest.mark.parametrize("name", ["53", "1", "2", "7", "10", "12"])
@pytest.mark.parametrize("value", [-0.0, 1e3, 1e-12])
def test_an_odd_measurement_is_followed_or_refused(name, value):
    """What is stated holds against a filter of a thousandth of the error, or there is a
    sentence."""
    y = simulate(VARIANTS[name], 2, 4, seed=1).y
    y[1] = value
    try:
        coarse = followed(VARIANTS[name], y, 1e-3)
        mean, sd, _ = followed(VARIANTS[name], y)
    except Unresolved as error:
        assert "step 1" in str(error) or "step 2" in str(error)
        return
    agrees(coarse, mean, sd)


@pytest.mark.parametrize(
    ("state", "meter"), [("x + (x - x**3)/10", "x"), ("x + 3*sin(2*x)/10", "x + x**3/10")]
)
def test_records_that_contradict_the_model_have_the_right_answer_or_none(state, meter):
    """Jumps, lasting faults, ramps and alternations of .3 to 6, and a jump of 1000: a grid of
    logarithms, which cannot underflow, says what is right.  At most two answers of a hundred err by
    more than three times what is stated."""
    model = Model.define(f"{state} + 0.15*v", f"{meter} + 0.4*w")
    b, h = (sp.lambdify("x", formula, "numpy") for formula in (state, meter))
    x, k, rng = np.linspace(-9, 9, 361), np.arange(8), np.random.default_rng(5)
    y = simulate(model, 60, 8, seed=5).y[:, :, 0]
    shapes = np.array([k == 3, k // 3 == 1, (k > 1) * (k - 1) / 3, (k > 1) * (-1.0) ** k])
    y += np.resize(shapes, (60, 8)).T * np.append(1000, rng.uniform(0.3, 6, 59))
    moves, logs = -0.5 * ((x[:, None] - b(x)) / 0.15) ** 2, -0.5 * x[None] ** 2 / model.prior.cov
    right, worse = [], []
    for values in y:
        logs = logs - 0.5 * ((values[:, None] - h(x)) / 0.4) ** 2
        p = np.exp(logs - scipy.special.logsumexp(logs, axis=1, keepdims=True))
        mean = p @ x
        right.append([mean, np.sqrt((p * (x - mean[:, None]) ** 2).sum(axis=1))])
        logs = scipy.special.logsumexp(moves + logs[:, None, :], axis=-1)
    exact = filters.pointmass(model, 1e-3)
    for i, answers in enumerate(np.moveaxis(right, -1, 0)):
        try:
            for state, (mean, sd) in zip(walk(exact, y[:, i]), [answers[0], *answers], strict=True):
                if state.step:
                    (z,), ((variance,),) = (part[0] for part in state.posterior)
                    off = max(abs(z - mean), abs(np.sqrt(variance) - sd)) / sd
                    worse.append(off > 3 * state.memory.error[0] + FLOOR)
        except Unresolved as error:
            assert "contradicts the model" in str(error) or "no state explains" in str(error)
    assert np.mean(worse) < 0.02 and 300 < len(worse) < 470


def test_threads_change_no_number(monkeypatch):
    _, y = simulate(VARIANTS["5"], 150, 5, seed=1)
    together = run(pointmass(VARIANTS["5"]), y)
    for threads in (1, 3):
        monkeypatch.setattr("numba.config.NUMBA_NUM_THREADS", threads)
        again = run(pointmass(VARIANTS["5"]), y)
        assert np.array_equal(again.mean, together.mean) and np.array_equal(again.cov, together.cov)


# --- models it is not for


@pytest.mark.parametrize(
    ("state", "meter", "problem"),
    [
        (["x1 + v1", "x2 + v2"], "x1 + w", "scalar.*dimension 2.*particle"),
        (["x"], ["x + w1", "x + w2"], "state has dimension 1, the measurement 2: use particle"),
        ("x + v**2", "x + w", "noise enters nonlinearly.*gauss_hermite"),
        *(
            ("x + v", meter, "noise enters nonlinearly.*gauss_hermite")
            for meter in ("x + w**2", "exp(w*x) + w")
        ),
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


def test_what_its_memory_shows_is_a_density():
    exact = pointmass(VARIANTS["53"])
    state = states(exact, simulate(VARIANTS["53"], 3, 3, seed=1).y)[-1]
    for i in range(3):
        x, p = state.memory.density(i)
        assert (np.diff(x) >= 0).all() and (p >= 0).all()
        # by trapezia between eight Lobatto points of a panel
        assert np.trapezoid(p, x) == pytest.approx(1, abs=0.02)
        assert np.trapezoid(p * x, x) == pytest.approx(state.posterior.mean[i, 0], rel=0.02)


def test_a_law_is_printed_once_for_all_numbers():
    model = VARIANTS["53"]
    assert pointmasses.printed(model) == pointmasses.printed(model.replace(f=0.3))


def test_states_are_drawn_from_the_posterior():
    """Two million: the variance of one trajectory's in units of the filter's is known to 1e-3."""
    model = Model.define("0.9*x + 0.5*v", "x + 0.5*w")
    state = states(filters.pointmass(model), simulate(model, 40, 3, seed=3).y)[-1]
    x, mode = state.memory.drawn(50_000, np.random.default_rng(1))
    z = (x - state.posterior.mean) / np.sqrt(state.posterior.cov[..., 0])
    assert x.shape == (50_000, 40, 1) and not mode.any()
    assert abs(z.mean()) < 3e-3 and abs((z**2).mean() - 1) < 3e-3
