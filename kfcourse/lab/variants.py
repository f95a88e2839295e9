"""The lab: its variants and its filters by their short names."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from kfcourse.filters import Design, Filter, aof, duof, fos, mfos, particle, pointmass
from kfcourse.symbolic.model import Model, ModelError
from kfcourse.symbolic.moments import NoClosedForm
from kfcourse.symbolic.structure import Structure, gauss_hermite, gaussian, linearised, unscented

VARIANT_KEYS = {"title", "state", "meter", "parameters", "symbols", "prior", "state_noise", "meter_noise"}


class VariantError(ValueError):
    """A file of variants, or a variant in it, cannot be used; the message names the file and variant."""


@dataclass(frozen=True)
class Variant:
    """A variant of the lab: its name in the file, a title, its model, and the table of the file it was read from."""

    name: str
    title: str
    model: Model
    table: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)


class Structures:
    """The structural functions of a model, derived when first asked for."""

    def __init__(self, model: Model):
        self.model = model

    @cached_property
    def linearised(self) -> Structure:
        return linearised(self.model)

    @cached_property
    def gaussian(self) -> Structure:
        return gaussian(self.model)


class Entry(NamedTuple):
    """A filter of the lab: printed names and how to build it."""

    title: str
    russian: str
    build: Callable[[Structures], Filter | Design]


# One line a filter: this is where a new one is added.
FILTERS: dict[str, Entry] = {
    "aof-gaussian": Entry("GAOF", "ГАОФ", lambda s: aof(s.gaussian)),
    "aof-linearised": Entry("LAOF", "ЛАОФ", lambda s: aof(s.linearised)),
    "duof": Entry("DUOF", "ДУОФ", lambda s: duof(s.model)),
    "fos-gaussian": Entry("GFOS", "ГФОС", lambda s: fos(s.gaussian)),
    "fos-linearised": Entry("LFOS", "ЛФОС", lambda s: fos(s.linearised)),
    "mfos-gaussian": Entry("GMFOS", "ГМФОС", lambda s: mfos(s.gaussian)),
    "mfos-linearised": Entry("LMFOS", "ЛМФОС", lambda s: mfos(s.linearised)),
    "fos3-gaussian": Entry("GFOS3", "ГФОС, 3 арг.", lambda s: fos(s.gaussian, arguments=3)),
    "fos3-linearised": Entry("LFOS3", "ЛФОС, 3 арг.", lambda s: fos(s.linearised, arguments=3)),
    "mfos3-gaussian": Entry("GMFOS3", "ГМФОС, 3 арг.", lambda s: mfos(s.gaussian, arguments=3)),
    "mfos3-linearised": Entry("LMFOS3", "ЛМФОС, 3 арг.", lambda s: mfos(s.linearised, arguments=3)),
    "aof-unscented": Entry("UKF", "АОФ, unscented", lambda s: aof(unscented(s.model))),
    "aof-gauss-hermite": Entry("GHKF", "АОФ, Гаусс–Эрмит", lambda s: aof(gauss_hermite(s.model))),
    "aof-exact": Entry("exact AOF", "АОФ", lambda s: pointmass(s.model)),
    "particle": Entry("particle", "АОФ, частицы", lambda s: particle(s.model)),
}
# Printed names of filters that are not among the lab's.
TITLES = {
    "kalman": "Kalman",
    "iterated-linearised": "iterated EKF",
    "iterated-unscented": "iterated UKF",
    "alpha-beta": "alpha-beta",
    "alpha-beta-gamma": "alpha-beta-gamma",
    "imm": "IMM",
}
LAB = ("aof-gaussian", "aof-linearised", "duof", "fos-gaussian", "fos-linearised", "mfos-gaussian", "mfos-linearised")


def title(name: str) -> str:
    """The printed name of a filter: "GAOF" for "aof-gaussian"."""
    return FILTERS[name].title if name in FILTERS else TITLES.get(name, name)


def lab_filters(model: Model, names: Sequence[str] = LAB) -> list[Filter | Design]:
    """Filters of the lab for a model, by short names.

    Raises
    ------
    ValueError
        An unknown name; the message lists the known ones.
    NoClosedForm, ModelError
        A filter that this model does not admit; the message names the filter and says what to use instead.
    """
    unknown = [name for name in names if name not in FILTERS]
    if unknown:
        raise ValueError(f"unknown filter {', '.join(map(repr, unknown))}; known: {', '.join(FILTERS)}")
    structures = Structures(model)
    built = []
    for name in dict.fromkeys(names):
        try:
            built.append(FILTERS[name].build(structures))
        except (NoClosedForm, ModelError) as error:
            raise type(error)(f"{name}: {error}") from None
    return built


def has_exact(model: Model) -> bool:
    """Whether the exact AOF can be computed for the model: scalar, noises entering linearly."""
    try:
        pointmass(model)
    except ModelError:
        return False
    return True


def load_variants(path: str | Path | None = None) -> dict[str, Variant]:
    """Read a TOML file of variants; the shipped one by default.

    Parameters
    ----------
    path : path, optional
        A file with tables ``[variants.NAME]``: `state`, `meter`, `parameters`, and optionally `title`,
        `symbols`, `prior`, `state_noise`, `meter_noise` (see `Model.define`).

    Raises
    ------
    VariantError
        The file is missing or not TOML, or a variant in it is not a model; nothing else is read then.
    """
    where = "the shipped variants" if path is None else str(path)
    try:
        text = (resources.files("kfcourse.lab") / "variants.toml" if path is None else Path(path)).read_text(encoding="utf-8")
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
    return {name: read_variant(name, table, where) for name, table in tables.items()}


def read_variant(name: str, table: Any, where: str) -> Variant:
    """A variant from its table; VariantError, naming the place, if it is not a model."""
    prefix = f"variant {name} in {where}: "
    if not isinstance(table, Mapping):
        raise VariantError(f"{prefix}expected a table [variants.{name}], got {table!r}")
    unknown, missing = sorted(set(table) - VARIANT_KEYS), sorted({"state", "meter"} - set(table))
    if unknown or missing:
        problem = f"unknown key {', '.join(unknown)}" if unknown else f"no {' and no '.join(missing)}"
        raise VariantError(f"{prefix}{problem}; the keys are {', '.join(sorted(VARIANT_KEYS))}")
    for key in ("parameters", "symbols", "prior", "state_noise", "meter_noise"):
        if key in table and not isinstance(table[key], Mapping):
            raise VariantError(f"{prefix}`{key}` must be a table such as {{ c = 0.9 }}, got {table[key]!r}")
    options = {key: value for key, value in table.items() if key not in ("title", "state", "meter", "parameters")}
    try:
        model = Model.define(table["state"], table["meter"], table.get("parameters"), **options)
    except (ValueError, TypeError, OverflowError) as error:  # FormulaError and ModelError are ValueErrors
        raise VariantError(f"{prefix}{error}") from None
    return Variant(name, str(table.get("title", "")), model, dict(table))


def find_variant(name: str, path: str | Path | None = None) -> Variant:
    """One variant by name; VariantError lists the names if there is no such."""
    variants = load_variants(path)
    if name not in variants:
        raise VariantError(f"no variant {name!r}; there are {', '.join(variants)}")
    return variants[name]
