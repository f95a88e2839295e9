"""Continuous time: simulation against closed forms, the filter against slow loops, exact
discretisation, python-control."""

import math
from itertools import pairwise

import control
import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
import sympy as sp

from kfcourse.continuous import (
    ContinuousModel,
    Path,
    extended_kalman_bucy,
    filter_equations,
    linear_matrices,
    log_likelihood_rate,
    simulate,
    steady_state,
    symmetrised_drift,
    to_discrete,
)
from kfcourse.filters import aof
from kfcourse.laws import Gaussian
from kfcourse.montecarlo.designing import NotFinite
from kfcourse.montecarlo.experiment import predictions, run
from kfcourse.symbolic.equations import compile_model
from kfcourse.symbolic.formula import FormulaError
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import linearised

pytestmark = pytest.mark.quick


def coarsen(path, factor):
    """The same trajectories seen with a step `factor` times as long: every factor-th state, means
    of the measurements."""
    y = path.y.reshape(-1, factor, *path.y.shape[1:]).mean(axis=1)
    return Path(path.step * factor, path.x[::factor], y)


N_VECTOR = [[0.3, 0.1], [0.1, 0.2]]
S_VECTOR = [[0.8, 0.2], [0.2, 0.5]]


def ornstein_uhlenbeck(**changes):
    """dx/dt = -a x + s xi, y = h x + n; stationary variance s^2 S_xi / (4 a)."""
    a, s, S = 0.7, 1.3, 0.9
    settings = {
        "prior": {"variance": s**2 * S / (4 * a)},
        "spectral_density": S,
        "noise_density": 0.4,
    } | changes
    return ContinuousModel.define("-a*x", "s", "h*x", {"a": a, "s": s, "h": 1.5}, **settings)


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


def parabola(**changes):
    settings = {
        "prior": {"mean": 0.4, "variance": 0.3},
        "spectral_density": 1.6,
        "noise_density": 0.5,
    } | changes
    return ContinuousModel.define(
        "-a*x + b*x**2",
        "s*(1 + x/4)",
        "x + k*x**2/2",
        {"a": 1.1, "b": 0.1, "s": 0.8, "k": 0.7},
        **settings,
    )


# --- simulation
# -------------------------------------------------------------------------------------------------------------


def test_simulated_moments_are_those_of_the_ornstein_uhlenbeck_process():
    """Variance, covariance at a distance, and the variance of y_k, within 4 standard errors.

    Step 1/400: the scheme's own variance is larger by the factor 1 / (1 - a dt / 2), 1e-3, a tenth
    of a standard error.
    """
    runs, T, substeps, a, q, h = 20_000, 0.5, 200, 0.7, 1.3**2 * 0.9 / 2, 1.5
    path = simulate(ornstein_uhlenbeck(), T, 3, runs, 5, substeps)
    variance, decay = q / (2 * a), math.exp(-a * T)
    for k in range(4):
        assert abs(np.mean(path.x[k] ** 2) - variance) < 4 * variance * math.sqrt(2 / runs)
        assert abs(np.mean(path.x[k])) < 4 * math.sqrt(variance / runs)
    lag = path.x[1, :, 0] * path.x[2, :, 0]
    assert abs(np.mean(lag) - variance * decay) < 4 * variance * math.sqrt((1 + decay**2) / runs)
    # the mean of x over an interval has the variance q/(2a) * 2 (e^-aT - 1 + aT) / (aT)^2
    mean_variance = variance * 2 * (decay - 1 + a * T) / (a * T) ** 2
    expected = h**2 * mean_variance + 0.4 / (2 * T)
    assert abs(np.mean(path.y[1] ** 2) - expected) < 4 * expected * math.sqrt(2 / runs)
    # noises of successive measurements are independent: only the state correlates them
    cross = h**2 * variance * ((1 - decay) / (a * T)) ** 2
    assert abs(np.mean(path.y[0] * path.y[1]) - cross) < 4 * math.sqrt(
        (expected**2 + cross**2) / runs
    )


