"""The lab's filters by short name: how each is built, and what it is called in tables and figures."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from typing import Generic, NamedTuple, TypeVar

from kfcourse.filters import (
    Design,
    Filter,
    aof,
    dfkp,
    dfmp,
    duof,
    fbp,
    fkp,
    fos,
    gpb2,
    imm,
    logic_dynamic,
    logic_dynamic_fbp,
    logic_dynamic_fkp,
    logic_dynamic_fos,
    mdfkp,
    mdfmp,
    mfkp,
    mfos,
    particle,
    pointmass,
)
from kfcourse.filters.densities import has_object_noise
from kfcourse.filters.exact.laws import modes_of
from kfcourse.filters.optimal_structure import STEPS
from kfcourse.lab.checked_quadrature import Checked, of_checked_order
from kfcourse.lab.families import FAMILIES, family
from kfcourse.laws import Array
from kfcourse.symbolic.averaging import averaged, averaged_equations
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import NoClosedForm
from kfcourse.symbolic.quadrature import gauss_hermite, unscented
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import Structure, gaussian, linearised


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

    @cached_property
    def quadrature(self) -> Checked | NoClosedForm | None:
        """What takes the place of the Gaussian functions if they have no closed form, or why nothing does; None if they have."""
        return _by_quadrature(self.model, lambda: self.gaussian)

    @property
    def normal(self) -> Structure:
        """The Gaussian functions, by quadrature if they have no closed form; NoClosedForm if that does not do either."""
        return self.gaussian if self.quadrature is None else _found(self.quadrature)[0]


class JumpStructures:
    """Those of a model that jumps: of each mode, and averaged over the modes."""

    def __init__(self, model: JumpModel):
        self.model = model

    @cached_property
    def linearised(self) -> list[Structure]:
        return [linearised(mode) for mode in self.model.modes]

    @cached_property
    def gaussian(self) -> list[Structure]:
        return [gaussian(mode) for mode in self.model.modes]

    @cached_property
    def quadrature(self) -> Checked | NoClosedForm | None:
        """As of `Structures`, for the modes that need it."""
        return _by_quadrature(self.model, lambda: self.gaussian)

    @property
    def normal(self) -> list[Structure]:
        """The Gaussian functions of each mode; as of `Structures`."""
        return self.gaussian if self.quadrature is None else _found(self.quadrature)

    @property
    def chain(self) -> tuple[JumpModel, Array]:
        """The model, for its transitions, and the law of the first mode: what filters with modes take."""
        return self.model, self.model.first

    @property
    def best(self) -> list[Structure]:
        """Gaussian ones if they can be had, else linearised ones."""
        try:
            return self.normal
        except NoClosedForm:
            return self.linearised

    @cached_property
    def averaged(self) -> Structure:
        return averaged(self.model, self.best)


def _by_quadrature(model: Model | JumpModel, formulas: Callable[[], object]) -> Checked | NoClosedForm | None:
    """As `Structures.quadrature`; of the models asked for last it is kept, as a pilot takes seconds, and a report asks again."""
    for known, found in _ASKED:
        if known is model:
            return found
    found = None
    try:
        formulas()
    except NoClosedForm as why:
        try:
            found = of_checked_order(model, why)
        except NoClosedForm as neither:
            found = neither
    _ASKED.append((model, found))
    return found


_ASKED: deque[tuple[Model | JumpModel, Checked | NoClosedForm | None]] = deque(maxlen=4)


def _found(quadrature: Checked | NoClosedForm) -> list[Structure]:
    if isinstance(quadrature, NoClosedForm):
        raise quadrature
    return quadrature.structures


AnyStructures = TypeVar("AnyStructures", Structures, JumpStructures)


class Entry(NamedTuple, Generic[AnyStructures]):
    """A filter of the lab, or of those for models that jump: printed names and how to build it."""

    title: str
    russian: str
    build: Callable[[AnyStructures], Filter | Design]


def _twice(short: str, build: Callable[[Structure], Filter | Design], russian: str = "") -> dict[str, Entry[Structures]]:
    """The entries of "fos", "fos3": with Gaussian structural functions, and with linearised ones; `russian` ends the name."""
    of = FAMILIES[family(short)]
    title, russian = of.title + short.removeprefix(family(short)), of.russian + russian
    return {
        f"{short}-gaussian": Entry(f"G{title}", f"Г{russian}", lambda s: build(s.normal)),
        f"{short}-linearised": Entry(f"L{title}", f"Л{russian}", lambda s: build(s.linearised)),
    }


def _entry(short: str, build: Callable[[Structures], Filter | Design]) -> dict[str, Entry[Structures]]:
    """The entry of a family that is one filter."""
    return {short: Entry(FAMILIES[short].title, FAMILIES[short].russian, build)}


def _with_modes(
    short: str, build: Callable[[JumpModel, list[Structure]], Filter | Design], russian: str = ""
) -> dict[str, Entry[JumpStructures]]:
    """The same of a filter with the structural functions of each mode: "fos" is "fos-jump-gaussian", the LD-GFOS."""
    of = FAMILIES[family(short)]
    title = of.title + short.removeprefix(family(short))
    return {
        f"{short}-jump-gaussian": Entry(f"LD-G{title}", f"Г{of.russian}лд{russian}", lambda s: build(s.model, s.normal)),
        f"{short}-jump-linearised": Entry(f"LD-L{title}", f"Л{of.russian}лд{russian}", lambda s: build(s.model, s.linearised)),
    }


_MEMORY = f", {STEPS} шага"
# One line a filter: this is where a new one is added.
FILTERS: dict[str, Entry[Structures]] = {
    **_twice("aof", aof),
    **_entry("duof", lambda s: duof(s.model)),
    **_twice("fos", fos),
    **_twice("mfos", mfos),
    **_twice("fos3", partial(fos, arguments=3), ", 3 арг."),
    **_twice("mfos3", partial(mfos, arguments=3), ", 3 арг."),
    **_twice("dfmp", dfmp),
    **_twice("mdfmp", mdfmp),
    **_twice(f"fkp{STEPS}", fkp, _MEMORY),
    **_twice(f"mfkp{STEPS}", mfkp, _MEMORY),
    **_twice(f"dfkp{STEPS}", dfkp, _MEMORY),
    **_twice(f"mdfkp{STEPS}", mdfkp, _MEMORY),
    **_twice(f"fbp{STEPS}", fbp, _MEMORY),
    "aof-unscented": Entry("UKF", "АОФ, сигма-точки", lambda s: aof(unscented(s.model))),
    "aof-gauss-hermite": Entry("GHKF", "АОФ, Гаусс–Эрмит", lambda s: aof(gauss_hermite(s.model))),
    "aof-exact": Entry("exact AOF", "АОФ", lambda s: exact(s.model)),
    **_entry("particle", lambda s: particle(s.model)),
}
# The same for models that jump: filters that know the modes, and plain ones on the average over the modes.
JUMP_FILTERS: dict[str, Entry[JumpStructures]] = {
    **_with_modes("aof", lambda model, structures: logic_dynamic(structures, model, model.first)),
    "imm": Entry(*FAMILIES["imm"][:2], lambda s: imm(s.best, *s.chain)),
    "gpb2": Entry(*FAMILIES["gpb2"][:2], lambda s: gpb2(s.best, *s.chain)),
    **_with_modes("fos", logic_dynamic_fos),
    **_with_modes(f"fkp{STEPS}", logic_dynamic_fkp, _MEMORY),
    **_with_modes(f"fbp{STEPS}", logic_dynamic_fbp, _MEMORY),
    "aof-averaged": Entry("AOF (averaged)", "АОФ (среднее по режимам)", lambda s: aof(s.averaged)),
    "duof": Entry(*FAMILIES["duof"][:2], lambda s: duof(s.model.modes[0], averaged_equations(s.model))),
    "fos-averaged": Entry("FOS (averaged)", "ФОС (среднее по режимам)", lambda s: fos(s.averaged)),
    "mfos-averaged": Entry("MFOS (averaged)", "МФОС (среднее по режимам)", lambda s: mfos(s.averaged)),
    "aof-exact": Entry("exact AOF", "АОФ", lambda s: exact(s.model)),
}
# Printed names of filters that are not among the lab's.
TITLES = {
    "kalman": FAMILIES["kalman"].title,
    "iterated-linearised": FAMILIES["iterated"].title,
    "iterated-unscented": "iterated UKF",
    "alpha-beta": FAMILIES["alpha"].title,
    "alpha-beta-gamma": "alpha-beta-gamma",
}
BOUND = 1000  # particles of the exact AOF where there are no point masses
WITH_MODES = ("aof-jump-gaussian", "aof-jump-linearised", "imm", "gpb2", "aof-exact")  # that carry their probabilities
OF_BEST = ("imm", "gpb2", "aof-averaged", "fos-averaged", "mfos-averaged")  # by `JumpStructures.best`
# As of models without jumps, those that remember several steps are asked for by name.
JUMP_LAB = tuple(name for name in JUMP_FILTERS if name != "aof-exact" and not re.search(r"\d-", name))
LAB = ("aof-gaussian", "aof-linearised", "duof", "fos-gaussian", "fos-linearised", "mfos-gaussian", "mfos-linearised")


def title(name: str) -> str:
    """The printed name of a filter: "GAOF" for "aof-gaussian", "GFKP2" for "fkp2-gaussian"."""
    if entry := FILTERS.get(name) or JUMP_FILTERS.get(name):
        return entry.title
    length = re.sub(r"\D", "", name.split("-")[0])
    usual = f"{family(name)}{STEPS}-{name.partition('-')[2]}"
    if entry := FILTERS.get(usual) or JUMP_FILTERS.get(usual):
        return entry.title.replace(str(STEPS), length)
    return TITLES.get(name, name)


def lab_filters(model: Model, names: Sequence[str] = LAB) -> list[Filter | Design]:
    """Filters of the lab for a model, by short names; `kfcourse.lab.admission` tells of each whether it can be had.

    Raises
    ------
    ValueError
        An unknown name; the message lists the known ones.
    NoClosedForm, ModelError
        A filter that this model does not admit; the message names the filter and says what to use instead.
    """
    check_names(names)
    structures = Structures(model)
    built = []
    for name in dict.fromkeys(names):
        try:
            built.append(FILTERS[name].build(structures))
        except (NoClosedForm, ModelError) as error:
            raise type(error)(f"{name}: {error}") from None
    return built


def check_names(names: Sequence[str], known: Mapping[str, object] = FILTERS) -> None:
    """ValueError, which lists the known names, if a short name is not among them."""
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError(f"unknown filter {', '.join(map(repr, unknown))}; known: {', '.join(known)}")


def exact(model: Model | JumpModel) -> Filter:
    """The exact AOF, by point masses where they reach, else by particles, whose own error does not enter the bound.

    Raises
    ------
    ModelError
        Neither can be had: there is no density of y given x, or no noise enters the object.
    """
    if has_exact(model):
        return pointmass(model)
    if not all(map(has_object_noise, modes_of(model))):
        raise ModelError("no noise enters the object, and copies of a particle stay copies: there is no bound")
    return particle(model, BOUND, name="aof-exact")


def has_exact(model: Model | JumpModel) -> bool:
    """Whether the exact AOF can be computed for the model by point masses: scalar, noises entering linearly."""
    try:
        pointmass(model)
    except ModelError:
        return False
    return True


def has_bound(model: Model | JumpModel) -> bool:
    """Whether the exact AOF can be computed for the model, by point masses or by particles."""
    try:
        exact(model)
    except ModelError:
        return False
    return True
