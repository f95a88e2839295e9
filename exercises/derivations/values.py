r"""A tree at random points, and its means there by Gauss-Hermite quadrature; are two equal?

With n nodes on an axis the mean of a polynomial is exact up to degree 2n - 1; the exponentials,
sines and cosines of linear functions that may stand in a mean are entire, and with `FUNCTION_NODES`
nodes exact to rounding for the slopes tried here. Beside each value goes a bound of its terms'
sizes, \|a\| + \|b\| for a - b: rounding is relative to that.
"""

from __future__ import annotations

import random
from fractions import Fraction
from functools import lru_cache, reduce
from weakref import WeakKeyDictionary

import numpy as np

from kfcourse.exercises.derivations.setting import Setting
from kfcourse.exercises.derivations.terms import (
    CALL,
    LETTER,
    MEAN,
    NUMBER,
    POWER,
    PRODUCT,
    SUM,
    Node,
    means_in,
)
from kfcourse.laws import Array

ENTIRE = ("exp", "sin", "cos", "sinh", "cosh")  # functions that may stand in a mean
FUNCTION_NODES = 32
# of the size of the terms: some thousand operations of 1e-16 each, and nodes and weights known to
# 1e-13
ROUNDING = 1e-10
TRIED = 18  # points; a third of them with all letters positive

NO_MEAN = (
    "in a mean only polynomials are computed, and exp, sin, cos, sinh, cosh of linear ones; "
    "take the rest out of M[...]"
)


class Uncomputed(ValueError):
    """A line has no value that could be compared, or a mean that is not computed here."""

    def __init__(self, node: Node, says: str = NO_MEAN):
        super().__init__(says)
        self.span = node.span


def degrees(node: Node, setting: Setting) -> dict[str, float]:
    """A bound on the degree in each random letter; infinite inside a function; Uncomputed where no
    mean is computed."""
    if node.kind in (NUMBER, MEAN):
        return {}
    if node.kind == LETTER:
        if node.data in setting.law.random:
            return {node.data: 1}
        meaning = setting.meanings.get(node.data)
        return degrees(meaning, setting) if meaning else {}
    parts = [degrees(part, setting) for part in node.parts]
    names = {name for part in parts for name in part}
    if node.kind in (SUM, PRODUCT):
        product = node.kind == PRODUCT
        if product and any(part and e < 0 for e, part in zip(node.data, parts, strict=True)):
            raise Uncomputed(node)
        together = sum if product else max
        return {name: together(part.get(name, 0) for part in parts) for name in names}
    if not names:
        return {}
    if node.kind == POWER:
        if node.data.denominator != 1 or node.data < 0:
            raise Uncomputed(node)
        return {name: float(node.data) * parts[0][name] if node.data else 0 for name in names}
    if node.data not in ENTIRE or any(degree > 1 for degree in parts[0].values()):
        raise Uncomputed(node)
    return dict.fromkeys(names, np.inf)


