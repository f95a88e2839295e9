"""Models with time and known inputs: against loops typed by hand, and the Kalman filter with matrices that change."""

import math
from typing import ClassVar

import numpy as np
import oracles
import pytest
import sympy as sp

from kfcourse.filters import (
    alpha_beta,
    aof,
    dfkp,
    dfmp,
    duof,
    fbp,
    fkp,
    fos,
    imm,
    iterated,
    kalman_filter,
    mdfkp,
    mdfmp,
    mfkp,
    mfos,
    particle,
    pointmass,
)
from kfcourse.filters.densities import likelihood, transition
from kfcourse.linear.system import is_linear, linear_system, linear_systems
from kfcourse.montecarlo.designing import design
from kfcourse.montecarlo.ensemble import Ensemble, Instant, simulate
from kfcourse.montecarlo.experiment import compare, predictions, run
from kfcourse.scenarios.navigation import Sensor
from kfcourse.symbolic.equations import compile_model, compile_noiseless
from kfcourse.symbolic.formula import FormulaError
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import NoClosedForm
from kfcourse.symbolic.quadrature import gauss_hermite, unscented
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import gaussian, linearised

pytestmark = pytest.mark.quick

STEPS = 6
U = [0.7, -2.0, 3.0, 0.0, 1.5, -1.0, 0.4]  # of every step another value: a step too early or too late is seen


def growth():
    return Model.define(
        "x/2 + 25*x/(1 + x**2) + 8*cos(1.2*k) + v", "x**2/20 + w", state_noise={"variance": 10}, prior={"variance": 5}
    )


# ---------------------------------------------------------------- linear models whose matrices change


class Changing:
    """x' = A_k x + B_k v + a_k, y = H_k x + C_k w + b_k, as text and as arrays typed apart from it."""

    text = (
        ["(0.9 + 0.1*sin(k))*x1 + 0.2*x2 + (1 + t)*v1 + u", "0.1*x1 + (0.8 - 0.05*k)*x2 + 0.5*v2 - 2*u + v1"],
        ["x1 + 0.1*k*x2 + (2 if t < 1 else 1)*w1 + u**2", "x2 + w2 + cos(t)"],
    )
    options: ClassVar = {
        "inputs": {"u": U}, "interval": 0.5, "prior": {"mean": [1.0, -0.5], "variance": [[1.0, 0.3], [0.3, 0.8]]},
        "state_noise": {"mean": [0.2, -0.1], "variance": [[0.5, 0.1], [0.1, 0.3]]},
        "meter_noise": {"mean": [0.1, 0.3], "variance": [[0.4, 0.1], [0.1, 0.6]]},
    }  # fmt: skip

    @staticmethod
    def matrices(k):
        t, u = 0.5 * k, U[k]
        A = np.array([[0.9 + 0.1 * math.sin(k), 0.2], [0.1, 0.8 - 0.05 * k]])
        B = np.array([[1 + t, 0.0], [1.0, 0.5]])
        H = np.array([[1.0, 0.1 * k], [0.0, 1.0]])
        C = np.diag([2.0 if t < 1 else 1.0, 1.0])
        return A, B, np.array([u, -2 * u]), H, C, np.array([u**2, math.cos(t)])

    @classmethod
    def model(cls):
        return Model.define(*cls.text, **cls.options)


def kalman_loop(y):
    """The textbook's filter with the matrices of each step, one trajectory: y (steps, 2)."""
    laws = {
        key: (np.array(law["mean"]), np.array(law["variance"])) for key, law in Changing.options.items() if "i" not in key[:1]
    }
    (x, P), (m_v, D_v), (m_w, D_w) = laws["prior"], laws["state_noise"], laws["meter_noise"]
    found = []
    for k, value in enumerate(y):
        A, B, a, H, C, b = Changing.matrices(k)
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + C @ D_w @ C.T)
        x, P = x + K @ (value - H @ x - C @ m_w - b), P - K @ H @ P
        found.append((x, P))
        x, P = A @ x + B @ m_v + a, A @ P @ A.T + B @ D_v @ B.T
    return found


