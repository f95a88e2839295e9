"""An exercise set for a variant: what a notebook opens, and what questions are asked about."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.checks import structural
from kfcourse.checks.engine import Question, Result, check
from kfcourse.lab import Structures, Variant, find_variant, read_variant
from kfcourse.model import Model


class ExerciseError(ValueError):
    """No such set or question; the message lists those there are."""


@dataclass(frozen=True)
class SetOfQuestions:
    """An exercise set: its letter, the master's file name without .md, its title and its questions."""

    letter: str
    file: str
    title: str
    questions: tuple[Question, ...]


# One line a set; the masters are exercises/<file>.md.
SETS: Mapping[str, SetOfQuestions] = MappingProxyType(
    {s.letter: s for s in (SetOfQuestions("a", "a-structural-functions", "Structural functions", structural.QUESTIONS),)}
)


@dataclass(frozen=True)
class Exercise:
    """One exercise set for one variant.

    Attributes
    ----------
    letter : str
    variant : Variant
    """

    letter: str
    variant: Variant

    @property
    def questions(self) -> dict[str, Question]:
        return {question.name: question for question in SETS[self.letter].questions}

    @property
    def model(self) -> Model:
        """The variant's model."""
        return self.variant.model

    @cached_property
    def structures(self) -> Structures:
        """`.linearised` and `.gaussian` structural functions of the model."""
        return Structures(self.model)

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

    def rng(self, name: str) -> np.random.Generator:
        """Random numbers that belong to this variant and name: for personal numbers and hidden arguments."""
        return np.random.default_rng(zlib.crc32(f"{self.variant.name}/{name}".encode()))

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
        No such set; no such variant.
    """
    if letter not in SETS:
        raise ExerciseError(f"no exercise set {letter!r}; there are {', '.join(SETS)}")
    if isinstance(variant, Mapping):
        table = dict(variant)
        return Exercise(letter, read_variant(str(table.pop("name", "own")), table, "this notebook"))
    return Exercise(letter, find_variant(variant))
