r"""The posterior Cramer-Rao bound: no estimate errs less, by what the densities' slopes tell.

    M[(x_k - z_k)(x_k - z_k)^T] >= J_k^-1,
    J_{k+1} = D22 - D12^T (J_k + D11)^-1 D12 + M[I_y(x_{k+1})],
    J_0 = d^-1 + M[I_y(x_0)]

With normal laws x' | x ~ N(m(x), S(x)), and y | x likewise, the means over true trajectories are

    D11 = M[I_x(x)],    D12 = -M[m_x^T S^-1],    D22 = M[S^-1],
    I_ij = m_i^T S^-1 m_j + 1/2 tr(S^-1 S_i S^-1 S_j)
        (an index is a derivative by a component of x)

The second term is what the size of the noise tells of x.  For a linear model with normal noises
J^-1 is the Kalman filter's covariance; for others it lies below the exact filter's error, and it
may be far below: J is a mean, and the few states at which the densities are sharp count in it most,
while they hardly count in a mean square of errors.

Van Trees (1968); Tichavsky, Muravchik, Nehorai (1998).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import sympy as sp

from kfcourse.errors import expect
from kfcourse.filters.densities import law_given_state
from kfcourse.laws import Array, Gaussian, symmetric, transpose
from kfcourse.montecarlo.ensemble import simulate
from kfcourse.montecarlo.statistics import Estimate, means_without_each
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.sides import jumps

# of one trajectory in a mean of information: where it is more, the mean is infinite, or as good as
SHARE = 0.05


def posterior_bound(model: Model, runs: int, steps: int, seed: int) -> Estimate:
    """J_k^-1, the covariances below which no filter's errors are, (steps, n, n); after y_k, as the
    filters' estimates.

    Its standard error is that of the means over trajectories, by the jackknife over batches.

    Parameters
    ----------
    model : Model
        Both noises enter linearly; their covariances and the prior's are regular.  Angles count as
        numbers.
    runs, steps : int
        Trajectories over which the means are taken.
    seed : int

    Raises
    ------
    ModelError
        A noise enters nonlinearly, or leaves a component without noise, or the prior has none
        there: no density then.
    ValueError
        The information is infinite, as where a noise vanishes at a state or an equation jumps
        there: the bound is zero then, and says nothing.

    Examples
    --------
    >>> from kfcourse import Model
    >>> from kfcourse.montecarlo.cramer_rao import posterior_bound
    >>> model = Model.define("0.9*x + v", "x + 2*w")
    >>> posterior_bound(model, runs=10, steps=2, seed=1).value.ravel().round(4).tolist()
    [0.8, 1.1671]
    """
    expect(model, Model, "posterior_bound")
    try:
        np.linalg.cholesky(model.prior.cov)
    except np.linalg.LinAlgError:
        message = (
            "the prior leaves a component, or a sum of some, without variance: there is no "
            "density, and no bound of this kind"
        )
        raise ModelError(message) from None
    object_ = _information(
        model, model.difference_equation("this bound"), model.v, model.state_noise, "state"
    )
    meter = _information(model, model.meter_equation, model.w, model.meter_noise, "meter")
    J = np.linalg.inv(model.prior.cov)
    bounds = []
    for k, x in enumerate(simulate(model, runs, steps, seed).x):
        information, *_ = meter(x, k)
        J = J + _mean(information, "meter", k)
        bounds.append(np.linalg.inv(J))
        of_state, mixed, of_next = object_(x, k)
        D12 = -means_without_each(mixed)
        J = _mean(of_next, "state", k) - transpose(D12) @ np.linalg.solve(
            J + _mean(of_state, "state", k), D12
        )
    return Estimate.jackknife(np.moveaxis(symmetric(np.stack(bounds)), 1, -1))


def _information(
    model: Model, equation: sp.MatrixBase, noise: Sequence[sp.Symbol], law: Gaussian, what: str
) -> Callable[[Array, int], tuple[Array, Array, Array]]:
    """(x (runs, n), k) -> I (runs, n, n), m_x^T S^-1 (runs, n, r), S^-1 (runs, r, r) of what the
    equation makes of x."""
    steps = [
        jump
        for jump in equation.atoms(sp.sign, sp.Heaviside, sp.floor)
        if jump.has(*model.x, *noise)
    ]
    if steps or any(jumps(jump, [*model.x, *noise]) for jump in equation.atoms(sp.Piecewise)):
        raise ValueError(
            _infinite(what, "it jumps, and a jump has no slope: slopes elsewhere do not tell of it")
        )
    mean, cov = law_given_state(model, what, equation, noise, law)
    S = cov.subs(model.values).applyfunc(sp.expand)
    if S.det().expand() == 0:
        raise ModelError(
            f"the {what} equation leaves a component without noise: there is no density, and no "
            f"bound of this kind"
        )
    slope = mean.subs(model.values).jacobian(sp.Matrix(model.x))
    functions = model.compiled([model.x], [slope, S, *(S.diff(x) for x in model.x)])

    def at(x: Array, k: int) -> tuple[Array, Array, Array]:
        slope, S, *changes = (
            np.broadcast_to(values, (len(x), *values.shape[-2:])) for values in functions(x, k=k)
        )
        precision = np.linalg.inv(S)
        mixed = transpose(slope) @ precision
        relative = np.stack([precision @ change for change in changes], axis=1)  # (runs, n, r, r)
        return (
            mixed @ slope + 0.5 * np.einsum("aiuv,ajvu->aij", relative, relative),
            mixed,
            precision,
        )

    return at


def _mean(information: Array, what: str, k: int) -> Array:
    """Its means over the trajectories, (1 + batches, ...); ValueError if they are infinite, as far
    as these can tell."""
    parts = np.diagonal(information, axis1=-2, axis2=-1)
    total = parts.sum(axis=0)
    if len(parts) > 1 and (parts.max(axis=0) > max(SHARE, 2 / len(parts)) * total).any():
        raise ValueError(
            _infinite(
                what, f"at step {k} it hangs on one trajectory in {len(parts)}; or take more runs"
            )
        )
    return means_without_each(information)


def _infinite(what: str, why: str) -> str:
    return (
        f"the {what} equation's information is infinite, and infinite information bounds no "
        f"error ({why})"
    )
