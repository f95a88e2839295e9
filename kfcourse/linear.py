"""The Kalman filter for given matrices, in four arithmetic forms.

    x_{k+1} = A x_k + B u_k + v_k,  v ~ N(0, Q)        u_k: known input
    y_k     = H x_k + w_k,          w ~ N(0, R)

All four are the same filter on paper.  They differ in what rounding does to the covariance:

    covariance     P = (I - K H) P^-                          as in the textbook; may turn asymmetric or negative
    symmetrised    the same, then (P + P^T) / 2               symmetric, may still be negative
    joseph         P = (I - K H) P^- (I - K H)^T + K R K^T    a sum of non-negative terms
    square-root    S with P = S S^T, by orthogonal transformations; P is never formed.  R must be positive definite

Time runs as in the lab: a filter starts from the law of x_0, corrects with y_0, then predicts x_1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg

from kfcourse.gaussian import (
    Array,
    Gaussian,
    Measurement,
    any_missing,
    apply,
    correct,
    gain,
    square_root,
    symmetric,
    transpose,
    without_missing,
)


@dataclass(frozen=True)
class LinearSystem:
    """Matrices of a linear model.

    Attributes
    ----------
    A : ndarray (n, n)
        Transition of the state.
    H : ndarray (p, n)
        Sensitivity of the meter.
    Q, R : ndarray (n, n), (p, p)
        Covariances of the noises of object and meter.
    B : ndarray (n, m), optional
        Effect of the known input.

    Raises
    ------
    ValueError
        Shapes that do not fit, numbers that are not finite, covariances that are none.
    """

    A: Array
    H: Array
    Q: Array
    R: Array
    B: Array | None = None

    def __post_init__(self) -> None:
        for name in "AHQRB":
            value = getattr(self, name)
            if value is None:
                continue
            array = np.asarray(value)
            array = array if array.dtype == np.float32 else array.astype(float)
            if array.ndim != 2:
                raise ValueError(f"{name} must be a matrix (2 axes), got the shape {array.shape}")
            if not np.isfinite(array).all():
                raise ValueError(f"{name} must be finite, got {array.tolist()}")
            object.__setattr__(self, name, array)
        n, p = len(self.A), len(self.H)
        shapes = {"A": (n, n), "H": (p, n), "Q": (n, n), "R": (p, p)}
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise ValueError(
                    f"{name} has the shape {getattr(self, name).shape}; with {n} states and {p} measurements it is {shape}"
                )
        if self.B is not None and len(self.B) != n:
            raise ValueError(f"B has {len(self.B)} rows; with {n} states it has {n}")
        for name in "QR":
            cov = getattr(self, name)
            if not np.array_equal(cov, cov.T):
                raise ValueError(f"{name} is a covariance and must be symmetric, got {cov.tolist()}")
            values = np.linalg.eigvalsh(cov)
            if values.min() < -1e-6 * max(values.max(), 0.0):  # rounding of eigvalsh, in float32 too
                raise ValueError(f"{name} is a covariance and must not be negative, got {cov.tolist()}")

    def astype(self, dtype: Any) -> LinearSystem:
        """The same matrices in another arithmetic, such as numpy.float32."""
        matrices = (self.A, self.H, self.Q, self.R, self.B)
        return LinearSystem(*(None if matrix is None else matrix.astype(dtype) for matrix in matrices))  # type: ignore[arg-type]

    def input(self, u: Array | None) -> Array | float:
        """B u, (..., n); 0 without an input."""
        if u is None:
            return 0.0
        if self.B is None:
            raise ValueError("an input u was given, but the system has no matrix B; pass LinearSystem(A, H, Q, R, B)")
        return apply(self.B, u)

    def measure(self, m: Array, d: Array) -> Measurement:
        """Structural functions of the meter: h = H m, G = H, F = H d H^T + R."""
        return Measurement(apply(self.H, m), self.H, symmetric(self.H @ d @ self.H.T) + self.R, self.R)


class Root(NamedTuple):
    """A normal law by a square root of its covariance: mean (..., n), root (..., n, n), cov = root root^T."""

    mean: Array
    root: Array


class Form(NamedTuple):
    """One arithmetic of the Kalman filter; S is a Gaussian, or a Root.

    Attributes
    ----------
    start : callable
        Gaussian -> S.
    predict, correct : callable
        (LinearSystem, S, shift (..., n)) -> S and (LinearSystem, S, y (..., p)) -> S.
    law : callable
        S -> Gaussian.
    """

    start: Callable[[Gaussian], Any]
    predict: Callable[[LinearSystem, Any, Array | float], Any]
    correct: Callable[[LinearSystem, Any, Array], Any]
    law: Callable[[Any], Gaussian]


def predict_law(system: LinearSystem, law: Gaussian, shift: Array | float = 0.0) -> Gaussian:
    """A m + shift,  A P A^T + Q."""
    return Gaussian(apply(system.A, law.mean) + shift, system.A @ law.cov @ system.A.T + system.Q)


def _predict_symmetric(system: LinearSystem, law: Gaussian, shift: Array | float) -> Gaussian:
    mean, cov = predict_law(system, law, shift)
    return Gaussian(mean, symmetric(cov))


def _correct_textbook(system: LinearSystem, law: Gaussian, y: Array) -> Gaussian:
    """K = P H^T (H P H^T + R)^-1,  m + K (y - H m),  (I - K H) P."""
    innovation, H, R = _measured(system, y - apply(system.H, law.mean))
    cross = law.cov @ transpose(H)
    K = gain(cross, H @ cross + R)
    return Gaussian(law.mean + apply(K, innovation), (np.eye(len(system.A), dtype=law.cov.dtype) - K @ H) @ law.cov)


def _correct_symmetrised(system: LinearSystem, law: Gaussian, y: Array) -> Gaussian:
    mean, cov = _correct_textbook(system, law, y)
    return Gaussian(mean, symmetric(cov))


def _correct_joseph(system: LinearSystem, law: Gaussian, y: Array) -> Gaussian:
    """K as above, (I - K H) P (I - K H)^T + K R K^T."""
    return correct(law, system.measure(*law), y)


def _measured(system: LinearSystem, innovation: Array) -> tuple[Array, Array, Array]:
    """Innovation, H and R with the missing (NaN) components taken out."""
    if not any_missing(innovation):
        return innovation, system.H, system.R
    innovation, H, _, R = without_missing(innovation, system.H, system.R, system.R)
    return innovation, H, R


def _predict_root(system: LinearSystem, law: Root, shift: Array | float) -> Root:
    """[A S, Q^(1/2)] made triangular: its product with its transpose is A P A^T + Q."""
    return Root(apply(system.A, law.mean) + shift, _triangular(_beside(system.A @ law.root, square_root(system.Q))))


def _correct_root(system: LinearSystem, law: Root, y: Array) -> Root:
    """Potter's idea with an orthogonal transformation U,

        [R^(1/2)  H S]       [F^(1/2)      0 ]
        [   0       S] U  =  [P H^T F^(-T/2)  S+]

    because both sides times their transposes are [[F, H P], [P H^T, P]].
    """
    innovation, H, R = _measured(system, y - apply(system.H, law.mean))
    p, noise = len(system.H), np.linalg.cholesky(R)
    top, bottom = _beside(noise, H @ law.root), _beside(np.zeros_like(transpose(H)), law.root)
    lower = _triangular(np.concatenate(_broadcast(top, bottom), axis=-2))
    whitened = _forward(lower[..., :p, :p], innovation)
    return Root(law.mean + apply(lower[..., p:, :p], whitened), lower[..., p:, p:])


def _beside(left: Array, right: Array) -> Array:
    return np.concatenate(_broadcast(left, right), axis=-1)


def _broadcast(left: Array, right: Array) -> list[Array]:
    """Both with the same leading axes."""
    lead = np.broadcast_shapes(left.shape[:-2], right.shape[:-2])
    return [np.broadcast_to(matrix, lead + matrix.shape[-2:]) for matrix in (left, right)]


def _triangular(wide: Array) -> Array:
    """Lower triangular L with L L^T = wide wide^T, by Householder's reflections of the columns.

    In the precision of `wide`: numpy.linalg.qr computes float32 in double, which would hide what short words do.
    """
    work, rows = np.array(wide), wide.shape[-2]
    for i in range(rows):
        size = np.abs(work[..., i, i:]).max(axis=-1, keepdims=True)
        v = work[..., i, i:] / np.where(size > 0, size, 1)  # no square leaves the range of short words
        v[..., 0] += np.copysign(np.sqrt((v * v).sum(axis=-1)), v[..., 0])
        square = (v * v).sum(axis=-1)
        factor = 2 / np.where(square > 0, square, 1)
        work[..., i:, i:] -= (apply(work[..., i:, i:], v) * factor[..., None])[..., None] * v[..., None, :]
    return np.tril(work[..., :rows])


def _forward(lower: Array, right: Array) -> Array:
    """The solution x of lower x = right for a triangular matrix, in its precision: (..., p, p), (..., p) -> (..., p)."""
    x = np.zeros(np.broadcast_shapes(lower.shape[:-1], right.shape), dtype=lower.dtype)
    for i in range(right.shape[-1]):
        x[..., i] = (right[..., i] - (lower[..., i, :i] * x[..., :i]).sum(axis=-1)) / lower[..., i, i]
    return x


FORMS: dict[str, Form] = {
    "covariance": Form(lambda law: law, predict_law, _correct_textbook, lambda law: law),
    "symmetrised": Form(lambda law: law, _predict_symmetric, _correct_symmetrised, lambda law: law),
    "joseph": Form(lambda law: law, _predict_symmetric, _correct_joseph, lambda law: law),
    "square-root": Form(
        lambda law: Root(law.mean, square_root(law.cov)),
        _predict_root,
        _correct_root,
        lambda law: Gaussian(law.mean, law.root @ transpose(law.root)),
    ),
}


def form(name: str, system: LinearSystem) -> Form:
    """The arithmetic form of that name; ValueError if there is none, or the system does not allow it."""
    if name not in FORMS:
        raise ValueError(f"no form {name!r} of the Kalman filter; known: {', '.join(FORMS)}")
    if name == "square-root" and np.linalg.eigvalsh(system.R).min() <= 0:
        raise ValueError("the square-root form divides by the noise of the meter: R must be positive definite; use joseph")
    return FORMS[name]


class Run(NamedTuple):
    """A filter's laws along stored measurements: posterior and predicted, each mean (steps, runs, n), cov (steps, runs, n, n)."""

    posterior: Gaussian
    predicted: Gaussian


