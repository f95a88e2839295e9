"""Compiled steps of filters of scalar models: one loop over the ensemble for each stretch of equations between two regressions.

The loops are printed from `Filter.printed`, the equations that the chapters derive, with the formulas of the structural functions
put in.  NumPy passes over the ensemble once for each operation; a loop passes once for all of them.  In two places the equations
are computed as `laws.correct` does, not as they are printed: p = Psi R / F, which is never negative, and the gain of a meter that
cannot vary is 0.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import NamedTuple, TypeVar

import numpy as np
import sympy as sp

from kfcourse.filters import notation as s
from kfcourse.filters.base import Advance, Filter, State
from kfcourse.filters.designed import Affine, Design, Equations, Regression
from kfcourse.filters.programs import Rule, array_name, in_numbers, needed, scalar, stages, value_of
from kfcourse.laws import Array, Gaussian, column
from kfcourse.symbolic import compiled

T = TypeVar("T")
Letters = Sequence[sp.Symbol]
Equalities = tuple[sp.Eq, ...]

_X, _NEXT, _Y, _LAM, _PSI, _Z, _P, _LAM_NEXT, _PSI_NEXT, _F = map(
    scalar, (s.x, s.x_next, s.y, s.lam, s.Psi, s.z, s.P, s.lam_next, s.Psi_next, s.F)
)
_KEPT = {_Z, _P, _LAM_NEXT, _PSI_NEXT}


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
        return replace(one, step=program.known(one.step, ()))
    return replace(
        one,
        equations=lambda state, y: program.equations(one.equations, state, y),
        known=lambda fits: program.known(one.answered(fits), fits),
    )


def _or_warning(one: Filter | Design, compile: Callable[[], T]) -> T | None:
    try:
        return compile()
    except ImportError:
        raise
    except Exception as error:  # whatever a compiler may say of a formula: it runs without, too
        warnings.warn(f"{one.name} is not compiled, and runs as without compiled=True: {error}", stacklevel=3)
        return None


Arrays = dict[str, Array]  # of each trajectory, by the name of the letter


class _Loop(NamedTuple):
    """A compiled function, the names of the arrays that it reads, and of those that it makes."""

    function: Callable[..., int]
    given: list[str]
    made: list[str]

    def __call__(self, constants: Array, arrays: Arrays) -> bool:
        """Make its arrays; whether a measurement is missing, so that they are not what they should be."""
        given = [arrays[one] for one in self.given]
        rows = np.empty((len(self.made), len(given[0])))
        missing = self.function(constants, *given, *rows)
        arrays.update(zip(self.made, rows, strict=True))
        return self.given[0] == "y" and missing > 0


class _Program(NamedTuple):
    """The loops of a filter: all of a step with known coefficients; and by parts, with regressions and their targets between."""

    parameters: list[float]
    whole: _Loop
    parts: list[_Loop]
    fits: list[tuple[str, str]]  # target and regressor
    targets: dict[str, _Loop]

    def known(self, otherwise: Advance, fits: Sequence[Affine]) -> Advance:
        """A step with the coefficients known; with a measurement missing the other one."""
        constants = self.constants(fits)

        def step(state: State, y: Array) -> State:
            arrays = _given(state, y)
            return otherwise(state, y) if self.whole(constants, arrays) else _state(state, arrays, fits)

        return step

    def equations(self, otherwise: Callable[[State, Array], Equations], state: State, y: Array) -> Equations:
        """A step that asks for its coefficients; with a measurement missing the other one."""
        from kfcourse.filters.loops import scatter

        arrays, fits = _given(state, y), list[Affine]()
        for part, (target, regressor) in zip(self.parts, self.fits, strict=False):
            if part(self.constants(fits), arrays) and not fits:
                return (yield from otherwise(state, y))
            fits.append((yield Regression(partial(self._target, target, arrays), arrays[regressor][:, None], scatter=scatter)))
        self.parts[-1](self.constants(fits), arrays)
        return _state(state, arrays, fits)

    def _target(self, name: str, arrays: Arrays, x: Array, x_next: Array) -> Array:
        if name not in self.targets:
            return x if name == "x" else x_next
        known = {**arrays, "x": column(x)}
        self.targets[name](self.constants(()), known)
        return known[name][:, None]

    def constants(self, fits: Sequence[Affine]) -> Array:
        """Parameters and coefficients, in the order in which the loops take them."""
        return np.array([*self.parameters, *(one.item() for fit in fits for one in fit)])


def _given(state: State, y: Array) -> Arrays:
    (lam, Psi), size = state.predicted, len(y)
    spread = column(Psi) if len(Psi) == size else np.full(size, Psi.item())
    return {"y": column(y), "lambda": column(lam), "Psi": spread}


def _state(before: State, arrays: Arrays, fits: Sequence[Affine]) -> State:
    """Covariances that are no arrays are the residuals of the first and of the last regression."""
    p = arrays["p"][:, None, None] if "p" in arrays else fits[0].residual
    Psi = arrays["next Psi"][:, None, None] if "next Psi" in arrays else fits[-1].residual
    posterior, predicted = Gaussian(arrays["z"][:, None], p), Gaussian(arrays["next lambda"][:, None], Psi)
    return State(before.step + 1, posterior, predicted)


class _Texts:
    """The loops of a filter as they are printed, one after the other."""

    def __init__(self, parameters: Sequence[sp.Symbol]):
        self.parameters = parameters
        self.texts = list[str]()
        self.arrays = list[tuple[list[str], list[str]]]()

    def add(
        self, group: Sequence[Rule], made: Sequence[sp.Symbol], known: Sequence[sp.Symbol], found: Sequence[sp.Symbol]
    ) -> None:
        """Print what makes these letters of known ones and of the coefficients found so far."""
        definitions = needed(group, made)
        used = set().union(*(right.free_symbols for right in definitions.values()))
        given = [letter for letter in known if letter in used] or [_LAM]  # of a constant: as many as there are trajectories
        arrays = {f"old_{array_name(letter)}": letter for letter in given}
        new = {f"new_{array_name(letter)}": letter for letter in made}
        name = f"part{len(self.texts)}"
        self.texts.append(compiled.loop(name, arrays, new, [*self.parameters, *found], definitions))
        self.arrays.append(([_name(letter) for letter in given], [_name(letter) for letter in made]))

    def compiled(self) -> list[_Loop]:
        module = compiled.load(*self.texts)
        return [_Loop(getattr(module, f"part{i}"), *names) for i, names in enumerate(self.arrays)]


_PRINTED: dict[tuple[object, ...], _Program] = {}  # by all that they are printed from


def _program(one: Filter | Design, printed: Equalities) -> _Program:
    """The loops of a filter, with its parameters."""
    model, formulas = one.model, one.structure.formulas.functions.values() if one.structure and one.structure.formulas else ()
    means = (tuple(law.mean) for law in (model.state_noise, model.meter_noise))
    key = (printed, model.state_equation, model.meter_equation, tuple(model.values), *means, *formulas)
    if key not in _PRINTED:
        _PRINTED[key] = _printed(one, printed)
    return _PRINTED[key]._replace(parameters=[float(value) for value in model.values.values()])


def _printed(one: Filter | Design, printed: Equalities) -> _Program:
    """Print, compile and load all loops of a filter."""
    groups, fits = stages(printed, _rules(one, printed))
    coefficients = [[*fit.found, sp.Dummy()][:3] for fit in fits]
    of_truth = dict(rule for group in groups for rule in group if rule[1].has(_X, _NEXT))  # while designing only
    groups = [[rule for rule in group if rule[0] not in of_truth] for group in groups]
    texts, known = _Texts(list(one.model.values)), [_Y, _LAM, _PSI]
    every = list(chain(*groups))
    texts.add(every, [left for left, _ in every if left in _KEPT], known, list(chain(*coefficients)))
    for i, group in enumerate(groups if fits else []):
        later = {letter for fit in fits[i:] for letter in (fit.target, fit.regressor)} | _KEPT
        later |= set().union(*(right.free_symbols for _, right in (*chain(*groups[i + 1 :]), *of_truth.items())))
        made = [left for left, _ in group if left in later]
        texts.add(group, made, known, list(chain(*coefficients[:i])))
        known = [*known, *made]
    for rule in of_truth.items():
        texts.add([rule], [rule[0]], [_X, *known], [])
    whole, *loops = texts.compiled()
    parts, targets = loops[: len(loops) - len(of_truth)], loops[len(loops) - len(of_truth) :]
    names = [(_name(fit.target), _name(fit.regressor)) for fit in fits]
    return _Program([], whole, parts, names, dict(zip(map(_name, of_truth), targets, strict=True)))


def _name(letter: sp.Symbol) -> str:
    """Of its array."""
    return f"next {array_name(letter)}" if letter in (_LAM_NEXT, _PSI_NEXT) else array_name(letter)


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
