r"""A model that jumps: several ways to move and to measure, its modes, of which one is in force at
each step.

    x_{k+1} = a^{i_{k+1}}(x_k, v_k)        y_k = b^{i_k}(x_k, w_k)
    P(i_{k+1} = j | i_k = i, x_k = x) = pi_ij(k) or pi_ij(x, k),    P(i_0 = j) = q_j

Nobody sees the mode i_k.  (Systems with random structure, системы со случайной структурой; jump
Markov systems.)  A mode is an ordinary `Model`, so that its structural functions, densities and
code are derived as any model's are.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.angles import Angles
from kfcourse.laws import Array, Gaussian
from kfcourse.symbolic.codegen import Compiled
from kfcourse.symbolic.formula import FormulaError
from kfcourse.symbolic.known import Known
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import (
    Formulas,
    ModelError,
    by_name,
    exact_number,
    numbers,
    read,
    shown,
    table,
)

# in which modes may differ
OF_A_MODE = ("state", "meter", "parameters", "state_noise", "meter_noise")
SUM = 1e-9  # a row of probabilities written with ten digits sums to 1 within this


@dataclass(frozen=True)
class JumpModel:
    """A model with modes; build it with `JumpModel.define`.

    Attributes
    ----------
    names : tuple of J str
    modes : tuple of J Model
        Of one state, measurement and prior, with noises of the same names.
    first : ndarray (J,)
        q, law of the first mode.
    chain : sympy.Matrix
        pi, J x J, as formulas.
    known : Known
        What the chain knows of every step.
    """

    names: tuple[str, ...]
    modes: tuple[Model, ...]
    first: Array = field(repr=False, compare=False)
    chain: sp.ImmutableMatrix = field(repr=False)
    known: Known = field(repr=False, compare=False)

    @classmethod
    def define(
        cls,
        state: Formulas,
        meter: Formulas,
        parameters: Mapping[str, float] | None = None,
        *,
        modes: Mapping[str, Mapping[str, Any]],
        transition: Sequence[Any],
        first: Sequence[float] | None = None,
        **options: Any,
    ) -> JumpModel:
        """Build a model with modes from formulas.

        Parameters
        ----------
        state, meter, parameters, options
            As of `Model.define`: what holds in every mode.
        modes : dict
            Name of a mode to what differs there: `state`, `meter`, `parameters`, `state_noise`,
            `meter_noise`.
        transition : matrix, or list
            pi, the rows of which sum to 1: numbers, or formulas of the state x_k, the step's number
            k, its time t, inputs and parameters.
            A single row: at each step the mode is drawn anew with these probabilities.
        first : list, optional
            q, law of the mode of the first measurement.  By default a single row's own.

        Raises
        ------
        FormulaError, ModelError
            A mode is no model, modes do not fit together, or numbers are no probabilities.

        Examples
        --------
        >>> from kfcourse import JumpModel
        >>> JumpModel.define("0.9*x + v", "x + C*w", modes={"sound": {"parameters": {"C": 1}},
        ...                  "faulty": {"parameters": {"C": 10}}}, transition=[0.8, 0.2])
        JumpModel(names=('sound', 'faulty'), modes=(Model(x' = v + 9*x/10, y = C*w + x; C = 1),
        Model(x' = v + 9*x/10, y = C*w + x; C = 10)))
        """
        shared = {"state": state, "meter": meter, **options}
        common, changed = table("parameters", parameters), set[str]()
        built: dict[str, Model] = {}
        for name, change in table("modes", modes).items():
            try:
                own = table(f"modes.{name}", change, OF_A_MODE)
                values = table("parameters", own.get("parameters"))
                given = shared | own | {"parameters": common | values}
                built[str(name)] = Model.define(**given)
            except (ModelError, FormulaError) as error:
                raise ModelError(f"mode {name}: {error}") from None
            changed |= set(values)
        forms = {(mode.x, mode.angles, mode.p, len(mode.v), len(mode.w)) for mode in built.values()}
        if len(forms) != 1:
            raise ModelError(
                "`modes` holds a mode at least, such as {sound = {}, faulty = {...}}, and all have "
                "the same state, angles, measurement components and noises, named by `symbols` "
                f'such as v = ["v1", "v2"]; got {shown([*built])}'
            )
        size, rows = len(built), np.atleast_2d(np.array(transition, dtype=object))
        if rows.shape not in ((1, size), (size, size)) or any(map(np.ndim, rows.flat)):
            raise ModelError(
                f"`transition` must be {size} rows of {size} probabilities for {size} mode(s), or "
                f"one row, got {shown(transition)}"
            )
        names, fitting = zip(*built.items(), strict=True)
        chain, known = _chain(np.broadcast_to(rows, (size, size)), fitting[0], changed)
        model = cls(names, fitting, np.empty(0), chain, known)
        if not model.by_state:
            # a row that is none is refused here; of later steps and of states, where they are
            # reached
            at_start = model.transition_at(0)
            first = at_start[0] if len(rows) == 1 and first is None else first
        return replace(model, first=probabilities("`first`", first, (size,)))

    @property
    def n(self) -> int:
        """Number of state components."""
        return self.modes[0].n

    @property
    def p(self) -> int:
        """Number of measurement components."""
        return self.modes[0].p

    @property
    def x(self) -> tuple[sp.Symbol, ...]:
        """State components."""
        return self.modes[0].x

    @property
    def prior(self) -> Gaussian:
        """Law of x_0, the same in all modes."""
        return self.modes[0].prior

    @property
    def angles(self) -> Angles:
        """Components that are angles."""
        return self.modes[0].angles

    @property
    def steps(self) -> float:
        """For how many steps the modes' inputs have values."""
        return min(self.known.steps, *(mode.known.steps for mode in self.modes))

    @cached_property
    def by_state(self) -> bool:
        """Whether the probabilities of transitions depend on the state."""
        return self.chain.has(*self.x)

    @cached_property
    def _rows(self) -> Compiled:
        """The chain as a function of the state and the step."""
        return replace(self.modes[0], known=self.known).compiled([self.x], [self.chain])

    def without_state(self, what: str) -> None:
        """ModelError, which names what needs them, if the modes' probabilities before any
        measurement are not known."""
        if self.by_state:
            raise ModelError(
                f"{what}: with transitions that depend on the state nobody knows the "
                f"probabilities of the modes before anything "
                "is measured; take filters that carry them: aof-jump-gaussian, "
                "aof-jump-linearised, imm, gpb2"
            )

    def transition_of(self, x: Array, k: int) -> Array:
        """pi at step k and states x (..., n), (..., J, J)."""
        with np.errstate(all="ignore"):
            rows = self._rows(x, k=k)[0]
        finite = rows[np.isfinite(x).all(axis=-1)] if self.by_state else rows
        probabilities(f"`transition` at step {k}", finite, finite.shape)
        rows = rows / rows.sum(axis=-1, keepdims=True)
        return np.broadcast_to(rows, (*x.shape[:-1], *self.chain.shape))

    def transition_at(self, k: int) -> Array:
        """pi at step k, (J, J): from the mode of y_k to that of y_{k+1}; ModelError if it depends
        on the state."""
        self.without_state("a matrix of transitions for all states")
        return self.transition_of(np.zeros(self.n), k)

    def law_at(self, k: int) -> Array:
        """q_k, (J,): the probabilities of the modes of y_k before anything is measured; ModelError
        if they are not known."""
        self.without_state("the law of the modes")
        if not self.known.symbols:
            return self.first @ np.linalg.matrix_power(self.transition_at(0), k)
        return reduce(lambda law, step: law @ self.transition_at(step), range(k), self.first)


def _chain(rows: Array, model: Model, changed: Collection[str]) -> tuple[sp.ImmutableMatrix, Known]:
    """The chain as formulas, and what it knows of every step."""
    of_step = model.known.names([*model.parameters, *changed, *by_name(model.x, model.v, model.w)])
    # what differs between the modes is not known
    shared = [s for s in model.values if s.name not in changed]
    names = of_step | by_name(model.x, shared)
    entries = [
        read(p, names, "transition")
        if isinstance(p, str | sp.Expr)
        else exact_number("an entry of `transition`", p)
        for p in rows.flat
    ]
    matrix = sp.ImmutableMatrix(*rows.shape, entries)
    return matrix, model.known.used(matrix, of_step)


def probabilities(what: str, given: Any, shape: tuple[int, ...]) -> Array:
    """Probabilities (..., J) whose rows sum to 1; ModelError if they are none, or of another
    shape."""
    rows = numbers(given)
    if rows.shape != shape:
        raise ModelError(
            f"{what} must be probabilities of the shape {shape}, for {shape[-1]} mode(s); got "
            f"{shown(given)}"
        )
    wrong = ~((rows >= 0).all(axis=-1) & (np.abs(rows.sum(axis=-1) - 1) <= SUM))
    if wrong.any():
        raise ModelError(
            f"{what}: {rows[wrong][0].tolist()} are no probabilities, at least 0 and together 1"
        )
    return rows / rows.sum(axis=-1, keepdims=True)
