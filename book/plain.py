"""Sphinx extension: equations that docstrings write in plain letters, set as formulas.

A docstring is read with `help()` and in its file, and there an equation is plain text:

    K = Psi G^T F^+,   z = lambda + K (y - h)        the gain, and the estimate
    p = Psi - K G Psi

In the book the same lines are set.  The grammar is what one would write anyhow:

    letters       one letter, with digits behind it or not; the Greek ones and functions such as exp and Cov by their names;
                  `window`, in grave accents, is a parameter.  M[...] is a mean, N(...) the normal law, P(...) a probability.
    marks         z_k, p_{k+1}, P^-, F^-1, G^T, z^{j}, x', z* tightly behind what they belong to
    products      of what stands side by side; 1/2 and dz/dt, without spaces, are fractions
    words         all else: between formulas, not beside an operator (so a letter misspelt is an error)
    columns       what stands in one column after two spaces or more stands in one column of the book
"""

from __future__ import annotations

import re
from difflib import get_close_matches
from typing import NamedTuple

from docutils import nodes
from docutils.parsers.rst import Directive

GREEK = frozenset(
    re.findall(
        r"\w+",
        "alpha beta gamma delta epsilon zeta eta theta kappa lambda mu nu xi pi rho sigma tau phi chi psi omega "
        "Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega",
    )
)
LETTERS = {**{name: rf"\{name}" for name in GREEK}, "eps": r"\varepsilon", "phi": r"\varphi"}
FUNCTIONS = {name: rf"\{name} " for name in ("exp", "ln", "sin", "cos", "tan", "sinh", "cosh", "max", "min", "arg", "det")}
FUNCTIONS |= {name: rf"\operatorname{{{name}}}" for name in ("argmax", "tr", "diag", "Cov", "Var")}
LARGE = {"sum": r"\sum ", "prod": r"\prod ", "Integral": r"\int ", "int": r"\int "}
SPECIAL = {"M": r"\mathsf{M}", "P": r"\mathsf{P}", "N": r"\mathcal{N}"}
OPENED = {"M": "[", "P": "(", "N": "("}  # by what they mean a mean, a probability, a law
OPERATORS = {"+": "+", "-": "-", "*": r"\cdot ", "/": "/", "±": r"\pm "}
RELATIONS = {"=": "=", "<": "<", ">": ">", "<=": r"\le ", ">=": r"\ge ", "~": r"\sim ", "∝": r"\propto ", "≈": r"\approx "}
RELATIONS |= {"->": r"\to ", "<-": r"\leftarrow "}
PARTING = {*RELATIONS.values(), "+", "-"}  # a line may be broken before them
SHORTEST = 20  # characters of LaTeX that a line may keep of a formula
MARKS = {",": ",", ";": ";", ".": ".", ":": "{:}"}
CLOSING = {"(": ")", "[": "]", "{": "}", "|": "|"}
KNOWN = {*LETTERS, *FUNCTIONS, *LARGE, "sqrt"}
SHORT = frozenset(re.findall(r"\w+", "an as at be by do if in is it no of on or so to up we"))  # words
ALSO_WORDS = {"a", "A", "I", "sum", "max", "min", "arg"}  # if a word follows

TOKEN = re.compile(
    r"(?P<code>`[^`]+`)|(?P<number>\d+(?:\.\d+)?)|(?P<word>[^\W\d_]{2,}(?:'s\b|-[^\W\d_]{2,})+)|(?P<name>[^\W\d_]+)"
    r"|(?P<mark>\.\.\.|<->|->|<-|<=|>=|[-+*/±=<>~∝≈|(){}\[\],;:.!?'^_])"
)
DIFFERENTIAL = re.compile(rf"d(?=[a-zA-Z]$|(?:{'|'.join(sorted(GREEK))})$)")
NO_DIFFERENTIALS = {"do", "de"}
INDEX = re.compile(r"[^\W_]+(?:\|[a-z]\b)?(?:\.\.[^\W_]+(?:[-+]\d+)?)?")
POWER = re.compile(r"-?\d+|[-+](?![^\W_])|-?[^\W\d_]+|\*")
GAP = re.compile(r" {2,}")


