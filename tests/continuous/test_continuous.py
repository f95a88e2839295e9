"""Continuous time: simulation against closed forms, the filter against slow loops, exact
discretisation, python-control."""

import math
from dataclasses import replace

import control
import numpy as np
import oracles
import pytest
import sympy as sp
from numpy.testing import assert_allclose

from kfcourse import FormulaError, Gaussian, ModelError, NotFinite, linearised, predictions, run
from kfcourse.continuous import (
    ContinuousModel,
    extended_kalman_bucy,
    linear_matrices,
    simulate,
    steady_state,
    symmetrised_drift,
    to_discrete,
)
from kfcourse.filters import aof
from kfcourse.symbolic.equations import compile_model

N_VECTOR = [[0.3, 0.1], [0.1, 0.2]]
S_VECTOR = [[0.8, 0.2], [0.2, 0.5]]


def ornstein_uhlenbeck():
    """dx/dt = -a x + s xi, y = h x + n; stationary variance s^2 S_xi / (4 a)."""
    a, s, S = 0.7, 1.3, 0.9
    prior, values = {"variance": s**2 * S / (4 * a)}, {"a": a, "s": s, "h": 1.5}
    densities = {"spectral_density": S, "noise_density": 0.4}
    return ContinuousModel.define("-a*x", "s", "h*x", values, prior=prior, **densities)


def oscillator():
    """A damped oscillator, both components seen through a mixing meter with correlated noises:
    linear, nothing unit."""
    return ContinuousModel.define(
        ["x2", "-k*x1 - c*x2 + 0.1"],
        [["0.2", "0"], ["0.1", "s"]],
        ["x1 + 0.3*x2", "0.8*x2 - 0.2"],
        {"k": 2.0, "c": 0.4, "s": 1.2},
        prior={"mean": [0.5, -0.3], "variance": [[0.6, 0.1], [0.1, 0.9]]},
        spectral_density=S_VECTOR,
        noise_density=N_VECTOR,
    )


def nonlinear_vector():
    """Two states, two correlated measurements, everything nonlinear."""
    return ContinuousModel.define(
        ["sin(x2)", "-a*x1 - x2**3/5"],
        [["0.3", "0.1*x1"], ["0.2*x2", "0.5"]],
        ["x1 + 0.4*x1*x2", "cos(x2) + 0.3*x1**2"],
        {"a": 0.8},
        prior={"mean": [0.6, -0.5], "variance": [[0.3, 0.05], [0.05, 0.2]]},
        spectral_density=S_VECTOR,
        noise_density=N_VECTOR,
    )


LAWS = {
    "prior": {"mean": 0.4, "variance": 0.3},
    "spectral_density": 1.6,
    "noise_density": 0.5,
}


def parabola():
    return ContinuousModel.define(
        "-a*x + b*x**2",
        "s*(1 + x/4)",
        "x + k*x**2/2",
        {"a": 1.1, "b": 0.1, "s": 0.8, "k": 0.7},
        **LAWS,
    )


# --- simulation


def test_simulated_moments_are_those_of_the_ornstein_uhlenbeck_process():
    """Variance, covariance at a distance, and the variance of y_k, within 4 standard errors.

    Step 1/400: the scheme's own variance is larger by the factor 1 / (1 - a dt / 2), 1e-3, a tenth
    of a standard error.
    """
    runs, T, substeps, a, q, h = 20_000, 0.5, 200, 0.7, 1.3**2 * 0.9 / 2, 1.5
    path = simulate(ornstein_uhlenbeck(), T, 3, runs, 5, substeps)
    variance, decay = q / (2 * a), math.exp(-a * T)
    for k in range(4):
        oracles.has_moments(path.x[k], [0], np.array([[variance]]))
    oracles.is_mean(variance * decay, path.x[1] * path.x[2])
    # the mean of x over an interval has the variance q/(2a) * 2 (e^-aT - 1 + aT) / (aT)^2
    mean_variance = variance * 2 * (decay - 1 + a * T) / (a * T) ** 2
    expected = h**2 * mean_variance + 0.4 / (2 * T)
    oracles.has_moments(path.y[1], [0], np.array([[expected]]))
    # noises of successive measurements are independent: only the state correlates them
    oracles.is_mean(h**2 * variance * ((1 - decay) / (a * T)) ** 2, path.y[0] * path.y[1])


