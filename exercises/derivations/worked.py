"""Right derivations, written by SymPy: of a structural function, a step a line, for any model that
derivations are checked for.

The definition; the equation put in and multiplied out; the means of the noises; the moments of the
state; like terms.
"""

from __future__ import annotations

import re
from collections.abc import Container
from typing import NamedTuple

import sympy as sp
from sympy.codegen.cfunctions import expm1

from kfcourse.exercises.derivations.setting import Setting, of_model, of_side
from kfcourse.exercises.derivations.terms import means_in, written
from kfcourse.exercises.derivations.typed import tree_of
from kfcourse.exercises.derivations.verdicts import check_text
from kfcourse.limits import OutOfTime, time_limit
from kfcourse.symbolic.formula import symbol
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import GaussianMoments

M = sp.Function("M")
SECONDS = 20.0  # for a derivation


def stages(
    model: Model, name: str, mean: sp.MatrixBase, cov: sp.MatrixBase, known: Container[str] = ()
) -> tuple[list[sp.Expr], GaussianMoments]:
    """The lines of a derivation of tau, Theta, h, G or F, or of an entry (Theta12), as formulas;
    and the moments that they use.

    M(...) is a mean that is not yet computed; x ~ N(mean, cov), noises are standard.  `known`:
    names of means that may stand as letters, tau, h2.
    """
    side = model.state_equation if name[0] in "tT" else model.meter_equation
    noises = model.v if name[0] in "tT" else model.w
    law = GaussianMoments(
        [*model.x, *noises], [*mean, *[0] * len(noises)], sp.diag(cov, sp.eye(len(noises)))
    )
    digits = [int(c) - 1 for c in name if c.isdigit()] or [0]
    a, b = side[digits[0]], side[digits[-1]]
    values: dict[sp.Symbol, sp.Expr] = {}
    if name[0] in "th":
        inner = a
    elif name[0] == "G":
        inner = sp.diff(a, model.x[digits[-1]])
    else:
        means = [without_expm1(law.mean_of(part)) for part in (a, b)]
        for place, i in enumerate((digits[0], digits[-1])):
            letter = ("tau" if name[0] == "T" else "h") + (f"{i + 1}" if len(side) > 1 else "")
            if letter in known:
                values[symbol(letter)], means[place] = means[place], symbol(letter)
        inner = (a - means[0]) * (b - means[1])
    groups: dict[sp.Expr, sp.Expr] = {}
    for term in sp.Add.make_args(sp.expand(inner)):
        outside, inside = term.as_independent(*model.x, *noises, as_Add=False)
        groups[inside] = groups.get(inside, 0) + outside
    split, quiet, closed = list[sp.Expr](), sp.S.Zero, sp.S.Zero
    for inside, outside in groups.items():
        factor = sp.factor(outside)
        split.append(factor * (1 if inside == 1 else M(inside)))
        of_noise, of_state = inside.as_independent(*model.x, as_Add=False)
        mean_of_noise = law.mean_of(of_noise)
        quiet += factor * mean_of_noise * (1 if of_state == 1 else M(of_state))
        closed += factor.subs(values) * mean_of_noise * without_expm1(law.mean_of(of_state))
    return [M(inner), sp.Add(*split, evaluate=False), quiet, closed, sp.expand(closed)], law


def without_expm1(formula: sp.Expr) -> sp.Expr:
    """The formula as people write it: NumPy's expm1 keeps the digits of e^u - 1 in the code."""
    return formula.replace(expm1, lambda u: sp.exp(u) - 1)


class Worked(NamedTuple):
    """A right derivation: of which model and which structural function, and its text."""

    model: Model
    name: str
    text: str


def right_derivation(model: Model) -> Worked | None:
    """A derivation of a model, checked; None where derivations are not checked, or SymPy does not
    find one.

    Noises that are not standard, equations that depend on the step or switch: see `of_model`.
    """
    try:
        with time_limit(SECONDS):
            setting = of_model(model)
            name = worth_deriving(model)
            text = derive(model, name)
            (chain,) = check_text(text, None, setting).chains
    except (Exception, OutOfTime):  # of SymPy, at a formula that it cannot average
        return None
    closed = chain.end is not None and not means_in(chain.end)
    return Worked(model, name, text) if chain.right and closed else None


def worth_deriving(model: Model) -> str:
    """Name of the structural function of a model that is worth a derivation: the equation is
    curved, or its noise depends on x.

    Of a scalar model a variance, F or Theta; of others a mean, tau2 or h1, whose formula is short.
    """
    setting = of_model(model)
    sides = (("h", "F", model.meter_equation), ("tau", "Theta", model.state_equation))
    telling, other = [], []
    for first, second, equations in sides:
        for i, equation in enumerate(equations):
            index = "" if len(equations) == 1 else f"{i + 1}"
            if any(equation.diff(x).has(*model.x) for x in model.x):
                telling.append(second + 2 * index if model.n == 1 else first + index)
            other.append(second + 2 * index)
    return next(
        name for name in (*telling, *other, "h", "tau") if name in of_side(setting, name).meanings
    )


def derive(model: Model, name: str) -> str:
    """The text of a right derivation of a structural function, with a remark on each step."""
    setting = of_side(of_model(model), name)
    law = setting.law
    mean = sp.Matrix([symbol(entry) for entry in law.means])
    cov = sp.Matrix([[symbol(entry) for entry in row] for row in law.cov])
    formulas, _ = stages(model, name, mean, cov, setting.meanings)
    lines = [written(tree_of(formula)) for formula in formulas]
    remarks = [
        "",
        "# multiplied out",
        "# means of the noises",
        "# moments of the state",
        "# like terms",
    ]
    if definition := _definition(setting, name):
        lines, remarks = [definition, *lines], ["", "# the equation put in", *remarks[1:]]
    rows = [f"{name} = {lines[0]}"]
    for before, line, remark in zip(lines, lines[1:], remarks[1:], strict=False):
        rows += [remark, f"  = {line}"] if line != before else []
    return "\n".join(rows)


def _definition(setting: Setting, name: str) -> str:
    """That of a variance of the measurement, in the letters y and h; nothing where a parameter has
    such a letter."""
    if not (variance := re.fullmatch(r"F((\d)\2)?", name)):
        return ""
    y, h = (f"{letter}{variance[2] or ''}" for letter in "yh")
    return f"M[({y} - {h})^2]" if {y, h} <= setting.meanings.keys() else ""
