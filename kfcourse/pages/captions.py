"""Words about a figure that its picture contradicts.

`drawn` says what a picture has: for each panel its place, its words and colours and dashes, those of what has a name by name.
`contradicted` reads a caption with it.  Five rules, none of which needs to know what the figure is about:

* a colour or dashes beside a name, "the DUOF (orange)", "the dashed tangent", are those of the curve with this name;
* what is said of a panel, "Left, ...", speaks of colours and dashes that this panel has, of each of two once, and there are as
  many panels as it says;
* sentences about two panels have no fewer words (of titles, axes, names) in common with them than with the panels exchanged;
* what is said to rise or fall, by its name, colour or dashes, does so somewhere, by a third of its height;
* of two that are said to lie one above or below the other, some pair of curves does so on the average.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import rgb_to_hsv, to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

DASHES = {"-": "solid", "--": "dashed", "dashed": "dashed", ":": "dotted", "dotted": "dotted"}
HUES = {"red": (335, 12), "orange": (8, 48), "green": (70, 170), "blue": (170, 255), "purple": (250, 345)}  # degrees
LOOKS = {*DASHES.values(), *HUES, "black", "grey"}
_RISES, _FALLS = r"rises?|grows?|climbs?", r"falls?|sinks?|drops?"
_SAMPLES = 60  # of a curve's points
_SIDE = re.compile(r"(?:^|(?<=[.;] ))(left|right|above|below|top|bottom)(?=[,:])", re.IGNORECASE)
_NUMBERS = ("two", "three", "four", "five", "six")
_NO_NAMES = {"the", "and", "with", "one", "exact", "of", "at", "step", "time", "filter"}  # in names, and in any sentence


def drawn(figure: Figure) -> list[dict[str, Any]]:
    """The panels of a picture: place (row, column), words, looks, and names with their looks."""
    found = []
    for ax in figure.axes:
        place = ax.get_subplotspec()
        looks = [(str(line.get_label()), _looks(line)) for line in ax.get_lines()]
        looks += [(text.get_text(), _hues(text.get_color())) for text in ax.texts]
        looks += [
            (str(one.get_label()), {hue for colour in one.get_facecolor() for hue in _hues(colour)}) for one in ax.collections
        ]
        looks += [("_", {hue for colour in one.get_edgecolor() for hue in _hues(colour)}) for one in ax.collections]
        patches = [*ax.patches, *(arrow for text in ax.texts if (arrow := getattr(text, "arrow_patch", None)))]
        looks += [("_", {DASHES.get(str(one.get_linestyle()), ""), *_hues(one.get_facecolor())} - {""}) for one in patches]
        names = [(name, sorted(look)) for name, look in looks if name and not name.startswith("_") and name != "None"]
        curves = [curve for line in ax.get_lines() if (curve := _curve(ax, line))] if ax.name == "rectilinear" else []
        said = [ax.get_title(), ax.get_title("left"), ax.get_xlabel(), ax.get_ylabel(), *(text.get_text() for text in ax.texts)]
        found.append(
            {
                "place": [place.rowspan.start, place.colspan.start] if place else [0, 0],
                "words": sorted(_words(" ".join(said))),
                "looks": sorted(set().union(*(look for _, look in looks))),
                "names": names,
                "together": sorted({tuple(sorted(look)) for _, look in looks if len(look) > 1}),
                "curves": curves,
            }
        )
    return found


def contradicted(words: str, panels: list[dict[str, Any]]) -> list[str]:
    """What a caption says, and the picture does not show."""
    words = " ".join(words.split())
    return [*_of_names(words, panels), *_of_panels(words, panels), *_of_curves(words, panels)]


def _of_names(words: str, panels: list[dict[str, Any]]) -> Iterator[str]:
    """Looks beside a name that no curve of this name has."""
    looks: dict[str, set[str]] = {}
    for panel in panels:
        for name, look in panel["names"]:
            for word in _words(name) - _NO_NAMES:
                looks.setdefault(word, set()).update(look)
    if not looks:
        return
    any_name = "|".join(map(re.escape, looks))
    any_look = "|".join(LOOKS)
    after = re.compile(rf"\b({any_name})\b(?: \w+)?(?: filter)? \(({any_look})\b((?:, (?:{any_look}))*)", re.IGNORECASE)
    before = re.compile(rf"\b({any_look}) ({any_name})\b", re.IGNORECASE)
    pairs = [(one[1], [one[2], *re.findall(any_look, one[3])], one[0]) for one in after.finditer(words)]
    pairs += [(one[2], [one[1]], one[0]) for one in before.finditer(words)]
    for name, said, text in pairs:
        if has := looks[name.lower()] & LOOKS:
            yield from (f"{text!r}: it is {', '.join(sorted(has))}" for look in said if look.lower() not in has)


def _of_panels(words: str, panels: list[dict[str, Any]]) -> Iterator[str]:
    """A wrong number of panels; looks that a panel has not; sentences that would fit better with panels exchanged."""
    places = {tuple(panel["place"]): panel for panel in panels}
    for number, what in re.findall(r"\b(two|three|four|five|six) (?:\w+[ -]){0,2}(panels|maps)\b", words, re.IGNORECASE):
        if len(places) != _NUMBERS.index(number.lower()) + 2:
            yield f"{number} {what}: there are {len(places)}"
    if absent := sorted((LOOKS & _words(words)).difference(*(panel["looks"] for panel in panels))):
        yield f"{', '.join(absent)}: no panel has it"
    drawn_so = [set(look) for panel in panels for look in panel.get("together", [])]
    for one, other in re.findall(rf"\b({'|'.join(LOOKS)})(?:, | )({'|'.join(LOOKS)})\b", words, re.IGNORECASE):
        if drawn_so and not any({one.lower(), other.lower()} <= look for look in drawn_so):
            yield f"{one}, {other}: nothing is both"
    if len(places) != 2:
        return
    spoken = [side for side, _ in _sided(words)]
    yield from (f"{side} is said twice" for side in sorted(set(spoken)) if spoken.count(side) > 1)
    shared = set.intersection(*(set(panel["words"]) for panel in panels))
    first, last = (places[place] for place in sorted(places))
    across = first["place"][0] == last["place"][0]
    fits = others = 0
    for side, said in _sided(words):
        if (side in ("left", "right")) == across:
            here, there = (first, last) if side in ("left", "above", "top") else (last, first)
            if absent := sorted(LOOKS & _words(said) - set(here["looks"])):
                yield f"{side}: {', '.join(absent)} is not there, but {', '.join(here['looks'])}"
            fits += len(_words(said) & (set(here["words"]) - shared))
            others += len(_words(said) & (set(there["words"]) - shared))
    if others > fits:
        yield f"panels exchanged: {words}"


def _of_curves(words: str, panels: list[dict[str, Any]]) -> Iterator[str]:
    """Curves that do not rise or fall as is said, or that lie on the other side of another one."""
    curves = [curve for panel in panels for curve in panel.get("curves", [])]
    if not curves:
        return
    names = {word for curve in curves if not curve["name"].startswith("_") for word in _words(curve["name"])} - _NO_NAMES
    one = "|".join(sorted(map(re.escape, names | LOOKS), key=len, reverse=True))
    meant = rf"(?P<{{}}>(?:{one})(?: (?:{one}))*)"
    thing = r"(?: (?:curves?|lines?|ones?|filters?|errors?))?"
    moved = re.compile(rf"\b{meant.format('what')}{thing}(?: (?!and\b)\w+)?? (?:{_RISES}|{_FALLS})\b", re.IGNORECASE)
    for said in moved.finditer(words):
        up = bool(re.search(rf"\b(?:{_RISES})$", said[0], re.IGNORECASE))
        candidates = _meant(said["what"], curves)
        if candidates and not any(_moves(curve["places"], up) for curve in candidates):
            yield f"{said[0]!r}: nothing there {'rises' if up else 'falls'}"
    beside = r"(?: \w+){0,3}? (?P<side>above|below) (?:that of )?(?:the |all )?"
    placed = re.compile(rf"\b{meant.format('what')}{thing}{beside}{meant.format('other')}\b", re.IGNORECASE)
    for said in placed.finditer(words):
        pairs = [
            higher
            for panel in panels
            for first in _meant(said["what"], panel.get("curves", []))
            for second in _meant(said["other"], panel.get("curves", []))
            if first is not second and (higher := _higher(first["places"], second["places"])) is not None
        ]
        if pairs and not any((higher > 0) == (said["side"].lower() == "above") for higher in pairs):
            yield f"{said[0]!r}: it is the other way round"


def _meant(what: str, curves: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The curves that have all these looks and one of these names."""
    said = _words(what)
    looks, names = said & LOOKS, said - LOOKS
    return [
        curve
        for curve in curves
        if looks <= set(curve["looks"]) and (not names or {name.lower() for name in names} & _words(curve["name"]))
    ]