class NotPlain(ValueError):
    """Something indented in a docstring is no equation that can be set."""


class Token(NamedTuple):
    kind: str
    text: str
    start: int
    end: int


class Piece(NamedTuple):
    """A part of a formula in LaTeX (`math`, `operator`), `words`, a `mark` among them, or a wider space (`gap`)."""

    kind: str
    text: str
    spaced: bool = False


class Row:
    """The reader of one line, or of a column of it."""

    def __init__(self, text: str):
        self.text, self.at, self.small = text, 0, False
        self.tokens: list[Token] = []
        place = 0
        while place < len(text):
            if text[place] == " ":
                place += 1
                continue
            match = TOKEN.match(text, place)
            if match is None:
                raise NotPlain(f"{text[place]!r} in {text!r} is no mark of a formula")
            self.tokens.append(Token(match.lastgroup or "", match[0], match.start(), match.end()))
            place = match.end()

    def fail(self, why: str) -> NotPlain:
        token = self.tokens[min(self.at, len(self.tokens) - 1)]
        return NotPlain(f"{why}: {self.text[: token.start]}>>>{self.text[token.start :]}")

    @property
    def token(self) -> Token | None:
        return self.tokens[self.at] if self.at < len(self.tokens) else None

    def gap(self, at: int | None = None) -> int:
        """Spaces before a token."""
        at = self.at if at is None else at
        return self.tokens[at].start - self.tokens[at - 1].end if 0 < at < len(self.tokens) else 0 if at else 1

    def tight(self, text: str) -> bool:
        """Whether this comes next, without a space before it."""
        return self.token is not None and self.token.text == text and not self.gap()

    def is_word(self, at: int) -> bool:
        """Whether the token is a word, and no letter, function or number."""
        if at >= len(self.tokens):
            return False
        kind, text = self.tokens[at][:2]
        if kind != "name":
            return kind == "word"
        if text in ALSO_WORDS:
            return self.gap(at + 1) == 1 and self.is_word(at + 1)
        return len(text) > 1 and not (text in KNOWN or _differential(text))

    def pieces(self, close: str = "") -> list[Piece]:
        """All up to a closing bracket, or to the end."""
        found: list[Piece] = []
        wide = False
        before = ""  # operand, operator, words, mark
        while (token := self.token) is not None:
            kind, text = token[:2]
            apart = self.gap() > 0
            spaced = apart and self.gap(self.at + 1) > 0
            if text == close and (close != "|" or (before == "operand" and not spaced)):
                break
            if found and self.gap() > 1 and before != "operator" and text not in RELATIONS:
                found.append(Piece("gap", " "))
                before = "mark"
            if self.is_word(self.at) or (kind == "code" and not self.in_formula(before)):
                if before == "operator":
                    raise self.fail(f"{text!r} is no letter, but stands behind an operator")
                if kind == "name":
                    self.check_word(text)
                    if self.gap(self.at + 1) == 0 and self.at + 1 < len(self.tokens) and self.tokens[self.at + 1].text in "([{_^":
                        raise self.fail(f"{text!r} is no letter or function; a parameter stands in grave accents")
                found.append(Piece("code" if kind == "code" else "words", text, apart))
                before, self.at = "words", self.at + 1
            elif text == "." and close and not found:
                found.append(Piece("math", r"\cdot "))  # any argument
                before, self.at = "operand", self.at + 1
            elif text in (",", ";", ":", ".", "?"):
                if before in ("operator", ""):
                    raise self.fail("a mark with no formula before it")
                found.append(Piece("mark", text, apart))
                before, self.at = "mark", self.at + 1
            elif text in RELATIONS or text in OPERATORS or (text == "|" and spaced):
                if before == "words" and text != "|":
                    raise self.fail(f"the word before {text!r} is no letter")
                sign = text in ("+", "-")
                if (before == "operator" and not (sign and found[-1].text not in ("+", "-"))) or (
                    before in ("", "mark") and not (sign or text in RELATIONS)
                ):
                    raise self.fail("an operator with nothing before it")
                found.append(Piece("operator", {**RELATIONS, **OPERATORS, "|": r"\mid "}[text], apart))
                before, self.at = "mark" if text == "|" else "operator", self.at + 1
            elif text in CLOSING.values() and text != "|":
                raise self.fail("a bracket that was not opened")
            else:
                if before == "operand" and apart and (kind in ("number", "code") or wide or _differential(text)):
                    found.append(Piece("math", r"\,"))
                wide = kind == "code" or bool(_differential(text))
                first, *rest = self.factor()
                found += [first._replace(spaced=apart), *rest]
                before = "operand"
        if before == "operator":
            self.at -= 1
            raise self.fail("an operator with nothing behind it")
        return found

    def check_word(self, text: str) -> None:
        """A word is none that was meant as a letter."""
        if len(text) == 2 and text.isascii() and text.lower() not in SHORT:
            raise self.fail(f"{text!r} is no word, and two letters need a space between them")
        if near := get_close_matches(text, GREEK, 1, 0.85):
            raise self.fail(f"{text!r} is no letter; {near[0]} is one")

    def in_formula(self, before: str) -> bool:
        """Whether a parameter's name stands for its value: beside an operator or a bracket, not among words."""
        after = self.tokens[self.at + 1].text if self.at + 1 < len(self.tokens) else ""
        return before == "operator" or after in RELATIONS or after in OPERATORS or after in ("^", ")", "]", "|")

    def factor(self) -> list[Piece]:
        """A letter, number, function or bracket, with the marks and fractions that are tightly bound to it."""
        found = self.marked()
        while self.tight("/") and self.at + 1 < len(self.tokens) and not self.gap(self.at + 1):
            self.at += 1
            if self.small:
                found = [Piece("math", f"{self.latex(found)}/{self.latex(self.marked())}")]
            else:
                found = [Piece("math", rf"\frac{{{self.latex(_bare(found))}}}{{{self.latex(_bare(self.marked()))}}}")]
        return found

    def latex(self, pieces: list[Piece]) -> str:
        """A formula without words."""
        if any(piece.kind not in ("math", "operator", "mark") for piece in pieces):
            raise self.fail("words within a formula")
        return "".join(rf"{piece.text}\ " if piece.kind == "mark" else piece.text for piece in pieces)

    def marked(self) -> list[Piece]:
        """With its subscripts, powers and primes."""
        base = self.base()
        while (token := self.token) is not None and not self.gap():
            if token.text == "_":
                mark = self.raised("_", INDEX)
            elif token.text == "^":
                mark = self.raised("^", POWER)
            elif token.text in ("'", "!"):
                mark, self.at = token.text, self.at + 1
            elif token.text == "~":
                base, mark = [Piece("math", rf"\tilde{{{self.latex(base)}}}")], ""
                self.at += 1
            elif token.text == "*" and not self.operand_follows():
                mark, self.at = "^{*}", self.at + 1
            else:
                break
            base = [Piece("math", self.latex(base) + mark)]
        return base

    def operand_follows(self) -> bool:
        following = self.at + 1
        return following < len(self.tokens) and not self.gap(following) and self.tokens[following].kind != "mark"

    def raised(self, mark: str, run: re.Pattern) -> str:
        """A subscript or a power: in brackets, or what is tightly behind it."""
        self.at += 1
        token = self.token
        if token is None or self.gap():
            raise self.fail(f"nothing behind {mark}")
        if token.text in ("{", "("):
            self.small, outside = True, self.small
            inside = self.latex(_bare(self.bracket()))
            self.small = outside
            return f"{mark}{{{inside}}}"
        match = run.match(self.text, token.start)
        if match is None:
            raise self.fail(f"nothing that can stand behind {mark}")
        while self.token is not None and self.token.start < match.end():
            self.at += 1
        return f"{mark}{{{_small(match[0])}}}"

    def base(self) -> list[Piece]:
        token = self.token
        if token is None:
            raise self.fail("a formula that ends too early")
        kind, text = token[:2]
        if text in CLOSING:
            return self.bracket()
        self.at += 1
        following = self.token.text if self.token is not None and not self.gap() else ""
        if kind == "code":
            return [Piece("math", rf"\mathtt{{{text.strip('`').replace('_', chr(92) + '_')}}}")]
        if kind == "number":
            return [Piece("math", text)]
        if text == "...":
            return [Piece("math", r"\ldots ")]
        if text == "sqrt" and following == "(":
            return [Piece("math", rf"\sqrt{{{self.latex(_bare(self.bracket()))}}}")]
        if kind == "name":
            if text in SPECIAL and (following == OPENED[text] or (text == "M" and self.text[token.end :].startswith("_N["))):
                return [Piece("math", SPECIAL[text])]
            if text in FUNCTIONS or text in LARGE:
                return [Piece("math", FUNCTIONS.get(text) or LARGE[text])]
            if text in LETTERS or len(text) == 1:
                digits = self.token
                if digits is not None and digits.kind == "number" and not self.gap():
                    self.at += 1
                    return [Piece("math", f"{LETTERS.get(text, text)}_{{{digits.text}}}")]
                return [Piece("math", _letter(text))]
            if rest := _differential(text):
                return [Piece("math", f"d{_letter(rest)}")]
        self.at -= 1
        raise self.fail(f"{text!r} is no part of a formula")

    def bracket(self) -> list[Piece]:
        """(...), [...], {...} or |...|."""
        opening = self.tokens[self.at].text
        close = CLOSING[opening]
        self.at += 1
        inside = self.pieces(close)
        if self.token is None:
            self.at -= 1
            raise self.fail(f"no {close} for {opening}")
        self.at += 1
        if any(piece.kind in ("words", "gap") for piece in inside):
            return [Piece("mark", opening), *inside, Piece("mark", close)]
        latex = self.latex(inside)
        high = any(part in latex for part in (r"\frac", r"\sum", r"\int", r"\prod"))
        left, right = {"{": (r"\{", r"\}"), "|": (r"\lvert ", r"\rvert ")}.get(opening, (opening, close))
        if high:
            left, right = (rf"\left{left}", rf"\right{right}") if opening != "|" else (r"\left|", r"\right|")
        return [Piece("math", f"{left}{latex}{right}")]


