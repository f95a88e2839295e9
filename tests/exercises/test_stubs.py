"""What a student is given and what is checked belong together: names, arguments, imports."""

import ast
import inspect
import re

import pytest

from kfcourse.checks import exercise, sets
from kfcourse.notebooks.master import read, render, without_solution

pytestmark = pytest.mark.quick

QUESTIONS = [
    pytest.param(letter, question, id=question.name)
    for letter, one in sets().items()
    for question in one.questions
]


def notebook(letter):
    return render(read(letter), exercise(letter, "53"))


def stubs(letter):
    """Functions of the student's notebook that still have to be written: name to arguments."""
    cells = [
        without_solution(cell.source, code=True)
        for cell in notebook(letter).cells
        if cell.cell_type == "code"
    ]
    found = [
        node
        for source in cells
        for node in ast.parse(source).body
        if isinstance(node, ast.FunctionDef)
    ]
    return {node.name: [argument.arg for argument in node.args.args] for node in found}


@pytest.mark.parametrize(("letter", "question"), QUESTIONS)
def test_the_key_has_the_name_and_the_arguments_of_the_stub(letter, question):
    key = question.answer(exercise(letter, "53"))
    assert stubs(letter)[question.function] == list(inspect.signature(key).parameters)


@pytest.mark.parametrize("letter", sets())
def test_a_notebook_imports_no_module_of_a_key(letter):
    imported = set(re.findall(r"kfcourse\.exercises\.\w+\.(\w+)", read(letter)))
    assert imported <= {"companion"}
    for name in imported:
        source = (sets()[letter].folder / f"{name}.py").read_text(encoding="utf-8")
        assert not re.search(r"kfcourse\.exercises\.\w+\.", source)