def every_filter(model):
    structures = [linearised(model), gaussian(model), unscented(model), gauss_hermite(model, 3)]
    ready = [kalman_filter(model), *(aof(one) for one in structures), *(iterated(one, 3) for one in structures)]
    ready.append(imm(structures[:2], [[0.9, 0.1], [0.1, 0.9]]))
    designs = [duof(model)]
    designs += [family(one, arguments) for one in structures[:2] for family in (fos, mfos) for arguments in (2, 3)]
    designs += [family(one) for one in structures[:2] for family in (dfmp, mdfmp, fbp)]
    designs += [family(one, STEPS) for one in structures[:2] for family in (fkp, mfkp, dfkp, mdfkp)]
    return ready, designs


def exact_ensemble(steps, seed):
    """Trajectories whose sample moments are exactly the model's: affine functions of orthonormal columns."""
    columns = 2 + 4 * steps
    draws = np.random.default_rng(seed).normal(size=(3 * columns, columns))
    orthonormal, _ = np.linalg.qr(draws - draws.mean(axis=0))
    standard = iter((orthonormal * np.sqrt(len(draws))).T)

    def draw(key):
        law = Changing.options[key]
        root = np.linalg.cholesky(np.array(law["variance"]))
        return np.array(law["mean"]) + np.stack([next(standard), next(standard)], axis=-1) @ root.T

    x, found = draw("prior"), []
    for k in range(steps):
        A, B, a, H, C, b = Changing.matrices(k)
        y = x @ H.T + draw("meter_noise") @ C.T + b
        following = x @ A.T + draw("state_noise") @ B.T + a
        found.append(Instant(x, y, following))
        x = following
    return found


def test_every_filter_is_the_kalman_filter_with_the_matrices_of_each_step():
    """As for models without time: structural functions are exact, designs take exact moments; tolerances as there."""
    model, instants = Changing.model(), exact_ensemble(STEPS, seed=3)
    y = np.stack([one.y for one in instants])
    ready, designs = every_filter(model)
    expected = [kalman_loop(y[:, i]) for i in range(y.shape[1])]
    mean = np.stack([[z for z, _ in one] for one in expected], axis=1)
    cov = np.stack([[p for _, p in one] for one in expected], axis=1)
    for one in [*ready, *design(designs, instants)]:
        found = run(one, y)
        np.testing.assert_allclose(found.mean, mean, rtol=1e-7, atol=1e-7, err_msg=one.name)
        if one.name.split("-")[0] in ("kalman", "aof", "iterated", "imm"):
            np.testing.assert_allclose(found.cov, cov, rtol=1e-7, atol=1e-9, err_msg=one.name)


def test_the_matrices_are_those_of_the_page():
    model = Changing.model()
    assert is_linear(model) and model.timed
    systems = linear_systems(model)
    noise = Changing.options["state_noise"], Changing.options["meter_noise"]
    for k in range(STEPS):
        A, B, a, H, C, b = Changing.matrices(k)
        system, shift, offset = systems(k)
        Q, R = (M @ np.array(law["variance"]) @ M.T for M, law in zip((B, C), noise, strict=True))
        expected = (A, Q, a + B @ noise[0]["mean"], H, R, b + C @ noise[1]["mean"])
        for one, other in zip((system.A, system.Q, shift, system.H, system.R, offset), expected, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-14, atol=1e-14)
    with pytest.raises(ModelError, match="depends on the step"):
        linear_system(model)


