"""What letters mean in a derivation: the law of the state, the noises, the structural functions of
a model.

Means M[...] are over a normal law of the state, x ~ N(m, d), and over standard normal noises,
independent of it and of each
other.  A structural function is a tree with means in it, so that it is computed as everything else
is.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import sympy as sp

from kfcourse.exercises.derivations.terms import (
    Node,
    difference,
    letter,
    letters,
    mean,
    power,
    product,
)
from kfcourse.exercises.derivations.typed import tree_of
from kfcourse.symbolic.formula import symbol
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.sides import Side, taylor

KINDS = ("gaussian", "linearised")
# letters of a filter's equations
OF_FILTERS = ("y", "K", "R", "lambda", "Psi", "m", "d", "z", "p", "tau", "Theta", "h", "G", "F")


@dataclass(frozen=True)
class Law:
    """Which letters are random: states of a normal law with these letters for mean and covariance,
    and standard normal noises."""

    states: tuple[str, ...] = ("x",)
    means: tuple[str, ...] = ("m",)
    cov: tuple[tuple[str, ...], ...] = (("d",),)
    noises: tuple[str, ...] = ("v", "w")

    @property
    def random(self) -> tuple[str, ...]:
        return self.states + self.noises

    @property
    def letters(self) -> tuple[str, ...]:
        """Of means and covariances, each once."""
        return tuple(dict.fromkeys([*self.means, *(name for row in self.cov for name in row)]))

    def at(self, mean: str, cov: str) -> Law:
        """The same with other letters for mean and covariance; components are numbered."""
        n = len(self.states)
        numbers = [f"{i + 1}" for i in range(n)] if n > 1 else [""]
        return replace(
            self,
            means=tuple(mean + i for i in numbers),
            cov=tuple(tuple(cov + min(i, j) + max(i, j) for j in numbers) for i in numbers),
        )


@dataclass(frozen=True)
class Setting:
    """What letters mean.

    Attributes
    ----------
    law : Law
    meanings : mapping
        Name to tree, of what is no free letter: structural functions of a model, what was derived
        before.
    positive : frozenset of str
        Letters that were declared positive; variances are without saying.
    known : frozenset of str, optional
        Letters that may be used; without it, all.
    model : Model, optional
    kind : {"gaussian", "linearised"}
        Which structural functions tau, Theta, h, G, F are.
    """

    law: Law = field(default_factory=Law)
    meanings: Mapping[str, Node] = field(default_factory=dict)
    positive: frozenset[str] = frozenset()
    known: frozenset[str] | None = None
    model: Model | None = None
    kind: str = "gaussian"

    def problem(self, name: str) -> str | None:
        """What is wrong with a letter; None if it may be used."""
        if self.known is None:
            return None
        # nothing is random: there is no law either
        of_law = self.law.letters if self.known.intersection(self.law.random) else ()
        known = {*self.known, *self.meanings, *of_law}
        if name in known:
            return None
        names = ", ".join(sorted(known))
        return (
            f"unknown letter {name!r}; known here: {names}. Declare another one in a line of "
            f"its own: letters {name}"
        )

    def at(self, mean_name: str, cov_name: str) -> Setting:
        """The same for a law x ~ N(mean, covariance) with these letters."""
        return with_functions(replace(self, law=self.law.at(mean_name, cov_name)))

    def opened(self, *trees: Node, closed: str = "") -> set[str]:
        """Letters of trees, and of all that these letters mean; but of what one of them means."""
        seen: set[str] = set()
        waiting = list(trees)
        while waiting:
            new = letters(waiting.pop()) - seen
            seen |= new
            waiting += [self.meanings[name] for name in new - {closed} if name in self.meanings]
        return seen


def of_model(model: Model, kind: str = "gaussian") -> Setting:
    """The setting of a model: its parameters, noises and structural functions; tau and Theta take x
    ~ N(z, p) (see `of_side`).

    Raises
    ------
    ModelError
        Its noises are not standard normal, or its equations depend on the step.
    """
    for law_, which in ((model.state_noise, "state_noise"), (model.meter_noise, "meter_noise")):
        if np.any(law_.mean != 0) or np.any(law_.cov != np.eye(len(law_.mean))):
            raise ModelError(
                f"derivations are checked for standard normal noises, and `{which}` is another "
                f"law; scale it in the equation"
            )
    if model.timed:
        raise ModelError("derivations are checked for equations that do not depend on the step")
    states, noises = tuple(s.name for s in model.x), tuple(s.name for s in (*model.v, *model.w))
    law = Law(states, noises=noises).at(
        *(f"{name}_" if name in model.parameters else name for name in ("m", "d"))
    )
    known = {*states, *noises, *model.parameters, *OF_FILTERS}
    return with_functions(Setting(law, known=frozenset(known), model=model, kind=kind))


def of_side(setting: Setting, name: str) -> Setting:
    """The setting of a chain that begins with this name: tau and Theta are functions of z and p."""
    given = setting.model is None or setting.law != of_model(setting.model).law
    return setting if given or not re.fullmatch(r"(tau|Theta)\d*", name) else setting.at("z", "p")


def with_functions(setting: Setting) -> Setting:
    """The setting with the structural functions of its model at its law; a letter of the model
    keeps its own meaning."""
    if setting.model is None:
        return setting
    model, law = setting.model, setting.law
    own = {*law.random, *law.letters, *model.parameters}
    at_law = {
        "mean": sp.ImmutableMatrix([symbol(name) for name in law.means]),
        "cov": sp.ImmutableMatrix([[symbol(name) for name in row] for row in law.cov]),
    }
    meanings: dict[str, Node] = {}
    for first, second, which in (("tau", "Theta", "object"), ("h", "F", "meter")):
        side = replace(Side.of(model, which), **at_law)
        size = len(side.equation)
        names = [first if size == 1 else f"{first}{i + 1}" for i in range(size)]
        values, slopes, covariances = (
            _means(side, names, own)
            if setting.kind == "gaussian"
            else map(_trees, taylor(side)[:3])
        )
        meanings |= {name: value for name, (value,) in zip(names, values, strict=True)}
        for name, rows in ((second, covariances), *([("G", slopes)] if first == "h" else [])):
            for i, row in enumerate(rows):
                for j, entry in enumerate(row):
                    place = f"{i + 1}{j + 1}" if len(rows) * len(row) > 1 else ""
                    meanings[name + place] = entry
    meanings |= zip(model.measured, map(tree_of, model.meter_equation), strict=True)
    return replace(
        setting, meanings={name: tree for name, tree in meanings.items() if name not in own}
    )


def _trees(formulas: sp.MatrixBase) -> list[list[Node]]:
    return [[tree_of(formula) for formula in row] for row in formulas.tolist()]


def _means(side: Side, names: list[str], own: set[str]) -> tuple[list[list[Node]], ...]:
    """Means of equations, of their slopes, and covariances, around the mean's own letter, so that
    they follow what was derived; around the mean itself where the model has that letter."""
    equations = [tree for (tree,) in _trees(side.equation)]
    deviations = [
        difference(tree, mean(tree) if name in own else letter(name))
        for tree, name in zip(equations, names, strict=True)
    ]
    slopes = _trees(side.equation.jacobian(side.x))
    return (
        [[mean(tree)] for tree in equations],
        [[mean(slope) for slope in row] for row in slopes],
        [[mean(power(a, 2) if a is b else product(a, b)) for b in deviations] for a in deviations],
    )
