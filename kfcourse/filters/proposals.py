"""Where to look for the next state once the measurement is known: proposals of the particle filter.

A particle x and the noise u ~ N(m, D) make the next state x' = a(x, u), and y = b(x', w).  As a function of u alone,

    y = g(u) + e,    g(u) = b(a(x, u), m_w),    Cov(e) = R(u)

so u has a posterior of its own.  A step of Gauss and Newton takes g and R at the last u_i for affine and constant, which gives
a normal law for u; a few of them find the posterior's mode and width.  They are taken in s, u = m + L s with L L^T = D, so that
singular D (a noise that enters some components only) needs no care.  The initial state is a noise, too: x_0 = u ~ prior.
Doucet, Godsill and Andrieu (2000) say why to look there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
import sympy as sp

from kfcourse.angles import Components, near
from kfcourse.laws import Array, Gaussian, Measurement, apply, correct, product, square_root, transpose
from kfcourse.symbolic.known import Stepwise
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import exact_matrix

ROUNDS = 4  # steps of Gauss and Newton
FREEDOM = 4.0  # of Student's law around the mode: its tails are heavier than those of the posterior
WIDER = 1.2  # the same in scale
PRIOR = 0.1  # share drawn from N(m, D) all the same, for what the mode does not see
STARTS = (-2.0, -1.0, 0.0, 1.0, 2.0)  # of the search for the modes of the initial state, in standard deviations
SMALLEST = 1e-100  # in place of a width of exactly 0


class Proposal(NamedTuple):
    """A mixture of laws of s, one mixture for each trajectory or particle.

    Attributes
    ----------
    mean : ndarray (..., J, r)
    root : ndarray (..., J, r, r)
        Lower triangles.
    share : ndarray (..., J)
        They sum to 1.
    """

    mean: Array
    root: Array
    share: Array

    def of_clouds(self, clouds: int) -> Proposal:
        """Those of each trajectory (runs, J) for so many clouds: (runs, clouds, J)."""
        return Proposal(*(np.repeat(array[:, None], clouds, axis=1) for array in self))


def _slopes(equation: sp.MatrixBase, by: tuple[sp.Symbol, ...]) -> sp.MatrixBase:
    """Derivatives, with those of a jump left out: where to look needs not be exact."""
    return equation.jacobian(sp.Matrix(by)).replace(sp.DiracDelta, lambda *place: sp.S.Zero)


@dataclass(frozen=True)
class Look:
    """What the measurement tells of the noise that makes the next state.

    Attributes
    ----------
    state, meter : callable
        (x (..., n), u (..., r), k) -> the next state (..., n) and its derivatives by u (..., n, r), from step k on;
        (x, k) -> b(x, m_w) (..., p), its derivatives (..., p, n), and R (..., p, p).
    angles : tuple of int
        Components of y that are angles.
    noise : Gaussian
        N(m, D) of u.
    blind : bool
        The measurement does not depend on u: N(m, D) is the best proposal.
    affine : bool
        g is affine in u and R does not depend on it: one step finds the posterior itself.
    """

    state: Callable[[Array, Array, int], tuple[Array, Array]]
    meter: Callable[[Array, int], tuple[Array, Array, Array]]
    angles: Components
    noise: Gaussian
    blind: bool
    affine: bool

    @classmethod
    def at_start(cls, model: Model) -> Look:
        """x_0 = u."""
        return cls._of(model, sp.Matrix(model.x), model.x, model.prior, lambda x, u, k: (u, np.eye(model.n)))

    @classmethod
    def ahead(cls, model: Model) -> Look:
        """x' = a(x, u)."""
        equation = model.state_equation.subs(model.values)
        outputs = {"after": equation, "slope": _slopes(equation, model.v)}
        arguments = {"x": sp.Matrix(model.x), "u": sp.Matrix(model.v)}
        state = Stepwise.compile(model.known, "next_state", arguments, outputs, ["x", "u", "after"])
        return cls._of(model, equation, model.v, model.state_noise, lambda x, u, k: state.at(k)(x, u))

    @classmethod
    def _of(
        cls,
        model: Model,
        equation: sp.MatrixBase,
        u: tuple[sp.Symbol, ...],
        noise: Gaussian,
        state: Callable[[Array, Array, int], tuple[Array, Array]],
    ) -> Look:
        mean = model.meter_equation.subs(dict(zip(model.w, exact_matrix(model.meter_noise.mean), strict=True))).subs(model.values)
        means = dict(zip(model.w, exact_matrix(model.meter_noise.mean), strict=True))
        B = model.meter_equation.jacobian(sp.Matrix(model.w)).subs(means)  # where the noise enters nonlinearly: only a proposal
        cov = (B * exact_matrix(model.meter_noise.cov) * B.T).subs(model.values)
        outputs = {"signal": mean, "slope": _slopes(mean, model.x), "noise": cov}
        meter = Stepwise.compile(model.known, "seen", {"x": sp.Matrix(model.x)}, outputs, ["x", "signal"])
        there = dict(zip(model.x, equation, strict=True))
        H = mean.subs(there, simultaneous=True).jacobian(sp.Matrix(u))
        still = not model.timed and not cov.subs(there, simultaneous=True).free_symbols & set(u)
        affine = still and not H.free_symbols & set(u)
        return cls(
            state,
            lambda x, k: meter.at(k)(x),
            model.angles.y,
            noise,
            affine and H.is_zero_matrix is True,
            affine and not model.angles.y,
        )

    def noise_of(self, s: Array) -> Array:
        """u = m + L s."""
        return self.noise.mean + s @ square_root(self.noise.cov).T

    def proposal(self, x: Array, y: Array, starts: Array, k: int) -> Proposal:
        """One normal law (..., J) for each start (J, r), at x (..., n) and with y_k (..., p), which may be missing (NaN)."""
        r = starts.shape[-1]
        standard = Gaussian(np.broadcast_to(starts, (*x.shape[:-1], *starts.shape)), np.eye(r))
        law, L = standard, square_root(self.noise.cov)
        for _ in range(1 if self.affine else ROUNDS):
            after, by_noise = self.state(x[..., None, :], self.noise_of(law.mean), k - 1)
            signal, by_state, R = self.meter(after, k)
            H = product(product(by_state, by_noise), L)
            F = product(H, transpose(H)) + R
            meter = Measurement(signal - apply(H, law.mean), H, F, R)
            law = correct(Gaussian(np.zeros_like(law.mean), np.eye(r)), meter, near(y[..., None, :], signal, self.angles))
        mean = np.where(np.isfinite(law.mean), law.mean, 0.0)
        cov = np.broadcast_to(law.cov, (*mean.shape, r))
        root = _lower(np.where(np.isfinite(cov), cov, np.eye(r)))
        return Proposal(mean, root if self.affine else WIDER * root, np.full(mean.shape[:-1], 1 / len(starts)))

    def starts(self) -> Array:
        """(J, r): where the modes of the initial state are looked for; later steps start at the noise's mean."""
        r = len(self.noise.mean)
        return np.array([[0.0]]) * np.ones(r) if self.affine else np.array(STARTS)[:, None] * np.ones(r) / np.sqrt(r)

    def draw_each(self, proposal: Proposal, rng: np.random.Generator) -> tuple[Array, Array]:
        """The same, one for each mixture: (..., r) and (...)."""
        s, logs = self.draw(proposal, rng, 1)
        return s[..., 0, :], logs[..., 0]

    def draw(self, proposal: Proposal, rng: np.random.Generator, particles: int) -> tuple[Array, Array]:
        """s (..., M, r), and log N(s; 0, I) - log q(s), (..., M), for mixtures (..., J): M from each."""
        mean, root, share = proposal
        r, size = mean.shape[-1], (*mean.shape[:-2], particles)
        normal = rng.standard_normal((*size, r))
        if self.affine:
            s = mean[..., 0, None, :] + (root[..., 0, None, :, :] @ normal[..., None])[..., 0]
            return s, _log_normal(s) - _log_laws(s, mean, root, None)[..., 0]
        which = component(share, rng.random(size))
        student = normal * np.sqrt(FREEDOM / rng.chisquare(FREEDOM, size))[..., None]
        chosen_mean = np.take_along_axis(mean, which[..., None], axis=-2)
        chosen_root = np.take_along_axis(root, which[..., None, None], axis=-3)
        s = chosen_mean + (chosen_root @ student[..., None])[..., 0]
        s = np.where((rng.random(size) < PRIOR)[..., None], normal, s)
        prior = _log_normal(s)
        with np.errstate(divide="ignore"):
            laws = _log_laws(s, mean, root, FREEDOM) + np.log((1 - PRIOR) * share)[..., None, :]
        return s, prior - np.logaddexp(np.logaddexp.reduce(laws, axis=-1), prior + np.log(PRIOR))


