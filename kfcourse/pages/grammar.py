r"""The grammar of relations in LaTeX: sums of products of factors, read into functions that compute them.

A function takes the values of the indices and of the variables of integration, by their names.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import product
from typing import Any, TypeAlias

import numpy as np

from kfcourse.pages.tex import CLOSE, OPEN, RELATIONS, normal
from kfcourse.pages.values import (
    Indexed,
    Of,
    Operator,
    Unread,
    Value,
    added,
    bell,
    filled,
    inverse,
    multiplied,
    number_of,
    raised,
    root,
    transposed,
    whole,
)

Letters: TypeAlias = Mapping[str, Any]
Side: TypeAlias = Callable[[dict[str, Any]], Value]

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    r"\sin": np.sin, r"\cos": np.cos, r"\tan": np.tan, r"\sinh": np.sinh, r"\cosh": np.cosh, r"\coth": lambda x: 1 / np.tanh(x),
    r"\exp": np.exp, r"\ln": np.log, r"\det": np.linalg.det, r"\max": np.maximum, r"\min": np.minimum,
    r"\operatorname{sign}": np.sign,
}  # fmt: skip
_NUMBERS = {r"\pi": np.pi, "e": np.e, r"\infty": np.inf}
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(400)
_FAR = 12.0  # stands for infinity in integrals and, ten times, in sums: what is integrated there decays as a normal density


class Reader:
    """A parser by recursive descent: each method reads a part of the text and returns what computes its value."""

    def __init__(self, text: list[str], letters: Letters) -> None:
        self.text, self.letters, self.place = text, letters, 0
        keys = sorted(((normal(key).split(), key) for key in letters), key=lambda pair: -len(pair[0]))
        self.keys = [*keys, *(([*normal(key).split()], key) for key in _FUNCTIONS if key not in letters)]
        self.bound: list[str] = []  # variables of the integrals around
        self.indices: list[str] = []  # indices in the order of their first use
        self.summed: list[str] = []
        self.stop: list[str | None] = []
        self.bars: list[str] = []  # what is open around: a "group", "arguments", a "value" between bars
        self.braced: list[tuple[Side, Side]] = []

    @property
    def next(self) -> str:
        return self.text[self.place] if self.place < len(self.text) else ""

    def take(self, expected: str = "") -> str:
        if not self.next or (expected and self.next != expected):
            raise Unread(
                f"{expected or 'more'} expected before {' '.join(self.text[self.place :]) or 'the end'}: {' '.join(self.text)}"
            )
        self.place += 1
        return self.text[self.place - 1]

    def chain(self) -> tuple[list[Side], list[str], list[str]]:
        changed = r"\leftarrow" in self.text
        if changed:  # the left side is the letter's new value
            cut = self.text.index(r"\leftarrow")
            new = " ".join([*self.text[:cut], r"\leftarrow"])
            value = next((v for key, v in self.letters.items() if normal(key) == new), None)
            if value is None:
                raise Unread(f"no value for {new}")
            self.place = cut + 1
            sides, signs = [self._entered(value, "")], ["="]
            sides.append(self.sum_of_terms())
        else:
            sides, signs = [self.sum_of_terms()], []
        while self.next in RELATIONS:
            signs.append(self.take())
            sides.append(self.sum_of_terms())
        if self.next:
            raise Unread(f"cannot read {' '.join(self.text[self.place :])} in {' '.join(self.text)}")
        if not signs:
            raise Unread(f"no relation: {' '.join(self.text)}")
        return sides, signs, list(dict.fromkeys(self.indices))

    def sum_of_terms(self) -> Side:
        terms = []
        sign = -1 if self.next == "-" else 1
        if self.next in ("+", "-"):
            self.take()
        terms.append((sign, self.product()))
        while self.next in ("+", "-"):
            sign = -1 if self.take() == "-" else 1
            terms.append((sign, self.product()))

        def total(at: dict[str, Any]) -> Value:
            value = terms[0][0] * terms[0][1](at)
            for sign, term in terms[1:]:
                value = added(value, sign * term(at))
            return value

        return total if terms[1:] or terms[0][0] < 0 else terms[0][1]

    def product(self) -> Side:
        factors: list[tuple[bool, Side]] = [(False, self.factor())]
        while True:
            divided = self.next == "/"
            if self.next in ("/", r"\cdot", r"\times"):
                self.take()
            elif not self._starts_factor():
                break
            factors.append((divided, self.factor()))

        def total(at: dict[str, Any]) -> Value:
            value = factors[0][1](at)
            for divided, factor in factors[1:]:
                value = value / number_of(factor(at)) if divided else multiplied(value, factor(at))
            return value

        return total if factors[1:] else factors[0][1]

    def _starts_factor(self) -> bool:
        one = self.next
        if one == "|":  # opens, unless it closes or separates arguments
            return self.bars[-1:] in ([], ["group"])
        if not one or one in RELATIONS or one in CLOSE or one in {"}", "+", "-", ",", ";", "&", r"\\", r"\end"}:
            return False
        return not (one == "d" and self.stop and self.stop[-1] and self._differential(self.place))

    def _differential(self, place: int) -> bool:
        variable = (self.stop[-1] or "").split()
        return self.text[place + 1 : place + 1 + len(variable)] == variable

    def factor(self) -> Side:
        bracketed = self.next in OPEN
        base = self.atom()
        if bracketed and self.next == "_":  # a column of a matrix, counted from one
            self.take()
            base = self._column(base, self._inside(self._group()))
        while self.next == "^":
            self.take()
            base = self._power(base, self._group())
        if self.next == "|" and self._after(1) == "_":  # where it is taken: for the letters to know
            self.place += 2
            self._group()
        return base

    def _column(self, matrix: Side, number: Side) -> Side:
        return lambda at: matrix(at)[:, [whole(number(at)) - 1]]

    def _power(self, base: Side, exponent: list[str]) -> Side:
        text = "".join(exponent)
        if text == "T":
            return lambda at: transposed(base(at))
        if text == "-T":
            return lambda at: transposed(inverse(base(at)))
        if text == "-1":
            return lambda at: inverse(base(at))
        if text == "1/2":
            return lambda at: root(base(at))
        if text == "-1/2":
            return lambda at: inverse(root(base(at)))
        power = self._inside(exponent)
        return lambda at: raised(base(at), power(at))

    def _group(self) -> list[str]:
        """The tokens of an argument: in braces, or the next one."""
        if self.next != "{":
            return [self.take()]
        self.take("{")
        depth, start = 1, self.place
        while depth:
            one = self.take()
            depth += (one == "{") - (one == "}")
        return self.text[start : self.place - 1]

    def _inside(self, text: list[str]) -> Side:
        """A part of the text, read by itself with the same letters."""
        around, self.text, self.place = (self.text, self.place), text, 0
        with self._within("group"):
            side = self.sum_of_terms()
        if self.next:
            raise Unread(f"cannot read {' '.join(text)}")
        self.text, self.place = around
        return side

    def atom(self) -> Side:
        one = self.next
        found = self._letter()
        if found is not None:
            return found
        if one.isdigit():
            number = ""
            while self.next.isdigit() or (
                self.next == "." and self.text[self.place + 1 : self.place + 2] and self.text[self.place + 1].isdigit()
            ):
                number += self.take()
            return lambda at: float(number)
        if one in OPEN:
            self.take()
            with self._within("group"):
                side = self.sum_of_terms()
            self.take(OPEN[one])
            return side
        if one == "{":
            return self._inside(self._group())
        if one == "|":
            self.take()
            with self._within("value"):
                side = self.sum_of_terms()
            self.take("|")
            return lambda at: np.abs(side(at))
        if one == r"\frac":
            self.take()
            above, below = self._inside(self._group()), self._inside(self._group())
            return lambda at: above(at) / number_of(below(at))
        if one == r"\sqrt":
            self.take()
            under = self._inside(self._group())
            return lambda at: np.sqrt(under(at))
        if one == r"\underbrace":
            self.take()
            side = self._inside(self._group())
            self.take("_")
            self.braced.append((side, self._inside(self._group())))
            return side
        if one == r"\begin":
            return self._matrix()
        if one in (r"\sum", r"\prod"):
            return self._sum(self.take() == r"\sum")
        if one == r"\int":
            return self._integral()
        if one == r"\mathcal" and self.text[self.place + 1] == "N":
            self.place += 2
            arguments = self._arguments()
            return lambda at: bell(*(argument(at) for argument in arguments))
        if one in _NUMBERS:
            self.take()
            return lambda at: _NUMBERS[one]
        raise Unread(f"no value for {' '.join(self.text[self.place : self.place + 4]) or 'the end'} in {' '.join(self.text)}")

    def _letter(self) -> Side | None:
        for variable in self.bound:
            words = variable.split()
            if self._fits(words) and self._after(len(words)) not in ("_", "'"):
                self.place += len(words)
                return lambda at: at[variable]
        for words, key in self.keys:
            if not self._fits(words):
                continue
            value = self.letters[key] if key in self.letters else _FUNCTIONS[key]
            follows = self._after(len(words))
            if follows == "'" or (follows == "_" and not isinstance(value, Indexed)):
                continue
            if isinstance(value, Indexed) and follows != "_":
                if value.plain is None:
                    continue
                value = value.plain
            self.place += len(words)
            return self._entered(value, key)
        return None

    def _fits(self, words: list[str]) -> bool:
        return self.text[self.place : self.place + len(words)] == words

    def _after(self, count: int) -> str:
        return self.text[self.place + count] if self.place + count < len(self.text) else ""

    def _entered(self, value: Any, key: str) -> Side:
        """What a letter stands for; arguments and indices are read with it."""
        if isinstance(value, range):
            return self._index(key)
        if isinstance(value, Of):
            for name in value.letters:
                if isinstance(self.letters.get(_key(self.letters, name)), range):
                    self._index(name)
            return lambda at: value.function(
                *(at[one] if one in at else self.letters[_key(self.letters, one)] for one in value.letters)
            )
        if isinstance(value, Indexed):
            self.take("_")
            indices = self._subscript(self._group())
            found: Side = lambda at: value[tuple(whole(index(at)) for index in indices)]  # noqa: E731
            return self._applied(found) if callable(_sample(value)) and self._is_call() else found
        if isinstance(value, Operator):
            argument = self.product()
            return lambda at: value.function(argument(at))
        if callable(value):
            return self._applied(lambda at: value)
        return lambda at: value

    def _index(self, key: str) -> Side:
        if key not in self.summed:
            self.indices.append(key)
        return lambda at: at[key]

    def _subscript(self, text: list[str]) -> list[Side]:
        cut = next((place for place, one in enumerate(text) if one in (",", "|")), 0)
        if cut:
            return [self._inside(text[:cut]), *self._subscript(text[cut + 1 :])]
        if len(text) > 1 and all(self._is_index(one) or one.isdigit() for one in text):
            return [self._inside([one]) for one in text]
        return [self._inside(text)]

    def _is_index(self, one: str) -> bool:
        return isinstance(self.letters.get(one), range)

    def _is_call(self) -> bool:
        """Does a bracket follow, perhaps after a power?"""
        return self.next in ("(", "[") or (self.next == "^" and self._after(2) in ("(", "["))

    def _applied(self, function: Side) -> Side:
        power, turned = None, False
        if self.next == "^" and self._after(1) == "T" and self._after(2) == "(":
            self.place += 2
            turned = True
        elif self.next == "^" and self._after(1) not in ("T", "{"):
            self.take()
            power = self._inside(self._group())
        if self.next in ("(", "["):
            arguments = self._arguments()
            call: Side = lambda at: function(at)(*(argument(at) for argument in arguments))  # noqa: E731
        elif self._starts_factor():  # a function without brackets: all that is multiplied after it
            argument = self.product()
            call = lambda at: function(at)(argument(at))  # noqa: E731
        else:
            return function
        if turned:
            return lambda at: transposed(call(at))
        return call if power is None else lambda at: raised(call(at), power(at))

    def _arguments(self) -> list[Side]:
        close = OPEN[self.take()]
        with self._within("arguments"):
            arguments = [self.sum_of_terms()]
            while self.next in (",", ";", "|"):
                self.take()
                arguments.append(self.sum_of_terms())
        self.take(close)
        return arguments

    @contextmanager
    def _within(self, bracket: str) -> Iterator[None]:
        """Inside a bracket a d is no differential of the integral around, and a bar closes or separates."""
        self.stop.append(None)
        self.bars.append(bracket)
        yield
        self.stop.pop()
        self.bars.pop()

    def _matrix(self) -> Side:
        self.place += 1
        name = self._group()
        rows: list[list[Side]] = [[]]
        while True:
            rows[-1].append(self.sum_of_terms())
            if (mark := self.take()) == r"\\":
                rows.append([])
            elif mark == r"\end":
                break
        if self._group() != name:
            raise Unread("a matrix that does not end")
        return lambda at: np.block(filled([[np.atleast_2d(entry(at)) for entry in row] for row in rows]))

    def _sum(self, adding: bool) -> Side:
        limits: dict[str, list[str]] = {"_": [], "^": []}
        while self.next in ("_", "^"):
            side = self.take()
            limits[side] = self._group()
        below = limits["_"]
        index, start, stop = (below[0] if below else ""), None, None
        if len(below) > 1:
            start = self._inside(below[2:])
        if limits["^"]:
            stop = self._inside(limits["^"])
        first = len(self.indices)
        if index:
            self.summed.append(index)
            if start is not None and index not in self.letters:
                self.letters = {**self.letters, index: range(0)}
                self.keys.insert(0, ([index], index))
        body = self.product()
        if index:
            self.summed.remove(index)
            over = [index]
        else:
            over = list(dict.fromkeys(self.indices[first:]))
            self.indices = self.indices[:first]

        def total(at: dict[str, Any]) -> Value:
            begin = None if start is None else whole(start(at))
            if begin is None:
                choices: Iterable[tuple[int, ...]] = product(*(self.letters[one] for one in over))
            else:
                last = int(10 * _FAR) if stop is None else whole(stop(at))
                choices = ((one,) for one in range(begin, last + 1))
            values = [body(at | dict(zip(over, chosen, strict=True))) for chosen in choices]
            return sum(values[1:], values[0]) if adding else np.prod(values)

        return total

    def _integral(self) -> Side:
        self.take(r"\int")
        limits: dict[str, list[str]] = {"_": ["-", r"\infty"], "^": [r"\infty"]}
        while self.next in ("_", "^"):
            side = self.take()
            limits[side] = self._group()
        low, high = self._inside(limits["_"]), self._inside(limits["^"])
        variable = self._variable()
        self.bound.append(variable)
        self.stop.append(variable)
        body = self.product()
        self.stop.pop()
        self.bound.remove(variable)
        self.take("d")
        self.place += len(variable.split())

        def total(at: dict[str, Any]) -> Value:
            a, b = np.clip([low(at), high(at)], -_FAR, _FAR)
            nodes = (a + b) / 2 + (b - a) / 2 * _NODES
            return (b - a) / 2 * float(np.sum(_WEIGHTS * body(at | {variable: nodes})))

        return total

    def _variable(self) -> str:
        """The variable of the integral that begins here: what follows the next d outside of brackets."""
        depth = 0
        for place in range(self.place, len(self.text)):
            one = self.text[place]
            depth += (one in OPEN or one == "{") - (one in CLOSE or one == "}")
            if one == "d" and depth == 0 and place + 1 < len(self.text):
                end = place + 2
                if end < len(self.text) and self.text[end] == "_":
                    end += 2
                    if self.text[end - 1] == "{":
                        while self.text[end - 1] != "}":
                            end += 1
                return " ".join(self.text[place + 1 : end])
        raise Unread(f"an integral without its d: {' '.join(self.text)}")


def _key(letters: Letters, words: str) -> str:
    return next((key for key in letters if normal(key) == words), words)


def _sample(value: Indexed) -> Any:
    found: Any = value.values
    return (lambda: 0) if not callable(found) and callable(_first(found)) else None


def _first(values: Any) -> Any:
    while isinstance(values, list | tuple) and values:
        values = values[0]
    return values
