"""Angles: filters near the place where pi becomes -pi give what they give elsewhere."""

import re
import warnings
from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import norm

from kfcourse import (
    AngleWarning,
    Ensemble,
    Gaussian,
    Model,
    ModelError,
    compare,
    design,
    gauss_hermite,
    gaussian,
    linearised,
    predictions,
    run,
    simulate,
    unscented,
)
from kfcourse.angles import difference, moments_on_circle, wrapped
from kfcourse.filters import (
    aof,
    duof,
    fbp,
    fos,
    gated,
    imm,
    iterated,
    kalman_filter,
    mfos,
    particle,
    pointmass,
)
from kfcourse.filters.densities import likelihood
from kfcourse.filters.optimal_structure import Memory, Remembered
from kfcourse.linear.consistency import innovations, nees
from kfcourse.scenarios.navigation import Dynamics, Observation, Sensor, fuse

PI = np.pi
FINE = partial(pointmass, accuracy=1e-3)


# ---------------------------------------------------------------- what is said of a model


STATE, METER, NAMES = ["psi + om", "om + v"], ["psi + w1", "om + w2"], {"x": ["psi", "om"]}


@pytest.mark.parametrize(
    ("given", "angles"),
    [
        (["y1", "psi"], ((0,), (0,))),
        (["om", "y2"], ((1,), (1,))),
        ([], ((), ())),
        (None, ((), ())),
        (("y2", "y1"), ((), (0, 1))),
    ],
)
def test_components_are_named_in_a_list(given, angles):
    model = Model.define(STATE, METER, symbols=NAMES, angles=given)
    assert model.angles == angles == model.replace().angles
    latex = [r"{\psi}_{k} &\in [-\pi, \pi]", r"y_{1,k} &\in [-\pi, \pi]"]
    assert [text in model.latex() for text in latex] == [0 in part for part in angles]


@pytest.mark.parametrize(
    ("given", "names", "message"),
    [
        (["y2"], ["x", "y2"], r"of one only, such as those of x, y2, y1, y2; got \['y2'\]"),
        (["y3"], ["psi", "om"], r"such as those of psi, om, y1, y2; got \['y3'\]"),
        ({"x": ["psi"]}, ["psi", "om"], "a list of names of components"),
        (3, ["psi", "om"], "a list of names of components.*got 3"),
    ],
)
def test_other_names_of_angles_are_refused(given, names, message):
    first, second = names
    state, meter = [first, f"{second} + v"], [f"{first} + w1", f"{second} + w2"]
    with pytest.raises(ModelError, match=message):
        Model.define(state, meter, symbols={"x": names}, angles=given)


UNDECLARED = r'angles=\["y2"\], or angles=\[\]'
CONTAINED = r'y2 contains the angle psi.*angles=\["psi", "y2"\]'


@pytest.mark.parametrize(
    ("meter", "angles", "warning"),
    [
        ("atan2(x2, psi) + w", None, UNDECLARED),
        ("w*(1 + 2*atan2(x2, psi - 3))", None, UNDECLARED),
        ("cos(atan2(x2, psi) + w)", None, None),
        # an elevation: the ground distance is not negative
        ("atan2(x2, sqrt(psi**2 + x2**2)) + w", None, None),
        ("atan(x2/psi) + w", None, None),
        ("atan2(x2, psi) + w", ["y2"], None),
        ("atan2(x2, psi) + w", [], None),
        ("psi + w", ["psi"], CONTAINED),
        ("2*psi*x2 + sin(psi) + w", ["psi"], CONTAINED),
        ("sin(psi) + x2*cos(2*psi + x2) + w", ["psi"], None),
        ("psi + w", ["psi", "y2"], None),
        ("psi + w", ["x2", "y1"], None),  # psi is no angle here
    ],
)
def test_a_meter_of_an_angle_that_is_not_declared_warns_and_names_the_cure(meter, angles, warning):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        names = {"x": ["psi", "x2"]}
        Model.define(["psi + v1", "x2 + v2"], ["x2 + w", meter], symbols=names, angles=angles)
    assert [type(each.message) for each in caught] == [AngleWarning] * (warning is not None)
    if warning:
        assert re.search(warning, str(caught[0].message))
        assert caught[0].filename == __file__  # where the model was defined


# ---------------------------------------------------------------- a bearing that passes from pi to
# -pi


