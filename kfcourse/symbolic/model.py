"""The model of a filtering problem: an object, a meter, and their Gaussian noises.

    x_{k+1} = a(x_k, v_k)        state equation   (object)
    y_k     = b(x_k, w_k)        meter equation
    x_0 ~ N(m, d),  v_k ~ N(m_v, D_v),  w_k ~ N(m_w, D_w),   all independent

`Model` holds the two equations as SymPy expressions with their parameters as symbols.  Everything
else (structural functions, filters, simulation, the printed equations) is derived from it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import sympy as sp

from kfcourse.laws import Array, Gaussian
from kfcourse.symbolic.formula import check_name, parse, symbol

Formula: TypeAlias = str | sp.Expr
Formulas: TypeAlias = Formula | Sequence[Formula] | sp.MatrixBase
Names: TypeAlias = Sequence[str]


class ModelError(ValueError):
    """The description of a model is inconsistent; the message says what to change."""


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
    ) -> Model:
        """Build a model from formulas.

        Parameters
        ----------
        state, meter : str, sympy expression, or a list of them
            a(x, v) and b(x, w).  A single formula is a scalar model in x, v, w; lists of formulas use
            x1, x2, ..., v1, ..., w1, ... unless `symbols` names them.
        parameters : dict
            Name to number, for every other symbol in the formulas.
        symbols : dict, optional
            Keys "x", "v", "w": lists of names.
        prior, state_noise, meter_noise : dict, optional
            Keys "mean" and "variance" (number, list of variances, or covariance matrix).  Standard
            normal by default.

        Raises
        ------
        FormulaError
            A formula string cannot be read (points at the place).
        ModelError
            The parts do not fit together.

        Examples
        --------
        >>> Model.define("c*x + e*x*v", "g*x + f*x**2*w", dict(c=0.9, e=0.05, g=1, f=0.02))
        Model(x' = c*x + e*v*x, y = f*w*x**2 + g*x; c = 9/10, e = 1/20, g = 1, f = 1/50)
        """
        values = {_checked(name): _exact(name, value) for name, value in _table("parameters", parameters).items()}
        a, b = _as_list("state", state), _as_list("meter", meter)
        used = {name for formula in (*a, *b) for name in _names_in(formula)}
        named = _symbols(symbols, values, used, len(a))
        x, v, w = (tuple(symbol(name) for name in named[key]) for key in "xvw")
        if len(x) != len(a):
            raise ModelError(f"{len(a)} state equation(s) but {len(x)} state symbol(s) {named['x']}; there must be one each")
        constants = {name: symbol(name) for name in values}
        model = cls(
            sp.ImmutableMatrix([_read(f, constants | _by_name(x, v), "state") for f in a]),
            sp.ImmutableMatrix([_read(f, constants | _by_name(x, w), "meter") for f in b]),
            x,
            v,
            w,
            values,
            _law("prior", prior, len(x)),
            _law("state_noise", state_noise, len(v)),
            _law("meter_noise", meter_noise, len(w)),
        )
        for equation in (*model.state_equation.subs(model.values), *model.meter_equation.subs(model.values)):
            if equation.has(sp.zoo, sp.nan, sp.oo, -sp.oo, sp.I) or any(
                e.is_number and e.is_real is False for e in sp.preorder_traversal(equation)
            ):
                raise ModelError(f"with these parameters {model} has no finite real value: {equation}")
        if not model.meter_equation.has(*x):
            raise ModelError(f"the meter {list(model.meter_equation)} does not depend on the state {list(x)}: nothing to filter")
        return model

    @property
    def n(self) -> int:
        """Number of state components."""
        return len(self.x)

    @property
    def p(self) -> int:
        """Number of measurement components."""
        return len(self.meter_equation)

    @cached_property
    def values(self) -> dict[sp.Symbol, sp.Rational]:
        """Parameter symbols and their values, for `subs`."""
        return {symbol(name): value for name, value in self.parameters.items()}

    def replace(self, **parameters: float) -> Model:
        """The same model with some parameters changed: ``model.replace(f=0.2)``."""
        unknown = sorted(set(parameters) - set(self.parameters))
        if unknown:
            raise ModelError(f"the model has no parameter {', '.join(unknown)}; it has {', '.join(self.parameters) or 'none'}")
        values = dict(self.parameters) | {name: _exact(name, value) for name, value in parameters.items()}
        return Model(
            self.state_equation,
            self.meter_equation,
            self.x,
            self.v,
            self.w,
            values,
            self.prior,
            self.state_noise,
            self.meter_noise,
        )

    def __repr__(self) -> str:
        a = ", ".join(f"{name}' = {formula}" for name, formula in zip(self.x, self.state_equation, strict=True))
        names = ["y"] if self.p == 1 else [f"y{i + 1}" for i in range(self.p)]
        b = ", ".join(f"{name} = {formula}" for name, formula in zip(names, self.meter_equation, strict=True))
        values = ", ".join(f"{name} = {value}" for name, value in self.parameters.items())
        return f"Model({a}, {b}{'; ' if values else ''}{values})"


def _by_name(*groups: tuple[sp.Symbol, ...]) -> dict[str, sp.Symbol]:
    return {s.name: s for group in groups for s in group}


def _table(what: str, table: Mapping[str, Any] | None) -> dict[str, Any]:
    if table is None:
        return {}
    if not isinstance(table, Mapping):
        raise ModelError(f"`{what}` must be a table such as {{'name': value}}, got {table!r}")
    return dict(table)


def _checked(name: str) -> str:
    try:
        return check_name(name)
    except ValueError as error:
        raise ModelError(str(error)) from None


def _exact(name: str, value: Any) -> sp.Rational:
    """The decimal number a person typed, exactly: 0.9 is 9/10."""
    if isinstance(value, sp.Rational):
        return value
    try:
        number = float(value) if isinstance(value, int | float | np.integer | np.floating) else float("nan")
    except OverflowError:
        number = float("inf")
    if isinstance(value, bool) or not np.isfinite(number):
        raise ModelError(f"parameter {name} = {value!r}: expected a finite number")
    if number and not 1e-100 < abs(number) < 1e100:
        raise ModelError(f"parameter {name} = {value!r} is too large or too small; change the units")
    return sp.Rational(str(value))


def exact_matrix(array: Array) -> sp.ImmutableMatrix:
    """Decimal numbers as exact rationals; a vector becomes a column."""
    rows = array[:, None] if array.ndim == 1 else array
    return sp.ImmutableMatrix([[sp.Rational(str(float(value))) for value in row] for row in rows])


def _as_list(what: str, formulas: Formulas) -> list[Formula]:
    if isinstance(formulas, str) or (isinstance(formulas, sp.Expr) and not isinstance(formulas, sp.MatrixBase)):
        return [formulas]
    result = list(formulas) if isinstance(formulas, Sequence | sp.MatrixBase) else [formulas]
    if not result:
        raise ModelError(f"`{what}` holds no formula")
    for formula in result:
        if not isinstance(formula, str | sp.Expr):
            raise ModelError(f"`{what}` must be a formula or a list of formulas, got {formula!r}")
    return result


def _names_in(formula: Formula) -> set[str]:
    if isinstance(formula, str):
        return set(re.findall(r"[A-Za-z][A-Za-z0-9_]*", formula))
    return {s.name for s in formula.free_symbols if isinstance(s, sp.Symbol)}


def _symbols(symbols: Mapping[str, Names] | None, values: Mapping[str, Any], used: set[str], n: int) -> dict[str, list[str]]:
    """Names of the state components and noises: given, or x, v, w with numbers as the formulas use them."""
    given = _table("symbols", symbols)
    if set(given) - set("xvw"):
        raise ModelError(f"`symbols` has the keys x, v, w, not {', '.join(sorted(set(given) - set('xvw')))}")
    result = {}
    for key in "xvw":
        if key in given:
            names: list[str] = [*([given[key]] if isinstance(given[key], str) else given[key])]
        elif key == "x":
            names = ["x"] if n == 1 and "x1" not in used else [f"x{i + 1}" for i in range(n)]
        else:
            numbers = [int(name[1:]) for name in used - set(values) if re.fullmatch(key + r"[1-9][0-9]?", name)]
            names = [f"{key}{i + 1}" for i in range(max(numbers))] if numbers else [key]
        if not names and key != "x":
            raise ModelError(f"`symbols` names no {key}; leave the key out, or give at least one name")
        result[key] = [_checked(name) for name in names]
    every = [name for names in result.values() for name in names] + list(values)
    twice = sorted({name for name in every if every.count(name) > 1})
    if twice:
        raise ModelError(f"{', '.join(twice)} named twice: state, noises and parameters need different names")
    return result


def _read(formula: Formula, known: dict[str, sp.Symbol], what: str) -> sp.Expr:
    if isinstance(formula, str):
        return parse(formula, known)
    # Symbols of the caller are recognised by name, whatever their assumptions.
    unknown = sorted(_names_in(formula) - set(known))
    if unknown:
        raise ModelError(f"the {what} equation {formula} has unknown symbols {', '.join(unknown)}; known: {', '.join(known)}")
    return formula.subs({s: known[s.name] for s in formula.free_symbols})


def _law(what: str, law: Mapping[str, Any] | None, size: int) -> Gaussian:
    """A Gaussian from {"mean": ..., "variance": ...}; standard normal for what is left out."""
    law = _table(what, law)
    if set(law) - {"mean", "variance"}:
        raise ModelError(f"`{what}` has the keys mean and variance, not {', '.join(sorted(set(law) - {'mean', 'variance'}))}")
    try:
        mean = np.broadcast_to(np.asarray(law.get("mean", 0.0), dtype=float), (size,)).copy()
        cov = np.asarray(law.get("variance", 1.0), dtype=float)
        cov = cov.copy() if cov.ndim == 2 else np.diag(np.broadcast_to(cov, (size,)))
    except (TypeError, ValueError):
        raise ModelError(
            f"`{what}`: mean and variance must be numbers, or lists of {size} numbers (variance: or a matrix)"
        ) from None
    if cov.shape != (size, size):
        raise ModelError(f"`{what}`: the covariance has shape {cov.shape}, expected ({size}, {size})")
    if not (np.isfinite(mean).all() and np.isfinite(cov).all()):
        raise ModelError(f"`{what}`: mean and variance must be finite, got {mean} and {cov.tolist()}")
    if not np.array_equal(cov, cov.T):
        raise ModelError(f"`{what}`: the covariance matrix must be symmetric, got {cov.tolist()}")
    eigenvalues = np.linalg.eigvalsh(cov)
    if eigenvalues.min() < -1e-12 * max(eigenvalues.max(), 0.0):  # rounding of eigvalsh
        raise ModelError(f"`{what}`: negative variance in {cov.tolist()}")
    return Gaussian(mean, cov)
