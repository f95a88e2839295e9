"""Texts of other people: in a folder's name, on a terminal, in a table that a spreadsheet opens."""

from __future__ import annotations

import csv
import io
import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2

from kfcourse.exercises.derivations.wording import coded
from kfcourse.files import save

FORMULA = ("=", "+", "-", "@")  # full-width ones are taken for these
GUARD = "'"


def safe(name: str) -> str:
    """A name as one component of a path, on every system."""
    return re.sub(r"[^\w.-]+", "-", unicodedata.normalize("NFC", name)).strip(".-") or "unnamed"


def clean(text: str, length: int = 200) -> str:
    """A text on one line without control characters: no terminal takes a part of it for a
    command."""
    line = "".join(c if c.isprintable() else " " for c in text)
    line = " ".join(line.split())
    return line if len(line) <= length else line[: length - 1] + "…"


def page(name: str, **values: Any) -> str:
    """A page of HTML from a template of this folder; `coded` marks code in a text."""
    loader = jinja2.PackageLoader("kfcourse.exercises.notebooks")
    environment = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True)
    environment.filters["coded"] = coded
    return environment.get_template(f"{name}.html.j2").render(**values)


def write_csv(columns: Sequence[str], rows: Iterable[Mapping[str, Any]], path: Path) -> None:
    """Write a table completely or not at all, every text in it `cautious`; what a row has not stays
    empty."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(
        {key: cautious(value) if isinstance(value, str) else value for key, value in row.items()}
        for row in rows
    )
    save("\ufeff" + text.getvalue(), path)


def cautious(text: str) -> str:
    """A text that no spreadsheet takes for a formula: such a one gets an apostrophe; tabs and their
    like are spaces.

    >>> from kfcourse.exercises.notebooks.texts import cautious
    >>> cautious("=1+1"), cautious("\\t=1+1"), cautious("\uff1d1+1"), cautious("a = 1")
    ("'=1+1", "' =1+1", "'\uff1d1+1", 'a = 1')
    """
    text = "".join(" " if unicodedata.category(c) in ("Cc", "Cs") else c for c in text)
    return GUARD + text if _begins_a_formula(text) else text


def plain(text: str) -> str:
    """The text that `cautious` has given an apostrophe."""
    return text[1:] if text.startswith(GUARD) and _begins_a_formula(text[1:]) else text


def _begins_a_formula(text: str) -> bool:
    """Whether a spreadsheet may see a formula in it, behind spaces and what cannot be seen."""
    start = "".join(c for c in text if c.isprintable()).lstrip(GUARD + " ")
    return unicodedata.normalize("NFKC", start[:1]).startswith(FORMULA)
