"""Sphinx extension: pages as light as what they show.

The theme's style sheets are made for every page that anyone may write: of 530 kB the book uses 140.  So the rules that ask for
a class or a name that no page and no script of the built book has are left out.  And the fonts of nearly every page come with a
script, which is the only way to have them when the first line is laid out: a page is laid out once, not once more for each font
that arrives, and no line moves.  The script has the letters that the book shows; the sheets' fonts have all.
"""

from __future__ import annotations

import base64
import html
import io
import json
import logging
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import tinycss2
from fontTools import subset
from fontTools.ttLib import TTFont
from tinycss2 import ast

SHEETS = ("styles/*.css", "sphinx-design.min.css", "mystnb.*.css", "basic.css", "togglebutton.css", "pygments.css")
FONTS = (  # first in the lists of book.css and formulas.css; other letters, and readers without scripts, have those of the sheets
    ("Ready Serif", "normal", "100 900", "source-serif-4-latin-wght-normal.woff2"),
    ("Ready Serif", "italic", "100 900", "source-serif-4-latin-wght-italic.woff2"),
    ("Ready Sans", "normal", "100 900", "source-sans-3-latin-wght-normal.woff2"),
    ("Ready Mono", "normal", "100 900", "jetbrains-mono-latin-wght-normal.woff2"),
    ("Ready MJXZERO", "normal", "normal", "MathJax_Zero.woff"),
    ("Ready MJXTEX", "normal", "normal", "MathJax_Main-Regular.woff"),
    ("Ready MJXTEX-I", "normal", "normal", "MathJax_Math-Italic.woff"),
    ("Ready MJXTEX-S1", "normal", "normal", "MathJax_Size1-Regular.woff"),
    ("Ready MJXTEX-S4", "normal", "normal", "MathJax_Size4-Regular.woff"),
    ("Ready MJXTEX-C", "normal", "normal", "MathJax_Calligraphic-Regular.woff"),
    ("Ready MJXTEX-SS", "normal", "normal", "MathJax_SansSerif-Regular.woff"),
)
SCRIPT_OF_FONTS = """{
  const slowly = (data) => {
    const text = atob(data), bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
    return bytes;
  };
  for (const [family, style, weight, data] of %s) {
    const bytes = Uint8Array.fromBase64?.(data) ?? slowly(data); // browsers of before 2025 have no fromBase64
    document.fonts.add(new FontFace(family, bytes, { style, weight }));
  }
}
"""
TAG = re.compile(r"<[^>]*>")
ESCAPED = re.compile(r"\\([0-9A-Fa-f]{1,6})")  # a letter in a style sheet, such as those of formulas
NAMED = re.compile(r'\b(?:class|id)="([^"]*)"')
SCRIPT = re.compile(r"<script\b[^>]*>(.*?)</script>", re.DOTALL)
WORD = re.compile(r"[A-Za-z_][\w-]*")
BEGUN = re.compile(r"([A-Za-z][\w-]*-)(?=[\"'`]|\$\{)")  # "bs-" of `bs-${name}-auto`: what a script puts together
logging.getLogger("fontTools").setLevel(logging.WARNING)  # it would tell of every table


class Used(NamedTuple):
    """Classes and names of the elements of a book: whole ones, and beginnings of those that scripts put together."""

    words: frozenset[str]
    beginnings: tuple[str, ...]

    def __contains__(self, name: object) -> bool:
        return name in self.words or str(name).startswith(self.beginnings)


def used(pages: Iterable[str], scripts: Iterable[str]) -> Used:
    """What the elements of these pages are called, or may be once scripts have run."""
    words: set[str] = set()
    programs = set(scripts)
    for page in pages:
        words.update(*(names.split() for names in set(NAMED.findall(page))))
        programs.update(SCRIPT.findall(page))
    for program in programs:
        words.update(WORD.findall(program))
    return Used(frozenset(words), tuple({begun for program in programs for begun in BEGUN.findall(program)}))


def pruned(sheet: str, here: Used) -> str:
    """A style sheet without the rules that fit no element; licences stay."""
    rules = tinycss2.parse_stylesheet(sheet, skip_whitespace=True)
    return "\n".join(text for rule in rules if (text := _rule(rule, here)))


