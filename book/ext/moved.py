"""Sphinx extension: old addresses lead on to the pages that have taken their chapters in."""

from __future__ import annotations

from collections.abc import Iterator

MOVED = {
    "better-than-a-tangent": "when-linearisation-fails",
    "checking-exact": "comparison",
    "derive-it": "live-lab",
    "extended-kalman": "linearisation",
    "integration-limits": "four-sensors",
    "lecture-continuous": "continuous",
    "manoeuvres": "models-that-jump",
    "particles": "grid",
    "radar-extended": "radar-tracking",
}


def pages(app) -> Iterator[tuple[str, dict[str, str], str]]:
    """A page without text at each old address; see _templates/moved.html."""
    for old, new in MOVED.items():
        yield old, {"address": app.builder.get_relative_uri(old, new)}, "moved.html"


def setup(app) -> dict[str, bool]:
    app.connect("html-collect-pages", pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