def _differential(text: str) -> str:
    """What follows the d, if this is the differential of a letter."""
    return "" if text in NO_DIFFERENTIALS or not DIFFERENTIAL.match(text) else text[1:]


def _letter(text: str) -> str:
    return f"{LETTERS[text]} " if text in LETTERS else text


def _small(text: str) -> str:
    """A subscript or power as it is typed: letters by their names, words upright."""

    def named(match: re.Match) -> str:
        name = match[0]
        return _letter(name) if name in LETTERS or len(name) < 3 else rf"\mathrm{{{name}}}"

    return re.sub(r"[^\W\d_]+", named, text).replace("..", ":")


def _bare(pieces: list[Piece]) -> list[Piece]:
    """Without the brackets around all of it, which a fraction or a power does not need."""
    if len(pieces) == 1 and pieces[0].kind == "math":
        text = re.sub(r"^\\left([(\[])|\\right([)\]])$", r"\1\2", pieces[0].text)
        text = re.sub(r"^\\\{(.*)\\\}$", r"(\1)", text)
        depth = 0
        for i, mark in enumerate(text):
            depth += (mark in "([") - (mark in ")]")
            if not depth:
                return [Piece("math", text[1:-1])] if i and i == len(text) - 1 else pieces
    return pieces


def runs(text: str, breaks: bool = True) -> list[Piece]:
    """One line, as formulas (`math`), `words`, `code` and `gap`s follow one another; `breaks` part a formula at =, + and -."""
    found: list[Piece] = []
    for piece in Row(text).pieces():
        kind, latex, spaced = piece
        last = found[-1] if found else Piece("gap", "")
        if kind == "mark":
            kind = "math" if last.kind == "math" and not spaced and latex in MARKS else "words"
            latex = MARKS[latex] if kind == "math" else latex
        part = kind == "operator" and breaks and latex in PARTING and len(last.text) > SHORTEST
        kind = "math" if kind == "operator" else kind
        if kind == last.kind == "math" and not part:
            found[-1] = Piece("math", last.text + (r"\ " if spaced and re.search(r"(?<!\\)[,;]$", last.text) else "") + latex)
        elif kind == last.kind == "words":
            found[-1] = Piece("words", last.text + " " * spaced + latex)
        elif "gap" in (kind, last.kind) or part:
            found.append(Piece(kind, ("{}" if part and last.kind == "math" else "") + latex))
        elif last.kind == "words":
            found[-1] = Piece("words", last.text + " " * spaced)
            found.append(Piece(kind, latex))
        elif kind == "words":
            found.append(Piece("words", " " * spaced + latex))
        else:
            found += [Piece("words", " " * spaced), Piece(kind, latex)]
    return found


