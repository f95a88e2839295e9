r"""Logic-dynamic filters of optimal structure: what a memory tells of state and mode, found
off-line.

Such a filter of a model that jumps carries no covariances and no probabilities from step to step,
but zeta_k only (`Memory`). Before it predicts it asks what zeta_k says of the state in each mode i,
and of the mode, over the trajectories in mode i:

    u_i = Gamma_i zeta + chi_i  with residual covariance T_i
        regression of x_k on zeta_k, given i_k = i
    xi_i ∝ q_i N(zeta; M[zeta | i], Cov(zeta | i))

and (xi_i, u_i, T_i) take the place of (mu_i, z_i, p_i) in the prediction of the logic-dynamic AOF
(`multiple_models`).

    `logic_dynamic_fos`   zeta_k = z_k                             (ФОСлд)
    `logic_dynamic_fkp`   zeta_k = (y_k, y_{k-1}, ..., y_{k-l+1})  (ФКПлд, finite memory)
    `logic_dynamic_fbp`   zeta_k = (z_k, z_{k-1}, ..., z_{k-l+1})  (ФБПлд, high order)

The memories are Rudenko's (2010), a mode beside the state as in his logic-dynamic filters.

Without jumps they are `fos`, `fkp` and `fbp`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kfcourse.filters.base import State, initial_state
from kfcourse.filters.designed import Design, Equations, Regression
from kfcourse.filters.multiple_models import (
    Modes,
    corrected,
    expectations,
    mixture,
    modes_given,
    onward,
)
from kfcourse.filters.optimal_structure import (
    STEPS,
    Memory,
    Remembered,
    checked_memory,
)
from kfcourse.laws import Array, Gaussian, Measurement
from kfcourse.symbolic.averaging import check_averaged
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.structure import Structure, expect_each

# of the largest variance, that a law of zeta without width in a direction has a density
RIDGE = 1e-12


def logic_dynamic_fos(model: JumpModel, structures: Sequence[Structure]) -> Design:
    """The logic-dynamic FOS, with the structural functions of each mode.

    Raises
    ------
    ModelError
        A component is an angle; transitions depend on the state.
    """
    return _remembering("fos", model, structures, Memory())


def logic_dynamic_fkp(
    model: JumpModel, structures: Sequence[Structure], memory: int = STEPS
) -> Design:
    """The logic-dynamic filter with finite memory: what the last `memory` measurements tell of
    state and mode.

    Raises
    ------
    ValueError
        `memory` is not a positive whole number.
    ModelError
        As of `logic_dynamic_fos`.
    """
    return _remembering(
        f"fkp{checked_memory(memory)}", model, structures, Memory(estimates=0, measurements=memory)
    )


def logic_dynamic_fbp(
    model: JumpModel, structures: Sequence[Structure], memory: int = STEPS
) -> Design:
    """The logic-dynamic filter of high order: what the last `memory` estimates tell; errors as of
    `logic_dynamic_fkp`."""
    return _remembering(f"fbp{checked_memory(memory)}", model, structures, Memory(estimates=memory))


def _remembering(
    name: str, model: JumpModel, structures: Sequence[Structure], memory: Memory
) -> Design:
    """The construction.  A missing measurement is remembered as its prediction, the mean over the
    modes."""
    what = f"the logic-dynamic {name.upper()}"
    check_averaged(model, what)
    expect_each(structures, what)

    def init(runs: int) -> State:
        start = initial_state(model.modes[0])(runs)
        expected = np.tile(model.first, (runs, 1))
        return start._replace(
            memory=Modes(expected, expected, (start.predicted,) * len(structures))
        )

    def equations(state: State, y: Array) -> Equations:
        k, before = state.step, state.memory
        now = [structure.at(k) for structure in structures]
        measured = expectations(now, before)
        of_modes, mu = corrected(before, measured, y)
        posterior = mixture(of_modes, mu)
        h = sum(before.expected[:, i, None] * each.h for i, each in enumerate(measured))
        seen = np.where(np.isnan(y), h, y)
        kept = (before.kept or Remembered()).and_now(posterior.mean, seen, memory, ())
        zeta = kept.regressor
        constant, unit = np.zeros((len(y), 1)), np.eye(zeta.shape[1])

        def itself(x: Array, x_next: Array) -> Array:
            return zeta

        laws, weights, densities = [], model.law_at(k), []
        for i in range(len(now)):
            if not weights[i] > 0:  # nobody is there
                laws.append(posterior)
                densities.append(Measurement(zeta, unit, unit, unit))
                continue
            fit = yield Regression(lambda x, x_next: x, zeta, i)
            laws.append(Gaussian(fit(zeta), fit.residual))
            fit = yield Regression(itself, constant, i)  # mean and covariance of zeta
            cov = fit.residual + RIDGE * max(fit.residual.max(), np.finfo(float).tiny) * unit
            densities.append(Measurement(fit.offset, unit, cov, cov))
        xi, _ = modes_given(np.tile(weights, (len(y), 1)), densities, zeta)
        expected, shares = onward(xi, model.transition_at(k))
        following = [
            mixture([now[j].predict(*law) for law in laws], shares[:, :, j])
            for j in range(len(now))
        ]
        return State(
            k + 1,
            posterior,
            mixture(following, expected),
            Modes(mu, expected, tuple(following), kept),
        )

    return Design(f"{name}-jump-{structures[0].name}", model.modes[0], equations, start=init)
