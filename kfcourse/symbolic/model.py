"""The model of a filtering problem: an object, a meter, and their Gaussian noises.

    x_{k+1} = a(x_k, v_k)        state equation   (object)
    y_k     = b(x_k, w_k)        meter equation
    x_0 ~ N(m, d),  v_k ~ N(m_v, D_v),  w_k ~ N(m_w, D_w),   all independent

Both equations may contain what is known of the step: its number k, its time t, inputs u_k.

`Model` holds the two equations as SymPy expressions with their parameters as symbols.  Everything
else (structural functions, filters, simulation, the printed equations) is derived from it.
"""

from __future__ import annotations

import dataclasses
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import sympy as sp

from kfcourse.angles import Angles, Components
from kfcourse.laws import Array, Gaussian
from kfcourse.symbolic.codegen import Compiled, Entries, check_numbers, compile_function
from kfcourse.symbolic.formula import check_name, symbol
from kfcourse.symbolic.known import Known, equation_and_law
from kfcourse.symbolic.reading import (
    Formulas,
    ModelError,
    Names,
    by_name,
    formula_list,
    law,
    numbered,
    parameter_values,
    shown,
    table,
)
from kfcourse.symbolic.typesetting import aligned, with_index
from kfcourse.symbolic.writing import formula_latex, number_latex


class AngleWarning(UserWarning):
    """A formula finds or contains an angle, and the model does not say that it is one."""


class Half(NamedTuple):
    """The object or the meter of a model: its equation, its noises with their law, and which
    components of its value are angles."""

    equation: sp.ImmutableMatrix
    noises: tuple[sp.Symbol, ...]
    law: Gaussian
    angles: Components


