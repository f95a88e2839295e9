"""Motion in continuous time, and its exact transition over any interval.

    dx = (A x + B u(t)) dt + dW,   M[dW dW^T] = Q_c dt

Over an interval dt in which u does not change, with nothing approximated,

    x(t + dt) = Phi x(t) + Gamma u + v,   v ~ N(0, Q)
    Phi = exp(A dt),   Gamma = int_0^dt exp(A s) ds B,   Q = int_0^dt exp(A s) Q_c exp(A s)^T ds
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.linalg

from kfcourse.errors import expect_not_negative
from kfcourse.laws import Array, Gaussian, apply, is_covariance, square_root, symmetric
from kfcourse.linear.runs import check_prior

# s: moments that differ by less are the same but for rounding; stamps of Unix hold 2e-7 s
ROUNDING = 1e-6


class Transition(NamedTuple):
    """x' = A x + B u + v, v ~ N(0, Q): Phi (n, n), Gamma (n, m), Q (n, n), named as in
    `kfcourse.linear.runs.LinearSystem`."""

    A: Array
    B: Array
    Q: Array


@dataclass(frozen=True)
class Dynamics:
    """A linear stochastic differential equation with constant coefficients.

    Attributes
    ----------
    A : ndarray (n, n)
        In 1/s.
    Qc : ndarray (n, n)
        Intensity of the white noise, M[w(t) w(s)^T] = Qc delta(t - s): its two-sided spectral
        density, in (units of x)^2 / s.
    B : ndarray (n, m), optional
        Effect of the known input.

    Raises
    ------
    ValueError
        Shapes that do not fit, numbers that are not finite, an intensity that is no covariance.
    """

    A: Array
    Qc: Array
    B: Array | None = None

    def __post_init__(self) -> None:
        A, Qc = np.asarray(self.A, dtype=float), np.asarray(self.Qc, dtype=float)
        n = len(A)
        B = np.zeros((n, 0)) if self.B is None else np.asarray(self.B, dtype=float)
        if A.shape != (n, n) or Qc.shape != (n, n) or B.ndim != 2 or len(B) != n:
            raise ValueError(
                f"A and Qc must be square matrices (n, n), and B (n, number of inputs); got the "
                f"shapes {A.shape}, {Qc.shape} and {B.shape}"
            )
        for name, matrix in (("A", A), ("Qc", Qc), ("B", B)):
            if not np.isfinite(matrix).all():
                raise ValueError(f"{name} must be finite, got {matrix.tolist()}")
            object.__setattr__(self, name, matrix)
        if not (np.array_equal(Qc, Qc.T) and is_covariance(Qc)):
            raise ValueError(
                f"Qc is an intensity of noise: symmetric and not negative; got {Qc.tolist()}"
            )

    @property
    def inputs(self) -> int:
        """Number of known inputs."""
        return 0 if self.B is None else self.B.shape[1]

    def over(self, dt: float) -> Transition:
        """The exact transition over dt seconds, to rounding.

        By Van Loan's exponential (1978) for a part h of dt with |A| h <= 1/2,

            exp([[A, Q_c, B], [0, -A^T, 0], [0, 0, 0]] h)
                = [[Phi, X, Gamma], [0, Phi^-T, 0], [0, 0, I]],
            Q = X Phi^T

        and then doubled until h is dt, as exp(-A dt) may be huge where exp(A dt) is small:

            Phi(2h) = Phi Phi,   Gamma(2h) = Gamma + Phi Gamma,   Q(2h) = Q + Phi Q Phi^T

        Raises
        ------
        ValueError
            dt negative or not finite.
        """
        expect_not_negative(interval=dt)
        n, size = len(self.A), float(np.abs(self.A).sum(axis=1).max())
        doublings = max(0, math.ceil(math.log2(max(2 * size * dt, 1.0))))
        block = np.zeros((2 * n + self.inputs,) * 2)
        block[:n, :n], block[:n, n : 2 * n], block[:n, 2 * n :] = self.A, self.Qc, self.B
        block[n : 2 * n, n : 2 * n] = -self.A.T
        Phi, X, Gamma = np.split(
            scipy.linalg.expm(block * (dt / 2**doublings))[:n], [n, 2 * n], axis=1
        )
        Q = X @ Phi.T
        for _ in range(doublings):
            Q, Gamma, Phi = Q + Phi @ Q @ Phi.T, Gamma + Phi @ Gamma, Phi @ Phi
        return Transition(Phi, Gamma, symmetric(Q))


class Inputs(NamedTuple):
    """A known input, sampled by a fast sensor: values[i], (runs, m) or (1, m), acts from times[i]
    until times[i + 1].

    times (s,) ascending, values (s, runs, m).  The last value acts for ever.
    """

    times: Array
    values: Array


class Path(NamedTuple):
    """True states (s, runs, n) at times (s,): as a function, it looks up the states at some of
    these times."""

    times: Array
    states: Array

    def __call__(self, times: Array) -> Array:
        """States (len(times), runs, n); ValueError for a time that is not stored."""
        index = np.minimum(
            np.searchsorted(self.times, np.asarray(times) - ROUNDING), len(self.times) - 1
        )
        missing = np.flatnonzero(np.abs(self.times[index] - times) > 2 * ROUNDING)
        if len(missing):
            raise ValueError(
                f"the path is not known at t = {np.asarray(times)[missing[0]]:.16g} s; sample it "
                f"at all moments that are needed: "
                "np.unique(np.concatenate([outputs, *(sensor.captures(duration) for sensor in "
                "sensors)]))"
            )
        return self.states[index]


Mover = Callable[[Array, float, float], Array]
Predictor = Callable[[Gaussian, float, float], Gaussian]


def motion(
    dynamics: Dynamics, inputs: Inputs | None = None
) -> tuple[Callable[[float], Transition], Mover]:
    """Transitions over intervals, each found once, and the noiseless motion (x (..., n), start,
    end) -> x.

    Raises
    ------
    ValueError
        Inputs that do not fit the dynamics, or begin after they are needed.
    """
    over = lru_cache(dynamics.over)  # sensors of fixed rates have a few intervals
    if inputs is None:
        if dynamics.inputs:
            raise ValueError(
                f"the dynamics have {dynamics.inputs} known input(s); give them: "
                f"inputs=Inputs(times, values)"
            )
        return over, lambda x, start, end: apply(over(end - start).A, x)
    times, values = np.asarray(inputs.times, dtype=float), np.asarray(inputs.values, dtype=float)
    _check_inputs(dynamics, times, values)

    def move(x: Array, start: float, end: float) -> Array:
        first = int(np.searchsorted(times, start, side="right")) - 1
        if first < 0:
            raise ValueError(
                f"the inputs begin at t = {times[0]:.16g} s, but are needed from t = {start:.16g} s"
            )
        last = int(np.searchsorted(times, end, side="left"))
        edges = [start, *times[first + 1 : last].tolist(), end]
        for i, (left, right) in enumerate(pairwise(edges)):
            step = over(right - left)
            x = apply(step.A, x) + apply(step.B, values[first + i])
        return x

    return over, move


def predictor(dynamics: Dynamics, inputs: Inputs | None = None) -> Predictor:
    """(law, start, end) -> law: the mean moves with the inputs, the covariance needs one step,
    whatever they are.

    Phi m + Gamma u + ...,   Phi P Phi^T + Q
    """
    over, move = motion(dynamics, inputs)

    def predict(law: Gaussian, start: float, end: float) -> Gaussian:
        if end == start:
            return law
        step = over(end - start)
        return Gaussian(move(law.mean, start, end), symmetric(step.A @ law.cov @ step.A.T + step.Q))

    return predict


def _check_inputs(dynamics: Dynamics, times: Array, values: Array) -> None:
    fits = values.ndim == 3 and (len(values), values.shape[2]) == (len(times), dynamics.inputs)
    if not (fits and np.isfinite(values).all() and _ascending(times)):
        raise ValueError(
            f"the inputs need ascending times (s,) and values (s, runs or 1, {dynamics.inputs}), "
            f"all finite, got {times.shape} and {values.shape}: fill a gap of the fast sensor by "
            "what it would have said, and enlarge Qc"
        )


def _ascending(times: Array) -> bool:
    return bool(len(times) and np.isfinite(times).all() and (np.diff(times) > 0).all())


def sample(
    dynamics: Dynamics,
    prior: Gaussian,
    times: Array,
    runs: int,
    seed: int | np.random.Generator,
    inputs: Inputs | None = None,
) -> Path:
    """True paths of the dynamics, exact at the given times.

    Parameters
    ----------
    dynamics : Dynamics
    prior : Gaussian
        Law of the state at times[0]: mean (n,) or (runs, n), covariance (n, n).
    times : ndarray (s,)
        Ascending, in seconds: all moments at which the path will be needed.
    runs : int
    seed : int or Generator
    inputs : Inputs, optional

    Returns
    -------
    Path
        times (s,) and states (s, runs, n).

    Raises
    ------
    ValueError
        Times not ascending, a prior or inputs that do not fit.
    """
    times = np.asarray(times, dtype=float)
    if not _ascending(times):
        raise ValueError(
            "times must be a finite ascending vector; np.unique sorts and removes what is twice"
        )
    rng, n = np.random.default_rng(seed), len(dynamics.A)
    check_prior(prior, runs, n)
    over, move = motion(dynamics, inputs)
    states = np.empty((len(times), runs, n))
    states[0] = prior.mean + rng.standard_normal((runs, n)) @ square_root(np.asarray(prior.cov)).T
    for k in range(1, len(times)):
        start, end = float(times[k - 1]), float(times[k])
        noise = rng.standard_normal((runs, n)) @ square_root(over(end - start).Q).T
        states[k] = move(states[k - 1], start, end) + noise
    return Path(times, states)
