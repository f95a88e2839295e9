"""The instructor's commands: exercises, solutions, grade."""

from __future__ import annotations

import functools
import secrets
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import click

from kfcourse.checks import sets
from kfcourse.lab.variants import chosen_variants
from kfcourse.notebooks.course_list import assign, read_assignment, save_assignment
from kfcourse.notebooks.grading.marking import Setting
from kfcourse.notebooks.grading.owners import Person
from kfcourse.notebooks.grading.pool import grading
from kfcourse.notebooks.grading.report import write_report
from kfcourse.notebooks.grading.running import Place, packages_of
from kfcourse.notebooks.grading.sandbox import HELD, KINDS, chosen
from kfcourse.notebooks.grading.staging import answers, stage
from kfcourse.notebooks.grading.submissions import SECONDS, clean, returned
from kfcourse.notebooks.grading.table import FAILED, GRADED, SIGNS, Grade, grade_all
from kfcourse.notebooks.jobs import Job, Outcome, make, plan, run_all

ASSIGNMENT = "assignment.csv"


def _options(command: Callable) -> Callable:
    """Options common to exercises and solutions."""
    options = [
        click.option("--variant", "names", multiple=True, help="Name of a variant; may be repeated."),
        click.option("--all", "everything", is_flag=True, help="Every variant of the file."),
        click.option("--sets", "letters", help="Letters of the sets, separated by commas.  [default: all]"),
        click.option("--variants", "variants_file", type=click.Path(path_type=Path), help="Another TOML file of variants."),
        click.option("--students", type=click.Path(path_type=Path), help="CSV with name, group: a variant for each student."),
        click.option("--out", required=True, type=click.Path(path_type=Path, file_okay=False), help="Folder of the notebooks."),
        click.option("--masters", type=click.Path(path_type=Path), help="Folder of other masters, <set>/statement.md each."),
        click.option("--jobs", "workers", type=click.IntRange(min=1), default=2, show_default=True, help="Notebooks at once."),
        click.option("--dask", help="Address of a Dask scheduler that does the work instead."),
    ]
    return functools.reduce(lambda decorated, option: option(decorated), reversed(options), command)


@click.command()
@_options
@click.option("--nbgrader", is_flag=True, help="Write source notebooks of nbgrader instead: a folder for each variant.")
def exercises(nbgrader: bool, **options: Any) -> None:
    """Write the students' notebooks, ready to run."""
    if nbgrader and options["students"]:
        raise click.UsageError("--nbgrader hands the same notebooks to all students: name a --variant instead of --students")
    _make("nbgrader" if nbgrader else "exercises", **options)


@click.command()
@_options
@click.option("--pdf", "with_pdf", is_flag=True, help="Print each page to PDF too (needs Chromium or Chrome).")
def solutions(**options: Any) -> None:
    """Write the worked solutions: executed notebooks and HTML pages."""
    _make("solutions", **options)


def _make(
    kind: str,
    names: Sequence[str],
    everything: bool,
    letters: str | None,
    variants_file: Path | None,
    students: Path | None,
    out: Path,
    masters: Path | None,
    workers: int,
    dask: str | None,
    with_pdf: bool = False,
) -> None:
    wanted = _letters(letters)
    if not (names or everything or students):
        raise click.UsageError("name the variants: --variant 53, or --all, or a course list with --students")
    variants = [v.name for v in chosen_variants(names, everything or bool(students and not names), variants_file)]
    if students:
        work = _for_students(kind, students, variants, wanted, out, variants_file, masters, with_pdf)
    else:
        work = plan(kind, out, variants, wanted, variants_file, masters, with_pdf)
    _separate(work)
    out.mkdir(parents=True, exist_ok=True)
    outcomes = list(run_all(work, make, workers, kind, dask))
    _table(outcomes, work)
    if any(outcome.status == "failed" for outcome in outcomes):
        sys.exit(1)


def _letters(given: str | None) -> list[str]:
    letters = list(sets()) if given is None else [letter.strip() for letter in given.split(",") if letter.strip()]
    unknown = [letter for letter in letters if letter not in sets()]
    if unknown or not letters:
        raise click.UsageError(f"no exercise set {', '.join(unknown) or given}; there are {', '.join(sets())}")
    return letters


def _for_students(
    kind: str,
    students: Path,
    variants: Sequence[str],
    letters: Sequence[str],
    out: Path,
    variants_file: Path | None,
    masters: Path | None,
    with_pdf: bool,
) -> list[Job]:
    """A folder for each student, out/group/name, with their variant's notebooks; the assignment is printed."""
    work = []
    given = assign(students, variants)
    click.echo("group       variant   name")
    for one in given:
        click.echo(f"{one.group:<11} {one.variant:<9} {one.name}")
        work += [
            Job(letter, one.variant, out / one.folder, kind, variants_file, masters, with_pdf, f"{one.name}, {one.group}")
            for letter in letters
        ]
    if kind == "exercises":
        out.mkdir(parents=True, exist_ok=True)
        save_assignment([replace(one, sets=" ".join(letters)) for one in given], out / ASSIGNMENT)
        click.echo(f"\nWho has which variant: {out / ASSIGNMENT}, for `kfcourse grade --students`")
    return work


def _separate(work: Sequence[Job]) -> None:
    """ValueError if two jobs would write the same file; some file systems take large and small letters for the same."""
    seen: dict[str, Job] = {}
    for job in work:
        other = seen.setdefault(str(job.target).casefold(), job)
        if other is not job:
            raise ValueError(f"two notebooks would be {job.target}: of {other.name} and of {job.name}; change one of the names")


