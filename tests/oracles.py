"""Slow reference code, written straight from the pages and independent of the package's
computations."""

from typing import ClassVar

import numpy as np
import sympy as sp

from kfcourse import Model


def regression(target, *regressors):
    """Affine least squares: (matrix, offset, residual variance) by Cov(t, r) Cov(r)^+."""
    rows = np.stack(regressors)
    joint = np.cov(np.vstack([target, rows]), bias=True)
    matrix = joint[0, 1:] @ np.linalg.pinv(joint[1:, 1:], hermitian=True)
    offset = np.mean(target) - matrix @ np.mean(rows, axis=1)
    return matrix, offset, joint[0, 0] - matrix @ joint[1:, 0]


def is_mean(expected, sample):
    """The sample's mean is the expected one, within four of its own standard errors: one chance in
    16,000."""
    sample = np.asarray(sample, dtype=float)
    assert abs(sample.mean() - expected) < 4 * sample.std() / np.sqrt(sample.size)


def has_moments(sample, mean, cov):
    """Whether draws (N, n) have this mean and covariance, as `is_mean` asks."""
    away = sample - mean
    for i in range(len(cov)):
        is_mean(mean[i], sample[:, i])
        for j in range(i + 1):
            is_mean(cov[i, j], away[:, i] * away[:, j])


def gaussian_points(mean, cov, order: int = 40):
    """Points (N, n) and weights (N,) of a Gauss-Hermite product rule for N(mean, cov)."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(order)
    grids = np.meshgrid(*[nodes] * len(mean), indexing="ij")
    each = np.meshgrid(*[weights / weights.sum()] * len(mean), indexing="ij")
    standard = np.stack([grid.ravel() for grid in grids], axis=-1)
    return mean + standard @ np.linalg.cholesky(cov).T, np.prod(each, axis=0).ravel()


def gaussian_mean(function, mean, cov):
    """M[function(x)], x ~ N(mean, cov); function takes a list of components."""
    points, weights = gaussian_points(np.array(mean), np.array(cov))
    return float(weights @ function(list(points.T)))


def mixture(weights, laws):
    """Mean and covariance of a mixture of laws (mean, cov)."""
    mean = sum(w * m for w, (m, _) in zip(weights, laws, strict=True))
    spread = (P + np.outer(m - mean, m - mean) for m, P in laws)
    return mean, sum(w * P for w, P in zip(weights, spread, strict=True))


def executed(formula, symbols, values):
    """A printed formula at values of its symbols, arrays (N, rows, columns) of matrices and (N,) of
    numbers: by SymPy's own code for each of N."""
    names = [
        sp.MatrixSymbol(f"M{i}", *each.shape[1:]) if each.ndim > 1 else sp.Symbol(f"a{i}")
        for i, each in enumerate(values)
    ]
    function = sp.lambdify(names, formula.xreplace(dict(zip(symbols, names, strict=True))), "numpy")
    return np.array([function(*row) for row in zip(*values, strict=True)])


def steps_of(system, count):
    """(A, constant, Q, H, constant, R) of the first steps of x' = A x + B v + a, y = H x + C w + b,
    with matrices `system.at` and laws `system.laws`: what the two references below take."""
    _, (m_v, D_v), (m_w, D_w) = system.laws.values()
    return [
        (A, B @ m_v + a, B @ D_v @ B.T, H, C @ m_w + b, C @ D_w @ C.T)
        for A, B, a, H, C, b in map(system.at, range(count))
    ]


def kalman_loop(steps, prior, y):
    """Predicted and posterior law (mean, cov) at each step of one record y (N, p), NaN where
    missing: the page's equations, with inverses.

    `steps`: for each k (A, a, Q, H, b, R) of x' = A x + a + v, y = H x + b + w.
    """
    mean, cov = prior
    for (A, a, Q, H, b, R), measured in zip(steps, y, strict=True):
        predicted, seen = (mean, cov), ~np.isnan(measured)
        H, R = H[seen], R[np.ix_(seen, seen)]
        K = cov @ H.T @ np.linalg.inv(H @ cov @ H.T + R)
        mean, cov = mean + K @ (measured - b)[seen] - K @ H @ mean, cov - K @ H @ cov
        yield predicted, (mean, cov)
        mean, cov = A @ mean + a, A @ cov @ A.T + Q