def test_multiplicative_noise_is_taken_in_itos_sense():
    """dx/dt = a x + s x xi: the mean is x0 e^{at} in Ito's sense, x0 e^{(a + s^2 S_xi / 4) t} in
    the symmetrised one."""
    a, s, S, runs, T = -0.3, 0.6, 1.4, 40_000, 1.0
    model = ContinuousModel.define(
        "a*x", "s*x", "x", {"a": a, "s": s}, prior={"mean": 2, "variance": 0.0}, spectral_density=S
    )
    x = simulate(model, T, 1, runs, 8, substeps=100).x[1, :, 0]
    error = x.std() / math.sqrt(runs)
    # Euler's own mean is 2 (1 + a T / 100)^100, 2 e^{aT} but for 5e-4 of it: a sixth of a standard
    # error
    assert abs(x.mean() - 2 * math.exp(a * T)) < 4 * error
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
    still = ContinuousModel.define(
        list(model.drift),
        model.diffusion,
        list(model.signal),
        {"a": 0.8},
        prior={"mean": [0.6, -0.5], "variance": 0.0},
        spectral_density=S_VECTOR,
        noise_density=N_VECTOR,
    )
    path = simulate(still, T, 1, runs, 3)
    g = np.array([[0.3, 0.06], [-0.1, 0.5]])
    for sample, cov in (
        (path.x[1] - path.x[0], g @ np.array(S_VECTOR) @ g.T * T / 2),
        (path.y[0], np.array(N_VECTOR) / (2 * T)),
    ):
        found = np.cov(sample.T)
        error = np.sqrt((np.outer(np.diag(cov), np.diag(cov)) + cov**2) / runs)
        assert (abs(found - cov) < 4 * error).all()


def test_a_coarse_path_is_the_same_path():
    """substeps draw the same numbers as a fine path, and coarsening it gives the same: equal but
    for the order of a sum."""
    model = nonlinear_vector()
    fine = simulate(model, 0.01, 24, 5, 4)
    coarse = simulate(model, 0.06, 4, 5, 4, substeps=6)
    seen = coarsen(fine, 6)
    assert seen.step == pytest.approx(0.06)
    assert np.allclose(seen.x, coarse.x, rtol=1e-13, atol=0)
    assert np.allclose(seen.y, coarse.y, rtol=1e-12, atol=1e-12)
    for k in range(4):  # straight from the definition
        assert np.array_equal(seen.x[k], fine.x[6 * k])
        assert np.allclose(
            seen.y[k], sum(fine.y[6 * k + i] for i in range(6)) / 6, rtol=0, atol=1e-13
        )
    twice = coarsen(coarsen(fine, 2), 3)
    assert np.array_equal(twice.x, seen.x) and np.allclose(twice.y, seen.y, rtol=0, atol=1e-13)


def test_an_explosion_is_reported():
    model = ContinuousModel.define("x**3", "1", "x", prior={"mean": 5})
    with pytest.raises(NotFinite, match=r"step \d+, time .*substeps"):
        simulate(model, 0.1, 100, 4, 1)


# --- the discrete model
# -----------------------------------------------------------------------------------------------------


def test_the_discrete_model_is_eulers():
    model, T = parabola(), 0.05
    discrete = to_discrete(model, T)
    (x,), (v,), (w,) = discrete.x, discrete.v, discrete.w
    a, b, s, k = sp.symbols("a b s k", real=True)
    step = sp.Rational(1, 20)
    assert (
        sp.expand(
            discrete.state_equation[0] - (x + step * (-a * x + b * x**2 + s * (1 + x / 4) * v))
        )
        == 0
    )
    assert sp.expand(discrete.meter_equation[0] - (x + k * x**2 / 2 + w)) == 0
    assert discrete.state_noise.cov.item() == pytest.approx(1.6 / (2 * T))
    assert discrete.meter_noise.cov.item() == pytest.approx(0.5 / (2 * T))
    assert discrete.prior == model.prior


def test_the_discrete_limit_of_the_covariance_equation():
    """(Theta of the linearised discrete model after its correction - D) / T tends to the Riccati
    rate, the error falls as T."""
    model = oscillator()
    A, G, H = linear_matrices(model)
    D = np.array([[0.5, -0.1], [-0.1, 0.7]])
    rate = (
        A @ D
        + D @ A.T
        + G @ np.array(S_VECTOR) @ G.T / 2
        - D @ H.T @ np.linalg.inv(np.array(N_VECTOR) / 2) @ H @ D
    )
    errors = []
    for T in (2e-3, 1e-3):
        structure = linearised(to_discrete(model, T))
        m = structure.measure(np.zeros(2), D)
        corrected = D - D @ m.G.T @ np.linalg.inv(m.F) @ m.G @ D
        errors.append(np.abs((structure.predict(np.zeros(2), corrected).cov - D) / T - rate).max())
    assert errors[0] < 0.1 * np.abs(rate).max()
    # c T + d T^2: the ratio is 2 but for a term of order T
    assert 1.9 < errors[0] / errors[1] < 2.1


