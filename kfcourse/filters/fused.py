"""Compiled steps of filters of scalar models.

A step is a loop over trajectories, printed from `Filter.printed`, the equations that the chapters derive, with the formulas of
the structural functions put in; `loops` calls it, step by step.  NumPy passes over the ensemble once for each operation; a loop
passes once for all of them.  In two places the equations are computed as `laws.correct` does, not as they are printed:
p = Psi R / F, which is never negative, and the gain of a meter that cannot vary is 0.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from itertools import chain
from typing import Any, NamedTuple, TypeVar

import numpy as np
import sympy as sp

from kfcourse.filters import notation as s
from kfcourse.filters.base import Advance, Filter, State
from kfcourse.filters.designed import Affine, Design
from kfcourse.filters.programs import Rule, in_numbers, needed, scalar, stages, value_of
from kfcourse.laws import Array, Gaussian, any_missing, column
from kfcourse.symbolic import compiled

T = TypeVar("T")
Equalities = tuple[sp.Eq, ...]

_X, _NEXT, _Y, _LAM, _PSI, _Z, _P, _LAM_NEXT, _PSI_NEXT, _F = map(
    scalar, (s.x, s.x_next, s.y, s.lam, s.Psi, s.z, s.P, s.lam_next, s.Psi_next, s.F)
)


def fuse(one: Filter | Design) -> Filter | Design:
    """The same filter with compiled steps, equal up to rounding; the filter itself where there is no formula to compile.

    Compiled are AOF, DUOF, FOS, MFOS and their kin in two steps, of scalar models whose structural functions have formulas; and
    what has a compiled step of its own, the exact filter by point masses.
    One that cannot be compiled runs as it is, with a warning that tells why.

    Raises
    ------
    ImportError
        There is no numba.
    """
    model, structure = one.model, one.structure
    own = one.step if isinstance(one, Filter) else one.equations
    if isinstance(one, Filter) and one.quick and one.quick[0] is one.step:
        step = _or_warning(one, one.quick[1])
        return replace(one, step=step) if step else one
    if (
        one.printed is None
        or one.printed[0] is not own
        or not compiled.is_scalar(model)
        or (structure and structure.formulas is None)
    ):
        return one
    program = _or_warning(one, partial(_program, one, one.printed[1]))
    if program is None:
        return one
    if isinstance(one, Filter):
        return replace(one, step=Steps(program, one.step, program.table(np.empty((1, 0)))))
    return Fused(**vars(one), program=program)


def _or_warning(one: Filter | Design, compile: Callable[[], T]) -> T | None:
    try:
        with compiled.no_collection():
            return compile()
    except ImportError:
        raise
    except Exception as error:  # whatever a compiler may say of a formula: it runs without, too
        warnings.warn(f"{one.name} is not compiled, and runs as without compiled=True: {error}", stacklevel=3)
        return None


class Loops(NamedTuple):
    """The printed loops of a filter: its step; of a design also what its regressions are on, and what comes after them."""

    parameters: list[float]
    regressions: int
    text: str
    one_for_all: bool  # p is the residual of the first regression

    @property
    def compiled(self) -> Any:
        """Their module, with the function `step`."""
        return compiled.load(self.text)

    def table(self, coefficients: Array) -> Array:
        """What the loops take as constants of each step, (steps, m): parameters, and coefficients (steps, regressions, 3)."""
        steps = len(coefficients)
        return np.hstack([np.tile(self.parameters, (steps, 1)), coefficients.reshape(steps, -1)])


@dataclass(frozen=True)
class Fused(Design):
    """A design whose coefficients a compiled loop finds: `montecarlo.designing.design_together`."""

    program: Loops = field(kw_only=True)

    def begin(self, runs: int, steps: int) -> tuple[Array, Array]:
        """What the loop works on: a table with room for the coefficients, and lambda and Psi before the first step, (2, runs)."""
        law = np.array(_law(self.init(1).predicted))
        return self.program.table(np.zeros((steps, self.program.regressions, 3))), np.tile(law, runs)

    def find(self, table: Array, y: Array, x: Array, lam: Array, Psi: Array) -> None:
        """Coefficients of steps with y (K, N) and x (K + 1, N): into the table; lambda and Psi (N,) are those after them."""
        from kfcourse.filters import loops

        program = self.program
        loops.design(program.compiled.step, len(program.parameters), program.regressions, table, y, x, lam, Psi)

    def fitted(self, table: Array) -> Filter:
        """The filter with the coefficients of a table."""
        found = table[:, len(self.program.parameters) :].reshape(len(table), -1, 3, 1)
        return self.with_coefficients([[Affine(H[None], e, T[None]) for H, e, T in row] for row in found])

    def with_coefficients(self, coefficients: Sequence[Sequence[Affine]]) -> Filter:
        """`Design.with_coefficients`, with compiled steps."""
        one = super().with_coefficients(coefficients)
        found = np.array([[part.item() for fit in row for part in fit] for row in coefficients])
        return replace(one, step=Steps(self.program, one.step, self.program.table(found)))


@dataclass(frozen=True)
class Steps:
    """Compiled steps of a filter of a scalar model: one, as `Filter.step` is, or several with the sums of a comparison.

    Attributes
    ----------
    program : Loops
        Printed from the equations of the filter.
    otherwise : Advance
        The step where a measurement is missing, or coefficients are.
    table : ndarray (steps, m)
        Constants of every step; of one for all, if the filter has no coefficients.
    """

    program: Loops
    otherwise: Advance
    table: Array

    def __call__(self, state: State, y: Array) -> State:
        if any_missing(y) or (self.program.regressions and state.step >= len(self.table)):
            return self.otherwise(state, y)
        from kfcourse.filters.loops import AT_ONCE

        row, ends = column(y), np.minimum(np.arange(0, len(y) + AT_ONCE, AT_ONCE), len(y))
        sums = np.empty((5, 1, len(ends) - 1))
        return self.several(state, row[None], row[None], row, ends, sums, np.empty((2, len(y))))

    def several(
        self, state: State, y: Array, x: Array, weight: Array, starts: Array, sums: Iterable[Array], room: Array
    ) -> State:
        """The state after measurements y (K, N), none missing.

        Into the sums (5, K, B) goes what `montecarlo.Sums.record` keeps of the errors of states x (K, N), of batches that begin
        at starts[:-1] and end at starts[1:].  The posterior is found in the room (2, N); with room for a batch only, it is not.
        """
        from kfcourse.filters import loops

        program, k, after = self.program, state.step, np.empty((2, len(weight)))
        constants = self.table[k : k + len(y)] if program.regressions else self.table.repeat(len(y), axis=0)
        loops.advance(program.compiled.step, constants, y, x, weight, starts, *_law(state.predicted), *after, *room, *sums)
        residual = len(program.parameters) + 2
        p = constants[-1:, residual : residual + 1] if program.one_for_all else room[1][:, None, None]
        posterior, predicted = Gaussian(room[0][:, None], p), Gaussian(after[0][:, None], after[1][:, None, None])
        return State(k + len(y), posterior, predicted)


def _law(predicted: Gaussian) -> tuple[Array, Array]:
    """lambda and Psi of every trajectory, (N,)."""
    mean, Psi = column(predicted.mean), column(predicted.cov)
    return mean, Psi if len(Psi) == len(mean) else np.full(len(mean), Psi.item())


_PRINTED: dict[tuple[object, ...], Loops] = {}  # by all that they are printed from


def _program(one: Filter | Design, printed: Equalities) -> Loops:
    """The loops of a filter, with its parameters."""
    model, formulas = one.model, one.structure.formulas.functions.values() if one.structure and one.structure.formulas else ()
    means = (tuple(law.mean) for law in (model.state_noise, model.meter_noise))
    key = (printed, model.state_equation, model.meter_equation, tuple(model.values), *means, *formulas)
    if key not in _PRINTED:
        _PRINTED[key] = _printed(one, printed)
    return _PRINTED[key]._replace(parameters=[float(value) for value in model.values.values()])


def _printed(one: Filter | Design, printed: Equalities) -> Loops:
    """Print, compile and load the loops of a filter."""
    import_module("kfcourse.filters.loops")  # now, with the warning of what cannot be compiled
    groups, fits = stages(printed, _rules(one, printed))
    # A residual without a letter has a name: the number of a nameless Dummy would make another text, compiled anew, each time.
    residuals = [sp.Dummy(f"T{i}") for i in range(len(fits))]
    rules, found = list(chain(*groups)), [[*fit.found, own][:3] for fit, own in zip(fits, residuals, strict=True)]
    letters, known = {left for left, _ in rules}, {"y": _Y, "lam": _LAM, "Psi": _PSI}
    after = {"lam": _LAM_NEXT, "Psi": _PSI_NEXT if _PSI_NEXT in letters else found[-1][2]}
    p = _P if _P in letters else found[0][2]
    constants, parameters = [*one.model.values, *chain(*found)], len(one.model.values)

    def made(arrays: dict[str, sp.Symbol], count: int) -> compiled.Pass:
        return compiled.Pass(arrays, constants[:count], needed(rules, arrays.values()))

    passes = [made({**after, "first": _Z, "second": p}, len(constants))]
    if fits:
        passes.append(made(after, len(constants)))
    passes += [made({"first": fit.target, "second": fit.regressor}, parameters + 3 * i) for i, fit in enumerate(fits)]
    text = compiled.choice("step", {**known, "x": _X, "x_next": _NEXT}, ["first", "second"], passes)
    program = Loops([], len(fits), text, _P not in letters)
    assert program.compiled
    return program


def _rules(one: Filter | Design, printed: Equalities) -> list[Rule]:
    """The equations in numbers, gain and covariance as in `laws.correct` and `laws.gain`."""
    plain = any(equation.lhs == s.K for equation in printed)  # z = lambda + K (y - h), no regression
    refused = sp.S.Zero if plain else compiled.NAN

    def inverse(F: sp.Expr) -> sp.Expr:
        return sp.Piecewise((1 / F, F > 0), (refused, F < 0), (0, sp.Eq(F, 0)), (compiled.NAN, True))

    found = in_numbers(printed, one.model, one.structure, inverse)
    if not plain:
        return found
    assert one.structure is not None
    R = value_of(one.structure, "R", s.lam, s.Psi)
    p = (_P, sp.Piecewise((_PSI, _F <= 0), (_PSI * R / _F, True)))
    after = next(i for i, (left, _) in enumerate(found) if left == _Z) + 1
    return [*found[:after], p, *(rule for rule in found[after:] if rule[0] != _P)]
