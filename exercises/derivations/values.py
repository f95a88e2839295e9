r"""A tree at random points, and its means there by Gauss-Hermite quadrature; are two equal?

With n nodes on an axis the mean of a polynomial is exact up to degree 2n - 1; the exponentials,
sines and cosines of linear functions that may stand in a mean are entire, and with `FUNCTION_NODES`
nodes exact to rounding for the slopes tried here. Beside each value goes a bound of its terms'
sizes, \|a\| + \|b\| for a - b: rounding is relative to that.
"""

from __future__ import annotations

import random
from functools import lru_cache

import numpy as np

from kfcourse.exercises.derivations.setting import Setting
from kfcourse.exercises.derivations.terms import LETTER, MEAN, NUMBER, POWER, PRODUCT, SUM, Node
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

_FUNCTIONS = {
    name: getattr(np, {"atan": "arctan", "abs": "abs"}.get(name, name))
    for name in ("sin", "cos", "tan", "atan", "exp", "log", "sinh", "cosh", "tanh", "abs")
}


class Uncomputed(ValueError):
    """A line has no value that could be compared, or a mean that is not computed here."""

    def __init__(self, node: Node, says: str = NO_MEAN):
        super().__init__(says)
        self.span = node.span


def degrees(node: Node, setting: Setting) -> dict[str, float]:
    """A bound on the degree in each random letter; infinite inside a function; Uncomputed where no
    mean is computed."""
    if node.kind == NUMBER or node.kind == MEAN:
        if node.kind == MEAN:
            degrees(node.parts[0], setting)
        return {}
    if node.kind == LETTER:
        meaning = setting.meanings.get(node.data)
        return (
            {node.data: 1}
            if node.data in setting.law.random
            else degrees(meaning, setting)
            if meaning
            else {}
        )
    parts = [degrees(part, setting) for part in node.parts]
    names = {name for part in parts for name in part}
    if node.kind == SUM:
        return {name: max(part.get(name, 0) for part in parts) for name in names}
    if node.kind == PRODUCT:
        if any(part and e < 0 for e, part in zip(node.data, parts, strict=True)):
            raise Uncomputed(node)
        return {name: sum(part.get(name, 0) for part in parts) for name in names}
    if not names:
        return {}
    if node.kind == POWER:
        if node.data.denominator != 1 or node.data < 0:
            raise Uncomputed(node)
        return {name: float(node.data) * parts[0][name] if node.data else 0 for name in names}
    if node.data not in ENTIRE or any(degree > 1 for degree in parts[0].values()):
        raise Uncomputed(node)
    return dict.fromkeys(names, np.inf)


def means(node: Node, setting: Setting) -> list[Node]:
    """The means in a tree, also those in the meanings of its letters."""
    if node.kind == LETTER:
        meaning = setting.meanings.get(node.data)
        return means(meaning, setting) if meaning else []
    return ([node] if node.kind == MEAN else []) + [
        inner for part in node.parts for inner in means(part, setting)
    ]


