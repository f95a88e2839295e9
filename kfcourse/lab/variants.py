"""The variants of the lab, read from TOML."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from kfcourse.symbolic.model import Model
from kfcourse.symbolic.sense import nothing_random

MODEL_KEYS = {"parameters", "symbols", "prior", "state_noise", "meter_noise", "inputs", "interval", "angles"}
VARIANT_KEYS = {"title", "state", "meter"} | MODEL_KEYS

LARGEST_FILE = 1_000_000  # bytes; thousands of variants.  /dev/zero never ends


class VariantError(ValueError):
    """A file of variants, or a variant in it, cannot be used; the message names the file and variant."""


@dataclass(frozen=True)
class Variant:
    """A variant of the lab: its name in the file, a title, its model, and the table of the file it was read from."""

    name: str
    title: str
    model: Model
    table: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)


def load_variants(path: str | Path | None = None) -> dict[str, Variant]:
    """Read a TOML file of variants; the shipped one by default.

    Parameters
    ----------
    path : path, optional
        A file with tables ``[variants.NAME]``: `state`, `meter`, `parameters`, and optionally `title`,
        `symbols`, `prior`, `state_noise`, `meter_noise`, `inputs`, `interval`, `angles` (see `Model.define`).

    Raises
    ------
    VariantError
        The file is missing or not TOML, or a variant in it is not a model; nothing else is read then.
    """
    where, tables = _tables(path)
    return {name: read_variant(name, table, where) for name, table in tables.items()}


def _tables(path: str | Path | None) -> tuple[str, dict[str, Any]]:
    """What a file is called in messages, and its tables."""
    where = "the shipped variants" if path is None else str(path)
    try:
        with (resources.files("kfcourse.lab") / "variants.toml" if path is None else Path(path)).open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
        if len(content) > LARGEST_FILE:
            raise VariantError(f"{where} has more than {LARGEST_FILE:,} bytes: it is no file of variants; check the path")
        text = content.decode("utf-8").replace("\r\n", "\n")
    except FileNotFoundError:
        raise VariantError(f"no file of variants at {where}; check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise VariantError(f"{where} cannot be read: {error}") from None
    try:
        tables = tomllib.loads(text).get("variants")
    except (ValueError, RecursionError) as error:  # TOMLDecodeError is a ValueError; so is a number of too many digits
        raise VariantError(f"{where} is not valid TOML: {error}") from None
    if not isinstance(tables, dict) or not tables:
        raise VariantError(f'{where} has no variants; it needs tables such as [variants.53] with state = "..." and meter = "..."')
    return where, tables


def read_variant(name: str, table: Any, where: str) -> Variant:
    """A variant from its table; VariantError, naming the place, if it is not a model."""
    if not name.isprintable():  # it goes to terminals
        raise VariantError(f"variant {name!r} in {where}: a name with characters that cannot be seen; type it anew")
    prefix = f"variant {name} in {where}: "
    if not isinstance(table, Mapping):
        raise VariantError(f"{prefix}expected a table [variants.{name}], got {table!r}")
    unknown, missing = sorted(set(table) - VARIANT_KEYS), sorted({"state", "meter"} - set(table))
    if unknown or missing:
        problem = f"unknown key {', '.join(unknown)}" if unknown else f"no {' and no '.join(missing)}"
        raise VariantError(f"{prefix}{problem}; the keys are {', '.join(sorted(VARIANT_KEYS))}")
    for key in ("parameters", "symbols", "prior", "state_noise", "meter_noise", "inputs"):
        if key in table and not isinstance(table[key], Mapping):
            raise VariantError(f"{prefix}`{key}` must be a table such as {{ c = 0.9 }}, got {table[key]!r}")
    options = {key: value for key, value in table.items() if key not in ("title", "state", "meter", "parameters")}
    try:
        model = Model.define(table["state"], table["meter"], table.get("parameters"), **options)
    except (ValueError, TypeError, OverflowError) as error:  # FormulaError and ModelError are ValueErrors
        raise VariantError(f"{prefix}{error}") from None
    if problem := nothing_random(model):
        raise VariantError(f"{prefix}{problem}")
    title = "".join(c if c.isprintable() else " " for c in str(table.get("title", "")))
    return Variant(name, " ".join(title.split()), model, dict(table))


def find_variant(name: str, path: str | Path | None = None) -> Variant:
    """One variant by name; VariantError lists the names if there is no such, and tells what is wrong in a file of yours."""
    where, tables = _tables(path)
    if name not in tables:
        raise VariantError(f"no variant {name!r}; there are {', '.join(tables)}")
    wanted = [name] if path is None else tables  # of the shipped ones, the others are models, too
    return {one: read_variant(one, tables[one], where) for one in wanted}[name]


def chosen_variants(names: Sequence[str], everything: bool, variants_file: Path | None) -> list[Variant]:
    """The variants of these names, each once, or all of them; ValueError if there is no such."""
    known = load_variants(variants_file)
    if everything:
        return list(known.values())
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError(f"no variant {', '.join(unknown)}; there are {', '.join(known)}")
    return [known[name] for name in dict.fromkeys(names)]
