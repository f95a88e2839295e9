"""The tiny set, and notebooks executed in this process: no kernel has to start, where nothing is asked
about kernels."""

import ast
import json
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import nbformat

from kfcourse.exercises.checks import exercise
from kfcourse.exercises.grading.running import Kernel, Ran
from kfcourse.exercises.grading.session import _of_a_stub
from kfcourse.exercises.grading.values import decode, encode
from kfcourse.exercises.notebooks.execution import results
from kfcourse.exercises.notebooks.master import read, render, solution, student

FIXTURES = Path(__file__).parent / "exercises" / "fixtures"
TINY = (FIXTURES / "b_aof" / "statement.md").read_text(encoding="utf-8")


TABLES = {  # variants with time and inputs
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


@cache
def opened(letter, variant="53"):
    """A set for a variant of the lab, or of those here."""
    own = TABLES.get(variant)
    return exercise(letter, {"name": variant, **own} if own else variant)


@cache
def rendered(letter, variant="53"):
    """The complete notebook of a set; not to be changed."""
    return render(read(letter), opened(letter, variant))


def tiny(variant="53", text=TINY):
    return render(text, exercise("b", variant))


def handed_out(*changes):
    """The tiny set as a student gets it, changed."""
    return changed(student(tiny(), {}), *changes)


def solved(*changes, variant="53"):
    return changed(solution(tiny(variant)), *changes)


def changed(notebook, *changes):
    """With a new text in the cell that begins so, (start, old, new), or a cell before that one,
    (start, source); at the end, if the start is empty."""
    for start, *texts in changes:
        if len(texts) == 2:
            assert texts[0] in cell(notebook, start).source
            cell(notebook, start).source = cell(notebook, start).source.replace(*texts)
        else:
            place = notebook.cells.index(cell(notebook, start)) if start else len(notebook.cells)
            notebook.cells.insert(place, nbformat.v4.new_code_cell(*texts))
    return notebook


def cell(notebook, start):
    return next(cell for cell in notebook.cells if cell.source.startswith(start))


def code(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def execute_inside(notebook):
    """A copy with outputs: values of last lines and errors, after which the rest runs too."""
    result, namespace = nbformat.from_dict(notebook), {}
    for count, cell in enumerate(code(result), 1):
        cell.execution_count = count
        try:
            *body, last = ast.parse(cell.source).body
            if not isinstance(last, ast.Expr):
                body, last = [*body, last], None
            exec(compile(ast.Module(body, []), cell.id, "exec"), namespace)
            value = last and eval(compile(ast.Expression(last.value), cell.id, "eval"), namespace)
            if hasattr(value, "_repr_mimebundle_"):
                shown = value._repr_mimebundle_()
                cell.outputs = [nbformat.v4.new_output("execute_result", shown)]
        except Exception as error:
            failure = {"ename": type(error).__name__, "evalue": str(error)}
            cell.outputs = [nbformat.v4.new_output("error", **failure)]
    return result


def errors(executed):
    """The cells of an executed notebook that show an error, each with that output."""
    shown = [(cell, output) for cell in code(executed) for output in cell.get("outputs", [])]
    return [(cell, output) for cell, output in shown if output.output_type == "error"]


def checked(notebook):
    """What the checks say, question by question; a cell that stands on a stub is marked as one that
    may fail."""
    cells = code(notebook)
    last = max(i for i, cell in enumerate(cells) if "check" in cell.metadata.get("tags", []))
    executed = execute_inside(nbformat.v4.new_notebook(cells=cells[: last + 1]))
    for cell, error in errors(executed):
        assert error.ename == "NotImplementedError", error
        assert "raises-exception" in cell.metadata.get("tags", []), cell.source
    return {result["question"]: result for result in results(executed)}


def statuses(notebook):
    return {name: result["status"] for name, result in checked(notebook).items()}


class InsideKernel:
    """A kernel for notebooks that do nothing to their process; values are sent as between two."""

    def __init__(self, place, opening, seconds):
        self.seconds, self._namespace, self._answers = seconds, {}, {}

    answer = Kernel.answer

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def cell(self, source, names=()):
        handed_in = {}
        self._namespace.update(dict.fromkeys(names, SimpleNamespace(check=handed_in.__setitem__)))
        try:
            exec(source, self._namespace)
            error, stub = "", False
        except Exception as raised:
            error, stub = f"{type(raised).__name__}: {raised}", _of_a_stub(raised)
        self._answers |= handed_in
        kinds = {name: type(value).__name__ for name, value in handed_in.items()}
        return Ran(error, stub, {n: "" if callable(handed_in[n]) else k for n, k in kinds.items()})

    def ask(self, question, arguments, seconds):
        functions = []
        sent = _sent(encode(arguments, functions))
        return decode(_sent(encode(self._answers[question](*decode(sent, functions.__getitem__)))))


def _sent(data):
    return json.loads(json.dumps(data))