class Values:
    """Values of trees at the same random points.

    Parameters
    ----------
    setting : Setting
    trees : list of Node
        Those whose means must be exact; others with a power more still are.
    points : int
        In a third of them all letters are positive; otherwise those not declared so have both
        signs.
    seed : str
    """

    def __init__(self, setting: Setting, trees: list[Node], points: int = TRIED, seed: str = ""):
        self.setting, self.points, self.seed = setting, points, seed
        self.letters: dict[str, Array] = {}
        # of each tree as long as it lives: inside of a mean, and outside
        self.kept = {inside: WeakKeyDictionary[Node, Array]() for inside in (True, False)}
        opened = [setting.meanings[name] for name in setting.opened(*trees) & {*setting.meanings}]
        highest = dict.fromkeys(setting.law.random, 0.0)
        for tree in [*trees, *opened]:
            for mean in means_in(tree):
                for name, degree in degrees(mean.parts[0], setting).items():
                    highest[name] = max(highest[name], degree)
        # a component is made of several normal numbers
        states = setting.law.states
        highest |= dict.fromkeys(states, max((highest[x] for x in states), default=0.0))
        self._at_nodes(
            [hermite(FUNCTION_NODES if np.isinf(d) else int(d) + 2) for d in highest.values()]
        )

    def _at_nodes(self, rules: list[tuple[Array, Array]]) -> None:
        """Weights, and random letters at the nodes, each rule on an axis of its own; a covariance
        is positive definite."""
        (_, *normal), (_, *self.weights) = (
            np.meshgrid([0.0], *values, indexing="ij", sparse=True)
            for values in zip(*rules, strict=True)
        )
        law, points = self.setting.law, self.points
        n = len(law.states)
        lower = np.zeros((points, n, n))
        for i in range(n):
            for j in range(i):
                lower[:, i, j] = self._random(f"root/{i}/{j}") / 2
            lower[:, i, i] = np.abs(self._random(f"root/{i}/{i}"))
        cov = lower @ lower.transpose(0, 2, 1)
        for i, j in np.ndindex(n, n):
            self.letters[law.cov[i][j]] = cov[:, i, j]
        self.inside = dict(zip(law.noises, normal[n:], strict=True))
        for i, name in enumerate(law.states):
            self.inside[name] = self._column(self.letter(law.means[i])) + sum(
                self._column(lower[:, i, j]) * normal[j] for j in range(i + 1)
            )

    def of(self, node: Node) -> Array:
        """Values at the points, (points,); NaN where there is none."""
        return self.sized(node)[0]

    def sized(self, node: Node) -> Array:
        """Values, and the sizes of the terms that they are made of, (2, points)."""
        with np.errstate(all="ignore"):
            both = self._value(node, False)
        return np.broadcast_to(both.reshape(2, -1), (2, self.points))

    def _column(self, values: Array) -> Array:
        return values.reshape(-1, *[1] * len(self.weights))

    def _random(self, name: str) -> Array:
        positive = name in self.setting.positive
        numbers = []
        for i in range(self.points):
            source = random.Random(f"{self.seed}{name}/{i}")
            sign = 1 if positive or i < self.points / 3 else source.choice((1, -1))
            numbers.append(sign * source.uniform(0.4, 1.5))
        return np.array(numbers)

    def letter(self, name: str) -> Array:
        """Its values at the points, (points,)."""
        if name not in self.letters:
            self.letters[name] = self._random(name)
        return self.letters[name]

    def _value(self, node: Node, inside: bool) -> Array:
        """Values and sizes, (2, points, nodes...); with random letters at the nodes inside a
        mean."""
        kept = self.kept[inside]
        if node not in kept:
            kept[node] = self._fresh(node, inside)
        return kept[node]

    def _fresh(self, node: Node, inside: bool) -> Array:
        if node.kind == LETTER and node.data in self.setting.meanings:
            return self._value(self.setting.meanings[node.data], inside)
        if node.kind in (NUMBER, LETTER):
            if inside and node.data in self.inside:
                value = self.inside[node.data]
            elif node.kind == LETTER:
                value = self._column(self.letter(node.data))
            else:
                value = self._column(np.array([float(node.data)]))
            return np.stack([value, np.abs(value)])
        if node.kind == MEAN:
            both = self._value(node.parts[0], True)
            for axis, weights in enumerate(self.weights, 2):
                if both.shape[axis] > 1:
                    both = (both * weights).sum(axis, keepdims=True)
            return both
        parts = [self._value(part, inside) for part in node.parts]
        if node.kind == POWER:
            return _power(parts[0], node.data)
        if node.kind == CALL:
            value = getattr(np, node.data)(parts[0][0])
            return np.stack([value, np.abs(value) + np.maximum(1, np.abs(value)) * parts[0][1]])
        pairs = list(zip(node.data, parts, strict=True))
        if node.kind == PRODUCT:
            return reduce(np.multiply, [p if e > 0 else _power(p, e) for e, p in pairs])
        return reduce(np.add, [p if sign > 0 else np.stack([-p[0], p[1]]) for sign, p in pairs])


def _power(both: Array, exponent: Fraction) -> Array:
    inner, size = both
    k = float(exponent)
    value = np.abs(inner) ** k if exponent.numerator % 2 == 0 else inner**k
    return np.stack([value, size**k if k > 0 else np.abs(value) * (size / np.abs(inner)) ** -k])


@lru_cache
def hermite(count: int) -> tuple[Array, Array]:
    """Nodes and weights for the standard normal law, exact for polynomials up to degree 2 count -
    1."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(count)
    return nodes, weights / weights.sum()


EQUAL, DIFFERENT, IF_POSITIVE, NO_VALUE = "equal", "different", "equal if positive", "no value"
FEWEST = 4  # points at which both have values
# of a value: what its rounding may be, that it can be compared; tan(1e16) has no value
CLEAR = 1e-4


def compare(setting: Setting, first: Node, second: Node) -> str:
    """Whether two trees are equal: "equal", "different", "equal if positive" letters are meant, or
    "no value".

    Raises
    ------
    Uncomputed
        A mean is not computed here.
    """
    values = Values(setting, [first, second])
    value, size = np.stack([values.sized(first), values.sized(second)], axis=1)
    with np.errstate(all="ignore"):
        same = np.abs(value[0] - value[1]) <= ROUNDING * size.sum(axis=0)
        defined = np.isfinite(value) & (ROUNDING * size < CLEAR * (1 + np.abs(value)))
    positive = defined.all(axis=0) & (np.arange(values.points) < values.points / 3)
    if positive.sum() < FEWEST:
        return NO_VALUE
    if not same[positive].all():
        return DIFFERENT
    # Where only one side has a value, as log(c^2) has and 2 log(c) has not, they are equal for
    # positive letters only.
    return EQUAL if same[defined.any(axis=0)].all() else IF_POSITIVE


def are_equal(setting: Setting, first: Node, second: Node) -> bool:
    """Whether two trees are equal, and their means are computed here."""
    try:
        return compare(setting, first, second) == EQUAL
    except Uncomputed:
        return False
