"""Set h, answers as a student would type them: the right ones pass, the wrong ones are told apart or not named at all."""

import numpy as np
import sympy as sp
from answers import test_no_wrong_kind_of_mistake_is_named, test_right_answers_pass, test_what_cannot_be_compared_is_explained  # noqa: F401


def h2(
    spread=lambda S_xi, T: np.sqrt(S_xi * T / 2),
    meter=lambda N, T: np.sqrt(N / T / 2),
    span=lambda T: T,
    seen="before",
    noise_of_meter=1,
):
    def answer(x, xi, n, T, f, g, S, S_xi, N):
        drifted = x + span(T) * f(x)
        after = drifted + g(x) * spread(S_xi, T) * xi
        return after, S(x if seen == "before" else after) + noise_of_meter * meter(N, T) * n

    return answer


def h2_by_variances(x, xi, n, T, f, g, S, S_xi, N):
    v, w = S_xi / 2 / T, N / 2 / T
    return x + (f(x) + g(x) * v**0.5 * xi) * T, S(x) + w**0.5 * n


def h2_noise_not_shaped(x, xi, n, T, f, g, S, S_xi, N):
    return x + T * f(x) + np.sqrt(S_xi * T / 2) * xi, S(x) + np.sqrt(N / T / 2) * n


def h3(
    drift=lambda A, D: A @ D + (A @ D).T,
    noise=lambda G, Q: G @ (Q / 2) @ G.T,
    taken=lambda D, H, N: D @ H.T @ (2 * np.linalg.inv(N)) @ H @ D,
    sign=-1,
):
    return lambda D, A, G, H, S_xi, N: drift(A, D) + noise(G, S_xi) + sign * taken(D, H, N)


def h4(root=1, S=lambda S_xi: S_xi / 2, R=lambda N: N / 2, square=True, gain=lambda D, h, R: D * h / R, decay=1):
    def answer(a, s, h, S_xi, N):
        q, r = s ** (2 if square else 1) * S(S_xi), R(N)
        D = r / h**2 * (-decay * a + root * sp.sqrt((decay * a) ** 2 + q * h**2 / r))
        return D, gain(D, h, r)

    return answer


def h4_solved(a, s, h, S_xi, N):
    D = sp.Symbol("D", positive=True)
    roots = sp.solve(-2 * a * D + s**2 * S_xi / 2 - D**2 * h**2 * 2 / N, D)
    D = next(root for root in roots if root.subs({a: 1, s: 1, h: 1, S_xi: 1, N: 1}) > 0)
    return D, 2 * D * h / N


def h4_root_forgotten(a, s, h, S_xi, N):
    r = N / 2
    D = r / h**2 * (-a + a**2 + s**2 * S_xi / 2 * h**2 / r)
    return D, D * h / r


def h4_not_twice(a, s, h, S_xi, N):
    c = 2 * h**2 / N
    D = (-2 * a + sp.sqrt(4 * a**2 + 2 * c * s**2 * S_xi)) / c
    return D, D * h * 2 / N


def h4_object_alone(a, s, h, S_xi, N):
    D = s**2 * S_xi / (4 * a)
    return D, D * h * 2 / N


def h5(
    intensity=lambda N: N / 2,
    Q=lambda S_xi: S_xi / 2,
    power=2,
    noise_power=2,
    double=2,
    innovation=lambda y, S, S_x, z: y - S(z),
    gain=lambda D, slope, r: D * slope / r,
    span=lambda T: T,
    sign=-1,
    order="together",
):
    def answer(z, D, y, T, f, f_x, g, S, S_x, S_xi, N):
        r = intensity(N)

        def rate_of_D(z, D):
            return double * f_x(z) * D + g(z) ** noise_power * Q(S_xi) + sign * D**2 * S_x(z) ** power / r

        def rate_of_z(z, D):
            return f(z) + gain(D, S_x(z), r) * innovation(y, S, S_x, z)

        if order == "D first":
            D = D + span(T) * rate_of_D(z, D)
            return z + span(T) * rate_of_z(z, D), D
        new = z + span(T) * rate_of_z(z, D)
        return new, D + span(T) * rate_of_D(new if order == "z first" else z, D)

    return answer


def h6(u=lambda S, S1, y: S1 * (y - S), U=lambda S, S1, S2, y: S2 * (y - S) - S1**2, scale=lambda N: 2 / N):
    def answer(S, x, y, N):
        S1 = S.diff(x)
        return scale(N) * u(S, S1, y), scale(N) * U(S, S1, S1.diff(x), y)

    return answer