def _moves(places: list[list[float]], up: bool) -> bool:
    """Does a curve rise, or fall, as it is drawn or to the right, by a third of what it does at all?"""
    ways = (np.array([y for _, y in way]) * (1 if up else -1) for way in (places, sorted(places)))
    return any(np.max(heights - np.minimum.accumulate(heights)) > max(np.ptp(heights) / 3, 0.01) for heights in ways)


def _higher(one: list[list[float]], other: list[list[float]]) -> float | None:
    """How much higher one curve is than the other, where both are; None if nowhere."""
    (x, y), (x_other, y_other) = (np.array(sorted(places)).T for places in (one, other))
    both = x[(x >= x_other[0]) & (x <= x_other[-1])]
    return float(np.mean(np.interp(both, x, y) - np.interp(both, x_other, y_other))) if len(both) else None


def _sided(words: str) -> Iterator[tuple[str, str]]:
    """Sides, and what is said of them: after "Left, " to the next one, or before "(left)"."""
    parts = _SIDE.split(words)[1:]
    yield from zip(map(str.lower, parts[::2]), parts[1::2], strict=True)
    yield from ((one[2], one[1]) for one in re.finditer(r"([^.;:()]+)\((left|right|above|below|top|bottom)\)", words))


def _words(text: str) -> set[str]:
    """Its words, and its formulas without spaces."""
    formulas = {re.sub(r"\s|\\,", "", formula) for formula in re.findall(r"\$[^$]*\$", text)}
    return formulas | {word.lower() for word in re.findall(r"[A-Za-z]{3,}", re.sub(r"\$[^$]*\$", " ", text))}


