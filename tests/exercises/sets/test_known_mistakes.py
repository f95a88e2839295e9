"""Every answer of every set passes, every known mistake is recognised by its name, and no message
gives an answer away."""

import random
from functools import cache, partial

import numpy as np
import pytest
import sympy as sp
from weekly import WEEK

from kfcourse import load_variants
from kfcourse.exercises.checks import ExerciseError, engine, exercise, sets
from kfcourse.exercises.checks.editing import edited

# Questions about the variant's model are asked for variants of all kinds.  The others are called
# with hidden functions, numbers: two draws of them.  So are those of sets f and g, g's in the
# dimensions of the variant: a variant for each of them.
MODELS = ("53", "7", "9", "12", "20", "21")
DRAWS = ("53", "21")
# Each question in one of its variants, in another one every week; in all of them every night.
HIDDEN = {"f": DRAWS, "g": ("53", "12", "20", "21")} | {
    letter: DRAWS for letter, set_ in sets().items() if not set_.about_variant
}

CASES = [
    pytest.param(
        letter,
        question,
        variant,
        id=f"{question.name}-{variant}",
        marks=[] if place == chosen else pytest.mark.slow,
    )
    for letter, set_ in sets().items()
    for number, question in enumerate(set_.questions)
    for variants in [HIDDEN.get(letter, MODELS)]
    for chosen in [(WEEK + number) % len(variants)]
    for place, variant in enumerate(variants)
]


@cache
def opened(letter, variant):
    return exercise(letter, variant)


def test_every_edit_finds_its_text():
    """In exactly one place of the key, or of a function that it calls; ValueError otherwise."""
    edits = [
        m.wrong
        for set_ in sets().values()
        for q in set_.questions
        for m in q.mistakes
        if isinstance(m.wrong, partial)
    ]
    assert len(edits) > 600
    for edit in edits:
        key, texts = edit.args
        assert callable(edited(key, *texts))


@pytest.mark.parametrize(("letter", "question", "variant"), CASES)
def test_every_answer_and_every_mistake(letter, question, variant):
    """The right answer passes.  A mistake is diagnosed by its name, or it is the same as the right
    answer here, or impossible.

    Hidden arguments tell every mistake from the answer: there none is the same.  No message gives
    the answer away.
    """
    lab = opened(letter, variant)
    key, arguments = question.answer(lab), list(question.arguments(lab))
    assert lab.check(question.name, key).passed
    right = [key(*values) for values in arguments]
    given_away = telling(right)
    for mistake in question.mistakes:
        try:
            wrong = mistake.answer(lab)
        except ValueError:
            assert letter not in HIDDEN
            continue
        result = engine.check(question, lab, wrong)  # as if nothing had been handed in before
        assert not [text for text in given_away if text in result.message.replace(" ", "")]
        fact = equal_in_fact(wrong, arguments, right)
        if letter in HIDDEN:
            assert fact is not True
        if mistake.name in result.diagnosis:
            assert mistake.says in result.message
            assert fact is not True
        else:
            expected = {True: "passed", None: "unusable", False: "diagnosed"}[fact]
            assert result.status == expected, f"{mistake.name}: {result}"


@pytest.mark.slow
@pytest.mark.parametrize(
    "letter", [letter for letter, set_ in sets().items() if set_.about_variant and letter != "a"]
)
def test_hidden_arguments_tell_every_mistake_apart_in_every_variant(letter):
    """No known mistake gives the right numbers for any variant of the lab; a transposed number is
    no mistake.

    Set a is called with the model's own formulas: where those are linear, the tangent is exact.
    """
    equal = set()
    for name in load_variants():
        try:
            lab = opened(letter, name)
        except ExerciseError:
            continue
        for question in lab.questions.values():
            key, arguments = question.answer(lab), list(question.arguments(lab))
            right = [key(*values) for values in arguments]
            for mistake in question.mistakes:
                try:
                    wrong = mistake.answer(lab)
                except ValueError:
                    continue
                if equal_in_fact(wrong, arguments, right) and not (
                    lab.model.n == 1 and mistake.name == "gain-transposed"
                ):
                    equal.add((question.name, mistake.name, name))
    assert equal == set()


def equal_in_fact(wrong, arguments, right):
    """Whether a mistake gives the right numbers, to rounding; None if its numbers have another
    shape, or there are none."""
    try:
        with np.errstate(all="ignore"):
            theirs = [wrong(*values) for values in arguments]
        pairs = [
            pair
            for result, expected in zip(theirs, right, strict=True)
            for pair in paired(result, expected)
        ]
    except Exception:  # a mistake that this variant does not allow
        return None
    if any(np.shape(a) != np.shape(b) for a, b in pairs):
        return None
    with np.errstate(all="ignore"):
        # Formulas are evaluated in doubles, sums of some tens of terms: 1e-9 is far above their
        # rounding.
        return all(np.allclose(a, b, rtol=1e-9, atol=1e-9 * np.abs(b).max()) for a, b in pairs)


def paired(result, expected):
    """The parts of two results as arrays."""
    return list(zip(numbers(result), numbers(expected), strict=True))


def numbers(result):
    """A result as arrays; formulas at a random point, the same for the same name."""
    if isinstance(result, tuple | list):
        return [array for part in result for array in numbers(part)]
    if not isinstance(result, sp.Basic | sp.MatrixBase):
        return [np.asarray(result, dtype=complex)]
    point = {s: sp.Float(0.2 + random.Random(s.name).random()) for s in result.free_symbols}
    entries = result.tolist() if isinstance(result, sp.MatrixBase) else result
    return [
        np.vectorize(lambda entry: complex(sp.sympify(entry).xreplace(point)), otypes=[complex])(
            np.array(entries, dtype=object)
        )
    ]


def telling(right):
    """The right formulas, in the usual ways of writing them."""
    formulas = [
        formula for result in right for formula in flat(result) if isinstance(formula, sp.Expr)
    ]
    forms = {form(q) for q in formulas for form in (str, sp.latex, lambda q: str(sp.expand(q)))}
    return [text for text in (form.replace(" ", "") for form in forms) if len(text) > 3]


def flat(result):
    return (
        [entry for part in result for entry in flat(part)]
        if isinstance(result, tuple | list | sp.MatrixBase)
        else [result]
    )
