"""The instructor's commands: exercises, solutions, grade.  What they need is imported when they
have something to do."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from kfcourse.exercises.grading.sandbox import KINDS
from kfcourse.exercises.grading.submissions import SECONDS


def _cores() -> int:
    from joblib import cpu_count

    return int(cpu_count())


FILE = click.Path(path_type=Path)
FOLDER = click.Path(path_type=Path, file_okay=False)
MASTERS = click.option(
    "--masters", type=FILE, help="Folder of other masters, <set>/statement.md each."
)
JOBS = click.option(
    "--jobs",
    "workers",
    type=click.IntRange(min=1),
    default=_cores,
    show_default="all cores",
    help="Notebooks at once.",
)


def _options(command: Callable) -> Callable:
    """Options common to exercises and solutions."""
    options = [
        click.option(
            "--variant", "names", multiple=True, help="Name of a variant; may be repeated."
        ),
        click.option("--all", "everything", is_flag=True, help="Every variant of the file."),
        click.option(
            "--sets", "letters", help="Letters of the sets, separated by commas.  [default: all]"
        ),
        click.option(
            "--variants", "variants_file", type=FILE, help="Another TOML file of variants."
        ),
        click.option(
            "--students", type=FILE, help="CSV with name, group: a variant for each student."
        ),
        click.option("--out", required=True, type=FOLDER, help="Folder of the notebooks."),
        MASTERS,
        JOBS,
    ]
    for option in reversed(options):
        command = option(command)
    return command


@click.command()
@_options
@click.option(
    "--nbgrader",
    is_flag=True,
    help="Write source notebooks of nbgrader instead: a folder for each variant.",
)
def exercises(nbgrader: bool, **options: Any) -> None:
    """Write the students' notebooks, ready to run."""
    if nbgrader and options["students"]:
        raise click.UsageError(
            "--nbgrader hands the same notebooks to all students: name a --variant instead of "
            "--students"
        )
    _make("nbgrader" if nbgrader else "exercises", **options)


@click.command()
@_options
@click.option(
    "--pdf", "with_pdf", is_flag=True, help="Print each page to PDF too (needs Chromium or Chrome)."
)
def solutions(**options: Any) -> None:
    """Write the worked solutions: executed notebooks and HTML pages."""
    _make("solutions", **options)


def _make(kind: str, **options: Any) -> None:
    if not (options["names"] or options["everything"] or options["students"]):
        raise click.UsageError(
            "name the variants: --variant 53, or --all, or a course list with --students"
        )
    from kfcourse.exercises.notebooks.handing_out import hand_out

    if not hand_out(kind, **options):
        sys.exit(1)


@click.command()
@click.argument("folder", type=click.Path(exists=True, path_type=Path, file_okay=False))
@click.option(
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    help="File of the table.  [default: FOLDER-grades.csv]",
)
@click.option(
    "--variants", "variants_file", type=FILE, help="The file of variants that you handed out."
)
@MASTERS
@JOBS
@click.option(
    "--seconds",
    type=click.FloatRange(min=1),
    default=SECONDS,
    show_default=True,
    help="Time limit of a cell, and of an answer's call (18 s at most); a notebook may take five "
    "times as long.",
)
@click.option(
    "--again", is_flag=True, help="Grade those too that have not changed since the last table."
)
@click.option(
    "--sandbox",
    "kind",
    type=click.Choice(KINDS),
    default=KINDS[0],
    show_default=True,
    help="Where the notebooks run: in bubblewrap's sandbox (you are asked if there is none), or "
    "with all your rights.",
)
@click.option(
    "--students",
    type=FILE,
    help="The assignment that `exercises --students` wrote, or the course list: by its variants "
    "notebooks are marked.",
)
@click.option(
    "--report",
    type=FOLDER,
    help="Folder of points, feedback for each student and an overview.  [default with --students: "
    "FOLDER-report]",
)
@click.option(
    "--parts",
    type=click.FloatRange(0, 1),
    default=0.5,
    show_default=True,
    help="Share of the points for the right results of a wrong answer: with 1, one right result "
    "of three is worth a third.",
)
@click.option(
    "--follow-on",
    type=click.FloatRange(0, 1),
    default=0.0,
    show_default=True,
    help="Share of the points for a step that is right on top of the student's own wrong answer "
    "to an earlier question.",
)
@click.option(
    "--seed", help="Text that the hidden arguments come from.  [default: another each time]"
)
def grade(**options: Any) -> None:
    """Run the returned notebooks in FOLDER and write a table of what passed.

    The notebook of each set is made again from the master, for the variant that the list gives the
    student, and the student's cells are put into it; checks and variants that a student changed do
    not count.  Each notebook runs in a process and an empty folder of its own, with limits of time
    and memory (4 GB, where the system can limit it).  That process has no answers: it is asked for
    values, and another one compares them.  With --sandbox none it has all your rights.

    Lines that reach for more than an exercise needs are noted: look at them.  Links are not
    followed; they, archives, hidden notebooks and notebooks by another name are named.

    Marks: a tick is passed, a cross is wrong or not usable, a dash is not implemented or not run, a
    question mark could not
    be graded.  Unchanged notebooks are not run again.  Exit status: 0 if every exercise notebook
    could be graded, however badly; 1 if some could not.
    """
    from kfcourse.exercises.grading.course import grade_folder

    if not grade_folder(**options):
        sys.exit(1)
