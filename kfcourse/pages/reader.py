r"""Reads a relation as it is printed, in LaTeX, and computes both of its sides.

    holds(r"p_k=(I-K_kH)\Psi_k", {"p": Indexed(p), "K": Indexed(K), "H": H, "I": I, r"\Psi": Indexed(Psi), "k": range(1, 4)})

The letters are given numbers: floats, matrices (n, m) (a column is (n, 1)), functions of Python, `Indexed` values for letters
with an index, a `range` for an index that runs, `Of` for what depends on a variable of integration.  A letter may be any piece
of LaTeX (`p(x_k\mid y_{0:k})`, `\frac{\partial S}{\partial x}`): the longest that fits is taken.  Read are + - / products and
powers, ^T and ^{-1}, functions, \frac, \sqrt, |x|, matrices, \sum, \prod and \int, and the relations = \approx \le \ge < >
\propto \leftarrow.  What is written z\leftarrow on the left is the letter `z\leftarrow`, the new value.
Products of matrices keep their order, and shapes must fit: a transposition that is missing is found.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import pairwise, product
from typing import Any, TypeAlias

import numpy as np

from kfcourse.pages.verification import Unverified

Letters: TypeAlias = Mapping[str, Any]
Value: TypeAlias = Any
_Side: TypeAlias = Callable[[dict[str, Any]], Value]

RELATIONS = {"=", r"\approx", r"\le", r"\ge", "<", ">", r"\propto", r"\leftarrow"}
_OTHERS = {r"\sim", r"\ll", r"\gg", r"\to", r"\in", r"\ne", r"\gtrsim", r"\lesssim"}  # not computed
_TOKEN = re.compile(r"\\[a-zA-Z]+|\\.|[^\s]", re.DOTALL)
_SPACE = {r"\,", r"\;", r"\!", r"\:", r"\ ", "~", r"\displaystyle", r"\textstyle", r"\nonumber", r"\left", r"\right", r"\middle"}
_SPACE |= {rf"\{size}{side}" for size in ("big", "Big", "bigg", "Bigg") for side in ("", "l", "r", "m")}
_SAME = {
    r"\dfrac": r"\frac",
    r"\tfrac": r"\frac",
    r"\mid": "|",
    r"\vert": "|",
    r"\lbrace": r"\{",
    r"\rm": r"\mathrm",
    r"\leq": r"\le",
}
_OPEN, _CLOSE = {"(": ")", "[": "]", r"\{": r"\}"}, {")", "]", r"\}"}
_BETWEEN = {",", ";", r"\\", r"\qquad", r"\quad", ":"}
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    r"\sin": np.sin, r"\cos": np.cos, r"\tan": np.tan, r"\sinh": np.sinh, r"\cosh": np.cosh, r"\exp": np.exp, r"\ln": np.log,
    r"\det": np.linalg.det, r"\max": np.maximum, r"\min": np.minimum, r"\operatorname{sign}": np.sign,
}  # fmt: skip
_NUMBERS = {r"\pi": np.pi, "e": np.e, r"\infty": np.inf}
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(400)
_FAR = 12.0  # stands for infinity in integrals and, ten times, in sums: what is integrated there decays as a normal density
ROUNDING = 1e-8


class Unread(ValueError):
    """A relation that cannot be computed: a letter without a value, or LaTeX that is not read."""


class Indexed:
    """Values of a letter with an index, in one or several dimensions: `\\Psi_{k+1}`, `P_{ij}`; without one it is `plain`."""

    def __init__(self, values: Sequence[Any] | Callable[..., Any], plain: Any = None) -> None:
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


def tokens(latex: str) -> list[str]:
    """The tokens that have a meaning: no spaces, sizes, environments, alignment or words."""
    latex = re.sub(r"\\(begin|end)\{(aligned|gathered|gathered|split)\}", " ", latex)
    latex = re.sub(r"\\\\\[[^\]]*\]", r"\\\\", latex)
    latex = re.sub(
        r"\\text(rm)?\{([^{}$]|\$[^$]*\$)*\}", lambda word: word[0] if _scripted(latex, word.start()) else r" \qquad ", latex
    )
    found = [_SAME.get(one, one) for one in _TOKEN.findall(latex) if one not in _SPACE]
    inside, kept = 0, []
    for one in found:
        inside += (one == r"\begin") - (one == r"\end")
        if one != "&" or inside:  # the columns of a matrix, not those of an alignment
            kept.append(one)
    return kept


def _scripted(latex: str, place: int) -> bool:
    return latex[:place].rstrip().endswith(("_", "^", "_{", "^{"))


def normal(latex: str) -> str:
    """One way of writing what TeX prints alike: no space, no braces around a single token."""
    before, text = None, " ".join(tokens(latex))
    while text != before:
        before, text = text, re.sub(r"(?<!}) ?\{ (\\[a-zA-Z]+|[^\s{}]) \}", r" \1", text)
    return " ".join(text.split())


def pieces(latex: str) -> list[str]:
    """The pieces of a formula that commas, spaces and lines separate, each without the mark that ends it."""
    found: list[list[str]] = [[]]
    depth = 0
    for one in normal(latex).split():
        depth += (one in _OPEN or one in ("{", r"\begin")) - (one in _CLOSE or one in ("}", r"\end"))
        if one in _BETWEEN and depth == 0:
            found.append([])
        else:
            found[-1].append(one)
    texts = (" ".join(piece).removesuffix(" .").strip() for piece in found)
    return [text for text in texts if text and text != "."]


def is_relation(piece: str) -> bool:
    """Does this piece relate two sides, outside all brackets?"""
    depth = 0
    for one in piece.split():
        depth += (one in _OPEN or one == "{") - (one in _CLOSE or one == "}")
        if depth == 0 and one in RELATIONS | _OTHERS:
            return True
    return False


def holds(relation: str, letters: Letters, within: float = ROUNDING, approximately: float = 0.1) -> None:
    """Compute the sides of a relation for every value of its indices, and compare.

    |left - right| <= within * scale,   for \\approx within `approximately`

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
    reader = _Reader(text.split(), letters)
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


