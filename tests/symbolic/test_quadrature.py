"""Quadrature: points, what does not vary, and warnings where points cannot
integrate."""

import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from kfcourse import (
    Model,
    QuadratureWarning,
    gauss_hermite,
    gaussian,
    likelihood,
    linearised,
    run,
    simulate,
    unscented,
)
from kfcourse.filters import aof
from kfcourse.symbolic.quadrature import axes

# --- what does not vary


@pytest.mark.parametrize("kind", [unscented, gauss_hermite])
def test_a_known_state_has_no_part_in_the_unexplained(kind):
    model = Model.define(
        ["0.9*x1 + v1", "x2 + 0.1"],
        "exp(0.1*x1) + x1*x2 + w1",
        prior={"mean": [0.3, 0.3], "variance": [1.0, 0.0]},
        meter_noise={"variance": 1.5},
    )
    filter_, structure = aof(kind(model)), kind(model)
    state = filter_.init(3)
    for y in simulate(model, 3, 30, seed=2).y:
        G, F, R = structure.measure(*state.predicted)[1:]
        explained = G @ state.predicted.cov @ np.swapaxes(G, -1, -2)
        assert_allclose(F - explained, R, rtol=1e-12)
        assert (R >= 1.5).all()
        assert not G[..., 1].any()
        state = filter_.step(state, y)


@pytest.mark.parametrize("kind", [unscented, gauss_hermite])
@pytest.mark.parametrize("units", [(1.0, 1.0), (1e-6, 1e9)])
def test_slopes_are_seen_in_directions_without_variance(kind, units):
    """x1 + x2 is known exactly, yet its meter has the slopes (1, 1), in any units; noise makes it a
    measurement again."""
    a, b = units
    model = Model.define(
        ["x1", "x2"], [f"{a}*x1 + {b}*x2", f"{a}*x1 - {b}*x2", f"{a}*x1 + {b}*x2 + w1"]
    )
    cov = 1e8 * np.array([[1.0, -1.0], [-1.0, 1.0]]) / np.outer(units, units)
    G, F, R = kind(model).measure(np.array([3.0, 4.0]) / units, cov)[1:]
    # the enlarged variances are 2e-14 of 1e8, so slopes have half of the digits
    assert_allclose(G[1:], np.array([[1, -1], [1, 1]]) * units, rtol=1e-6)
    assert_allclose(np.diagonal(F), [0, 4e8, 1], rtol=1e-6, atol=1e-6)
    assert_allclose(R[0], 0, atol=1e-20)


BOTH = {"mean": [0, 0], "variance": [[1.0, 0.5], [0.5, 1.0]]}


@pytest.mark.filterwarnings("ignore::kfcourse.symbolic.quadrature.QuadratureWarning")
@pytest.mark.parametrize(
    ("state", "meter", "laws", "size"),
    [
        ("x/(1 + x**2) + v", "x**3 + x + w", {}, 1),
        ("x/(1 + x**2)*v", "x*w1 + exp(x)*w2", {}, 1),  # given x all is known of them
        ("x + v", "sin(w1)*w2/(1 + x**2)", {}, 3),
        ("x + v", "x*w1 + w2**2", {}, 2),
        ("x + v", "x*w1 + w2**2", {"meter_noise": BOTH}, 3),  # correlated with one that does
        ("x + v", "x*w1 + sign(x + w2)", {}, 2),
    ],
)
def test_only_noises_that_do_not_enter_linearly_take_points(state, meter, laws, size):
    assert axes(Model.define(state, meter, **laws)) == size


# --- warnings


NOT_INTEGRATED = ("exp(x**2)", "abs(x)", "exp(3*x)", "25*x/(1 + x**2)")
NOT_FINITE = ("log(x)", "sqrt(x)", "exp(exp(exp(5*x)))")


@pytest.mark.parametrize("kind", [unscented, gauss_hermite])
@pytest.mark.parametrize(
    ("term", "words"),
    [
        *((term, "points an axis") for term in NOT_INTEGRATED),
        *((t, "not finite") for t in NOT_FINITE),
    ],
)
def test_what_the_points_do_not_integrate_is_said(kind, term, words):
    for state, meter in ((f"{term} + v", "x + w"), ("0.5*x + v", f"x + {term} + w")):
        with pytest.warns(QuadratureWarning, match=words):
            kind(Model.define(state, meter))


@pytest.mark.parametrize("kind", [unscented, gauss_hermite])
@pytest.mark.parametrize(
    "term", ["0", "7", "sin(x)", "x**3", "exp(0.5*x)", "sqrt(4 + x)", "x*v", "tanh(x/2)"]
)
def test_where_the_points_do_nothing_is_said(kind, term):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        kind(Model.define(f"{term} + v", "x + w", prior={"variance": 0.5}))


def test_what_is_not_finite_is_said_where_the_rules_have_too_many_points():
    with pytest.warns(QuadratureWarning, match="not finite"):
        unscented(Model.define([f"x{i} + v{i}" for i in range(1, 8)], "log(x1) + w"))


def test_a_covariance_that_rounding_has_broken_is_no_error():
    """After a measurement 1e13 times as sharp as the prior the covariance of the state is none, by
    some units of precision."""
    prior = {"mean": [0, 1], "variance": [1e8, 4e8]}
    model = Model.define(["x1 + x2", "x2"], ["x1 + 1e-9*w1", "x1 + x2 + w2"], prior=prior)
    filters = aof(gauss_hermite(model)), aof(linearised(model))
    (_, points), (_, exact) = (run(each, np.zeros((6, 1, 2))) for each in filters)
    assert_allclose(points[-1], exact[-1], rtol=1e-5)
    # one such trajectory leaves the others as they are
    sound, broken = np.array([[1.0, 0.3], [0.3, 2.0]]), np.array([[1.0, 1 + 1e-6], [1 + 1e-6, 1.0]])
    measure, mean = gauss_hermite(model).measure, np.zeros((2, 2))
    for alone, beside in zip(
        measure(mean[:1], sound[None]), measure(mean, np.array([sound, broken])), strict=True
    ):
        assert_array_equal(beside[0], np.broadcast_to(alone, (1, *beside.shape[1:]))[0])


@pytest.mark.parametrize("build", [unscented, gauss_hermite])
def test_a_meter_without_noise_leaves_no_rounding_as_a_variance(build):
    """The states are then known, as by the closed form; 1e-32 in the place of 0 made a likelihood
    of -1e29."""
    model = Model.define("0.9*x + v", "2*x + 1", prior={"mean": 0.3, "variance": 2.0})
    y = np.array([1.7, 0.2, -3.0])
    estimates, exact = (run(aof(filter_(model)), y) for filter_ in (build, gaussian))
    assert_array_equal(estimates.cov, np.zeros((3, 1, 1, 1)))
    assert_allclose(estimates.mean, exact.mean, rtol=1e-12)
    still = Model.define("x", "x", prior={"mean": 0, "variance": 2.0})
    with pytest.raises(ValueError, match="no density for the measurement of step 1"):
        likelihood(aof(build(still)), np.array([1.0, 1.1]))
