"""The variants of the lab, read from TOML."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from kfcourse.lab.variant_tables import SHIPPED, VariantError, on_a_line, read_tables, shipped
from kfcourse.symbolic.jumping import JumpModel, model_of_table
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import shown
from kfcourse.symbolic.sense import nothing_random

MODEL_KEYS = {"parameters", "symbols", "prior", "state_noise", "meter_noise", "inputs", "interval", "angles"}
JUMP_KEYS = {"modes", "transition", "first"}
VARIANT_KEYS = {"title", "steps", "state", "meter"} | MODEL_KEYS | JUMP_KEYS
STEPS = 51  # of the lab, where a variant does not say another number


class VariantWarning(UserWarning):
    """A variant in a file is not a model, and is passed over."""


@dataclass(frozen=True)
class Variant:
    """A variant of the lab: its name in the file, a title, its model, how many measurements, and the table it was read from."""

    name: str
    title: str
    model: Model | JumpModel
    steps: int = STEPS
    table: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)

    def plain(self, what: str) -> Model:
        """The model; VariantError, which says what knows no modes, if it has some."""
        if isinstance(self.model, JumpModel):
            raise VariantError(
                f"variant {self.name} jumps between modes ({', '.join(self.model.names)}), for which {what} are not made; "
                f"`kfcourse lab {self.name}` compares filters on it (with --variants FILE if it is one of your own)"
            )
        return self.model


def load_variants(path: str | Path | None = None) -> dict[str, Variant]:
    """Read the variants without modes of a TOML file; by default the shipped ones that are made for the exercises.

    Parameters
    ----------
    path : path, optional
        A file with tables ``[variants.NAME]``: `state`, `meter`, `parameters`, and optionally `title`,
        `symbols`, `prior`, `state_noise`, `meter_noise`, `inputs`, `interval`, `angles` (see `Model.define`).
        `steps` is how many measurements the lab takes.  Those with `modes`, `transition`, `first` (see `JumpModel.define`), and
        the shipped tasks of the school's program, D1, D2 and D3, are read by `read_variants` and `find_variant`.

    Raises
    ------
    VariantError
        The file is missing or not TOML, or no variant in it is a model without modes.

    Warns
    -----
    VariantWarning
        A variant is not a model; the others can be used.
    """
    found, faults = usable_variants(path)
    for fault in faults.values():
        warnings.warn(str(fault), VariantWarning, stacklevel=2)
    if not found:
        cure = "`read_variants` reads them, or `find_variant` by name"
        raise VariantError(f"{path} has no other variants than those that jump between modes: {cure}")
    return found


def usable_variants(path: str | Path | None = None) -> tuple[dict[str, Variant], dict[str, VariantError]]:
    """What `load_variants` reads; and, by name, what is wrong with the others. VariantError as there."""
    found, faults = read_variants(path, [*shipped(SHIPPED[0])] if path is None else ())
    if not found:
        raise next(iter(faults.values()))
    return {name: one for name, one in found.items() if isinstance(one.model, Model)}, faults


def read_variants(
    path: str | Path | None = None, names: Sequence[str] = ()
) -> tuple[dict[str, Variant], dict[str, VariantError]]:
    """The variants of these names, or all of a file; and, by name, what is wrong with those that are none.

    Only what is asked for is built: a file may hold thousands.

    Raises
    ------
    VariantError
        The file is missing or not TOML, or has no variant of such a name.
    """
    where, tables = read_tables(path, names)
    found: dict[str, Variant] = {}
    faults: dict[str, VariantError] = {}
    for name, table in tables.items():
        try:
            found[name] = read_variant(name, table, where)
        except VariantError as error:
            faults[name] = error
    return found, faults


def read_variant(name: str, table: Any, where: str) -> Variant:
    """A variant from its table; VariantError, naming the place, if it is not a model."""
    if not name.isprintable():  # it goes to terminals
        raise VariantError(f"variant {name!r} in {where}: a name with characters that cannot be seen; type it anew")
    prefix = f"variant {name} in {where}: "
    if not isinstance(table, Mapping):
        raise VariantError(f"{prefix}expected a table [variants.{name}], got {shown(table)}")
    unknown, missing = sorted(set(table) - VARIANT_KEYS), sorted({"state", "meter"} - set(table))
    if unknown or missing:
        problem = f"unknown key {', '.join(unknown)}" if unknown else f"no {' and no '.join(missing)}"
        raise VariantError(f"{prefix}{problem}; the keys are {', '.join(sorted(VARIANT_KEYS))}")
    for key in ("parameters", "symbols", "prior", "state_noise", "meter_noise", "inputs", "modes"):
        if key in table and not isinstance(table[key], Mapping):
            raise VariantError(f"{prefix}`{key}` must be a table such as {{ c = 0.9 }}, got {shown(table[key])}")
    try:
        model = model_of_table(table)
    except (ValueError, TypeError, OverflowError) as error:  # FormulaError and ModelError are ValueErrors
        raise VariantError(f"{prefix}{error}") from None
    steps = table.get("steps", STEPS)
    if isinstance(steps, bool) or not isinstance(steps, int) or steps < 1:
        raise VariantError(f"{prefix}`steps` must be a positive whole number of measurements, got {shown(steps)}")
    for mode in model.modes if isinstance(model, JumpModel) else (model,):
        if problem := nothing_random(mode):
            raise VariantError(f"{prefix}{problem}")
    return Variant(name, on_a_line(str(table.get("title", ""))), model, steps, dict(table))


def find_variant(name: str, path: str | Path | None = None) -> Variant:
    """One variant by name; VariantError lists the names if there is no such, and tells what is wrong with it."""
    return chosen_variants([name], False, path)[0]


def chosen_variants(names: Sequence[str], everything: bool, path: str | Path | None = None) -> list[Variant]:
    """The variants of these names, each once, or all that can be used (`load_variants`).

    VariantError if there is no such, or if one of them is not a model.
    """
    if everything:
        return list(load_variants(path).values())
    found, faults = read_variants(path, names)
    for fault in faults.values():
        raise fault
    return list(found.values())
