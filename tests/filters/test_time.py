"""Models with time and known inputs: against loops typed by hand; the Kalman filter with
matrices that change: test_every_filter."""

import math

import numpy as np
import oracles
import pytest
from numpy.testing import assert_allclose
from test_every_filter import LINEAR

from kfcourse import (
    FormulaError,
    Model,
    ModelError,
    NoClosedForm,
    design,
    gaussian,
    linearised,
    run,
    simulate,
    unscented,
)
from kfcourse.filters import alpha_beta, aof, duof, kalman_filter, pointmass
from kfcourse.linear.system import is_linear
from kfcourse.montecarlo.ensemble import Instant
from kfcourse.scenarios.navigation import Sensor
from kfcourse.symbolic.equations import compile_model, compile_noiseless

STEPS = 6
U = list(oracles.Changing.U)


# ---------------------------------------------------------------- linear models whose matrices
# change


def test_trajectories_satisfy_the_equations_of_each_step():
    """They begin as the prior says; what is left of them are the noises, in their places and sizes,
    independent of one another, of the states and of those before: four standard errors."""
    system, runs = LINEAR["changing"], 4000
    x, y = simulate(system.model(), runs, STEPS, seed=1)
    _, (m_v, D_v), (m_w, D_w) = system.laws.values()
    oracles.has_moments(x[0], *system.laws["prior"])
    before = np.empty((0, runs))
    for k in range(STEPS - 1):
        A, B, a, H, C, b = system.at(k)
        noises = []
        for left, M, mean, cov in (
            (x[k + 1] - x[k] @ A.T - a, B, m_v, D_v),
            (y[k] - x[k] @ H.T - b, C, m_w, D_w),
        ):
            noises.append(np.linalg.solve(M, left.T))
            oracles.has_moments(noises[-1].T, mean, cov)
        v, w = noises
        for now, others in ((v, [w, x[k].T, before]), (w, [x[k].T, before])):
            together = np.corrcoef(np.vstack([now, *others]))
            assert np.abs(together[:2, 2:]).max() < 4 / np.sqrt(runs)
        before = np.vstack(noises)


def test_the_duof_of_the_growth_model_by_a_loop_of_hand():
    """Its prediction regresses x_{k+1} on a(z_k, m_v) of step k: a curved function, on which a
    wrong step is no other scale."""
    model = Model.define("0.5*x + 3*sin(x + 0.9*k) + v", "x + 0.1*k*x**2 + 0.5*w")
    x, y = (array[..., 0] for array in simulate(model, 50, 8, seed=6))
    blocks = [Instant(x[k, :, None], y[k, :, None], x[k + 1, :, None]) for k in range(7)]
    (filter_,) = design([duof(model)], blocks)
    mean = run(filter_, y[:-1, :, None]).mean[..., 0]
    lam = np.zeros(50)
    for k in range(7):
        omega = y[k] - (lam + 0.1 * k * lam**2)
        (slope,), offset, _ = oracles.regression(x[k] - lam, omega)
        z = lam + slope * omega + offset
        # 50 trajectories, regressions conditioned up to 1e3
        assert_allclose(mean[k], z, rtol=1e-9, atol=1e-11)
        alpha = 0.5 * z + 3 * np.sin(z + 0.9 * k)
        (slope,), offset, _ = oracles.regression(x[k + 1], alpha)
        lam = slope * alpha + offset


# ---------------------------------------------------------------- what may be written


def value_at(formula, k, **options):
    """The state equation at step k, x = 2 and v = 0."""
    state, _ = compile_model(Model.define(formula + " + x + v", "x + w", **options))
    return state(np.array([[2.0]]), np.zeros((1, 1)), k).item() - 2.0


@pytest.mark.parametrize(
    ("formula", "values"),
    [
        ("t", [0, 15, 30, 45]),
        ("8*cos(1.2*k)", [8 * math.cos(1.2 * k) for k in range(4)]),
        ("(3 if t < 30 else 5 if t <= 30 else -1)", [3, 3, 5, -1]),
        ("(1 if 15 <= t < 45 else 0)", [0, 1, 1, 0]),
        ("(1 if k == 2 else (1 if t <= 0 else 0))", [1, 0, 1, 0]),
        ("(0 if k != 2 else 1)", [0, 0, 1, 0]),
        ("4*Heaviside(t - 30)", [0, 0, 2, 4]),
        ("sign(k - 1)*Abs(k - 3)", [-3, 0, 1, 0]),
        ("u*k", [k * U[k] for k in range(4)]),
    ],
)
def test_formulas_of_the_step(formula, values):
    ours = [value_at(formula, k, inputs={"u": U}, interval=15) for k in range(4)]
    assert_allclose(ours, values, rtol=1e-14, atol=1e-14)