# --- formulas
# ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("make", [parabola, nonlinear_vector, oscillator])
def test_derivatives_against_finite_differences(make):
    """u and U are the derivatives of F, computed here in plain NumPy from the formulas' values.

    Central differences with the step e = 1e-4: their error is e^2 F''' ~ 1e-7 and 1e-16 F / e^2 ~
    1e-7; 1e-5 is far above.
    """
    model = make()
    e = filter_equations(model)
    y = np.linspace(0.7, 1.1, model.p)
    z = np.linspace(0.3, -0.4, model.n)
    S = sp.lambdify([list(model.x)], list(model.signal.subs(model.values)), "math")
    information = np.linalg.inv(model.noise_density)

    def F(x):
        value = np.array(S(list(x)), dtype=float)
        return 2 * value @ information @ (y - value / 2)

    at = dict(zip([*e.z, *e.y], [*z, *y], strict=True)) | model.values
    h, unit = 1e-4, np.eye(model.n)
    u = np.array(e.u.subs(at), dtype=float)[:, 0]
    U = np.array(e.U.subs(at), dtype=float)
    assert abs(float(e.F.subs(at)) - F(z)) < 1e-12
    for i in range(model.n):
        assert abs(u[i] - (F(z + h * unit[i]) - F(z - h * unit[i])) / (2 * h)) < 1e-5
        for j in range(model.n):
            a, b = h * unit[i], h * unit[j]
            second = (F(z + a + b) - F(z + a - b) - F(z - a + b) + F(z - a - b)) / (4 * h**2)
            assert abs(U[i, j] - second) < 1e-5


def test_linear_signal_leaves_the_riccati_term():
    model = oscillator()
    full, usual = filter_equations(model), filter_equations(model, second_derivatives=False)
    N = sp.Matrix(
        [[sp.Rational(3, 10), sp.Rational(1, 10)], [sp.Rational(1, 10), sp.Rational(1, 5)]]
    )
    H = sp.Matrix([[1, sp.Rational(3, 10)], [0, sp.Rational(4, 5)]])
    assert (full.U + 2 * H.T * N.inv() * H).applyfunc(sp.simplify) == sp.zeros(2, 2)
    assert (full.U - usual.U).applyfunc(sp.simplify) == sp.zeros(2, 2)


def test_the_log_likelihood_rate_completes_the_square():
    """F = y^T N^-1 y - (y - S)^T N^-1 (y - S)."""
    S, y = sp.Matrix(sp.symbols("S1 S2")), sp.Matrix(sp.symbols("y1 y2"))
    N = sp.Matrix([[2, 1], [1, 3]])
    square = ((y - S).T * N.inv() * (y - S))[0]
    assert sp.expand(log_likelihood_rate(S, y, N) - (y.T * N.inv() * y)[0] + square) == 0


# --- the filter against slow loops
# ------------------------------------------------------------------------------------------

SIGNALS = {  # S and its first three derivatives, by hand
    "x + 0.7*x**2/2": (
        lambda x: x + 0.35 * x * x,
        lambda x: 1 + 0.7 * x,
        lambda x: 0.7,
        lambda x: 0.0,
    ),
    "2*sin(x)": (
        lambda x: 2 * math.sin(x),
        lambda x: 2 * math.cos(x),
        lambda x: -2 * math.sin(x),
        lambda x: -2 * math.cos(x),
    ),
}


@pytest.mark.parametrize("signal", SIGNALS)
@pytest.mark.parametrize(
    ("second", "symmetrised"), [(False, False), (True, False), (True, True), (False, True)]
)
def test_the_scalar_filter_is_the_loop_in_plain_floats(signal, second, symmetrised):
    T, N, S_xi, steps, runs = 0.01, 0.5, 1.6, 60, 3
    model = ContinuousModel.define(
        "-1.1*x + 0.1*x**2",
        "0.8 + 0.2*x",
        signal,
        prior={"mean": 0.4, "variance": 0.3},
        spectral_density=S_xi,
        noise_density=N,
    )
    y = simulate(model, T, steps, runs, 2).y
    found = predictions(extended_kalman_bucy(model, T, second, symmetrised), y)
    S, S1, S2, S3 = SIGNALS[signal]
    for r in range(runs):
        z, D = 0.4, 0.3
        for k in range(steps):
            # rounding of 60 steps
            assert math.isclose(found.mean[k, r, 0], z, rel_tol=1e-11, abs_tol=1e-12)
            assert math.isclose(found.cov[k, r, 0, 0], D, rel_tol=1e-11)
            innovation = y[k, r, 0] - S(z)
            B = 1 / (1 / D + T * S1(z) ** 2 * 2 / N)
            M, dz, dD = 1.0, 0.0, 0.0
            if second:
                W, V = S2(z) * 2 / N * innovation, S2(z) ** 2 * 2 / N * B
                M = (1 + T * B * W / 2) / (1 + T * B * V / 8)
            if symmetrised:
                dz = B**2 * S1(z) * S2(z) / N * (2 if second else 1)
                dD = B**3 * (2 * S2(z) ** 2 + S1(z) * S3(z)) / N if second else 0.0
            A, Q = -1.1 + 0.2 * z, (0.8 + 0.2 * z) ** 2 * S_xi / 2
            z = z + T * (-1.1 * z + 0.1 * z**2 + B * S1(z) * 2 / N * innovation + dz)
            D = (M + T * A) ** 2 * B + T * (Q + dD)


