"""The letters of when-linearisation-fails.md: a signal that is a parabola, its moments by quadrature."""

import numpy as np
from gate.page import CONDITION, NOTATION
from gate.worlds import normal_nodes


def course(rng):
    """A bent signal; kappa from the error that the linearised correction really has."""
    lam, Psi, D_n = rng.normal(), rng.uniform(0.2, 0.5), rng.uniform(0.3, 0.6)
    first, second = -rng.uniform(1, 2), rng.uniform(0.2, 0.5)
    x, mean = normal_nodes(lam, Psi)

    def S(at):
        return 1 + first * (at - lam) + second * (at - lam) ** 2 / 2

    F = first**2 * Psi + D_n
    K, p = Psi * first / F, Psi * D_n / F
    excess = (mean((x - lam - K * (S(x) - S(lam))) ** 2) + K**2 * D_n) / p - 1
    exact = mean(S(x) ** 2) - mean(S(x)) ** 2
    c = np.sqrt(2 * (exact - first**2 * Psi) / D_n)
    s = np.sqrt((F - D_n) / D_n)
    derivatives = {"S'": first, "S''": second, "S": S(lam), "h": mean(S(x)), "F": exact + D_n, "G": mean((x - lam) * S(x)) / Psi}
    return derivatives | {
        r"\Psi": Psi,
        "D_n": D_n,
        "s": s,
        "c": c,
        r"\nu": np.sqrt(c**2 / s**2),
        r"\kappa": np.sqrt(4 * excess / 3),
    }


def display(rng):
    """Near the prediction the parabola in t."""
    own = course(rng)
    t = 10.0
    first, second, Psi = abs(own["S'"]), own["S''"], own[r"\Psi"]
    bend = 0.001 * np.sqrt(Psi) ** 3 * t**3  # what the series leaves out
    ahead = first * np.sqrt(Psi) * t + second * Psi * t**2 / 2 + bend
    return own | {"S(x)": own["S"] + ahead, r"S(\lambda)": own["S"], "t": t}


def western(rng):
    own = course(rng)
    names = {r"\Psi": "P^-", "D_n": "R", "S'": "h'", "S''": "h''"}
    return {names.get(name, name): value for name, value in own.items()}


def again(rng):
    """A constant measured n times, the first time with a larger error than is claimed: the filter's own recursion."""
    kappa, p, n = rng.uniform(1, 3), rng.uniform(0.5, 2), int(rng.integers(4, 9))
    claimed, square = p, (1 + 3 * kappa**2 / 4) * p
    for _ in range(n - 1):
        K = claimed / (claimed + p)
        claimed, square = (1 - K) * claimed, (1 - K) ** 2 * square + K**2 * p
    return {r"\kappa": kappa, "n": n, r"\frac{\mathsf Me_n^2}{p_n}": square / claimed}


def perfect(rng, nu=1.3):
    """A parabola without noise: moments by quadrature, and the measurement in the scale of the tangent."""
    lam, Psi, slope = rng.normal(), rng.uniform(0.5, 2), rng.uniform(1, 2)
    bend = nu * slope / np.sqrt(Psi)
    x, mean = normal_nodes(lam, Psi)

    def S(x):
        return slope * (x - lam) + bend * (x - lam) ** 2 / 2

    h, t = mean(S(x)), rng.uniform(0.5, 1)
    law = {r"\Psi": Psi, "S'": slope, "S''": bend, r"\nu": nu, "F": mean((S(x) - h) ** 2), "G": mean((x - lam) * S(x)) / Psi}
    return law | {"t": t, "s": (S(lam + t * np.sqrt(Psi)) - h) / slope / np.sqrt(Psi)}


def nearly_straight(rng):
    return perfect(rng, 0.1)


LETTERS = (course, display, western, again, perfect, nearly_straight)
SAID = {
    CONDITION: [r"\nu\ll1", r"\frac34\kappa^2\ll1", r"S'\approx0"],
    NOTATION: [r"\mathsf{M}[e^2]/p", r"(\mathsf{M}{e})^2/p", r"\mathsf{M}[e^2]/\Psi"],
}
