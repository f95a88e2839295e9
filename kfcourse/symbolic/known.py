"""What is known of every step: its number k, its time t = interval * k, and the inputs; and functions that depend on it.

A model without them pays nothing: a `Stepwise` function is then the generated function itself, at every step.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import sympy as sp

from kfcourse.laws import Array
from kfcourse.symbolic.codegen import Compiled, compile_function
from kfcourse.symbolic.formula import symbol
from kfcourse.symbolic.reading import ModelError, checked_name, exact_number, of_numbers, read, shown, table
from kfcourse.symbolic.sense import not_computable

CHECKED = 1000  # steps for which a variance is tried out
SURE = 51  # steps of a run of the lab: a model whose variance fails before is refused as it is defined


@dataclass(frozen=True)
class Known:
    """What a model knows of every step.

    Attributes
    ----------
    symbols : tuple of sympy.Symbol
        Those of k, t and the inputs that its equations contain.
    interval : sympy.Rational
        Time between two steps, t = interval * k.
    inputs : dict
        Name to its values at the steps 0, 1, 2...
    end : (float, str)
        The first step at which a noise has no variance, and why; the model holds for the steps before.
    """

    symbols: tuple[sp.Symbol, ...] = ()
    interval: sp.Rational = sp.S.One
    inputs: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    end: tuple[float, str] = (np.inf, "")

    @classmethod
    def read(cls, interval: Any, inputs: Mapping[str, Sequence[float] | Array] | None) -> Known:
        """The interval and the inputs as people give them; ModelError if they are none."""
        length = exact_number("interval", interval)
        if not length > 0:
            raise ModelError(f"the interval between two steps must be positive, got {shown(interval)}")
        values = {checked_name(name): _sequence(name, given) for name, given in table("inputs", inputs).items()}
        return cls((), length, values)

    def names(self, taken: Sequence[str]) -> dict[str, sp.Symbol]:
        """Symbols that formulas may use: k and t, where they name nothing else, and the inputs."""
        return {name: symbol(name) for name in ("k", "t", *self.inputs) if name in self.inputs or name not in taken}

    def used(self, equations: sp.MatrixBase, known: Mapping[str, sp.Symbol]) -> Known:
        """The same with the symbols of these equations."""
        return replace(self, symbols=tuple(s for s in known.values() if equations.has(s)))

    @property
    def steps(self) -> float:
        """For how many steps the inputs have values and the noises variances; infinite if nothing ends."""
        return min(self.end[0], *(len(values) for name, values in self.inputs.items() if symbol(name) in self.symbols), np.inf)

    def at(self, k: int) -> Array:
        """Values of `symbols` at step k, (m,); ModelError if an input or a variance ends before."""
        if k >= self.end[0]:
            raise ModelError(f"{self.end[1]}; run at most {self.end[0]} steps, or change the formula")
        return np.array([self._value(s.name, k) for s in self.symbols])

    def _value(self, name: str, k: int) -> float:
        if name in self.inputs:
            values = self.inputs[name]
            if k >= len(values):
                raise ModelError(
                    f"the input {name} has {len(values)} value(s), for the steps 0 to {len(values) - 1}, but step {k} needs one; "
                    "give a value for every step, or run fewer"
                )
            return values[k]
        return float(k if name == "k" else self.interval * k)

    def latex(self) -> list[str]:
        """Lines of an `aligned` block: the time, and the first values of the inputs."""
        lines = [rf"t &= {sp.latex(self.interval * symbol('k'))}"] if symbol("t") in self.symbols else []
        for name, values in self.inputs.items():
            shown = ", ".join(f"{value:g}" for value in values[:6]) + (r", \ldots" if len(values) > 6 else "")
            lines.append(rf"{sp.latex(symbol(name))}_0, {sp.latex(symbol(name))}_1, \ldots &= {shown}")
        return lines


def _sequence(name: str, given: Any) -> tuple[float, ...]:
    try:
        values = np.asarray(given, dtype=float) if of_numbers(given) else np.array(np.nan)
    except (TypeError, ValueError, OverflowError):
        values = np.array(np.nan)
    if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
        raise ModelError(f"the input {name} must be a list of finite numbers, one for every step; got {shown(given)}")
    return tuple(values.tolist())


class Stepwise(NamedTuple):
    """A generated function, and what is known of every step: the function's last argument, if its formulas contain any of it."""

    compiled: Compiled
    known: Known

    @classmethod
    def compile(
        cls,
        known: Known,
        name: str,
        arguments: Mapping[str, sp.MatrixBase],
        outputs: Mapping[str, sp.MatrixBase],
        vectors: Sequence[str],
    ) -> Stepwise:
        """Arguments as of `compile_function`."""
        if known.symbols:
            arguments = {**arguments, "known": sp.Matrix(known.symbols)}
        return cls(compile_function(name, arguments, outputs, [*vectors, "known"]), known)

    def at(self, k: int | None) -> Callable[..., Any]:
        """The function at step k."""
        function = self.compiled.function
        if not self.known.symbols:
            return function
        values = self.known.at(needed(k))
        return lambda *arrays: function(*arrays, values)