def test_the_vector_filter_is_the_page():
    """The equations of the docstring with explicit inverses and loops, derivatives by hand."""
    T, steps, runs = 0.01, 40, 3
    model = nonlinear_vector()
    y = simulate(model, T, steps, runs, 6).y
    found = predictions(extended_kalman_bucy(model, T, second_derivatives=True), y)
    C = 2 * np.linalg.inv(np.array(N_VECTOR))
    identity = np.eye(2)
    for r in range(runs):
        z, D = np.array([0.6, -0.5]), np.array([[0.3, 0.05], [0.05, 0.2]])
        for k in range(steps):
            assert np.allclose(found.mean[k, r], z, rtol=1e-10, atol=1e-11)  # rounding of 40 steps
            assert np.allclose(found.cov[k, r], D, rtol=1e-10, atol=1e-11)
            x1, x2 = z
            f, A = (
                np.array([math.sin(x2), -0.8 * x1 - x2**3 / 5]),
                np.array([[0, math.cos(x2)], [-0.8, -0.6 * x2**2]]),
            )
            g = np.array([[0.3, 0.1 * x1], [0.2 * x2, 0.5]])
            S = np.array([x1 + 0.4 * x1 * x2, math.cos(x2) + 0.3 * x1**2])
            H = np.array([[1 + 0.4 * x2, 0.4 * x1], [0.6 * x1, -math.sin(x2)]])
            hessians = np.array([[[0, 0.4], [0.4, 0]], [[0.6, 0], [0, -math.cos(x2)]]])
            innovation = y[k, r] - S
            B = np.linalg.inv(np.linalg.inv(D) + T * H.T @ C @ H)
            W = sum((C @ innovation)[i] * hessians[i] for i in range(2))
            V = sum(C[i, j] * hessians[i] @ B @ hessians[j] for i in range(2) for j in range(2))
            M = np.linalg.inv(identity + T / 8 * B @ V) @ (identity + T / 2 * B @ W)
            z = z + T * (f + B @ H.T @ C @ innovation)
            D = (M + T * A) @ B @ (M + T * A).T + T * g @ np.array(S_VECTOR) @ g.T / 2


@pytest.mark.parametrize("symmetrised", [False, True])
def test_the_white_term_has_the_mean_that_its_sense_demands(symmetrised):
    """Over the white noise of y, (Mean[p'] - p) / T is the rate of dD/dt, plus in the symmetrised
    sense its correction.

    p' is the covariance after the correction; the mean over the two normal noises is Gauss-Hermite
    quadrature (9 x 9 points, exact for polynomials of degree 17).  What is left is of the order T:
    halving T halves it.
    """
    model = nonlinear_vector()
    e = filter_equations(model)
    at = dict(zip(e.z, model.prior.mean, strict=True)) | {
        e.D[i, j]: model.prior.cov[i, j] for i in range(2) for j in range(2)
    }
    S = np.array(e.S.subs(at | model.values), dtype=float)[:, 0]
    at |= dict(zip(e.y, S, strict=True)) | model.values
    D, J = model.prior.cov, -np.array(e.U.subs(at), dtype=float)
    rate_cov, rate_mean = -D @ J @ D, np.zeros(2)
    if symmetrised:
        N = sp.Matrix(N_VECTOR)
        extra = np.array(
            symmetrised_drift(e.rates, e.state, list(e.y), N / 2).subs(at), dtype=float
        )[:, 0]
        rate_mean, rate_cov = (
            extra[:2],
            rate_cov + np.array([[extra[2], extra[3]], [extra[3], extra[4]]]),
        )
    nodes, weights = np.polynomial.hermite_e.hermegauss(9)
    pairs = np.array([[a, b] for a in nodes for b in nodes])
    weight = np.array([a * b for a in weights for b in weights]) / weights.sum() ** 2
    left = []
    for T in (2e-4, 1e-4):
        one = extended_kalman_bucy(model, T, True, symmetrised)
        y = S + pairs @ np.linalg.cholesky(np.array(N_VECTOR) / (2 * T)).T
        posterior = one.step(one.init(len(y)), y).posterior
        left.append(np.abs((np.tensordot(weight, posterior.cov, 1) - D) / T - rate_cov).max())
        assert np.abs(
            (weight @ posterior.mean - model.prior.mean) / T - rate_mean
        ).max() < 0.01 * max(1, np.abs(rate_mean).max())
    assert left[0] < 0.02 * np.abs(rate_cov).max()
    assert 1.7 < left[0] / left[1] < 2.3