def jumping(k):
    """Equations with three functions of the step, and with their numbers at step k."""
    state, meter = "{0}*sin(x) + x*{1} + {2}*v*x", "{0}*x**2 + {1}*x*w + {2}"
    texts = "(2 if t < 45 else 0.5)", "Heaviside(t - 30)", "sign(k - 1.5)*u"
    numbers = 2 if 15 * k < 45 else 0.5, np.heaviside(k - 2, 0.5), np.sign(k - 1.5) * U[k]
    for parts in texts, [f"({number})" for number in numbers]:
        yield state.format(*parts), meter.format(*parts)


def choosing(k):
    """Equations that choose between noises by the step, and what they choose at step k."""
    yield "0.9*x + (2*v if k < 2 else x*v)", "x + (w if 1 <= k < 3 else 3*w + x**2)"
    chosen = "2*v" if k < 2 else "x*v", "w" if 1 <= k < 3 else "3*w + x**2"
    yield f"0.9*x + {chosen[0]}", f"x + {chosen[1]}"


@pytest.mark.parametrize(
    ("build", "equations"),
    [
        *((build, jumping) for build in (linearised, gaussian, unscented)),
        *((build, choosing) for build in (linearised, unscented)),
    ],
)
def test_what_jumps_with_the_step_is_a_constant_for_the_structural_functions(build, equations):
    law = np.array([[0.4], [-1.0]]), np.array([[[0.5]], [[1.5]]])
    for k in range(5):
        timed, plain = equations(k)
        now = build(Model.define(*timed, inputs={"u": U}, interval=15)).at(k)
        then = build(Model.define(*plain))
        # a noise that is only added at some steps gets points at all: other moments, but the mean
        parts = slice(1) if (build, equations) == (unscented, choosing) else slice(None)
        for ours, expected in zip(
            (*now.predict(*law)[parts], *now.measure(*law)[parts]),
            (*then.predict(*law)[parts], *then.measure(*law)[parts]),
            strict=True,
        ):
            assert_allclose(*np.broadcast_arrays(ours, expected), rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("build", [linearised, gaussian, unscented])
def test_noise_laws_that_change_with_time_are_factors_in_the_equations(build):
    by_law = Model.define(
        "0.9*x + x*v",
        "x + w",
        {"c": 0.1},
        state_noise={"mean": 0.1, "variance": "c*(1 + k/2)"},
        meter_noise={"mean": 0.3, "variance": "R"},
        inputs={"R": [1, 4, 0, 9, 1, 1, 1]},
        prior={"mean": 1},
    )
    by_hand = Model.define(
        "0.9*x + x*(0.1 + sqrt(0.1*(1 + k/2))*v)",
        "x + 0.3 + r*w",
        inputs={"r": [1, 2, 0, 3, 1, 1, 1]},
        prior={"mean": 1},
    )
    y = simulate(by_law, 4, 7, seed=9).y
    for ours, expected in zip(run(aof(build(by_law)), y), run(aof(build(by_hand)), y), strict=True):
        assert_allclose(ours, expected, rtol=1e-12)


def test_k_and_t_mean_what_else_they_name():
    model = Model.define("k*x + v", "t*x + w", {"k": 0.5, "t": 2})
    assert not model.timed
    assert Model.define("t + v", "t + w", symbols={"x": ["t"]}).n == 1
    assert Model.define("x + v + k", "x + w", inputs={"k": [1, 2]}).known.at(1).tolist() == [2.0]


def test_what_is_printed_names_the_step():
    model = Model.define("x + u*v + t", "x + w", inputs={"u": U}, interval=0.5)
    listed = r"t &= \frac{k}{2}", r"u_0, u_1, \ldots &= 0.7, -2, 3, 0, 1.5, -1, \ldots"
    assert all(line in model.latex() for line in listed)
    assert r"\tau(z, p, k) &= " in linearised(model).latex()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"inputs": {"u": [1, float("nan")]}}, "input u must be a list of finite numbers"),
        ({"inputs": {"x": [1]}}, "x named twice: state, noises, parameters and inputs"),
        ({"inputs": [1, 2]}, "`inputs` must be a table"),
        ({"interval": 0}, "interval between two steps must be positive"),
        ({"state_noise": {"variance": "x"}}, "unknown symbol 'x'; known here: k, pi, t"),
        ({"state_noise": {"variance": ["k", 1]}}, "1 numbers or a"),
        ({"prior": {"variance": "k"}}, "`prior`: the mean must be 1 finite"),
        ("(1 if sin(k) + (k < 2) else 2)", "Compare is not allowed|a condition compares"),
        ("(k < 2)", "Compare is not allowed"),
        ("(1 if k in (1, 2) else 2)", "a condition compares"),
        ("Heaviside(k, 1)", "takes 1 argument"),
    ],
)
def test_what_does_not_fit_is_refused(options, message):
    extra, options = ("0", options) if isinstance(options, dict) else (options, {})
    with pytest.raises((ModelError, FormulaError), match=message):
        Model.define("x + v + " + extra, "x + w", **options)


