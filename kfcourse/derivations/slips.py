r"""Which single change of a line makes it equal to the one above?

Let the line be a tree, and A the value of the line above.  Going down from the root, what a node
should be follows from A and from the nodes beside it: tau = A - b for the term a of a + b, tau = A
/ b for the factor a of a b, and so on; inside a mean, a square or a function it follows if the line
above has one of the right value.  Beside its own value t this tells the slip:

    tau = -t                    a sign            tau = q t, q a number          a number in front
    tau = t c, c of letters     a power, a factor, a letter for another one
    tau = 0                     doubled, or too much
    tau - t = q c, or a term of the line above                                  a term is lost
    tau / t = M[x^4] / (3 d^2), and others of the normal law                     a moment

All of it by values at random points.  Where nothing follows, changes are tried: each of the same
kinds, one node at a time. The change that is found is made in the tree, and the line must then be
equal to the one above.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property

import numpy as np

from kfcourse.derivations.compared import EQUAL, compare
from kfcourse.derivations.setting import Setting
from kfcourse.derivations.terms import (
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
)
from kfcourse.derivations.values import ENTIRE, Uncomputed, Values
from kfcourse.laws import Array

CLOSE = 1e-7  # relative difference of values: what is found is made sure of exactly
MOST_TRIED = 4000  # changes
CERTAIN = 1.35  # cost of a slip beside which no other one is looked for
COSTS = {  # what is named if several changes explain a line
    "sign": 1.0,
    "doubled": 1.05,
    "letter": 1.1,
    "moment": 1.25,
    "power": 1.2,
    "factor": 1.2,
    "noise-forgotten": 1.22,
    "noise-mean": 1.45,
    "lost-factor": 1.3,
    "extra": 1.4,
    "function": 1.4,
    "lost": 1.5,
    "combined": 3.0,
}


@dataclass(frozen=True)
class Slip:
    """A change that makes a line equal to the one above.

    Attributes
    ----------
    kind : str
        A key of `COSTS`.
    path : tuple of int
        Way from the root to what is changed, in the line; to the term of the line above if `above`.
    repaired : Node
        The line with the change.
    name : str
        The letter, the function or the noise concerned.
    order : int
        Of the moment.
    lost : Node, optional
        The term that is lost, of the line above.
    above : bool
        Whether the path is one of the line above: of the term that something else was made of.
    """

    kind: str
    path: Path
    repaired: Node
    name: str = ""
    order: int = 0
    lost: Node | None = None
    above: bool = False
    extra: float = 0.0

    @property
    def cost(self) -> float:
        return COSTS[self.kind] + self.extra


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


def find_slips(setting: Setting, line: Node, above: Node) -> list[Slip]:
    """The slips that explain a line best, at most two of different terms; none if no single change
    does."""
    search = _Search(setting, line, _open(setting, above))
    found = search.best([*search.solved(), *search.noise()])
    if not found or search.cost > CERTAIN:
        found = (
            search.best(one for one in search.tried() if not found or one.cost < search.cost)
            or found
        )
    return found or search.best(search.misread())


def _open(setting: Setting, node: Node) -> Node:
    """A letter that stands for a tree, opened, so that its terms can be seen."""
    return (
        setting.meanings[node.data]
        if node.kind == LETTER and node.data in setting.meanings
        else node
    )


@dataclass
class _Search:
    setting: Setting
    line: Node
    above: Node
    mirrored: bool = False  # the line above has the wrong values, and the line the right ones
    values: Values = field(init=False)
    cost: float = field(init=False, default=np.inf)  # of what was found best

    def __post_init__(self) -> None:
        free: set[str] = set()
        waiting = [self.line, self.above]
        while waiting:
            for name in letters(waiting.pop()) - free:
                free.add(name)
                if name in self.setting.meanings:
                    waiting.append(self.setting.meanings[name])
        self.letters = sorted(free - set(self.setting.meanings) | set(self.setting.law.letters))
        self.values = Values(
            self.setting, [self.line, self.above], points=len(self.letters) + 10, seed="slip"
        )
        self.target = self.values.of(self.above, keep=True)
        self.values.of(self.line, keep=True)
        columns = [np.log(np.abs(self.values.letter(name))) for name in self.letters]
        self.logs = np.array([np.ones(self.values.points), *columns]).T
        self.inverse = np.linalg.pinv(self.logs)
        self.moments = list(self._moment_pairs())

    # ---------------------------------------------------------------- what is found, made sure of

    def best(self, found: Iterable[Slip]) -> list[Slip]:
        """The cheapest that hold, one for each term."""
        kept: list[Slip] = []
        places: set[tuple[bool, Path]] = set()
        priced = [
            (slip.cost + self._unlikely(slip), -len(slip.path), i, slip)
            for i, slip in enumerate(found)
        ]
        for cost, _, _, slip in sorted(priced):
            if kept and cost > self.cost and slip.cost != kept[0].cost:
                continue
            place = slip.above, term_path(self.above if slip.above else self.line, slip.path)
            # around a term that is named already
            if any(place == (one[0], one[1][: len(place[1])]) for one in places):
                continue
            if not self._equal(slip.repaired, self.above):
                continue
            places.add(place)
            kept.append(slip)
            self.cost = cost if len(kept) == 1 else self.cost
        if kept and kept[0].kind == "doubled":  # either of the two
            return kept[-1:]
        return kept if len(kept) <= 2 else []

    def _unlikely(self, slip: Slip) -> float:
        """An addition to the cost of changing a term that is nothing, or that stands in the line
        above as it is."""
        if slip.above or slip.kind in ("doubled", "extra", "lost", "noise-forgotten", "noise-mean"):
            return 0.0
        path = term_path(self.line, slip.path)
        value = self.values.of(at(self.line, path), keep=True)
        stays = path and any(
            self._same(_sign(self.line, path) * value, other) for other in self.as_above
        )
        return 0.35 if stays or np.all(np.abs(value) <= 1e-10) else 0.0

    @cached_property
    def as_above(self) -> list[Array]:
        """Values of the terms of the line above, with their signs."""
        paths = [
            path for path, _ in walk(self.above) if path and at(self.above, path[:-1]).kind == SUM
        ]
        return [_sign(self.above, path) * self.values.of(at(self.above, path)) for path in paths]

    def _equal(self, first: Node, second: Node) -> bool:
        try:
            return compare(self.setting, first, second) == EQUAL
        except Uncomputed:  # with the change a mean would be of something that is not computed
            return False

    def _same(self, a: Array, b: Array) -> bool:
        with np.errstate(all="ignore"):
            return bool(np.all(np.abs(a - b) <= CLOSE * (np.abs(a) + np.abs(b)) + 1e-14))

    # ---------------------------------------------------------------- solved for

    def solved(self) -> Iterator[Slip]:
        for path, node, t, tau in self._needed(self.line, self.target, (), self.above):
            yield from self._told(path, node, t, tau)

    def _needed(
        self, node: Node, tau: Array, path: Path, other: Node
    ) -> Iterator[tuple[Path, Node, Array, Array]]:
        """Every node with its value and the one it should have."""
        with np.errstate(all="ignore"):
            t = self.values.of(node, keep=True)
            if not np.isfinite(t).all() or not np.isfinite(tau).all():
                return
            yield path, node, t, tau
            if node.kind == SUM:
                for i, (sign, part) in enumerate(zip(node.data, node.parts, strict=True)):
                    own = self.values.of(part, keep=True)
                    yield from self._needed(part, sign * (tau - t) + own, (*path, i), other)
            elif node.kind == PRODUCT:
                for i, (e, part) in enumerate(zip(node.data, node.parts, strict=True)):
                    own = self.values.of(part, keep=True)
                    yield from self._needed(
                        part, tau * own / t if e > 0 else own * t / tau, (*path, i), other
                    )
            elif node.kind in (POWER, CALL, MEAN):
                yield from self._needed_inside(node, tau, path, other)

    def _needed_inside(
        self, node: Node, tau: Array, path: Path, other: Node
    ) -> Iterator[tuple[Path, Node, Array, Array]]:
        part = node.parts[0]
        if node.kind == POWER and node.data.numerator % 2:
            yield from self._needed(
                part, np.sign(tau) * np.abs(tau) ** float(1 / node.data), (*path, 0), other
            )
            return
        if node.kind == CALL and node.data in ("exp", "log"):
            yield from self._needed(
                part, np.log(tau) if node.data == "exp" else np.exp(tau), (*path, 0), other
            )
            return
        for _, one in walk(other):  # the line above has one of the right value
            if (
                one.kind == node.kind
                and one.data == node.data
                and self._same(self.values.of(one, keep=True), tau)
            ):
                yield from self._needed(
                    part, self.values.of(one.parts[0], keep=True), (*path, 0), one.parts[0]
                )

    def _told(self, path: Path, node: Node, t: Array, tau: Array) -> Iterator[Slip]:
        """What the two values tell of the slip."""
        in_sum = (
            bool(path)
            and at(self.line, path[:-1]).kind == SUM
            and len(at(self.line, path[:-1]).parts) > 1
        )
        scale = np.abs(self.target) + np.abs(t)
        if np.all(np.abs(tau) <= 1e-10 * scale):
            if in_sum:
                beside = at(self.line, path[:-1])
                twice = any(
                    i != path[-1]
                    and sign == beside.data[path[-1]]
                    and self._same(self.values.of(one), t)
                    for i, (sign, one) in enumerate(zip(beside.data, beside.parts, strict=True))
                )
                yield Slip(
                    "doubled" if twice else "extra", path, changed(self.line, path, number(0))
                )
            return
        with np.errstate(all="ignore"):
            ratio, rest = tau / t, tau - t
        for kind, name, factor, extra in self._ratio(ratio, node):
            yield Slip(
                kind, path, changed(self.line, path, product(factor, node)), name, extra=extra
            )
        for wrong, right, order, (w, r) in self.moments:
            if self._same(tau * w, t * r):
                repaired = changed(
                    self.line, path, product(node, right, wrong, exponents=(1, 1, -1))
                )
                yield Slip("moment", path, repaired, order=order)
        yield from self._powers(path, node, tau)
        if not in_sum:
            yield from self._lost(path, node, rest)
        if node.kind == CALL:
            for name in ENTIRE:
                other = Node(CALL, node.parts, name)
                if name != node.data and self._same(self.values.of(other), tau):
                    yield Slip("function", path, changed(self.line, path, other), node.data)

    def _monomial(self, values: Array) -> tuple[Fraction, dict[str, int]] | None:
        """q and powers of letters of which these are the values; None if of none."""
        if not np.isfinite(values).all() or np.any(values == 0):
            return None
        powers = np.round((self.inverse @ np.log(np.abs(values)))[1:])
        if np.abs(powers).max(initial=0) > 12:
            return None
        with np.errstate(all="ignore"):
            found = values / np.prod(
                [
                    self.values.letter(name) ** k
                    for name, k in zip(self.letters, powers, strict=True)
                ],
                axis=0,
            )
        q = Fraction(float(np.median(found))).limit_denominator(720)
        if not q or not self._same(found, np.full_like(found, float(q))):
            return None
        return q, {name: int(k) for name, k in zip(self.letters, powers, strict=True) if k}

    def _ratio(self, ratio: Array, node: Node) -> Iterator[tuple[str, str, Node, float]]:
        """Kind of slip, letter, and the factor that is missing."""
        found = self._monomial(ratio)
        if found is None:
            return
        q, powers = found
        factor = product(number(q), *(power(letter(name), k) for name, k in powers.items()))
        own, size = letters(node), sum(map(abs, powers.values()))
        if not powers:
            yield (
                ("sign" if q == -1 else "factor"),
                "",
                factor,
                0.0 if max(abs(q.numerator), q.denominator) <= 60 else 1.0,
            )
        elif q == 1 and len(powers) == 1:
            ((name, k),) = powers.items()
            kind = "power" if name in own else "lost-factor" if k > 0 else "combined"
            yield (
                kind,
                name,
                factor,
                (0.02 * (abs(k) - 1) if abs(k) <= 3 else 1.0) + 0.15 * _gone(node, name, k),
            )
        elif q == 1 and len(powers) == 2 and sum(powers.values()) == 0 and size <= 8:
            wrong = min(powers, key=powers.__getitem__)
            yield ("letter" if wrong in own else "combined"), wrong, factor, 0.02 * size
        elif (
            q == 1
            and len(powers) == 2
            and min(powers.values()) > 0
            and size <= 4
            and not own & set(powers)
        ):
            yield "lost-factor", " and ".join(powers), factor, 0.3
        else:
            yield "combined", "", factor, 0.1 * size

    def _powers(self, path: Path, node: Node, tau: Array) -> Iterator[Slip]:
        """A sum, a mean or a function in a wrong power."""
        base, own = (node.parts[0], node.data) if node.kind == POWER else (node, Fraction(1))
        if base.kind in (LETTER, NUMBER, PRODUCT):
            return
        for exponent in (1, 2, 3, 4, -1, -2, Fraction(1, 2)):
            other = power(base, exponent)
            if exponent != own and self._same(self.values.of(other), tau):
                yield Slip("power", path, changed(self.line, path, other))

    def _lost(self, path: Path, node: Node, rest: Array) -> Iterator[Slip]:
        for one, term, value in self.could_be_lost:
            for sign in (1, -1):
                if self._same(sign * value, rest):
                    repaired = changed(self.line, path, total(node, term, signs=(1, sign)))
                    yield Slip("lost", path, repaired, lost=one, extra=-0.01)
        if found := self._monomial(rest):
            q, powers = found
            if max(abs(q.numerator), q.denominator) <= 60:
                one = product(number(q), *(power(letter(name), k) for name, k in powers.items()))
                # in the sum where least is lost
                extra = 0.02 * sum(map(abs, powers.values())) + 0.1 * (node.kind != SUM)
                yield Slip(
                    "lost",
                    path,
                    changed(self.line, path, total(node, one)),
                    " and ".join(powers),
                    extra=extra,
                )

    @cached_property
    def could_be_lost(self) -> list[tuple[Node, Node, Array]]:
        """Terms of the line above, or of a mean in it: the term, what would have to be added, and
        the values of that."""
        terms = [
            one for path, one in walk(self.above) if path and at(self.above, path[:-1]).kind == SUM
        ]
        return [(one, new, self.values.of(new)) for one in terms for new in (one, mean(one))]

    def _moment_pairs(self) -> Iterator[tuple[Node, Node, int, tuple[Array, Array]]]:
        """Wrong and right moments of the normal law, with their values; of functions, too."""
        law = self.setting.law
        at_mean = {state: letter(law.means[i]) for i, state in enumerate(law.states)}
        for _, call in [*walk(self.line), *walk(self.above)]:
            if call.kind == CALL and call.data in ENTIRE and letters(call) & set(law.states):
                square, there = mean(power(call, 2)), replaced(call, at_mean)
                for both in (
                    (there, mean(call)),
                    (power(there, 2), square),
                    (power(mean(call), 2), square),
                ):
                    wrong, right = both[::-1] if self.mirrored else both
                    yield wrong, right, 0, (self.values.of(wrong), self.values.of(right))
        for i, x in enumerate(law.states):
            m, moment = letter(law.means[i]), [mean(power(letter(x), k)) for k in range(9)]
            for k in range(2, 9):
                central = mean(power(difference(letter(x), m), k))
                pairs = [(power(m, k), moment[k])]
                if k % 2 == 0:
                    pairs += [(central, moment[k]), (moment[k], central)]
                if k in (4, 6, 8):
                    square = power(moment[2], k // 2)
                    pairs += [
                        (square, moment[k]),
                        (product(number({4: 3, 6: 15, 8: 105}[k]), square), moment[k]),
                    ]
                    pairs += [
                        (power(letter(law.cov[i][i]), k // 2), one) for one in (central, moment[k])
                    ]
                if k == 4:
                    pairs += [(moment[4], difference(moment[4], power(moment[2], 2)))]
                for wrong, right in pairs:
                    if self.mirrored:
                        wrong, right = right, wrong
                    yield wrong, right, k, (self.values.of(wrong), self.values.of(right))

    # ---------------------------------------------------------------- noises

    def noise(self) -> Iterator[Slip]:
        """The line above with the mean square of a noise left out, or its mean taken as one."""
        mine = self.values.of(self.line)
        for name in self.setting.law.noises:
            if name not in letters(self.above):
                continue
            for kind, value in (("noise-forgotten", 0), ("noise-mean", 1)):
                other = replaced(self.above, {name: number(value)})
                if self._same(self.values.of(other), mine) and self._equal(self.line, other):
                    yield Slip(kind, (), self.above, name)

    # ---------------------------------------------------------------- tried

    def tried(self) -> Iterator[Slip]:
        """Changes of one node inside a mean or a function, where what it should be does not
        follow."""
        count = 0
        pool = sorted({*self.letters, *letters(self.line), *letters(self.above)})
        terms = [
            one
            for where, one in walk(self.above)
            if where and at(self.above, where[:-1]).kind == SUM
        ]
        for path, node in walk(self.line):
            if not any(
                at(self.line, path[:i]).kind in (MEAN, CALL, POWER) for i in range(len(path))
            ):
                continue
            for kind, name, new in _changes(node, pool, terms):
                count += 1
                if count > MOST_TRIED:
                    return
                other = changed(self.line, path, new)
                if self._same(self.values.of(other), self.target) and not self._nothing(
                    other, path, kind
                ):
                    yield Slip(kind, path, other, name)

    def _nothing(self, line: Node, path: Path, kind: str) -> bool:
        """Whether a change leaves nothing of the mean or the power around it: then that does not
        belong there as a whole.

        With a noise that was lost a mean may be zero, and rightly so.
        """
        outer = at(
            line,
            next(
                path[:i] for i in range(len(path)) if at(line, path[:i]).kind in (MEAN, CALL, POWER)
            ),
        )
        return bool(
            np.all(
                np.abs(self.values.of(outer.parts[0] if kind == "lost-factor" else outer)) <= 1e-9
            )
        )

    # ---------------------------------------------------------------- of the line above

    def misread(self) -> Iterator[Slip]:
        """What was made of one term of the line above, spread over several terms of this one."""
        for slip in _Search(self.setting, self.above, self.line, mirrored=True).solved():
            a_mean = at(self.above, slip.path).kind == MEAN and slip.kind in (
                "sign",
                "factor",
                "power",
                "letter",
            )
            if (slip.kind == "moment" or a_mean) and self._equal(slip.repaired, self.line):
                yield Slip(slip.kind, slip.path, self.above, slip.name, slip.order, above=True)


def _sign(root: Node, path: Path) -> int:
    """Of a term, in its sum."""
    return at(root, path[:-1]).data[path[-1]]


def _gone(node: Node, name: str, k: int) -> bool:
    """Whether nothing is left of a letter, or its power, times another power of it."""
    base, own = (node.parts[0], node.data) if node.kind == POWER else (node, 1)
    return base.kind == LETTER and base.data == name and own + k == 0


def _changes(
    node: Node, pool: Sequence[str], terms: Sequence[Node]
) -> Iterator[tuple[str, str, Node]]:
    """Changes of one node: kind of slip, letter, the new node."""
    if node.kind == SUM:
        for i in range(len(node.parts)):
            signs = tuple(-s if i == j else s for j, s in enumerate(node.data))
            yield "sign", "", Node(SUM, node.parts, signs)
            if len(node.parts) > 1:
                rest = [j for j in range(len(node.parts)) if j != i]
                yield (
                    "extra",
                    "",
                    Node(
                        SUM, tuple(node.parts[j] for j in rest), tuple(node.data[j] for j in rest)
                    ),
                )
    if node.kind == LETTER:
        yield from (("letter", node.data, letter(name)) for name in pool if name != node.data)
    if node.kind == POWER:
        yield from (
            ("power", _name(node.parts[0]), power(node.parts[0], k))
            for k in (1, 2, 3, 4, 5, 6)
            if k != node.data
        )
    elif node.kind != NUMBER:
        yield from (("power", _name(node), power(node, k)) for k in (2, 3))
    if node.kind == CALL:
        yield from (
            ("function", node.data, Node(CALL, node.parts, name))
            for name in ENTIRE
            if name != node.data
        )
    yield from (
        ("factor", "", product(number(q), node))
        for q in map(Fraction, ("2", "1/2", "3", "1/3", "4", "1/4", "6", "1/6"))
    )
    if node.kind == PRODUCT:
        for i, one in enumerate(node.parts):
            inner = tuple(number(1) if i == j else part for j, part in enumerate(node.parts))
            yield "extra", _name(one), Node(PRODUCT, inner, node.data)
    yield from (("lost-factor", name, product(letter(name), node)) for name in pool)
    yield from (
        ("lost", "", total(node, one, signs=(1, sign))) for one in terms for sign in (1, -1)
    )


def _name(node: Node) -> str:
    return node.data if node.kind == LETTER else ""
