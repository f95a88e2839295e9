r"""Structural functions: the seam between a model and every filter of the course.

The first two conditional moments as functions of a Gaussian's mean and covariance,

    tau(z, p), Theta(z, p)     mean and covariance of x_{k+1} when x_k ~ N(z, p)
    h(m, d), G(m, d), F(m, d)  mean of y_k, its sensitivity dh/dm, its covariance when x_k ~ N(m, d)

and, for who looks back, the sensitivity A = dtau/dz.  By Stein's lemma Cov(x, y) = d G^T and
Cov(x_k, x_{k+1}) = p A^T.

`linearised` and `gaussian` derive them symbolically from the model; `unscented` and `gauss_hermite`
compute them numerically, for models without a closed form.  All four give a `Structure`, and one
predict/correct step serves them all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from itertools import product as cartesian
from typing import Any, NoReturn

import sympy as sp

from kfcourse.angles import on_circle
from kfcourse.errors import ModelError, NoClosedForm, expect
from kfcourse.laws import (
    Gaussian,
    Matrices,
    Measurement,
    Transition,
    Vectors,
    measurement_of,
    product,
    symmetric,
    transpose,
)
from kfcourse.symbolic.codegen import Compiled
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.sides import Side, moments, plain, taylor
from kfcourse.symbolic.typesetting import aligned
from kfcourse.symbolic.writing import formula_lines

FUNCTION_LATEX = {"tau": r"\tau", "Theta": r"\Theta", "h": "h", "G": "G", "F": "F"}
# of what moves in continuous time: tau and Theta are these, integrated
FUNCTION_LATEX |= {"tau_dot": r"\dot\tau", "A": "A", "Theta_dot": r"\dot\Theta", "p_dot": r"\dot p"}


def _at_no_step(mean: Vectors, cov: Matrices) -> NoReturn:
    raise ModelError(
        "the model depends on the step: say which, as in structure.at(k).predict(z, p)"
    )


@dataclass(frozen=True)
class Structure:
    """The structural functions of a model, as functions of arrays and (if derived) as formulas.

    Attributes
    ----------
    name : str
        "linearised", "gaussian", "unscented" or "gauss-hermite".
    model : Model
    predict : callable
        (z (..., n), p (..., n, n)) -> Gaussian(tau, Theta).
    measure : callable
        (m (..., n), d (..., n, n)) -> Measurement(h (..., p), G (..., p, n), F (..., p, p), R).
    transition : callable
        (z (..., n), p (..., n, n)) -> Transition(A (..., n, n), Q): what a smoother needs of the
        object.
    formulas : StructuralFormulas or None
        The symbolic functions; None for the numerical structures.
    at_step : callable, optional
        Step to the structure of that step, if the model depends on it; see `at`.

    Covariances, G and h that do not depend on the trajectory may come without the leading axes.
    """

    name: str
    model: Model
    predict: Callable[[Vectors, Matrices], Gaussian] = _at_no_step
    measure: Callable[[Vectors, Matrices], Measurement] = _at_no_step
    transition: Callable[[Vectors, Matrices], Transition] = _at_no_step
    formulas: StructuralFormulas | None = None
    at_step: Callable[[int], Structure] | None = None

    def at(self, k: int) -> Structure:
        """The structural functions of step k: tau and Theta from k to k + 1; h, G, F of y_k.

        Those of a model that does not depend on the step are the same at every step; those of one
        that does cannot be called without it.
        """
        return self if self.at_step is None else self.at_step(k)

    def __getitem__(self, function: str) -> sp.Expr | sp.MatrixBase:
        """The formula of "tau", "Theta", "h", "G", "F", "R", "A" or "Q": an expression if scalar,
        else a matrix."""
        formulas = self._derived()
        try:
            matrix = formulas.functions.get(function) or getattr(formulas, function)
        except (AttributeError, KeyError):
            raise NoClosedForm(
                f"there is no formula of {function!r}; derived are {', '.join(formulas.functions)}"
            ) from None
        return plain(matrix)

    def latex(self) -> str:
        """The five functions as a LaTeX `aligned` block, parameters as symbols; matrices entry by
        entry."""
        formulas = self._derived()
        lines = []
        for name, matrix in formulas.functions.items():
            arguments = formulas.arguments(name)
            names = "m, d" if name in "hGF" else "z, p"
            if self.model.n == 1:
                names = ", ".join(map(sp.latex, arguments))
            if self.model.between is None:
                names += ", k" if self.model.timed else ""
            elif matrix.has(*self.model.known.symbols):
                names += ", t"
            for i, j in cartesian(range(matrix.rows), range(matrix.cols)):
                if name not in ("A", "G") and i > j and matrix.cols > 1:
                    continue  # symmetric
                entry = f"{i + 1}" if matrix.cols == 1 else f"{i + 1}{j + 1}"
                index = "" if len(matrix) == 1 else f"_{{{entry}}}"
                value = f"{FUNCTION_LATEX[name]}{index}({names})"
                first, *further = formula_lines(matrix[i, j], arguments, value)
                lines += [f"{value} &= {first}", *(rf"&\quad {line}" for line in further)]
        return aligned(lines)

    def _derived(self) -> StructuralFormulas:
        if self.formulas is None:
            raise NoClosedForm(
                f"the {self.name} structure is computed by quadrature and has no formulas; see "
                f"linearised(model), gaussian(model)"
            )
        return self.formulas


@dataclass(frozen=True)
class StructuralFormulas:
    """Symbolic structural functions with parameters as symbols.

    Attributes
    ----------
    model : Model
    z, p, m, d : sympy.Matrix
        Arguments: mean and covariance before the state equation, and before the meter equation.
    functions : dict
        "tau", "Theta", "h", "G", "F" to matrices of expressions.
    """

    model: Model
    name: str
    z: sp.ImmutableMatrix
    p: sp.ImmutableMatrix
    m: sp.ImmutableMatrix
    d: sp.ImmutableMatrix
    functions: dict[str, sp.ImmutableMatrix]
    unexplained: tuple[sp.ImmutableMatrix, ...]  # Q and R, not multiplied out

    def arguments(self, function: str) -> list[sp.Symbol]:
        """z and p, or m and d, of a function."""
        mean, cov = (self.m, self.d) if function in "hGF" else (self.z, self.p)
        return list(dict.fromkeys([*mean, *cov]))

    @cached_property
    def R(self) -> sp.ImmutableMatrix:
        """F - G d G^T, the part of the measurement's covariance that the state does not explain."""
        return _expanded(self.unexplained[1])

    @cached_property
    def A(self) -> sp.ImmutableMatrix:
        """dtau/dz, the twin of G = dh/dm: Cov(x_k, x_{k+1}) = p A^T."""
        return self.functions["tau"].jacobian(self.z)

    @cached_property
    def Q(self) -> sp.ImmutableMatrix:
        """Theta - A p A^T, the part of the next state's covariance that this state does not
        explain."""
        return _expanded(self.unexplained[0])

    @cached_property  # compiled where it is asked for
    def compiled_transition(self) -> Compiled:
        return self.model.compiled([list(self.z), self.p], [self.A, self.Q])

    def structure(self) -> Structure:
        """The structure; of a model that depends on the step, one that must be told which."""
        tau, Theta, h, G = (self.functions[name] for name in ("tau", "Theta", "h", "G"))
        predict = self.model.compiled([list(self.z), self.p], [list(tau), Theta])
        # F is the sum of the last two
        outputs = [list(h), G, self.R, G * self.d * G.T]
        measure = self.model.compiled([list(self.m), self.d], outputs)
        angles, measurement = self.model.angles, measurement_of(self.model.angles.y)

        def at(k: int | None) -> Structure:
            def predicted(z: Vectors, p: Matrices) -> Gaussian:
                tau, Theta = predict(z, p, k=k)
                return Gaussian(on_circle(tau, angles.x), Theta)

            def measured(m: Vectors, d: Matrices) -> Measurement:
                h, G, R, explained = measure(m, d, k=k)
                return measurement(h, G, explained + R, R)

            def transition(z: Vectors, p: Matrices) -> Transition:
                return Transition(*self.compiled_transition(z, p, k=k))

            return Structure(self.name, self.model, predicted, measured, transition, self)

        return of_steps(self.name, self.model, at, self)


