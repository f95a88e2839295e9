r"""Reads a relation as it is printed, in LaTeX, and computes its sides while it reads them.

::

    holds(r"p_k=(I-K_kH)\Psi_k", {"p": Indexed(p), ..., "H": H, "I": I, "k": range(1, 4)})

The letters are numbers: floats, matrices (n, m) (a column is (n, 1)), functions, `Indexed` values,
`At` for functions that have a value without brackets, a `range` for an index that runs, `Of` for
what depends on an index or on a variable of integration.
A letter may be any piece of LaTeX (`p(x_k\mid y_{0:k})`): the longest that fits is taken.  Read are
+ - / products and powers, ^T and ^{-1}, functions, \frac, \sqrt, |x|, matrices, \sum, \prod and
\int, and the relations = \approx \le \ge < > \propto \leftarrow.  What is written z\leftarrow on
the left is the letter `z\leftarrow`, the new value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from gate.tex import CLOSE, OPEN, RELATIONS, normal
from gate.values import (
    At,
    Indexed,
    Of,
    Operator,
    Unread,
    Value,
    added,
    bell,
    block,
    divided,
    inverse,
    multiplied,
    raised,
    root,
    transposed,
    whole,
)
from kfcourse.pages import Unverified

Letters: TypeAlias = Mapping[str, Any]
ROUNDING = 1e-8  # relative, of a few dozen operations on matrices of condition 1e6
ROUGH = 0.1  # relative, what \approx allows
FAR = 12.0  # stands for infinity in integrals and, ten times, in sums: densities decay before
NODES, WEIGHTS = np.polynomial.legendre.leggauss(400)
FUNCTIONS: dict[str, Any] = {
    r"\sin": np.sin, r"\cos": np.cos, r"\tan": np.tan, r"\sinh": np.sinh, r"\cosh": np.cosh,
    r"\coth": lambda x: 1 / np.tanh(x), r"\exp": np.exp, r"\ln": np.log, r"\det": np.linalg.det,
    r"\max": np.maximum, r"\min": np.minimum, r"\operatorname{sign}": np.sign,
    r"\mathcal N": bell, r"\pi": np.pi, "e": np.e, r"\infty": np.inf,
}  # fmt: skip
POWERS = {
    "T": transposed,
    "-T": lambda value: transposed(inverse(value)),
    "-1": inverse,
    "1/2": root,
    "-1/2": lambda value: inverse(root(value)),
}
ERRORS = (TypeError, ValueError, AttributeError, LookupError, np.linalg.LinAlgError)
Chain: TypeAlias = tuple[list[Value], list[str], list[tuple[Value, Value]]]


class Free(Exception):
    """An index that nothing has set yet."""

    def __init__(self, index: str) -> None:
        self.index = index


class Key(NamedTuple):
    """A letter, as tokens and as it is written, with its value."""

    words: list[str]
    name: str
    value: Any


def keys_of(letters: Letters) -> list[Key]:
    """The letters, the longest first, and below them the functions and numbers that all pages
    know."""
    own = [Key(normal(name).split(), name, value) for name, value in letters.items()]
    known = [Key(normal(name).split(), name, value) for name, value in FUNCTIONS.items()]
    return sorted(own, key=lambda key: -len(key.words)) + [
        key for key in known if key.name not in letters
    ]


class Reader:
    """A parser by recursive descent: each method reads a part of the text and returns its value.

    What cannot be computed is NaN, and the first reason `failed`: the rest is read all the same, as
    a letter without a value weighs more than a shape that does not fit.
    """

    def __init__(
        self, text: list[str], keys: list[Key], at: Mapping[str, Any] | None = None
    ) -> None:
        self.text, self.keys, self.at, self.place = text, keys, dict(at or {}), 0
        self.bound: tuple[str, ...] = ()  # variables of the integrals around
        # the variable whose d ends what is read, "" inside a bracket
        self.ends: tuple[str, ...] = ()
        self.summed: tuple[str, ...] = ()  # indices of the sums around that name none
        # what is open: a "group", "arguments", a "value" between bars
        self.bars: tuple[str, ...] = ()
        self.braced: list[tuple[Value, Value]] = []
        self.failed: Exception | None = None

    @property
    def next(self) -> str:
        return self._after(0)

    def _after(self, count: int) -> str:
        return self.text[self.place + count] if self.place + count < len(self.text) else ""

    def _follows(self, words: list[str]) -> bool:
        return self.text[self.place : self.place + len(words)] == words

    def take(self, expected: str = "") -> str:
        if not self.next or (expected and self.next != expected):
            rest = " ".join(self.text[self.place :]) or "the end"
            raise Unread(f"{expected or 'more'} expected before {rest}: {' '.join(self.text)}")
        self.place += 1
        return self.text[self.place - 1]

    def compute(self, function: Callable[..., Value], *values: Value) -> Value:
        try:
            return function(*values)
        except Unread:
            raise
        except (*ERRORS, Unverified) as error:
            self.failed = self.failed or error
        return np.nan

    def chain(self) -> Chain:
        """The sides, the signs between them, and the pairs of underbraces."""
        if r"\leftarrow" in self.text:  # the left side is the letter's new value
            self.place = self.text.index(r"\leftarrow") + 1
            new = self.text[: self.place]
            key = next((key for key in self.keys if key.words == new), None)
            if key is None:
                raise Unread(f"no value for {' '.join(new)}")
            sides, signs = [self._entered(key), self.total()], ["="]
        else:
            sides, signs = [self.total()], []
        while self.next in RELATIONS:
            signs.append(self.take())
            sides.append(self.total())
        if self.next or not signs:
            raise Unread(
                f"cannot read {' '.join(self.text[self.place :]) or 'as a relation'} in "
                f"{' '.join(self.text)}"
            )
        if self.failed:
            raise Unverified(
                f"cannot be computed, {self.failed}: {' '.join(self.text)}"
            ) from self.failed
        return sides, signs, self.braced

    def total(self) -> Value:
        """A sum of terms."""
        minus = self.next in ("+", "-") and self.take() == "-"
        value = self.product()
        if minus:
            value = self.compute(np.negative, value)
        while self.next in ("+", "-"):
            minus = self.take() == "-"
            term = self.product()
            value = self.compute(added, value, self.compute(np.negative, term) if minus else term)
        return value

    def product(self) -> Value:
        value = self.factor()
        while True:
            operation = divided if self.next == "/" else multiplied
            if self.next in ("/", r"\cdot", r"\times"):
                self.take()
            elif not self._starts_factor():
                return value
            value = self.compute(operation, value, self.factor())

    def _starts_factor(self) -> bool:
        token = self.next
        if token == "|":  # opens, unless it closes or separates arguments
            return self.bars[-1:] in ((), ("group",))
        if (
            not token
            or token in RELATIONS
            or token in CLOSE
            or token in {"}", "+", "-", ",", ";", "&", r"\\", r"\end"}
        ):
            return False
        variable = self.ends[-1].split() if self.ends else []
        return not (token == "d" and variable and self._follows(["d", *variable]))

    def factor(self) -> Value:
        bracketed = self.next in OPEN
        value = self.atom()
        if bracketed and self.next == "_":  # a column of a matrix, counted from one
            self.take()
            value = self.compute(
                lambda matrix, number: matrix[:, [whole(number) - 1]],
                value,
                self._inside(self._group()),
            )
        while self.next == "^":
            self.take()
            value = self._power(value, self._group())
        if self.next == "|" and self._after(1) == "_":  # where it is taken: for the letters to know
            self.place += 2
            self._group()
        return value

    def _power(self, value: Value, exponent: list[str]) -> Value:
        if operation := POWERS.get("".join(exponent)):
            return self.compute(operation, value)
        return self.compute(raised, value, self._inside(exponent))

    def _group(self) -> list[str]:
        """The tokens of an argument: in braces, or the next one."""
        if self.next != "{":
            return [self.take()]
        self.take("{")
        depth, start = 1, self.place
        while depth:
            token = self.take()
            depth += (token == "{") - (token == "}")
        return self.text[start : self.place - 1]

    @contextmanager
    def _within(self, bracket: str) -> Iterator[None]:
        """Inside a bracket a d is no differential of the integral around, and a bar closes or
        separates."""
        before = self.ends, self.bars
        self.ends, self.bars = (*self.ends, ""), (*self.bars, bracket)
        yield
        self.ends, self.bars = before

    def _inside(self, text: list[str]) -> Value:
        """A part of the text, read by itself with the same letters."""
        around = self.text, self.place
        self.text, self.place = text, 0
        with self._within("group"):
            value = self.total()
        if self.next:
            raise Unread(f"cannot read {' '.join(text)}")
        self.text, self.place = around
        return value

    def atom(self) -> Value:
        token = self.next
        for variable in self.bound:
            words = variable.split()
            if self._follows(words) and self._after(len(words)) not in ("_", "'"):
                self.place += len(words)
                return self.at[variable]
        if (key := self._letter()) is not None:
            self.place += len(key.words)
            return self._entered(key)
        if token.isdigit():
            return self._digits()
        if token in OPEN or token == "|":
            self.take()
            with self._within("value" if token == "|" else "group"):
                value = self.total()
            self.take(OPEN.get(token, "|"))
            return self.compute(np.abs, value) if token == "|" else value
        if token == "{":
            return self._inside(self._group())
        if token in (r"\frac", r"\sqrt"):
            self.take()
            value = self._inside(self._group())
            if token == r"\sqrt":
                return self.compute(np.sqrt, value)
            return self.compute(divided, value, self._inside(self._group()))
        if token == r"\underbrace":
            self.take()
            value = self._inside(self._group())
            self.take("_")
            self.braced.append((value, self._inside(self._group())))
            return value
        if token == r"\begin":
            return self._matrix()
        if token in (r"\sum", r"\prod"):
            return self._sum()
        if token == r"\int":
            return self._integral()
        rest = " ".join(self.text[self.place : self.place + 4]) or "the end"
        raise Unread(f"no value for {rest} in {' '.join(self.text)}")

    def _digits(self) -> float:
        number = self.take()
        while self.next.isdigit() or (self.next == "." and self._after(1).isdigit()):
            number += self.take()
        return float(number)

    def _letter(self) -> Key | None:
        """The longest letter that begins here; one with an index only where an index follows."""
        for key in self.keys:
            if not self._follows(key.words):
                continue
            follows = self._after(len(key.words))
            if isinstance(key.value, Indexed):
                if follows == "_":
                    return key
                key = key._replace(value=key.value.plain)
            if isinstance(key.value, At):
                called = self._is_call(len(key.words))
                key = key._replace(value=key.value.function if called else key.value.plain)
            if key.value is not None and follows not in ("'", "_"):
                return key
        return None

    def _entered(self, key: Key) -> Value:
        """What a letter stands for; arguments and indices are read with it."""
        value = key.value
        if isinstance(value, range):
            return self._set(key.name)
        if isinstance(value, Of):
            return self.compute(value.function, *map(self._moved, value.letters))
        if isinstance(value, Indexed):
            self.take("_")
            indices = self._subscript(self._group())
            value = self.compute(lambda *places: key.value[tuple(map(whole, places))], *indices)
            if isinstance(value, At):
                value = value.function if self._is_call() else value.plain
            return self._applied(value) if callable(value) and self._is_call() else value
        if isinstance(value, Operator):
            return self.compute(value.function, self.product())
        return self._applied(value) if callable(value) else value

    def _set(self, index: str) -> Value:
        if index not in self.at:
            raise Free(index)
        return self.at[index]

    def _moved(self, name: str) -> Value:
        words = normal(name)
        if words in self.at:
            return self.at[words]
        key = next(key for key in self.keys if key.words == words.split())
        return self._set(key.name) if isinstance(key.value, range) else key.value

    def _subscript(self, text: list[str]) -> list[Value]:
        cut = next((place for place, token in enumerate(text) if token in (",", "|")), 0)
        if cut:
            return [self._inside(text[:cut]), *self._subscript(text[cut + 1 :])]
        running = {key.name for key in self.keys if isinstance(key.value, range)} | set(self.at)
        if len(text) > 1 and all(token in running or token.isdigit() for token in text):
            return [self._inside([token]) for token in text]
        return [self._inside(text)]

    def _is_call(self, words: int = 0) -> bool:
        """Does a bracket follow so many words, perhaps after a power?"""
        follows = self._after(words)
        return follows in ("(", "[") or (follows == "^" and self._after(words + 2) in ("(", "["))

    def _applied(self, function: Callable[..., Any]) -> Value:
        power: list[str] = []
        if self.next == "^" and (
            self._after(1) not in ("T", "{") or (self._after(1) == "T" and self._after(2) == "(")
        ):
            self.take()
            power = self._group()
        if self.next in ("(", "["):
            value = self.compute(function, *self._arguments())
        elif self._starts_factor():  # without brackets: of all that is multiplied after it
            value = self.compute(function, self.product())
        else:
            return function
        return self._power(value, power) if power else value

    def _arguments(self) -> list[Value]:
        close = OPEN[self.take()]
        with self._within("arguments"):
            arguments = [self.total()]
            while self.next in (",", ";", "|"):
                self.take()
                arguments.append(self.total())
        self.take(close)
        return arguments

    def _matrix(self) -> Value:
        self.take(r"\begin")
        name = self._group()
        rows: list[list[Value]] = [[]]
        while True:
            rows[-1].append(self.total())
            if (mark := self.take()) == r"\\":
                rows.append([])
            elif mark == r"\end":
                break
        if self._group() != name:
            raise Unread("a matrix that does not end")
        return self.compute(block, rows)

    def _limits(self) -> dict[str, list[str]]:
        limits = {}
        while self.next in ("_", "^"):
            side = self.take()
            limits[side] = self._group()
        return limits

    def _sum(self) -> Value:
        adding, limits = self.take() == r"\sum", self._limits()
        index, *start = limits.get("_", [""])
        if start:
            last = whole(self._inside(limits["^"])) if "^" in limits else int(10 * FAR)
            terms = self._terms(index, range(whole(self._inside(start[1:])), last + 1))
        elif index:
            values = next((key.value for key in self.keys if key.name == index), None)
            if not isinstance(values, range):
                raise Unread(f"no values for the index {index}")
            terms = self._terms(index, values)
        else:
            around = {name: self.at.pop(name) for name in self.summed if name in self.at}
            terms = self._over_free()
            self.at |= around
        return self.compute(lambda: sum(terms[1:], terms[0]) if adding else np.prod(terms))

    def _terms(self, index: str, values: range) -> list[Value]:
        """The product that follows, read again for each value of the index."""
        begin, terms = self.place, []
        outer, keys = self.at.get(index), self.keys
        self.keys = [Key([index], index, values), *keys]
        for value in values:
            self.place, self.at[index] = begin, value
            terms.append(self.product())
        self.keys = keys
        del self.at[index]
        if outer is not None:
            self.at[index] = outer
        return terms

    def _over_free(self) -> list[Value]:
        """The product that follows, over all its indices that nothing has set."""
        before = {name: value for name, value in self.__dict__.items() if name != "braced"}
        at = dict(self.at)
        try:
            return [self.product()]
        except Free as free:
            self.__dict__ |= before | {"at": at}
            values = next(key.value for key in self.keys if key.name == free.index)
            self.summed, terms = (*self.summed, free.index), []
            for value in values:
                self.place, self.at[free.index] = before["place"], value
                terms += self._over_free()
            self.summed = before["summed"]
            self.at.pop(free.index, None)
            return terms

    def _integral(self) -> Value:
        self.take(r"\int")
        limits = {"_": ["-", r"\infty"], "^": [r"\infty"]} | self._limits()
        a, b = (np.clip(self._inside(limits[side]), -FAR, FAR) for side in ("_", "^"))
        variable = self._variable()
        around = self.bound, self.ends
        self.bound, self.ends = (*self.bound, variable), (*self.ends, variable)
        inner = np.ndim(a + b) > 0  # a limit is a variable of the integral around
        nodes, weights = (each[:, None, None] if inner else each for each in (NODES, WEIGHTS))
        self.at[variable] = (a + b) / 2 + (b - a) / 2 * nodes
        body = self.product()
        del self.at[variable]
        self.bound, self.ends = around
        self.take("d")
        self.place += len(variable.split())
        return self.compute(lambda: (b - a) / 2 * np.sum(weights * body, axis=0).squeeze())

    def _variable(self) -> str:
        """The variable of the integral that begins here: what follows the next d outside of
        brackets."""
        depth = 0
        for place in range(self.place, len(self.text) - 1):
            token = self.text[place]
            depth += (token in OPEN or token == "{") - (token in CLOSE or token == "}")
            if token == "d" and depth == 0:
                end = place + 2
                if self.text[end : end + 1] == ["_"]:
                    end += 2
                    while self.text[place + 3] == "{" and self.text[end - 1] != "}":
                        end += 1
                return " ".join(self.text[place + 1 : end])
        raise Unread(f"an integral without its d: {' '.join(self.text)}")


def chains(
    text: list[str], letters: Letters, keys: list[Key], at: Mapping[str, Any]
) -> Iterator[tuple[Mapping[str, Any], Chain]]:
    """The sides for every value of the indices that run."""
    try:
        chain = Reader(text, keys, at).chain()
    except Free as free:
        for value in letters[free.index]:
            yield from chains(text, letters, keys, {**at, free.index: value})
        return
    yield at, chain


def holds(relation: str, letters: Letters) -> None:
    r"""Compute the sides of a relation for every value of its indices, and compare them.

    |l - r| <= `ROUNDING` * the scale of their terms; with \approx `ROUGH` takes its place.

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
            holds(text.replace(r"\pm", sign), letters)
        return
    first: list[Value] = []
    for at, (sides, signs, braced) in chains(text.split(), letters, keys_of(letters), {}):
        for (left, right), sign in zip(pairwise(sides), signs, strict=True):
            if sign != r"\propto":
                _compare(relation, left, right, sign, at)
        first = first or sides
        if r"\propto" in signs:  # one factor for all
            _compare(relation, sides[0] * first[1], sides[1] * first[0], "=", at)
        for left, right in braced:
            _compare(relation, left, right, "=", at)


def _compare(text: str, left: Value, right: Value, sign: str, at: Mapping[str, Any]) -> None:
    if any(callable(side) and not isinstance(side, np.ndarray) for side in (left, right)):
        raise Unread(f"a function without its arguments: {text}")
    left, right = np.asarray(left, float), np.asarray(right, float)
    if left.size == 1:
        left, right = left.ravel(), right.ravel()
    elif right.size == 1 and not right.any():
        right = np.zeros_like(left)
    if left.shape != right.shape:
        raise Unverified(f"a side {left.shape} cannot equal one of {right.shape}: {text}")
    size = np.max(np.abs(right))
    bound = ROUGH * max(np.max(np.abs(left)), size) if sign == r"\approx" else ROUNDING * (1 + size)
    off = left - right
    signs = {r"\le": off <= bound, "<": off < 0, r"\ge": off >= -bound, ">": off > 0}
    if not np.all(signs.get(sign, np.abs(off) <= bound)):
        where = f" at {dict(at)}" if at else ""
        raise Unverified(f"does not hold{where}: {text}\n  left:  {left}\n  right: {right}")
