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
from typing import TypeAlias

import numpy as np

from kfcourse.errors import expect
from kfcourse.laws import Array, product, transpose
from kfcourse.symbolic.equations import Equation, compile_noiseless
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import Structure, expect_each, form, regressed

Affine: TypeAlias = tuple[Array, Array, Array]  # mean, slope, covariance of the rest


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
    check_averaged(model)
    expect_each(structures, "averaged")
    if len(structures) != len(model.modes):
        raise ValueError(
            f"averaged expects a structure for each of the {len(model.modes)} modes, got "
            f"{len(structures)}"
        )

    return Structure("averaged", model.modes[0], at_step=partial(_at, model, structures))


def _at(model: JumpModel, structures: Sequence[Structure], k: int) -> Structure:
    """The average at a step."""
    before, after = model.law_at(k), model.law_at(k + 1)
    now = [structure.at(k) for structure in structures]

    def state(z: Array, p: Array) -> Affine:
        parts = [(structure.predict(z, p).mean, *structure.transition(z, p)) for structure in now]
        return _mixed(after, parts, p)

    def meter(m: Array, d: Array) -> Affine:
        parts = [structure.measure(m, d) for structure in now]
        return _mixed(before, [(part.h, part.G, part.R) for part in parts], d)

    return regressed("averaged", model.modes[0], state, meter)


def averaged_equations(model: JumpModel) -> tuple[Equation, Equation]:
    """a(x, m_v) and b(x, m_w), averaged over the modes: sum_j q_{k+1}^j a^j, sum_j q_k^j b^j;
    errors as of `averaged`."""
    check_averaged(model)
    states, meters = zip(*map(compile_noiseless, model.modes), strict=True)

    def mean_of(equations: Sequence[Equation], later: int) -> Equation:
        def mean(x: Array, k: int | None = None) -> Array:
            now = k or 0
            return _mean(model.law_at(now + later), [equation(x, now) for equation in equations])

        return mean

    return mean_of(states, 1), mean_of(meters, 0)


def check_averaged(model: JumpModel, what: str = "the average over the modes") -> None:
    """TypeError or ModelError, with what is asked for, where modes have no law before anything is
    measured, or components no average."""
    expect(model, JumpModel, what)
    model.without_state(what)
    if model.angles.x or model.angles.y:
        raise ModelError(
            f"{what} takes no components that are angles: angles have no average over modes; take "
            "filters that know the modes"
        )


def _mixed(weights: Array, parts: Sequence[Affine], cov: Array) -> Affine:
    """Mean, slope, and covariance that the slope does not explain, of affine functions with these
    weights over a law with this covariance."""
    means, slopes, _ = zip(*parts, strict=True)
    mean, slope = _mean(weights, means), _mean(weights, slopes)
    spreads = []
    for value, own, rest in parts:
        off = (value - mean)[..., None]
        spreads.append(rest + form(own - slope, cov) + product(off, transpose(off)))
    return mean, slope, _mean(weights, spreads)


def _mean(weights: Array, values: Sequence[Array]) -> Array:
    return sum((q * value for q, value in zip(weights, values, strict=True)), np.zeros(()))