class _Reader:
    """A parser by recursive descent; what it returns computes a value, given the indices and variables."""

    def __init__(self, text: list[str], letters: Letters) -> None:
        self.text, self.letters, self.place = text, letters, 0
        keys = sorted(((normal(key).split(), key) for key in letters), key=lambda pair: -len(pair[0]))
        self.keys = [*keys, *(([*normal(key).split()], key) for key in _FUNCTIONS if key not in letters)]
        self.bound: list[str] = []  # variables of the integrals around
        self.indices: list[str] = []  # indices in the order of their first use
        self.summed: list[str] = []
        self.stop: list[str | None] = []
        self.bars: list[str] = []  # what is open around: a "group", "arguments", a "value" between bars
        self.braced: list[tuple[_Side, _Side]] = []

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

    def chain(self) -> tuple[list[_Side], list[str], list[str]]:
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

    def sum_of_terms(self) -> _Side:
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
                value = _added(value, sign * term(at))
            return value

        return total if terms[1:] or terms[0][0] < 0 else terms[0][1]

    def product(self) -> _Side:
        factors: list[tuple[bool, _Side]] = [(False, self.factor())]
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
                value = value / _number(factor(at)) if divided else _multiplied(value, factor(at))
            return value

        return total if factors[1:] else factors[0][1]

    def _starts_factor(self) -> bool:
        one = self.next
        if one == "|":  # opens, unless it closes or separates arguments
            return self.bars[-1:] in ([], ["group"])
        if not one or one in RELATIONS or one in _CLOSE or one in {"}", "+", "-", ",", ";", "&", r"\\", r"\end"}:
            return False
        return not (one == "d" and self.stop and self.stop[-1] and self._differential(self.place))

    def _differential(self, place: int) -> bool:
        variable = (self.stop[-1] or "").split()
        return self.text[place + 1 : place + 1 + len(variable)] == variable

    def factor(self) -> _Side:
        bracketed = self.next in _OPEN
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

    def _column(self, matrix: _Side, number: _Side) -> _Side:
        return lambda at: matrix(at)[:, [_whole(number(at)) - 1]]

    def _power(self, base: _Side, exponent: list[str]) -> _Side:
        text = "".join(exponent)
        if text == "T":
            return lambda at: _transposed(base(at))
        if text == "-T":
            return lambda at: _transposed(_inverse(base(at)))
        if text == "-1":
            return lambda at: _inverse(base(at))
        if text == "1/2":
            return lambda at: _root(base(at))
        if text == "-1/2":
            return lambda at: _inverse(_root(base(at)))
        power = self._inside(exponent)
        return lambda at: _raised(base(at), power(at))

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

    def _inside(self, text: list[str]) -> _Side:
        """A part of the text, read by itself with the same letters."""
        around, self.text, self.place = (self.text, self.place), text, 0
        with self._within("group"):
            side = self.sum_of_terms()
        if self.next:
            raise Unread(f"cannot read {' '.join(text)}")
        self.text, self.place = around
        return side

    def atom(self) -> _Side:
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
        if one in _OPEN:
            self.take()
            with self._within("group"):
                side = self.sum_of_terms()
            self.take(_OPEN[one])
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
            return lambda at: above(at) / _number(below(at))
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

    def _letter(self) -> _Side | None:
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

    def _entered(self, value: Any, key: str) -> _Side:
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
            found: _Side = lambda at: value[tuple(_whole(index(at)) for index in indices)]  # noqa: E731
            return self._applied(found) if callable(_sample(value)) and self._is_call() else found
        if isinstance(value, Operator):
            argument = self.product()
            return lambda at: value.function(argument(at))
        if callable(value):
            return self._applied(lambda at: value)
        return lambda at: value

    def _index(self, key: str) -> _Side:
        if key not in self.summed:
            self.indices.append(key)
        return lambda at: at[key]

    def _subscript(self, text: list[str]) -> list[_Side]:
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

    def _applied(self, function: _Side) -> _Side:
        power, turned = None, False
        if self.next == "^" and self._after(1) == "T" and self._after(2) == "(":
            self.place += 2
            turned = True
        elif self.next == "^" and self._after(1) not in ("T", "{"):
            self.take()
            power = self._inside(self._group())
        if self.next in ("(", "["):
            arguments = self._arguments()
            call: _Side = lambda at: function(at)(*(argument(at) for argument in arguments))  # noqa: E731
        elif self._starts_factor():  # a function without brackets: all that is multiplied after it
            argument = self.product()
            call = lambda at: function(at)(argument(at))  # noqa: E731
        else:
            return function
        if turned:
            return lambda at: _transposed(call(at))
        return call if power is None else lambda at: _raised(call(at), power(at))

    def _arguments(self) -> list[_Side]:
        close = _OPEN[self.take()]
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

    def _matrix(self) -> _Side:
        self.place += 1
        name = self._group()
        rows: list[list[_Side]] = [[]]
        while True:
            rows[-1].append(self.sum_of_terms())
            if (mark := self.take()) == r"\\":
                rows.append([])
            elif mark == r"\end":
                break
        if self._group() != name:
            raise Unread("a matrix that does not end")
        return lambda at: np.block(_full([[np.atleast_2d(entry(at)) for entry in row] for row in rows]))

    def _sum(self, adding: bool) -> _Side:
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
            begin = None if start is None else _whole(start(at))
            if begin is None:
                choices: Iterable[tuple[int, ...]] = product(*(self.letters[one] for one in over))
            else:
                last = int(10 * _FAR) if stop is None else _whole(stop(at))
                choices = ((one,) for one in range(begin, last + 1))
            values = [body(at | dict(zip(over, chosen, strict=True))) for chosen in choices]
            return sum(values[1:], values[0]) if adding else np.prod(values)

        return total

    def _integral(self) -> _Side:
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
            depth += (one in _OPEN or one == "{") - (one in _CLOSE or one == "}")
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