def dedented(rows: list[str]) -> list[str]:
    """Without the space before all of them."""
    margin = min(len(row) - len(row.lstrip()) for row in rows)
    return [row[margin:].rstrip() for row in rows]


def begins_with_formula(row: str) -> bool:
    """Whether a line of a docstring begins with a letter, a number or a bracket rather than a word."""
    try:
        start = Row(" ".join(row.split()[:2]))
    except NotPlain:
        return False
    if not start.tokens or start.is_word(0) or start.tokens[0].text in (".", "*"):
        return False
    return start.tokens[0].kind != "code" or (len(start.tokens) > 1 and start.tokens[1].text in {**RELATIONS, **OPERATORS})


def columns(rows: list[str]) -> list[dict[int, str]]:
    """The cells of each row, by the place of their column in the text."""
    begins = [{match.end() for match in GAP.finditer(row) if match.start()} for row in rows]
    relations = [{m.start() for m in re.finditer(r"(?<= )(<-|->|<=|>=|[=<>~∝≈])(?= )", row)} for row in rows]
    shared = {
        place
        for i, row in enumerate(begins)
        for place in row
        for j in range(len(rows))
        if j != i and (place in begins[j] or (place in relations[i] and place in relations[j]))
    }
    found = []
    for row, gaps, signs in zip(rows, begins, relations, strict=True):
        stops = sorted(place for place in shared if place in gaps or place in signs)
        ends = [*stops, len(row)]
        found.append({place: row[place:end].rstrip() for place, end in zip([0, *stops], ends, strict=True)})
    return found


