r"""Moment equations between two measurements, derived and integrated.

    dz/dt = M_N[a],   dp/dt = A p + p A^T + M_N[B B^T],   A = dM_N[a] / dz,
    M_N: the mean over x ~ N(z, p)

Exact would be dp/dt = Cov(x, a) + Cov(a, x) + M[B B^T]; for a normal law Cov(a, x) = A p (Stein's
lemma).  Instead of p its two parts are integrated, of what was known at the beginning and of what
came since:

    p(t) = F p(t_k) F^T + Q,   dF/dt = A F,   dQ/dt = A Q + Q A^T + M_N[B B^T],
    F = I, Q = 0 at t_k

Neither can become negative, and F and Q are what a smoother needs.  All trajectories of an ensemble
share the steps of one embedded pair (Dormand and Prince's, of order 5); the worst of them decides
how long a step is.  Stiff equations are left to an implicit method (Radau's), which takes the
trajectories one by one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import sympy as sp
from scipy.integrate import RK45, solve_ivp
from scipy.linalg import expm

from kfcourse.errors import NotFinite
from kfcourse.laws import Array, Gaussian, Matrices, Vectors
from kfcourse.symbolic.codegen import compile_function
from kfcourse.symbolic.known import Known
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import GaussianMoments
from kfcourse.symbolic.reading import normal_symbols
from kfcourse.symbolic.structure import Structure, gaussian, linearised

# trajectories that may be stiff: the implicit method takes some tenths of a second each
FEW = 64
# between two measurements, at most: more would take many trajectories minutes in all, and few are
# faster by the implicit method; a twentieth of the steps shows by its length how many there will be
STEPS = 3_000
# of a mean that has no variance a part that stands for the standard deviation: a billionth of the
# mean is then right by the usual accuracy
NEAR = 1e-3

# (known, z, p) -> M[a], A, M[B B^T]
Rates: TypeAlias = Callable[[Array, Vectors, Matrices], tuple[Array, ...]]
Moved: TypeAlias = tuple[Vectors, Matrices, Matrices]  # tau, F, Q


class MomentEquations(NamedTuple):
    """The moment equations in formulas, parameters as symbols: z (n, 1), p (n, n); M[a], A and M[B
    B^T] at N(z, p)."""

    z: sp.ImmutableMatrix
    p: sp.ImmutableMatrix
    drift: sp.ImmutableMatrix
    A: sp.ImmutableMatrix
    intensity: sp.ImmutableMatrix

    @property
    def rates(self) -> tuple[sp.ImmutableMatrix, sp.ImmutableMatrix]:
        """dz/dt and dp/dt."""
        slope = self.A * self.p
        return self.drift, (slope + slope.T + self.intensity).applyfunc(sp.expand)


def moment_equations(
    model: Model, approximation: Callable[[Model], Structure] = gaussian
) -> MomentEquations:
    """Derive them: `gaussian`, with exact means over the normal law, or `linearised`, with those at
    its mean.

    Raises
    ------
    NoClosedForm
        A term without a closed-form mean, or, `linearised`, without a derivative.
    """
    z, p = normal_symbols(model.n, "z", "p", model.taken)
    drift, B = model.between.drift, model.between.diffusion
    if approximation is linearised:
        seen = _seen(model, [*drift, *(B * B.T)])
        m, _ = normal_symbols(model.n, "m", "d", seen.taken)
        at_mean = sp.Matrix([linearised(seen)["h"]])
        means = [*at_mean.subs(dict(zip(m, z, strict=True)), simultaneous=True)]
    else:
        law = GaussianMoments(model.x, list(z), p)
        means = [law.mean_of(formula) for formula in (*drift, *(B * B.T))]
    tau = sp.ImmutableMatrix(means[: model.n])
    return MomentEquations(
        z, p, tau, tau.jacobian(z), sp.ImmutableMatrix(model.n, model.n, means[model.n :])
    )


class _Now(Known):
    """What is known, where the values themselves are given for the step."""

    def at(self, k: Any) -> Array:
        return k if isinstance(k, np.ndarray) else super().at(k)


def _seen(model: Model, functions: list[sp.Expr]) -> Model:
    """A model whose meter these functions are: of such a meter every structure knows the mean, and
    its slope by x."""
    return replace(
        at_rest(model),
        meter_equation=sp.ImmutableMatrix(functions),
        angles=model.angles._replace(y=()),
        known=_Now(**vars(model.known)),
    )


def at_rest(model: Model) -> Model:
    """The model with its meter, and a state that stays where it is."""
    still = Gaussian(np.zeros(1), np.eye(1))
    return replace(
        model,
        between=None,
        state_equation=sp.ImmutableMatrix(model.x),
        v=model.v[:1],
        state_noise=still,
    )


def rates_of(
    model: Model, approximation: Callable[[Model], Structure], derived: MomentEquations | None
) -> Rates:
    """The right sides as a function of arrays; of sigma points, for which nothing is derived, by
    the slopes of their regression."""
    n = model.n
    if derived is not None:
        z, p, *rates = derived
        drift, A, Q = (part.subs(model.values) for part in rates)
        return compile_function([model.known.symbols, list(z), p], [list(drift), A, Q])
    intensity = model.between.diffusion * model.between.diffusion.T
    varying = [entry if entry.has(*model.x) else 0 for entry in intensity]
    rest = compile_function(
        [model.known.symbols], [(intensity - sp.Matrix(n, n, varying)).subs(model.values)]
    )
    places = np.eye(n * n)[[entry != 0 for entry in varying]]
    structure = approximation(_seen(model, [*model.between.drift, *filter(None, varying)]))

    def by_points(known: Any, z: Vectors, p: Matrices) -> tuple[Array, ...]:
        h, G, *_ = structure.at(known).measure(z, p)
        Q = (h[..., n:] @ places).reshape(*h.shape[:-1], n, n) + rest(known)[0]
        return h[..., :n], G[..., :n, :], Q

    return by_points


def flow_of(
    rates: Rates, model: Model, accuracy: float
) -> Callable[[Callable[[float], Array], float, Vectors, Matrices], Moved]:
    """(what is known after a time, span, z, p) -> tau, F, Q at its end; exact by the matrix
    exponential where linear."""
    parts = model.between
    slope = parts.drift.jacobian(sp.Matrix(model.x))
    varying = (*model.x, *(s for s in model.known.symbols if s.name == "t"))
    if not (
        slope.has(*varying)
        or parts.diffusion.has(*varying)
        or parts.drift.subs(dict.fromkeys(model.x, 0)).has(*varying)
    ):
        anywhere = Gaussian(np.zeros(model.n), np.eye(model.n))
        return lambda now, span, z, p: _linear(rates(now(0.0), *anywhere), span, z)
    return lambda now, span, z, p: _integrated(rates, now, span, z, p, accuracy)


def _linear(rates: tuple[Array, ...], span: float, z: Vectors) -> Moved:
    """dz/dt = A z + c: Van Loan's exponential over a short step, doubled until the span is
    reached."""
    c, A, Theta = rates
    n = len(c)
    doublings = max(0, int(np.ceil(np.log2(max(np.abs(A).sum(axis=1).max() * span, 1.0)))))
    block = np.block(
        [
            [A, Theta, c[:, None]],
            [np.zeros((n, n)), -A.T, np.zeros((n, 1))],
            [np.zeros((1, 2 * n + 1))],
        ]
    )
    whole = expm(block * span / 2**doublings)
    F, shift = whole[:n, :n], whole[:n, -1]
    Q = whole[:n, n : 2 * n] @ F.T
    for _ in range(doublings):
        F, Q, shift = F @ F, Q + F @ Q @ F.T, shift + F @ shift
    return z @ F.T + shift, F, Q


def _integrated(
    rates: Rates,
    now: Callable[[float], Array],
    span: float,
    z: Vectors,
    p: Matrices,
    accuracy: float,
) -> Moved:
    lead, n = z.shape[:-1], z.shape[-1]
    square = (*lead, n, n)
    # arrays in which each component lies together: of them sums are several times as fast
    p, products = np.asfortranarray(p), partial(np.einsum, "...ij,...jk")
    before = np.sqrt(np.abs(np.diagonal(p, axis1=-2, axis2=-1)))[..., None, :]

    def unpacked(state: Array) -> Moved:
        return (
            state[..., :n],
            state[..., n : n + n * n].reshape(square),
            state[..., n + n * n :].reshape(square),
        )

    def packed(mean: Array, F: Array, Q: Array) -> Array:
        state = np.empty((*lead, n + 2 * n * n), order="F")
        state[..., :n], (of_F, of_Q) = mean, unpacked(state)[1:]
        of_F[:], of_Q[:] = F, Q
        return state

    def covariance(F: Array, Q: Array) -> Array:
        return products(products(F, p), F.swapaxes(-1, -2)) + Q

    def rate(s: float, state: Array) -> Array:
        mean, F, Q = unpacked(state)
        drift, A, Theta = map(np.asfortranarray, rates(now(s), mean, covariance(F, Q)))
        grown = products(A, Q)
        return packed(drift, products(A, F), grown + grown.swapaxes(-1, -2) + Theta)

    def error(step: Array, state: Array) -> float:
        """The largest of a step, in standard deviations."""
        (mean, F, Q), (value, *law) = unpacked(step), unpacked(state)
        sd = (
            np.sqrt(np.abs(np.diagonal(covariance(*law), axis1=-2, axis2=-1)))
            + NEAR * np.abs(value)
            + np.finfo(float).tiny
        )
        of_F, of_Q = (
            np.abs(F) * before / sd[..., None],
            np.abs(Q) / sd[..., None] / sd[..., None, :],
        )
        return float(max((np.abs(mean) / sd).max(), of_F.max(), of_Q.max()))

    start = packed(z, np.eye(n), np.zeros((n, n)))
    done = _run(rate, error, start, span, accuracy)
    if done is None and z.size > n:  # stiff
        if z.size > FEW * n:
            raise NotFinite(
                f"the moment equations are stiff, or turn too fast for {STEPS} steps between two "
                f"measurements, and {z.size // n} trajectories would take minutes: run at most "
                f"{FEW}, measure more often, or replace the fastest component by its steady state"
            )
        each = zip(
            z.reshape(-1, 1, n), np.broadcast_to(p, square).reshape(-1, 1, n, n), strict=True
        )
        parts = [_integrated(rates, now, span, *law, accuracy) for law in each]
        mean, F, Q = map(np.concatenate, zip(*parts, strict=True))
        return mean.reshape(z.shape), F.reshape(square), Q.reshape(square)
    return unpacked(_implicit(rate, start, span, accuracy) if done is None else done)


def _implicit(
    rate: Callable[[float, Array], Array], start: Array, span: float, accuracy: float
) -> Array:
    """Of one trajectory."""
    done = solve_ivp(
        lambda s, state: rate(s, state.reshape(start.shape)).ravel(),
        (0.0, span),
        start.ravel(),
        "Radau",
        rtol=1e-2 * accuracy,
        atol=1e-3 * accuracy,
    )
    if not (done.success and np.isfinite(done.y[:, -1]).all()):
        raise NotFinite(
            f"the moment equations cannot be integrated beyond {done.t[-1]:g} of the {span:g} "
            f"between two instants: the drift outgrows the state there; check its sign, or measure "
            f"more often"
        )
    return done.y[:, -1].reshape(start.shape)


def _run(
    rate: Callable[[float, Array], Array],
    error: Callable[[Array, Array], float],
    state: Array,
    span: float,
    accuracy: float,
) -> Array | None:
    """The state after the span, by steps whose error stays below the accuracy; None if they are
    more than `STEPS`."""
    s, h, earlier, slopes = 0.0, span, span, np.empty((7, state.size))

    def moved(weights: Array) -> Array:
        return h * (weights @ slopes[: len(weights)]).reshape(state.shape, order="F")

    with np.errstate(all="ignore"):  # a step that leaves the finite numbers is taken again, shorter
        slopes[0] = rate(s, state).ravel("F")
        for done in range(STEPS):
            if done == STEPS // 40:
                earlier = h
            if done == STEPS // 20 and span - s > 2 * STEPS * h > STEPS * earlier:
                break  # stability, not what comes, holds the steps so short: they will not do
            for i in range(1, 6):
                slopes[i] = rate(s + RK45.C[i] * h, state + moved(RK45.A[i, :i])).ravel("F")
            ahead = state + moved(RK45.B)
            slopes[6] = rate(s + h, ahead).ravel("F")
            size = error(moved(RK45.E), ahead) / accuracy
            if size <= 1:
                s, state, slopes[0] = s + h, ahead, slopes[6]
                if s >= span * (1 - 1e-14):
                    return state
            longer = 0.9 * max(size, 1e-10) ** -0.2 if np.isfinite(size) else 0.0
            h = min(h * min(max(longer, 0.2), 10.0), span - s)
            if s + h == s:
                raise NotFinite(
                    f"the moments become infinite {s:g} after an instant, and the next is "
                    f"{span:g} after it: the drift outgrows "
                    "the state there, as x**3 does; check its sign, or measure more often"
                )
    return None
