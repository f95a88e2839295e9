"""The continuous-time model, and the discrete one whose limit it is."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.errors import expect, expect_positive
from kfcourse.laws import Array, Gaussian
from kfcourse.symbolic.codegen import Entries, compile_function
from kfcourse.symbolic.formula import symbol
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import (
    Formula,
    Formulas,
    ModelError,
    Names,
    by_name,
    formula_list,
    fresh,
    law,
    numbered,
    parameter_values,
    read,
)


@dataclass(frozen=True)
class ContinuousModel:
    """A continuous-time model with white noises; build it with `ContinuousModel.define`.

    Attributes
    ----------
    drift, diffusion, signal : sympy.Matrix
        f(x, t), n x 1; g(x, t), n x r; S(x, t), p x 1, with parameters and the time t as symbols.
    x : tuple of sympy.Symbol
    parameters : dict
        Parameter name to value (exact rational numbers).
    prior : Gaussian
        Law of x(0).
    spectral_density, noise_density : ndarray (r, r), (p, p)
        One-sided spectral densities S_xi of xi and N of n: units squared per hertz.
    """

    drift: sp.ImmutableMatrix
    diffusion: sp.ImmutableMatrix
    signal: sp.ImmutableMatrix
    x: tuple[sp.Symbol, ...]
    parameters: Mapping[str, sp.Rational]
    prior: Gaussian = field(compare=False)
    spectral_density: Array = field(compare=False)
    noise_density: Array = field(compare=False)

    @classmethod
    def define(
        cls,
        drift: Formulas,
        diffusion: Formula | Sequence[Sequence[Formula]] | sp.MatrixBase,
        signal: Formulas,
        parameters: Mapping[str, float] | None = None,
        *,
        symbols: Names | None = None,
        prior: Mapping[str, Any] | None = None,
        spectral_density: Any = 1.0,
        noise_density: Any = 1.0,
    ) -> ContinuousModel:
        """Build a model from formulas.

        Parameters
        ----------
        drift, signal : str, sympy expression, or a list of them
            f(x, t) and S(x, t).  A single drift formula is a scalar model in x; lists use x1, x2,
            ... unless `symbols` names
            them.  t is the time from the start on, unless a parameter or a component is called so.
        diffusion : str, sympy expression, or a list of rows
            g(x, t), one row for each state component, one column for each noise.
        parameters : dict
            Name to number, for every other symbol in the formulas.
        symbols : sequence of str, optional
            Names of the state components.
        prior : dict, optional
            Keys "mean" and "variance", as in `Model.define`.
        spectral_density, noise_density : number, list of numbers, or matrix
            One-sided densities of xi and n.

        Raises
        ------
        FormulaError, ModelError
            As `Model.define`; also a meter without noise (its density must be positive definite).

        Examples
        --------
        >>> from kfcourse.continuous import ContinuousModel
        >>> ContinuousModel.define("-a*x", "s", "sin(x)", dict(a=0.5, s=1), noise_density=0.2)
        ContinuousModel(dx/dt = -a*x + s*xi, y = sin(x) + n; a = 1/2, s = 1)
        >>> ContinuousModel.define("-x + cos(t)", "1 + exp(-t)", "x")
        ContinuousModel(dx/dt = -x + xi*(1 + exp(-t)) + cos(t), y = x + n)
        """
        values = parameter_values(parameters)
        f, S = formula_list("drift", drift), formula_list("signal", signal)
        g = diffusion_rows(diffusion)
        n, noises = len(f), len(g[0])
        names = [*([symbols] if isinstance(symbols, str) else symbols or numbered("x", n))]
        if len(names) != n or len(g) != n:
            raise ModelError(
                f"{n} drift formula(s), {len(g)} row(s) of diffusion and the state symbols "
                f"{names}: one each is needed"
            )
        x = tuple(symbol(name) for name in names)
        known = {"t": symbol("t")} | {name: symbol(name) for name in values} | by_name(x)
        N = law("noise_density", {"variance": noise_density}, len(S)).cov
        # rounding of eigvalsh
        if np.linalg.eigvalsh(N).min() <= 1e-12 * np.linalg.eigvalsh(N).max():
            raise ModelError(
                f"`noise_density` must be positive definite, got {N.tolist()}: without noise, "
                f"y(t) would give S(x) exactly"
            )
        model = cls(
            sp.ImmutableMatrix([read(formula, known, "drift") for formula in f]),
            sp.ImmutableMatrix(
                [[read(formula, known, "diffusion") for formula in row] for row in g]
            ),
            sp.ImmutableMatrix([read(formula, known, "signal") for formula in S]),
            x,
            values,
            law("prior", prior, n),
            law("spectral_density", {"variance": spectral_density}, noises).cov,
            N,
        )
        # its checks are this model's too: names, real and finite numbers, a signal of the state
        to_discrete(model, 1.0)
        return model

    @property
    def n(self) -> int:
        """Number of state components."""
        return len(self.x)

    @property
    def p(self) -> int:
        """Number of measurement components."""
        return len(self.signal)

    @cached_property
    def values(self) -> dict[sp.Symbol, sp.Rational]:
        """Parameter symbols and their values, for `subs`."""
        return {symbol(name): value for name, value in self.parameters.items()}

    @cached_property
    def time(self) -> sp.Symbol | None:
        """t, if the formulas contain it."""
        t = symbol("t")
        used = any(matrix.has(t) for matrix in (self.drift, self.diffusion, self.signal))
        return t if used and t.name not in self.taken else None

    @property
    def taken(self) -> set[str]:
        """The names of its symbols."""
        return {*self.parameters, *by_name(self.x)}

    def __repr__(self) -> str:
        xi = [symbol(name) for name in numbered("xi", self.diffusion.cols)]
        rates = self.drift + self.diffusion * sp.Matrix(xi)
        rows = [f"d{x}/dt = {rate}" for x, rate in zip(self.x, rates, strict=True)]
        rows += [
            f"{y} = {S} + n{y[1:]}" for y, S in zip(numbered("y", self.p), self.signal, strict=True)
        ]
        values = ", ".join(f"{name} = {value}" for name, value in self.parameters.items())
        return f"ContinuousModel({', '.join(rows)}{'; ' if values else ''}{values})"


def diffusion_rows(diffusion: Any) -> list[list[Formula]]:
    rows = diffusion.tolist() if isinstance(diffusion, sp.MatrixBase) else diffusion
    if isinstance(rows, str | sp.Expr):
        return [[rows]]
    if (
        not isinstance(rows, list | tuple)
        or not rows
        or not all(isinstance(row, list | tuple) for row in rows)
    ):
        raise ModelError(
            f"`diffusion` must be one formula or a list of rows such as [['0'], ['s']], got "
            f"{diffusion!r}"
        )
    lists = [formula_list("diffusion", list(row)) for row in rows]
    if len({len(row) for row in lists}) > 1:
        raise ModelError(
            f"`diffusion`: rows of different lengths {[len(row) for row in lists]}; write 0 where "
            f"a noise does not enter"
        )
    return lists


def to_discrete(model: ContinuousModel, step: float) -> Model:
    """The discrete model whose limit for T -> 0 the continuous one is.

    x_{k+1} = x_k + T f(x_k) + T g(x_k) v_k,  v ~ N(0, S_xi / (2 T));    y_k = S(x_k) + w_k,  w ~
    N(0, N / (2 T))

    f, g and S at the time t_k = T k.  Both noises are means of white noise over the step.  All
    discrete filters run on it.
    """
    expect(model, ContinuousModel, "to_discrete")
    expect_positive(step=step)
    T = sp.Rational(str(float(step)))
    v = [fresh(name, model.taken) for name in numbered("v", model.diffusion.cols)]
    w = [fresh(name, model.taken) for name in numbered("w", model.p)]
    return Model.define(
        list(sp.Matrix(model.x) + T * (model.drift + model.diffusion * sp.Matrix(v))),
        list(model.signal + sp.Matrix(w)),
        model.parameters,
        symbols={
            "x": [s.name for s in model.x],
            "v": [s.name for s in v],
            "w": [s.name for s in w],
        },
        prior={"mean": model.prior.mean, "variance": model.prior.cov},
        state_noise={"variance": model.spectral_density / (2 * step)},
        meter_noise={"variance": model.noise_density / (2 * step)},
        interval=T,
    )


def compiled(
    model: ContinuousModel, arguments: Sequence[Entries], outputs: Sequence[Entries]
) -> Callable[..., Any]:
    """The generated function of the time and these arguments."""
    function = compile_function(
        [*arguments, [model.time or sp.Dummy()]],
        [sp.Array(entries).subs(model.values) for entries in outputs],
    )
    return lambda t, *arrays: function(*arrays, np.array([t]))
