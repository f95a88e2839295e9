"""Grading what a course returned: from the folder to the table, the report and what stands on the screen."""

from __future__ import annotations

import secrets
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import click

from kfcourse.lab.variants import chosen_variants
from kfcourse.notebooks.course_list import Student, read_assignment
from kfcourse.notebooks.grading.far import far_grading
from kfcourse.notebooks.grading.owners import Person, owner
from kfcourse.notebooks.grading.pool import Order, grading
from kfcourse.notebooks.grading.report import write_report
from kfcourse.notebooks.grading.sandbox import HELD
from kfcourse.notebooks.grading.submissions import Unreadable, read_document, returned
from kfcourse.notebooks.grading.table import FAILED, PARTLY, SIGNS, Grade, grade_all
from kfcourse.notebooks.grading.weights import Credit
from kfcourse.notebooks.texts import clean


def grade_folder(
    folder: Path,
    out: Path | None,
    variants_file: Path | None,
    masters: Path | None,
    workers: int,
    seconds: float,
    again: bool,
    sandbox: str,
    students: Path | None,
    report: Path | None,
    seed: str | None,
    parts: float,
    follow_on: float,
    dask: str | None,
) -> bool:
    """Grade the notebooks of a folder as `kfcourse grade` is asked to; whether all could be graded."""
    course = None if students is None else _course(students, variants_file)
    work = returned(folder, seconds, variants_file, masters, _given(course))
    if not work:
        raise ValueError(f"no notebooks (*.ipynb) in {folder}")
    table, pages = out or folder / "grades.csv", report or folder / "report"
    for place in (table, pages):
        if place.is_symlink() and place.parent == folder:
            raise ValueError(f"{place} is a link: has a student returned it? Take it away, or name another place")
    order = Order(folder.resolve(), masters and masters.resolve(), sandbox, seed or secrets.token_hex(8))
    with far_grading(order, dask) if dask else grading(order, workers) as (graded, kinds):
        grades, old, kept = grade_all(work, table, again, graded)
    _show(grades)
    held = "; ".join(HELD[kind] for kind in sorted(kinds)) or "nothing was run"
    for name, reason in sorted(kept.items()):
        click.echo(f"kept as an earlier run graded it: {clean(name)}; this one could not: {clean(reason, 200)}")
    click.echo(f"\n{len(grades) - old} run, {old} unchanged since the last table. Table: {table}")
    click.echo(f"Sandbox: {held}\nHidden arguments: --seed {order.salt} repeats them")
    if students or report:
        _show_report(write_report(grades, course, pages, held, Credit(parts, follow_on)), pages)
    return all(one.status not in (FAILED, PARTLY) for one in grades)


def _course(path: Path, variants_file: Path | None) -> list[Student]:
    """The students, each with a variant that there is."""
    known = [one.name for one in chosen_variants([], True, variants_file)]
    course = read_assignment(path, known)
    for one in course:
        if one.variant not in known:
            hint = "there are " + ", ".join(known) if variants_file else "name the file that you handed out with --variants"
            raise ValueError(f"{path} gives {one.name} the variant {one.variant}, which is not known; {hint}")
    return course


def _given(course: Sequence[Student] | None) -> Callable[[str, Path], str]:
    """The variant that was given to the student of a notebook; nothing if there is no list, or the student is not in it."""

    def given(name: str, path: Path) -> str:
        whose = owner(Grade(name, ""), course or ())
        if whose is None and course:
            with suppress(Unreadable):  # told when it is graded
                claim = read_document(path).get("metadata", {}).get("kfcourse")
                whose = owner(Grade(name, "", student=str(claim.get("student"))), course) if isinstance(claim, Mapping) else None
        return whose.variant if whose else ""

    return given


def _show_report(persons: Sequence[Person], folder: Path) -> None:
    """What to look at, and where the rest is."""
    click.echo(f"\nReport of {len(persons)} students: {folder / 'overview.html'}")
    for person in persons:
        if person.flags:
            click.echo(f"look at {clean(person.student.name)}: {clean('; '.join(person.flags), 200)}")


def _show(grades: Sequence[Grade]) -> None:
    """The table on the screen; notes are cut."""
    names = {one.name: clean(one.name, len(one.name)) for one in grades}
    width = max(map(len, names.values()))
    signs = _signs()
    click.echo(f"{'notebook':<{width}}  set  variant  passed  checks")
    for one in grades:
        if not one.marks:
            click.echo(f"{names[one.name]:<{width}}  {one.status}{': ' * bool(one.note)}{clean(one.note, 100)}")
            continue
        marks = "".join(signs[mark] for mark in one.marks.values())
        count = f"{one.passed} of {len(one.marks)}"
        said = f"{clean(one.variant):<7}  {count:<6}  {marks:<7} {clean(one.note, 100)}"
        click.echo(f"{names[one.name]:<{width}}  {one.letter:<3}  {said}")


def _signs() -> dict[str, str]:
    """Signs of the marks that this screen can show."""
    try:
        "".join(SIGNS.values()).encode(getattr(sys.stdout, "encoding", None) or "ascii")
    except (UnicodeEncodeError, LookupError):
        return {mark: {"✓": "+", "✗": "x", "–": "-"}.get(sign, sign) for mark, sign in SIGNS.items()}
    return SIGNS