def component(share: Array, uniform: Array) -> Array:
    """Numbers (..., M) of the components that uniform numbers (..., M) fall into."""
    return (uniform[..., None] > np.cumsum(share, axis=-1)[..., None, :-1]).sum(axis=-1)


def _lower(cov: Array) -> Array:
    """Lower triangles with cov = root root^T, of positive diagonal."""
    if cov.shape[-1] == 1:
        return np.maximum(np.sqrt(np.maximum(cov, 0.0)), SMALLEST)
    variance = np.maximum(np.diagonal(cov, axis1=-2, axis2=-1), SMALLEST**2)
    scale = np.sqrt(variance)
    correlation = cov / (scale[..., :, None] * scale[..., None, :])
    return scale[..., :, None] * np.linalg.cholesky(correlation + 1e-12 * np.eye(cov.shape[-1]))


def _log_normal(s: Array) -> Array:
    return -0.5 * (s * s).sum(axis=-1) - 0.5 * s.shape[-1] * np.log(2 * np.pi)


def _log_laws(s: Array, mean: Array, root: Array, freedom: float | None) -> Array:
    """log density (..., M, J) at s (..., M, r) of normal laws (..., J), or of Student's with this freedom."""
    r = s.shape[-1]
    deviation = s[..., :, None, :] - mean[..., None, :, :]
    scaled = (
        deviation / root[..., None, :, :, 0]
        if r == 1
        else np.linalg.solve(root[..., None, :, :, :], deviation[..., None])[..., 0]
    )
    square = (scaled * scaled).sum(axis=-1)
    size = np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=-1)[..., None, :]
    if freedom is None:
        return -0.5 * square - size - 0.5 * r * np.log(2 * np.pi)
    constant = scipy.special.gammaln((freedom + r) / 2) - scipy.special.gammaln(freedom / 2) - 0.5 * r * np.log(freedom * np.pi)
    return constant - size - 0.5 * (freedom + r) * np.log1p(square / freedom)
