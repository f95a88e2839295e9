"""The lab's filters by short name: how each is built, and what it is called in tables and
figures."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from typing import Any, NamedTuple

import sympy as sp

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
from kfcourse.lab.families import FAMILIES, WORDS
from kfcourse.symbolic.averaging import averaged, averaged_equations
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import NoClosedForm
from kfcourse.symbolic.quadrature import gauss_hermite, unscented
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import Structure, gaussian, linearised


class Structures:
    """The structural functions of a model, derived when first asked for; of a model that jumps a
    list, those of each mode.

    `normal`: Gaussian, by quadrature if they have no closed form, else NoClosedForm.
    """

    def __init__(self, model: Model | JumpModel) -> None:
        self.model: Any = model
        self.jumps = isinstance(model, JumpModel)

    @classmethod
    def of(cls, model: Model | JumpModel) -> Structures:
        """Those of one of the models asked for last: comparison and report ask for the same, and
        a pilot takes seconds."""
        for known in _ASKED:
            if known.model is model:
                return known
        _ASKED.append(cls(model))
        return _ASKED[-1]

    @cached_property
    def linearised(self) -> Any:
        return self._each([linearised(mode) for mode in modes_of(self.model)])

    @cached_property
    def gaussian(self) -> Any:
        return self._each([gaussian(mode) for mode in modes_of(self.model)])

    @cached_property
    def averaged(self) -> Structure:
        """Averaged over the modes."""
        return averaged(self.model, self.best)

    @cached_property
    def quadrature(self) -> Checked | NoClosedForm | None:
        """What takes the place of the Gaussian functions if they have no closed form, or why
        nothing does; None if they have."""
        try:
            _ = self.gaussian
        except NoClosedForm as why:
            try:
                return of_checked_order(self.model, why)
            except NoClosedForm as neither:
                return neither
        return None

    @property
    def normal(self) -> Any:
        if isinstance(self.quadrature, NoClosedForm):
            raise self.quadrature
        checked = self.quadrature
        return self.gaussian if checked is None else self._each(checked.structures)

    @property
    def best(self) -> Any:
        """Gaussian ones if they can be had, else linearised ones."""
        return self.linearised if isinstance(self.quadrature, NoClosedForm) else self.normal

    def _each(self, structures: list[Structure]) -> Any:
        return structures if self.jumps else structures[0]


def operations(structure: Structure) -> int:
    """How many there are in the formulas of structural functions."""
    parts = structure.formulas.functions.values() if structure.formulas else ()
    return sum(int(formula.count_ops()) for formula in sp.flatten(parts))


_ASKED: deque[Structures] = deque(maxlen=4)


class Entry(NamedTuple):
    """A filter of the lab, or of those for models that jump: printed names, how to build it, and
    what it is.

    functions : str
        Of which structural functions: "gaussian", "linearised", "unscented", "gauss-hermite",
        "averaged" (over the modes), "best" (Gaussian if they can be had, else linearised); "exact";
        "" of none.
    family : str
        Key of `FAMILIES`.
    """

    title: str
    russian: str
    build: Callable[[Any], Any]  # structures -> Filter or Design
    functions: str = ""
    family: str = ""


def _twice(
    family: str,
    build: Callable[..., Filter | Design],
    number: str = "",
    russian: str = "",
    jump: bool = False,
) -> dict[str, Entry]:
    """The entries of "fos", or with a `number` of "fos3": with Gaussian structural functions and
    with linearised ones.

    `russian` ends the Russian name.  Those that `jump` are built of the model and the functions of
    each mode: the LD-GFOS.
    """
    of = FAMILIES[family]
    middle, latin, cyrillic = ("jump-", "LD-", "лд") if jump else ("", "", "")
    if of.memory:  # as the lab's filters remember
        number, russian = str(STEPS), f", {STEPS} шага"
    return {
        f"{family}{number}-{middle}{functions}": Entry(
            f"{latin}{functions[0].upper()}{of.title}{number}",
            f"{letter}{of.russian}{cyrillic}{russian}",
            partial(_built, build, functions),
            functions,
            family,
        )
        for functions, letter in (("gaussian", "Г"), ("linearised", "Л"))
    }


def _built(
    build: Callable[..., Filter | Design], functions: str, structures: Structures
) -> Filter | Design:
    of = structures.normal if functions == "gaussian" else structures.linearised
    return build(structures.model, of) if structures.jumps else build(of)


def _alone(
    family: str, build: Callable[[Any], Filter | Design], functions: str = ""
) -> dict[str, Entry]:
    """The entry of a family that is a single filter."""
    of = FAMILIES[family]
    return {family: Entry(of.title, of.russian, build, functions, family)}


def _averaged(family: str, build: Callable[[Structure], Filter | Design]) -> dict[str, Entry]:
    """The entry of a filter of the average over the modes."""
    of = FAMILIES[family]
    names = f"{of.title} (averaged)", f"{of.russian} (среднее по режимам)"
    return {f"{family}-averaged": Entry(*names, lambda s: build(s.averaged), "averaged", family)}


_EXACT = Entry("exact AOF", "точный АОФ", lambda s: exact(s.model), "exact", "aof")
# One line a filter: this is where a new one is added.
FILTERS: dict[str, Entry] = {
    **_twice("aof", aof),
    **_alone("duof", lambda s: duof(s.model)),
    **_twice("fos", fos),
    **_twice("mfos", mfos),
    **_twice("fos", partial(fos, arguments=3), "3", ", 3 арг."),
    **_twice("mfos", partial(mfos, arguments=3), "3", ", 3 арг."),
    **_twice("dfmp", dfmp),
    **_twice("mdfmp", mdfmp),
    **_twice("fkp", fkp),
    **_twice("mfkp", mfkp),
    **_twice("dfkp", dfkp),
    **_twice("mdfkp", mdfkp),
    **_twice("fbp", fbp),
    "aof-unscented": Entry(
        "UKF", "АОФ, сигма-точки", lambda s: aof(unscented(s.model)), "unscented", "aof"
    ),
    "aof-gauss-hermite": Entry(
        "GHKF", "АОФ, Гаусс–Эрмит", lambda s: aof(gauss_hermite(s.model)), "gauss-hermite", "aof"
    ),
    "aof-exact": _EXACT,
    **_alone("particle", lambda s: particle(s.model)),
}
# The same for models that jump: filters that know the modes, and plain ones on the average over the
# modes.
JUMP_FILTERS: dict[str, Entry] = {
    **_twice("aof", lambda model, each: logic_dynamic(each, model, model.first), jump=True),
    **_alone("imm", lambda s: imm(s.best, s.model, s.model.first), "best"),
    **_alone("gpb2", lambda s: gpb2(s.best, s.model, s.model.first), "best"),
    **_twice("fos", logic_dynamic_fos, jump=True),
    **_twice("fkp", logic_dynamic_fkp, jump=True),
    **_twice("fbp", logic_dynamic_fbp, jump=True),
    **_averaged("aof", aof),
    **_alone("duof", lambda s: duof(s.model.modes[0], averaged_equations(s.model))),
    **_averaged("fos", fos),
    **_averaged("mfos", mfos),
    "aof-exact": _EXACT,
}
# Printed names of filters that are not among the lab's.
TITLES = {"iterated-linearised": FAMILIES["iterated"].title, "iterated-unscented": "iterated UKF"}
BOUND = 1000  # particles of the exact AOF where there are no point masses
# As of models without jumps, those that remember several steps are asked for by name.
JUMP_LAB = tuple(
    name
    for name, known in JUMP_FILTERS.items()
    if name != "aof-exact" and not FAMILIES[known.family].memory
)
LAB = (
    "aof-gaussian",
    "aof-linearised",
    "duof",
    "fos-gaussian",
    "fos-linearised",
    "mfos-gaussian",
    "mfos-linearised",
)


def entry(name: str) -> Entry:
    """What is known of a filter; of those that are not the lab's by what their names are made of,
    FAMILY[LENGTH]-FUNCTIONS."""
    if known := FILTERS.get(name) or JUMP_FILTERS.get(name):
        return known
    kind, _, functions = name.partition("-")
    family = kind.rstrip("0123456789")
    usual = f"{family}{STEPS}-{functions}"
    if known := FILTERS.get(usual) or JUMP_FILTERS.get(usual):  # of another length of memory
        return known._replace(title=known.title.replace(str(STEPS), kind.removeprefix(family)))
    printed = FAMILIES[name].title if name in FAMILIES else TITLES.get(name, name)
    build = partial(check_names, [name])
    return Entry(printed, printed, build, functions.removeprefix("jump-"), family)


def title(name: str, words: Mapping[str, str] = WORDS["en"]) -> str:
    """The printed name of a filter in the language of these words: "GAOF" for "aof-gaussian",
    "GFKP2" for "fkp2-gaussian"."""
    return str(getattr(entry(name), words["field_of_title"]))


def lab_filters(model: Model, names: Sequence[str] = LAB) -> list[Filter | Design]:
    """Filters of the lab for a model, by short names; `kfcourse.lab.admission` says of each whether
    it can be had.

    Raises
    ------
    ValueError
        An unknown name; the message lists the known ones.
    NoClosedForm, ModelError
        A filter that this model does not admit; the message names the filter and says what to use
        instead.
    """
    check_names(names)
    structures = Structures.of(model)
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
        raise ValueError(
            f"unknown filter {', '.join(map(repr, unknown))}; known: {', '.join(known)}"
        )


def judging(model: Model | JumpModel) -> Structure:
    """The structural functions by which predictions of measurements are judged: the best ones,
    averaged over modes.  Those of the first mode where modes have no such average: no filter can be
    had then that needs it."""
    structures = Structures.of(model)
    if not isinstance(model, JumpModel):
        return structures.best
    return structures.best[0] if model.by_state else structures.averaged


def exact(model: Model | JumpModel) -> Filter:
    """The exact AOF, by point masses where they reach, else by particles, whose own error does not
    enter the bound.

    Raises
    ------
    ModelError
        Neither can be had: there is no density of y given x, or no noise enters the object.
    """
    if has_exact(model):
        return pointmass(model)
    if not all(map(has_object_noise, modes_of(model))):
        raise ModelError(
            "no noise enters the object, and copies of a particle stay copies: there is no bound"
        )
    return particle(model, BOUND, name="aof-exact")


def has_exact(model: Model | JumpModel) -> bool:
    """Whether the exact AOF can be computed for the model by point masses: scalar, noises entering
    linearly."""
    try:
        pointmass(model)
    except ModelError:
        return False
    return True
