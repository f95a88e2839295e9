"""The pages of the lab manual, made from the masters of the exercises for one variant.

Into book/manual/ go, for every set, its page (questions, hints, no solutions), the pictures to
reach, and the student's notebook to download; and the tables of all sets and variants.  The worked
solutions, executed before, are kept in _build/solutions.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import nbformat
import sympy as sp

from kfcourse.exercises.checks import exercise, sets
from kfcourse.exercises.notebooks.execution import pictures
from kfcourse.exercises.notebooks.jobs import Job
from kfcourse.exercises.notebooks.master import read, render, statement, student
from kfcourse.lab.variants import load_variants

VARIANT = "53"
PAGES = Path(__file__).resolve().parent / "manual"
SOLUTIONS = Path(__file__).resolve().parent.parent / "_build" / "solutions"
NOTE = """
```{{admonition}} Your own notebook
The formulas and pictures on this page are those of variant {variant}.
{{download}}`Download its notebook <notebooks/{file}.ipynb>`, or make that of your own variant,
here 5: `kfcourse exercises --variant 5 --sets {file[0]} --out mine`. Open it in Jupyter, in an
environment in which `kfcourse` is
installed: {{doc}}`../lab-manual`.
```
"""


def solutions() -> list[Job]:
    """The worked solutions that the pages are made from."""
    return [Job(letter, VARIANT, SOLUTIONS / VARIANT, "solutions") for letter in sets()]


def write() -> None:
    """Write the pages; the solutions are there."""
    shutil.rmtree(PAGES, ignore_errors=True)
    (PAGES / "notebooks").mkdir(parents=True)
    (PAGES / "sets.txt").write_text(table(), encoding="utf-8")
    (PAGES / "variants.txt").write_text(variants(), encoding="utf-8")
    for job in solutions():
        notebook, executed = (
            render(read(job.letter), exercise(job.letter, VARIANT)),
            nbformat.read(job.target, as_version=4),
        )
        images = pictures(executed)
        for name, png in images.items():
            (PAGES / f"{name}.png").write_bytes(png)
        file = sets()[job.letter].name
        heading, rest = statement(
            notebook, {name: (f"{name}.png", shown_width(png)) for name, png in images.items()}
        ).split("\n", 1)
        (PAGES / f"{file}.md").write_text(
            f"{heading}\n{NOTE.format(variant=VARIANT, file=file)}{rest}", encoding="utf-8"
        )
        nbformat.write(student(notebook, images), PAGES / "notebooks" / f"{file}.ipynb")


def shown_width(png: bytes) -> int:
    """Width of a picture on a page: it has twice the pixels of a screen."""
    return int.from_bytes(png[16:20], "big") // 2


def table() -> str:
    """The sets and the chapters that they belong to, in Markdown."""
    rows = [
        f"| {letter}: {{doc}}`{set_.title} <manual/{set_.name}>` | "
        f"{', '.join(f'{{doc}}`{chapter}`' for chapter in set_.chapters)} |"
        for letter, set_ in sets().items()
    ]
    return "\n".join(["| set | chapters |", "| --- | --- |", *rows, ""])


def variants() -> str:
    """The shipped variants without modes, with their equations, in Markdown."""
    rows = []
    for name, variant in load_variants().items():
        state, meter = (
            ", ".join(map(sp.latex, side))
            for side in (variant.model.state_equation, variant.model.meter_equation)
        )
        rows.append(f"| {name} | ${state}$ | ${meter}$ | {variant.title} |")
    return "\n".join(
        ["| variant | $x_{k+1}=$ | $y_k=$ | what it is |", "| --- | --- | --- | --- |", *rows, ""]
    )