def h6_from(F, by="x"):
    def answer(S, x, y, N):
        return sp.diff(F(S, y, N), {"x": x, "y": y}[by]), sp.diff(F(S, y, N), {"x": x, "y": y}[by], 2)

    return answer


RIGHT = [
    ("h1", lambda S_xi, N, T: [0.5 * S_xi / T, 0.5 * N / T]),
    ("h2", h2()),
    ("h2", h2_by_variances),
    ("h3", h3()),
    ("h4", h4()),
    ("h4", h4_solved),
    ("h5", h5()),
    ("h6", h6()),
]

WRONG = [
    ("h1", "one-sided", lambda S_xi, N, T: (S_xi / T, N / T)),
    ("h1", "times-step", lambda S_xi, N, T: (S_xi * T / 2, N * T / 2)),
    ("h1", "deviation", lambda S_xi, N, T: (np.sqrt(S_xi / 2 / T), np.sqrt(N / 2 / T))),
    ("h1", "step-forgotten", lambda S_xi, N, T: (S_xi / 2, N / 2)),
    ("h1", "factor-wrong-way", lambda S_xi, N, T: (2 * S_xi / T, 2 * N / T)),
    ("h1", "times-step", lambda S_xi, N, T: (S_xi * T / 2, N / T / 2)),
    ("h1", "step-squared", lambda S_xi, N, T: (S_xi / (2 * T**2), N / (2 * T**2))),
    ("h1", "times-step", lambda S_xi, N, T: (S_xi / 2 * T, N / 2 * T)),
    ("h1", "swapped", lambda S_xi, N, T: (N / 2 / T, S_xi / 2 / T)),
    ("h2", "one-sided", h2(spread=lambda S_xi, T: np.sqrt(S_xi * T), meter=lambda N, T: np.sqrt(N / T))),
    ("h2", "one-sided", h2(spread=lambda S_xi, T: np.sqrt(S_xi * T))),
    ("h2", "one-sided", h2(meter=lambda N, T: np.sqrt(N / T))),
    ("h2", "mean-for-integral", h2(spread=lambda S_xi, T: np.sqrt(S_xi / 2 / T))),
    ("h2", "noise-times-step", h2(spread=lambda S_xi, T: T * np.sqrt(S_xi / 2))),
    ("h2", "step-forgotten-in-noise", h2(spread=lambda S_xi, T: np.sqrt(S_xi / 2))),
    ("h2", "variance-for-deviation", h2(spread=lambda S_xi, T: S_xi * T / 2)),
    ("h2", "variance-for-deviation", h2(spread=lambda S_xi, T: T * S_xi / (2 * T), meter=lambda N, T: N / (2 * T))),
    ("h2", "integral-for-mean", h2(meter=lambda N, T: np.sqrt(N * T / 2))),
    ("h2", "variance-for-deviation", h2(meter=lambda N, T: N / 2 / T)),
    ("h2", "step-forgotten-in-noise", h2(meter=lambda N, T: np.sqrt(N / 2))),
    ("h2", "step-forgotten-in-drift", h2(span=lambda T: 1)),
    ("h2", "measured-at-end", h2(seen="after")),
    ("h2", "unused", h2(noise_of_meter=0)),
    ("h2", "factor-forgotten", h2_noise_not_shaped),
    ("h3", "one-side-only", h3(drift=lambda A, D: A @ D)),
    ("h3", "discrete", h3(drift=lambda A, D: A @ D @ A.T)),
    ("h3", "transposed", h3(drift=lambda A, D: A.T @ D + D @ A)),
    ("h3", "not-symmetric", h3(drift=lambda A, D: A @ D + A.T @ D)),
    ("h3", "process-one-sided", h3(noise=lambda G, Q: G @ Q @ G.T)),
    ("h3", "noise-forgotten", h3(noise=lambda G, Q: 0)),
    ("h3", "noise-sign", h3(noise=lambda G, Q: -G @ Q @ G.T / 2)),
    ("h3", "meter-one-sided", h3(taken=lambda D, H, N: D @ H.T @ np.linalg.inv(N) @ H @ D)),
    ("h3", "noise-not-inverted", h3(taken=lambda D, H, N: D @ H.T @ (N / 2) @ H @ D)),
    ("h3", "covariance-once", h3(taken=lambda D, H, N: D @ H.T @ (2 * np.linalg.inv(N)) @ H)),
    ("h3", "riccati-sign", h3(sign=1)),
    ("h3", "measurement-forgotten", h3(sign=0)),
    (
        "h3",
        "densities-for-intensities",
        h3(noise=lambda G, Q: G @ Q @ G.T, taken=lambda D, H, N: D @ H.T @ np.linalg.inv(N) @ H @ D),
    ),
    ("h4", "negative-root", h4(root=-1)),
    ("h4", "process-one-sided", h4(S=lambda S_xi: S_xi)),
    ("h4", "meter-one-sided", h4(R=lambda N: N)),
    ("h4", "densities-for-intensities", h4(S=lambda S_xi: S_xi, R=lambda N: N)),
    ("h4", "noise-inverted", h4(R=lambda N: 2 / N)),
    ("h4", "noise-power", h4(square=False)),
    ("h4", "gain-without-slope", h4(gain=lambda D, h, r: D / r)),
    ("h4", "gain-not-divided", h4(gain=lambda D, h, r: D * h * r)),
    ("h4", "gain-one-sided", h4(gain=lambda D, h, r: D * h / (2 * r))),
    ("h4", "gain-discrete", h4(gain=lambda D, h, r: D * h / (h**2 * D + r))),
    ("h4", "one-side-only", h4(decay=sp.Rational(1, 2))),
    ("h4", "quadratic-formula", h4_not_twice),
    ("h4", "drift-sign", h4(decay=-1)),
    ("h4", "drift-forgotten", h4(decay=0)),
    ("h4", "root-forgotten", h4_root_forgotten),
    ("h4", "without-measurement", h4_object_alone),
    ("h5", "gain-one-sided meter-one-sided", h5(intensity=lambda N: N)),
    ("h5", "process-one-sided", h5(Q=lambda S_xi: S_xi)),
    ("h5", "slope-power", h5(power=1)),
    ("h5", "noise-power", h5(noise_power=1)),
    ("h5", "one-side-only", h5(double=1)),
    ("h5", "unused", h5(double=0)),
    ("h5", "innovation-sign", h5(innovation=lambda y, S, S_x, z: S(z) - y)),
    ("h5", "innovation-without-signal", h5(innovation=lambda y, S, S_x, z: y)),
    ("h5", "expected-by-slope", h5(innovation=lambda y, S, S_x, z: y - S_x(z) * z)),
    ("h5", "gain-without-slope", h5(gain=lambda D, slope, r: D / r)),
    ("h5", "unused", h5(gain=lambda D, slope, r: slope / r)),
    ("h5", "step-forgotten", h5(span=lambda T: 1)),
    ("h5", "riccati-sign", h5(sign=1)),
    ("h5", "D-first", h5(order="D first")),
    ("h5", "z-first", h5(order="z first")),
    ("h6", "curvature-dropped", h6(U=lambda S, S1, S2, y: -(S1**2))),
    ("h6", "slope-dropped", h6(U=lambda S, S1, S2, y: S2 * (y - S))),
    ("h6", "slope-sign", h6(U=lambda S, S1, S2, y: S2 * (y - S) + S1**2)),
    ("h6", "slope-power", h6(U=lambda S, S1, S2, y: S2 * (y - S) - S1)),
    ("h6", "unused", h6(u=lambda S, S1, y: S1, U=lambda S, S1, S2, y: S2)),
    ("h6", "gain-without-slope", h6(u=lambda S, S1, y: y - S)),
    ("h6", "sign", h6(u=lambda S, S1, y: S1 * (S - y), U=lambda S, S1, S2, y: S1**2 - S2 * (y - S))),
    ("h6", "one-sided", h6(scale=lambda N: 1 / N)),
    ("h6", "half-forgotten", h6_from(lambda S, y, N: 2 / N * S * (y - S))),
    ("h6", "unused", h6_from(lambda S, y, N: 2 / N * S * (y - S / 2), by="y")),
    ("h6", "one-sided", h6_from(lambda S, y, N: -((y - S) ** 2) / (2 * N))),
]
UNUSABLE = [
    ("h4", "expected 2 results", lambda a, s, h, S_xi, N: (np.sqrt(a**2 + h**2 * s**2 * S_xi / N) - a) * N / 2 / h**2),
    ("h6", "stops with ValueError", lambda S, x, y, N: (np.gradient(S), np.gradient(np.gradient(S)))),
]
