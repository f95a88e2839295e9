r"""Transitions between modes that depend on the state: what a normal law of the state makes of them.

With the law N(z, p) of x_k in mode i and P(i_{k+1} = j | i_k = i, x_k = x) = pi_ij(x), Bayes' formula for the next mode gives

    nu_ij = M_N[pi_ij(x)]                                      how probable j is
    z_ij  = M_N[x pi_ij(x)] / nu_ij                            the law of x_k, given that j comes next: N weighted by pi_ij,
    p_ij  = M_N[(x - z_ij)(x - z_ij)^T pi_ij(x)] / nu_ij       and no longer normal

which takes the places of pi_ij and (z_i, p_i) in what merges predictions: tau_j(z_ij, p_ij), Theta_j(z_ij, p_ij).  For affine a
these are the moments of a^j weighted by pi_ij(x), as Rudenko's logic-dynamic filters have them, exactly; for others the weighted
law is taken for a normal one, as every law of these filters is.  With constant pi_ij nothing is weighted.

The means are found by Gauss-Hermite quadrature over the components that pi_ij contains; the others follow by regression on these,
exactly, as the law is normal.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from kfcourse.laws import Array, Gaussian, gain, square_root, transpose
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.quadrature import product_rule
from kfcourse.symbolic.reading import ModelError

ORDER = {1: 32, 2: 12, 3: 7}  # points an axis, by the number of components in the formulas
ROUGH = 1e-2  # by which half as many points may err at the prior: a twentieth of a probability such as .2
ELEMENTS = 2**21  # of the largest array

Leading = Callable[[int, Sequence[Gaussian]], tuple[Array, list[list[Gaussian]]]]


def by_state(model: JumpModel) -> Leading:
    """The function of the step and the laws in each mode that gives nu (runs, J, J), and the laws N(z_ij, p_ij), i first.

    Raises
    ------
    ModelError
        Formulas of more than three components, or so abrupt that the points do not see them.
    """
    used = _used(model)
    if len(used) > max(ORDER):
        raise ModelError(
            f"transitions that depend on {len(used)} components are not integrated: that takes too many points; let them depend "
            f"on at most {max(ORDER)}, or make one number of the state on which they depend a component of its own"
        )
    nodes, weights = product_rule(ORDER[len(used)])(len(used))
    _check_smooth(model, used, nodes, weights)

    def leading(k: int, laws: Sequence[Gaussian]) -> tuple[Array, list[list[Gaussian]]]:
        each = [_weighted(model, used, nodes, weights, i, law, k) for i, law in enumerate(laws)]
        return np.stack([nu for nu, _ in each], axis=1), [found for _, found in each]

    return leading


def points_of(model: JumpModel) -> int:
    """How many points a mean over the state takes here; 0 if transitions do not depend on it."""
    return ORDER[size] ** size if (size := len(_used(model))) in ORDER else 0


def _used(model: JumpModel) -> list[int]:
    """The components of the state on which transitions depend."""
    return [i for i, one in enumerate(model.x) if model.chain.has(one)]


def _weighted(
    model: JumpModel, used: list[int], nodes: Array, weights: Array, i: int, law: Gaussian, k: int
) -> tuple[Array, list[Gaussian]]:
    """nu_ij (runs, J), and N(z_ij, p_ij) for each j."""
    mean, cov = law.mean, np.broadcast_to(law.cov, (*law.mean.shape, law.mean.shape[-1]))
    root = square_root(cov[..., used, :][..., used])
    spread = gain(cov[..., used], cov[..., used, :][..., used]) @ root  # x = z + spread s, but for what s does not tell
    runs, size = len(mean), len(model.modes)
    nu, first, second = (np.empty((runs, size, *[len(used)] * more)) for more in (0, 1, 2))
    chunk = max(1, ELEMENTS // (len(weights) * size * size))
    for start in range(0, runs, chunk):
        some = slice(start, start + chunk)
        x = np.repeat(mean[some, None], len(nodes), axis=1)
        x[..., used] += nodes @ transpose(root[some])
        for j, column in enumerate(np.moveaxis(model.transition_of(x, k)[..., i, :], -1, 0)):
            found = weights * column
            nu[some, j] = total = found.sum(axis=1)
            if not np.minimum.reduce(total, axis=None) > 0:  # where j cannot come the law stays as it is
                found = np.where(total[:, None] > 0, found, weights)
            share = found / found.sum(axis=1, keepdims=True)
            first[some, j] = share @ nodes
            away = nodes - first[some, j, None]
            second[some, j] = transpose(share[..., None] * away) @ away
    second -= np.eye(len(used))
    laws = []
    for j in range(size):
        shift = np.einsum("rns,rs->rn", spread, first[:, j])
        laws.append(Gaussian(mean + shift, cov + spread @ second[:, j] @ transpose(spread)))
    return nu, laws


def _check_smooth(model: JumpModel, used: list[int], nodes: Array, weights: Array) -> None:
    """ModelError if half as many points give other probabilities, for laws as wide as the prior about its mean."""
    mean, cov = model.prior
    places = mean + np.linspace(-2, 2, 9)[:, None] * np.sqrt(np.diagonal(cov))
    rough = product_rule(len(np.unique(nodes[:, 0])) // 2)(len(used))
    law = Gaussian(places, cov)
    for i, name in enumerate(model.names):
        fine, coarse = (_weighted(model, used, *rule, i, law, 0)[0] for rule in ((nodes, weights), rough))
        if (apart := np.abs(fine - coarse).max()) > ROUGH:
            raise ModelError(
                f"the transitions from mode {name} change too abruptly: at laws as wide as the prior quadrature finds their "
                f"probabilities only to within {apart:.2g}; write a jump as a smooth step, such as (1 + tanh(3*x))/2"
            )