def block(rows: list[str]) -> nodes.table:
    """The rows of an indented paragraph as a table without lines."""
    cells = columns(rows)
    stops = sorted({place for row in cells for place in row})
    group = nodes.tgroup(cols=len(stops))
    group += [nodes.colspec(colwidth=1) for _ in stops]
    body = nodes.tbody()
    for row in cells:
        line = nodes.row()
        places = [stops.index(place) for place in row]
        for text, place, following in zip(row.values(), places, [*places[1:], len(stops)], strict=True):
            wide = {"morecols": following - place - 1} if following - place > 1 else {}
            said = nodes.paragraph("", "", *map(_node, runs(text, breaks=len(stops) == 1)))
            relation = any(text.startswith(sign) for sign in RELATIONS)
            line += nodes.entry("", said, classes=["kf-relation"] if relation else [], **wide)
        body += line
    group += body
    return nodes.table("", group, classes=["kf-formulas"])


def _node(piece: Piece) -> nodes.Node:
    if piece.kind == "math":
        latex = rf"\displaystyle {piece.text.strip()}"
        return nodes.math(latex, latex)
    if piece.kind == "code":
        name = piece.text.strip("`")
        return nodes.literal(name, name)
    if piece.kind == "gap":
        return nodes.inline(" ", " ", classes=["kf-gap"])
    return nodes.Text(piece.text)


class Equations(Directive):
    """An indented paragraph of a docstring (docstrings.py finds them)."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        try:
            return [block(dedented(list(self.content)))]
        except NotPlain as error:
            raise self.error(f"{error}. {REMEDY}") from None


REMEDY = 'A formula of a docstring stands indented, in the letters of book/plain.py; what is none stands after "::"'


def setup(app) -> dict[str, bool]:
    app.add_directive("equations", Equations)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