# --- linear models
# ----------------------------------------------------------------------------------------------------------


def exact_filter(model, T, y):
    """The Kalman filter of y_k = (1/T) Integral y dt, not approximated: van Loan's discretisation
    of (x, Integral H x dt)."""
    A, G, H = linear_matrices(model)
    f0 = np.array(model.drift.subs(model.values).subs(dict.fromkeys(model.x, 0)), dtype=float)[:, 0]
    S0 = np.array(model.signal.subs(model.values).subs(dict.fromkeys(model.x, 0)), dtype=float)[
        :, 0
    ]
    n, p = model.n, model.p
    F = np.zeros((n + p + 1, n + p + 1))  # x, integral of the signal, the constant 1
    F[:n, :n], F[:n, -1], F[n : n + p, :n], F[n : n + p, -1] = A, f0, H, S0
    Q = np.zeros_like(F)
    Q[:n, :n] = G @ model.spectral_density @ G.T / 2
    size = len(F)
    loan = scipy.linalg.expm(T * np.block([[-F, Q], [np.zeros_like(F), F.T]]))
    transition = loan[size:, size:].T
    noise = transition @ loan[:size, size:]
    meter, R = np.hstack([np.zeros((p, n)), np.eye(p) / T]), model.noise_density / (2 * T)
    z, D = np.tile(model.prior.mean, (y.shape[1], 1)), model.prior.cov
    means, covs = [z], [D]
    for measured in y:
        start = np.hstack([z, np.zeros((len(z), p)), np.ones((len(z), 1))])
        mean = (start @ transition.T)[:, :-1]
        cov = (transition[:-1, :n] @ D @ transition[:-1, :n].T) + noise[:-1, :-1]
        K = cov @ meter.T @ np.linalg.inv(meter @ cov @ meter.T + R)
        mean, cov = mean + (measured - mean @ meter.T) @ K.T, cov - K @ meter @ cov
        z, D = mean[:, :n], cov[:n, :n]
        means.append(z)
        covs.append(D)
    return np.array(means), np.array(covs)


@pytest.mark.parametrize("make", [ornstein_uhlenbeck, oscillator])
def test_the_filter_of_a_linear_model_tends_to_the_exact_one(make):
    """The same trajectories seen with T = 1/25, 1/50, 1/100: covariances and estimates come nearer
    in proportion to T.

    Covariances have the error c T + d T^2, so the ratio is near 2; for the root mean square of the
    estimates over 200 runs the statistical error of the ratio is below 2 / sqrt(2 * 200) = 0.1.
    """
    model = make()
    fine = simulate(model, 0.0025, 800, 200, 3)
    rms, worst = [], []
    for factor in (16, 8, 4):
        path = coarsen(fine, factor)
        found = run(extended_kalman_bucy(model, path.step), path.y)
        means, covs = exact_filter(model, path.step, path.y)
        rms.append(np.sqrt(np.mean((found.mean - means[1:]) ** 2)))
        worst.append(np.abs(found.cov[:, 0] - covs[1:]).max())
    for errors in (rms, worst):
        for coarse, half in pairwise(errors):
            assert 1.6 < coarse / half < 2.4
    assert rms[-1] < 0.02 * np.sqrt(np.mean(means**2))


