"""The text of a whole derivation: headings that say what letters mean, and chains of lines.

variant 53          whose structural functions and parameters the letters are
linearised          tau, Theta, h, G, F are those of the tangent; otherwise the exact ones
x ~ N(m, d)         letters of the law that means are over
positive c, g       letters that are positive; variances are without saying
letters S, q        more letters that may be used

::

    F = M[(g*x + f*x^2*w - h)^2]                a chain: name = line, and lines that begin with =
      = g^2*M[(x-m)^2] + f^2*M[x^4]             # what follows this sign is a remark
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from kfcourse.exercises.derivations.setting import KINDS, Setting, of_model
from kfcourse.symbolic.formula import check_name
from kfcourse.symbolic.model import Model

MOST_LINES = 400
_PIECE = re.compile(r"(?:^|=)\s*([^=]*)")

FindModel = Callable[[str], Model]


class DerivationError(ValueError):
    """A derivation cannot be read as a whole: too long, a heading without meaning."""


class Typed(NamedTuple):
    """One expression of a chain: number of its line, where it begins there, its text."""

    line: int
    column: int
    text: str


@dataclass
class Chain:
    """Expressions that should be equal, and the setting at the first of them."""

    setting: Setting
    links: list[Typed] = field(default_factory=list)


def read_chains(text: str, find: FindModel | None, setting: Setting | None = None) -> list[Chain]:
    """The chains of a text.

    Parameters
    ----------
    text : str
    find : callable or None
        Name of a variant -> its model; None where no heading may name one.
    setting : Setting, optional
        What letters mean before any heading.

    Raises
    ------
    DerivationError
        Too many lines, or a line that is neither heading nor chain.
    """
    setting = Setting() if setting is None else setting
    lines = text.splitlines()
    if len(lines) > MOST_LINES:
        raise DerivationError(
            f"the derivation has {len(lines)} lines; at most {MOST_LINES} are checked: split it up"
        )
    chains, goes_on = list[Chain](), False
    for number, line in enumerate(lines, 1):
        line = line.partition("#")[0].rstrip()
        if not line.strip():
            continue
        if "=" not in line:
            goes_on = False
            setting = _heading(line.strip(), number, setting, find)
            continue
        pieces = [
            Typed(number, piece.start(1), piece[1].rstrip()) for piece in _PIECE.finditer(line)
        ]
        if pieces[0].text:
            chains.append(Chain(setting))
            goes_on = True
        elif not goes_on:
            raise DerivationError(
                f"line {number}: {line.strip()[:60]!r} goes on, but nothing stands above it; "
                f"begin with a name, as in F = ..."
            )
        else:
            pieces = pieces[1:]
        chains[-1].links += pieces
    return chains


def _heading(line: str, number: int, setting: Setting, find: FindModel | None) -> Setting:
    """The setting after a heading."""
    word, _, rest = line.partition(" ")
    if word == "variant" and rest.strip():
        if find is None:
            raise DerivationError(f"line {number}: the model is given: leave out {line[:60]!r}")
        return of_model(find(rest.strip()), setting.kind)
    if line in KINDS:
        return (
            replace(setting, kind=line) if setting.model is None else of_model(setting.model, line)
        )
    if match := re.fullmatch(r"x\s*~\s*N\s*\(\s*(\w+)\s*,\s*(\w+)\s*\)", line):
        return setting.at(*(_name(name, number) for name in match.groups()))
    if word in ("positive", "letters") and rest.strip():
        names = frozenset(_name(name, number) for name in re.split(r"[\s,]+", rest.strip()))
        if word == "positive":
            return replace(setting, positive=setting.positive | names)
        return setting if setting.known is None else replace(setting, known=setting.known | names)
    raise DerivationError(
        f"line {number}: {line[:60]!r} has no =, and is no heading; headings are: variant 53, "
        f"linearised, gaussian, x ~ N(m, d), "
        "positive c, g, letters S, q"
    )


def _name(text: str, number: int) -> str:
    try:
        return text if text == "lambda" else check_name(text)
    except ValueError as error:
        raise DerivationError(f"line {number}: {error}") from None
