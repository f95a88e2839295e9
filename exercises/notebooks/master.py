"""Masters of the exercise sets, and the notebooks made from them.

A master is a MyST Markdown notebook, exercises/<set>/statement.md.  Text of the variant goes in by
Jinja, with the delimiters [= ... =] and [% ... %] that neither Python nor LaTeX uses; what is
between the lines

::

    # BEGIN SOLUTION            <!-- BEGIN SOLUTION -->
    # END SOLUTION              <!-- END SOLUTION -->

of a code or text cell is the solution; a cell of nothing else, such as the answer to a question in
words, is left out for
students.  From a master come, for a variant,

::

    render(...)     the complete notebook, with solutions
    student(...)    the same without: stubs that raise NotImplementedError, and the pictures to
                    reach
    statement(...)  the text of the book's page: questions and stubs, nothing executed
"""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import jinja2
import jupytext
import nbformat
import sympy as sp
from nbformat import NotebookNode

from kfcourse.exercises.checks import Exercise, sets
from kfcourse.exercises.notebooks.written_code import Solutions
from kfcourse.lab.variants import VariantError, find_variant
from kfcourse.symbolic.model import Model

BEGIN, END = "BEGIN SOLUTION", "END SOLUTION"
STUBS = STUB, _ = "# YOUR CODE HERE", "raise NotImplementedError"
CHECK = re.compile(r"""(\w+)\.check\(\s*["'](\w+)["']""")  # the exercise's name, the question


class MasterError(ValueError):
    """A master is missing or cannot be used; the message names the file and the place."""


def read(letter: str, masters: Path | None = None) -> str:
    """Text of the master of a set; from `masters`, a folder like exercises/, if one is given."""
    own = sets()[letter].folder
    path = (own if masters is None else masters / own.name) / "statement.md"
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise MasterError(
            f"no master {path}; leave --masters out, or name a folder that has "
            f"{own.name}/statement.md"
        ) from None


