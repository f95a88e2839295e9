"""Masters of all sets: what students get, worked solutions that pass, and a task and a hint for every
question."""

import ast
import inspect
import re

import pytest
from inside import TABLES, errors, execute_inside, opened, rendered, statuses
from weekly import weekly

from kfcourse.exercises.checks import sets
from kfcourse.exercises.notebooks.execution import results
from kfcourse.exercises.notebooks.master import STUB, STUBS, read, solution, student

VARIANTS = dict.fromkeys(sets(), ("53", "21", "5")) | dict.fromkeys(
    "abcdefg", ("53", "21", "5", "1", "20", *TABLES)
)
PAIRS = [(letter, variant) for letter, names in VARIANTS.items() for variant in names]
PAIRS.remove(("a", "growth"))
ANSWERS = re.compile(  # to questions in words
    r"\*(What to expect|Why never negative|When is there an answer\?|What is left out)\.?\*|It "
    r"goes to \$\\beta\$"
)


@pytest.mark.parametrize(("letter", "variant"), weekly(PAIRS))
def test_what_students_get(letter, variant):
    """Stubs that a key can be put into, with nothing that is not in the solution too; run, they fail
    only with "not implemented"."""
    whole, questions = rendered(letter, variant), sets()[letter].questions
    handed_out = student(whole, {})
    solved = {each.id: each.source for each in solution(whole).cells}
    stubs = {}
    for each in handed_out.cells:
        assert not ANSWERS.search(each.source) and "SOLUTION" not in each.source
        lines = iter(solved[each.id].splitlines())
        own = [line for line in each.source.splitlines() if line.strip() not in STUBS]
        assert all(line in lines for line in own)  # in this order
        if STUB in each.source:
            (function,) = ast.parse(each.source).body[:1]
            stubs[function.name] = [argument.arg for argument in function.args.args]
    for question in questions:
        key = question.answer(opened(letter, variant))
        assert stubs[question.function] == list(inspect.signature(key).parameters)
    assert len(stubs) == len(questions) + (letter == "e")  # question 6 of set e has one, too
    assert statuses(handed_out) == dict.fromkeys([q.name for q in questions], "not implemented")
    tags = [tag for each in whole.cells for tag in each.metadata.get("tags", [])]
    assert tags.count("check") == len(questions) and "picture" in tags


@pytest.mark.parametrize(("letter", "variant"), weekly(PAIRS, 5))
def test_worked_solutions_pass(letter, variant):
    """They run to the end, the answers in words too, which hold for the variant at hand."""
    worked = solution(rendered(letter, variant))
    done = execute_inside(worked)
    assert errors(done) == [] and {each["status"] for each in results(done)} == {"passed"}
    assert any(ANSWERS.search(each.source) for each in worked.cells) == (letter != "s")


@pytest.mark.parametrize("letter", sets())
def test_every_question_has_a_task_and_a_hint(letter):
    parts = re.split(r'\[= heading\("(\w+)".*', read(letter))
    assert parts[1::2] == [question.name for question in sets()[letter].questions]
    for name, body in zip(parts[1::2], parts[2::2], strict=True):
        body = body.partition("[= check(")[0]
        text = re.sub(r"(?s)```.*?```|<details>.*?</details>", "", body)
        assert len(text.split()) >= 8, f"{name} does not say what to do"
        hint = r"(?s)<details><summary>Hint</summary>\n\n(.+?)\n\n</details>"
        assert re.search(hint, body), f"{name} has no hint"
    assert "**To hand in**" in read(letter)
    imported = set(re.findall(r"kfcourse\.exercises\.sets\.\w+\.(\w+)", read(letter)))
    assert imported <= {"companion"}, "a module of a key"
    for name in imported:
        source = (sets()[letter].folder / f"{name}.py").read_text(encoding="utf-8")
        assert not re.search(r"kfcourse\.exercises\.sets\.", source)


@pytest.mark.parametrize(("variant", "first"), [("53", 1), ("5", 0), ("20", 0), ("12", 0)])
def test_the_first_step_is_left_out_only_where_the_meter_is_silent(variant, first):
    text = "\n".join(each.source for each in rendered("g", variant).cells)
    assert ("The first step is left out" in text) == bool(first) == ("[1:] for" in text)
    assert f"np.arange({first}, len(y))" in text
