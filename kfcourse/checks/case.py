"""One result of a wrong answer beside what was expected: what a hint looks at."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import sympy as sp

from kfcourse.checks.dependence import Sensitivity

Agree: TypeAlias = Callable[[Sequence[Any], Sequence[Any]], bool]
Said: TypeAlias = tuple[str, str]


@dataclass(frozen=True)
class Case:
    """One result of a wrong answer.

    found, expected : for every tuple of hidden arguments
    arguments, names : these, and what they are called
    part : its place among the results
    others : the other results expected, by name
    telling : for every tuple of hidden arguments, whether usual mistakes show there
    axes : what the leading axes of the results are
    """

    found: Sequence[Any]
    expected: Sequence[Any]
    agree: Agree
    arguments: Sequence[tuple]
    names: Sequence[str]
    part: int
    others: Sequence[tuple[str, Sequence[Any]]]
    telling: Sequence[bool]
    sensitivity: Sensitivity
    axes: Sequence[str] = ()

    @property
    def numeric(self) -> bool:
        return isinstance(self.expected[0], np.ndarray)

    @property
    def pairs(self) -> list[tuple[Any, Any]]:
        return list(zip(self.found, self.expected, strict=True))

    @property
    def formulas(self) -> list[tuple[list[sp.Expr], list[sp.Expr]]]:
        """Entries of both sides."""
        return [
            (list(a), list(b)) if isinstance(b, sp.MatrixBase) else ([a], [b])
            for a, b in self.pairs
        ]