def test_multiplicative_noise_is_taken_in_itos_sense():
    """dx/dt = a x + s x xi: the mean is x0 e^{at} in Ito's sense, x0 e^{(a + s^2 S_xi / 4) t} in
    the symmetrised one."""
    a, s, S, runs, T = -0.3, 0.6, 1.4, 40_000, 1.0
    model = ContinuousModel.define(
        "a*x", "s*x", "x", {"a": a, "s": s}, prior={"mean": 2, "variance": 0.0}, spectral_density=S
    )
    x = simulate(model, T, 1, runs, 8, substeps=100).x[1, :, 0]
    # Euler's own mean is 2 (1 + a T / 100)^100, 2 e^{aT} but for 5e-4 of it: a sixth of a standard
    # error
    oracles.is_mean(2 * math.exp(a * T), x)
    error = x.std() / math.sqrt(runs)
    assert abs(x.mean() - 2 * math.exp((a + s**2 * S / 4) * T)) > 20 * error
    x_, xi = sp.symbols("x xi", real=True)
    extra = symmetrised_drift(
        sp.Matrix([a * x_ + s * x_ * xi]), [x_], [xi], sp.Matrix([[sp.Float(S) / 2]])
    )
    assert abs(float(extra[0].subs(x_, 1.7)) - s**2 * 1.7 * S / 4) < 1e-14


def test_correlated_noises_have_their_covariances():
    """One short step from a known state: increments of x and values of y are normal with known
    covariances."""
    runs, T = 50_000, 0.01
    model = nonlinear_vector()
    still = replace(model, prior=Gaussian(model.prior.mean, np.zeros((2, 2))))
    path = simulate(still, T, 1, runs, 3)
    g = np.array([[0.3, 0.06], [-0.1, 0.5]])
    for sample, cov in (
        (path.x[1] - path.x[0], g @ np.array(S_VECTOR) @ g.T * T / 2),
        (path.y[0], np.array(N_VECTOR) / (2 * T)),
    ):
        oracles.has_moments(sample, sample.mean(axis=0), cov)


def test_a_coarse_path_is_the_same_path():
    """substeps draw the same numbers as a fine path, and coarsening it gives the same: equal but
    for the order of a sum."""
    model = nonlinear_vector()
    fine = simulate(model, 0.01, 24, 5, 4)
    coarse = simulate(model, 0.06, 4, 5, 4, substeps=6)
    means = fine.y.reshape(4, 6, 5, 2).mean(axis=1)
    assert np.allclose(fine.x[::6], coarse.x, rtol=1e-13, atol=0)
    assert np.allclose(means, coarse.y, rtol=1e-12, atol=1e-12)


def test_an_explosion_is_reported():
    model = ContinuousModel.define("x**3", "1", "x", prior={"mean": 5})
    with pytest.raises(NotFinite, match=r"step \d+, time .*substeps"):
        simulate(model, 0.1, 100, 4, 1)


# --- the filter against a slow loop


