r"""What the letters of a relation stand for: numbers, matrices, values with an index; and how they add and multiply.

A matrix is (n, m), a column (n, 1); products keep their order and shapes must fit, so that a missing transposition is found.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from kfcourse.pages.tex import normal
from kfcourse.pages.verification import Unverified

Value: TypeAlias = Any


class Unread(ValueError):
    """A relation that cannot be computed: a letter without a value, or LaTeX that is not read."""


class Indexed:
    """Values of a letter with an index, in one or several dimensions: `\\Psi_{k+1}`, `P_{ij}`; without one it is `plain`."""

    def __init__(self, values: Any, plain: Any = None) -> None:
        self.values, self.plain = values, plain

    def __getitem__(self, index: tuple[Any, ...]) -> Value:
        if callable(self.values):
            return self.values(*index)
        found: Any = self.values
        for one in index:
            if not 0 <= one < len(found):
                raise Unread(f"index {one} of {len(found)} values")
            found = found[one]
        return found


class Of:
    """What depends on letters that an integral or a sum changes: `Of(density, "x_k", "x_{k-1}")`."""

    def __init__(self, function: Callable[..., Any], *letters: str) -> None:
        self.function, self.letters = function, [normal(one) for one in letters]


class Operator:
    """What acts on all that is multiplied after it, powers and brackets: `\\mathsf M(x-z)^2` is the mean of a square."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        self.function = function


def whole(value: Value) -> int:
    if isinstance(value, str) or float(value) != int(value):
        raise Unread(f"{value} is no index")
    return int(value)


def number_of(value: Value) -> Value:
    value = np.asarray(value, float)
    if value.ndim == 2 and value.size > 1:
        raise Unverified("a matrix cannot divide")
    return value.item() if value.size == 1 else value


def _is_matrix(value: Value) -> bool:
    return np.ndim(value) == 2 and np.size(value) > 1


def added(one: Value, other: Value) -> Value:
    if (_is_matrix(one) or _is_matrix(other)) and np.shape(one) != np.shape(other):
        raise Unverified(f"a matrix {np.shape(one)} and one of {np.shape(other)} are added")
    return one + other


def multiplied(one: Value, other: Value) -> Value:
    if np.ndim(one) == np.ndim(other) == 2 and np.shape(one)[1] == np.shape(other)[0]:
        return one @ other
    if _is_matrix(one) and _is_matrix(other):
        raise Unverified(f"a matrix {np.shape(one)} is multiplied by one of {np.shape(other)}")
    return (one.item() if np.shape(one) == (1, 1) else one) * (other.item() if np.shape(other) == (1, 1) else other)


def transposed(value: Value) -> Value:
    return value.T if np.ndim(value) == 2 else value


def inverse(value: Value) -> Value:
    return np.linalg.inv(value) if np.ndim(value) == 2 else 1 / value


def root(value: Value) -> Value:
    return np.linalg.cholesky(value) if _is_matrix(value) else np.sqrt(value)


def raised(value: Value, power: Value) -> Value:
    if _is_matrix(value):
        return np.linalg.matrix_power(value, whole(power))
    return value**power


def filled(rows: list[list[Value]]) -> list[list[Value]]:
    """Zeros and ones of a block matrix take the shapes of their neighbours."""
    heights = [max(entry.shape[0] for entry in row) for row in rows]
    widths = [max(row[j].shape[1] for row in rows) for j in range(len(rows[0]))]
    return [
        [
            np.zeros((high, wide)) if entry.size == 1 and not entry.any() else entry
            for entry, wide in zip(row, widths, strict=True)
        ]
        for row, high in zip(rows, heights, strict=True)
    ]


def bell(x: Value, mean: Value, variance: Value) -> Value:
    """The normal density; of a column and a covariance matrix, too."""
    if _is_matrix(variance):
        off = x - mean
        return float(np.exp(-(off.T @ np.linalg.solve(variance, off)).item() / 2) / np.sqrt(np.linalg.det(2 * np.pi * variance)))
    x, mean, variance = (np.squeeze(one) for one in (x, mean, variance))
    return np.exp(-((x - mean) ** 2) / (2 * variance)) / np.sqrt(2 * np.pi * variance)