def test_the_scalar_riccati_equation_has_its_closed_form():
    """dD/dt = -2 a D + q - c D^2: D(t) by the hyperbolic tangent; the scheme's error halves with
    the step."""
    a, q, c, D0 = 0.7, 1.3**2 * 0.9 / 2, 1.5**2 * 2 / 0.4, 3.0
    model = ornstein_uhlenbeck(prior={"variance": D0})
    root = math.sqrt(a * a + c * q)
    errors = []
    for T in (0.02, 0.01):
        steps = round(1 / T)
        D = predictions(extended_kalman_bucy(model, T), np.zeros((steps, 1, 1))).cov[:, 0, 0, 0]
        t = T * np.arange(steps)
        tanh = np.tanh(root * t)
        exact = (D0 * (root - a * tanh) + q * tanh) / (root + (a + c * D0) * tanh)
        errors.append(np.abs(D - exact).max())
    assert 1.6 < errors[0] / errors[1] < 2.4  # the first steps from D0 = 3 are far from linear in T
    assert errors[1] < 0.1


# --- functions of time
# ------------------------------------------------------------------------------------------------------


def varying(**changes):
    """Linear, and everything depends on time: a decay that swings, a noise that dies down, a meter
    that fades in and out."""
    settings = {
        "prior": {"mean": 1.5, "variance": 2.0},
        "spectral_density": 0.9,
        "noise_density": 0.4,
    } | changes
    return ContinuousModel.define(
        "-(a + sin(2*t))*x + cos(t)",
        "0.5 + exp(-t)",
        "(1 + 0.8*cos(3*t))*x",
        {"a": 0.7},
        **settings,
    )


def varying_moments(times):
    """Mean and variance of `varying` without measurements, and the error variance of its optimal
    filter: ODEs of the page."""

    def rates(t, moments):
        mean, variance, D = moments
        A, q, H = (
            -(0.7 + math.sin(2 * t)),
            (0.5 + math.exp(-t)) ** 2 * 0.9 / 2,
            1 + 0.8 * math.cos(3 * t),
        )
        return [
            A * mean + math.cos(t),
            2 * A * variance + q,
            2 * A * D + q - (H * D) ** 2 * 2 / 0.4,
        ]

    return scipy.integrate.solve_ivp(
        rates, (0, times[-1]), [1.5, 2.0, 2.0], t_eval=times, rtol=1e-10, atol=1e-12
    ).y


def test_the_covariance_of_a_time_varying_model_solves_its_riccati_equation():
    """The scheme's error halves with the step; D itself swings between 0.1 and 0.3 after its start
    from 2."""
    errors = []
    for T in (0.02, 0.01, 0.005):
        steps = round(4 / T)
        D = predictions(extended_kalman_bucy(varying(), T), np.zeros((steps, 1, 1))).cov[:, 0, 0, 0]
        exact = varying_moments(T * np.arange(steps))[2]
        errors.append(np.abs(D - exact)[round(0.5 / T) :].max())
    for coarse, half in pairwise(errors):
        assert 1.6 < coarse / half < 2.4
    assert errors[-1] < 0.01


def test_the_discrete_model_has_its_functions_at_the_times_of_its_steps():
    """f, g, S at t_k = k T; its Kalman filter has the same covariances, and estimates that differ
    in proportion to T: f is taken at the corrected estimate instead of the predicted one."""
    T, x, v, w = 0.25, np.array([[0.7]]), np.array([[-0.4]]), np.array([[1.1]])
    state, meter = compile_model(to_discrete(varying(), T))
    for k in (0, 3):
        t = k * T
        following = x + T * (-(0.7 + math.sin(2 * t)) * x + math.cos(t) + (0.5 + math.exp(-t)) * v)
        np.testing.assert_allclose(state(x, v, k), following, rtol=1e-14)
        np.testing.assert_allclose(meter(x, w, k), (1 + 0.8 * math.cos(3 * t)) * x + w, rtol=1e-14)
    fine, apart = simulate(varying(), 0.005, 400, 200, 4), []
    for factor in (4, 2):
        path = coarsen(fine, factor)
        one = run(extended_kalman_bucy(varying(), path.step), path.y)
        two = run(aof(linearised(to_discrete(varying(), path.step))), path.y)
        np.testing.assert_allclose(one.cov, two.cov, rtol=0, atol=1e-12)
        apart.append(np.sqrt(np.mean((one.mean - two.mean) ** 2)))
    assert 1.6 < apart[0] / apart[1] < 2.4


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
    found = steady_state(model)
    # two solvers of the same equation, well conditioned
    assert np.allclose(found.cov, P, rtol=1e-10, atol=1e-12)
    assert np.allclose(found.gain, L, rtol=1e-10, atol=1e-12)
    residual = (
        A @ found.cov
        + found.cov @ A.T
        + G @ model.spectral_density @ G.T / 2
        - found.gain @ H @ found.cov
    )
    assert np.abs(residual).max() < 1e-12


