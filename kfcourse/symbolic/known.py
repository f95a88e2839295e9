"""What is known of every step: its number k, its time t = interval * k, and the inputs; and
variances of noises that depend on it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.laws import Array, Gaussian
from kfcourse.symbolic.formula import check_name, symbol
from kfcourse.symbolic.reading import (
    Formula,
    ModelError,
    by_name,
    exact_matrix,
    exact_number,
    law,
    numbers,
    read,
    shown,
    table,
)


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
    """

    symbols: tuple[sp.Symbol, ...] = ()
    interval: sp.Rational = sp.S.One
    inputs: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    @classmethod
    def read(cls, interval: Any, inputs: Mapping[str, Sequence[float] | Array] | None) -> Known:
        """The interval and the inputs as people give them; ModelError if they are none."""
        length = exact_number("interval", interval)
        if not length > 0:
            raise ModelError(
                f"the interval between two steps must be positive, got {shown(interval)}"
            )
        sequences = {}
        for name, given in table("inputs", inputs).items():
            values = numbers(given)
            if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
                raise ModelError(
                    f"the input {name} must be a list of finite numbers, one for every step; got "
                    f"{shown(given)}"
                )
            sequences[check_name(name)] = tuple(values.tolist())
        return cls((), length, sequences)

    def names(self, taken: Sequence[str]) -> dict[str, sp.Symbol]:
        """Symbols that formulas may use: k and t, where they name nothing else, and the inputs."""
        return {
            name: symbol(name)
            for name in ("k", "t", *self.inputs)
            if name in self.inputs or name not in taken
        }

    def used(self, equations: sp.MatrixBase, known: Mapping[str, sp.Symbol]) -> Known:
        """The same with the symbols of these equations."""
        return replace(self, symbols=tuple(s for s in known.values() if equations.has(s)))

    @property
    def steps(self) -> float:
        """For how many steps the inputs have values; infinite if nothing ends."""
        ends = (len(values) for name, values in self.inputs.items() if symbol(name) in self.symbols)
        return min([np.inf, *ends])

    def at(self, k: int | None) -> Array:
        """Values of `symbols` at step k, (m,).

        Raises
        ------
        ModelError
            There are any, and no step is given, or an input ends before.
        """
        if not self.symbols:
            return np.empty(0)
        if k is None:
            raise ModelError(
                "the model depends on the step: say which, as in structure.at(k) or "
                "equation(x, v, k)"
            )
        return np.array([self._value(s.name, k) for s in self.symbols])

    def _value(self, name: str, k: int) -> float:
        if name not in self.inputs:
            return float(k if name == "k" else self.interval * k)
        values = self.inputs[name]
        if k >= len(values):
            raise ModelError(
                f"the input {name} has {len(values)} value(s), for the steps 0 to "
                f"{len(values) - 1}, but step {k} needs one; "
                "give a value for every step, or run fewer"
            )
        return values[k]

    def latex(self, time: str = "t") -> list[str]:
        """Lines of an `aligned` block: the time of a step, and the first values of the inputs."""
        clock = symbol("t") in self.symbols and "t" not in self.inputs
        lines = [rf"{time} &= {sp.latex(self.interval * symbol('k'))}"] if clock else []
        for name, values in self.inputs.items():
            letter, more = sp.latex(symbol(name)), [r"\ldots"] if len(values) > 6 else []
            listed = ", ".join([*(f"{value:g}" for value in values[:6]), *more])
            lines.append(rf"{letter}_0, {letter}_1, \ldots &= {listed}")
        return lines


def equation_and_law(
    what: str,
    formulas: Sequence[Formula],
    noises: Sequence[sp.Symbol],
    given: Mapping[str, Any] | None,
    symbols: dict[str, sp.Symbol],
    x: Sequence[sp.Symbol],
) -> tuple[sp.ImmutableMatrix, Gaussian]:
    """The state or the meter equation, and the law of its noises, in which variances may be
    formulas of the step.

    A noise with the mean m and the variance D_k is m + sqrt(D_k) (v - m) with a v of the variance
    1: this goes into the equation.
    """
    parts = table(f"{what}_noise", given)
    variance = parts.get("variance", 1.0)
    entries = variance if isinstance(variance, list | tuple) else [variance] * len(noises)
    deviations = {
        noise: sp.sqrt(read(entry, symbols, what))
        for noise, entry in zip(noises, entries, strict=False)
        if isinstance(entry, str)
    }
    if deviations:
        parts["variance"] = [1.0 if isinstance(entry, str) else entry for entry in entries]
    result = law(f"{what}_noise", parts, len(noises))
    means = dict(zip(noises, exact_matrix(result.mean), strict=True))
    changed = {v: means[v] + scale * (v - means[v]) for v, scale in deviations.items()}
    names = symbols | by_name(x, noises)
    equation = sp.ImmutableMatrix([read(formula, names, what) for formula in formulas])
    return equation.subs(changed), result
