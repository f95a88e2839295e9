r"""Reads a relation as it is printed, in LaTeX, and computes both of its sides.

::

    holds(r"p_k=(I-K_kH)\Psi_k", {"p": Indexed(p), "K": Indexed(K), "H": H, "I": I, r"\Psi": Indexed(Psi), "k": range(1, 4)})

The letters are given numbers: floats, matrices (n, m) (a column is (n, 1)), functions of Python, `Indexed` values for letters
with an index, a `range` for an index that runs, `Of` for what depends on a variable of integration.  A letter may be any piece
of LaTeX (`p(x_k\mid y_{0:k})`, `\frac{\partial S}{\partial x}`): the longest that fits is taken.  Read are + - / products and
powers, ^T and ^{-1}, functions, \frac, \sqrt, |x|, matrices, \sum, \prod and \int, and the relations = \approx \le \ge < >
\propto \leftarrow.  What is written z\leftarrow on the left is the letter `z\leftarrow`, the new value.
Products of matrices keep their order, and shapes must fit: a transposition that is missing is found.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise, product
from typing import Any

import numpy as np

from kfcourse.pages.grammar import Letters, Reader
from kfcourse.pages.tex import is_relation, normal, pieces
from kfcourse.pages.values import Indexed, Of, Operator, Unread, Value, bell
from kfcourse.pages.verification import Unverified

__all__ = ["Indexed", "Of", "Operator", "Unread", "bell", "holds", "is_relation", "normal", "pieces"]
ROUNDING = 1e-8


def holds(relation: str, letters: Letters, within: float = ROUNDING, approximately: float = 0.1) -> None:
    """Compute the sides of a relation for every value of its indices, and compare.

    |l - r| <= `within` * the scale of their terms; with \\approx `approximately` takes the place of `within`.

    Raises
    ------
    Unread
        If a letter has no value, or the LaTeX is not read.
    Unverified
        If the relation does not hold; the message has both numbers.
    """
    text = normal(relation)
    if r"\pm" in text.split():  # both signs
        for sign in "+-":
            holds(text.replace(r"\pm", sign), letters, within, approximately)
        return
    reader = Reader(text.split(), letters)
    sides, signs, indices = reader.chain()
    first: list[Value] = []
    for chosen in product(*(letters[index] for index in indices)):
        at = dict(zip(indices, chosen, strict=True))
        try:
            values = [side(at) for side in sides]
        except (TypeError, ValueError, AttributeError, LookupError, np.linalg.LinAlgError) as error:
            if isinstance(error, Unread):
                raise
            raise Unverified(f"cannot be computed, {error}: {relation}") from error
        for (left, right), sign in zip(pairwise(values), signs, strict=True):
            if sign != r"\propto":
                _compare(relation, left, right, sign, within, approximately, at)
        first = first or values
        if r"\propto" in signs:  # one factor for all
            _compare(relation, values[0] * first[1], values[1] * first[0], "=", within, approximately, at)
    for left, right in reader.braced:
        _compare(relation, left({}), right({}), "=", within, approximately, {})


def _compare(text: str, left: Value, right: Value, sign: str, within: float, approximately: float, at: Mapping[str, Any]) -> None:
    if any(callable(side) and not isinstance(side, np.ndarray) for side in (left, right)):
        raise Unread(f"a function without its arguments: {text}")
    left, right = np.asarray(left, float), np.asarray(right, float)
    if left.size == 1 or (right.size == 1 and not right.any()):
        left, right = np.broadcast_arrays(np.squeeze(left), right) if left.size > 1 else (left.ravel(), right.ravel())
    scale = max(np.max(np.abs(left)), np.max(np.abs(right)), 1e-300) if sign == r"\approx" else 1 + np.max(np.abs(right))
    bound = scale * (approximately if sign == r"\approx" else within)
    if left.shape != right.shape:
        raise Unverified(f"a side {left.shape} cannot equal one of {right.shape}: {text}")
    difference = left - right
    signs = {r"\le": difference <= bound, "<": difference < 0, r"\ge": difference >= -bound, ">": difference > 0}
    true = np.all(signs.get(sign, np.abs(difference) <= bound))
    if not true:
        raise Unverified(f"does not hold{f' at {dict(at)}' if at else ''}: {text}\n  left:  {left}\n  right: {right}")
