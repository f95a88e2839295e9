"""Tables of numbers for people: a heading with units, aligned decimals, a caption."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from kfcourse.pages.verification import Shown
from kfcourse.symbolic.writing import by_thousands


def table(
    columns: Mapping[str, Iterable[Any]], formats: Mapping[str, str] | str = "", caption: str = ""
) -> Shown:
    """A table from its columns.

    Parameters
    ----------
    columns : mapping of headings (Markdown, units in brackets) to the entries of a column
        Numbers, set flush right so that decimals stand below each other; or texts, set flush left.
        A pair (value, error) is printed as value ± error.
    formats : mapping of headings to format specifications, or one for all numbers
        For instance ".3f".  NaN, "not there", is printed as a dash.
    caption : str
        Markdown above the table.

    Raises
    ------
    ValueError
        If their lengths differ.
    """
    listed = {heading: list(entries) for heading, entries in columns.items()}
    cells, rules = [], []
    for heading, entries in listed.items():
        style = formats if isinstance(formats, str) else formats.get(heading, "")
        cells.append([_cell(entry, style) for entry in entries])
        rules.append(":--" if all(isinstance(entry, str) for entry in entries) else "--:")
    rows = ["| " + " | ".join(row) + " |" for row in (listed, rules, *zip(*cells, strict=True))]
    above = f'<span class="kf-caption">{caption}</span>\n\n' if caption else ""
    return Shown(above + "\n".join(rows))


def _cell(entry: Any, style: str) -> str:
    if isinstance(entry, str):
        return entry
    if isinstance(entry, tuple):
        return " ± ".join(
            _cell(part, style if number == 0 else style.replace("+", ""))
            for number, part in enumerate(entry)
        )
    if isinstance(entry, float | np.floating) and np.isnan(entry):
        return "–"
    # as `claim` writes it
    return by_thousands(format(entry, style)).replace("-", "−").replace("%", "\u00a0%")
