"""Making a course's notebooks: which ones are wanted, and a line on the screen when a folder is
done."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import click
from tqdm import tqdm

from kfcourse.exercises.checks import sets
from kfcourse.exercises.notebooks.course_list import assign, save_assignment
from kfcourse.exercises.notebooks.jobs import Job, Outcome, make, run_all
from kfcourse.exercises.notebooks.texts import clean, safe
from kfcourse.lab.variants import (
    VariantError,
    find_variant,
    load_variants,
    read_variants,
    usable_variants,
)
from kfcourse.symbolic.jumping import JumpModel

ASSIGNMENT = "assignment.csv"


def hand_out(
    kind: str,
    names: Sequence[str],
    everything: bool,
    letters: str | None,
    variants_file: Path | None,
    students: Path | None,
    out: Path,
    masters: Path | None,
    workers: int,
    with_pdf: bool = False,
) -> bool:
    """Write the notebooks that `kfcourse exercises` or `solutions` is asked for; whether all could
    be made."""
    wanted = _letters(letters)
    faults: dict[str, VariantError] = {}
    if everything:
        variants, faults = usable_variants(variants_file)
    elif names:
        variants = {name: find_variant(name, variants_file) for name in names}
    else:
        variants = load_variants(variants_file)
    for variant in variants.values():
        variant.plain("the exercises")  # told once, not for each set
    if variants_file and (everything or not names):
        _say_left_out(variants_file, bool(variants))
    places = [(name, out / safe(name), "") for name in variants]
    if students:
        given = assign(students, [*variants])
        places = [
            (student.variant, out / student.folder, f"{student.name}, {student.group}")
            for student in given
        ]
        click.echo("group       variant   name")
        for student in given:
            click.echo(f"{student.group:<11} {clean(student.variant):<9} {student.name}")
        if kind == "exercises":
            table = out / ASSIGNMENT
            out.mkdir(parents=True, exist_ok=True)
            save_assignment((student._replace(sets=" ".join(wanted)) for student in given), table)
            click.echo(f"\nWho has which variant: {table}, for `kfcourse grade --students`")
    work = [
        Job(letter, variant, folder, kind, variants_file, masters, with_pdf, whom)
        for variant, folder, whom in places
        for letter in wanted
    ]
    _separate(work)
    out.mkdir(parents=True, exist_ok=True)
    failed = _show(run_all(work, make, workers, kind), work)
    for outcome in sorted(failed, key=lambda outcome: outcome.job.name):
        click.echo(f"FAILED {clean(outcome.job.name)}: {clean(outcome.message, 2000)}", err=True)
    for fault in faults.values():
        click.echo(f"FAILED {clean(str(fault), 2000)}", err=True)
    return not (failed or faults)


def _say_left_out(variants_file: Path, others: bool) -> None:
    """Name the file's variants with modes, which nobody gets; ValueError if there are no others."""
    jumping = [
        name
        for name, variant in read_variants(variants_file)[0].items()
        if isinstance(variant.model, JumpModel)
    ]
    reason = (
        f"jump between modes, for which the exercises are not made: "
        f"{clean(', '.join(jumping), 500)}"
    )
    if not others:
        raise ValueError(f"{variants_file} has no other variants than those that {reason}")
    if jumping:
        click.echo(f"Left out, since they {reason}\n")


def _letters(given: str | None) -> list[str]:
    letters = (
        list(sets())
        if given is None
        else [letter.strip() for letter in given.split(",") if letter.strip()]
    )
    unknown = [letter for letter in letters if letter not in sets()]
    if unknown or not letters:
        raise click.UsageError(
            f"no exercise set {', '.join(unknown) or given}; there are {', '.join(sets())}"
        )
    return letters


def _separate(work: Sequence[Job]) -> None:
    """ValueError if two jobs would write the same file; some file systems take large and small
    letters for the same."""
    seen: dict[str, Job] = {}
    for job in work:
        other = seen.setdefault(str(job.target).casefold(), job)
        if other is not job:
            raise ValueError(
                f"two notebooks would be {job.target}: of {other.name} and of {job.name}; change "
                f"one of the names"
            )


def _show(outcomes: Iterable[Outcome], work: Sequence[Job]) -> list[Outcome]:
    """Print a line for each folder as soon as it is done; what failed."""
    left = Counter(job.folder for job in work)
    count = {folder: Counter[str]() for folder in left}
    failed = []
    click.echo(f"\n{'folder':<28} written  up to date  failed")
    for outcome in outcomes:
        folder = outcome.job.folder
        left[folder] -= 1
        count[folder][outcome.status] += 1
        failed += [outcome] * (outcome.status == "failed")
        if not left[folder]:
            written, old, wrong = (
                count[folder][status] for status in ("written", "up to date", "failed")
            )
            with tqdm.external_write_mode():  # the progress bar stands aside
                click.echo(f"{folder!s:<28} {written:>7} {old:>11} {wrong:>7}")
    return failed