@pytest.mark.parametrize("second", [False, True])
def test_the_filter_is_the_page(second):
    """The equations of the docstring with explicit inverses and loops, derivatives by hand."""
    T, steps, runs = 0.01, 40, 3
    model = nonlinear_vector()
    y = simulate(model, T, steps, runs, 6).y
    y[3, 0, 1] = y[5:9, 1, 0] = y[9, 2] = np.nan
    ours = predictions(extended_kalman_bucy(model, T, second), y)
    N, identity = np.array(N_VECTOR), np.eye(2)
    for r in range(runs):
        z, D = np.array([0.6, -0.5]), np.array([[0.3, 0.05], [0.05, 0.2]])
        for k in range(steps):
            assert np.allclose(ours.mean[k, r], z, rtol=1e-10, atol=1e-11)  # rounding of 40 steps
            assert np.allclose(ours.cov[k, r], D, rtol=1e-10, atol=1e-11)
            x1, x2 = z
            f, A = (
                np.array([math.sin(x2), -0.8 * x1 - x2**3 / 5]),
                np.array([[0, math.cos(x2)], [-0.8, -0.6 * x2**2]]),
            )
            g = np.array([[0.3, 0.1 * x1], [0.2 * x2, 0.5]])
            S = np.array([x1 + 0.4 * x1 * x2, math.cos(x2) + 0.3 * x1**2])
            H = np.array([[1 + 0.4 * x2, 0.4 * x1], [0.6 * x1, -math.sin(x2)]])
            hessians = np.array([[[0, 0.4], [0.4, 0]], [[0.6, 0], [0, -math.cos(x2)]]])
            seen = ~np.isnan(y[k, r])
            H, hessians, innovation = H[seen], hessians[seen], (y[k, r] - S)[seen]
            C = 2 * np.linalg.inv(N[np.ix_(seen, seen)])
            B = np.linalg.inv(np.linalg.inv(D) + T * H.T @ C @ H)
            # with a component missing, the second derivatives are left out
            W = second * seen.all() * np.einsum("i,iab", C @ innovation, hessians)
            V = second * seen.all() * np.einsum("ij,iab,bc,jcd", C, hessians, B, hessians)
            M = np.linalg.inv(identity + T / 8 * B @ V) @ (identity + T / 2 * B @ W)
            z = z + T * (f + B @ H.T @ C @ innovation)
            D = (M + T * A) @ B @ (M + T * A).T + T * g @ np.array(S_VECTOR) @ g.T / 2


# --- functions of time


def varying():
    """Linear, and everything depends on time: a decay that swings, a noise that dies down, a meter
    that fades in and out."""
    return ContinuousModel.define(
        "-(a + sin(2*t))*x + cos(t)",
        "0.5 + exp(-t)",
        "(1 + 0.8*cos(3*t))*x",
        {"a": 0.7},
        prior={"mean": 1.5, "variance": 2.0},
        spectral_density=0.9,
        noise_density=0.4,
    )


def test_the_discrete_model_has_its_functions_at_the_times_of_its_steps():
    """f, g, S at t_k = k T; its Kalman filter has the same covariances."""
    T, x, v, w = 0.25, np.array([[0.7]]), np.array([[-0.4]]), np.array([[1.1]])
    state, meter = compile_model(to_discrete(varying(), T))
    for k in (0, 3):
        t = k * T
        following = x + T * (-(0.7 + math.sin(2 * t)) * x + math.cos(t) + (0.5 + math.exp(-t)) * v)
        assert_allclose(state(x, v, k), following, rtol=1e-14)
        assert_allclose(meter(x, w, k), (1 + 0.8 * math.cos(3 * t)) * x + w, rtol=1e-14)
    y = simulate(varying(), 0.02, 100, 5, 4).y
    ours = run(extended_kalman_bucy(varying(), 0.02), y)
    discrete = run(aof(linearised(to_discrete(varying(), 0.02))), y)
    assert_allclose(ours.cov, discrete.cov, rtol=0, atol=1e-12)


def test_names_of_the_time():
    """t is the time unless it names something else; the number of a step means nothing here."""
    assert varying().time == sp.Symbol("t", real=True)
    assert parabola().time is None
    assert ContinuousModel.define("-t*x", "1", "x", {"t": 2}).time is None
    assert ContinuousModel.define("-t", "1", "t", symbols=["t"]).time is None
    with pytest.raises(FormulaError, match="unknown symbol 'k'"):
        ContinuousModel.define("-k*x", "1", "x")
    with pytest.raises(ModelError, match="depends on the time t"):
        steady_state(varying())