def run(system: LinearSystem, prior: Gaussian, y: Array, u: Array | None = None, arithmetic: str = "joseph") -> Run:
    """The Kalman filter over stored measurements.

    Parameters
    ----------
    system : LinearSystem
    prior : Gaussian
        Law of x_0: mean (n,) or (runs, n), covariance (n, n) or (runs, n, n).
    y : ndarray (steps, runs, p)
        NaN where a measurement, or a component of it, is missing.
    u : ndarray (steps, runs, m) or (steps, 1, m), optional
        Known input; u[k] acts between y[k] and y[k+1].
    arithmetic : {"joseph", "covariance", "symmetrised", "square-root"}
        All of it runs in the precision of the system's matrices, but for the gain from p > 1 measurements at once: NumPy
        solves float32 equations in double and rounds the solution.

    Returns
    -------
    Run
        Means (steps, runs, n) and covariances (steps, runs, n, n).  Covariances that are the same for all runs, because no
        measurement is missing, are stored once and shown to each run: a read-only view.

    Raises
    ------
    ValueError
        Shapes that do not fit, a prior or inputs that are not finite.
    """
    chosen = form(arithmetic, system)
    if y.ndim != 3 or y.shape[2] != len(system.H):
        raise ValueError(f"measurements must have the shape (steps, runs, {len(system.H)}), got {y.shape}")
    runs, n, dtype = y.shape[1], len(system.A), system.A.dtype
    _check_input(system, u, len(y), runs)
    _check_prior(prior, runs, n)
    mean = np.broadcast_to(prior.mean, (runs, n)).astype(dtype)
    state = chosen.start(Gaussian(mean, np.asarray(prior.cov).astype(dtype)))
    predicted, posterior = [], []
    for k, measurement in enumerate(y.astype(dtype)):
        predicted.append(chosen.law(state))
        state = chosen.correct(system, state, measurement)
        posterior.append(chosen.law(state))
        state = chosen.predict(system, state, system.input(None if u is None else u[k].astype(dtype)))
    return Run(stacked(posterior), stacked(predicted))


