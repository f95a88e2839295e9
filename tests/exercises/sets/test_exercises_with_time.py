"""Exercises about variants with time and inputs: a wrong step is never
right."""

import re
from itertools import product

import pytest
import sympy as sp
from inside import TABLES, checked, code, opened, rendered
from weekly import weekly

from kfcourse.exercises.checks import ExerciseError, exercise
from kfcourse.exercises.notebooks.master import solution

WRONG_STEPS = {
    "b4": [
        (r"predict\(z, p, k\)", "predict(z, p, k + 1)", "input-of-next-step"),
        (r"predict\(z, p, k\)", "predict(z, p, k - 1)", "input-of-step-before"),
        (r"enumerate\(y\)", "enumerate(y, 1)", "steps-from-one"),
        (r"\b(Psi|p), k\)", r"\1, 0)", "step-not-passed"),
    ],
    "c4": [
        (r"\ba\(([^()]+), k\)", r"a(\1, k + 1)", "input-of-next-step"),
        (r"\bb\(([^()]+), k\)", r"b(\1, k - 1)", "input-of-step-before"),
    ],
    "g5": [
        (r"\ba\(x, k\)", "a(x, k + 1)", "input-of-next-step"),
        (r"\bb\(x, k\)", "b(x, k - 1)", "input-of-step-before"),
        (r"enumerate\(y\)", "enumerate(y, 1)", "steps-from-one"),
    ],
}


@pytest.mark.parametrize(("name", "question"), weekly(product(TABLES, WRONG_STEPS)))
def test_a_wrong_step_is_named(name, question):
    """Also where the input rests at first, and where the switch comes after the steps that are
    simulated."""
    for old, new, mistake in WRONG_STEPS[question]:
        notebook, changes = solution(rendered(question[0], name)), 0
        for cell in code(notebook):
            tags = cell.metadata.get("tags", [])
            if "picture" in tags or ("check" in tags and question not in cell.source):
                notebook.cells.remove(cell)
            elif not tags:
                cell.source, times = re.subn(old, new, cell.source)
                changes += times
        result = checked(notebook)[question]
        assert changes and result["status"] == "wrong" and mistake in result["diagnosis"], result


k, u, c, q, r, e = sp.symbols("k u c q r e", real=True)


def switched(mean):
    return lambda z, p: (c * z + r * z**2 + mean, (c + 2 * r * z) ** 2 * p + e**2)


def driven(mean):
    return lambda z, p: (c * z + mean, c**2 * p + e**2)


TYPED = [
    ("driven", driven(q * u), ""),
    ("driven", driven(0), "input-forgotten"),
    ("switched", switched(sp.Piecewise((q, k >= 30), (0, True))), ""),
    ("switched", switched(q * sp.Heaviside(k - sp.Rational(59, 2))), ""),  # the same at every step
    ("switched", switched(0), "input-forgotten"),
    ("switched", switched(q), None),
    ("switched", switched(sp.Piecewise((q, k > 30), (0, True))), None),
    ("switched", switched(sp.Piecewise((q, k >= 29), (0, True))), "input-of-next-step"),
    ("switched", switched(sp.Piecewise((q, k >= 60), (0, True))), None),
]


@pytest.mark.parametrize(("name", "answer", "mistake"), TYPED)
def test_formulas_with_time_and_inputs(name, answer, mistake):
    """A switch is looked at on both sides, step by step; `mistake` is "" for a right answer, None
    for one without a name."""
    result = opened("a", name).check("a2", answer)
    assert result.passed == (mistake == "")
    assert not mistake or mistake in result.diagnosis, result


def test_what_cannot_be_asked_is_refused_with_the_reason():
    words = r"set a asks for formulas.*no closed form.*another variant for this set"
    with pytest.raises(ExerciseError, match=words):
        rendered("a", "growth")
    for letter, table, where in (
        *((letter, ANGLE, "measurement") for letter in "bcdg"),
        ("e", ANGLE | {"angles": ["x", "y"]}, "state"),
    ):
        words = f"set {letter} asks about a model without angles in the {where}"
        with pytest.raises(ExerciseError, match=words):
            exercise(letter, table)


ANGLE = {"state": "0.9*x + 0.4*v", "meter": "x + 0.5*w", "angles": ["y"], "prior": {"mean": 3.0}}
