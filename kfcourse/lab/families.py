"""The families of filters: what each is called, in both languages, and how it is drawn:
families.toml, a table a family.  The words of reports and figures: report.toml, a table a language.

Filters of a family share its equations (`kfcourse.filters.EQUATIONS`, by the same name), colour and
marker, and differ in their structural functions (dashes) or in the length of their memory.
"""

from __future__ import annotations

import tomllib
from importlib import resources
from typing import Any, NamedTuple


class Family(NamedTuple):
    """Names of a family and its look in figures.

    title, russian            in tables: "FOS", "ФОС"
    heading, russian_heading  of the section with its equations in reports; "" if `EQUATIONS` has
                              none of it
    colour, marker            Matplotlib's
    memory                    whether its filters remember several steps
    """

    title: str
    russian: str
    heading: str = ""
    russian_heading: str = ""
    colour: str = "#555555"
    marker: str = "."
    memory: bool = False


def _read(file: str) -> dict[str, dict[str, Any]]:
    return tomllib.loads((resources.files("kfcourse.lab") / file).read_text(encoding="utf-8"))


FAMILIES = {name: Family(**table) for name, table in _read("families.toml").items()}
# Of reports and figures, by language.
WORDS: dict[str, dict[str, str]] = _read("report.toml")


def look(name: str) -> tuple[str, str]:
    """Colour and marker of a family, or of a filter by its short name: FAMILY[NUMBER]-FUNCTIONS."""
    kind = name.partition("-")[0]
    keys = (name, kind, kind.rstrip("0123456789"))
    return next((FAMILIES[key] for key in keys if key in FAMILIES), Family(name, name))[4:6]
