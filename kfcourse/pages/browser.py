"""The lab's filters as JavaScript, printed from the equations that the chapters derive and print.

`kfcourse.filters.programs` makes numbers of the equations.  Those that hold for each trajectory
become loops over the ensemble; those that find coefficients from means and covariances become
assignments between the loops.  What comes out is, for each filter of a scalar model,

::

    step(n, v, c, a)      estimates z and predictions of all trajectories, with the coefficients c
    design(n, v, c, a)    the same, and finds the coefficients c, for which it reads the states x
                          and the next ones

with the model's parameters in v and an array for each letter in a.  So no formula is written twice,
and a filter that runs in the browser is the one that the book derives.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import product
from pathlib import Path

import sympy as sp

from kfcourse.filters import EQUATIONS
from kfcourse.filters import notation as s
from kfcourse.filters.programs import Rule, array_name, in_numbers, scalar
from kfcourse.lab.short_names import LAB, Structures
from kfcourse.symbolic import javascript
from kfcourse.symbolic.model import Model

# trajectories, the exact filter, statistics: no formula of a model
LAB_SCRIPT = Path(__file__).parent / "data" / "lab.js"

# what a step is given; of a running filter without the states
_GIVEN = (s.x, s.x_next, s.y, s.lam, s.Psi)
_KEPT = (s.z, s.P, s.lam_next, s.Psi_next)  # what it leaves


@cache
def statistics(letters: frozenset[sp.MatrixSymbol]) -> Mapping[sp.Symbol, str]:
    """How the means, covariances and inverted variances of letters, which the equations hold as
    symbols, are computed."""
    rules_ = {}
    for left, right in product(sorted(letters, key=str), repeat=2):
        first, other = array_name(scalar(left)), array_name(scalar(right))
        rules_[scalar(s.cov(left, right))] = f"kfCov(n, a.{first}, a.{other})"
    for left in letters:
        first = array_name(scalar(left))
        rules_[scalar(s.mean(left))] = f"kfMean(n, a.{first})"
        rules_[scalar(s.cov(left))] = f"kfCov(n, a.{first}, a.{first})"
        rules_[scalar(s.cov_pinv(left))] = f"kfInverse(kfCov(n, a.{first}, a.{first}))"
    return rules_


def filter_source(name: str, structures: Structures) -> str:
    """A filter of the lab as the text of a JavaScript object { design, step }; `design` is null
    where nothing is to be found."""
    family, _, approximation = name.partition("-")
    structure = structures.gaussian if approximation == "gaussian" else structures.linearised
    rules = in_numbers(EQUATIONS[family], structures.model, structure, javascript.inverse)
    letters = {*_GIVEN, *(equation.lhs for equation in EQUATIONS[family])}
    known = statistics(frozenset(letters))
    kept = [
        scalar(letter)
        for letter in _KEPT
        if letter in letters and any(scalar(letter) == left for left, _ in rules)
    ]
    coefficients = {
        left: array_name(left) for left, right in rules if right.free_symbols & known.keys()
    }
    constants = list(structures.model.values)
    running = [(left, right) for left, right in rules if left not in coefficients]
    given = [scalar(letter) for letter in (s.y, s.lam, s.Psi)]
    step = _loop("step", running, kept, given, constants, coefficients)
    if not coefficients:
        return f"{{ design: null, step: {step.strip()} }}"
    return f"{{ design: {_design(rules, known, constants, coefficients)}, step: {step.strip()} }}"


def _design(
    rules: Sequence[Rule],
    known: Mapping[sp.Symbol, str],
    constants: Sequence[sp.Symbol],
    coefficients: Mapping[sp.Symbol, str],
) -> str:
    """Loops and, between them, the coefficients: in the order of the equations."""
    ready = [scalar(letter) for letter in _GIVEN]
    lines, group = list[str](), list[Rule]()
    arrays = {array_name(symbol): symbol for symbol in ready}

    def close() -> None:
        if group:
            wanted = [left for left, _ in group]
            loop = _loop(f"loop{len(lines)}", group, wanted, ready, constants, coefficients)
            lines.append(f"({loop.strip()})(n, v, c, a);")
            ready.extend(left for left, _ in group if array_name(left) not in arrays)
            group.clear()

    for left, right in rules:
        if left not in coefficients:
            group.append((left, right))
            continue
        close()
        names = {letter: known[letter] for letter in right.free_symbols & known.keys()}
        names |= {letter: f"c.{key}" for letter, key in coefficients.items()}
        lines.append(f"c.{coefficients[left]} = {javascript.expression(right, names)};")
    close()
    return "function (n, v, c, a) {\n" + "\n".join(lines) + "\n}"


def _loop(
    name: str,
    rules: Sequence[Rule],
    wanted: Sequence[sp.Symbol],
    given: Sequence[sp.Symbol],
    constants: Sequence[sp.Symbol],
    coefficients: Mapping[sp.Symbol, str],
) -> str:
    """The loop that computes what is wanted."""
    by_letter = dict(rules)
    return javascript.loop(
        name,
        {array_name(letter): sp.Matrix([letter]) for letter in given if letter not in by_letter},
        {array_name(letter): sp.Matrix([letter]) for letter in wanted},
        dict(rules),
        constants,
        coefficients,
    )


def model_source(model: Model, names: Sequence[str] = LAB) -> str:
    """A scalar model as the text of a JavaScript object: its equations, its structural functions,
    its filters.

    Raises
    ------
    ModelError
        A function that the pages' JavaScript does not have.
    NoClosedForm
        No Gaussian moments.
    ValueError
        A model that is not scalar.
    """
    structures, constants = Structures(model), list(model.values)
    parts = {
        "simulate": javascript.loop(
            "simulate",
            {"x": sp.Matrix(model.x), "v": sp.Matrix(model.v), "w": sp.Matrix(model.w)},
            {"y": model.meter_equation, "next": model.state_equation},
            constants=constants,
        )
    }
    for structure in (structures.linearised, structures.gaussian):
        formulas = structure.formulas
        assert formulas is not None
        functions = formulas.functions
        before, after = {"z": formulas.z, "p": formulas.p}, {"m": formulas.m, "d": formulas.d}
        predict = javascript.loop(
            "predict",
            before,
            {key: functions[key] for key in ("tau", "Theta")},
            constants=constants,
        )
        measure = javascript.loop(
            "measure", after, {key: functions[key] for key in ("h", "G", "F")}, constants=constants
        )
        parts[structure.name] = f"{{ predict: {predict.strip()}, measure: {measure.strip()} }}"
    filters = [f"{json.dumps(name)}: {filter_source(name, structures)}" for name in names]
    settings = {
        "parameters": {symbol.name: float(value) for symbol, value in model.values.items()},
        "levels": [symbol.name for symbol in levels(model)],
        "prior": {"mean": float(model.prior.mean[0]), "variance": float(model.prior.cov[0, 0])},
        "noises": [len(model.v), len(model.w)],
    }
    body = [f"{key}: {text.strip()}" for key, text in parts.items()]
    return (
        "{\n"
        + ",\n".join(
            [*body, "filters: {\n" + ",\n".join(filters) + "}", f"...{json.dumps(settings)}"]
        )
        + "}"
    )


def levels(model: Model) -> list[sp.Symbol]:
    """Parameters that only noises carry: sizes of noises, positive, for a logarithmic slider."""
    silent = {noise: 0 for noise in (*model.v, *model.w)}
    quiet = set().union(
        *(e.subs(silent).free_symbols for e in (*model.state_equation, *model.meter_equation))
    )
    return [symbol for symbol, value in model.values.items() if symbol not in quiet and value > 0]


def script(models: Mapping[str, Model]) -> str:
    """`kfLab` and `kfModels`, an object of the models by name, as the text of a script that loads
    nothing."""
    each = [f"{json.dumps(name)}: {model_source(model)}" for name, model in models.items()]
    return (
        javascript.RUNTIME
        + LAB_SCRIPT.read_text(encoding="utf-8")
        + "const kfModels = {\n"
        + ",\n".join(each)
        + "\n};\n"
    )
