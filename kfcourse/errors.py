"""What is refused, and in which words: exceptions that a report can reword, and checks of an
argument's kind and size."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np


class Refused(ValueError):
    """Something cannot be had.

    Attributes
    ----------
    kind : str
        Such as "no_mean"; reports have a sentence for each.  Empty: the message is quoted.
    parts : dict
        What is put into that sentence: "step", "seconds", "term" (a SymPy expression).
    """

    def __init__(self, message: str, kind: str = "", **parts: Any):
        super().__init__(message)
        self.kind, self.parts = kind, parts


class ModelError(Refused):
    """The description of a model is inconsistent; the message says what to change."""


class NoClosedForm(Refused):
    """The Gaussian mean of a term is not an elementary expression that the package can find."""


class NotFinite(ArithmeticError):
    """A filter or trajectory left the finite numbers.

    Attributes
    ----------
    filter_name : str
        Of the filter; empty if it was the model's trajectories.
    kind, parts
        As of `Refused`.
    """

    def __init__(self, message: str, filter_name: str = "", kind: str = "", **parts: Any):
        super().__init__(message)
        self.filter_name, self.kind, self.parts = filter_name, kind, parts


Reason: TypeAlias = str | Exception  # why something is left out: the error, or a sentence

REMEDIES = {
    "Model": "give a model, such as Model.define(...) or the .model of a filter",
    "Structure": "give linearised(model), gaussian(model), unscented(model) or "
    "gauss_hermite(model)",
    "Filter": "give a filter, such as aof(linearised(model)); design(...) makes one of a design",
}


def expect(given: object, kind: type, what: str, *also: type) -> None:
    """TypeError unless an argument of `what` is of this kind, or one of the others."""
    if not isinstance(given, (kind, *also)):
        came = (
            f"{type(given).__name__} {getattr(given, 'name', getattr(given, '__name__', ''))}"
        ).rstrip()
        remedy = REMEDIES.get(kind.__name__, "see its documentation")
        raise TypeError(f"{what} expects a {kind.__name__}, got {came}: {remedy}")


def expect_sizes(**sizes: object) -> None:
    """ValueError for one of these numbers, of steps, runs and so on, that is not a positive whole
    one."""
    for name, value in sizes.items():
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
            raise ValueError(f"{name} must be a positive whole number, got {value!r}")


def expect_positive(**numbers: float) -> None:
    """ValueError for one of these numbers that is not positive and finite."""
    for name, value in numbers.items():
        if not 0 < value < np.inf:
            raise ValueError(f"{name} must be positive and finite, got {value}")


def expect_not_negative(**numbers: float) -> None:
    """ValueError for one of these numbers that is negative or not finite."""
    for name, value in numbers.items():
        if not 0 <= value < np.inf:
            raise ValueError(f"{name} must be finite and not negative, got {value}")
