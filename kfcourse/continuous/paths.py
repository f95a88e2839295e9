"""Trajectories of a continuous model, simulated."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kfcourse.continuous.model import ContinuousModel, compiled
from kfcourse.errors import expect, expect_positive, expect_sizes
from kfcourse.laws import Array, apply, square_root
from kfcourse.montecarlo.designing import NotFinite


class Path(NamedTuple):
    """Trajectories of a continuous model, seen with the step T.

    step : float
    x : (steps + 1, runs, n), the state at the times 0, T, ..., steps T
    y : (steps, runs, p), the mean of y(t) over each step
    """

    step: float
    x: Array
    y: Array


def simulate(
    model: ContinuousModel,
    step: float,
    steps: int,
    runs: int,
    seed: int | np.random.Generator,
    substeps: int = 1,
) -> Path:
    """Trajectories by the Euler-Maruyama scheme with the step T / substeps.

    x' = x + dt f(x, t) + g(x, t) N(0, S_xi dt / 2),     y_k = 1/dt Integral S(x, t) dt + N(0, N /
    (2 dt))

    The error of a trajectory is of the order dt if g is constant, and sqrt(dt) if g depends on x;
    that of its moments is of the order dt in both cases.

    Raises
    ------
    ValueError
        A step that is not positive, sizes that are not positive whole numbers.
    NotFinite
        The trajectories became infinite.
    """
    expect(model, ContinuousModel, "simulate")
    expect_positive(step=step)
    expect_sizes(steps=steps, runs=runs, substeps=substeps)
    rng, dt = np.random.default_rng(seed), step / substeps
    formulas = [list(model.drift), model.diffusion, list(model.signal)]
    equations = compiled(model, [model.x], formulas)
    xi_root, n_root = (
        square_root(model.spectral_density * dt / 2),
        square_root(model.noise_density / (2 * dt)),
    )
    x = np.empty((steps + 1, runs, model.n))
    y = np.zeros((steps, runs, model.p))
    now = model.prior.mean + rng.standard_normal((runs, model.n)) @ square_root(model.prior.cov).T
    x[0] = now
    # what becomes infinite is reported below
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for k in range(steps):
            for part in range(substeps):
                f, g, S = equations((k + part / substeps) * step, now)
                y[k] += (S + rng.standard_normal((runs, model.p)) @ n_root.T) / substeps
                now = now + dt * f + apply(g, rng.standard_normal((runs, len(xi_root))) @ xi_root.T)
            x[k + 1] = now
            if not (np.isfinite(now).all() and np.isfinite(y[k]).all()):
                raise NotFinite(
                    f"step {k}, time {(k + 1) * step:g}: a trajectory became infinite; check the "
                    f"model, or use more substeps"
                )
    return Path(step, x, y)
