"""Time and inputs in the questions: functions that take the step, and the steps at which they are
told apart."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.laws import Array
from kfcourse.symbolic.equations import compile_model, compile_noiseless
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import Structure

STEP = 2  # of questions about one step, whose functions are those of this step
TRIED = 200  # steps that are looked at

Function = Callable[..., Any]


def of_steps(function: Function) -> Function:
    """The function, whose last argument is the step, marked as such for `at_step`."""
    function.__dict__["of_steps"] = True
    return function


def at_step(function: Function, k: int) -> Function:
    """The function at step k; a function that takes no step is the same at all."""
    return (lambda *arrays: function(*arrays, k)) if vars(function).get("of_steps") else function


def at_wrong_step(function: Function, k: int) -> Function:
    """The same for a known mistake; ValueError if the function takes no step, so that there is none
    to mistake."""
    if not vars(function).get("of_steps"):
        raise ValueError("only where the model depends on the step")
    return at_step(function, k)


def full(matrix: Array, runs: int) -> Array:
    """One matrix for every trajectory, (runs, r, c)."""
    return np.array(np.broadcast_to(matrix, (runs, *matrix.shape[-2:])))


def array_functions(structure: Structure, steps: Sequence[int] = ()) -> tuple[Function, Function]:
    """(measure, predict) of full arrays, as students get them: (m, d) -> h, G, F and (z, p) -> tau,
    Theta.

    Those of a structure that depends on the step take it too, `measure(m, d, k)`; with `steps`,
    these take the place of 0, 1, 2..., over and over.
    """
    if structure.at_step is not None:
        return (
            of_steps(lambda m, d, k: array_functions(structure.at(_taken(steps, k)))[0](m, d)),
            of_steps(lambda z, p, k: array_functions(structure.at(_taken(steps, k)))[1](z, p)),
        )

    def measure(m: Array, d: Array) -> tuple[Array, Array, Array]:
        h, G, F, _ = structure.measure(m, d)
        return (
            np.array(np.broadcast_to(h, (len(m), structure.model.p))),
            full(G, len(m)),
            full(F, len(m)),
        )

    def predict(z: Array, p: Array) -> tuple[Array, Array]:
        tau, Theta = structure.predict(z, p)
        return tau, full(Theta, len(z))

    return measure, predict


def noiseless_functions(model: Model, steps: Sequence[int] = ()) -> tuple[Function, Function]:
    """a(x) and b(x), the equations with the noises at their means: (N, n) -> (N, n) and (N, p);
    with the step as above."""
    a, b = compile_noiseless(model)
    if not model.timed:
        return a, b
    return of_steps(lambda x, k: a(x, _taken(steps, k))), of_steps(
        lambda x, k: b(x, _taken(steps, k))
    )


def _taken(steps: Sequence[int], k: int) -> int:
    return steps[k % len(steps)] if steps else k


def _values(model: Model) -> list[tuple[str, ...]]:
    """What the equations give at every step, at the same place."""
    state, meter = compile_model(model)
    x = model.prior.mean + np.sqrt(np.diagonal(model.prior.cov))
    v, w = (law.mean + 1.0 for law in (model.state_noise, model.meter_noise))
    with np.errstate(all="ignore"):
        return [
            tuple(f"{value:.9g}" for value in (*state(x, v, k), *meter(x, w, k)))
            for k in range(int(min(TRIED, model.known.steps)))
        ]


def telling_steps(model: Model) -> list[int]:
    """Steps at which the equations differ, in the order of time; where an input or a switch rests,
    a wrong step does not show."""
    first: dict[tuple[str, ...], int] = {}
    for k, values in enumerate(_values(model)):
        first.setdefault(values, k)
    return list(first.values())


def places(model: Model) -> list[Mapping[sp.Symbol, sp.Expr]]:
    """Values of k and t at which formulas are compared: on both sides of every switch; none if
    there is no switch."""
    equations = sp.Matrix([*model.state_equation, *model.meter_equation])
    if not equations.has(sp.core.relational.Relational, sp.Heaviside, sp.sign, sp.Abs):
        return []
    clocks = [s for s in model.known.symbols if s.name not in model.known.inputs]
    steps = set[int]()
    for k, (before, after) in enumerate(pairwise(_values(model))):
        steps |= {k, k + 1, k + 2} if before != after else set()
    return [
        {s: sp.Integer(k) * (model.known.interval if s.name == "t" else 1) for s in clocks}
        for k in sorted(steps)
    ]