class Values:
    """Values of trees at the same random points.

    Parameters
    ----------
    setting : Setting
    trees : list of Node
        Those whose means must be exact; others with a power more still are.
    positive : bool
        Whether all letters are positive; otherwise those not declared so have both signs.
    """

    def __init__(self, setting: Setting, trees: list[Node], points: int = TRIED, seed: str = ""):
        self.setting, self.points = setting, points
        highest: dict[str, float] = {}
        for tree in trees:
            for mean_ in means(tree, setting):
                for name, degree in degrees(mean_.parts[0], setting).items():
                    highest[name] = max(highest.get(name, 0), degree)
        self.axes = {name: i for i, name in enumerate(setting.law.random)}
        n = len(setting.law.states)
        # a component is made of several normal numbers
        most = max((highest.get(x, 0) for x in setting.law.states), default=0)
        sizes = [
            most if name in setting.law.states and n > 1 else highest.get(name, 0)
            for name in setting.law.random
        ]
        self.nodes = [hermite(FUNCTION_NODES if np.isinf(s) else int(s) + 2) for s in sizes]
        self.seed = seed
        self.letters: dict[str, Array] = {}
        self._law()
        self.kept: dict[tuple[int, bool], tuple[Node, Array, Array]] = {}

    def of(self, node: Node, keep: bool = False) -> Array:
        """Values at the points, (points,); NaN where there is none."""
        return self.sized(node, keep)[0]

    def sized(self, node: Node, keep: bool = False) -> tuple[Array, Array]:
        """Values, and the sizes of the terms that they are made of."""
        with np.errstate(all="ignore"):
            value, size = self._value(node, False, keep)
        first, second = (
            np.broadcast_to(array.reshape(array.shape[0], -1)[:, 0], self.points)
            for array in (value, size)
        )
        return first, second

    def _column(self, values: Array) -> Array:
        return values.reshape(-1, *[1] * len(self.axes))

    def _random(self, name: str) -> Array:
        positive = name in self.setting.positive or name in self.setting.variances
        numbers = []
        for i in range(self.points):
            source = random.Random(f"{self.seed}{name}/{i}")
            sign = 1 if positive or i < self.points / 3 else source.choice((1, -1))
            numbers.append(sign * source.uniform(0.4, 1.5))
        return np.array(numbers)

    def _law(self) -> None:
        """Points of a law: a positive definite covariance, and the normal letters on their axes."""
        law = self.setting.law
        n = len(law.states)
        if n == 1:
            self.roots = np.sqrt(self._random(law.cov[0][0]))[:, None, None]
        else:
            lower = np.array(
                [[self._random(f"root/{i}/{j}") for j in range(n)] for i in range(n)]
            ).transpose(2, 0, 1)
            lower = np.tril(lower, -1) * 0.5 + np.abs(lower) * np.eye(n)
            cov = lower @ lower.transpose(0, 2, 1)
            self.roots = lower
            for i in range(n):
                for j in range(n):
                    self.letters[law.cov[i][j]] = cov[:, i, j]

    def letter(self, name: str) -> Array:
        """Its values at the points, (points,)."""
        if name not in self.letters:
            self.letters[name] = self._random(name)
        return self.letters[name]

    def _on_axis(self, name: str) -> Array:
        """A random letter at the nodes."""
        law, k = self.setting.law, self.axes[name]

        def normal(axis: int) -> Array:
            shape = [1] * (len(self.axes) + 1)
            shape[axis + 1] = -1
            return self.nodes[axis][0].reshape(shape)

        if name in law.noises:
            return normal(k)
        value = self._column(self.letter(law.means[k]))
        for j in range(k + 1):
            value = value + self._column(self.roots[:, k, j]) * normal(j)
        return value

    def _value(self, node: Node, inside: bool, keep: bool) -> tuple[Array, Array]:
        kept = self.kept.get((id(node), inside))
        if kept is not None:
            return kept[1], kept[2]
        value, size = self._fresh(node, inside, keep)
        if keep:
            self.kept[id(node), inside] = node, value, size
        return value, size

    def _fresh(self, node: Node, inside: bool, keep: bool) -> tuple[Array, Array]:
        if node.kind == NUMBER:
            value = self._column(np.array([float(node.data)]))
            return value, np.abs(value)
        if node.kind == LETTER:
            if node.data in self.setting.meanings:
                return self._value(self.setting.meanings[node.data], inside, True)
            value = (
                self._on_axis(node.data)
                if inside and node.data in self.axes
                else self._column(self.letter(node.data))
            )
            return value, np.abs(value)
        if node.kind == MEAN:
            value, size = self._value(node.parts[0], True, keep)
            for k, (_, weights) in enumerate(self.nodes):
                if value.shape[k + 1] > 1:
                    shape = [1] * value.ndim
                    shape[k + 1] = -1
                    value = (value * weights.reshape(shape)).sum(axis=k + 1, keepdims=True)
                    size = (size * weights.reshape(shape)).sum(axis=k + 1, keepdims=True)
            return value, size
        parts = [self._value(part, inside, keep) for part in node.parts]
        if node.kind == SUM:
            value = size = self._column(np.zeros(1))
            for sign, (part, its_size) in zip(node.data, parts, strict=True):
                value, size = value + sign * part, size + its_size
            return value, size
        if node.kind == PRODUCT:
            value = size = self._column(np.ones(1))
            for e, (part, its_size) in zip(node.data, parts, strict=True):
                value = value * part if e > 0 else value / part
                size = size * its_size if e > 0 else size * its_size / part**2
            return value, size
        inner, its_size = parts[0]
        if node.kind == POWER:
            exponent = float(node.data)
            value = np.abs(inner) ** exponent if node.data.numerator % 2 == 0 else inner**exponent
            return value, its_size**exponent if exponent > 0 else np.abs(value) * (
                its_size / np.abs(inner)
            ) ** -exponent
        value = _FUNCTIONS[node.data](inner)
        return value, np.abs(value) + np.maximum(1, np.abs(value)) * its_size


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
    (a, size_a), (b, size_b) = values.sized(first), values.sized(second)
    with np.errstate(all="ignore"):
        same = np.abs(a - b) <= ROUNDING * (size_a + size_b)
        defined = np.array(
            [
                np.isfinite(value) & (ROUNDING * size < CLEAR * (1 + np.abs(value)))
                for value, size in ((a, size_a), (b, size_b))
            ]
        )
    positive = defined.all(axis=0) & (np.arange(values.points) < values.points / 3)
    if positive.sum() < FEWEST:
        return NO_VALUE
    if not same[positive].all():
        return DIFFERENT
    # Where only one side has a value, as log(c^2) has and 2 log(c) has not, they are equal for
    # positive letters only.
    return EQUAL if same[defined.any(axis=0)].all() else IF_POSITIVE