@pytest.mark.parametrize("make", [ornstein_uhlenbeck, oscillator])
def test_steady_state_is_that_of_python_control(make):
    model = make()
    A, G, H = linear_matrices(model)
    L, P, _ = control.lqe(A, G, H, model.spectral_density / 2, model.noise_density / 2)
    steady = steady_state(model)
    # two solvers of the same equation, well conditioned
    assert np.allclose(steady.cov, P, rtol=1e-10, atol=1e-12)
    assert np.allclose(steady.gain, L, rtol=1e-10, atol=1e-12)


# --- as a filter among the others


def test_names_that_the_filter_uses_itself():
    """Parameters and states called z, D, y, v, w, xi change nothing."""
    plain = parabola()
    named = ContinuousModel.define(
        "-z*D + y*D**2",
        "v*(1 + D/4)",
        "D + w*D**2/2",
        {"z": 1.1, "y": 0.1, "v": 0.8, "w": 0.7},
        symbols=["D"],
        **LAWS,
    )
    y = simulate(plain, 0.05, 10, 3, 2).y
    assert np.array_equal(simulate(named, 0.05, 10, 3, 2).y, y)
    a, b = (run(extended_kalman_bucy(model, 0.05, True), y) for model in (plain, named))
    assert np.allclose(a.mean, b.mean, rtol=1e-13) and np.allclose(a.cov, b.cov, rtol=1e-13)


def test_a_lost_filter_is_named():
    """A drift that outgrows the state, and measurements that hardly tell of it."""
    model = ContinuousModel.define("x**3", "1", "0.001*x", prior={"mean": 5})
    with pytest.raises(
        NotFinite,
        match=r"step \d+, time .*kalman-bucy-second became infinite in 50 of 50 runs; take a "
        r"smaller step",
    ):
        run(extended_kalman_bucy(model, 0.1, True), np.zeros((100, 50, 1)))


# --- input


@pytest.mark.parametrize(
    ("arguments", "settings", "message"),
    [
        (("-x", "1", "x"), {"noise_density": 0}, "positive definite"),
        (("-x", "1", "x"), {"spectral_density": [1, 2]}, "spectral_density"),
        ((["x2", "-x1"], "1", "x1"), {}, r"1 row\(s\) of diffusion"),
        (("-x", "1", "2"), {}, "does not depend on the state"),
        (("-x/(a - b)", "1", "x", {"a": 1, "b": 1}), {}, "no finite real value"),
    ],
)
def test_bad_models(arguments, settings, message):
    with pytest.raises(ModelError, match=message):
        ContinuousModel.define(*arguments, **settings)


@pytest.mark.parametrize("use", [to_discrete, extended_kalman_bucy])
def test_bad_steps(use):
    for step in (-0.1, float("nan")):
        with pytest.raises(ValueError, match="step must be positive and finite"):
            use(parabola(), step)


RATES = (0.5, 7.0)


def test_no_steady_state():
    with pytest.raises(ModelError, match="not linear"):
        steady_state(parabola())
    with pytest.raises(ModelError, match="not linear"):  # multiplicative noise
        steady_state(ContinuousModel.define("-x", "x", "x"))
    for drift, diffusion, signal in (
        (["x1", "-x2"], [["1"], ["1"]], ["x2"]),  # grows unseen
        (["-x1", "0"], [["1"], ["0"]], ["x2"]),  # neither noise nor decay
        (["0"], [["0"]], ["x"]),  # the same: D falls as 1/t
        (["x2", "0"], [["1"], ["0"]], ["x1"]),  # a constant velocity
        # the closed loop has a root at 0, which is found to rounding: -3e-18 is no decay
        *(([f"-{r}*x1 + x2", "0"], [["1"], ["0"]], ["x1"]) for r in RATES),
        *((["-x1 + x3", f"-{r}*x2", "0"], [["1"], ["1"], ["0"]], ["x1", "x2"]) for r in RATES),
    ):
        with pytest.raises(ValueError, match="no stabilising solution"):
            steady_state(ContinuousModel.define(drift, diffusion, signal))