# --- as a filter among the others
# -------------------------------------------------------------------------------------------


def test_the_continuous_and_the_discrete_extended_filter_come_together():
    """On the same data their difference is small beside the error itself, and falls with the step
    (by 2 or more for T / 4)."""
    model = parabola()
    fine = simulate(model, 0.0025, 400, 300, 5)
    differences = []
    for factor in (16, 4, 1):
        path = coarsen(fine, factor)
        continuous = predictions(extended_kalman_bucy(model, path.step), path.y)
        discrete = predictions(aof(linearised(to_discrete(model, path.step))), path.y)
        differences.append(np.sqrt(np.mean((continuous.mean - discrete.mean) ** 2)))
    error = np.sqrt(np.mean((continuous.mean - fine.x[:-1]) ** 2))
    assert differences[0] > 2 * differences[1] > 4 * differences[2]
    assert differences[2] < 0.01 * error


def test_a_missing_measurement_corrects_nothing():
    model = parabola()
    for how in ((False, False), (True, False), (True, True)):
        one = extended_kalman_bucy(model, 0.05, *how)
        y = np.array([[[0.8], [np.nan]]])
        both, alone = run(one, y), run(one, y[:, :1])
        assert np.array_equal(both.mean[:, :1], alone.mean) and np.array_equal(
            both.cov[:, :1], alone.cov
        )
        z, D = model.prior.mean[0], model.prior.cov[0, 0]
        after = one.step(one.init(2), y[0])
        assert after.posterior.mean[1, 0] == z and math.isclose(
            after.posterior.cov[1, 0, 0], D, rel_tol=1e-15
        )
        q = (0.8 * (1 + z / 4)) ** 2 * 1.6 / 2
        assert math.isclose(
            after.predicted.mean[1, 0], z + 0.05 * (-1.1 * z + 0.1 * z**2), rel_tol=1e-14
        )
        assert math.isclose(
            after.predicted.cov[1, 0, 0],
            (1 + 0.05 * (-1.1 + 0.2 * z)) ** 2 * D + 0.05 * q,
            rel_tol=1e-14,
        )


def test_a_missing_component_is_a_smaller_meter():
    """Independent noises: without its second component the meter is the one with the first
    alone."""
    both = ContinuousModel.define(
        ["x2", "-x1"], [["0"], ["1"]], ["x1", "x2"], noise_density=[0.3, 0.5]
    )
    first = ContinuousModel.define(["x2", "-x1"], [["0"], ["1"]], ["x1"], noise_density=0.3)
    y = simulate(both, 0.05, 10, 4, 1).y
    without = y.copy()
    without[..., 1] = np.nan
    a, b = (
        run(extended_kalman_bucy(both, 0.05), without),
        run(extended_kalman_bucy(first, 0.05), y[..., :1]),
    )
    assert np.allclose(a.mean, b.mean, rtol=1e-12, atol=1e-13) and np.allclose(
        a.cov, b.cov, rtol=1e-12, atol=1e-13
    )


def test_names_that_the_filter_uses_itself():
    """Parameters and states called z, D, y, v, w, xi change nothing."""
    plain = parabola()
    named = ContinuousModel.define(
        "-z*D + y*D**2",
        "v*(1 + D/4)",
        "D + w*D**2/2",
        {"z": 1.1, "y": 0.1, "v": 0.8, "w": 0.7},
        symbols=["D"],
        prior={"mean": 0.4, "variance": 0.3},
        spectral_density=1.6,
        noise_density=0.5,
    )
    y = simulate(plain, 0.05, 10, 3, 2).y
    assert np.array_equal(simulate(named, 0.05, 10, 3, 2).y, y)
    a, b = (run(extended_kalman_bucy(model, 0.05, True, True), y) for model in (plain, named))
    assert np.allclose(a.mean, b.mean, rtol=1e-13) and np.allclose(a.cov, b.cov, rtol=1e-13)


def test_a_lost_filter_is_named():
    """Where the log-likelihood curves upwards the symmetrised reading has no finite solution."""
    model = ContinuousModel.define(
        "-x", "1", "3*cos(x)", prior={"variance": 2}, spectral_density=4, noise_density=0.1
    )
    y = simulate(model, 0.01, 200, 50, 1).y
    with pytest.raises(
        NotFinite,
        match=r"step \d+, time .*kalman-bucy-second-symmetrised became .* of 50 runs; take a "
        r"smaller step",
    ):
        run(extended_kalman_bucy(model, 0.01, True, True), y)


