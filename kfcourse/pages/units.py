"""Units in labels of figures and headings of tables: one form over the whole book."""

from __future__ import annotations

import re
from collections.abc import Iterable

# What numbers are followed by, on pages and in labels.
UNIT = r"(?:%|°|(?:s\.d\.|[kMG]?Hz|[kMG]?B|dB|px|deg|m?rad|CPU-s|[km]?m|[mµ]?s|V|min|h)(?:/(?:s|min|h))?[²³]?(?![\w-]))"
_AFTER_A_COMMA = re.compile(rf"^(.*?\S),\s({UNIT})(?:[,;:.]|\s(?:±|a\b|of\b)|$)", re.DOTALL)


def in_brackets(labels: Iterable[str]) -> None:
    """Raise ValueError for the first of the labels whose unit follows a comma: "time, s" is written "time (s)"."""
    for label in labels:
        if found := _AFTER_A_COMMA.match(label.strip()):
            better = f"{found[1]} ({found[2]}){label.strip()[found.end(2) :]}"
            raise ValueError(f"the unit of the label {label!r} stands after a comma; units stand in brackets: {better}")
