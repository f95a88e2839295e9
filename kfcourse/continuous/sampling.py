r"""An object that moves in continuous time and is measured at instants.

    dx  = a(x, t) dt + B(x, t) dw   w: independent Wiener processes, D w(t) = t; in Ito's sense
    y_k = b(x(t_k), w_k)                   at instants t_0 < t_1 < ...

Such an object is a `Model` whose `between` says how it moves between two measurements.  Its
structural functions integrate the moment equations (`kfcourse.continuous.integration`), so filters,
likelihood, smoother, estimation and comparison are those of every model; what needs a difference
equation refuses it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.angles import on_circle
from kfcourse.continuous.equations import symmetrised_drift
from kfcourse.continuous.exact import by_substeps
from kfcourse.continuous.integration import at_rest, flow_of, moment_equations, rates_of
from kfcourse.continuous.model import diffusion_rows
from kfcourse.errors import expect_sizes
from kfcourse.filters.base import Filter
from kfcourse.laws import (
    Array,
    Gaussian,
    Matrices,
    Transition,
    Vectors,
    apply,
    product,
    symmetric,
    transpose,
)
from kfcourse.symbolic.codegen import compile_function
from kfcourse.symbolic.equations import Equation
from kfcourse.symbolic.formula import symbol
from kfcourse.symbolic.known import Known
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import Formula, Formulas, ModelError, Names, by_name, numbered, read
from kfcourse.symbolic.structure import Structure, gaussian, linearised, of_steps
from kfcourse.symbolic.typesetting import joined
from kfcourse.symbolic.writing import formula_latex


@dataclass(frozen=True)
class Between:
    """How an object moves between measurements.

    Attributes
    ----------
    drift, diffusion : sympy.Matrix
        a(x, t), (n, 1), and B(x, t), (n, r), in Ito's sense.
    correction : sympy.Matrix
        What the symmetrised (Stratonovich) sense has added to the drift, (n, 1); zeros in Ito's
        sense.
    substeps : int
        Steps of a simulation between two instants.
    accuracy : float
        Error of a step of the moment equations, in standard deviations.
    """

    drift: sp.ImmutableMatrix
    diffusion: sp.ImmutableMatrix
    correction: sp.ImmutableMatrix
    substeps: int = field(compare=False)
    accuracy: float = field(compare=False)

    def structure(self, model: Model, approximation: Callable[[Model], Structure]) -> Structure:
        """Structural functions: tau and Theta by the moment equations, h, G and F of the meter as
        of every model."""
        formulas = derived = None
        if approximation in (gaussian, linearised):  # before the meter, which may take a minute
            derived = moment_equations(model, approximation)
        meter = approximation(at_rest(model))
        if derived is not None and meter.formulas is not None:
            z, p, *rates = derived
            names = ("tau_dot", "A", "Theta_dot", "p_dot")
            functions = dict(zip(names, [*rates, derived.rates[1]], strict=True))
            functions |= {name: meter.formulas.functions[name] for name in "hGF"}
            formulas = replace(meter.formulas, model=model, z=z, p=p, functions=functions)
        compiled = rates_of(model, approximation, derived)
        flow, angles = flow_of(compiled, model, self.accuracy), model.angles.x

        def at(k: int | None) -> Structure:
            k = k or 0
            span, now = clock(model.known, k)

            def predict(z: Vectors, p: Matrices) -> Gaussian:
                tau, A, Q = flow(now, span, z, p)
                return Gaussian(
                    on_circle(tau, angles), symmetric(product(product(A, p), transpose(A)) + Q)
                )

            def transition(z: Vectors, p: Matrices) -> Transition:
                return Transition(*flow(now, span, z, p)[1:])

            return Structure(meter.name, model, predict, meter.at(k).measure, transition)

        return of_steps(meter.name, model, at, formulas)

    def latex(self, x: Sequence[sp.Symbol]) -> list[str]:
        """Lines dx = a dt + B dV of an `aligned` block, V the Wiener processes."""
        lines = []
        for i, name in enumerate(x):
            factors = {"dt": self.drift[i]}
            for j, entry in enumerate(self.diffusion.row(i), 1):
                factors[f"dV_{{{j}}}" if self.diffusion.cols > 1 else "dV"] = entry
            terms = []
            for of, factor in factors.items():
                text = formula_latex(factor, x)
                text = rf"\left({text}\right)" if factor.is_Add else text
                if factor != 0:
                    terms.append({1: "", -1: "-"}.get(factor, text) + rf"\,{of}")
            first, *further = joined(terms)
            lines += [f"d{sp.latex(name)} &= {first}", *(rf"&\quad {line}" for line in further)]
        return lines

    def exact(self, model: Model, accuracy: float) -> Filter:
        """`pointmass` of a scalar model, by sub-steps (`kfcourse.continuous.exact`)."""
        return by_substeps(model, accuracy, partial(clock, model.known))

    def motion(self, model: Model) -> Equation:
        """One interval of a simulation, (x (..., n), noise (..., r substeps), k) -> (..., n); noise
        standard.

        dx = a dt + B dw, then x' = x + (a(x, t) + a(x + dx, t + dt)) dt / 2 + B(x, t) dw: of strong
        order 1 and weak order 2 if B is constant, 1/2 and 1 if it depends on x.
        """
        a, B = (part.subs(model.values) for part in (self.drift, self.diffusion))
        drift = compile_function([model.x, model.known.symbols], [list(a)])
        diffusion = compile_function([model.x, model.known.symbols], [B])

        def motion(x: Array, noise: Array, k: int | None = None) -> Array:
            span, now = clock(model.known, k or 0)
            h = span / self.substeps
            for i, dw in enumerate(
                np.moveaxis(np.sqrt(h) * noise.reshape(*noise.shape[:-1], self.substeps, -1), -2, 0)
            ):
                (a,), (B,) = drift(x, now(i * h)), diffusion(x, now(i * h))
                pushed = x + apply(B, dw)
                x = pushed + h / 2 * (a + drift(pushed + h * a, now((i + 1) * h))[0])
            return x

        return motion


def clock(known: Known, k: int) -> tuple[float, Callable[[float], Array]]:
    """How long it is from t_k to t_{k+1}, and what is known so much later than t_k: values of
    `known.symbols`.

    After the last of listed instants as long as before it.  Inputs hold until the next instant.
    """
    listed, values, span = known.inputs.get("t"), known.at(k), float(known.interval)
    if listed is not None and len(listed) > 1:
        i = min(k, len(listed) - 2)
        span = listed[i + 1] - listed[i]
        if not span > 0:
            raise ModelError(
                f"instants must follow one another: t_{i + 1} = {listed[i + 1]:g} comes after "
                f"t_{i} = {listed[i]:g}"
            )
    is_time = np.array([s.name == "t" for s in known.symbols])
    return span, lambda s: values + s * is_time


def sampled(
    drift: Formulas,
    diffusion: Formula | Sequence[Sequence[Formula]] | sp.MatrixBase,
    meter: Formulas,
    parameters: Mapping[str, float] | None = None,
    *,
    symbols: Mapping[str, Names] | None = None,
    prior: Mapping[str, Any] | None = None,
    meter_noise: Mapping[str, Any] | None = None,
    angles: Names | Mapping[str, Names] | None = None,
    inputs: Mapping[str, Sequence[float]] | None = None,
    interval: float = 1,
    instants: Sequence[float] | None = None,
    stratonovich: bool = False,
    substeps: int = 16,
    accuracy: float = 1e-6,
) -> Model:
    """A model that moves in continuous time and is measured at instants.

    Parameters
    ----------
    drift, meter : str, sympy expression, or a list of them
        a(x, t) and b(x, w), as `state` and `meter` of `Model.define`; `parameters` to `inputs` as
        there, and an input holds from one instant to the next.
    diffusion : str, sympy expression, or a list of rows
        B(x, t), one row for each state component, one column for each Wiener process: B B^T is the
        (two-sided) intensity.
    interval : float
        Between two measurements, the first at t = 0.
    instants : list of numbers, optional
        Those of the measurements, instead.  A record's own: `read_measurements(path, model)`.
    stratonovich : bool
        Read the equation in the symmetrised sense; what that adds to the drift is
        `model.between.correction`.
    substeps, accuracy
        As of `Between`.

    Raises
    ------
    FormulaError, ModelError
        As `Model.define`; a diffusion that is no such matrix, noise in the drift, instants that do
        not grow.

    Examples
    --------
    >>> from kfcourse.continuous import sampled
    >>> model = sampled(
    ...     "-a*x", "s*x", "x + w", dict(a=0.5, s=1), instants=[0, 0.3, 1.7], stratonovich=True
    ... )
    >>> model
    Model(dx/dt = -a*x + s**2*x/2 + s*v*x, y = w + x; a = 1/2, s = 1; inputs t (3 values))
    >>> model.between.correction[0]
    s**2*x/2
    """
    inputs = inputs if instants is None else {**(inputs or {}), "t": instants}
    base = Model.define(
        drift,
        meter,
        parameters,
        symbols=symbols,
        prior=prior,
        meter_noise=meter_noise,
        angles=angles,
        inputs=inputs,
        interval=interval,
    )
    expect_sizes(substeps=substeps)
    if not 1e-12 <= accuracy <= 0.1:
        raise ModelError(
            f"the accuracy is a part of a standard deviation, from 1e-12 to 0.1, got {accuracy!r}"
        )
    t, rows = symbol("t"), diffusion_rows(diffusion)
    if t in (*base.values, *base.x):
        raise ModelError("t is the time: give the parameter or component of that name another")
    if base.state_equation.has(*base.v):
        raise ModelError(
            f"the drift {list(base.state_equation)} holds noise: write what multiplies it into "
            f"`diffusion`"
        )
    if len(rows) != base.n:
        raise ModelError(
            f"`diffusion` needs a row for each of {', '.join(map(str, base.x))}: it has {len(rows)}"
        )
    of_step = base.known.names([*base.parameters, *by_name(base.x)])
    names = {s.name: s for s in base.values} | of_step | by_name(base.x)
    B = sp.ImmutableMatrix([[read(formula, names, "diffusion") for formula in row] for row in rows])
    noises = [*numbered("v", B.cols), *(f"v{i + 1}" for i in range(B.cols, B.cols * substeps))]
    if taken := sorted(names.keys() & noises):
        raise ModelError(
            f"{', '.join(taken)}: names of v and a number are those of the noises; give it another"
        )
    v = [symbol(name) for name in noises]
    rates = sp.ImmutableMatrix(base.state_equation + B * sp.Matrix(v[: B.cols]))
    correction = sp.zeros(base.n, 1).as_immutable()
    if stratonovich:
        correction = symmetrised_drift(rates, base.x, v[: B.cols], sp.eye(B.cols))
    between = Between(
        sp.ImmutableMatrix(base.state_equation + correction), B, correction, substeps, accuracy
    )
    known = base.known.used(sp.Matrix([*rates, *base.meter_equation, t]), of_step)
    noise = Gaussian(np.zeros(len(v)), np.eye(len(v)))
    model = replace(
        base,
        state_equation=rates + correction,
        v=tuple(v),
        state_noise=noise,
        known=known,
        between=between,
    )
    model._check()
    for k in range(len(known.inputs.get("t", ()))):
        clock(known, k)
    return model