def test_innovations_and_normalised_errors_go_the_short_way():
    angle = Model.define(
        "x + 0.1*v", "x + 0.1*w", prior={"mean": 3, "variance": 0.01}, angles=["x", "y"]
    )
    x, y = simulate(angle, 500, 20, seed=1)
    assert np.abs(np.diff(x, axis=0)).max() > 6  # it jumps
    filter_ = kalman_filter(angle)
    value, cov = innovations(linearised(angle).measure, predictions(filter_, y), y)
    # 10,000 squares of normal numbers: 30 is passed with a chance of 1e-3; a turn would be 1e3
    assert (value[..., 0] ** 2 / cov[..., 0, 0]).max() < 30
    posterior = run(filter_, y)
    # of one step; 20 are more
    assert nees(x, posterior, angle.angles.x).mean() == pytest.approx(1, abs=4 * np.sqrt(2 / 500))
    assert nees(x, posterior).mean() > 10


def test_sensors_of_bearings_are_fused_across_the_jump():
    """Ten kilometres to the west and known to 100 m, as the bearing is there: the middle of 10 m to
    the north and 20 m to the south."""
    still = Dynamics(np.zeros((2, 2)), np.zeros((2, 2)))
    prior = Gaussian(np.array([-10_000.0, 10.0]), 100.0**2 * np.eye(2))
    meter = Model.define(
        ["e + v1", "n + v2"], "atan2(n, e) + 0.01*w", symbols={"x": ["e", "n"]}, angles=["y"]
    )
    sensor = Sensor("radar", meter, 1.0)
    seen = Observation("radar", 1.0, 1.0, np.array([[-PI + 2e-3]]))
    law = fuse(still, [sensor], prior, [seen], np.array([1.0]))
    assert_allclose(law.mean[0, 0], [-10_000, -5], rtol=1e-3)


# ---------------------------------------------------------------- a state that is an angle


def phase(angles, n=2):
    """A phase and its rate; over 40 steps it turns several times."""
    return Model.define(
        ["psi + 0.5*om + 0.1*v1", "om + 0.05*v2"],
        ["psi + 0.3*w"],
        symbols={"x": ["psi", "om"]},
        angles=angles,
        prior={"mean": [2.0, 1.0], "variance": [0.1, 0.05]},
    )


def test_a_phase_is_filtered_on_the_circle_as_on_the_line():
    """Differences of 2 pi are the only difference: with them dropped, every filter of the linear
    model is Kalman's on the line.

    The measurement's deviation of 0.3 and the prediction's make an innovation of half a turn a
    matter of 7 sd.
    """
    line, circle = phase([]), phase(["psi", "y"])
    x, y = simulate(line, 300, 40, seed=2)
    around_x, around_y = simulate(circle, 300, 40, seed=2)
    assert (
        np.abs(x[..., 0]).max() > 15
        and np.abs(around_x[..., 0]).max() <= PI
        and np.abs(around_y).max() <= PI
    )
    assert_allclose(wrapped(x - around_x)[..., 0], 0, atol=1e-12)  # rounding of 40 steps
    assert_allclose(wrapped(y - around_y), 0, atol=1e-12)
    assert_allclose(x[..., 1], around_x[..., 1], rtol=1e-12)
    expected = run(kalman_filter(line), y)
    structures = [linearised(circle), gaussian(circle), unscented(circle), gauss_hermite(circle, 3)]
    filters = [kalman_filter(circle), *(aof(s) for s in structures), iterated(structures[0], 3)]
    filters += [imm([structures[0], structures[1]], [[0.9, 0.1], [0.1, 0.9]])]
    filters += [gated(kalman_filter(circle), 1 - 1e-12)]  # an innovation of a turn is none
    for filter_ in filters:
        law, name = run(filter_, around_y), filter_.name
        assert np.abs(law.mean[..., 0]).max() <= PI
        off = difference(law.mean, expected.mean, (0,))
        assert_allclose(off, 0, atol=1e-9, err_msg=name)
        # some zeros are sums
        assert_allclose(law.cov, expected.cov, rtol=1e-9, atol=1e-15, err_msg=name)


def test_errors_of_a_comparison_go_the_short_way():
    """With equal draws the errors are those on the line; the designed filters regress angles on
    angles, and lose little."""

    def filters(model):
        s = linearised(model)
        return [kalman_filter(model), duof(model), fos(s), mfos(s), fos(s, arguments=3), fbp(s, 3)]

    # on one ensemble no initial state is drawn from a wider law, neither on the line nor on the
    # circle
    line, circle = (
        compare(filters(m), m, 2000, 30, seed=4, jobs=1, same_ensemble=True)
        for m in (phase([]), phase(["psi", "y"]))
    )
    assert_allclose(
        circle.error_variance("kalman").value, line.error_variance("kalman").value, rtol=1e-9
    )
    for name in circle.names:
        ratio = circle.error_variance(name).value / line.error_variance("kalman").value
        # Coefficients fitted over 2000 trajectories cost some parts in a thousand; a single lost
        # turn would cost 4 pi^2 / 2000 of an error variance of 0.03, two thirds of it.
        assert ratio.max() < 1.1, name