def regressed(
    name: str,
    model: Model,
    state: Callable[[Vectors, Matrices], tuple[Any, Any, Any]],
    meter: Callable[[Vectors, Matrices], tuple[Any, Any, Any]],
) -> Structure:
    """The structure of regressions: tau, A, Q of the object at N(z, p), h, G, R of the meter at
    N(m, d)."""

    def predict(z: Vectors, p: Matrices) -> Gaussian:
        tau, A, Q = state(z, p)
        return Gaussian(tau, form(A, p) + Q)

    def measure(m: Vectors, d: Matrices) -> Measurement:
        h, G, R = meter(m, d)
        return measurement_of(model.angles.y)(h, G, form(G, d) + R, R)

    def transition(z: Vectors, p: Matrices) -> Transition:
        return Transition(*state(z, p)[1:])

    return Structure(name, model, predict, measure, transition)


def form(matrix: Matrices, cov: Matrices) -> Matrices:
    """M P M^T."""
    return symmetric(product(product(matrix, cov), transpose(matrix)))


def of_steps(
    name: str,
    model: Model,
    at: Callable[[Any], Structure],
    formulas: StructuralFormulas | None = None,
) -> Structure:
    """The structure at every step; of a model that depends on the step the structure whose
    `Structure.at` makes those of each step."""
    return Structure(name, model, formulas=formulas, at_step=at) if model.timed else at(None)


