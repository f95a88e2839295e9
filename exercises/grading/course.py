"""Grading what a course returned: from the folder to the table, the report and what stands on the
screen."""

from __future__ import annotations

import secrets
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import click

from kfcourse.exercises.grading import pool, sandbox
from kfcourse.exercises.grading.marking import Setting
from kfcourse.exercises.grading.owners import owner, same_code
from kfcourse.exercises.grading.report import write_report
from kfcourse.exercises.grading.results import (
    FAILED,
    PARTLY,
    SIGNS,
    Grade,
    line,
    read_lines,
    write_lines,
    write_table,
)
from kfcourse.exercises.grading.sandbox import PROTECTION
from kfcourse.exercises.grading.submissions import Returned, Unreadable, read_document, returned
from kfcourse.exercises.grading.weights import Credit
from kfcourse.exercises.notebooks.course_list import Student, read_assignment
from kfcourse.exercises.notebooks.texts import clean
from kfcourse.lab.variants import chosen_variants


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
    folder, masters = folder.resolve(), masters and masters.resolve()
    work = returned(folder, seconds, variants_file, masters, _given(course))
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
    salt, protection = seed or secrets.token_hex(8), ["nothing was run"]

    def run(new: Sequence[Returned]) -> Iterator[Grade]:
        with pool.place(folder, masters, kind) as box:
            problem = "" if kind == "none" else sandbox.problem(box)
            if problem or kind == "none":
                _warn(problem)
                box = replace(box, kind="none")
            protection[:] = [PROTECTION[box.kind]]
            yield from pool.graded(new, Setting(box, salt), workers)

    grades, old = grade_all(work, table, again, run)
    _show(grades)
    click.echo(f"\n{len(grades) - old} run, {old} unchanged since the last table. Table: {table}")
    click.echo(f"Sandbox: {protection[0]}\nHidden arguments: --seed {salt} repeats them")
    if students or report:
        persons = write_report(grades, course, pages, protection[0], Credit(parts, follow_on))
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
    known = [variant.name for variant in chosen_variants([], variants_file)]
    course = read_assignment(path, known)
    for student in course:
        if student.variant not in known:
            hint = (
                f"there are {', '.join(known)}"
                if variants_file
                else "name the file that you handed out with --variants"
            )
            raise ValueError(
                f"{path} gives {student.name} the variant {student.variant}, which is not known; "
                f"{hint}"
            )
    return course


def _given(course: Sequence[Student] | None) -> Callable[[str, Path], str]:
    """The variant that was given to the student of a notebook; nothing without a list, or if the
    student is not in it."""

    def given(name: str, path: Path) -> str:
        whose = owner(Grade(name, ""), course or ())
        if whose is None and course:
            with suppress(Unreadable):  # told when it is graded
                claim = read_document(path).get("metadata", {}).get("kfcourse")
                if isinstance(claim, dict):
                    whose = owner(Grade(name, "", student=str(claim.get("student"))), course)
        return whose.variant if whose else ""

    return given


def grade_all(
    work: Sequence[Returned],
    table: Path,
    again: bool,
    run: Callable[[Sequence[Returned]], Iterator[Grade]],
) -> tuple[list[Grade], int]:
    """Grade what is new, and write each grade when it comes: an interrupted run goes on where it
    was.

    Beside the table, with the ending `.jsonl`, stand the grades; the table is made from them,
    however the run ends.

    Returns
    -------
    grades, old : list of Grade, int
        By name; how many an earlier run had graded.
    """
    lines = table.with_suffix(".jsonl")
    known = {} if again else read_lines(lines)
    grades = [
        replace(known[work_.digest], name=work_.name) for work_ in work if work_.digest in known
    ]
    old, new = len(grades), [work_ for work_ in work if work_.digest not in known]
    write_lines(grades, lines)
    waiting = {
        work_.name: Grade(work_.name, FAILED, notes=("the run ended before it was graded",))
        for work_ in new
    }
    try:
        with lines.open("a", encoding="utf-8") as file:
            for grade in run(new) if new else ():
                file.write(line(grade))
                file.flush()
                grades.append(grade)
                waiting.pop(grade.name)
    finally:
        write_table([*grades, *waiting.values()], table)
    return sorted(grades, key=lambda grade: grade.name), old


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