def test_trajectories_satisfy_the_equations_of_each_step():
    """Without noises of the object and prior, x is one sequence; the rest is the meter's noise, in its place and size."""
    options = Changing.options | {
        "prior": {"mean": [1.0, -0.5], "variance": 0.0}, "state_noise": {"mean": [0.2, -0.1], "variance": 0.0}
    }  # fmt: skip
    x, y = simulate(Model.define(*Changing.text, **options), 4000, STEPS, seed=1)
    expected = np.array([1.0, -0.5])
    for k in range(STEPS):
        A, B, a, H, C, b = Changing.matrices(k)
        np.testing.assert_allclose(x[k], np.tile(expected, (4000, 1)), rtol=1e-12)
        w = (y[k] - H @ expected - b) / np.diag(C)
        assert (np.abs(w.mean(axis=0) - [0.1, 0.3]) < 4 * np.sqrt(np.array([0.4, 0.6]) / 4000)).all()
        assert (np.abs(w.var(axis=0) - [0.4, 0.6]) < 4 * np.array([0.4, 0.6]) * np.sqrt(2 / 4000)).all()
        expected = A @ expected + B @ [0.2, -0.1] + a


def test_the_duof_of_the_growth_model_by_a_loop_of_hand():
    """Its prediction regresses x_{k+1} on a(z_k, m_v) of step k: a curved function, on which a wrong step is no other scale."""
    model = Model.define("0.5*x + 3*sin(x + 0.9*k) + v", "x + 0.1*k*x**2 + 0.5*w")
    x, y = (array[..., 0] for array in simulate(model, 50, 8, seed=6))
    blocks = [Instant(*(one[:, None] for one in step)) for step in zip(x[:-1], y[:-1], x[1:], strict=True)]
    (filter_,) = design([duof(model)], blocks)
    found = run(filter_, y[:-1, :, None]).mean[..., 0]
    lam = np.zeros(50)
    for k in range(7):
        omega = y[k] - (lam + 0.1 * k * lam**2)
        (slope,), offset, _ = oracles.regression(x[k] - lam, omega)
        z = lam + slope * omega + offset
        np.testing.assert_allclose(found[k], z, rtol=1e-9, atol=1e-11)  # 50 trajectories, regressions conditioned up to 1e3
        alpha = 0.5 * z + 3 * np.sin(z + 0.9 * k)
        (slope,), offset, _ = oracles.regression(x[k + 1], alpha)
        lam = slope * alpha + offset


# ---------------------------------------------------------------- the exact filter


def test_the_exact_filter_takes_the_input_of_the_step_before():
    """It predicts x_k when y_k has come, with the input u_{k-1}: a linear model, whose exact filter is Kalman's."""
    model = Model.define(
        "(0.8 + 0.02*k)*x + 4*u + (0.5 + 0.1*k)*v", "x + u + (1 + 0.2*k)*w", inputs={"u": U}, prior={"mean": 0.3}
    )
    y = simulate(model, 5, 7, seed=3).y
    expected, found = run(kalman_filter(model), y), run(pointmass(model, accuracy=1e-6), y)
    # the filter promises 1e-6 posterior deviations a step, for some steps
    np.testing.assert_allclose(found.mean, expected.mean, atol=1e-4)
    np.testing.assert_allclose(found.cov, expected.cov, rtol=1e-4)
    predicted, prediction = predictions(kalman_filter(model), y), predictions(pointmass(model, accuracy=1e-6), y)
    np.testing.assert_allclose(prediction.mean, predicted.mean, atol=1e-4)
    np.testing.assert_allclose(prediction.cov, predicted.cov, rtol=1e-4)
    late = Model.define(
        "(0.8 + 0.02*k)*x + 4*u + (0.5 + 0.1*k)*v", "x + u + (1 + 0.2*k)*w", inputs={"u": [0, *U]}, prior={"mean": 0.3}
    )
    assert np.abs(run(pointmass(late), y).mean - expected.mean).max() > 1  # so the test would see it


def growth_on_a_grid(y):
    """Posterior means and variances of the growth model by sums over a grid, typed from its page."""
    x = np.linspace(-45, 45, 3601)
    density = np.exp(-0.5 * x**2 / 5)
    found = []
    for k, value in enumerate(y):
        density = density * np.exp(-0.5 * (value - x**2 / 20) ** 2)
        density /= density.sum()
        mean = density @ x
        found.append((mean, density @ (x - mean) ** 2))
        centre = x / 2 + 25 * x / (1 + x**2) + 8 * np.cos(1.2 * k)
        density = np.exp(-0.05 * (x[:, None] - centre) ** 2) @ density
    return found