@dataclass(frozen=True)
class Model:
    """A discrete-time model with Gaussian noises; build it with `Model.define`.

    Attributes
    ----------
    state_equation, meter_equation : sympy.Matrix
        a(x, v), n x 1, and b(x, w), p x 1, with parameters as symbols.
    x, v, w : tuple of sympy.Symbol
        State components, state noises, meter noises.
    parameters : dict
        Parameter name to value (exact rational numbers).
    prior, state_noise, meter_noise : Gaussian
        Laws of x_0, v_k, w_k: mean (n,) and covariance (n, n).
    known : Known
        What is known of every step: its number k, its time t, and the inputs that the equations
        contain.
    angles : Angles
        Numbers of the components of x and of y that are angles, kept between -pi and pi.
    between : kfcourse.continuous.sampling.Between, optional
        How the state moves in continuous time from one measurement to the next.  The state equation
        then is dx/dt.
    """

    state_equation: sp.ImmutableMatrix
    meter_equation: sp.ImmutableMatrix
    x: tuple[sp.Symbol, ...]
    v: tuple[sp.Symbol, ...]
    w: tuple[sp.Symbol, ...]
    parameters: Mapping[str, sp.Rational]
    prior: Gaussian = field(compare=False)
    state_noise: Gaussian = field(compare=False)
    meter_noise: Gaussian = field(compare=False)
    angles: Angles = field(default_factory=Angles)
    known: Known = field(default_factory=Known)
    between: Any = None

    @classmethod
    def define(
        cls,
        state: Formulas,
        meter: Formulas,
        parameters: Mapping[str, float] | None = None,
        *,
        symbols: Mapping[str, Names] | None = None,
        prior: Mapping[str, Any] | None = None,
        state_noise: Mapping[str, Any] | None = None,
        meter_noise: Mapping[str, Any] | None = None,
        angles: Names | None = None,
        inputs: Mapping[str, Sequence[float]] | None = None,
        interval: float = 1,
    ) -> Model:
        """Build a model from formulas.

        Parameters
        ----------
        state, meter : str, sympy expression, or a list of them
            a(x, v) and b(x, w), which may contain the step's number k, its time t, and inputs.  A
            single formula is a scalar model in x, v, w; lists of formulas use x1, x2, ..., v1, ...,
            w1, ... unless `symbols` names them.
        parameters : dict
            Name to number, for every other symbol in the formulas.
        symbols : dict, optional
            Keys "x", "v", "w": lists of names.
        prior, state_noise, meter_noise : dict, optional
            Keys "mean" and "variance" (number, list of variances, or covariance matrix).  Standard
            normal by default.  Variances of noises may be formulas of k, t, the inputs and the
            parameters, such as "0.1 + 0.02*k": the noises are then standard, and the roots of the
            formulas go into the equations.
        angles : list of names, optional
            Components that are angles in radians, such as ["psi", "y2"]: they are kept between -pi
            and pi, and every filter takes their innovations, means and errors the short way round.
            [] says that there are none.
        inputs : dict, optional
            Name to a list of values, those at the steps 0, 1, 2...: one sequence for all
            trajectories.
        interval : float
            Time between two steps, in the unit of t: t = interval * k.  Where k and t name
            something else, they mean that.

        Raises
        ------
        FormulaError
            A formula string cannot be read (points at the place).
        ModelError
            The parts do not fit together.

        Warns
        -----
        AngleWarning
            A formula finds an angle by atan2, which jumps by a turn, and `angles` is not given; a
            meter contains an angle outside sin and cos, and is none.

        Examples
        --------
        >>> from kfcourse import Model
        >>> Model.define("c*x + e*x*v", "g*x + f*x**2*w", dict(c=0.9, e=0.05, g=1, f=0.02))
        Model(x' = c*x + e*v*x, y = f*w*x**2 + g*x; c = 9/10, e = 1/20, g = 1, f = 1/50)
        """
        values = parameter_values(parameters)
        a, b = formula_list("state", state), formula_list("meter", meter)
        known = Known.read(interval, inputs)
        used = {name for f in (*a, *b) for name in re.findall(r"[A-Za-z]\w*", str(f))}
        named = _symbols(symbols, [*values, *known.inputs], used, len(a))
        x, v, w = (tuple(symbol(name) for name in named[key]) for key in "xvw")
        if len(x) != len(a):
            raise ModelError(
                f"{len(a)} state equation(s) but {len(x)} state symbol(s) {named['x']}; there "
                f"must be one each"
            )
        of_step = known.names([*values, *by_name(x, v, w)])
        constants = {name: symbol(name) for name in values} | of_step
        state_equation, law_v = equation_and_law("state", a, v, state_noise, constants, x)
        meter_equation, law_w = equation_and_law("meter", b, w, meter_noise, constants, x)
        model = cls(
            state_equation,
            meter_equation,
            x,
            v,
            w,
            values,
            law("prior", prior, len(x)),
            law_v,
            law_w,
            _read_angles(angles, [s.name for s in x], numbered("y", len(b))),
            known.used(sp.Matrix([*state_equation, *meter_equation]), of_step),
        )
        if angles is None:
            _warn_of_angles(angles, (), zip([s.name for s in x], model.state_equation, strict=True))
        turning = [x[i] for i in model.angles.x]
        _warn_of_angles(angles, turning, zip(model.measured, model.meter_equation, strict=True))
        model._check()
        if not model.meter_equation.has(*x):
            raise ModelError(
                f"the meter {list(model.meter_equation)} does not depend on the state {list(x)}: "
                f"nothing to filter"
            )
        return model

    def _check(self) -> None:
        """ModelError if an equation cannot be computed with the parameters' values."""
        for what, half in zip(("state", "meter"), self.halves, strict=True):
            for formula in half.equation:
                try:
                    number = formula.subs(self.values)
                except TypeError:  # SymPy's, where a root of a negative number is compared
                    number = sp.nan
                place = f"the {what} equation, {formula!s:.100}, with these parameters"
                check_numbers(place, number)

    @property
    def n(self) -> int:
        """Number of state components."""
        return len(self.x)

    @property
    def p(self) -> int:
        """Number of measurement components."""
        return len(self.meter_equation)

    @property
    def halves(self) -> tuple[Half, Half]:
        """Object and meter."""
        return (
            Half(self.state_equation, self.v, self.state_noise, self.angles.x),
            Half(self.meter_equation, self.w, self.meter_noise, self.angles.y),
        )

    @cached_property
    def values(self) -> dict[sp.Symbol, sp.Rational]:
        """Parameter symbols and their values, for `subs`."""
        return {symbol(name): value for name, value in self.parameters.items()}

    @property
    def taken(self) -> set[str]:
        """The names of its symbols."""
        return {*self.parameters, *by_name(self.x, self.v, self.w, self.known.symbols)}

    def difference_equation(self, what: str) -> sp.ImmutableMatrix:
        """a(x, v); ModelError if the model moves in continuous time, of which `what` knows
        nothing."""
        if self.between is not None:
            raise ModelError(
                f"{what} needs a difference equation, and {self} moves in continuous time between "
                f"its measurements; filters "
                "of structural functions, duof(model) and particle(model) take it"
            )
        return self.state_equation

    @property
    def timed(self) -> bool:
        """Whether the equations depend on the step: on its number k, its time t or an input."""
        return bool(self.known.symbols)

    @property
    def measured(self) -> list[str]:
        """Names of the measurement's components: y, or y1, y2, ..."""
        return numbered("y", self.p)

    def compiled(self, arguments: Sequence[Entries], outputs: Sequence[Entries]) -> Compiled:
        """A function of arrays and of the step, `function(*arrays, k=k)`, as of `compile_function`,
        with the parameters' values; the step matters only where the model depends on it."""
        numeric = [sp.Array(entries).subs(self.values) for entries in outputs]
        function = compile_function([*arguments, self.known.symbols], numeric)
        return lambda *arrays, k=None: function(*arrays, self.known.at(k))

    def replace(self, **parameters: float) -> Model:
        """The same model with some parameters changed: ``model.replace(f=0.2)``; ModelError where
        it cannot be computed."""
        unknown = sorted(set(parameters) - set(self.parameters))
        if unknown:
            raise ModelError(
                f"the model has no parameter {', '.join(unknown)}; it has "
                f"{', '.join(self.parameters) or 'none'}"
            )
        values = parameter_values(parameters)
        changed = dataclasses.replace(self, parameters={**self.parameters, **values})
        changed._check()
        return changed

    def with_inputs(self, inputs: Mapping[str, Sequence[float] | Array]) -> Model:
        """The same model with other values of its inputs, or of the time t: those of a record.

        Raises
        ------
        ModelError
            A name that is no input of the model, values that are no finite numbers.
        """
        if unknown := sorted(set(inputs) - {*self.known.inputs, "t"}):
            raise ModelError(
                f"the model has no input {', '.join(unknown)}; it has "
                f"{', '.join(self.known.inputs) or 'none'}"
            )
        known = Known.read(self.known.interval, {**self.known.inputs, **inputs})
        known = dataclasses.replace(known, symbols=self.known.symbols)
        return dataclasses.replace(self, known=known)

    def latex(self, values: bool = True, indexed: bool = False) -> str:
        """The two equations, and the parameters' values unless they are not wanted, as a LaTeX
        `aligned` block.

        Indexed: x_{k+1} = c x_k + e x_k v_k, as on paper, for x_{k+1} = c x + e x v.
        """
        x, v, w = (
            [sp.Symbol(with_index(sp.latex(s), "k")) if indexed else s for s in group]
            for group in (self.x, self.v, self.w)
        )
        at_k = dict(zip((*self.x, *self.v, *self.w), (*x, *v, *w), strict=True))
        state = [sp.latex(x) for x in self.x]
        meter = ["y"] if self.p == 1 else [f"y_{{{i + 1}}}" for i in range(self.p)]
        lines = (
            [
                rf"{with_index(name, 'k+1')} &= {formula_latex(formula.xreplace(at_k), x, v)}"
                for name, formula in zip(state, self.state_equation, strict=True)
            ]
            if self.between is None
            else self.between.latex(self.x)
        )
        lines += [
            rf"{with_index(name, 'k')} &= {formula_latex(formula.xreplace(at_k), x, w)}"
            for name, formula in zip(meter, self.meter_equation, strict=True)
        ]
        lines += [
            rf"{with_index(name, 'k')} &\in [-\pi, \pi]"
            for name in [state[i] for i in self.angles.x] + [meter[i] for i in self.angles.y]
        ]
        if values:
            lines += [
                rf"{sp.latex(name)} &= {number_latex(float(value))}"
                for name, value in self.values.items()
            ] + self.known.latex("t" if self.between is None else "t_{k}")
        return aligned(lines)

    def __repr__(self) -> str:
        rate = "{}'" if self.between is None else "d{}/dt"
        a = ", ".join(
            f"{rate.format(name)} = {formula}"
            for name, formula in zip(self.x, self.state_equation, strict=True)
        )
        b = ", ".join(
            f"{name} = {formula}"
            for name, formula in zip(self.measured, self.meter_equation, strict=True)
        )
        values = ", ".join(f"{name} = {value}" for name, value in self.parameters.items())
        return f"Model({a}, {b}{'; ' if values else ''}{values})"