def needed(k: int | None) -> int:
    """The step; ModelError if it is not given."""
    if k is None:
        raise ModelError("the model depends on the step: say which, as in structure.at(k) or equation(x, v, k)")
    return k


def varying_law(
    what: str,
    given: Mapping[str, Any] | None,
    noises: Sequence[sp.Symbol],
    symbols: dict[str, sp.Symbol],
    known: Known,
    parameters: Mapping[sp.Symbol, sp.Rational],
) -> tuple[dict[sp.Symbol, sp.Expr], dict[str, Any], Known]:
    """A law of noises in which means and variances may be formulas of the step.

    A noise with the mean m_k and the variance D_k is m_k + sqrt(D_k) v with a standard one: these go into the equations.

    Returns
    -------
    dict, dict, Known
        What takes the place of each noise in the equations, the law that is left for it, and for which steps that holds.
    """
    law = table(what, given)
    scale, shift = (_formulas(what, law.get(key), len(noises), symbols) for key in ("variance", "mean"))
    if scale:
        # A mean that is a number moves into the equations too, as the law's own is multiplied by the deviation.
        means = _numbers(law.get("mean", 0.0), len(noises))
        shift = {i: means[i] for i in scale if i < len(means)} | shift
        law["mean"] = [0.0 if i in scale else one for i, one in enumerate(means)] if means else law.get("mean", 0.0)
        law["variance"] = _without(scale, law["variance"], 1.0)
        for i, variance in scale.items():
            known = replace(known, end=min(known.end, _end_of(what, noises[i], variance, known, symbols, parameters)))
    if shift:
        law["mean"] = _without(shift, law["mean"], 0.0)
    changed = {noises[i]: shift.get(i, 0) + sp.sqrt(scale.get(i, 1)) * noises[i] for i in {**scale, **shift}}
    return changed, law, known


def _numbers(given: Any, size: int) -> list[Any]:
    """The entries of a list, or one number for all, exactly; formulas as they are; none if they do not fit, which `law` tells."""
    entries = [given] * size if np.ndim(given) == 0 else [*given]
    try:
        return [one if _is_formula(one) else sp.Rational(str(float(one))) for one in entries]
    except (TypeError, ValueError):
        return []


def _without(formulas: Mapping[int, sp.Expr], given: Any, instead: float) -> Any:
    """What was given, with a number in the place of each formula."""
    return instead if _is_formula(given) else [instead if i in formulas else one for i, one in enumerate(given)]


def _formulas(what: str, given: Any, size: int, symbols: dict[str, sp.Symbol]) -> dict[int, sp.Expr]:
    """The formulas among numbers, by the number of the component; one formula holds for all."""
    entries = [given] * size if _is_formula(given) else [*given] if isinstance(given, Sequence) else []
    if any(any(map(_is_formula, row)) for row in entries if isinstance(row, Sequence) and not isinstance(row, str)):
        raise ModelError(
            f"`{what}`: a covariance matrix cannot have formulas; write correlated noises that change with time into the "
            "equation, as in (1 + k)*v1 + k*v2"
        )
    found = {i: read(one, symbols, what) for i, one in enumerate(entries) if _is_formula(one)}
    if found and len(entries) != size:
        raise ModelError(f"`{what}`: {len(entries)} entries for {size} noise(s); give one for each")
    return found


def _is_formula(one: Any) -> bool:
    return isinstance(one, str) or (isinstance(one, sp.Expr) and bool(one.free_symbols))


def _end_of(
    what: str,
    noise: sp.Symbol,
    variance: sp.Expr,
    known: Known,
    symbols: Mapping[str, sp.Symbol],
    parameters: Mapping[sp.Symbol, sp.Rational],
) -> tuple[float, str]:
    """The first of many steps at which a variance is negative or not finite, and what to say then; ModelError if it is early."""
    if problem := not_computable(sp.Matrix([variance]), parameters, {}):
        raise ModelError(f"`{what}`: the variance of {noise}, {problem}")
    numeric = sp.Matrix([variance.subs(parameters)])
    used = replace(known, end=Known.end).used(numeric, {name: s for name, s in symbols.items() if s not in parameters})
    steps = int(min(CHECKED, used.steps)) if used.symbols else 1  # the same at all steps
    variance_at = Stepwise.compile(used, "variance", {}, {"variance": numeric}, [])
    with np.errstate(all="ignore"):
        for k in range(steps):
            value = float(np.squeeze(variance_at.at(k)()[0]))
            if not 0 <= value < np.inf:
                wrong = "must be finite" if value > 0 else "must not be negative"
                problem = f"`{what}`: the variance of {noise} is {value:g} at step {k}; it {wrong}"
                if k < SURE:
                    raise ModelError(problem)
                return k, problem
    return Known.end