def test_what_a_filter_remembers_of_a_measured_angle_is_its_innovation():
    model = Model.define(
        "x + 0.1*v", "x + 0.2*w", angles=["x", "y"], prior={"mean": 3.1, "variance": 0.01}
    )
    (filter_,) = design([fos(linearised(model), 3)], Ensemble(model, 100, 1, seed=1))
    kept = filter_.step(filter_.init(3), np.array([[3.0], [-3.1], [np.nan]])).memory.measurements
    assert_allclose(kept[0].ravel(), [-0.1, 2 * PI - 6.2, 0], atol=1e-12)


def test_angles_are_kept_together_where_estimates_are_remembered():
    """A turn that goes on through pi: what was estimated before is kept within half a turn of what
    is estimated now."""
    before = Remembered((np.array([[3.1, 2.0]]),))
    kept = before.and_now(np.array([[-3.1, 2.1]]), np.empty((1, 0)), Memory(2), turning=(0,))
    assert_allclose(kept.regressor, [[-3.1, 2.1, 3.1 - 2 * PI, 2.0]])


# ---------------------------------------------------------------- densities on the circle


def test_the_likelihood_of_a_measured_angle_is_wound_around_the_circle():
    """Noise of 2 rad: the densities of y and of y plus whole turns add up; of a component that is
    none they do not, and what is missing counts in no turn."""
    model = Model.define(["x1 + 0.1*v1", "x2 + v2"], ["x1 + 2*w1", "x2 + w2"], angles=["y1"])
    x, turns = np.array([[-3.0, 1.0], [0.5, 4.0], [40.0, 2.0]]), 2 * PI * np.arange(-30, 31)
    angle = norm.pdf(3.0 - x[:, :1] + turns, scale=2.0).sum(axis=1)
    for y, other in ((2.5, norm.pdf(2.5 - x[:, 1])), (np.nan, 1.0)):
        density = likelihood(model)(np.array([3.0, y]), x)
        assert_allclose(density, np.log(angle * other), rtol=1e-12)


def by_grid(meter_sd, prior, y):
    """Posterior densities on a fine grid of the line, and the grid: a random walk by steps of 0.3,
    whose measured angle has a wound normal law."""
    x = np.linspace(-40, 40, 16_001)
    density, densities = np.exp(-0.5 * (x - prior[0]) ** 2 / prior[1]), []
    kernel = np.exp(-0.5 * (np.arange(-600, 601) * (x[1] - x[0]) / 0.3) ** 2)
    for value in y:
        for_turns = (value - x + 2 * PI * j for j in range(-12, 13))
        density = density * sum(np.exp(-0.5 * (off / meter_sd) ** 2) for off in for_turns)
        density /= density.sum()
        densities.append(density)
        density = np.convolve(density, kernel, mode="same")
    return densities, x


@pytest.mark.parametrize(
    ("angles", "prior", "meter_sd"),
    [
        (["y"], (3.0, 0.16), 0.3),
        (["y"], (1.0, 9.0), 0.5),
        (["y"], (0.0, 4.0), 0.05),
        (["x", "y"], (1.0, 9.0), 0.5),
    ],
)
@pytest.mark.parametrize("build", [FINE, lambda model: particle(model, 20_000)])
def test_filters_of_densities_on_the_circle(build, angles, prior, meter_sd):
    """Against a fine grid: a narrow prior near the jump, a wide one that leaves several turns
    possible, a sharp meter; and an estimate of a state that is an angle, which counts no turns.

    The grid's sums are exact to rounding; the exact filter errs by 1e-4 posterior deviations, and
    of the particles a fiftieth counts at the sharp meter.
    """
    law = {"mean": prior[0], "variance": prior[1]}
    model = Model.define("x + 0.3*v", f"x + {meter_sd}*w", prior=law, angles=angles)
    y = np.array([3.1, -3.0, 2.9, -2.7, -2.2])
    densities, x = by_grid(meter_sd, prior, y)
    ours = run(build(model), y)
    allowed = 1e-4 if build is FINE else 5 / np.sqrt(20_000 / 50)
    for density, z, p in zip(densities, ours.mean.ravel(), ours.cov.ravel(), strict=True):
        if "x" in angles:
            mean, variance = moments_on_circle(x, density)
            z = mean + wrapped(z - mean)
        else:
            mean = density @ x
            variance = density @ (x - mean) ** 2
        assert abs(z - mean) < allowed * np.sqrt(variance)
        assert p == pytest.approx(variance, rel=2 * allowed)
