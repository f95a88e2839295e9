"""Answers of sets a to e as a student would type them, without the package; with arguments that make them wrong."""

import numpy as np


def T(matrix):
    return np.swapaxes(matrix, -1, -2)


def times(matrix, vector):
    return (matrix @ vector[..., None])[..., 0]


def kalman_gain(Psi, G, F):
    return T(np.linalg.solve(F, G @ Psi))


def corrected(lam, Psi, h, G, F, y):
    K = kalman_gain(Psi, G, F)
    return lam + times(K, y - h), Psi - K @ G @ Psi


def b2(gain=kalman_gain, innovation=lambda y, h: y - h, cov=lambda Psi, K, G: Psi - K @ G @ Psi):
    def answer(lam, Psi, h, G, F, y):
        K = gain(Psi, G, F)
        return lam + times(K, innovation(y, h)), cov(Psi, K, G)

    return answer


def b3(change):
    """A step; `change` gets lam, Psi, z, p and returns what is predicted from."""

    def answer(lam, Psi, y, measure, predict):
        z, p = corrected(lam, Psi, *measure(lam, Psi), y)
        return z, p, *change(lam, Psi, z, p, predict)

    return answer


def predicts_first(lam, Psi, y, measure, predict):
    lam, Psi = predict(lam, Psi)
    z, p = corrected(lam, Psi, *measure(lam, Psi), y)
    return z, p, lam, Psi


def b4(first=False, returns="z", frozen=False, missing=np.nan, sign=1, shrink=True):
    def answer(y, mean, cov, measure, predict):
        N = y.shape[1]
        lam, Psi = np.tile(mean, (N, 1)), np.tile(cov, (N, 1, 1))
        if first:
            lam, Psi = predict(lam, Psi)
        found = []
        for y_k in y:
            gone = np.isnan(y_k)[:, 0]
            if not np.isnan(missing):
                y_k, gone = np.where(np.isnan(y_k), missing, y_k), np.zeros(N, dtype=bool)
            h, G, F = measure(lam, Psi)
            K = kalman_gain(Psi, G, F)
            z = np.where(gone[:, None], lam, lam + sign * times(K, np.nan_to_num(y_k) - h))
            p = np.where(gone[:, None, None], Psi, Psi - K @ G @ Psi if shrink else Psi)
            found.append(z if returns == "z" else lam)
            lam, following = predict(z, p)
            Psi = Psi if frozen else following
        return np.array(found)

    return answer


def covariance(a, b, centred=True):
    if centred:
        a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    return a.T @ b / len(a)


def regression(t, r, centred=True, offset=True, ridge=0.0, biased=1.0, residual=None):
    cross, own = covariance(t, r, centred), covariance(r, r, centred) * biased + ridge * np.eye(r.shape[1])
    A = cross @ np.linalg.pinv(own)
    shift = t.mean(axis=0) - A @ r.mean(axis=0) if offset else t.mean(axis=0)
    whole = covariance(t, t)
    rest = whole - A @ covariance(t, r).T
    return A, shift, {None: rest, "whole": whole, "n-1": rest * len(t) / (len(t) - 1)}[residual]


def c3(fit=regression, target=lambda x, lam: x - lam, base=lambda lam: lam, alpha=lambda a, z, lam: a(z)):
    def answer(lam, x, y, x_next, a, b):
        omega = y - b(lam)
        H, e, _ = fit(target(x, lam), omega)
        z = base(lam) + omega @ H.T + e
        F, g, _ = fit(x_next, alpha(a, z, lam))
        return z, alpha(a, z, lam) @ F.T + g

    return answer


def c4(part=None, one_gain=False, offset=True, returns="z"):
    def answer(x, y_design, y, mean, a, b):
        x, y_design = x[:, :part], y_design[:, :part]
        lam, other = np.tile(mean, (x.shape[1], 1)), np.tile(mean, (y.shape[1], 1))
        found = []
        for k in range(len(x)):
            if k == 0 or not one_gain:
                H, e, _ = regression(x[k] - lam, y_design[k] - b(lam))
            z = lam + (y_design[k] - b(lam)) @ H.T + e
            estimate = other + (y[k] - b(other)) @ H.T + (e if offset else 0)
            found.append({"z": estimate, "lam": other, "-z": -estimate}[returns])
            if k + 1 < len(x):
                F, g, _ = regression(x[k + 1], a(z))
                lam, other = a(z) @ F.T + g, a(estimate) @ F.T + g
        return np.array(found)

    return answer


def condition(x, z, fit=regression):
    A, shift, T_ = fit(x, z)
    return z @ A.T + shift, T_


def d2(condition=condition, choose=lambda u, T, z, p: (u, T)):
    def answer(lam, Psi, x, y, measure, predict):
        z, p = corrected(lam, Psi, *measure(lam, Psi), y)
        mean, cov = choose(*condition(x, z), z, p)
        return z, *predict(mean, np.broadcast_to(cov, Psi.shape))

    return answer


def d3(fit=regression, correct=True, predicted=True, target=lambda x, lam: x - lam, own=False):
    def answer(lam, Psi, x, y, x_next, measure, predict):
        z, p = corrected(lam, Psi, *measure(lam, Psi), y)
        sigma = z - lam
        if correct:
            H, e, _ = fit(target(x, lam), sigma)
            z = lam + sigma @ H.T + e
        u, T_ = condition(x, z)
        s, Psi_next = predict(u, p if own else np.broadcast_to(T_, Psi.shape))
        if predicted:
            F, g, _ = fit(x_next, s)
            s = s @ F.T + g
        return z, s, Psi_next

    return answer


def square(x, z):
    return ((x - z) ** 2).sum(axis=2)


def error(values, ddof=1):
    return values.std(axis=1, ddof=ddof) / np.sqrt(values.shape[1])


def partial_regression(**options):
    return lambda t, r: regression(t, r, **options)