def _whole(value: Value) -> int:
    if isinstance(value, str) or float(value) != int(value):
        raise Unread(f"{value} is no index")
    return int(value)


def _number(value: Value) -> Value:
    value = np.asarray(value, float)
    if value.ndim == 2 and value.size > 1:
        raise Unverified("a matrix cannot divide")
    return value.item() if value.size == 1 else value


def _is_matrix(value: Value) -> bool:
    return np.ndim(value) == 2 and np.size(value) > 1


def _added(one: Value, other: Value) -> Value:
    if (_is_matrix(one) or _is_matrix(other)) and np.shape(one) != np.shape(other):
        raise Unverified(f"a matrix {np.shape(one)} and one of {np.shape(other)} are added")
    return one + other


def _multiplied(one: Value, other: Value) -> Value:
    if np.ndim(one) == np.ndim(other) == 2 and np.shape(one)[1] == np.shape(other)[0]:
        return one @ other
    if _is_matrix(one) and _is_matrix(other):
        raise Unverified(f"a matrix {np.shape(one)} is multiplied by one of {np.shape(other)}")
    return (one.item() if np.shape(one) == (1, 1) else one) * (other.item() if np.shape(other) == (1, 1) else other)


def _transposed(value: Value) -> Value:
    return value.T if np.ndim(value) == 2 else value


def _inverse(value: Value) -> Value:
    return np.linalg.inv(value) if np.ndim(value) == 2 else 1 / value


def _root(value: Value) -> Value:
    return np.linalg.cholesky(value) if _is_matrix(value) else np.sqrt(value)


def _raised(value: Value, power: Value) -> Value:
    if _is_matrix(value):
        return np.linalg.matrix_power(value, _whole(power))
    return value**power


def _full(rows: list[list[Value]]) -> list[list[Value]]:
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
