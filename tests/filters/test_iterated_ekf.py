"""The iterated filter: Gauss and Newton's method, posterior linearisation, and the Kalman filter where nothing is curved."""

import re

import numpy as np
import pytest
import sympy as sp

from kfcourse.filters import notation as s
from kfcourse.filters.iterated_ekf import EQUATIONS, iterated
from kfcourse.montecarlo.ensemble import simulate
from kfcourse.montecarlo.experiment import run
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.quadrature import unscented
from kfcourse.symbolic.structure import linearised

PRIOR_MEAN, PRIOR_COV = np.array([3.0, 1.0]), np.array([[0.9, 0.3], [0.3, 0.6]])
NOISE = np.array([[0.04, 0.01], [0.01, 0.05]])


@pytest.fixture(scope="module")
def ranges() -> Model:
    """Range and a product, both curved over the prior; correlated noises."""
    return Model.define(
        ["x1 + 0.2*x2 + 0.1*v1", "0.9*x2 + 0.2*sin(x1) + 0.1*v2"], ["sqrt(x1**2 + x2**2) + w1", "x1*x2 + w2"],
        prior={"mean": PRIOR_MEAN, "variance": PRIOR_COV}, meter_noise={"variance": NOISE},
    )  # fmt: skip


def meter(x):
    return np.array([np.hypot(*x), x[0] * x[1]])


def jacobian(x):
    return np.array([x / np.hypot(*x), [x[1], x[0]]])


# ---------------------------------------------------------------- linearised: Gauss-Newton


def gauss_newton(y, rounds):
    """Gauss-Newton for the MAP in the information form, one measurement, plain NumPy."""
    x = PRIOR_MEAN
    for _ in range(rounds):
        H, inverse = jacobian(x), np.linalg.inv(NOISE)
        information = np.linalg.inv(PRIOR_COV) + H.T @ inverse @ H
        slope = H.T @ inverse @ (y - meter(x)) + np.linalg.inv(PRIOR_COV) @ (PRIOR_MEAN - x)
        x = x + np.linalg.solve(information, slope)
    return x, np.linalg.inv(information)


def measured(model, runs, seed):
    """First measurements (1, runs, 2)."""
    return simulate(model, runs, 1, seed=seed).y


@pytest.mark.parametrize("rounds", [1, 2, 3, 6])
def test_each_round_is_a_step_of_gauss_and_newton(ranges, rounds):
    y = measured(ranges, 6, seed=4)
    found = run(iterated(linearised(ranges), rounds), y)
    for i in range(6):
        mean, cov = gauss_newton(y[0, i], rounds)
        # a few rounds of 2 x 2 solutions with condition below 1e3
        np.testing.assert_allclose(found.mean[0, i], mean, rtol=1e-10)
        np.testing.assert_allclose(found.cov[0, i], cov, rtol=1e-9, atol=1e-12)


# ---------------------------------------------------------------- moments: posterior linearisation


def sigma_points(mean, cov):
    """Symmetric points of Julier and Uhlmann with kappa = max(3 - s, 0): any root with root root^T = cov."""
    size = len(mean)
    kappa = max(3 - size, 0)
    values, vectors = np.linalg.eigh(cov)
    root = vectors * np.sqrt(values)
    offsets = [np.zeros(size)] + [sign * np.sqrt(size + kappa) * root[:, j] for j in range(size) for sign in (1, -1)]
    weights = [kappa / (size + kappa)] + [0.5 / (size + kappa)] * (2 * size)
    return [mean + offset for offset in offsets], weights


