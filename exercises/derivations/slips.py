"""Which single change of a line makes it equal to the one above?

Changes are tried, one node of the line at a time: the sign of a term, a number in front, a power, a
letter for another one, a factor or a term lost or too much, a moment of the normal law for another
one.  So are changes of the line above: what of it would give this line?  Values at a few random
points choose; the line with the change must then be equal to the one above, as lines are compared.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from math import gcd, prod
from typing import Any

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
    Path,
    at,
    changed,
    difference,
    letter,
    letters,
    mean,
    number,
    power,
    product,
    replaced,
    total,
    walk,
    written,
)
from kfcourse.exercises.derivations.values import ENTIRE, Values, are_equal
from kfcourse.laws import Array

CLOSE = 1e-7  # relative difference of values: what is found is made sure of exactly
MOST_TRIED = 30000  # changes
FORGOTTEN = "noise-forgotten"
COSTS = {  # what is named if several changes explain a line
    "sign": 1.0,
    "doubled": 1.05,
    "letter": 1.1,
    "moment": 1.25,
    "power": 1.2,
    "factor": 1.2,
    FORGOTTEN: 1.22,
    "lost-factor": 1.3,
    "extra": 1.4,
    "lost": 1.5,
}
NUMBERS = [  # in front of a term
    Fraction(-1),
    *(Fraction(p, q) for q in range(1, 7) for p in range(1, 7) if p != q and gcd(p, q) == 1),
]
POWERS = (1, 2, 3, 4, Fraction(1, 2), -1, -2)
OF_THE_LINE_ABOVE = 1.0  # an addition to the cost


@dataclass(frozen=True)
class Slip:
    """A change that makes a line equal to the one above.

    Attributes
    ----------
    kind : str
        A key of `COSTS`.
    path : tuple of int
        Way from the root to what is changed, in the line; to the term of the line above if `above`.
    name : str
        The letter or the noise concerned.
    order : int
        Of the moment.
    lost : Node, optional
        The term or bracket that is lost, of the line above.
    above : bool
        Whether the path is one of the line above: of the term that something else was made of.
    more : float
        An addition to the cost.
    """

    kind: str
    path: Path
    name: str = ""
    order: int = 0
    lost: Node | None = None
    above: bool = False
    more: float = 0.0


def term_path(root: Node, path: Path) -> Path:
    """The way to the term around a node: the nearest one that stands in a sum; the whole line if
    none does."""
    for length in range(len(path), 0, -1):
        if at(root, path[: length - 1]).kind == SUM:
            return path[:length]
    return ()


def named(root: Node, path: Path) -> Path:
    """The way to what is named: the term around a node, or the function in it whose argument the
    node is part of."""
    functions = [
        path[:length] for length in range(len(path)) if at(root, path[:length]).kind == CALL
    ]
    return max([term_path(root, path), *functions], key=len)


def multiplied(root: Node, path: Path) -> bool:
    """Whether a node stands in a factor of something."""
    return any(at(root, path[:i]).kind == PRODUCT for i in range(len(path)))


def find_slips(setting: Setting, line: Node, above: Node) -> list[Slip]:
    """The slips that explain a line best, at most two of different terms; none if no single change
    does."""
    if above.kind == LETTER and above.data in setting.meanings:  # opened, to see its terms
        above = setting.meanings[above.data]
    return _Search(setting, line, above).best()


class _Search:
    def __init__(self, setting: Setting, line: Node, above: Node):
        self.setting, self.line, self.above = setting, line, above
        self.pool = sorted({*setting.law.letters, *setting.opened(line, above)})
        self.values = Values(setting, [line, above], points=len(self.pool) + 10, seed="slip")
        self.mine, self.theirs = map(self.values.of, (line, above))
        inner = list(walk(above))
        self.terms = [
            (sign, term, multiplied(above, path))
            for path, node in inner
            if node.kind == SUM
            for sign, term in zip(node.data, node.parts, strict=True)
        ]
        brackets = {
            written(part): part
            for _, node in inner
            if node.kind == PRODUCT
            for part in node.parts
            if part.kind == SUM
        }
        self.factors: list[tuple[str, Node | None, Node]] = [
            *((name, None, power(letter(name), k)) for name in self.pool for k in (1, 2)),
            *(("", part, part) for part in brackets.values()),
        ]

    def best(self) -> list[Slip]:
        """The cheapest that hold, one for each term."""
        fitting = [(self._cost(slip), slip, tree) for slip, tree in self.fitting()]
        kept, least = list[Slip](), np.inf
        for cost, slip, tree in sorted(fitting, key=lambda fit: (fit[0], -len(fit[1].path))):
            if cost > least + 1e-9:
                break
            place = self._place(slip)
            # around a term that is named already
            if any(self._place(other)[: len(place)] == place for other in kept):
                continue
            target = self.line if slip.above or slip.kind == FORGOTTEN else self.above
            if are_equal(self.setting, tree, target):
                kept.append(slip)
                least = cost
        if kept and kept[0].kind == "doubled":  # either of the two
            return kept[-1:]
        return kept if len(kept) <= 2 else []

    def _place(self, slip: Slip) -> Path:
        return term_path(self.above if slip.above else self.line, slip.path)

    def fitting(self) -> Iterator[tuple[Slip, Node]]:
        """Changes that give the right values: slip, the changed tree."""
        for name in [noise for noise in self.setting.law.noises if noise in letters(self.above)]:
            tree = replaced(self.above, {name: number(0)})
            if self._same(self.values.of(tree), self.mine):
                yield Slip(FORGOTTEN, (), name), tree
        moments, count = list(self._moments()), 0
        for root, other in ((self.line, False), (self.above, True)):
            target = self.mine if other else self.theirs
            for path, node in walk(root):
                outer = at(root, path[:-1]) if path else None
                changes = self._of_moments(path, node, outer, moments, other)
                if not other:
                    changes = chain(changes, self._of_node(path, node, outer))
                for slip, new in changes:
                    count += 1
                    if count > MOST_TRIED:
                        return
                    tree = changed(root, path, new)
                    if self._same(self.values.of(tree), target) and not self._nothing(
                        tree, path, slip.kind
                    ):
                        yield slip, tree
        yield from self._lost()

    def _nothing(self, tree: Node, path: Path, kind: str) -> bool:
        """Whether a change leaves nothing of the mean or the power around it: then that does not
        belong there as a whole.

        With a noise that was lost a mean may be zero, and rightly so.
        """
        for i in range(len(path)):
            outer = at(tree, path[:i])
            if outer.kind in (MEAN, CALL, POWER):
                left = self.values.of(outer.parts[0] if kind == "lost-factor" else outer)
                return bool(np.all(np.abs(left) <= 1e-9))
        return False

    def _lost(self) -> Iterator[tuple[Slip, Node]]:
        """What the line lacks, if that is a number times powers of letters."""
        names = [name for name in self.pool if name not in self.setting.meanings]
        values, factors = self.theirs - self.mine, list[Node]()
        with np.errstate(all="ignore"):
            logs = [np.log(np.abs(self.values.letter(name))) for name in names]
            inverse = np.linalg.pinv(np.array([np.ones(self.values.points), *logs]).T)
            exponents = np.round(inverse @ np.log(np.abs(values)))[1:]
            if not np.abs(exponents).max(initial=0) <= 12:  # also of what has no value
                return
            powers = {name: int(k) for name, k in zip(names, exponents, strict=True) if k}
            for name, k in powers.items():
                values = values / self.values.letter(name) ** float(k)
                factors.append(power(letter(name), k))
        q = number(Fraction(float(np.median(values))).limit_denominator(60))
        tree = total(self.line, product(q, *factors))
        if self._same(self.values.of(tree), self.theirs):
            yield Slip("lost", (), " and ".join(powers)), tree

    def _of_moments(
        self, path: Path, node: Node, outer: Node | None, moments: list[Any], other: bool
    ) -> Iterator[tuple[Slip, Node]]:
        """A moment in the place of another; of the line above, the other way round."""
        if outer is None or outer.kind in (SUM, POWER):
            for wrong, right, order in moments:
                pair = (wrong, right) if other else (right, wrong)
                slip = Slip("moment", path, order=order, above=other)
                yield slip, product(node, *pair, exponents=(1, 1, -1))

    def _of_node(self, path: Path, node: Node, outer: Node | None) -> Iterator[tuple[Slip, Node]]:
        """Changes of one node of the line: slip, the new node."""
        parts, data = node.parts, node.data

        def slip(
            kind: str, new: Node, name: str = "", below: Path = (), **of: Any
        ) -> tuple[Slip, Node]:
            return Slip(kind, path + below, name, **of), new

        if node.kind == SUM:
            for i, part in enumerate(parts):
                signs = tuple(-s if i == j else s for j, s in enumerate(data))
                yield slip("sign", Node(SUM, parts, signs), below=(i,))
                value = data[i] * self.values.of(part)
                twice = any(
                    j != i and self._same(data[j] * self.values.of(other), value)
                    for j, other in enumerate(parts)
                )
                gone = Node(SUM, (*parts[:i], number(0), *parts[i + 1 :]), data)
                if len(parts) > 1:
                    yield slip("doubled" if twice else "extra", gone, below=(i,))
        if node.kind == LETTER:
            yield from (slip("letter", letter(name), data) for name in self.pool if name != data)
        base, own = (parts[0], data) if node.kind == POWER else (node, 1)
        if base.kind != NUMBER:
            name = base.data if base.kind == LETTER else ""
            yield from (slip("power", power(base, k), name) for k in POWERS if k != own)
        if node.kind == PRODUCT:
            for i, part in enumerate(parts):
                name = part.data if part.kind == LETTER else ""
                rest = Node(PRODUCT, (*parts[:i], number(1), *parts[i + 1 :]), data)
                yield slip("extra", rest, name, below=(i,))
        if outer is None or outer.kind != PRODUCT:
            beside = outer is not None and len(outer.parts) > 1
            for q in NUMBERS:
                kind, new = "sign" if q == -1 else "factor", product(number(q), node)
                yield slip(kind, new, more=0.35 * (node.kind == LETTER and beside))
            for name, lost, factor in self.factors:
                yield slip("lost-factor", product(factor, node), name, lost=lost)
        if outer is None or outer.kind != SUM:
            odd = outer is not None and outer.kind == PRODUCT and node.kind != SUM
            for _, term, _ in self.terms:
                for lost in (term, mean(term)):
                    for sign in (1, -1):
                        sum_ = total(node, lost, signs=(1, sign))
                        yield slip("lost", sum_, more=0.2 * odd, lost=term)

    def _moments(self) -> Iterator[tuple[Node, Node, int]]:
        """Wrong and right moments of the normal law, and their order; of functions, too."""
        law = self.setting.law
        at_mean = {state: letter(law.means[i]) for i, state in enumerate(law.states)}
        products: dict[str, list[Node]] = {}
        for _, node in [*walk(self.line), *walk(self.above)]:
            if node.kind == CALL and node.data in ENTIRE and letters(node) & set(law.states):
                there = replaced(node, at_mean)
                yield there, mean(node), 0
                yield power(there, 2), mean(power(node, 2)), 0
            if node.kind == MEAN:
                (inside,) = node.parts
                for term in inside.parts if inside.kind == SUM else (inside,):
                    products[written(term)] = self._factors(term)
        for factors in products.values():
            for i in range(1, len(factors)):
                apart = (mean(product(*part)) for part in (factors[:i], factors[i:]))
                yield product(*apart), mean(product(*factors)), 0
        for i, x in enumerate(law.states):
            m, d, moment = letter(law.means[i]), letter(law.cov[i][i]), mean(power(letter(x), 2))
            for k in range(2, 9):
                raw, central = (
                    mean(power(base, k)) for base in (letter(x), difference(letter(x), m))
                )
                yield power(m, k), raw, k
                if k % 2 == 0:
                    square, own = (power(base, Fraction(k, 2)) for base in (moment, d))
                    yield central, raw, k
                    yield raw, central, k
                    yield product(number(prod(range(1, k, 2))), square), raw, k
                    yield own, central, k
                    yield own, raw, k
                if k == 4:
                    yield raw, difference(raw, power(moment, 2)), k

    def _factors(self, node: Node) -> list[Node]:
        """Those that depend on the state, x^3 as three of them."""
        if node.kind == PRODUCT:
            return [factor for part in node.parts for factor in self._factors(part)]
        if node.kind == POWER and node.data in range(2, 9):
            return self._factors(node.parts[0]) * int(node.data)
        return [node] * bool(letters(node) & set(self.setting.law.states))

    def _cost(self, slip: Slip) -> float:
        """More for a change of a term that is nothing, or that stands in the line above as it is,
        where it stands: in a bracket that is multiplied, or not."""
        cost = COSTS[slip.kind] + slip.more
        if slip.above:
            return cost + OF_THE_LINE_ABOVE
        if slip.kind in (FORGOTTEN, "doubled", "extra", "lost"):
            return cost
        path = term_path(self.line, slip.path)
        value = self.values.of(at(self.line, path))
        if path:
            value = value * at(self.line, path[:-1]).data[path[-1]]
        stays = path and any(
            self._same(value, sign * self.values.of(term))
            for sign, term, inside in self.terms
            if inside == multiplied(self.line, path)
        )
        return cost + 0.35 * bool(stays or np.all(np.abs(value) <= 1e-10))

    def _same(self, a: Array, b: Array) -> bool:
        with np.errstate(all="ignore"):
            return bool(np.all(np.abs(a - b) <= CLOSE * (np.abs(a) + np.abs(b)) + 1e-14))
