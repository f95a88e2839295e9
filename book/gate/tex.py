r"""Formulas in LaTeX as tokens: what TeX prints alike is alike here, and a display falls into its
relations."""

from __future__ import annotations

import re
from functools import cache

RELATIONS = {"=", r"\approx", r"\le", r"\ge", "<", ">", r"\propto", r"\leftarrow"}
_OTHERS = {r"\sim", r"\ll", r"\gg", r"\to", r"\in", r"\ne", r"\gtrsim", r"\lesssim"}  # not computed
_TOKEN = re.compile(r"\\[a-zA-Z]+|\\.|[^\s]", re.DOTALL)
_SPACE = {
    r"\,",
    r"\;",
    r"\!",
    r"\:",
    r"\ ",
    "~",
    r"\displaystyle",
    r"\textstyle",
    r"\nonumber",
    r"\left",
    r"\right",
    r"\middle",
}
_SPACE |= {
    rf"\{size}{side}" for size in ("big", "Big", "bigg", "Bigg") for side in ("", "l", "r", "m")
}
_SAME = {
    r"\dfrac": r"\frac",
    r"\tfrac": r"\frac",
    r"\mid": "|",
    r"\vert": "|",
    r"\lbrace": r"\{",
    r"\rm": r"\mathrm",
    r"\leq": r"\le",
}
OPEN, CLOSE = {"(": ")", "[": "]", r"\{": r"\}"}, {")", "]", r"\}"}
_BETWEEN = {",", ";", r"\\", r"\qquad", r"\quad", ":"}


def tokens(latex: str) -> list[str]:
    """The tokens that have a meaning: no spaces, sizes, environments, alignment or words."""
    latex = re.sub(r"\\(begin|end)\{(aligned|gathered|gathered|split)\}", " ", latex)
    latex = re.sub(r"\\\\\[[^\]]*\]", r"\\\\", latex)
    latex = re.sub(
        r"\\text(rm)?\{([^{}$]|\$[^$]*\$)*\}",
        lambda word: word[0] if _scripted(latex, word.start()) else r" \qquad ",
        latex,
    )
    parts = [_SAME.get(token, token) for token in _TOKEN.findall(latex) if token not in _SPACE]
    inside, kept = 0, []
    for token in parts:
        inside += (token == r"\begin") - (token == r"\end")
        if token != "&" or inside:  # the columns of a matrix, not those of an alignment
            kept.append(token)
    return kept


def _scripted(latex: str, place: int) -> bool:
    return latex[:place].rstrip().endswith(("_", "^", "_{", "^{"))


@cache
def normal(latex: str) -> str:
    """One way of writing what TeX prints alike: no space, no braces around a single token."""
    before, text = None, " ".join(tokens(latex))
    while text != before:
        before, text = text, re.sub(r"(?<!}) ?\{ (\\[a-zA-Z]+|[^\s{}]) \}", r" \1", text)
    return " ".join(text.split())


def pieces(latex: str) -> list[str]:
    """The pieces of a formula that commas, spaces and lines separate, each without the mark that
    ends it."""
    parts: list[list[str]] = [[]]
    depth = 0
    for token in normal(latex).split():
        depth += (token in OPEN or token in ("{", r"\begin")) - (
            token in CLOSE or token in ("}", r"\end")
        )
        if token in _BETWEEN and depth == 0:
            parts.append([])
        else:
            parts[-1].append(token)
    texts = (" ".join(piece).removesuffix(" .").strip() for piece in parts)
    return [text for text in texts if text and text != "."]


def is_relation(piece: str) -> bool:
    """Does this piece relate two sides, outside all brackets?"""
    depth = 0
    for token in piece.split():
        depth += (token in OPEN or token == "{") - (token in CLOSE or token == "}")
        if depth == 0 and token in RELATIONS | _OTHERS:
            return True
    return False
