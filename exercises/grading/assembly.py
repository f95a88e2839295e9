"""The notebook that is run: the master's, made again, with the student's cells in it."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping, Sequence
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


def check_cells(master: NotebookNode) -> dict[str, list[str]]:
    """Id of a check cell to the questions it asks."""
    return {
        cell.id: _asked(cell.source)
        for cell in master.cells
        if cell.cell_type == "code" and _asked(cell.source)
    }


def _asked(source: str) -> list[str]:
    return [question for _, question in CHECK.findall(source)]


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
    code = [(index, cell) for index, cell in enumerate(master.cells) if cell.cell_type == "code"]
    checks = check_cells(master)
    places, taken = _places(code, checks, cells)
    ordered = [(index, -1, Step(cell.source, "the first cell")) for index, cell in code[:1]]
    for index, cell in code[1:]:
        where = (
            f"the check of {', '.join(checks[cell.id])}"
            if cell.id in checks
            else f"the cell `{cell.source[:40].strip()}`"
        )
        if cell.id in checks:
            names = tuple(dict.fromkeys(name for name, _ in CHECK.findall(cell.source)))
            ordered.append(
                (index, 0, Step(cell.source, where, False, names, tuple(checks[cell.id])))
            )
        elif index not in taken:
            ordered.append((index, 0, Step(cell.source, where)))
    own = [cell for cell in cells if cell.number in places]
    ordered += [
        (places[cell.number], cell.number, Step(cell.source, cell.name, True)) for cell in own
    ]
    return [step for *_, step in sorted(ordered, key=lambda row: row[:2])], own


def lost(master: NotebookNode, cells: Sequence[Cell]) -> dict[str, str]:
    """Names of asked functions whose cells did not come back as code, each with what became of
    it."""
    defined = set[str]().union(*(_defined(cell.source) for cell in cells if cell.code))
    back = {cell.id for cell in cells if cell.code} | {cell.answer for cell in cells if cell.code}
    fates = {}
    for stub in (cell for cell in master.cells if "kfcourse" in cell.metadata):
        name = stub.metadata["kfcourse"]["answer"]
        if name not in defined and not {stub.id, name} & back:
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
    code: Sequence[tuple[int, NotebookNode]], checks: Mapping[str, list[str]], cells: Sequence[Cell]
) -> tuple[dict[int, int], set[int]]:
    """Number of a student's cell to the index of the master's cell that it replaces or follows; and
    those that are replaced."""
    by_id = {cell.id: index for index, cell in code}
    answers = {
        cell.metadata["kfcourse"]["answer"]: index
        for index, cell in code
        if "kfcourse" in cell.metadata
    }
    asked_at = {
        question: by_id[name] for name, questions in checks.items() for question in questions
    }
    unchanged = {_plain(cell.source): index for index, cell in reversed(code)}
    of: dict[int, int] = {}
    taken: set[int] = set()

    mine = [
        cell
        for cell in cells
        if _plain(cell.source) not in unchanged and not _only_checks(cell.source)
    ]
    defines = {cell.number: _defined(cell.source) & set(answers) for cell in mine}
    for name, index in answers.items():
        candidates = [cell for cell in mine if name in defines[cell.number]]
        if candidates:
            best = min(
                candidates,
                key=lambda cell: (by_id.get(cell.id) != index, cell.answer != name, cell.number),
            )
            of[best.number] = min(index, of.get(best.number, index))
            taken.add(index)
    for cell in mine:
        index = answers.get(cell.answer, by_id.get(cell.id, -1))
        if (
            cell.number not in of
            and not defines[cell.number]
            and index not in taken | set(asked_at.values()) | {-1}
        ):
            of[cell.number] = index
            taken.add(index)

    last = -1
    kept = {cell.number for cell in mine}
    for cell in cells:
        if cell.number in of:
            last = of[cell.number]
        elif cell.number in kept:
            of[cell.number] = last
        else:  # a cell of the master's, as it was
            asked = [asked_at[question] for question in _asked(cell.source) if question in asked_at]
            last = asked[-1] if asked else unchanged.get(_plain(cell.source), last)
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
