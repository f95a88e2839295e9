"""Set k, answers as a student would type them: the right ones pass, the wrong ones are told apart or not named at all."""

import numpy as np
import sympy as sp
from answers import test_no_wrong_kind_of_mistake_is_named, test_right_answers_pass, test_what_cannot_be_compared_is_explained  # noqa: F401


def k1(velocity=lambda y, eps: y - eps, by=-1):
    def answer(signal, y, eps):
        V = sp.Symbol("V")
        at = velocity(y, eps)
        return signal(at), by * signal(V).diff(V).subs(V, at)

    return answer


def k2(root=1, four=4, gain=lambda Psi, q, r: -Psi / (Psi + r), p=lambda Psi, K, q: (1 + K) * Psi, power=2, power_n=2):
    def answer(sigma_xi, sigma_n):
        q, r = sigma_xi**power, sigma_n**power_n
        Psi = q / 2 + root * sp.sqrt(q * q / 4 + four * q * r / 4)
        K = gain(Psi, q, r)
        return Psi, p(Psi, K, q), K

    return answer


def k2_through_p(sigma_xi, sigma_n):
    p = sigma_xi * (sp.sqrt(sigma_xi**2 + 4 * sigma_n**2) - sigma_xi) / 2
    return p + sigma_xi**2, p, -p / sigma_n**2


def k2_root_forgotten(sigma_xi, sigma_n):
    Psi = (sigma_xi**2 + sigma_xi**4 + 4 * sigma_xi**2 * sigma_n**2) / 2
    return Psi, Psi - sigma_xi**2, -Psi / (Psi + sigma_n**2)


def k3(
    first=False,
    velocity=lambda ins, e: ins - e,
    gain=lambda Psi, r: -Psi / (Psi + r),
    expected=lambda ins, e: ins - e,
    missing="predicted",
    power=2,
    returned="p",
    spread=lambda p: p,
    shake=True,
    shrink=lambda K, Psi: Psi + K * Psi,
):
    def answer(y_ins, y_sr, sigma_xi, sigma_n, p0):
        q, r = sigma_xi**power, sigma_n**power
        Psi = p0 + q if first else p0
        e, V, out = np.zeros(y_ins[0].shape), [], []
        for k in range(len(y_ins)):
            ins, sr = y_ins[k], y_sr[k]
            gone = np.isnan(sr).all()
            if gone and missing == "zero":
                sr, gone = np.zeros_like(sr), False
            p = Psi
            if not gone:
                K = gain(Psi, r)
                e = e + K * (sr - expected(ins, e))
                p = shrink(K, Psi)
            elif missing == "reset":
                e = 0 * e
            elif missing == "innovation zero":
                p = shrink(gain(Psi, r), Psi)
            V.append(velocity(ins, np.zeros_like(e) if gone and missing == "INS alone" else e))
            out.append(spread(p if returned == "p" else Psi))
            Psi = p + (q if shake and not (gone and missing == "frozen") else 0)
        return np.stack(V), np.stack(out)

    return answer


def k3_velocity_carried_on(y_ins, y_sr, sigma_xi, sigma_n, p0):
    """The velocity itself is carried on by the differences of the INS."""
    V, Psi, found, variances = y_ins[0], p0, [], []
    for k, sr in enumerate(y_sr):
        if k:
            V, Psi = V + y_ins[k] - y_ins[k - 1], Psi + sigma_xi**2
        weight = 0.0 if np.isnan(sr).any() else Psi / (Psi + sigma_n**2)
        V, Psi = V + weight * (np.nan_to_num(sr) - V), Psi * (1 - weight)
        found.append(V)
        variances.append(Psi)
    return np.array(found), np.array(variances)


def k4(factor=lambda n, p, Psi: n / sp.sqrt(p), tau=lambda T, K: T / sp.log(1 / (1 + K))):
    def answer(sigma_xi, sigma_n, T):
        Psi, p, K = k2()(sigma_xi, sigma_n)
        return factor(sigma_n, p, Psi), tau(T, K)

    return answer


def k5(spread=lambda p, q, n: sp.sqrt(p + n * q**2), time=lambda p, q, r, T: (r**2 - p) / q**2 * T):
    return lambda p, sigma_xi, sigma_n, n, T: (spread(p, sigma_xi, n), time(p, sigma_xi, sigma_n, T))


def k6(error=lambda beta, K, j: beta - beta * (1 + K) ** j):
    return error