def test_the_exact_filter_of_the_growth_model():
    y = simulate(growth(), 3, 5, seed=4).y
    found = run(pointmass(growth(), accuracy=1e-6), y)
    for i in range(3):
        for k, (mean, variance) in enumerate(growth_on_a_grid(y[:, i, 0])):
            # the grid's 0.025 against hills of width 0.1 at least: its sums are exact; the filter promises 1e-6 a step
            assert found.mean[k, i, 0] == pytest.approx(mean, abs=1e-4 * math.sqrt(variance))
            assert found.cov[k, i, 0, 0] == pytest.approx(variance, rel=1e-4)


def test_the_signal_of_a_pure_noise_meter_may_have_an_offset_that_changes():
    """Stochastic volatility with a level b_k: known, so it is as if it were taken off y."""
    plain = Model.define("0.9*x + 0.3*v", "exp(x/2)*w")
    shifted = Model.define("0.9*x + 0.3*v", "exp(x/2)*w + u", inputs={"u": U})
    y = simulate(plain, 4, 6, seed=5).y
    moved = y + np.array(U[:6])[:, None, None]
    np.testing.assert_allclose(run(pointmass(shifted), moved).mean, run(pointmass(plain), y).mean, rtol=1e-7, atol=1e-9)


def test_particles_of_each_step():
    model = Changing.model()
    y = simulate(model, 3, STEPS, seed=6).y
    found = run(particle(model, 20_000), y)
    for i in range(3):
        for k, (z, p) in enumerate(kalman_loop(y[:, i])):
            # a tenth of the particles counts
            assert (np.abs(found.mean[k, i] - z) < 5 * np.sqrt(np.diag(p) / 2000)).all()
    law = transition(model)(np.array([1.0, 2.0]), 3)
    A, B, a, *_ = Changing.matrices(3)
    np.testing.assert_allclose(law.mean, A @ [1.0, 2.0] + B @ [0.2, -0.1] + a, rtol=1e-14)
    assert likelihood(model)(y[3, :1], np.array([[1.0, 2.0]]), 3) != likelihood(model)(y[3, :1], np.array([[1.0, 2.0]]), 2)


# ---------------------------------------------------------------- the growth model, by hand


def extended_loop(y):
    z, p, found = 0.0, 5.0, []
    for k, value in enumerate(y):
        slope = z / 10
        gain = p * slope / (slope**2 * p + 1)
        z, p = z + gain * (value - z**2 / 20), (1 - gain * slope) * p
        found.append((z, p))
        slope = 0.5 + 25 * (1 - z**2) / (1 + z**2) ** 2
        z, p = z / 2 + 25 * z / (1 + z**2) + 8 * math.cos(1.2 * k), slope**2 * p + 10
    return found


def unscented_loop(y):
    """Three points, spread 3; the noises are added."""
    z, p, found = 0.0, 5.0, []
    weights = np.array([2 / 3, 1 / 6, 1 / 6])
    for k, value in enumerate(y):
        x = z + math.sqrt(3 * p) * np.array([0, 1, -1])
        signal = x**2 / 20
        h = weights @ signal
        cross, variance = weights @ ((x - z) * (signal - h)), weights @ (signal - h) ** 2 + 1
        z, p = z + cross / variance * (value - h), p - cross**2 / variance
        found.append((z, p))
        x = z + math.sqrt(3 * p) * np.array([0, 1, -1])
        following = x / 2 + 25 * x / (1 + x**2) + 8 * np.cos(1.2 * k)
        z = weights @ following
        p = weights @ (following - z) ** 2 + 10
    return found


