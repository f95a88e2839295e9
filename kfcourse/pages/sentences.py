r"""Numbers and words in the sentences that `claim` and `agree` print, read from the code of a page.

A number that is typed, in digits or in words, must also stand in the code of its cell outside of the sentence, as it is or as a
tolerance (12 digits and 1e-12, 95 % and 0.95, 10^{-6} and 1e-6, a third and 3); others come from values, `f"{x:.2f}"`.  What is
left (years, names, units) the page's file in letters/ lists in LITERALS.  A sentence that compares needs a condition that does.

A number of two digits or more in the prose around the cells, or in the words of a figure, stands in the code of the page as well:
where it is computed, or in a condition that holds it.  Numbers that are names (variant 53, lecture 10) need not.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from kfcourse.laws import CONFIDENCE
from kfcourse.pages.relations import calls, cells

COMPARING = re.compile(
    r"\b(larger|smaller|more|less|most|least|none|never|always|all|every|each|no|worse|better|best|worst|above|below|lower|higher|"
    r"narrower|wider|only|falls?|grows?|rises?|faster|slower|sooner|later|leads|first|last|same|agree|equal)\b"
)
_NUMBER = re.compile(r"(?<![\w.^_{\\])(\d{1,3}(?:,\d{3})+(?:\.\d+)?|\d+(?:\.\d+)?)")
_TOLD = re.compile(r"(?<![\w.^_\\{])(?:\d+\.\d+|\d{1,3}(?:,\d{3})+|\d{2,})(?!\w|[.-]\w|\})")
_NO_PROSE = re.compile(
    r"\A---\n.*?\n---\n|^```(?:text|toml|console|python|\{chapter\})\n.*?^```|``?[^`\n]+``?|<[^>]+>|\]\([^)]*\)"
    r"|\b(?:[Vv]ariants?|[Ll]ectures?|Python) \d[\d.]*(?: and \d+)?",
    re.MULTILINE | re.DOTALL,
)
_WORDS = {"two": 2, "three": 3, "four": 4, "five": 5, "six": 6, "seven": 7, "eight": 8, "nine": 9, "ten": 10, "eleven": 11}
_WORDS |= {"twelve": 12, "twenty": 20, "thirty": 30, "forty": 40, "fifty": 50, "hundred": 100, "thousand": 1000}
_WORDS |= {"twice": 2, "double": 2, "doubles": 2, "half": 2, "halves": 2, "halved": 2, "third": 3, "thirds": 3, "quarter": 4}
_WORDS |= {"fourth": 4, "fifth": 5, "sixth": 6, "eighth": 8, "tenth": 10, "twentieth": 20, "hundredth": 100, "thousandth": 1000}
_IN_WORDS = re.compile(rf"\b(?:{'|'.join(_WORDS)})(?:[ -](?:hundred|thousand))?\b", re.IGNORECASE)
_POWER = re.compile(r"10\^(?:\{(-?\d+)\}|(\d))")
_FORMULA = re.compile(r"\$([^$]*)\$")
_VALUE = re.compile(r"(?:=|<|>|\\l?eq?|\\ge?|\\approx|^)\s*(-?[\d.]+)\s*$")


class Sentence(NamedTuple):
    """What a call prints, with the numbers that it types and no code of its cell knows, and whether a condition compares."""

    text: str
    unknown: list[str]
    compares: bool


def spoken(page: str) -> Iterator[Sentence]:
    """The sentences of all `claim` and `agree` of a page."""
    for code in cells(page):
        for call in calls(code, "claim", "agree"):
            typed = list(_typed(call.args[0]))
            known = _constants(ast.parse(code), {id(one) for one in ast.walk(call.args[0])})
            unknown = [number for text in typed for number in _numbers(text) if not _stands(number, known)]
            yield Sentence(
                "…".join(typed), unknown, getattr(call.func, "id", "") == "agree" or any(map(_compares, call.args[1:]))
            )


def told(page: str) -> list[str]:
    """The numbers of a page's prose and of the words of its figures that its code does not know."""
    known, prose = {CONFIDENCE}, page
    for code in cells(page):
        known |= _constants(ast.parse(code), set())
        prose = prose.replace(code, "")
    found = _TOLD.findall(_NO_PROSE.sub("", prose))
    values = [float(number.replace(",", "")) for number in found]
    known |= {round(100 * one, 9) for one in known}  # a percentage
    return [number for number, value in zip(found, values, strict=True) if value not in known]


def _typed(sentence: ast.expr) -> Iterator[str]:
    """The text of a sentence without what is put in."""
    values = {id(one) for node in ast.walk(sentence) if isinstance(node, ast.FormattedValue) for one in ast.walk(node)}
    for node in ast.walk(sentence):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in values:
            yield node.value


def _numbers(text: str) -> Iterator[str]:
    for formula in _FORMULA.findall(text):
        for power in _POWER.findall(formula):
            yield f"1e{''.join(power)}"
        yield from (value[1] for part in re.split(r"[,;]|\\ ", formula) if (value := _VALUE.search(part)))
    for number in _NUMBER.findall(_FORMULA.sub(" ", text)):
        yield number.replace(",", "")
    yield from _IN_WORDS.findall(_FORMULA.sub(" ", text))


def _constants(tree: ast.AST, without: set[int]) -> set[float]:
    found = {float(one.value) for one in ast.walk(tree)
             if isinstance(one, ast.Constant) and isinstance(one.value, int | float) and id(one) not in without}  # fmt: skip
    return found | {-one for one in found}


def _stands(number: str, known: set[float]) -> bool:
    if words := re.findall("[a-z]{2,}", number.lower()):
        value = float(np.prod([_WORDS[word] for word in words]))
        return any(abs(one - other) <= 1e-9 * abs(one) for one in (value, 1 / value, 10.0**-value) for other in known if other)
    value = float(number)
    also = (value, value / 100, value / 1000, 1 - value / 100, 10.0**-value if value < 300 else value)
    return any(abs(one - other) <= 1e-9 * abs(one) for one in also for other in known if one) or value in known


def _compares(condition: ast.expr) -> bool:
    """Is there a comparison in it, a call, or a name that holds one?"""
    return any(isinstance(one, ast.Compare | ast.Call | ast.Name | ast.Attribute) for one in ast.walk(condition))
