"""The notebook that is run: the master's, made again, with the student's cells in it."""

from __future__ import annotations

import ast
import re
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

from nbformat import NotebookNode

from kfcourse.exercises.checks import exercise
from kfcourse.exercises.grading.submissions import Cell, syntax
from kfcourse.exercises.notebooks.master import CHECK, render, student


@lru_cache(maxsize=64)
def generated(text: str, letter: str, opening: str) -> NotebookNode:
    """The student's notebook as it was handed out.  Not to be changed."""
    return student(render(text, exercise(letter, ast.literal_eval(opening))), {})


class Step(NamedTuple):
    """A cell to run.

    where: what a note calls it;  own: whether the student wrote it;  names, questions: by which
    names a check cell calls the exercise, and what it asks.
    """

    source: str
    where: str
    own: bool = False
    names: tuple[str, ...] = ()
    questions: tuple[str, ...] = ()


def assembled(master: NotebookNode, cells: Sequence[Cell]) -> tuple[list[Step], list[Cell]]:
    """The master's cells with the student's in them, and those.

    A cell that defines an asked function takes the place of its stub, wherever it stands; a changed
    cell of the master, known by its id, takes that cell's place, but the first one runs all the
    same: it imports, whatever stops the changed one.  Other cells follow what they followed in the
    returned notebook.  The master's check cells stay, and get the exercise as it was handed out.
    """
    cells = [cell for cell in cells if cell.code]
    code = {index: cell for index, cell in enumerate(master.cells) if cell.cell_type == "code"}
    places, taken = _places(code, cells)
    first, own, steps = min(code), [cell for cell in cells if cell.number in places], []
    for index, cell in code.items():
        calls = CHECK.findall(cell.source)
        names, questions = (tuple(dict.fromkeys(call[part] for call in calls)) for part in (0, 1))
        where = "the first cell" if index == first else f"the cell `{cell.source[:40].strip()}`"
        if questions:
            where = f"the check of {', '.join(questions)}"
        if index == first or index not in taken:
            steps.append((index, 0, Step(cell.source, where, False, names, questions)))
    steps += [
        (places[cell.number], cell.number, Step(cell.source, cell.name, True)) for cell in own
    ]
    return [step for *_, step in sorted(steps)], own


def lost(master: NotebookNode, cells: Sequence[Cell]) -> dict[str, str]:
    """Names of asked functions whose cells did not come back as code, each with what became of
    it."""
    back = set[str]()
    for cell in cells:
        if cell.code:
            back |= {cell.id, cell.answer, *_defined(cell.source)}
    fates = {}
    for stub in (cell for cell in master.cells if "kfcourse" in cell.metadata):
        name = stub.metadata["kfcourse"]["answer"]
        if not {stub.id, name} & back:
            text = any(
                cell.id == stub.id or f"def {name}(" in cell.source
                for cell in cells
                if not cell.code
            )
            fates[name] = (
                "has become text: make it a code cell again"
                if text
                else "is gone from the notebook"
            )
    return fates


def _places(
    code: dict[int, NotebookNode], cells: Sequence[Cell]
) -> tuple[dict[int, int], set[int]]:
    """Number of a student's cell to the index of the master's cell that it replaces or follows; and
    those that are replaced."""
    by_id = {cell.id: index for index, cell in code.items()}
    answers = {
        cell.metadata["kfcourse"]["answer"]: index
        for index, cell in code.items()
        if "kfcourse" in cell.metadata
    }
    asked_at = {
        question: index
        for index, cell in code.items()
        for _, question in CHECK.findall(cell.source)
    }
    unchanged = {_plain(cell.source): index for index, cell in reversed(code.items())}
    mine = [
        cell
        for cell in cells
        if _plain(cell.source) not in unchanged and not _only_checks(cell.source)
    ]
    defines = {
        cell: {answers[name] for name in _defined(cell.source) & answers.keys()} for cell in mine
    }
    of: dict[int, int] = {}
    taken: set[int] = set()
    for index in code.keys() - asked_at.values():
        candidates = [
            (
                not defines[cell],
                by_id.get(cell.id) != index,
                answers.get(cell.answer) != index,
                cell,
            )
            for cell in mine
            if index in (defines[cell] or {answers.get(cell.answer, by_id.get(cell.id, -1))})
        ]
        if candidates:
            best = min(candidates)[-1].number
            of[best] = min(index, of.get(best, index))
            taken.add(index)

    last = -1
    for cell in cells:
        if cell in defines:
            last = of.setdefault(cell.number, last)
        else:  # a cell of the master's, as it was
            asked = [asked_at[name] for _, name in CHECK.findall(cell.source) if name in asked_at]
            last = [unchanged.get(_plain(cell.source), last), *asked][-1]
    return of, taken


def _plain(source: str) -> str:
    return "\n".join(line.rstrip() for line in source.strip().splitlines())


def _only_checks(source: str) -> bool:
    """Whether a cell does nothing but call checks."""
    tree = syntax(source)
    return tree is not None and all(
        isinstance(line, ast.Expr)
        and isinstance(line.value, ast.Call)
        and isinstance(line.value.func, ast.Attribute)
        and line.value.func.attr == "check"
        for line in tree.body
    )


def _defined(source: str) -> set[str]:
    """Names that a cell defines at top level; roughly, if it is not Python."""
    tree = syntax(source)
    if tree is None:
        return {
            a or b for a, b in re.findall(r"^(?:def\s+(\w+)|(\w+)\s*=(?!=))", source, re.MULTILINE)
        }
    names = set()
    for line in tree.body:
        if isinstance(line, ast.FunctionDef | ast.ClassDef):
            names.add(line.name)
        elif isinstance(line, ast.Assign):
            names |= {target.id for target in line.targets if isinstance(target, ast.Name)}
    return names
