r"""What each displayed relation of a page is: computed from the page's letters, a definition,
quoted, or stated without proof.

A page `my-chapter.md` that types relations in `$$` or in a box has a file `letters/my_chapter.py`
beside it::

    def course(rng): return {"p": Indexed(...), ...}   # numbers for the letters: a program,
    western = r"K = PH^TS^{-1}"                        # or definitions in LaTeX (gate.worlds)
    LETTERS = (course, western)  # a relation must hold in one of them, with all its letters
    # what cannot be computed, letter by letter, and what it is; or by its label: computed all the
    # same, but shown under this name
    DECLARED = {DEFINITION: [r"x_0\sim\mathcal N(m_0,D_0)", "eq-my-model"]}
    # a string in a cell, and what the checked sides beside it say
    EQUALS = {r"\det M": r"ad-bc"}

So a changed letter stops the build: what is computed no longer holds, or what was declared is no
longer there.

The key points of a page say again what it has shown: a formula in them is computed, or stands
elsewhere on the page, letter by
letter.  A relation in any other sentence, an answer for instance, holds if the page's letters can
read it, in a world of its own where need be; only what gives a letter a value or another name,
`T=0.1`, holds where it is said and nowhere else.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from itertools import groupby
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from gate.relation import holds
from gate.tex import RELATIONS, is_relation, normal, pieces
from gate.values import Unread
from gate.worlds import world
from kfcourse.pages import Unverified
from kfcourse.pages.verification import DEFINITION as DEFINITION

COMPUTED = "both sides computed"
STATED = "stated without proof"
NOTATION = "notation"
CONDITION = "condition"
_SEEDS = (53, 54)  # what holds for two draws of the numbers is no accident
_CELL = re.compile(r"^(`{3,})\{code-cell\}[^\n]*\n(.*?)^\1\s*$", re.DOTALL | re.MULTILINE)
_BOX = re.compile(
    r"^(`{3,})\{admonition\} ([^\n]*)\n:class:[^\n]*\b(?:algorithm|definition)\b(.*?)^\1\s*$",
    re.DOTALL | re.MULTILINE,
)
_POINTS = re.compile(r"^(`{3,})\{admonition\} Key points\n(.*?)^\1\s*$", re.DOTALL | re.MULTILINE)
_DISPLAY = re.compile(
    r"^(?:\$\$|```\{math\})\n(.*?)\n(?:\$\$|```)(?: \(([\w-]+)\))?\s*$", re.DOTALL | re.MULTILINE
)
_INLINE = re.compile(r"(?<![\\$])\$([^$]+)\$(?!\$)")
_NO_LETTER = re.compile(r"\\(?:frac|sqrt|cdot|infty|hat|bar|tilde|dot|ddot)\b|'")
_NUMBER = re.compile(r"(?<![\w.^_{\\])(\d{1,3}(?:,\d{3})+(?:\.\d+)?|\d+(?:\.\d+)?)")
_NO_NUMBER = re.compile(r"\$[^$]*\$|\{\w+\}`[^`]*`|`[^`]*`|(?:[Vv]ariants?|[Ll]ectures?) \d+")
_OPERATOR = re.compile(r"(?:^|\s)([+/]|-|\\frac|\\sqrt|\^ (?:T|\d|\{ - 1 \}))(?=\s|$)")


class Formula(NamedTuple):
    """A formula as a page types it: a "display", in a "box", in a key "point", in a "sentence", or
    in a cell a "side" or "name" that is printed, not checked."""

    kind: str
    latex: str
    label: str = ""


class Verdict(NamedTuple):
    """A piece of a formula, and what it is."""

    piece: str
    what: str
    computed: bool


def quoted(source: str) -> str:
    """The word for a relation taken over from a source."""
    return f"quoted from {source}"


class Letters:
    """The letters of a page with their numbers, and what its other relations are."""

    def __init__(
        self,
        worlds: Sequence[str | Callable[[np.random.Generator], Mapping[str, Any]]] = (),
        verdicts: Mapping[str, Sequence[str]] = MappingProxyType({}),
        equals: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        makers = [world(entry) if isinstance(entry, str) else entry for entry in worlds]
        self.worlds = [[make(np.random.default_rng(seed)) for seed in _SEEDS] for make in makers]
        self.declared = {normal(text): what for what, texts in verdicts.items() for text in texts}
        self.equals = {
            normal(text): f"{normal(text)} = {normal(other)}" for text, other in equals.items()
        }
        self.labels = {
            text: what
            for what, texts in verdicts.items()
            for text in texts
            if text.startswith("eq-")
        }
        self.indices = {
            key
            for (first, *_) in self.worlds
            for key, value in first.items()
            if isinstance(value, range)
        }

    @property
    def listed(self) -> list[str]:
        """What a page must have, as its file speaks of it."""
        return [
            *(text for text in self.declared if text not in map(normal, self.labels)),
            *self.labels,
            *self.equals.values(),
        ]

    def judge(self, formula: Formula, elsewhere: str = "") -> list[Verdict]:
        """What each relation of a formula is; a key point may say what stands elsewhere on the
        page.

        Raises
        ------
        Unverified
            If one does not hold, or nothing says what it is.
        """
        whole = normal(formula.latex)
        if whole in self.declared:
            return [Verdict(whole, self.declared[whole], False)]
        if whole in self.equals:
            return [self._judged(self.equals[whole], formula)]
        if formula.kind in ("side", "name"):
            raise Unverified(
                _unsaid(
                    formula.latex,
                    "it is printed beside a checked equation, and nothing holds it; EQUALS or "
                    "DECLARED may",
                )
            )
        if formula.kind == "point":
            new = [
                piece
                for piece in pieces(formula.latex)
                if not re.search(rf" {re.escape(piece)} (?![\^_'])", elsewhere)
            ]
            return [self._judged(self.equals.get(piece, piece), formula) for piece in new]
        if formula.kind == "sentence":
            return [verdict for piece in self.related(formula) for verdict in self.read(piece)]
        return [self._judged(piece, formula) for piece in pieces(formula.latex) if self.says(piece)]

    @staticmethod
    def related(formula: Formula) -> list[str]:
        """The relations of a formula that hold everywhere on the page."""
        return [piece for piece in pieces(formula.latex) if is_relation(piece) and not _sets(piece)]

    def says(self, piece: str) -> bool:
        """Is there anything in it that can be wrong?  Not where an index begins."""
        left, _, right = piece.partition(" = ")
        return speaks(piece) and not (
            left in self.indices and re.fullmatch(r"[\d\w]( [\d\w])*|\\dots", right)
        )

    def _judged(self, piece: str, formula: Formula) -> Verdict:
        if piece in self.declared:
            return Verdict(piece, self.declared[piece], False)
        if not is_relation(piece):
            raise Unverified(_unsaid(piece, "an expression that is no relation"))
        unread = self._against(piece)
        if unread is None:
            return Verdict(piece, self.labels.get(formula.label, COMPUTED), True)
        raise Unverified(_unsaid(piece, unread or "the page has no letters"))

    def read(self, piece: str) -> list[Verdict]:
        """What a relation in a sentence is, if it can be read."""
        if piece in self.declared:
            return [Verdict(piece, self.declared[piece], False)]
        return [Verdict(piece, COMPUTED, True)] if self._against(piece) is None else []

    @cache  # noqa: B019
    def _against(self, piece: str) -> str | None:
        """None if a relation holds in a world of the page; why, if none can read it.

        Raises
        ------
        Unverified
            If it holds in none, and one can.
        """
        reasons: list[Exception] = []
        for draws in self.worlds:
            try:
                for letters in draws:
                    holds(piece, letters)
                return None
            except (Unread, Unverified) as reason:
                reasons.append(reason)
        false = [reason for reason in reasons if isinstance(reason, Unverified)]
        if false:
            raise Unverified(str(false[0]))
        return "; ".join(map(str, reasons))


def speaks(piece: str) -> bool:
    """Does this piece say anything: a relation, a sum, a product, a power of several letters?  A
    name alone does not."""
    if is_relation(piece):
        return True
    letters = _without_scripts(piece)
    return (
        bool(_OPERATOR.search(f" {letters}"))
        and len(re.sub(r"\^ (?:\{[^{}]*\}|\S+)", "", letters).split()) > 1
    )


def _sets(piece: str) -> bool:
    """Does it give a letter a value or another name, as `T = 0.1` or `x_0 = m`?"""
    plain = _NO_LETTER.sub("", _without_scripts(piece)).split()
    sides = [list(side) for related, side in groupby(plain, RELATIONS.__contains__) if not related]
    return all(
        len(side) == 1
        or (side[0] == "-" and len(side) == 2)
        or not any(entry.strip("\\").isalpha() for entry in side)
        for side in sides
    )


def _unsaid(latex: str, why: str) -> str:
    to_do = (
        "give its letters numbers in LETTERS of the page's file in letters/, or list it in DECLARED"
    )
    return f"nothing says what this is: {latex}\n  {why}\n  {to_do}"


def _without_scripts(piece: str) -> str:
    """A piece without its indices; powers, transposes and inverses stay."""
    return re.sub(r"_ (?:\{[^{}]*\}|\S+)|\^ [-+*]", "", piece)


def letters_file(page: Path) -> Path:
    """Where a page has its letters."""
    return Path(__file__).parents[1] / "letters" / f"{page.stem.replace('-', '_')}.py"


@cache
def letters_of(page: Path) -> Letters:
    """The letters of a page, from the folder `letters`; none if it has no file there."""
    path = letters_file(page)
    if not path.exists():
        return Letters()
    spec = spec_from_file_location(f"letters.{path.stem}", path)
    assert spec and spec.loader
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return Letters(
        getattr(module, "LETTERS", ()),
        getattr(module, "DECLARED", {}),
        getattr(module, "EQUALS", {}),
    )


def formulas(text: str) -> Iterator[Formula]:
    """The formulas of a page that no expression of SymPy prints: displays, boxes, strings in
    `verified` and `typeset`."""
    prose = _CELL.sub("", text)
    before, dollars, after = _DISPLAY.sub("", prose).partition("$$")
    if dollars:
        there = f"{before[-20:]}$${after[:20]}".strip()
        raise Unverified(
            f"a display stands on lines of its own, with $$ at the beginning of the lines around "
            f"it: {there!r}"
        )
    for latex, label in _DISPLAY.findall(prose):
        yield Formula("display", latex, label)
    for *_, body in _BOX.findall(prose):
        yield from (Formula("box", latex) for latex in _INLINE.findall(_DISPLAY.sub("", body)))
    for _, body in _POINTS.findall(prose):
        yield from (Formula("point", latex) for latex in _INLINE.findall(body))
    sentences = _POINTS.sub("", _BOX.sub("", _DISPLAY.sub("", prose)))
    yield from (Formula("sentence", latex) for latex in _INLINE.findall(sentences))
    for code in cells(text):
        yield from _printed(code)


def cells(text: str) -> Iterator[str]:
    """The Python of each cell of a page, without the options above it."""
    for _, cell in _CELL.findall(text):
        yield re.sub(r"\A(?:---\n.*?\n---\n|(?::[^\n]*\n)+\n?)", "", cell, flags=re.DOTALL)


def calls(code: str, *names: str) -> Iterator[ast.Call]:
    """The calls of these functions in a piece of Python."""
    for node in ast.walk(ast.parse(code)):
        if (
            isinstance(node, ast.Call)
            and getattr(node.func, "id", getattr(node.func, "attr", "")) in names
        ):
            yield node


def _printed(code: str) -> Iterator[Formula]:
    for call in calls(code, "verified", "typeset"):
        for sides in (node for side in call.args for node in ast.walk(side)):
            yield from (Formula("side", text) for text in _texts(getattr(sides, "elts", ())))
        for keyword in call.keywords:
            if keyword.arg == "names" and isinstance(keyword.value, ast.Dict):
                yield from (Formula("name", text) for text in _texts(keyword.value.values))
    for call in calls(code, "Symbol", "MatrixSymbol", "symbols"):
        several = getattr(call.func, "attr", getattr(call.func, "id", "")) == "symbols"
        names = [
            name for text in _texts(call.args[:1]) for name in (text.split() if several else [text])
        ]
        yield from (
            Formula("name", name)
            for name in dict.fromkeys(names)
            if re.search(r"[\\{]", name) and speaks(normal(name))
        )


def _texts(nodes: Iterable[ast.expr]) -> list[str]:
    return [
        entry.value
        for entry in nodes
        if isinstance(entry, ast.Constant) and isinstance(entry.value, str)
    ]


def typed_numbers(text: str) -> Iterator[str]:
    """Yield the numbers typed in claims and captions of tables that their cell has nowhere else.

    A number stands behind a digit as it is, as a share (95 %) or as a tolerance (12 digits, 1e-12);
    what a formula or a name (variant 53) says is no number.
    """
    for code in cells(text):
        captions = [
            word.value
            for call in calls(code, "table")
            for word in call.keywords
            if word.arg == "caption"
        ]
        sentences = [*captions, *(call.args[0] for call in calls(code, "claim", "agree"))]
        typed = {_place(node) for sentence in sentences for node in ast.walk(sentence)}
        constants = [node for node in ast.walk(ast.parse(code)) if isinstance(node, ast.Constant)]
        known = [
            node.value
            for node in constants
            if isinstance(node.value, int | float) and _place(node) not in typed
        ]
        for number in _NUMBER.findall(
            _NO_NUMBER.sub(
                " ", "…".join(text for sentence in sentences for text in _typed(sentence))
            )
        ):
            value = float(number.replace(",", ""))
            backing = [
                value,
                *([10.0**-value] if value < 300 else []),
                *([value / 100, 1 - value / 100] if value % 100 else []),
            ]
            if not any(
                np.isclose(entry, abs(other), rtol=1e-9, atol=0)
                for entry in backing
                for other in known
            ):
                yield number


def _place(node: ast.AST) -> tuple[int, int]:
    return getattr(node, "lineno", 0), getattr(node, "col_offset", 0)


def _typed(sentence: ast.expr) -> Iterator[str]:
    """The texts of a sentence without what is put in."""
    values = {
        id(node)
        for field in ast.walk(sentence)
        if isinstance(field, ast.FormattedValue)
        for node in ast.walk(field)
    }
    for node in ast.walk(sentence):
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and id(node) not in values
        ):
            yield node.value


def judged(page: Path, text: str | None = None) -> Iterator[tuple[Formula, list[Verdict]]]:
    """The formulas of a page, each with what its relations are; another text may take the place of
    the page's."""
    letters = letters_of(page)
    text = page.read_text(encoding="utf-8") if text is None else text
    elsewhere = outside_points(text)
    for formula in formulas(text):
        yield formula, letters.judge(formula, elsewhere)


def outside_points(text: str) -> str:
    """All formulas of a page but those of its key points, one after the other, as `normal` writes
    them."""
    text = _POINTS.sub("", text)
    typed = [latex for latex, _ in _DISPLAY.findall(text)] + _INLINE.findall(_DISPLAY.sub("", text))
    return "|".join(f" {normal(latex)} " for latex in typed)


def mark(verdicts: Sequence[Verdict]) -> str:
    """The words under a display: what its relations are, each once."""
    computed = "✓ " if verdicts and all(entry.computed for entry in verdicts) else ""
    return computed + "; ".join(dict.fromkeys(entry.what for entry in verdicts))
