"""The Kalman filter for given matrices along stored measurements, and simulation.

    x_{k+1} = A x_k + B u_k + v_k,  v ~ N(0, Q)        u_k: known input
    y_k     = H x_k + w_k,          w ~ N(0, R)

Time runs as in the lab: a filter starts from the law of x_0, corrects with y_0, then predicts x_1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kfcourse.errors import expect_sizes
from kfcourse.laws import Array, Gaussian, apply, square_root, stacked
from kfcourse.linear.arithmetic import form
from kfcourse.linear.system import LinearSystem


class Trajectories(NamedTuple):
    """Stored trajectories: states x (steps, runs, n), measurements y (steps, runs, p)."""

    x: Array
    y: Array


class Run(NamedTuple):
    """A filter's laws along stored measurements: posterior and predicted, each mean (steps, runs,
    n), cov (steps, runs, n, n)."""

    posterior: Gaussian
    predicted: Gaussian


def run(
    system: LinearSystem,
    prior: Gaussian,
    y: Array,
    u: Array | None = None,
    arithmetic: str = "joseph",
) -> Run:
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
        All of it runs in the precision of the system's matrices, but for the gain from p > 1
        measurements at once: NumPy solves float32 equations in double and rounds the solution.

    Returns
    -------
    Run
        Means (steps, runs, n) and covariances (steps, runs, n, n).  Covariances that are the same
        for all runs, because no measurement is missing, are stored once and shown to each run: a
        read-only view.

    Raises
    ------
    ValueError
        Shapes that do not fit; no measurements, infinite ones, a prior or inputs that are not
        finite.
    """
    chosen = form(arithmetic, system)
    if y.ndim != 3 or y.shape[2] != len(system.H) or not y.size or np.isinf(y).any():
        raise ValueError(
            f"measurements must be finite and have the shape (steps, runs, {len(system.H)}), with "
            f"NaN where one is missing; got {y.shape}, {int(np.isinf(y).sum())} of them infinite"
        )
    runs, n, dtype = y.shape[1], len(system.A), system.A.dtype
    _check_input(system, u, len(y), runs)
    check_prior(prior, runs, n)
    mean = np.broadcast_to(prior.mean, (runs, n)).astype(dtype)
    state = chosen.start(Gaussian(mean, np.asarray(prior.cov).astype(dtype)))
    predicted, posterior = [], []
    for k, measurement in enumerate(y.astype(dtype)):
        predicted.append(chosen.law(state))
        state = chosen.correct(system, state, measurement)
        posterior.append(chosen.law(state))
        state = chosen.predict(
            system, state, system.input(None if u is None else u[k].astype(dtype))
        )
    return Run(stacked(posterior), stacked(predicted))


def _check_input(system: LinearSystem, u: Array | None, steps: int, runs: int) -> None:
    if u is None or system.B is None:
        system.input(u)  # says what to do where there is no B
        return
    m = system.B.shape[1]
    if u.shape not in ((steps, runs, m), (steps, 1, m)) or not np.isfinite(u).all():
        raise ValueError(
            f"inputs must be finite and have the shape ({steps}, {runs}, {m}), or ({steps}, 1, "
            f"{m}) for all runs; got {u.shape}: give a missing input the value that the object "
            "had, or its mean with a larger Q"
        )


def check_prior(prior: Gaussian, runs: int, n: int) -> None:
    """ValueError unless this is a law of n components, for each of so many runs or for all."""
    mean, cov = np.shape(prior.mean), np.shape(prior.cov)
    shapes = (n,), (1, n), (runs, n)
    if mean not in shapes or cov not in [(*shape, n) for shape in shapes]:
        raise ValueError(
            f"the prior's mean must have the shape ({n},) or ({runs}, {n}), its covariance ({n}, "
            f"{n}) or ({runs}, {n}, {n}); got {mean} and {cov}"
        )
    if not (np.isfinite(prior.mean).all() and np.isfinite(prior.cov).all()):
        raise ValueError(
            "the prior must be finite: for an unknown state give a large variance, or start from "
            "measurements"
        )
    if (np.diagonal(prior.cov, axis1=-2, axis2=-1) < 0).any():
        raise ValueError(
            f"the prior's variances must not be negative, got the covariance "
            f"{np.asarray(prior.cov).tolist()}"
        )


def simulate(
    system: LinearSystem,
    prior: Gaussian,
    steps: int,
    runs: int,
    seed: int | np.random.Generator,
    u: Array | None = None,
) -> Trajectories:
    """Trajectories of the system with normal noises, from x_0 drawn from the prior.

    Parameters
    ----------
    system : LinearSystem
    prior : Gaussian
        Law of x_0: mean (n,) or (runs, n), covariance (n, n).
    steps, runs : int
    seed : int or numpy.random.Generator
    u : ndarray (steps, runs, m) or (steps, 1, m), optional
        Known input; u[k] acts between x[k] and x[k+1].
    """
    expect_sizes(steps=steps, runs=runs)
    _check_input(system, u, steps, runs)
    check_prior(prior, runs, len(system.A))
    rng = np.random.default_rng(seed)

    def noise(cov: Array) -> Array:
        return rng.standard_normal((runs, len(cov))) @ square_root(cov).T

    state, x, y = prior.mean + noise(prior.cov), [], []
    for k in range(steps):
        x.append(state)
        y.append(apply(system.H, state) + noise(system.R))
        state = apply(system.A, state) + system.input(None if u is None else u[k]) + noise(system.Q)
    return Trajectories(np.stack(x), np.stack(y))