@pytest.mark.parametrize("rounds", [2, 5])
def test_with_sigma_points_it_is_iterated_posterior_linearisation(rounds):
    """A scalar state measured twice, the noise added: the loop of Garcia-Fernandez and others, their letters."""
    noise, prior_mean, prior_cov = np.array([[0.04, 0.01], [0.01, 0.09]]), np.array([1.2]), np.array([[0.5]])
    model = Model.define(
        "0.9*x + 0.1*v",
        ["x + 0.3*x**2 + w1", "exp(x/2) + w2"],
        {},
        prior={"mean": 1.2, "variance": 0.5},
        meter_noise={"variance": noise},
    )
    y = measured(model, 5, seed=7)
    found = run(iterated(unscented(model), rounds), y)
    for i in range(5):
        mean, cov = prior_mean, prior_cov
        for _ in range(rounds):
            # points over (x, w): the package's rule
            joint = np.block([[cov, np.zeros((1, 2))], [np.zeros((2, 1)), noise]])
            points, weights = sigma_points(np.concatenate([mean, np.zeros(2)]), joint)
            images = [np.array([q[0] + 0.3 * q[0] ** 2 + q[1], np.exp(q[0] / 2) + q[2]]) for q in points]
            y_bar = sum(w * image for w, image in zip(weights, images, strict=True))
            Psi = sum(w * np.outer(q[:1] - mean, image - y_bar) for w, q, image in zip(weights, points, images, strict=True))
            Phi = sum(w * np.outer(image - y_bar, image - y_bar) for w, image in zip(weights, images, strict=True))
            A = Psi.T @ np.linalg.inv(cov)
            b = y_bar - A @ mean
            Omega = Phi - A @ cov @ A.T
            S = A @ prior_cov @ A.T + Omega
            K = prior_cov @ A.T @ np.linalg.inv(S)
            mean, cov = prior_mean + K @ (y[0, i] - A @ prior_mean - b), prior_cov - K @ S @ K.T
        # the page's Omega and p are differences of numbers some 1e2 times larger, in each round
        np.testing.assert_allclose(found.mean[0, i], mean, rtol=1e-10)
        np.testing.assert_allclose(found.cov[0, i], cov, rtol=1e-9)


def test_the_printed_equations_are_the_filter(ranges):
    y, rounds = measured(ranges, 1, seed=8), 3
    structure = linearised(ranges)
    values = {s.y: y[0, 0][:, None], s.lam: PRIOR_MEAN[:, None], s.Psi: PRIOR_COV}
    z_i, P_i = (symbol(name) for name in (r"z^{(i)}", r"p^{(i)}"))
    values |= {z_i: values[s.lam], P_i: values[s.Psi]}
    for _ in range(rounds):
        measurement = structure.measure(values[z_i][:, 0], values[P_i])
        values |= {symbol("h("): measurement.h[:, None], symbol("G("): measurement.G, symbol("F("): measurement.F}
        for equation in EQUATIONS:
            arguments = sorted(equation.rhs.atoms(sp.MatrixSymbol), key=str)
            dummies = [sp.MatrixSymbol(f"M{j}", *argument.shape) for j, argument in enumerate(arguments)]
            function = sp.lambdify(dummies, equation.rhs.xreplace(dict(zip(arguments, dummies, strict=True))), "numpy")
            values[equation.lhs] = function(*(values[argument] for argument in arguments))
        values |= {z_i: values[symbol(r"z^{(i+1)}")], P_i: values[symbol(r"p^{(i+1)}")]}
    found = run(iterated(structure, rounds), y)
    # the printed forms lose a few digits where the meter is sharper than the prior
    np.testing.assert_allclose(found.mean[0, 0], values[z_i][:, 0], rtol=1e-10)
    np.testing.assert_allclose(found.cov[0, 0], values[P_i], rtol=1e-9, atol=1e-12)


def symbol(start):
    """The symbol of the printed equations whose LaTeX starts so."""
    every = set().union(*(q.lhs.atoms(sp.MatrixSymbol) | q.rhs.atoms(sp.MatrixSymbol) for q in EQUATIONS))
    (one,) = [q for q in every if re.sub(r"^\{(.*)\}$", r"\1", q.name).startswith(start)]
    return one


# ---------------------------------------------------------------- missing measurements, shapes, errors


@pytest.mark.parametrize("iterations", [0, -1, 1.5, 2.0, True, "3", None, float("nan")])
def test_rounds_that_are_no_number_of_rounds_are_refused(ranges, iterations):
    with pytest.raises(ValueError, match="iterations must be a whole number, at least 1"):
        iterated(linearised(ranges), iterations)
