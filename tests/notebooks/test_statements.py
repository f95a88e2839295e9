"""Statements: a task and a hint for every question, and answers to the questions in words that hold
for the variant at hand."""

import re

import pytest
from inside import execute_inside

from kfcourse.checks import exercise, sets
from kfcourse.notebooks.execution import results
from kfcourse.notebooks.master import STUB, read, render, solution, student

ANSWERED = {
    "a": 2,
    "b": 1,
    "c": 1,
    "d": 1,
    "e": 1,
    "f": 2,
    "g": 2,
    "h": 2,
    "i": 1,
    "j": 1,
    "k": 2,
    "l": 1,
    "m": 1,
    "n": 1,
    "o": 1,
    "p": 1,
    "r": 1,
    "s": 0,
}  # questions in words
SAID = re.compile(
    r"\*(What to expect|Why never negative|When is there an answer\?|What is left out)\.?\*|It "
    r"goes to \$\\beta\$"
)


def questions():
    for letter in sets():
        parts = re.split(r'\[= heading\("(\w+)".*', read(letter))
        yield from zip(
            parts[1::2], (body.partition("[= check(")[0] for body in parts[2::2]), strict=True
        )


@pytest.mark.quick
@pytest.mark.parametrize(("name", "body"), list(questions()))
def test_every_question_has_a_task_and_a_hint(name, body):
    text = re.sub(r"(?s)```.*?```|<details>.*?</details>", "", body)
    assert len(text.split()) >= 8, f"{name} does not say what to do"
    hints = re.findall(r"(?s)<details><summary>Hint</summary>\n\n(.+?)\n\n</details>", body)
    assert hints, f"{name} has no hint"


@pytest.mark.parametrize(
    ("letter", "variant"),
    [(letter, "5") for letter in sets()] + [("a", "53"), ("a", "1"), ("g", "20")],
)
def test_answers_in_words_are_the_solutions_only(letter, variant):
    """They run to the end, and no student gets one of them, nor a stub in its place."""
    whole = render(read(letter), exercise(letter, variant))
    done = execute_inside(solution(whole))
    assert [one for one in results(done) if one["status"] != "passed"] == []
    assert [
        output
        for cell in done.cells
        for output in cell.get("outputs", [])
        if output.output_type == "error"
    ] == []
    assert (
        len(SAID.findall("\n".join(cell.source for cell in solution(whole).cells)))
        == ANSWERED[letter]
    )
    handed_out = student(whole, {})
    assert not [
        cell.source
        for cell in handed_out.cells
        if SAID.search(cell.source) or "SOLUTION" in cell.source
    ]
    stubs = [cell for cell in handed_out.cells if STUB in cell.source]
    assert all(cell.source.startswith("def ") for cell in stubs)
    # question 6 of set e has one, too
    assert len(stubs) == len(sets()[letter].questions) + (letter == "e")


@pytest.mark.parametrize(("variant", "first"), [("53", 1), ("5", 0), ("20", 0), ("12", 0)])
def test_the_first_step_is_left_out_only_where_the_meter_is_silent(variant, first):
    text = "\n".join(cell.source for cell in render(read("g"), exercise("g", variant)).cells)
    assert ("The first step is left out" in text) == bool(first) == ("one[1:]" in text)
    assert f"np.arange({first}, len(y))" in text