def joint_posterior(steps, prior, y):
    """Means (N, n), covariances (N, n, n) of a linear model's states given a record, and its log
    density, by one regression.

    `steps`: for each k (A, a, Q, H, b, R) of x' = A x + a + v, y = H x + b + w; y (N, p), NaN where
    missing.  All states are linear functions of x_0 and the noises; the joint law of states and
    measurements is written down, and conditioned once.
    """
    m, P = prior
    n, size = len(m), len(steps)
    means, covs = [m], np.zeros((size * n, size * n))
    covs[:n, :n] = P
    for k, (A, a, Q, *_) in enumerate(steps[:-1]):
        done, new = slice(0, (k + 1) * n), slice((k + 1) * n, (k + 2) * n)
        means.append(A @ means[-1] + a)
        covs[new, done] = A @ covs[k * n : (k + 1) * n, done]
        covs[done, new] = covs[new, done].T
        covs[new, new] = A @ covs[k * n : (k + 1) * n, k * n : (k + 1) * n] @ A.T + Q
    mean = np.concatenate(means)
    rows = [(k, i) for k in range(size) for i in range(y.shape[1]) if not np.isnan(y[k, i])]
    H, noise = np.zeros((len(rows), size * n)), np.zeros((len(rows), len(rows)))
    for r, (k, i) in enumerate(rows):
        H[r, k * n : (k + 1) * n] = steps[k][3][i]
        for s, (j, other) in enumerate(rows):
            noise[r, s] = steps[k][5][i, other] if j == k else 0.0
    residual = np.array([y[k, i] - steps[k][4][i] for k, i in rows]) - H @ mean
    F = H @ covs @ H.T + noise
    K = np.linalg.solve(F, H @ covs).T
    mean, cov = mean + K @ residual, covs - K @ H @ covs
    log_density = -0.5 * (
        residual @ np.linalg.solve(F, residual) + np.linalg.slogdet(2 * np.pi * F).logabsdet
    )
    blocks = [slice(k * n, (k + 1) * n) for k in range(size)]
    return np.array([mean[b] for b in blocks]), np.array([cov[b, b] for b in blocks]), log_density


def as_tables(laws):
    """Laws (mean, covariance) by name as a model takes them."""
    return {key: {"mean": mean, "variance": cov} for key, (mean, cov) in laws.items()}


class Changing:
    """A linear model whose matrices, constants and noises change with time and input; as text, and
    as arrays typed apart."""

    # each step another: one too early or too late is seen
    U = (0.7, -2.0, 3.0, 0.0, 1.5, -1.0, 0.4, -0.6, 2.2, 1.1)
    laws: ClassVar = {
        "prior": (np.array([1.0, -0.5]), np.array([[1.0, 0.3], [0.3, 0.8]])),
        "state_noise": (np.array([0.2, -0.1]), np.array([[0.5, 0.1], [0.1, 0.3]])),
        "meter_noise": (np.array([0.1, 0.3]), np.array([[0.4, 0.1], [0.1, 0.6]])),
    }

    def at(self, k: int):
        t, u = 0.5 * k, self.U[k]
        A = np.array([[0.9 + 0.1 * np.sin(k), 0.2], [0.1, 0.8 - 0.05 * k]])
        C = np.diag([2.0 if t < 1 else 1.0, 1.0])
        H, b = np.array([[1.0, 0.1 * k], [0.0, 1.0]]), np.array([u**2, np.cos(t)])
        return A, np.array([[1 + t, 0.0], [1.0, 0.5]]), np.array([u, -2 * u]), H, C, b

    def steps(self, count: int):
        return steps_of(self, count)

    def model(self) -> Model:
        state = [
            "(0.9 + 0.1*sin(k))*x1 + 0.2*x2 + (1 + t)*v1 + u",
            "0.1*x1 + (0.8 - 0.05*k)*x2 + 0.5*v2 - 2*u + v1",
        ]
        meter = ["x1 + 0.1*k*x2 + (2 if t < 1 else 1)*w1 + u**2", "x2 + w2 + cos(t)"]
        laws = as_tables(self.laws)
        return Model.define(state, meter, inputs={"u": self.U}, interval=0.5, **laws)
