r"""A model that jumps, averaged over its modes: what a filter that knows of no modes may take for
the model.

With the probabilities q_j of the modes before anything is measured, and N(z, p) or N(m, d) in every
one of them,

    tau = sum q_j tau_j,   Theta = sum q_j [Theta_j + (tau_j - tau)(tau_j - tau)^T],   and so h, F;
        G = sum q_j G_j

are the moments of the next state and of the measurement: the mode is one noise more.  Where the
modes are drawn anew at each step nothing is lost but the shape of that noise; where they last, all
that the past tells of the mode is lost.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from kfcourse.errors import expect
from kfcourse.laws import Array, Gaussian, Measurement, Transition, product, transpose
from kfcourse.symbolic.equations import Noiseless, compile_noiseless
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import Structure, expect_each, of_steps


def averaged(model: JumpModel, structures: Sequence[Structure]) -> Structure:
    """The structural functions averaged over the modes, from those of each, such as [gaussian(mode)
    for mode in model.modes].

    Raises
    ------
    ModelError
        A component is an angle, of which there is no such average; transitions depend on the state.
    ValueError
        Not a structure for each mode.
    """
    _check(model)
    expect_each(structures, "averaged")
    if len(structures) != len(model.modes):
        raise ValueError(
            f"averaged expects a structure for each of the {len(model.modes)} modes, got "
            f"{len(structures)}"
        )

    return of_steps("averaged", model.modes[0], partial(_at, model, structures), timed=True)


def _at(model: JumpModel, structures: Sequence[Structure], k: int) -> Structure:
    """The average at a step."""
    before, after = model.law_at(k), model.law_at(k + 1)
    now = [structure.at(k) for structure in structures]

    def predict(z: Array, p: Array) -> Gaussian:
        laws = [structure.predict(z, p) for structure in now]
        tau = _mean(after, [law.mean for law in laws])
        return Gaussian(tau, _mean(after, [law.cov + _square(law.mean - tau) for law in laws]))

    def measure(m: Array, d: Array) -> Measurement:
        parts = [structure.measure(m, d) for structure in now]
        slopes = [part.G for part in parts]
        h, G, R = _mixed(before, [part.h for part in parts], slopes, [part.R for part in parts], d)
        return Measurement(h, G, _form(G, d) + R, R)

    def transition(z: Array, p: Array) -> Transition:
        taus = [structure.predict(z, p).mean for structure in now]
        slopes, rests = zip(*(structure.transition(z, p) for structure in now), strict=True)
        return Transition(*_mixed(after, taus, slopes, rests, p)[1:])

    return Structure("averaged", model.modes[0], predict, measure, transition)


def averaged_equations(model: JumpModel) -> tuple[Noiseless, Noiseless]:
    """a(x, m_v) and b(x, m_w), averaged over the modes: sum_j q_{k+1}^j a^j, sum_j q_k^j b^j;
    errors as of `averaged`."""
    _check(model)
    each = [compile_noiseless(mode) for mode in model.modes]

    def state(x: Array, k: int | None = None) -> Array:
        return sum(
            q * np.broadcast_to(equation(x, k), x.shape)
            for q, (equation, _) in zip(model.law_at((k or 0) + 1), each, strict=True)
        )

    def meter(x: Array, k: int | None = None) -> Array:
        return sum(
            q * equation(x, k) for q, (_, equation) in zip(model.law_at(k or 0), each, strict=True)
        )

    return state, meter


def _check(model: JumpModel) -> None:
    expect(model, JumpModel, "the average over the modes")
    model.without_state("the average over the modes")
    if model.angles.x or model.angles.y:
        raise ModelError(
            "components that are angles have no average over modes; take filters that know the "
            "modes"
        )


def _mixed(
    weights: Array,
    means: Sequence[Array],
    slopes: Sequence[Array],
    rests: Sequence[Array],
    cov: Array,
) -> tuple[Array, Array, Array]:
    """Mean, slope, and covariance that the slope does not explain, of affine functions with these
    weights over a law with this covariance."""
    mean, slope = _mean(weights, means), _mean(weights, slopes)
    spreads = [
        rest + _form(own - slope, cov) + _square(value - mean)
        for value, own, rest in zip(means, slopes, rests, strict=True)
    ]
    return mean, slope, _mean(weights, spreads)


def _mean(weights: Array, values: Sequence[Array]) -> Array:
    return sum((q * value for q, value in zip(weights, values, strict=True)), np.zeros(()))


def _square(vector: Array) -> Array:
    return vector[..., :, None] * vector[..., None, :]


def _form(matrix: Array, cov: Array) -> Array:
    """M P M^T."""
    return product(product(matrix, cov), transpose(matrix))
