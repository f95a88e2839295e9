"""Grading what a course returned: from the folder to the table, the report and what stands on the
screen."""

from __future__ import annotations

import secrets
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import click

from kfcourse.exercises.grading import pool, sandbox
from kfcourse.exercises.grading.marking import Setting
from kfcourse.exercises.grading.owners import same_code
from kfcourse.exercises.grading.report import write_report
from kfcourse.exercises.grading.results import (
    FAILED,
    PARTLY,
    SIGNS,
    Grade,
    line,
    read_lines,
    write_table,
)
from kfcourse.exercises.grading.sandbox import PROTECTION
from kfcourse.exercises.grading.submissions import returned
from kfcourse.exercises.grading.weights import Credit
from kfcourse.exercises.notebooks.course_list import Student, read_assignment
from kfcourse.exercises.notebooks.texts import clean
from kfcourse.files import save
from kfcourse.lab.variants import load_variants


def grade_folder(
    folder: Path,
    out: Path | None,
    variants_file: Path | None,
    masters: Path | None,
    workers: int,
    seconds: float,
    again: bool,
    kind: str,
    students: Path | None,
    report: Path | None,
    seed: str | None,
    parts: float,
    follow_on: float,
) -> bool:
    """Grade the notebooks of a folder as `kfcourse grade` is asked to; whether all could be
    graded."""
    course = None if students is None else _course(students, variants_file)
    folder = folder.resolve()
    work = returned(folder, seconds, variants_file, masters, course or ())
    if not work:
        raise ValueError(f"no notebooks (*.ipynb) in {folder}")
    table = out or folder.with_name(f"{folder.name}-grades.csv")
    pages = report or folder.with_name(f"{folder.name}-report")
    if table.suffix == ".jsonl":
        raise ValueError(
            f"--out {table}: the grades themselves are written there; end the table's name in .csv"
        )
    for path in (table, pages):
        if path.resolve().is_relative_to(folder):
            raise ValueError(
                f"{path} is inside of what was returned: a student may have put it there; name "
                f"another place"
            )
    salt, protection = seed or secrets.token_hex(8), "nothing was run"
    lines = table.with_suffix(".jsonl")
    known = {} if again else read_lines(lines)
    grades = [
        replace(known[notebook.digest], name=notebook.name)
        for notebook in work
        if notebook.digest in known
    ]
    new = [notebook for notebook in work if notebook.digest not in known]
    save("".join(map(line, grades)), lines)
    try:
        if new:
            with (
                pool.place(folder, masters, kind) as box,
                lines.open("a", encoding="utf-8") as file,
            ):
                problem = "" if kind == "none" else sandbox.problem(box)
                if problem or kind == "none":
                    _warn(problem)
                    box = replace(box, kind="none")
                protection = PROTECTION[box.kind]
                for grade in pool.graded(new, Setting(box, salt), workers):
                    # at once: an interrupted run goes on where it was
                    file.write(line(grade))
                    file.flush()
                    grades.append(grade)
    finally:
        waiting = {notebook.name for notebook in work} - {grade.name for grade in grades}
        ended = ("the run ended before it was graded",)
        write_table([*grades, *(Grade(name, FAILED, notes=ended) for name in waiting)], table)
    grades.sort(key=lambda grade: grade.name)
    _show(grades)
    old = len(work) - len(new)
    click.echo(f"\n{len(new)} run, {old} unchanged since the last table. Table: {table}")
    click.echo(f"Sandbox: {protection}\nHidden arguments: --seed {salt} repeats them")
    if students or report:
        persons = write_report(grades, course, pages, protection, Credit(parts, follow_on))
        click.echo(f"\nReport of {len(persons)} students: {pages / 'overview.html'}")
        for person in persons:
            if person.flags:
                click.echo(
                    f"look at {clean(person.student.name)}: {clean('; '.join(person.flags), 200)}"
                )
        for letter, names in same_code(persons):
            click.echo(f"set {letter}: the same code came from {clean(', '.join(names))}")
    return all(grade.status not in (FAILED, PARTLY) for grade in grades)


def _warn(problem: str) -> None:
    """Say loudly what a run without a sandbox risks, and ask whether to go on if nobody said so;
    ValueError if nobody does."""
    click.secho(
        f"{problem}{'. ' * bool(problem)}The protection would be {PROTECTION['none']}.",
        fg="red",
        bold=True,
        err=True,
    )
    if problem and not (sys.stdin.isatty() and click.confirm("Run them all the same?", err=True)):
        raise ValueError("no notebook was run; --sandbox none runs them without protection")


def _course(path: Path, variants_file: Path | None) -> list[Student]:
    """The students, each with a variant that there is."""
    known = [*load_variants(variants_file)]
    course = read_assignment(path, known)
    for student in course:
        if student.variant not in known:
            raise ValueError(
                f"{path} gives {student.name} the variant {student.variant}, which is not known; "
                f"name the file that you handed out with --variants; known are {', '.join(known)}"
            )
    return course


def _show(grades: Sequence[Grade]) -> None:
    """The table on the screen; notes are cut."""
    names = {grade.name: clean(grade.name, len(grade.name)) for grade in grades}
    width = max(map(len, names.values()))
    signs = _signs()
    click.echo(f"{'notebook':<{width}}  set  variant  passed  checks")
    for grade in grades:
        name = f"{names[grade.name]:<{width}}"
        if not grade.marks:
            click.echo(f"{name}  {grade.status}{': ' * bool(grade.note)}{clean(grade.note, 100)}")
            continue
        marks = "".join(signs[mark] for mark in grade.marks.values())
        count = f"{grade.passed} of {len(grade.marks)}"
        rest = f"{clean(grade.variant):<7}  {count:<6}  {marks:<7} {clean(grade.note, 100)}"
        click.echo(f"{name}  {grade.letter:<3}  {rest}")


def _signs() -> dict[str, str]:
    """Signs of the marks that this screen can show."""
    try:
        "".join(SIGNS.values()).encode(sys.stdout.encoding or "ascii")
    except UnicodeEncodeError:
        return dict(zip(SIGNS, "+xx--?", strict=True))
    return SIGNS