RIGHT = [
    ("k1", k1()),
    ("k2", k2()),
    ("k2", k2_through_p),
    ("k3", k3()),
    ("k3", k3_velocity_carried_on),
    ("k4", k4()),
    ("k5", k5()),
    ("k6", k6()),
]

WRONG = [
    ("k1", "slope-sign", k1(by=1)),
    ("k1", "error-sign", k1(velocity=lambda y, eps: y + eps, by=1)),
    ("k1", "difference-reversed", k1(velocity=lambda y, eps: eps - y, by=1)),
    ("k1", "signal-of-error", k1(velocity=lambda y, eps: eps, by=1)),
    ("k1", "unused sometimes reading-subtracted", k1(velocity=lambda y, eps: -eps)),
    ("k1", "sometimes", lambda signal, y, eps: (y - eps, sp.Integer(-1))),
    ("k1", "reading-minus-signal sometimes", lambda signal, y, eps: (signal(y) - signal(eps), -sp.diff(signal(eps), eps))),
    ("k1", "slope-sign unused", lambda signal, y, eps: (signal(y - eps), sp.diff(signal(y), y))),
    ("k1", "reading-minus-signal", lambda signal, y, eps: (signal(y - eps), -sp.diff(signal(eps), eps))),
    ("k1", "sometimes", lambda signal, y, eps: (signal(y - eps), sp.Integer(-1))),
    ("k1", "sometimes", lambda signal, y, eps: (signal(y) - eps, sp.Integer(-1))),
    ("k2", "minus-root", k2(root=-1)),
    ("k2", "four-forgotten", k2(four=1)),
    ("k2", "gain-sign", k2(gain=lambda Psi, q, r: Psi / (Psi + r), p=lambda Psi, K, q: (1 - K) * Psi)),
    ("k2", "drift-added share-sign gain-sign", k2(gain=lambda Psi, q, r: Psi / (Psi + r))),
    ("k2", "gain-of-estimate", k2(gain=lambda Psi, q, r: -(Psi - q) / (Psi - q + r))),
    ("k2", "deviation-for-variance", k2(gain=lambda Psi, q, r: -Psi / (Psi + sp.sqrt(r)), p=lambda Psi, K, q: Psi - q)),
    ("k2", "gain-by-noise-alone", k2(gain=lambda Psi, q, r: -Psi / r, p=lambda Psi, K, q: Psi - q)),
    ("k2", "drift-added share-sign", k2(p=lambda Psi, K, q: Psi + q)),
    ("k2", "variances-swapped", k2(p=lambda Psi, K, q: Psi)),
    ("k2", "deviation-for-variance", k2(power=1, power_n=1)),
    ("k2", "deviation-for-variance", k2(power_n=1)),
    ("k2", "root-forgotten", k2_root_forgotten),
    ("k2", "variances-swapped", lambda sigma_xi, sigma_n: tuple(k2()(sigma_xi, sigma_n)[i] for i in (1, 0, 2))),
    (
        "k2",
        "root",
        lambda sigma_xi, sigma_n: (
            sp.sqrt(k2()(sigma_xi, sigma_n)[0]),
            sp.sqrt(k2()(sigma_xi, sigma_n)[1]),
            k2()(sigma_xi, sigma_n)[2],
        ),
    ),
    ("k3", "noise-as-deviation", k3(gain=lambda Psi, r: -Psi / (Psi + np.sqrt(r)))),
    ("k3", "drift-as-deviation", lambda ins, sr, xi, n, p0: k3()(ins, sr, np.sqrt(xi), n, p0)),
    ("k3", "predicted-first", k3(first=True)),
    ("k3", "error-added", k3(velocity=lambda ins, e: ins + e)),
    ("k3", "error-returned", k3(velocity=lambda ins, e: e)),
    ("k3", "gain-sign", k3(gain=lambda Psi, r: Psi / (Psi + r), shrink=lambda K, Psi: (1 - K) * Psi)),
    ("k3", "error-not-removed", k3(expected=lambda ins, e: ins)),
    ("k3", "missing-as-zero", k3(missing="zero")),
    ("k3", "no-drift-in-gap", k3(missing="frozen")),
    ("k3", "sometimes", k3(missing="reset")),
    ("k3", "sometimes", k3(missing="INS alone")),
    ("k3", "deviation-for-variance", k3(power=1)),
    ("k3", "variance-before", k3(returned="Psi")),
    ("k3", "root", k3(spread=np.sqrt)),
    ("k3", "drift-forgotten", k3(shake=False)),
    ("k3", "variance-grows", k3(shrink=lambda K, Psi: (1 - K) * Psi)),
    ("k4", "upside-down", k4(factor=lambda n, p, Psi: sp.sqrt(p) / n)),
    ("k4", "variance-ratio", k4(factor=lambda n, p, Psi: n**2 / p)),
    ("k4", "variance-for-deviation", k4(factor=lambda n, p, Psi: n / p)),
    ("k4", "prediction", k4(factor=lambda n, p, Psi: n / sp.sqrt(Psi))),
    ("k4", "difference", k4(factor=lambda n, p, Psi: n - sp.sqrt(p))),
    ("k4", "in-steps", k4(tau=lambda T, K: -1 / sp.log(1 + K))),
    ("k4", "sign", k4(tau=lambda T, K: T / sp.log(1 + K))),
    ("k4", "first-order", k4(tau=lambda T, K: -T / K)),
    ("k4", "other-time-constant", k4(tau=lambda T, K: -T / sp.log(1 - K))),
    ("k4", "decimal-logarithm", k4(tau=lambda T, K: -T / sp.log(1 + K, 10))),
    ("k4", "rate-for-time", k4(tau=lambda T, K: -sp.log(1 + K) / T)),
    ("k4", "half-life", k4(tau=lambda T, K: -sp.log(2) * T / sp.log(1 + K))),
    ("k5", "variance-for-deviation", k5(spread=lambda p, q, n: p + n * q**2)),
    ("k5", "deviation-for-variance", k5(spread=lambda p, q, n: sp.sqrt(p + n * q))),
    ("k5", "drifts-in-line", k5(spread=lambda p, q, n: sp.sqrt(p + n**2 * q**2))),
    ("k5", "grows-as-n", k5(spread=lambda p, q, n: sp.sqrt(p) + n * q)),
    ("k5", "deviations-added", k5(spread=lambda p, q, n: sp.sqrt(p) + sp.sqrt(n) * q)),
    ("k5", "start-forgotten", k5(spread=lambda p, q, n: sp.sqrt(n) * q)),
    ("k5", "variance-squared", k5(spread=lambda p, q, n: sp.sqrt(p**2 + n * q**2))),
    ("k5", "one-period-more", k5(spread=lambda p, q, n: sp.sqrt(p + (n + 1) * q**2))),
    ("k5", "unused", k5(spread=lambda p, q, n: sp.sqrt(p + q**2))),
    ("k5", "in-periods", k5(time=lambda p, q, r, T: (r**2 - p) / q**2)),
    ("k5", "start-forgotten", k5(time=lambda p, q, r, T: T * r**2 / q**2)),
    ("k5", "grows-as-n", k5(time=lambda p, q, r, T: T * (r - sp.sqrt(p)) / q)),
    ("k5", "deviation-for-variance", k5(time=lambda p, q, r, T: T * (r - p) / q)),
    ("k5", "sign", k5(time=lambda p, q, r, T: T * (p - r**2) / q**2)),
    ("k6", "innovation", k6(lambda beta, K, j: beta * (1 + K) ** j)),
    ("k6", "sign", k6(lambda beta, K, j: -beta * (1 - (1 + K) ** j))),
    ("k6", "gain-sign", k6(lambda beta, K, j: beta * (1 - (1 - K) ** j))),
    ("k6", "one-step-late", k6(lambda beta, K, j: beta * (1 - (1 + K) ** (j - 1)))),
    ("k6", "one-step-early", k6(lambda beta, K, j: beta * (1 - (1 + K) ** (j + 1)))),
    ("k6", "in-line", k6(lambda beta, K, j: -K * beta * j)),
    ("k6", "one-step", k6(lambda beta, K, j: -K * beta)),
    ("k6", "power-of-K", k6(lambda beta, K, j: beta * (1 - K**j))),
    ("k6", "limit", k6(lambda beta, K, j: beta)),
]
UNUSABLE = [
    ("k3", "a missing measurement used", k3(missing="zero", expected=lambda ins, e: ins * np.nan)),
    ("k3", "expected an array of shape", k3(spread=lambda p: p * np.ones(3))),
    ("k4", "functions of symbols", lambda sigma_xi, sigma_n, T: sigma_n / np.sqrt(k2()(sigma_xi, sigma_n)[1])),
]