def _curve(ax: Axes, line: Line2D) -> dict[str, Any] | None:
    """A line's name and looks, where it runs, in parts of the panel's width and height, and its values at both ends, the least
    and the largest; none if it is no curve."""
    points = np.asarray(line.get_xydata(), float)
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 2 or line.get_transform() != ax.transData:
        return None
    order = points[np.linspace(0, len(points) - 1, min(len(points), _SAMPLES)).round().astype(int)]
    places = ax.transAxes.inverted().transform(ax.transData.transform(order))
    first, *_, last = values = points[:, 1]
    return {
        "name": str(line.get_label()),
        "looks": sorted(_looks(line)),
        "places": np.round(places, 3).tolist(),
        "values": [float(f"{one:.4g}") for one in (first, last, min(values), max(values))],
    }


def _looks(line: Line2D) -> set[str]:
    return {DASHES.get(str(line.get_linestyle()), ""), *_hues(line.get_color())} - {""}


def _hues(colour: Any) -> set[str]:
    """What a colour is called; none if it is hardly there."""
    red, green, blue, opacity = to_rgba(colour)
    hue, saturation, value = rgb_to_hsv((red, green, blue))
    if opacity < 0.05:
        return set()
    if saturation < 0.15:
        return {"black"} if value < 0.2 else {"grey"} if value < 0.95 else set()
    return {name for name, (low, high) in HUES.items() if (360 * hue - low) % 360 <= (high - low) % 360}
