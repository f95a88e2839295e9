"""An exercise set for a variant: what a notebook opens, and what questions are asked about."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.checks.engine import check
from kfcourse.checks.question import Question, Result
from kfcourse.checks.registry import sets
from kfcourse.lab.short_names import Structures
from kfcourse.lab.variants import Variant, find_variant, read_variant
from kfcourse.laws import Array
from kfcourse.montecarlo.ensemble import Trajectories, simulate
from kfcourse.symbolic.equations import compile_noiseless
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import Structure


class ExerciseError(ValueError):
    """No such set or question; the message lists those there are."""


def full(matrix: Array, runs: int) -> Array:
    """One matrix for every trajectory, (runs, r, c)."""
    return np.array(np.broadcast_to(matrix, (runs, *matrix.shape[-2:])))


def array_functions(structure: Structure) -> tuple[Callable, Callable]:
    """(measure, predict) of full arrays, as students get them: (m, d) -> h, G, F and (z, p) -> tau, Theta."""

    def measure(m: Array, d: Array) -> tuple[Array, Array, Array]:
        h, G, F, _ = structure.measure(m, d)
        return np.array(np.broadcast_to(h, (len(m), structure.model.p))), full(G, len(m)), full(F, len(m))

    def predict(z: Array, p: Array) -> tuple[Array, Array]:
        tau, Theta = structure.predict(z, p)
        return tau, full(Theta, len(z))

    return measure, predict


@dataclass(frozen=True)
class Exercise:
    """One exercise set for one variant.

    Attributes
    ----------
    letter : str
    variant : Variant
    salt : str
        Changes the hidden arguments, and nothing that a student sees: `kfcourse grade` asks with arguments of its own.
    """

    letter: str
    variant: Variant
    salt: str = ""

    def __post_init__(self) -> None:
        asked = self.letter in sets() and sets()[self.letter].about_variant
        if asked and (self.model.timed or any(self.model.angles)):
            raise ExerciseError(
                f"set {self.letter} asks about a model without time, inputs and angles, and variant {self.variant.name} has "
                f"them: {self.model}; take another variant"
            )

    @property
    def questions(self) -> dict[str, Question]:
        return {question.name: question for question in sets()[self.letter].questions}

    @cached_property
    def numbers(self) -> dict[str, float]:
        """Personal numbers of this set and variant, by name; none for a set that asks about the variant's model only."""
        of_set = sets()[self.letter].numbers
        return {} if of_set is None else of_set(replace(self, salt=""))

    @property
    def model(self) -> Model:
        """The variant's model."""
        return self.variant.model

    @cached_property
    def structures(self) -> Structures:
        """`.linearised` and `.gaussian` structural functions of the model."""
        return Structures(self.model)

    def functions(self, kind: str) -> tuple[Callable, Callable]:
        """Structural functions of arrays: measure(m, d) -> h, G, F and predict(z, p) -> tau, Theta.

        `kind` is "gaussian" or "linearised"; shapes (N, n), (N, n, n), (N, p), (N, p, n), (N, p, p).
        """
        if kind not in ("gaussian", "linearised"):
            raise ExerciseError(f"no structural functions {kind!r}; there are gaussian and linearised")
        return array_functions(getattr(self.structures, kind))

    @cached_property
    def hidden(self) -> Structures:
        """Structural functions of a model like the variant's with other parameters.

        An answer that works for any functions is called with these: where the variant has a 1, a forgotten factor would pass.
        """
        return Structures(self.hidden_model)

    @cached_property
    def hidden_model(self) -> Model:
        factors = self.rng("hidden").uniform(1.1, 1.4, len(self.model.parameters))
        changed = {name: float(value) * f for (name, value), f in zip(self.model.parameters.items(), factors, strict=True)}
        return self.model.replace(**changed)

    @cached_property
    def noiseless(self) -> tuple[Callable, Callable]:
        """The equations with the noises at their means, a(x) and b(x): (N, n) -> (N, n) and (N, p)."""
        return compile_noiseless(self.model)

    @cached_property
    def hidden_noiseless(self) -> tuple[Callable, Callable]:
        """The same of the hidden model."""
        return compile_noiseless(self.hidden_model)

    @property
    def prior_mean(self) -> np.ndarray:
        """Mean of the state at the start, (n,)."""
        return self.model.prior.mean

    def law(self, mean: Sequence[float], variance: float) -> tuple[Any, Any]:
        """A normal law as your formulas take it: mean and covariance of independent components of equal variance.

        Numbers for a scalar variant, matrices for a vector one.
        """
        n = self.model.n
        law = sp.Matrix([sp.Float(m) for m in mean]), sp.Float(variance) * sp.eye(n)
        return (law[0][0], law[1][0]) if n == 1 else law

    def simulate(self, runs: int, steps: int, name: str) -> Trajectories:
        """Trajectories of the variant, x (steps, runs, n) and y (steps, runs, p); the same name gives the same ones."""
        return simulate(self.model, runs, steps, seed=int(self.rng(name).integers(2**31)))

    def rng(self, name: str) -> np.random.Generator:
        """Random numbers that belong to this variant and name: for personal numbers and hidden arguments."""
        return np.random.default_rng(zlib.crc32(f"{self.salt}{self.variant.name}/{name}".encode()))

    def check(self, name: str, answer: Any) -> Result:
        """Check the answer to a question: right, or what kind of mistake it looks like."""
        if name not in self.questions:
            raise ExerciseError(f"set {self.letter} has no question {name!r}; it has {', '.join(self.questions)}")
        return check(self.questions[name], self, answer)


def exercise(letter: str, variant: str | Mapping[str, Any] = "53") -> Exercise:
    """Open an exercise set.

    Parameters
    ----------
    letter : str
        Of the set: "a", "b", ...
    variant : str or dict
        Name of a variant in `kfcourse variants`, or a table with the keys of a file of variants, and `name`.

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
