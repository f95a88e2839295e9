"""Sphinx extension: old addresses lead on.

Once all chapters stood in one folder; some were later taken in by others.
"""

from __future__ import annotations

from collections.abc import Iterator

from equations import FOLDERS

TAKEN_IN = {
    "better-than-a-tangent": "beyond/when-linearisation-fails",
    "checking-exact": "course/comparison",
    "derive-it": "course/live-lab",
    "extended-kalman": "course/linearisation",
    "integration-limits": "beyond/four-sensors",
    "lecture-continuous": "course/continuous",
    "manoeuvres": "beyond/models-that-jump",
    "particles": "beyond/grid",
    "radar-extended": "course/radar-tracking",
}


def pages(app) -> Iterator[tuple[str, dict[str, str], str]]:
    """A page without text at each old address; see _templates/moved.html."""
    parted = (name.split("/") for name in sorted(app.env.found_docs) if "/" in name)
    moved = {page: f"{folder}/{page}" for folder, page in parted if folder in FOLDERS}
    for old, new in (moved | TAKEN_IN).items():
        yield old, {"address": app.builder.get_relative_uri(old, new)}, "moved.html"


def setup(app) -> dict[str, bool]:
    app.connect("html-collect-pages", pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
