"""The instructor's commands: exercises, solutions."""

from __future__ import annotations

import functools
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

from kfcourse.checks import SETS
from kfcourse.notebooks.course import Job, Outcome, assign, chosen_variants, jobs, make, run_all, safe
from kfcourse.notebooks.master import MASTERS


def _options(command: Callable) -> Callable:
    """Options common to exercises and solutions."""
    options = [
        click.option("--variant", "names", multiple=True, help="Name of a variant; may be repeated."),
        click.option("--all", "everything", is_flag=True, help="Every variant of the file."),
        click.option("--sets", "letters", help=f"Letters of the sets, separated by commas.  [default: {','.join(SETS)}]"),
        click.option("--variants", "variants_file", type=click.Path(path_type=Path), help="Another TOML file of variants."),
        click.option("--students", type=click.Path(path_type=Path), help="CSV with name, group: a variant for each student."),
        click.option("--out", required=True, type=click.Path(path_type=Path, file_okay=False), help="Folder of the notebooks."),
        click.option("--masters", type=click.Path(path_type=Path), default=MASTERS, help="Folder of the masters."),
        click.option("--jobs", "workers", type=click.IntRange(min=1), default=2, show_default=True, help="Notebooks at once."),
        click.option("--dask", help="Address of a Dask scheduler that does the work instead."),
    ]
    return functools.reduce(lambda decorated, option: option(decorated), reversed(options), command)


@click.command()
@_options
def exercises(**options: Any) -> None:
    """Write the students' notebooks, ready to run."""
    _make("exercises", **options)


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
    masters: Path,
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
        work = jobs(kind, out, variants, wanted, variants_file, masters, with_pdf)
    out.mkdir(parents=True, exist_ok=True)
    outcomes = list(run_all(work, make, workers, kind, dask))
    _table(outcomes, work)
    if any(outcome.status == "failed" for outcome in outcomes):
        sys.exit(1)


def _letters(given: str | None) -> list[str]:
    letters = list(SETS) if given is None else [letter.strip() for letter in given.split(",") if letter.strip()]
    unknown = [letter for letter in letters if letter not in SETS]
    if unknown or not letters:
        raise click.UsageError(f"no exercise set {', '.join(unknown) or given}; there are {', '.join(SETS)}")
    return letters


def _for_students(
    kind: str,
    students: Path,
    variants: Sequence[str],
    letters: Sequence[str],
    out: Path,
    variants_file: Path | None,
    masters: Path,
    with_pdf: bool,
) -> list[Job]:
    """A folder for each student, out/group/name, with their variant's notebooks; the assignment is printed."""
    work = []
    given = assign(students, variants)
    click.echo("group       variant   name")
    for one in given:
        click.echo(f"{one.group:<11} {one.variant:<9} {one.name}")
        folder = out / safe(one.group) / safe(one.name)
        work += [Job(letter, one.variant, folder, kind, variants_file, masters, with_pdf) for letter in letters]
    return work


def _table(outcomes: Sequence[Outcome], work: Sequence[Job]) -> None:
    """What was written, folder by folder, and what failed."""
    found = {(o.job.folder, o.job.letter): o for o in outcomes}
    click.echo(f"\n{'folder':<28} written  up to date  failed")
    for folder in dict.fromkeys(job.folder for job in work):
        count = Counter(found[job.folder, job.letter].status for job in work if job.folder == folder)
        click.echo(f"{folder!s:<28} {count['written']:>7} {count['up to date']:>11} {count['failed']:>7}")
    for outcome in sorted((o for o in outcomes if o.status == "failed"), key=lambda o: o.job.name):
        click.echo(f"FAILED {outcome.job.name}: {outcome.message}", err=True)