@pytest.mark.filterwarnings("ignore::kfcourse.symbolic.quadrature.QuadratureWarning")
@pytest.mark.parametrize(("build", "loop"), [(linearised, extended_loop), (unscented, unscented_loop)])
def test_the_growth_model_by_a_loop_of_hand(build, loop):
    model = growth()
    y = simulate(model, 6, 30, seed=7).y
    found = run(aof(build(model)), y)
    for i in range(6):
        expected = np.array(loop(y[:, i, 0]))
        # errors of rounding grow where the slope 25 (1 - z^2)/(1 + z^2)^2 does: 25 at each step that passes near 0
        np.testing.assert_allclose(found.mean[:, i, 0], expected[:, 0], rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(found.cov[:, i, 0, 0], expected[:, 1], rtol=1e-6, atol=1e-6)


@pytest.mark.filterwarnings("ignore::kfcourse.symbolic.quadrature.QuadratureWarning")
def test_the_growth_model_works_with_every_filter():
    model = growth()
    s, g = linearised(model), gauss_hermite(model, 10)
    filters = [aof(s), aof(unscented(model)), aof(g), iterated(s, 2), duof(model)]
    filters += [family(g, arguments) for family in (fos, mfos) for arguments in (2, 3)] + [fos(s), mfos(s)]
    filters += [pointmass(model), particle(model, 300)]
    found = compare(filters, model, 112, 20, seed=1, jobs=1, progress=False)
    assert not found.left_out and set(found.names) == {one.name for one in filters}
    extended, conditional = (found.error_variance(name).value.mean() for name in ("aof-linearised", "duof"))
    assert conditional < extended / 3  # the model's fame: linearising fails here


def test_time_as_a_state_gives_the_same_as_time_in_the_formula():
    """The trick that was needed before: a second state x2 = k, known exactly."""
    trick = Model.define(
        ["x1/2 + 25*x1/(1 + x1**2) + 8*cos(1.2*x2) + v1", "x2 + 1"], ["x1**2/20 + w"],
        state_noise={"variance": 10}, prior={"mean": [0, 0], "variance": [5.0, 0.0]}, symbols={"v": ["v1"]},
    )  # fmt: skip
    y = simulate(growth(), 5, 12, seed=8).y
    for ours, theirs in ((aof(linearised(growth())), aof(linearised(trick))),):
        np.testing.assert_allclose(run(ours, y).mean[..., 0], run(theirs, y).mean[..., 0], rtol=1e-7, atol=1e-7)


# ---------------------------------------------------------------- what may be written


def value_at(formula, k, **options):
    """The state equation at step k, x = 2 and v = 0."""
    state, _ = compile_model(Model.define(formula + " + x + v", "x + w", **options))
    return state(np.array([[2.0]]), np.zeros((1, 1)), k).item() - 2.0


@pytest.mark.parametrize(
    ("formula", "values"),
    [
        ("k", [0, 1, 2, 3]),
        ("t", [0, 15, 30, 45]),
        ("8*cos(1.2*k)", [8 * math.cos(1.2 * k) for k in range(4)]),
        ("(3 if t < 45 else -1)", [3, 3, 3, -1]),
        ("Piecewise((3, t < 30), (5, t <= 30), (-1, True))", [3, 3, 5, -1]),
        ("(1 if 15 <= t < 45 else 0)", [0, 1, 1, 0]),
        ("(1 if k == 2 or not t > 0 else 0)", [1, 0, 1, 0]),
        ("(1 if k != 2 and t >= 15 else 0)", [0, 1, 0, 1]),
        ("4*Heaviside(t - 30)", [0, 0, 2, 4]),
        ("sign(k - 1)*Abs(k - 3)", [-3, 0, 1, 0]),
        ("u", U[:4]),
        ("u*k", [k * U[k] for k in range(4)]),
    ],
)
def test_formulas_of_the_step(formula, values):
    found = [value_at(formula, k, inputs={"u": U}, interval=15) for k in range(4)]
    np.testing.assert_allclose(found, values, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("build", [linearised, gaussian, unscented])
def test_what_jumps_with_the_step_is_a_constant_for_the_structural_functions(build):
    """Structural functions of the step equal those of a model with the numbers of that step."""
    state, meter = "{0}*sin(x) + x*{1} + {2}*v*x", "{0}*x**2 + {1}*x*w + {2}"
    parts = "(2 if t < 45 else 0.5)", "Heaviside(t - 30)", "sign(k - 1.5)*u"
    model = Model.define(state.format(*parts), meter.format(*parts), inputs={"u": U}, interval=15)
    mean, cov = np.array([[0.4], [-1.0]]), np.array([[[0.5]], [[1.5]]])
    for k in range(5):
        numbers = [2 if 15 * k < 45 else 0.5, 0.5 if k == 2 else float(k > 2), np.sign(k - 1.5) * U[k]]
        plain = build(Model.define(*(text.format(*(f"({n})" for n in numbers)) for text in (state, meter))))
        now = build(model).at(k)
        for one, other in zip(
            (*now.predict(mean, cov), *now.measure(mean, cov)),
            (*plain.predict(mean, cov), *plain.measure(mean, cov)),
            strict=True,
        ):
            np.testing.assert_allclose(*np.broadcast_arrays(one, other), rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("build", [linearised, gaussian, unscented])
def test_noise_laws_that_change_with_time_are_factors_in_the_equations(build):
    by_law = Model.define(
        "0.9*x + x*v", "x + w",
        {"c": 0.1}, state_noise={"mean": 0.1, "variance": "c*(1 + k/2)"}, meter_noise={"mean": 0.3, "variance": "R"},
        inputs={"R": [1, 4, 0, 9, 1, 1, 1]}, prior={"mean": 1},
    )  # fmt: skip
    by_hand = Model.define(
        "0.9*x + x*(0.1 + sqrt(0.1*(1 + k/2))*v)", "x + 0.3 + r*w", inputs={"r": [1, 2, 0, 3, 1, 1, 1]}, prior={"mean": 1}
    )
    y = simulate(by_law, 4, 7, seed=9).y
    for one, other in zip(run(aof(build(by_law)), y), run(aof(build(by_hand)), y), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)
    several = Model.define(
        ["x1 + v1", "x2 + v2"], ["x1 + w1", "x2 + w2"], state_noise={"variance": [2, "1 + k"], "mean": [3, 1]},
        meter_noise={"variance": "1 + t"}, interval=0.5,
    )  # fmt: skip
    for k in (0, 3):
        now = build(several).at(k)
        tau, Theta = now.predict(np.zeros((1, 2)), np.zeros((1, 2, 2)))
        np.testing.assert_allclose(tau, [[3, 1]], atol=1e-12)
        np.testing.assert_allclose(np.broadcast_to(Theta, (1, 2, 2))[0], np.diag([2, 1 + k]), rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(
            np.broadcast_to(now.measure(np.zeros((1, 2)), np.eye(2)).R, (1, 2, 2))[0],
            (1 + k / 2) * np.eye(2),
            rtol=1e-10,
            atol=1e-10,
        )


def test_k_and_t_mean_what_else_they_name():
    model = Model.define("k*x + v", "t*x + w", {"k": 0.5, "t": 2})
    assert not model.timed
    assert Model.define("t + v", "t + w", symbols={"x": ["t"]}).n == 1
    assert Model.define("x + v + k", "x + w", inputs={"k": [1, 2]}).known.at(1).tolist() == [2.0]


def test_models_without_time_pay_nothing(variant53):
    structure = linearised(variant53)
    assert structure.at(5) is structure and "known" not in structure.source()
    densities = pointmass(variant53)
    assert densities is not None and variant53.known.symbols == ()


def test_what_is_printed_names_the_step():
    model = Model.define("x + u*v + t", "x + w", inputs={"u": U}, interval=0.5)
    assert repr(model).endswith("inputs u (7 values))")
    text = model.latex()
    assert r"t &= \frac{k}{2}" in text and r"u_0, u_1, \ldots &= 0.7, -2, 3, 0, 1.5, -1, \ldots" in text
    assert r"\tau(z, p, k) &= " in linearised(model).latex()
    x, k, u = sp.Symbol("z", real=True), sp.Symbol("t", real=True), sp.Symbol("u", real=True)
    assert linearised(model)["tau"] == x + k and linearised(model)["Theta"].coeff(u, 2) == 1


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"inputs": {"u": []}}, ModelError, "input u must be a list of finite numbers"),
        ({"inputs": {"u": [1, float("nan")]}}, ModelError, "input u must be a list of finite numbers"),
        ({"inputs": {"u": "cos(k)"}}, ModelError, "input u must be a list of finite numbers"),
        ({"inputs": {"u": [[1, 2]]}}, ModelError, "input u must be a list of finite numbers"),
        ({"inputs": {"x": [1]}}, ModelError, "x named twice: state, noises, parameters and inputs"),
        ({"inputs": {"sin": [1]}}, ModelError, "already means a function"),
        ({"inputs": [1, 2]}, ModelError, "`inputs` must be a table"),
        ({"interval": 0}, ModelError, "interval between two steps must be positive"),
        ({"interval": "1 s"}, ModelError, "interval"),
        ({"state_noise": {"variance": "x"}}, FormulaError, "unknown symbol 'x'; known here: k, pi, t"),
        ({"state_noise": {"variance": [["k"]]}}, ModelError, "write correlated noises that change with time into the equation"),
        ({"state_noise": {"variance": ["k", 1]}}, ModelError, r"2 variances and 1 means for 1 noise\(s\)"),
        ({"meter_noise": {"mean": "k", "variance": 2}}, ModelError, "mean and variance must be numbers"),
        ({"prior": {"variance": "k"}}, ModelError, "`prior`: mean and variance must be numbers"),
    ],
)
def test_what_does_not_fit_is_refused(options, error, message):
    with pytest.raises(error, match=message):
        Model.define("x + v", "x + w", **options)


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("(1 if x else 2)", "a condition compares"),
        ("(1 if sin(k) + (k < 2) else 2)", "Compare is not allowed|a condition compares"),
        ("Piecewise((1, k < 2))", "must have the condition True"),
        ("Piecewise(1, 2)", "takes pairs"),
        ("Piecewise()", "takes pairs"),
        ("(k < 2)", "Compare is not allowed"),
        ("(1 if k in (1, 2) else 2)", "a condition compares"),
        ("Heaviside(k, 1)", "takes exactly one argument"),
    ],
)
def test_bad_choices_are_refused_at_their_place(formula, message):
    with pytest.raises(FormulaError, match=message):
        Model.define("x + v + " + formula, "x + w")


