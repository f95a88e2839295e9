"""Polynomials, and quotients of them, multiplied out exactly; means of polynomials by the moments of normal laws.

Two lines are equal if their quotients are: numerators multiplied crosswise, so that nothing has to be cancelled.
"""

from __future__ import annotations

from functools import cache
from math import comb
from typing import Any, NamedTuple

from sympy import QQ, ring

from kfcourse.derivations.setting import Setting
from kfcourse.derivations.terms import LETTER, MEAN, NUMBER, POWER, PRODUCT, SUM, Node, letters

MOST = 3000  # monomials that are multiplied out; beyond that, values are compared
HIGHEST = 48  # degree


class NotPolynomial(ValueError):
    """Not a quotient of polynomials, or too long a one: compare values instead."""


class Quotient(NamedTuple):
    top: Any  # elements of a ring of polynomials
    bottom: Any


class Exact:
    """Trees of one setting as quotients of polynomials in all letters that they have."""

    def __init__(self, setting: Setting, trees: list[Node]):
        names: set[str] = set(setting.law.random) | set(setting.law.letters)
        found = list(trees)
        while found:
            new = letters(found.pop()) - names
            names |= new
            found += [setting.meanings[name] for name in new if name in setting.meanings]
        self.setting = setting
        self.names = sorted(names)
        self.ring, *generators = ring(self.names, QQ)
        self.letter = dict(zip(self.names, generators, strict=True))
        self.random = [self.names.index(name) for name in setting.law.random]
        self.moment = cache(self._moment)
        self.meaning = cache(lambda name: self.of(setting.meanings[name]))

    def of(self, node: Node) -> Quotient:
        """The quotient; NotPolynomial if there is none, ZeroDivisionError if something is divided by zero."""
        one = self.ring.one
        if node.kind == NUMBER:
            return Quotient(one * QQ(node.data.numerator, node.data.denominator), one)
        if node.kind == LETTER:
            return self.meaning(node.data) if node.data in self.setting.meanings else Quotient(self.letter[node.data], one)
        if node.kind == SUM:
            top, bottom = self.ring.zero, one
            for sign, part in zip(node.data, node.parts, strict=True):
                a, b = self.of(part)
                top, bottom = (
                    (top + sign * a, b)
                    if b == bottom
                    else (self.times(top, b) + sign * self.times(a, bottom), self.times(bottom, b))
                )
            return Quotient(top, bottom)
        if node.kind == PRODUCT:
            top, bottom = one, one
            for e, part in zip(node.data, node.parts, strict=True):
                a, b = self.of(part)[::e]
                top, bottom = self.times(top, a), self.times(bottom, b)
            return self._divided(top, bottom)
        if node.kind == POWER and node.data.denominator == 1:
            inner, k = self.of(node.parts[0]), int(node.data)
            return self._divided(*(self._power(one, abs(k)) for one in inner[:: 1 if k >= 0 else -1]))
        if node.kind == MEAN:
            top, bottom = self.of(node.parts[0])
            if any(monomial[i] for monomial in bottom for i in self.random):
                raise NotPolynomial
            return Quotient(self.mean(top), bottom)
        raise NotPolynomial

    def equal(self, first: Quotient, second: Quotient) -> bool:
        return (first.bottom == second.bottom and first.top == second.top) or not (
            self.times(first.top, second.bottom) - self.times(second.top, first.bottom)
        )

    def _divided(self, top: Any, bottom: Any) -> Quotient:
        if not bottom:
            raise ZeroDivisionError
        return Quotient(top, bottom)

    def times(self, first: Any, second: Any) -> Any:
        if len(first) * len(second) > MOST**2 / 10 or _degree(first) + _degree(second) > HIGHEST:
            raise NotPolynomial
        return first * second

    def _power(self, base: Any, k: int) -> Any:
        if comb(len(base) + k - 1, k) > MOST if base else False:
            raise NotPolynomial
        if _degree(base) * k > HIGHEST:
            raise NotPolynomial
        return base**k

    def mean(self, polynomial: Any) -> Any:
        """M of a polynomial: its random letters by their moments."""
        parts: dict[tuple[int, ...], Any] = {}
        for monomial, coefficient in polynomial.terms():
            powers = tuple(monomial[i] for i in self.random)
            rest = tuple(0 if i in self.random else power for i, power in enumerate(monomial))
            parts.setdefault(powers, {})[rest] = coefficient
        found = self.ring.zero
        for powers, rest in parts.items():
            found += self.times(self.moment(powers), self.ring.from_dict(rest))
        return found

    def _moment(self, powers: tuple[int, ...]) -> Any:
        """M[x^a ... v^b ...] by Stein's lemma: M[x_i f] = m_i M[f] + sum_j P_ij M[df/dx_j]; a noise has m = 0 and P = 1."""
        law, n = self.setting.law, len(self.setting.law.states)
        first = next((i for i, power in enumerate(powers) if power), None)
        if first is None:
            return self.ring.one
        rest = [power - (i == first) for i, power in enumerate(powers)]

        def lower(j: int) -> Any:
            return rest[j] * self.moment(tuple(power - (i == j) for i, power in enumerate(rest)))

        if first >= n:
            return lower(first) if rest[first] else self.ring.zero
        found = self.letter[law.means[first]] * self.moment(tuple(rest))
        for j in range(n):
            if rest[j]:
                found += self.letter[law.cov[first][j]] * lower(j)
        return found


def _degree(polynomial: Any) -> int:
    return max((sum(monomial) for monomial in polynomial), default=0)