def _check_input(system: LinearSystem, u: Array | None, steps: int, runs: int) -> None:
    if u is None:
        return
    if system.B is None:
        system.input(u)  # says what to do
        return
    m = system.B.shape[1]
    if u.ndim != 3 or len(u) != steps or u.shape[1] not in (1, runs) or u.shape[2] != m:
        raise ValueError(f"inputs must have the shape ({steps}, {runs}, {m}), or ({steps}, 1, {m}) for all runs; got {u.shape}")
    if not np.isfinite(u).all():
        raise ValueError("inputs must be finite: give a missing input the value that the object had, or its mean with a larger Q")


def _check_prior(prior: Gaussian, runs: int, n: int) -> None:
    mean, cov = np.shape(prior.mean), np.shape(prior.cov)
    if mean not in ((n,), (1, n), (runs, n)):
        raise ValueError(f"the prior's mean must have the shape ({n},) or ({runs}, {n}), got {mean}")
    if cov not in ((n, n), (1, n, n), (runs, n, n)):
        raise ValueError(f"the prior's covariance must have the shape ({n}, {n}) or ({runs}, {n}, {n}), got {cov}")
    if not (np.isfinite(prior.mean).all() and np.isfinite(prior.cov).all()):
        raise ValueError("the prior must be finite: for an unknown state give a large variance, or start from measurements")