def linearised(model: Model) -> Structure:
    """Structural functions of the model linearised at the mean (the extended Kalman filter's).

    tau = a(z, m_v),  Theta = a_x p a_x^T + a_v D_v a_v^T,
    h = b(m, m_w),  G = b_x,  F = b_x d b_x^T + b_w D_w b_w^T,   derivatives at (z, m_v) and (m,
    m_w)

    Raises
    ------
    NoClosedForm
        If an equation is not differentiable.
    """
    # e^(a+b) stays one: a height of 6500 km over a scale of 13 km has an e^a beyond all numbers.
    return _derived(model, linearised, taylor, power_exp=False)


def gaussian(model: Model) -> Structure:
    """Structural functions as exact moments over x ~ N (the normal, or Gaussian, filters').

    tau = M[a(x, v)],  Theta = Cov(a(x, v)),  h = M[b(x, w)],  G = dh/dm,  F = Cov(b(x, w))

    Raises
    ------
    NoClosedForm
        If a term has no closed-form Gaussian mean: use `unscented` or `gauss_hermite`.
    """
    return _derived(model, gaussian, moments)


def _derived(
    model: Model,
    build: Callable[[Model], Structure],
    moments_of: Callable[[Side], tuple[sp.ImmutableMatrix, ...]],
    **hints: bool,
) -> Structure:
    """The structure from mean, slope and covariance of both sides, multiplied out."""
    name = build.__name__
    expect(model, Model, name)
    if model.between is not None:
        return model.between.structure(model, build)
    state, meter = Side.of(model, "object"), Side.of(model, "meter")
    (tau, _, Theta, Q), (h, G, F, R) = moments_of(state), moments_of(meter)
    functions = {"tau": tau, "Theta": Theta, "h": h, "G": G, "F": F}
    expanded = {key: _expanded(part, **hints) for key, part in functions.items()}
    return StructuralFormulas(
        model, name, state.mean, state.cov, meter.mean, meter.cov, expanded, (Q, R)
    ).structure()


@lru_cache(maxsize=256)  # modes often have the same object, or the same meter, with other numbers
def _expanded(matrix: sp.ImmutableMatrix, **hints: bool) -> sp.ImmutableMatrix:
    return matrix.applyfunc(partial(sp.expand, **hints))


def expect_each(structures: Sequence[Structure], what: str) -> None:
    """TypeError unless these are structural functions, a list of them."""
    if isinstance(structures, Structure) or not structures:
        raise TypeError(
            f"{what} expects a list of structures, one a mode, such as [linearised(mode) for mode "
            "in model.modes]"
        )
    for structure in structures:
        expect(structure, Structure, what)
