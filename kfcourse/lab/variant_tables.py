"""The tables of a file of variants, as they are written there: what lists variants needs no model of them."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

RUNS = 40_000  # trajectories by which a variant is checked
SHIPPED = ("variants.toml", "tasks.toml", "jumps.toml")
MANY = 40  # names that a message lists
LARGEST_FILE = 1_000_000  # bytes; thousands of variants.  /dev/zero never ends


class VariantError(ValueError):
    """A file of variants, or a variant in it, cannot be used; the message names the file and variant."""


def read_tables(path: str | Path | None = None, names: Sequence[str] = ()) -> tuple[str, dict[str, Any]]:
    """What a file, or None, those that are shipped, is called in messages; and its tables of these names, or all.

    Raises
    ------
    VariantError
        The file is missing or not TOML, or has no variant of such a name.
    """
    where, tables = _all_tables(path)
    if unknown := [name for name in names if name not in tables]:
        raise VariantError(f"no variant {', '.join(map(repr, unknown))}; there are {_listed(list(tables))}")
    return where, {name: tables[name] for name in dict.fromkeys(names) or tables}


def _listed(names: list[str]) -> str:
    return ", ".join(names if len(names) <= MANY else [*names[:MANY], f"... ({len(names)} in all)"])


def shipped(file: str) -> dict[str, Any]:
    """The tables of a shipped file."""
    text = (resources.files("kfcourse.lab") / file).read_text(encoding="utf-8")
    return dict(tomllib.loads(text)["variants"])


def _all_tables(path: str | Path | None) -> tuple[str, dict[str, Any]]:
    if path is None:
        return "the shipped variants", {name: table for file in SHIPPED for name, table in shipped(file).items()}
    where = str(path)
    try:
        with Path(path).open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
        if len(content) > LARGEST_FILE:
            raise VariantError(f"{where} has more than {LARGEST_FILE:,} bytes: it is no file of variants; check the path")
        text = content.decode("utf-8-sig").replace("\r\n", "\n")
    except FileNotFoundError:
        raise VariantError(f"no file of variants at {where}; check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise VariantError(f"{where} cannot be read: {error}") from None
    try:
        tables = tomllib.loads(text).get("variants")
    except tomllib.TOMLDecodeError as error:
        raise VariantError(f"{where} is not valid TOML: {error}{_line_of(text, error)}") from None
    except (ValueError, RecursionError) as error:
        what = "lists in too many lists" if isinstance(error, RecursionError) else "a number of thousands of digits"
        raise VariantError(f"{where} holds {what}, and is not read; no variant needs that") from None
    if not isinstance(tables, dict) or not tables:
        raise VariantError(f'{where} has no variants; it needs tables such as [variants.53] with state = "..." and meter = "..."')
    return where, tables


def _line_of(text: str, error: tomllib.TOMLDecodeError) -> str:
    """The line that is no TOML and, of the two ways in which a value is most often written wrongly, how it is written right."""
    place = re.search(r"at line (\d+), column (\d+)", str(error))
    if not place:
        return ""
    line, column = text.split("\n")[int(place[1]) - 1], int(place[2]) - 1
    cure = ""
    if re.match(r"[+-]?\.\d", line[column:]):
        cure = "; a number has a digit before its point, as in 0.9"
    elif "Invalid value" in str(error):
        cure = "; formulas and other texts stand in quotes"
    return f": {on_a_line(line):.80}{cure}"


def on_a_line(text: str) -> str:
    """A title or formula that goes to terminals: without line breaks and characters that cannot be seen."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def summary(name: str, table: Mapping[str, Any]) -> str:
    """Name, title and equations as the table of a variant has them; with modes a line for each, of what differs there."""
    modes: Mapping[str, Mapping[str, Any]] = table.get("modes", {})
    numbers = [{**table.get("parameters", {}), **mode.get("parameters", {})} for mode in modes.values()]
    formulas = [_equations({**table, **mode}) for mode in modes.values()] or [_equations(table)]
    common = formulas[:1] if len(set(formulas)) == 1 else []
    lines = [f"{name:>6}  {on_a_line(str(table.get('title', ''))) or 'no title'}", *common]
    for mode, formula, values in zip(modes, formulas, numbers, strict=bool(modes)):
        own = [f"{key} = {value:g}" for key, value in values.items() if any(one.get(key) != value for one in numbers)]
        lines.append(f"{mode}: {';  '.join(own if common else [formula, *own])}")
    return "\n        ".join(lines)


def _equations(table: Mapping[str, Any]) -> str:
    state, meter = ([one] if isinstance(one, str) else one for one in (table["state"], table["meter"]))
    return f"x' = {', '.join(map(on_a_line, state))};  y = {', '.join(map(on_a_line, meter))}"