def stacked(laws: list[Gaussian]) -> Gaussian:
    """Laws of successive steps as one, the step before everything: mean (steps, runs, n), cov (steps, runs, n, n)."""
    mean = np.stack([law.mean for law in laws])
    covs = np.stack(np.broadcast_arrays(*(law.cov for law in laws)))
    by_run = covs if covs.ndim == mean.ndim + 1 else covs[:, None]
    return Gaussian(mean, np.broadcast_to(by_run, (*mean.shape, mean.shape[-1])))


class Trajectories(NamedTuple):
    """Simulated states x (steps, runs, n) and measurements y (steps, runs, p)."""

    x: Array
    y: Array


def simulate(system: LinearSystem, prior: Gaussian, steps: int, runs: int, seed: int, u: Array | None = None) -> Trajectories:
    """Trajectories of the system with normal noises, from x_0 drawn from the prior.

    Parameters
    ----------
    system : LinearSystem
    prior : Gaussian
        Law of x_0: mean (n,) or (runs, n), covariance (n, n).
    steps, runs, seed : int
    u : ndarray (steps, runs, m) or (steps, 1, m), optional
        Known input; u[k] acts between x[k] and x[k+1].
    """
    _check_input(system, u, steps, runs)
    _check_prior(prior, runs, len(system.A))
    rng = np.random.default_rng(seed)

    def noise(cov: Array) -> Array:
        return rng.standard_normal((runs, len(cov))) @ square_root(cov).T

    state, x, y = prior.mean + noise(prior.cov), [], []
    for k in range(steps):
        x.append(state)
        y.append(apply(system.H, state) + noise(system.R))
        state = apply(system.A, state) + system.input(None if u is None else u[k]) + noise(system.Q)
    return Trajectories(np.stack(x), np.stack(y))


class Covariances(NamedTuple):
    """Covariance analysis: predicted (steps, n, n), posterior (steps, n, n), gains (steps, n, p)."""

    predicted: Array
    posterior: Array
    gains: Array


def covariances(system: LinearSystem, prior_cov: Array, steps: int, gains: Array | None = None) -> Covariances:
    """Accuracy in advance: covariances of the error, which no measurement enters.

    Parameters
    ----------
    system : LinearSystem
        The *true* matrices.
    prior_cov : ndarray (n, n)
        True covariance of the error before y_0.
    steps : int
    gains : ndarray (steps, n, p) or (n, p), optional
        Gains of another linear filter with the same A and H (one of a wrong model, or constant): its true errors are then
        found, P = (I - K H) P^- (I - K H)^T + K R K^T for any K.  By default the optimal gains.
    """
    given = None if gains is None else np.broadcast_to(gains, (steps, len(system.A), len(system.H)))
    cov = np.asarray(prior_cov, dtype=float)
    rows = []
    for k in range(steps):
        K = gain(cov @ system.H.T, system.measure(np.zeros(len(cov)), cov).F) if given is None else given[k]
        rest = np.eye(len(cov)) - K @ system.H
        posterior = symmetric(rest @ cov @ rest.T + K @ system.R @ K.T)
        rows.append((cov, posterior, K))
        cov = symmetric(system.A @ posterior @ system.A.T + system.Q)
    return Covariances(*(np.stack(column) for column in zip(*rows, strict=True)))


class Steady(NamedTuple):
    """The stationary Kalman filter: predicted (n, n), posterior (n, n), gain (n, p)."""

    predicted: Array
    posterior: Array
    gain: Array


def steady_state(system: LinearSystem) -> Steady:
    """Limit of the covariances and of the gain, from the discrete algebraic Riccati equation.

    P = A (P - P H^T (H P H^T + R)^-1 H P) A^T + Q

    Raises
    ------
    ValueError
        There is no limit that the filter reaches from every start: a part of the state is neither seen nor decays, or has
        no noise.
    """
    try:
        predicted = scipy.linalg.solve_discrete_are(system.A.T, system.H.T, system.Q, system.R)
    except (np.linalg.LinAlgError, ValueError):
        raise ValueError(
            "the Riccati equation has no stabilising solution: a part of the state is neither seen by the meter nor decays, "
            "or has no noise; use covariances(system, ...) to follow the filter step by step"
        ) from None
    law = Gaussian(np.zeros(len(system.A)), symmetric(predicted))
    measurement = system.measure(*law)
    return Steady(law.cov, correct(law, measurement, measurement.h).cov, gain(law.cov @ system.H.T, measurement.F))
