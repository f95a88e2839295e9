r"""The equations of the logic-dynamic filter (`multiple_models`) for a mode j of so many, in SymPy:
to print and to execute.

j may be a letter, as it is printed, or a number; sums over the modes are written out.
"""

from __future__ import annotations

import sympy as sp

from kfcourse.filters import notation as s


def of(name: str, j: object, step: str = "k") -> str:
    """LaTeX of what belongs to mode j at a step."""
    return rf"{name}_{{{step}}}^{{{j}}}"


def vector(name: str, j: object, step: str = "k") -> sp.MatrixSymbol:
    """Of the state's dimension."""
    return s.matrix(of(name, j, step), s.n, s.ONE)


def square(name: str, j: object, step: str = "k") -> sp.MatrixSymbol:
    """As the state's covariances are."""
    return s.matrix(of(name, j, step), s.n, s.n)


def number(name: str, j: object, step: str = "k") -> sp.Symbol:
    """A probability, a weight."""
    return sp.Symbol(of(name, j, step))


def likelihood(j: object) -> sp.Symbol:
    """N(y_k; h^j, F^j)."""
    return sp.Symbol(rf"\mathcal{{N}}(y_{{k}};\, {of('h', j)}, {of('F', j)})")


def ahead(j: object, i: object) -> tuple[sp.MatrixSymbol, sp.MatrixSymbol]:
    """tau and Theta of mode j at the law of mode i."""
    at = rf"({of('z', i)}, {of('p', i)})"
    return s.matrix(rf"\tau^{{{j}}}{at}", s.n, s.ONE), s.matrix(rf"\Theta^{{{j}}}{at}", s.n, s.n)


def correction(j: object, size: int) -> tuple[sp.Eq, ...]:
    """The law of the state in mode j after y_k, and the probability of the mode."""
    lam, Psi, z, p = vector(r"\lambda", j), square(r"\Psi", j), vector("z", j), square("p", j)
    h, K = s.matrix(of("h", j), s.p, s.ONE), s.matrix(of("K", j), s.n, s.p)
    G, F = s.matrix(of("G", j), s.p, s.n), s.matrix(of("F", j), s.p, s.p)
    at = rf"({lam.name}, {Psi.name})"
    values = [
        s.matrix(rf"{name}^{{{j}}}{at}", *entry.shape)
        for name, entry in (("h", h), ("G", G), ("F", F))
    ]
    total = sp.Add(*(number("c", i) * likelihood(i) for i in range(1, size + 1)), evaluate=False)
    return (
        *(s.equation(entry, value) for entry, value in zip((h, G, F), values, strict=True)),
        s.equation(K, Psi * G.T * F.I),
        s.equation(z, lam + K * (s.y - h)),
        s.equation(p, Psi - K * G * Psi),
        s.equation(number(r"\mu", j), number("c", j) * likelihood(j) / total),
    )


def combination(j: object, size: int) -> tuple[sp.Eq, ...]:
    """The estimate, how far the law of mode j is from it, and the covariance."""
    modes = range(1, size + 1)
    mu, z, p, delta = (
        [make(name, i) for i in modes]
        for make, name in ((number, r"\mu"), (vector, "z"), (square, "p"), (vector, r"\delta"))
    )
    spread = [entry + away * away.T for entry, away in zip(p, delta, strict=True)]
    return (
        s.equation(s.z, _sum(mu, z)),
        s.equation(vector(r"\delta", j), vector("z", j) - s.z),
        s.equation(s.P, _sum(mu, spread)),
    )


def prediction(j: object, size: int) -> tuple[sp.Eq, ...]:
    """The probability of mode j at the next step, what leads to it, and the law of the state
    there."""
    modes = range(1, size + 1)
    mu, c = [number(r"\mu", i) for i in modes], number("c", j, "k+1")
    pi, w = ([sp.Symbol(rf"{name}^{{{i}{j}}}") for i in modes] for name in (r"\pi", "w"))
    lam, Psi = vector(r"\lambda", j, "k+1"), square(r"\Psi", j, "k+1")
    laws, away = [ahead(j, i) for i in modes], [vector(r"\delta", f"{i}{j}", "k+1") for i in modes]
    return (
        s.equation(c, sp.Add(*(entry * weight for entry, weight in zip(pi, mu, strict=True)))),
        *(
            s.equation(share, entry * weight / c)
            for share, entry, weight in zip(w, pi, mu, strict=True)
        ),
        s.equation(lam, _sum(w, [tau for tau, _ in laws])),
        *(s.equation(entry, tau - lam) for entry, (tau, _) in zip(away, laws, strict=True)),
        s.equation(
            Psi,
            _sum(
                w, [Theta + entry * entry.T for entry, (_, Theta) in zip(away, laws, strict=True)]
            ),
        ),
    )


def _sum(weights: list[sp.Symbol], parts: list[sp.MatrixExpr]) -> sp.MatrixExpr:
    return sp.MatAdd(*(sp.MatMul(w, entry) for w, entry in zip(weights, parts, strict=True)))