def nothing_random(model: Model) -> str:
    """Why there is nothing to filter in a model: too little of it is random; empty if there is
    enough."""
    moving, measured = (
        any(
            variance and half.equation.subs(model.values).has(noise)
            for noise, variance in zip(half.noises, half.law.cov.diagonal(), strict=True)
        )
        for half in model.halves
    )
    if not moving and not model.prior.cov.any():
        return (
            f"the state is known exactly: neither the prior nor a noise of the state equation "
            f"{list(model.state_equation)} has a variance; give one of them a variance above 0"
        )
    if not (moving or measured):
        return (
            f"no noise enters the state equation {list(model.state_equation)} or the meter "
            f"{list(model.meter_equation)}: after some measurements nothing would be left to "
            "estimate; add a noise to one of them"
        )
    return ""


def _symbols(
    symbols: Mapping[str, Names] | None, values: Sequence[str], used: set[str], n: int
) -> dict[str, list[str]]:
    """Names of the state components and noises: given, or x, v, w with numbers as the formulas use
    them."""
    given = table("symbols", symbols, "xvw")
    result: dict[str, list[str]] = {}
    for key in "xvw":
        numbers = (
            int(name[1:]) for name in used - set(values) if re.fullmatch(key + r"[1-9][0-9]?", name)
        )
        count = max(numbers, default=0)
        if key == "x" and (n > 1 or count):
            count = n
        names = given.get(key, [f"{key}{i + 1}" for i in range(count)] or key)
        if not isinstance(names, Sequence) or not names:
            raise ModelError(
                f"`symbols`: {key} must be a name or a list of names, got {shown(names)}"
            )
        result[key] = [check_name(name) for name in ([names] if isinstance(names, str) else names)]
    every = [name for names in result.values() for name in names] + [*values]
    if twice := sorted({name for name in every if every.count(name) > 1}):
        raise ModelError(
            f"{', '.join(twice)} named twice: state, noises, parameters and inputs need different "
            f"names"
        )
    return result