def test_a_negative_covariance_is_an_error():
    """At z = 0 of a sine the symmetrised sense adds -B^3 / N to dD/dt.  Here B = 4.8, T B^3 / N =
    10.8."""
    model = ContinuousModel.define("-x", "1", "sin(x)", prior={"variance": 100}, noise_density=0.1)
    with pytest.raises(NotFinite, match=r"step 0, time 0.01: .* negative in 3 of 3 runs"):
        run(extended_kalman_bucy(model, 0.01, True, True), np.zeros((1, 3, 1)))


# --- input
# ------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "settings", "message"),
    [
        (("-x", "1", "x"), {"noise_density": 0}, "positive definite"),
        (("-x", "1", "x"), {"noise_density": -1}, "negative variance"),
        (("-x", "1", "x"), {"noise_density": float("nan")}, "finite"),
        (("-x", "1", "x"), {"spectral_density": -0.1}, "negative variance"),
        (("-x", "1", "x"), {"spectral_density": [1, 2]}, "spectral_density"),
        (("-x", "1", "x"), {"prior": {"variance": -1}}, "negative variance"),
        (("-x", "1", "x"), {"symbols": ["a", "b"]}, "one each"),
        (("-x", "1", "x", {"x": 2}), {}, "named twice"),
        ((["x2", "-x1"], "1", "x1"), {}, r"1 row\(s\) of diffusion"),
        ((["x2", "-x1"], ["0", "1"], "x1"), {}, "list of rows"),
        ((["x2", "-x1"], [["0"], ["1", "2"]], "x1"), {}, "different lengths"),
        (("-x", "1", "2"), {}, "does not depend on the state"),
        (("-x/(a - b)", "1", "x", {"a": 1, "b": 1}), {}, "no finite real value"),
        (("-x", 3.5, "x"), {}, "diffusion"),
        (("-x", "1", ["x", "x"]), {"noise_density": [[1, 0.5], [0.4, 1]]}, "symmetric"),
    ],
)
def test_bad_models(arguments, settings, message):
    with pytest.raises(ModelError, match=message):
        ContinuousModel.define(*arguments, **settings)


def test_bad_formulas_point_at_the_place():
    with pytest.raises(FormulaError, match="unknown symbol 'b'"):
        ContinuousModel.define("-b*x", "1", "x")
    with pytest.raises(FormulaError, match="unknown symbol 'xi'"):
        ContinuousModel.define("-x + xi", "1", "x")


@pytest.mark.parametrize("step", [0, -0.1, float("nan"), float("inf"), "0.1", True, None])
def test_bad_steps(step):
    model = parabola()
    for use in (
        lambda: to_discrete(model, step),
        lambda: simulate(model, step, 1, 1, 0),
        lambda: extended_kalman_bucy(model, step),
    ):
        with pytest.raises(ValueError, match="positive number of time units"):
            use()


@pytest.mark.parametrize("bad", [{"steps": 0}, {"runs": 1.5}, {"substeps": -1}, {"runs": True}])
def test_bad_sizes(bad):
    with pytest.raises(ValueError, match=f"{next(iter(bad))} must be a positive whole number"):
        simulate(parabola(), 0.1, **({"steps": 2, "runs": 2, "seed": 0} | bad))


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
    ):
        with pytest.raises(ValueError, match="no stabilising solution"):
            steady_state(ContinuousModel.define(drift, diffusion, signal))


@pytest.mark.parametrize("rate", [0.1, 0.3, 0.5, 0.7, 1.0, 1.3, 2.0, 3.0, 5.0, 7.0])
def test_a_constant_that_is_seen_better_and_better_has_no_steady_state(rate):
    """The closed loop has a root at 0, which is found to rounding, on either side: -3e-18 is no
    decay."""
    for drift, noises, signal in (
        ([f"-{rate}*x1 + x2", "0"], [["1"], ["0"]], ["x1"]),
        (["-x1 + x3", f"-{rate}*x2", "0"], [["1"], ["1"], ["0"]], ["x1", "x2"]),
    ):
        with pytest.raises(ValueError, match="no stabilising solution"):
            steady_state(ContinuousModel.define(drift, noises, signal))


def test_measurements_of_the_wrong_shape():
    one = extended_kalman_bucy(oscillator(), 0.1)
    with pytest.raises(ValueError, match="expects 2 measurement"):
        run(one, np.zeros((3, 4, 1)))
    assert isinstance(run(one, np.zeros((3, 4, 2))), Gaussian)
