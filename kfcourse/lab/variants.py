"""The variants of the lab, read from TOML: variants.toml, tasks.toml, jumps.toml, or a file of
one's own."""

from __future__ import annotations

import tomllib
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from kfcourse.continuous.sampling import sampled
from kfcourse.errors import expect_sizes
from kfcourse.files import read_text
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model, nothing_random
from kfcourse.symbolic.reading import shown

SHIPPED = ("variants.toml", "tasks.toml", "jumps.toml")
KEYS = {
    "title", "steps", "state", "meter", "interval", "angles", "transition", "first", "parameters",
    "symbols", "prior", "state_noise", "meter_noise", "inputs", "modes", "runs",
}  # fmt: skip
# of an object in continuous time
IN_TIME = {"drift", "diffusion", "instants", "stratonovich", "substeps", "accuracy"}
OF_STEPS = {"state", "state_noise", "modes", "transition", "first"}
TRAJECTORIES, STEPS = 20_000, 51  # of the lab, where a variant does not say other numbers
RUNS = 40_000  # trajectories by which a variant is checked
MANY = 40  # names that a message lists


class VariantError(ValueError):
    """A file of variants, or a variant in it, cannot be used; the message names both."""


class VariantWarning(UserWarning):
    """A variant in a file is not a model, and is passed over."""


@dataclass(frozen=True)
class Variant:
    """A variant of the lab: its name in the file, a title, its model, how many measurements and
    trajectories.

    `table` is what it was read from.
    """

    name: str
    title: str
    model: Model | JumpModel
    steps: int = STEPS
    runs: int = TRAJECTORIES
    table: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)

    def plain(self, what: str) -> Model:
        """The model; VariantError, which says what knows no modes, if it has some."""
        if isinstance(self.model, JumpModel):
            raise VariantError(
                f"variant {self.name} jumps between modes ({', '.join(self.model.names)}), for "
                f"which "
                f"{what} are not made; `kfcourse lab {self.name}` compares filters on it "
                "(with --variants FILE if it is one of your own)"
            )
        return self.model


def load_variants(path: str | Path | None = None) -> dict[str, Variant]:
    """Read the variants without modes of a TOML file; by default those made for the exercises.

    Parameters
    ----------
    path : path, optional
        A file with tables ``[variants.NAME]``: `state`, `meter`, `parameters`, and optionally
        `title`, `symbols`, `prior`, `state_noise`, `meter_noise`, `inputs`, `interval`, `angles`
        (see `Model.define`); of an object in continuous time `drift` and `diffusion` in the place
        of `state`, and `instants` (see `kfcourse.continuous.sampled`).
        `steps` is how many measurements the lab takes, `runs` how many trajectories.  Those with
        `modes`, `transition`, `first` (see `JumpModel.define`), and the shipped tasks of the
        school's program, D1, D2 and D3, are read by `read_variants` and `find_variant`.

    Raises
    ------
    VariantError
        The file is missing or not TOML, or no variant in it is a model without modes.

    Warns
    -----
    VariantWarning
        A variant is not a model; the others can be used.
    """
    variants, faults = usable_variants(path)
    for fault in faults.values():
        warnings.warn(str(fault), VariantWarning, stacklevel=2)
    if not variants:
        raise VariantError(
            f"{path} has no other variants than those that jump between modes: "
            "`read_variants` reads them, or `find_variant` by name"
        )
    return variants


def usable_variants(
    path: str | Path | None = None,
) -> tuple[dict[str, Variant], dict[str, VariantError]]:
    """What `load_variants` reads; and, by name, what is wrong with the others."""
    variants, faults = read_variants(path, list(_shipped(SHIPPED[0])) if path is None else ())
    if not variants:
        raise next(iter(faults.values()))
    return {
        name: variant for name, variant in variants.items() if isinstance(variant.model, Model)
    }, faults


def find_variant(name: str, path: str | Path | None = None) -> Variant:
    """One variant by name; VariantError lists the names if there is no such."""
    variants, faults = read_variants(path, [name])
    for fault in faults.values():
        raise fault
    return variants[name]


def read_variants(
    path: str | Path | None = None, names: Sequence[str] = ()
) -> tuple[dict[str, Variant], dict[str, VariantError]]:
    """The variants of these names, or all of a file; and, by name, what is wrong with the others.

    Only what is asked for is built: a file may hold thousands.
    """
    variants: dict[str, Variant] = {}
    faults: dict[str, VariantError] = {}
    for name, table in read_tables(path, names).items():
        try:
            variants[name] = read_variant(name, table, str(path or "the shipped variants"))
        except VariantError as error:
            faults[name] = error
    return variants, faults


