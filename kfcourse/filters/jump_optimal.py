r"""The logic-dynamic filter of optimal structure: what the estimate alone tells of state and mode, found off-line.

The FOS of a model that jumps carries no covariances and no probabilities from step to step, but z_k only.  Before it predicts it
asks what z_k says of the state in each mode i, and of the mode, over the trajectories that are in mode i:

    u_i = Gamma_i z + chi_i  with residual covariance T_i          regression of x_k on z_k, given i_k = i
    xi_i ~ q_i N(z; M[z | i], Cov(z | i))

and (xi_i, u_i, T_i) take the place of (mu_i, z_i, p_i) in the prediction of the logic-dynamic AOF (`multiple_models`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kfcourse.filters.base import State, initial_state
from kfcourse.filters.designed import Design, Equations, Regression
from kfcourse.filters.multiple_models import Modes, each_once, mixture, modes_given, moving_alike, onward
from kfcourse.laws import Array, Gaussian, Measurement, correct
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import Structure

RIDGE = 1e-12  # of the largest variance, that a law of z without width in a direction has a density


def logic_dynamic_fos(model: JumpModel, structures: Sequence[Structure]) -> Design:
    """The logic-dynamic FOS, with the structural functions of each mode.

    Raises
    ------
    ModelError
        A component is an angle; transitions depend on the state.
    """
    model.without_state("the logic-dynamic FOS")
    if model.angles.x or model.angles.y:
        raise ModelError("the logic-dynamic FOS takes no components that are angles")

    alike = moving_alike(structures)

    def init(runs: int) -> State:
        start = initial_state(model.modes[0])(runs)
        expected = np.tile(model.first, (runs, 1))
        return start._replace(memory=Modes(expected, expected, (start.predicted,) * len(structures)))

    def equations(state: State, y: Array) -> Equations:
        k, memory = state.step, state.memory
        now = [structure.at(k) for structure in structures]
        expectations = [one.measure(*prior) for one, prior in zip(now, memory.predicted, strict=True)]
        corrected = [correct(prior, one, y) for prior, one in zip(memory.predicted, expectations, strict=True)]
        mu, _ = modes_given(memory.expected, expectations, y)
        posterior = mixture(corrected, mu)
        z, constant, unit = posterior.mean, np.zeros((len(y), 1)), np.eye(posterior.mean.shape[1])

        def itself(x: Array, x_next: Array) -> Array:
            return z

        laws, weights, densities = [], model.law_at(k), []
        for i in range(len(now)):
            if not weights[i] > 0:  # nobody is there
                laws.append(posterior)
                densities.append(Measurement(z, unit, unit, unit))
                continue
            fit = yield Regression(lambda x, x_next: x, z, i)
            laws.append(Gaussian(fit(z), fit.residual))
            fit = yield Regression(itself, constant, i)  # mean and covariance of z
            cov = fit.residual + RIDGE * max(fit.residual.max(), np.finfo(float).tiny) * unit
            densities.append(Measurement(fit.offset, unit, cov, cov))
        xi, _ = modes_given(np.tile(weights, (len(y), 1)), densities, z)
        expected, shares = onward(xi, model.transition_at(k))
        predict = each_once(now, alike)
        following = [mixture([predict(j, law) for law in laws], shares[:, :, j]) for j in range(len(now))]
        return State(k + 1, posterior, mixture(following, expected), Modes(mu, expected, tuple(following)))

    return Design(f"fos-jump-{structures[0].name}", model.modes[0], equations, start=init)