def render(text: str, exercise: Exercise) -> NotebookNode:
    """The complete notebook, solutions in, of a master's text for an exercise.

    Raises
    ------
    MasterError
        The text is no template, or its solution markers do not match; names the set and the line.
    """
    name = sets()[exercise.letter].name
    environment = jinja2.Environment(
        variable_start_string="[=",
        variable_end_string="=]",
        block_start_string="[%",
        block_end_string="%]",
        comment_start_string="[##",
        comment_end_string="##]",
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    try:
        filled = environment.from_string(text).render(context(exercise))
    except jinja2.TemplateSyntaxError as error:
        raise MasterError(f"master {name}, line {error.lineno}: {error.message}") from None
    except jinja2.UndefinedError as error:
        raise MasterError(f"master {name}: {error.message}") from None
    notebook = jupytext.reads(filled, fmt="md:myst")
    for index, cell in enumerate(notebook.cells):
        cell.id = f"{exercise.letter}-{index:02d}"
        _check_markers(cell.source, f"master {name}, cell {index + 1}")
        if cell.cell_type == "code" and STUB in without_solution(cell.source, code=True):
            names = re.findall(r"^def (\w+)", cell.source, re.MULTILINE)
            cell.metadata["kfcourse"] = {"answer": "".join(names[:1])}
    notebook.metadata["kfcourse"] = {"set": exercise.letter, "variant": exercise.variant.name}
    notebook.metadata["kernelspec"] = {
        "display_name": "Python 3",
        "language": "python",
        "name": "python3",
    }
    return notebook


def _check_markers(source: str, where: str) -> None:
    inside = False
    for number, line in enumerate(source.splitlines(), 1):
        if BEGIN in line or END in line:
            if (BEGIN in line) == inside:
                raise MasterError(
                    f"{where}, line {number}: {BEGIN if inside else END} without "
                    f"{END if inside else BEGIN} before it"
                )
            inside = not inside
    if inside:
        raise MasterError(f"{where}: {BEGIN} without {END}")


def without_solution(source: str, code: bool) -> str:
    """The text without what is between the markers; in code a stub takes its place, unless there is
    nothing else."""
    kept: list[str] = []
    inside = False
    for line in source.splitlines():
        if BEGIN in line:
            inside = True
            if code:
                indent = line[: len(line) - len(line.lstrip())]
                kept += [f"{indent}{line}" for line in STUBS]
        elif END in line:
            inside = False
        elif not inside:
            kept.append(line)
    return "\n".join(kept) if any(line.strip() not in ("", *STUBS) for line in kept) else ""


def solution(notebook: NotebookNode) -> NotebookNode:
    """The worked solution: the complete notebook without the marker lines."""
    result = nbformat.from_dict(notebook)
    for cell in result.cells:
        lines = cell.source.splitlines()
        cell.source = "\n".join(line for line in lines if BEGIN not in line and END not in line)
    return result


def student(notebook: NotebookNode, pictures: Mapping[str, bytes]) -> NotebookNode:
    """The student's notebook: stubs in place of the solutions, and the pictures to reach.

    Parameters
    ----------
    notebook : NotebookNode
        From `render`.
    pictures : dict
        Cell id to PNG, of the solution's cells tagged `picture`.
    """
    result = nbformat.from_dict(notebook)
    cells: list[NotebookNode] = []
    stubs = False
    for cell in result.cells:
        cell.source = without_solution(cell.source, cell.cell_type == "code")
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
            stub = STUB in cell.source
            # it may call what is not written yet: "Run All" goes on to the other questions
            if stubs and not stub:
                cell.metadata["tags"] = [*cell.metadata.get("tags", []), "raises-exception"]
            stubs = stubs or stub
            if cell.id in pictures:
                cells.append(_picture(cell, pictures[cell.id]))
        if cell.source.strip():
            cells.append(cell)
    result.cells = cells
    return result


def _picture(drawn_by: NotebookNode, png: bytes) -> NotebookNode:
    name, seen = drawn_by.id, drawn_by.metadata.get("alt", "The picture to reach")
    cell = nbformat.v4.new_markdown_cell(
        f"The picture to reach:\n\n![{seen}](attachment:{name}.png)"
    )
    cell.id = f"{name}-goal"
    cell["attachments"] = {f"{name}.png": {"image/png": base64.b64encode(png).decode()}}
    return cell


def statement(notebook: NotebookNode, pictures: Mapping[str, tuple[str, int]]) -> str:
    """The set as a page of the book: text, stubs and checks as plain code, what draws a picture
    folded under it.

    `pictures`: cell id to the path of the image and its width in pixels of a screen.
    """
    parts = []
    for cell in notebook.cells:
        source = without_solution(cell.source, cell.cell_type == "code").strip()
        if not source:
            continue
        if cell.cell_type == "code":
            source = f"```python\n{source}\n```"
            if cell.id in pictures:
                path, width = pictures[cell.id]
                seen = cell.metadata.get("alt", "")
                parts.append(
                    f"```{{figure}} {path}\n:alt: {seen}\n:width: {width}px\n\nThe picture to "
                    f"reach.\n```"
                )
                source = (
                    f'<details class="kf-code"><summary>Show the '
                    f"code</summary>\n\n{source}\n\n</details>"
                )
        parts.append(source)
    return "\n\n".join(parts) + "\n"


def context(exercise: Exercise) -> dict[str, Any]:
    """What a master's template may use."""
    model = exercise.model
    blocks = [model.latex(values=False)]
    if model.timed and (lines := model.known.latex()):  # the time, first values of the inputs
        blocks.append("\\begin{aligned}\n" + " \\\\\n".join(lines) + "\n\\end{aligned}")
    return {
        "exercise": exercise,
        "variant": exercise.variant.name,
        "opened": opened(exercise),
        "title": sets()[exercise.letter].title,
        "model": model,
        "scalar": model.n == 1 and model.p == 1,
        "latex": sp.latex,
        "equations": "\n\n".join(f"$$\n{block}\n$$" for block in blocks),
        "timed": model.timed,
        "known": known(model),
        "k": ", k" if model.timed else "",  # the last argument of functions that take the step
        "symbols": parameter_symbols(exercise),
        "values": {name: float(value) for name, value in model.parameters.items()},
        "solution": Solutions(exercise),
        "heading": partial(heading, exercise),
        "check": partial(check_cell, exercise),
    }


def known(model: Model) -> str:
    """A sentence on what the equations contain of the step; nothing if it is nothing."""
    meanings = dict.fromkeys(model.known.inputs, "an input, whose value is known at every step")
    meanings = {"k": "the number of the step", "t": "the time"} | meanings
    parts = [f"${sp.latex(s)}$ is {meanings[s.name]}" for s in model.known.symbols]
    return f"Your equations depend on the step: {'; '.join(parts)}." if parts else ""


def heading(exercise: Exercise, name: str, russian: str = "") -> str:
    """Number, level and title of a question."""
    question = exercise.questions[name]
    term = f" ({russian})" if russian else ""
    return f"## Question {name[1:]} ({question.level}): {question.title}{term}"


def check_cell(exercise: Exercise, name: str) -> str:
    """The cell in which a student checks an answer."""
    return (
        f'```{{code-cell}} python\n:tags: [check]\ntask.check("{name}", '
        f"{exercise.questions[name].function})\n```"
    )


def opened(exercise: Exercise) -> str:
    """Python for the variant: its name if it is a shipped one, else its table, so that the notebook
    needs no file."""
    variant = exercise.variant
    with suppress(VariantError):  # no such is shipped
        if find_variant(variant.name) == variant:
            return f'"{variant.name}"'
    return repr({"name": variant.name, **variant.table})


def parameter_symbols(exercise: Exercise) -> str:
    """The line of code that makes the symbols of the parameters, and of what is known of every
    step."""
    names = [*exercise.model.parameters, *(s.name for s in exercise.model.known.symbols)]
    if not names:
        return "# this variant has no parameters"
    left = ", ".join(names)
    return (
        f"{left}{',' if len(names) == 1 else ''} = "
        f'sp.symbols("{" ".join(names)}{"," if len(names) == 1 else ""}", real=True)'
    )