def read_tables(path: str | Path | None = None, names: Sequence[str] = ()) -> dict[str, Any]:
    """The tables of these names, or all, as they are written in a file; None: those shipped.

    Raises
    ------
    VariantError
        The file is missing or not TOML, or has no variant of such a name.
    """
    if path is None:
        tables = {name: table for file in SHIPPED for name, table in _shipped(file).items()}
    else:
        tables = _tables(Path(path))
    if unknown := [name for name in names if name not in tables]:
        more = f", ... ({len(tables)} in all)" if len(tables) > MANY else ""
        known = ", ".join([*tables][:MANY]) + more
        raise VariantError(f"no variant {', '.join(map(repr, unknown))}; there are {known}")
    return {name: tables[name] for name in dict.fromkeys(names) or tables}


def _shipped(file: str) -> dict[str, Any]:
    text = (resources.files("kfcourse.lab") / file).read_text(encoding="utf-8")
    return dict(tomllib.loads(text)["variants"])


def _tables(path: Path) -> dict[str, Any]:
    """The tables of a file of one's own."""
    text = read_text(path, VariantError)
    try:
        tables = tomllib.loads(text).get("variants")
    except (ValueError, RecursionError) as error:
        raise VariantError(
            f"{path} is not valid TOML: {error}; formulas and other texts stand in quotes, and a "
            f"number has a digit before "
            "its point, as in 0.9"
        ) from None
    if not isinstance(tables, dict) or not tables:
        raise VariantError(
            f'{path} has no variants; it needs tables such as [variants.53] with state = "..." '
            f'and meter = "..."'
        )
    return tables


def read_variant(name: str, table: Any, where: str) -> Variant:
    """A variant from its table; VariantError, naming the place, if it is not a model."""
    if not name.isprintable():  # it goes to terminals
        raise VariantError(
            f"variant {name!r} in {where}: a name with characters that cannot be seen; type it anew"
        )
    prefix = f"variant {name} in {where}: "
    if not isinstance(table, Mapping):
        raise VariantError(f"{prefix}expected a table [variants.{name}], got {shown(table)}")
    moves = not {"drift", "diffusion"}.isdisjoint(table)
    jumps = not {"modes", "transition", "first"}.isdisjoint(table)
    keys = KEYS - OF_STEPS | IN_TIME if moves else KEYS
    needed = {"meter", "drift", "diffusion"} if moves else {"meter", "state"}
    needed |= {"modes", "transition"} if jumps else set()
    unknown, missing = sorted(set(table) - keys), sorted(needed - set(table))
    if unknown or missing:
        problem = (
            f"unknown key {', '.join(unknown)}" if unknown else f"no {' and no '.join(missing)}"
        )
        raise VariantError(f"{prefix}{problem}; the keys are {', '.join(sorted(keys))}")
    try:
        given = {key: table[key] for key in table if key not in ("title", "steps", "runs")}
        model = (sampled if moves else JumpModel.define if jumps else Model.define)(**given)
        steps, runs = table.get("steps", STEPS), table.get("runs", TRAJECTORIES)
        expect_sizes(steps=steps, runs=runs)
    # FormulaError and ModelError are ValueErrors
    except (ValueError, TypeError, OverflowError) as error:
        raise VariantError(f"{prefix}{error}") from None
    for mode in model.modes if isinstance(model, JumpModel) else (model,):
        if problem := nothing_random(mode):
            raise VariantError(f"{prefix}{problem}")
    return Variant(name, on_a_line(str(table.get("title", ""))), model, steps, runs, dict(table))


def on_a_line(text: str) -> str:
    """A title or formula that goes to terminals: no line breaks, no characters that cannot be
    seen."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def summary(name: str, table: Mapping[str, Any]) -> str:
    """Name, title and equations as the table has them; a line for each mode, of what differs
    there."""
    lines = [f"{name:>6}  {on_a_line(str(table.get('title', ''))) or 'no title'}"]
    lines += [_equations(table)]
    for mode, own in table.get("modes", {}).items():
        values = {key: f"{value:g}" for key, value in own.get("parameters", {}).items()}
        formulas = {key: value for key, value in own.items() if key != "parameters"}
        parts = [f"{key} = {on_a_line(str(value))}" for key, value in (formulas | values).items()]
        lines.append(f"{mode}: {';  '.join(parts) or 'as above'}")
    return "\n        ".join(lines)


def _equations(table: Mapping[str, Any]) -> str:
    left, key = ("dx/dt", "drift") if "drift" in table else ("x'", "state")
    state, meter = (
        ", ".join(map(on_a_line, [side] if isinstance(side, str) else side))
        for side in (table[key], table["meter"])
    )
    pushed = f" + ({on_a_line(str(table['diffusion']))}) v" if key == "drift" else ""
    return f"{left} = {state}{pushed};  y = {meter}"