def _read_angles(given: Names | None, x: list[str], y: list[str]) -> Angles:
    """The components named."""
    names = () if given is None else given
    if not isinstance(names, Sequence) or any([*x, *y].count(name) != 1 for name in names):
        raise ModelError(
            f"`angles` is a list of names of components, each of one only, such as those of "
            f"{', '.join([*x, *y])}; got {shown(given)}"
        )
    return Angles(*(tuple(i for i, name in enumerate(kind) if name in names) for kind in (x, y)))


def _warn_of_angles(
    given: Names | None, turning: Sequence[sp.Symbol], equations: Iterable[tuple[str, sp.Expr]]
) -> None:
    """AngleWarning for components that may pass from pi to -pi and of which nothing is said: those
    with an atan2, where nothing is said at all, and those that contain an angle as it is."""
    for name, equation in equations:
        jumping = [
            part
            for part in _outside_sines(equation)
            if part in turning
            # an atan2 of a point to the right jumps nowhere
            or (given is None and isinstance(part, sp.atan2) and not part.args[1].is_nonnegative)
        ]
        if jumping and name not in (given or ()):
            quoted = ", ".join(f'"{angle}"' for angle in [*(given or ()), name])
            warnings.warn(
                f"{name} contains the angle {jumping[0]}, which jumps from pi to -pi, outside sin "
                "and cos, and a filter takes the jump for an innovation of a turn: say "
                f"angles=[{quoted}], or angles=[] if nothing comes near pi",
                AngleWarning,
                stacklevel=3,  # where Model.define was called
            )


def _outside_sines(formula: sp.Basic) -> Iterator[sp.Basic]:
    """Its parts that stand outside sine, cosine and tangent."""
    parts = sp.preorder_traversal(formula)
    for part in parts:
        if isinstance(part, sp.sin | sp.cos | sp.tan):
            parts.skip()
        else:
            yield part