def _rule(rule: ast.Node, here: Used) -> str:
    if isinstance(rule, ast.Comment):
        return rule.serialize() if rule.value.startswith("!") else ""
    if isinstance(rule, ast.AtRule) and rule.lower_at_keyword in ("media", "supports", "layer", "container") and rule.content:
        inside = tinycss2.parse_rule_list(rule.content, skip_comments=True, skip_whitespace=True)
        kept = "".join(_rule(one, here) for one in inside)
        return kept and f"@{rule.at_keyword}{tinycss2.serialize(rule.prelude)}{{{kept}}}"
    if not isinstance(rule, ast.QualifiedRule):
        return rule.serialize()
    selectors = [tinycss2.serialize(one).strip() for one in _selectors(rule.prelude) if all(name in here for name in _asked(one))]
    return f"{','.join(selectors)}{{{_short(rule.content)}}}" if selectors else ""


def _selectors(prelude: list[ast.Node]) -> Iterator[list[ast.Node]]:
    begin = 0
    for place, token in enumerate([*prelude, None]):
        if token is None or token == ",":
            yield prelude[begin:place]
            begin = place + 1


def _asked(selector: list[ast.Node]) -> Iterator[str]:
    """The classes and names that an element and those around it must have; what stands in brackets may be one of several."""
    for before, token in zip([None, *selector], selector, strict=False):
        if isinstance(token, ast.HashToken) or (isinstance(token, ast.IdentToken) and before == "."):
            yield token.value


def _short(content: list[ast.Node]) -> str:
    return "".join(" " if isinstance(one, ast.WhitespaceToken) else one.serialize() for one in content if one.type != "comment")


def letters(pages: Iterable[str], sheets: Iterable[str], scripts: Iterable[str]) -> str:
    """What pages, style sheets and scripts may show."""
    shown = {chr(code) for code in range(0x20, 0x7F)}
    for page in pages:
        shown.update(html.unescape(TAG.sub("", page)))
    for sheet in sheets:
        shown.update(sheet, *(chr(int(code, 16)) for code in ESCAPED.findall(sheet)))
    shown.update(*scripts)
    return "".join(sorted(shown))


def cut(font: Path, shown: str) -> bytes:
    """A font with these letters only; one that has none of them, as that which gives formulas lines without height, is whole."""
    face = TTFont(font, recalcTimestamp=False)
    if not {*map(ord, shown)} & {*face.getBestCmap()}:
        return font.read_bytes()
    smaller = subset.Subsetter(subset.Options(hinting=False, drop_tables=[*subset.Options().drop_tables, "FFTM"]))
    smaller.populate(text=shown)
    smaller.subset(face)
    face.flavor = "woff2"
    face.save(file := io.BytesIO())
    return file.getvalue()


def carried(folder: Path, shown: str) -> str:
    """A script with the fonts in it."""
    return SCRIPT_OF_FONTS % json.dumps([(*face, base64.b64encode(cut(folder / file, shown)).decode()) for *face, file in FONTS])


def write(app, exception: Exception | None) -> None:
    if exception or app.builder.format != "html":
        return
    root = Path(app.outdir)
    static = root / "_static"
    pages = [page.read_text(encoding="utf-8") for page in root.rglob("*.html")]
    scripts = [script.read_text(encoding="utf-8") for script in static.rglob("*.js")]
    here = used(pages, scripts)
    for path in (path for pattern in SHEETS for path in static.glob(pattern)):
        path.write_text(pruned(path.read_text(encoding="utf-8"), here), encoding="utf-8")
    sheets = [sheet.read_text(encoding="utf-8") for sheet in static.rglob("*.css")]
    (static / "fonts.js").write_text(carried(static / "fonts", letters(pages, sheets, scripts)), encoding="utf-8")


def setup(app) -> dict[str, bool]:
    app.add_js_file("fonts.js", priority=100)  # before all others
    app.connect("build-finished", write, priority=950)  # when all pages and sheets are there
    return {"parallel_read_safe": True, "parallel_write_safe": True}
