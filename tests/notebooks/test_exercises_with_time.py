"""Exercises about variants with time and inputs: solutions pass, untouched notebooks do not, a
wrong step is never right."""

import re
from functools import cache

import pytest
import sympy as sp

from kfcourse.checks import Exercise, ExerciseError, exercise, sets
from kfcourse.lab.variants import read_variant
from kfcourse.notebooks.master import read, render, solution, student

TABLES = {
    "growth": {
        "state": "0.5*x + 25*x/(1 + x**2) + 8*cos(1.2*k) + v",
        "meter": "x**2/20 + w",
        "state_noise": {"variance": 10},
        "prior": {"variance": 5},
    },
    "driven": {
        "state": "c*x + q*u + e*v",
        "meter": "g*x + f*w",
        "parameters": {"c": 0.9, "q": 0.7, "e": 0.3, "g": 1.2, "f": 0.4},
        "inputs": {"u": [0.0] * 8 + [1.0, -1.0] * 7},  # rests at first: hidden steps must be others
    },
    "switched": {
        "state": "c*x + r*x**2 + e*v + (q if 30 <= k else 0)",
        "meter": "g*x + h*x**2 + f*w",
        "parameters": {"c": 0.6, "r": 0.05, "e": 0.3, "q": 0.5, "g": 1.0, "h": 0.2, "f": 0.4},
    },
}
SETS = [
    (name, letter) for name in TABLES for letter in "abcdefg" if (name, letter) != ("growth", "a")
]


@cache
def opened(name, letter):
    return Exercise(letter, read_variant(name, {"title": name, **TABLES[name]}, "here"))


@cache
def rendered(name, letter):
    return render(read(letter), opened(name, letter))


def run(notebook, *change):
    """The functions that a notebook defines, after a change of its text; all up to its last check,
    without the checks."""
    cells = [one for one in notebook.cells if one.cell_type == "code"]
    last = max(place for place, one in enumerate(cells) if "check" in one.metadata.get("tags", []))
    namespace, changed = {}, 0
    for one in cells[:last]:
        if not {"check", "picture", "raises-exception"} & {*one.metadata.get("tags", [])}:
            source, times = re.subn(*change, one.source) if change else (one.source, 1)
            exec(source, namespace)
            changed += times
    assert changed
    return namespace


@pytest.mark.parametrize(("name", "letter"), SETS)
def test_solutions_pass_and_untouched_notebooks_do_not(name, letter):
    lab = opened(name, letter)
    solved, untouched = (
        run(solution(rendered(name, letter))),
        run(student(rendered(name, letter), {})),
    )
    for question in sets()[letter].questions:
        assert lab.check(question.name, solved[question.function]).passed
        assert lab.check(question.name, untouched[question.function]).status == "not implemented"


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


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("question", WRONG_STEPS)
def test_a_wrong_step_is_named(name, question):
    """Also where the input rests at first, and where the switch comes after the steps that are
    simulated."""
    lab = opened(name, question[0])
    for old, new, mistake in WRONG_STEPS[question]:
        functions = run(solution(rendered(name, question[0])), old, new)
        result = lab.check(question, functions[lab.questions[question].function])
        assert result.status == "wrong" and mistake in result.diagnosis, result


k, u, c, q, r, e = sp.symbols("k u c q r e", real=True)


def growth(mean):
    """The linearised growth model with another mean."""

    def answer(z, p):
        slope = sp.Rational(1, 2) + 25 * (1 - z**2) / (1 + z**2) ** 2
        return mean(z / 2 + 25 * z / (1 + z**2)), slope**2 * p + 10

    return answer


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
    result = opened(name, "a").check("a2", answer)
    assert result.passed == (mistake == "")
    assert not mistake or mistake in result.diagnosis, result


def test_what_cannot_be_asked_is_refused_with_the_reason():
    with pytest.raises(
        ExerciseError,
        match=r"set a asks for formulas.*no closed form.*another variant for this set",
    ):
        rendered("growth", "a")
    for letter in "bcdg":
        with pytest.raises(
            ExerciseError,
            match=f"set {letter} asks about a model without angles in the measurement",
        ):
            exercise(letter, ANGLE)
    with pytest.raises(ExerciseError, match="set e asks about a model without angles in the state"):
        exercise("e", ANGLE | {"angles": {"x": ["x"], "y": ["y"]}})


ANGLE = {"state": "0.9*x + 0.4*v", "meter": "x + 0.5*w", "angles": ["y"], "prior": {"mean": 3.0}}
