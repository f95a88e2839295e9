"""An exercise set for a variant: what a notebook opens, and what questions are asked about."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.engine import check
from kfcourse.exercises.checks.question import Attempts, Question, Result
from kfcourse.exercises.checks.reference import Posed
from kfcourse.exercises.checks.registry import sets
from kfcourse.exercises.checks.steps import (
    array_functions,
    noiseless_functions,
    places,
    telling_steps,
)
from kfcourse.lab.short_names import Structures
from kfcourse.lab.variants import Variant, find_variant, read_variant
from kfcourse.montecarlo.ensemble import Trajectories, simulate
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import NoClosedForm
from kfcourse.symbolic.quadrature import gauss_hermite
from kfcourse.symbolic.structure import Structure, gaussian

if TYPE_CHECKING:
    from kfcourse.exercises.derivations.worked import Worked

STEPS = 21  # that the sets simulate at most
COURSE = "53"  # the variant that the course itself works through
NODES = {1: 100, 2: 16}  # on an axis, for so many states


class ExerciseError(ValueError):
    """No such set or question; the message lists those there are."""


class Given(Structures):
    """The same for a normal law without a closed form too: by quadrature."""

    @cached_property
    def gaussian(self) -> Structure:
        try:
            return gaussian(self.model)
        except NoClosedForm:
            return gauss_hermite(self.model, NODES.get(self.model.n, 5))


@dataclass(frozen=True)
class Exercise:
    """One exercise set for one variant.

    Attributes
    ----------
    letter : str
    variant : Variant
    salt : str
        Changes the hidden arguments, and nothing that a student sees: `kfcourse grade` asks with
        arguments of its own.
    """

    letter: str
    variant: Variant
    salt: str = ""

    def __post_init__(self) -> None:
        # whatever the set: each check asks the model for its letters
        self.variant.plain("the exercises")
        if self.letter not in sets() or not sets()[self.letter].about_variant:
            return
        for which, where in (("y", "measurement"), ("x", "state")):
            if getattr(self.model.angles, which) and which not in sets()[self.letter].angles:
                raise ExerciseError(
                    f"set {self.letter} asks about a model without angles in the {where} "
                    f"(differences would have to go the short "
                    f"way round), and variant {self.variant.name} has them: {self.model}; take "
                    f"another variant"
                )
        if (known := self.model.known).steps < STEPS:
            raise ExerciseError(
                f"set {self.letter} simulates {STEPS} steps, and an input of variant "
                f"{self.variant.name} ends after "
                f"{known.steps}: {self.model}; give it a value for every step"
            )

    @property
    def questions(self) -> dict[str, Question]:
        return {question.name: question for question in sets()[self.letter].questions}

    @cached_property
    def numbers(self) -> dict[str, float]:
        """Personal numbers of this set and variant, by name; none for a set that asks about the
        variant's model only."""
        of_set = sets()[self.letter].numbers
        return {} if of_set is None else of_set(replace(self, salt=""))

    @property
    def model(self) -> Model:
        """The variant's model."""
        return self.variant.plain("the exercises")

    def closed(self, kind: str) -> Structure:
        """Structural functions with formulas, "linearised" or "gaussian"; ExerciseError if they
        have no closed form."""
        try:
            return getattr(Structures(self.model), kind)
        except NoClosedForm as error:
            raise ExerciseError(
                f"set {self.letter} asks for formulas of the structural functions, and those of "
                f"variant {self.variant.name} have "
                f"no closed form ({error}); take another variant for this set"
            ) from None

    @cached_property
    def derivation(self) -> Worked:
        """A right derivation of a structural function of the model; of the course's model, where
        none of this one is checked."""
        # which a notebook that is graded does not find
        from kfcourse.exercises.derivations.worked import right_derivation

        course = find_variant(COURSE).plain("the exercises")
        derivation = right_derivation(self.model) or right_derivation(course)
        assert derivation is not None  # the course's own can be checked
        return derivation

    @cached_property
    def given(self) -> Structures:
        """Structural functions of the model that are given, not asked for: by quadrature where
        there is no closed form."""
        return Given(self.model)

    @property
    def by_quadrature(self) -> bool:
        """Whether those of a normal law have no closed form."""
        return self.given.gaussian.formulas is None

    def functions(self, kind: str, k: int | None = None) -> tuple[Callable, Callable]:
        """Structural functions of arrays: measure(m, d) -> h, G, F and predict(z, p) -> tau, Theta.

        `kind` is "gaussian" or "linearised"; shapes (N, n), (N, n, n), (N, p), (N, p, n), (N, p,
        p).  Where the model depends on the step, they are those of step k; without k they take it,
        `measure(m, d, k)`.
        """
        if kind not in ("gaussian", "linearised"):
            raise ExerciseError(
                f"no structural functions {kind!r}; there are gaussian and linearised"
            )
        structure: Structure = getattr(self.given, kind)
        return array_functions(structure if k is None else structure.at(k))

    @cached_property
    def hidden(self) -> Structures:
        """Structural functions of a model like the variant's with other parameters.

        An answer that works for any functions is called with these: where the variant has a 1, a
        forgotten factor would pass.
        """
        return Given(self.hidden_model)

    @cached_property
    def hidden_steps(self) -> list[int]:
        """Steps that take the place of 0, 1, 2... in hidden functions: where an input rests, a
        wrong one would pass."""
        return telling_steps(self.hidden_model) if self.model.timed else []

    def hidden_functions(self) -> tuple[Callable, Callable]:
        """Hidden measure and predict of arrays, which take the step where the model depends on
        it."""
        return array_functions(self.hidden.gaussian, self.hidden_steps)

    @cached_property
    def places(self) -> list[Mapping[sp.Symbol, sp.Expr]]:
        """Steps at which formulas are compared, if the model has a switch."""
        return places(self.model)

    def known(self, k: int) -> dict[sp.Symbol, float]:
        """Values of k, t and the inputs at step k, for `subs`; empty where the model depends on
        none of them."""
        return dict(zip(self.model.known.symbols, self.model.known.at(k).tolist(), strict=True))

    @cached_property
    def hidden_model(self) -> Model:
        factors = self.rng("hidden").uniform(1.1, 1.4, len(self.model.parameters))
        changed = {
            name: float(value) * f
            for (name, value), f in zip(self.model.parameters.items(), factors, strict=True)
        }
        return self.model.replace(**changed)

    @cached_property
    def noiseless(self) -> tuple[Callable, Callable]:
        """The equations with the noises at their means, a(x) and b(x): (N, n) -> (N, n) and (N, p).

        Where the model depends on the step they take it, `a(x, k)`.
        """
        return noiseless_functions(self.model)

    @cached_property
    def hidden_noiseless(self) -> tuple[Callable, Callable]:
        """The same of the hidden model."""
        return noiseless_functions(self.hidden_model, self.hidden_steps)

    @property
    def prior_mean(self) -> np.ndarray:
        """Mean of the state at the start, (n,)."""
        return self.model.prior.mean

    def law(self, mean: Sequence[float], variance: float) -> tuple[Any, Any]:
        """A normal law as your formulas take it: mean and covariance of independent components of
        equal variance.

        Numbers for a scalar variant, matrices for a vector one.
        """
        n = self.model.n
        law = sp.Matrix([sp.Float(m) for m in mean]), sp.Float(variance) * sp.eye(n)
        return (law[0][0], law[1][0]) if n == 1 else law

    def simulate(self, runs: int, steps: int, name: str) -> Trajectories:
        """Trajectories of the variant, x (steps, runs, n) and y (steps, runs, p); the same name
        gives the same ones."""
        return simulate(self.model, runs, steps, seed=int(self.rng(name).integers(2**31)))

    def rng(self, name: str) -> np.random.Generator:
        """Random numbers that belong to this variant and name: for personal numbers and hidden
        arguments."""
        return np.random.default_rng(zlib.crc32(f"{self.salt}{self.variant.name}/{name}".encode()))

    @cached_property
    def posed(self) -> dict[Question, Posed]:
        """Questions that an answer was handed in to."""
        return {}

    @cached_property
    def past(self) -> Attempts:
        """What was handed in so far: the same wrong answer again gets a stronger hint, a later one
        may stand on it."""
        return Attempts()

    def check(self, name: str, answer: Any) -> Result:
        """Check the answer to a question: right, or what kind of mistake it looks like."""
        if name not in self.questions:
            raise ExerciseError(
                f"set {self.letter} has no question {name!r}; it has {', '.join(self.questions)}"
            )
        return check(self.questions[name], self, answer, past=self.past)


def exercise(letter: str, variant: str | Mapping[str, Any] = "53") -> Exercise:
    """Open an exercise set.

    Parameters
    ----------
    letter : str
        Of the set: "a", "b", ...
    variant : str or dict
        Name of a variant in `kfcourse variants`, or a table with the keys of a file of variants,
        and `name`.

    Raises
    ------
    ExerciseError, VariantError
        No such set, or its questions cannot be asked about the variant; no such variant.
    """
    if letter not in sets():
        raise ExerciseError(f"no exercise set {letter!r}; there are {', '.join(sets())}")
    if isinstance(variant, Mapping):
        table = dict(variant)
        return Exercise(letter, read_variant(str(table.pop("name", "own")), table, "this notebook"))
    return Exercise(letter, find_variant(variant))