def test_an_input_that_ends_too_soon_is_named():
    model = Model.define("x + u + v", "x + w", inputs={"u": [1, 2, 3]})
    for use in (
        lambda: simulate(model, 2, 4, seed=1),
        lambda: run(kalman_filter(model), np.zeros((4, 1, 1))),
        lambda: run(pointmass(model), np.zeros((4, 1, 1))),
    ):
        with pytest.raises(ModelError, match=r"input u has 3 value\(s\), for the steps 0 to 2, but step 3 needs one"):
            use()
    assert simulate(model, 2, 3, seed=1).x.shape == (3, 2, 1)


def test_functions_of_a_model_with_time_want_the_step():
    model, law = growth(), (np.zeros((1, 1)), np.ones((1, 1, 1)))
    for use in (
        lambda: linearised(model).predict(*law),
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


def with_meter(formula):
    return Model.define("0.9*x + 0.3*v", f"{formula} + 0.5*w", prior={"mean": 0.4})


SMOOTH_ENOUGH = {"Abs(x)": -1.0, "(x if x < 1 else 1)": 1.0, "Piecewise((x, x < 1), (2*x - 1, True))": 1.0, "x*Abs(x)": 1.4}
JUMPS = ["sign(x)", "Heaviside(x - 1)", "(x if x < 1 else 2)", "Piecewise((x, x < 1), (x**2, x < 2), (1, True))"]


@pytest.mark.parametrize(("formula", "slope"), SMOOTH_ENOUGH.items())
def test_a_kink_can_be_linearised(formula, slope):
    at = -0.5 if slope == -1 else 0.7
    found = linearised(with_meter(formula)).measure(np.array([[at]]), np.ones((1, 1, 1)))
    assert found.G.item() == pytest.approx(slope)


@pytest.mark.parametrize("formula", JUMPS)
def test_a_jump_is_refused_with_the_reason_where_it_cannot_be_used(formula):
    model = with_meter(formula)
    with pytest.raises(NoClosedForm, match="not differentiable and cannot be linearised"):
        linearised(model)


def test_the_reason_is_told_in_the_formulas_of_the_model():
    with pytest.raises(NoClosedForm, match=r"term 1/\(x\*\*2 \+ 1\) in 8\*cos\(6\*k/5\) \+ v"):
        gaussian(growth())


@pytest.mark.parametrize("formula", [*JUMPS, *SMOOTH_ENOUGH])
def test_where_there_is_no_closed_form_sampling_and_regressions_do(formula):
    """Against the exact posterior on a grid at the first step: particles; the DUOF is the best affine function."""
    model = with_meter(formula)
    with pytest.raises(NoClosedForm):
        gaussian(model)
    x, y = simulate(model, 20_000, 1, seed=1)
    grid = np.linspace(-6, 7, 4001)
    _, meter = compile_model(model)
    signal = np.broadcast_to(meter(grid[:, None], np.zeros((4001, 1))), (4001, 1))[:, 0]
    few = y[0, :20, 0]
    weight = np.exp(-0.5 * (grid - 0.4) ** 2 - 2 * (few[:, None] - signal) ** 2)
    expected = (weight @ grid) / weight.sum(axis=1)
    found = run(particle(model, 20_000), y[:, :20]).mean[0, :, 0]
    np.testing.assert_allclose(found, expected, atol=5 / np.sqrt(20_000 / 10))
    fitted = design([duof(model)], Ensemble(model, 20_000, 1, seed=1))[0]
    slope, offset = np.polyfit(y[0, :, 0], x[0, :, 0], 1)
    np.testing.assert_allclose(run(fitted, y).mean[0, :, 0], offset + slope * y[0, :, 0], rtol=1e-6, atol=1e-9)


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
    """Derivatives of 1 if v > 0 else -1 are 0 almost everywhere, but it is not a constant, and no filter may take it for one."""
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
    x, y = simulate(model, 200_000, 2, seed=1)
    mean, variance = model.prior.mean, model.prior.cov
    found = gauss_hermite(model, 60)  # the error of a rule at a jump is the weight of a point, 0.05 at most here
    tau, theta = found.predict(mean, variance)
    h, _, F, _ = found.measure(mean, variance)
    for moment, sample in ((tau, x[1].mean()), (theta, x[1].var()), (h, y[0].mean()), (F, y[0].var())):
        assert np.squeeze(moment) == pytest.approx(sample, abs=0.15)


@pytest.mark.parametrize("build", [linearised, gaussian, unscented])
def test_a_choice_between_noises_by_the_step_is_one_of_constants(build):
    chosen = Model.define("0.9*x + (2*v if k < 2 else x*v)", "x + (w if 1 <= k < 3 else 3*w + x**2)")
    for k in range(4):
        plain = build(Model.define("0.9*x + " + ("2*v" if k < 2 else "x*v"), "x + " + ("w" if 1 <= k < 3 else "3*w + x**2")))
        law = np.array([[0.3]]), np.array([[[0.7]]])
        now = build(chosen).at(k)
        if build is unscented:  # a noise that is only added at some steps gets points at all
            np.testing.assert_allclose(now.predict(*law).mean, plain.predict(*law).mean, rtol=1e-12)
            continue
        for one, other in zip(
            (*now.predict(*law), *now.measure(*law)), (*plain.predict(*law), *plain.measure(*law)), strict=True
        ):
            np.testing.assert_allclose(*np.broadcast_arrays(one, other), rtol=1e-12, atol=1e-14)
