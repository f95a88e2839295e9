"""What the letters of a relation stand for, and how values add and multiply.

A matrix is (n, m), a column (n, 1); products keep their order and shapes must fit, so that a
missing transposition is found.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from kfcourse.pages import Unverified

Value: TypeAlias = Any


class Unread(ValueError):
    """A relation that cannot be computed: a letter without a value, or LaTeX that is not read."""


class Indexed:
    r"""Values of a letter with indices, `\Psi_{k+1}`, `P_{ij}`; without one it is `plain`."""

    def __init__(self, values: Any, plain: Any = None) -> None:
        self.values, self.plain = values, plain

    def __getitem__(self, index: tuple[Any, ...]) -> Value:
        if callable(self.values):
            return self.values(*index)
        entry: Any = self.values
        for place in index:
            if place not in (entry if isinstance(entry, dict) else range(len(entry))):
                raise Unread(f"index {place} of {len(entry)} values")
            entry = entry[place]
        return entry


class At(NamedTuple):
    """A function of what follows in brackets, and its value where none follow: f(x), f."""

    function: Callable[..., Any]
    plain: Value


class Of:
    """What depends on letters that an index or an integral moves:
    `Of(density, "x_k", "x_{k-1}")`."""

    def __init__(self, function: Callable[..., Any], *letters: str) -> None:
        self.function, self.letters = function, letters


class Operator(NamedTuple):
    r"""What acts on the whole product after it: `\mathsf M(x-z)^2` is the mean of a square."""

    function: Callable[[Any], Any]


def whole(value: Value) -> int:
    """The value as an index."""
    if isinstance(value, str) or float(value) != int(value):
        raise Unread(f"{value} is no index")
    return int(value)


def is_matrix(value: Value) -> bool:
    return np.ndim(value) == 2 and np.size(value) > 1


def _number(value: Value) -> Value:
    return value.item() if np.shape(value) == (1, 1) else value


def added(left: Value, right: Value) -> Value:
    if (is_matrix(left) or is_matrix(right)) and np.shape(left) != np.shape(right):
        raise Unverified(f"a matrix {np.shape(left)} and one of {np.shape(right)} are added")
    return left + right


def multiplied(left: Value, right: Value) -> Value:
    if np.ndim(left) == np.ndim(right) == 2 and np.shape(left)[1] == np.shape(right)[0]:
        return left @ right
    if is_matrix(left) and is_matrix(right):
        raise Unverified(f"a matrix {np.shape(left)} times one of {np.shape(right)}")
    return _number(left) * _number(right)


def divided(left: Value, right: Value) -> Value:
    if is_matrix(right):
        raise Unverified("a matrix cannot divide")
    return left / (np.asarray(right).item() if np.size(right) == 1 else right)


def inverse(value: Value) -> Value:
    return np.linalg.inv(value) if np.ndim(value) == 2 else 1 / value


def transposed(value: Value) -> Value:
    return value.T if np.ndim(value) == 2 else value


def root(value: Value) -> Value:
    return np.linalg.cholesky(value) if is_matrix(value) else np.sqrt(value)


def raised(value: Value, power: Value) -> Value:
    if is_matrix(value):
        return np.linalg.matrix_power(value, whole(power))
    return np.multiply(value, 1.0) ** power  # a root of a negative number is NaN


def block(rows: list[list[Value]]) -> np.ndarray:
    """A block matrix, whose zeros take the shapes of their neighbours."""
    entries = [[np.atleast_2d(entry) for entry in row] for row in rows]
    heights = [max(entry.shape[0] for entry in row) for row in entries]
    widths = [max(row[j].shape[1] for row in entries) for j in range(len(entries[0]))]
    for row, height in zip(entries, heights, strict=True):
        for j, (entry, width) in enumerate(zip(row, widths, strict=True)):
            if entry.size == 1 and not entry.any():
                row[j] = np.zeros((height, width))
    return np.block(entries)


def bell(x: Value, mean: Value, variance: Value) -> Value:
    """The normal density; of a column and a covariance matrix, too."""
    if is_matrix(variance):
        off = x - mean
        size = (off.T @ np.linalg.solve(variance, off)).item()
        return float(np.exp(-size / 2) / np.sqrt(np.linalg.det(2 * np.pi * variance)))
    x, mean, variance = (np.squeeze(value) for value in (x, mean, variance))
    return np.exp(-((x - mean) ** 2) / (2 * variance)) / np.sqrt(2 * np.pi * variance)