def test_an_input_that_ends_too_soon_is_named():
    model = Model.define("x + u + v", "x + w", inputs={"u": [1, 2, 3]})
    for use in (
        lambda: simulate(model, 2, 4, seed=1),
        lambda: run(kalman_filter(model), np.zeros((4, 1, 1))),
        lambda: run(pointmass(model), np.zeros((4, 1, 1))),
    ):
        with pytest.raises(
            ModelError,
            match=r"input u has 3 value\(s\), for the steps 0 to 2, but step 3 needs one",
        ):
            use()
    assert simulate(model, 2, 3, seed=1).x.shape == (3, 2, 1)


def test_functions_of_a_model_with_time_want_the_step():
    model, law = (
        Model.define("x/2 + cos(k) + v", "x**2/20 + k + w"),
        (np.zeros((1, 1)), np.ones((1, 1, 1))),
    )
    for use in (
        lambda: linearised(model).measure(*law),
        lambda: compile_model(model)[0](*np.zeros((2, 1, 1))),
        lambda: compile_noiseless(model)[0](np.zeros((1, 1))),
    ):
        with pytest.raises(ModelError, match="depends on the step"):
            use()
    with pytest.raises(ModelError, match="depends on the step"):
        alpha_beta(Model.define(["x1 + x2 + k", "x2 + v"], "x1 + w"), 0.5, 0.2)
    with pytest.raises(ModelError, match="a sensor has moments of its own"):
        Sensor.define("late", ["s"], "s + t + w", 1.0, 0.1)


# ---------------------------------------------------------------- kinks and jumps of the state


SMOOTH_ENOUGH = {
    "Abs(x)": -1.0,
    "(x if x < 1 else 1)": 1.0,
    "(x if x < 1 else 2*x - 1)": 1.0,
    "x*Abs(x)": 1.4,
}


@pytest.mark.parametrize(("formula", "slope"), SMOOTH_ENOUGH.items())
def test_a_kink_can_be_linearised(formula, slope):
    at = np.array([[-0.5 if slope == -1 else 0.7]])
    structure = linearised(Model.define("0.9*x + 0.3*v", f"{formula} + 0.5*w"))
    assert structure.measure(at, np.ones((1, 1, 1))).G.item() == pytest.approx(slope)


@pytest.mark.parametrize(
    ("state", "meter"),
    [
        ("0.9*x + v", "(1 if x > 0 else 2) + w"),
        ("0.9*x + v", "x + (1 if w > 0 else 2)"),
        ("0.9*x + (1 if v > 0 else -1)", "x + w"),
        ("0.9*x + (1 if v > x else -1)", "x + w"),
        ("0.9*x + v*(1 if x > 0 else 2)", "x + w"),
        ("0.9*x + sign(v)", "x + w"),
    ],
)
def test_a_choice_that_the_state_or_a_noise_makes_is_no_constant(state, meter):
    """Derivatives of 1 if v > 0 else -1 are 0 almost everywhere, but it is not a constant, and no
    filter may take it for one."""
    model = Model.define(state, meter)
    assert not is_linear(model)
    for refuses in (kalman_filter, linearised, gaussian):
        with pytest.raises((ModelError, NoClosedForm)):
            refuses(model)
    if "if x > 0" in state + meter:  # it follows jumps of the state: test_exact.py
        assert pointmass(model).name == "aof-exact"
    else:
        with pytest.raises(ModelError):
            pointmass(model)