def _shown(folder: Path) -> str:
    """A folder as a user would name it: relative to where the command runs, if it is there."""
    return str(folder.relative_to(Path.cwd()) if folder.is_relative_to(Path.cwd()) else folder)


def _table(outcomes: Sequence[Outcome], work: Sequence[Job]) -> None:
    """What was written, folder by folder, and what failed."""
    found = {(o.job.folder, o.job.letter): o for o in outcomes}
    click.echo(f"\n{'folder':<28} written  up to date  failed")
    for folder in dict.fromkeys(job.folder for job in work):
        count = Counter(found[job.folder, job.letter].status for job in work if job.folder == folder)
        click.echo(f"{_shown(folder):<28} {count['written']:>7} {count['up to date']:>11} {count['failed']:>7}")
    for outcome in sorted((o for o in outcomes if o.status == "failed"), key=lambda o: o.job.name):
        click.echo(f"FAILED {outcome.job.name}: {outcome.message}", err=True)


@click.command()
@click.argument("folder", type=click.Path(exists=True, path_type=Path, file_okay=False))
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="File of the table.  [default: FOLDER/grades.csv]")
@click.option("--variants", "variants_file", type=click.Path(path_type=Path), help="The file of variants that you handed out.")
@click.option("--masters", type=click.Path(path_type=Path), help="Folder of other masters, <set>/statement.md each.")
@click.option("--jobs", "workers", type=click.IntRange(min=1), default=2, show_default=True, help="Notebooks at once.")
@click.option(
    "--seconds",
    type=click.FloatRange(min=1),
    default=SECONDS,
    show_default=True,
    help="Time limit of a cell; a notebook may take five times as long.",
)
@click.option("--again", is_flag=True, help="Grade those too that have not changed since the last table.")
@click.option("--sandbox", type=click.Choice(KINDS), default="auto", show_default=True, help="Where the notebooks run.")
@click.option(
    "--students",
    type=click.Path(path_type=Path),
    help="The assignment that `exercises --students` wrote, or the course list: says who has which variant.",
)
@click.option(
    "--report",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder of points, feedback for each student and an overview.  [default with --students: FOLDER/report]",
)
@click.option("--seed", help="Text that the hidden arguments come from.  [default: another each time]")
def grade(
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
) -> None:
    """Run the returned notebooks in FOLDER and write a table of what passed.

    The notebook of each set and variant is made again from the master, and the student's cells are put into it: checks that a
    student changed or deleted do not count.  Each notebook runs in a process and an empty folder of its own, with limits of time
    and memory (4 GB, where the system can limit it).  That process has no answers: it is asked for values, and another one
    compares them.  With --sandbox none it runs with your rights.

    What reaches for more than an exercise needs is noted: look at it.

    Marks: a tick is passed, a cross is wrong or not usable, a dash is not implemented or not run.  Unchanged notebooks are not
    run again.  Exit status: 0 if every exercise notebook could be graded, however badly; 1 if some could not.
    """
    course = (
        None if students is None else read_assignment(students, [one.name for one in chosen_variants([], True, variants_file)])
    )
    work = returned(folder, seconds, variants_file, masters)
    if not work:
        raise ValueError(f"no notebooks (*.ipynb) in {folder}")
    table = out or folder / "grades.csv"
    with tempfile.TemporaryDirectory(prefix="kfcourse-") as made:
        place = Path(made).resolve()
        (place / "stage").mkdir()
        staged = stage(place / "stage")
        hidden = [Path(str(resources.files("kfcourse"))), *answers(), folder.resolve(), *([masters] if masters else [])]
        held = chosen(sandbox, hidden, place, packages_of(staged))
        salt = seed or secrets.token_hex(8)
        with grading(Setting(Place(staged, held), salt), workers) as graded:
            grades, old = grade_all(work, table, again, graded)
    _grades(grades)
    click.echo(f"\n{len(grades) - old} run, {old} unchanged since the last table. Table: {table}")
    click.echo(f"Sandbox: {HELD[held.kind]}\nHidden arguments: --seed {salt} repeats them")
    if students or report:
        _report(write_report(grades, course, report or folder / "report", HELD[held.kind]), report or folder / "report")
    if any(one.status == FAILED for one in grades):
        sys.exit(1)


def _report(persons: Sequence[Person], folder: Path) -> None:
    """What to look at, and where the rest is."""
    flagged = [person for person in persons if person.flags]
    click.echo(f"\nReport of {len(persons)} students: {folder / 'overview.html'}")
    for person in flagged:
        click.echo(f"look at {person.student.name}: {clean('; '.join(person.flags), 200)}")


def _grades(grades: Sequence[Grade]) -> None:
    """The table on the screen; notes are cut."""
    width = max(len(one.name) for one in grades)
    signs = _signs()
    click.echo(f"{'notebook':<{width}}  set  variant  passed  checks")
    for one in grades:
        if one.status != GRADED:
            click.echo(f"{one.name:<{width}}  {one.status}{': ' * bool(one.note)}{clean(one.note, 100)}")
            continue
        marks = "".join(signs[mark] for mark in one.marks.values())
        count = f"{one.passed} of {len(one.marks)}"
        click.echo(f"{one.name:<{width}}  {one.letter:<3}  {one.variant:<7}  {count:<6}  {marks:<7} {clean(one.note, 100)}")


def _signs() -> dict[str, str]:
    """Signs of the marks that this screen can show."""
    try:
        "".join(SIGNS.values()).encode(getattr(sys.stdout, "encoding", None) or "ascii")
    except (UnicodeEncodeError, LookupError):
        return {mark: {"✓": "+", "✗": "x"}.get(sign, "-") for mark, sign in SIGNS.items()}
    return SIGNS
