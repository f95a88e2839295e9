"""The command line: `kfcourse lab 53`, `kfcourse variants`, `kfcourse estimate`, ...

The instructor's commands are in `kfcourse.exercises.commands`.
"""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

import click
from joblib import cpu_count

from kfcourse.errors import NotFinite
from kfcourse.exercises.checks.posing import unposed
from kfcourse.exercises.derivations import check_text
from kfcourse.exercises.derivations.setting import of_model
from kfcourse.files import read_text, save
from kfcourse.lab import admission, grammar, quality
from kfcourse.lab.own_data import STRUCTURES, estimate_record, model_of, write_record
from kfcourse.lab.report import (
    LANGUAGES,
    conclusions,
    recognised_modes,
    remarks_in_words,
    write_json,
    write_report,
)
from kfcourse.lab.report_sections import score_cells
from kfcourse.lab.short_names import (
    FILTERS,
    JUMP_FILTERS,
    JUMP_LAB,
    LAB,
    check_names,
    has_exact,
    judging,
    title,
)
from kfcourse.lab.variants import RUNS as CHECKED
from kfcourse.lab.variants import STEPS, TRAJECTORIES, find_variant, read_variants, summary
from kfcourse.montecarlo import FEWEST
from kfcourse.montecarlo.comparison import EXACT, Comparison
from kfcourse.montecarlo.experiment import compare
from kfcourse.symbolic.model import Model

# seconds for the formulas of the filters: a busy machine must not leave out what a quiet one has
DERIVATION = 180.0
INSTRUCTORS = ("exercises", "grade", "solutions")


PATH = click.Path(path_type=Path)
VARIANTS = click.option(
    "--variants", "variants_file", type=PATH, help="Another TOML file of variants."
)
SEED = click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=1,
    show_default=True,
    help="The same seed gives the same numbers.",
)
JOBS = click.option(
    "--jobs",
    type=click.IntRange(min=1),
    default=cpu_count,
    show_default="all",
    help="Processor cores to use; does not change the numbers.",
)


@contextmanager
def _clear_errors() -> Iterator[None]:
    """What went wrong is said in a sentence, not in a traceback."""
    try:
        with warnings.catch_warnings():
            # NumPy's: what became infinite is reported by name
            warnings.simplefilter("ignore", RuntimeWarning)
            warnings.showwarning = lambda message, *_: click.echo(f"Warning: {message}", err=True)
            yield
    except BrokenPipeError:
        raise
    except OSError as error:
        where = f": {error.filename}" if error.filename else ""
        raise click.ClickException(f"{error.strerror or error}{where}") from None
    except (ValueError, NotFinite) as error:
        raise click.ClickException(str(error)) from None
    except MemoryError:
        raise click.ClickException(
            "this needs more memory than there is; take fewer --runs, --steps or --jobs"
        ) from None
    except KeyboardInterrupt:
        click.echo("Interrupted; files written before are as they were.", err=True)
        sys.exit(130)


class _Group(click.Group):
    """Commands that say in a sentence what a user did wrong; the instructor's are imported when
    they are asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted([*self.commands, *INSTRUCTORS])

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name in INSTRUCTORS:
            return getattr(import_module("kfcourse.exercises.commands"), name)
        return self.commands.get(name)

    def invoke(self, ctx: click.Context) -> object:
        with _clear_errors():
            try:
                return super().invoke(ctx)
            except click.UsageError as error:
                if "unexpected extra argument" not in error.message:
                    raise
                hint = (
                    "separate names by commas (--sets a,b), and repeat --variant for each variant"
                )
                raise click.UsageError(f"{error.message}: {hint}", error.ctx) from None


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="kfcourse")
def main() -> None:
    """Kalman and nonlinear suboptimal filtering: the lab from the command line."""


@main.command()
@click.argument("variant")
@VARIANTS
@click.option(
    "--runs",
    type=click.IntRange(min=2),
    help=f"Trajectories, the same for all filters.  [default: {TRAJECTORIES}, or what the variant "
    "says]",
)
@click.option(
    "--steps",
    type=click.IntRange(min=1),
    help=f"Measurements of each trajectory.  [default: {STEPS}, or what the variant says]",
)
@SEED
@click.option(
    "--filters",
    "names",
    help=f"Short names, separated by commas. Known: {', '.join(FILTERS)}; for variants with "
    f"modes: {', '.join(JUMP_FILTERS)}.  "
    "[default: the lab's seven and the exact AOF; for variants with modes all but those that "
    "remember several steps]",
)
@click.option(
    "--bound",
    is_flag=True,
    help="Bound vector models, too: the exact AOF by particles, which takes minutes for some "
    "thousand trajectories.",
)
@JOBS
@click.option("--dask", help="Address of a Dask scheduler whose workers run the filters instead.")
@click.option("--out", type=PATH, help="Folder of the report.  [default: lab-VARIANT]")
@click.option(
    "--report",
    "language",
    type=click.Choice(LANGUAGES),
    default="en",
    show_default=True,
    help="Language of the report.",
)
@click.option(
    "--scores",
    is_flag=True,
    help="Also judge each filter's prediction of the measurement, doubt and all: log score, CRPS.",
)
@click.option(
    "--json",
    "json_file",
    type=PATH,
    help="Also write the numbers to this file.",
)
def lab(
    variant: str,
    variants_file: Path | None,
    runs: int | None,
    steps: int | None,
    seed: int,
    names: str | None,
    bound: bool,
    jobs: int,
    dask: str | None,
    out: Path | None,
    language: str,
    scores: bool,
    json_file: Path | None,
) -> None:
    """Compare the filters on VARIANT (such as 53) and write the report.

    The same seed gives the same numbers, bit by bit on one machine; another one's linear algebra
    (BLAS) may round otherwise, by 1e-13 or so.
    """
    chosen = find_variant(variant, variants_file)
    folder, model = out or _below(f"lab-{chosen.name}"), chosen.model
    _check_places(folder, json_file)  # before the long part
    entries, usual = (FILTERS, LAB) if isinstance(model, Model) else (JUMP_FILTERS, JUMP_LAB)
    bound = names is None and (bound or has_exact(model))
    wanted = [*usual, *[EXACT] * bound] if names is None else _names(names)
    if names is None and not bound:
        click.echo(
            "No bound: point masses do not reach this model; --bound runs particles beside the "
            "others",
            err=True,
        )
    check_names(wanted, entries)
    known = {answer.name: answer for answer in admission.admissions(model, seconds=DERIVATION)}
    answers = [known[name] for name in dict.fromkeys(wanted)]
    refused = {answer.name: answer.reason for answer in answers if answer.built is None}
    notes: dict[tuple[str, str], list[str]] = {}
    for answer in answers:
        for note in answer.notes:
            heading = "Warning: " if answer.poor else ""
            notes.setdefault((heading, note), []).append(title(answer.name))
    for (heading, note), titles in notes.items():
        click.echo(f"{heading}{', '.join(titles)}: {note}", err=True)
    filters = [answer.built for answer in answers if answer.built]
    if not filters:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in refused.items())
        raise click.ClickException(reasons or "give at least one filter: --filters duof")
    click.echo(f"Variant {chosen.name}: {chosen.title or model}", err=True)
    result = compare(
        filters, model, runs or chosen.runs, steps or chosen.steps, seed, jobs=jobs,
        dask=dask, scores=judging(model) if scores else None,
    )  # fmt: skip
    result = replace(result, left_out={**refused, **result.left_out})
    for name, reason in result.left_out.items():
        click.echo(f"{title(name)} left out: {reason}", err=True)
    click.echo(_ranking(result))
    if json_file:
        write_json(chosen, result, json_file)
    with _writing(folder):
        modes = recognised_modes(result, filters)
        write_report(chosen, result, folder, language, [*known.values()], modes)
    click.echo(
        f"Report: {folder / 'report.html'}" + (f"; numbers: {json_file}" if json_file else "")
    )


def _ranking(result: Comparison) -> str:
    """The ranking, remarks and conclusions."""
    lines = [
        f"D_k above that of {title(result.reference)}, %, mean over the steps ± standard error:"
    ]
    for name, gap in result.ranking():
        size = f"{100 * float(gap.value):8.3f} ± {100 * float(gap.standard_error):.3f}"
        lines.append(f"{title(name):<18} {'diverges' if name in result.lost else size}")
    if result.scored:
        lines.append("Predictions of the measurement, mean over the steps and 95 % interval:")
        rows = [["", "log score", f"below {title(result.reference)}", "CRPS"]]
        rows += [[title(name), *score_cells(result, name)] for name in result.names]
        lines += admission.aligned(rows)
    return "\n".join([*lines, *remarks_in_words(result), *conclusions(result)])


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    """A report that fails is one sentence: it changed nothing in its folder."""
    try:
        yield
    except (OSError, MemoryError):
        raise
    except Exception as error:
        reason = " ".join(str(error).split())[:200] or "no reason given"
        raise click.ClickException(
            f"no report was written to {folder} ({type(error).__name__}: {reason}); what was "
            f"there is there, the ranking holds"
        ) from None


@main.command()
@click.argument("variant")
@VARIANTS
def filters(variant: str, variants_file: Path | None) -> None:
    """Say of each filter whether VARIANT admits it, and why not."""
    chosen = find_variant(variant, variants_file)
    click.echo(f"Variant {chosen.name}: {chosen.title or chosen.model}", err=True)
    click.echo(admission.table(admission.admissions(chosen.model, seconds=DERIVATION)))


@main.command()
@VARIANTS
@click.option("--variant", "names", multiple=True, help="Only this one; may be repeated.")
@click.option(
    "--check",
    is_flag=True,
    help="Say of each whether it is well posed; exit status 1 if one is not.",
)
@click.option(
    "--generate",
    "wanted",
    type=click.IntRange(1, 200),
    help="Propose so many new variants that are well posed.",
)
@SEED
@click.option(
    "--runs",
    type=click.IntRange(min=FEWEST),
    default=CHECKED,
    show_default=True,
    help="Trajectories of a check, an eighth for vectors.",
)
@JOBS
@click.option(
    "--out",
    type=PATH,
    help="New file for the proposed variants.  [default: print them]",
)
def variants(
    variants_file: Path | None,
    names: tuple[str, ...],
    check: bool,
    wanted: int | None,
    seed: int,
    runs: int,
    jobs: int,
    out: Path | None,
) -> None:
    """List the variants of the lab, check them, or propose new ones."""
    if wanted is not None and (check or names or variants_file):
        raise click.UsageError("--generate goes with --seed, --runs, --jobs and --out only")
    if wanted is None and out:
        raise click.UsageError("--out goes with --generate only")
    if wanted is not None:
        _generate(wanted, seed, runs, jobs, out)
        return
    chosen, faults = read_variants(variants_file, names)
    good = not faults
    if check and chosen:
        qualities = list(quality.examine_all(list(chosen.values()), runs, seed, jobs, unposed))
        click.echo(quality.table(qualities))
        good &= all(examined.well_posed for examined in qualities)
    else:
        for variant in chosen.values():
            click.echo(summary(variant.name, variant.table))
    for fault in faults.values():
        click.echo(f"Error: {fault}", err=True)
    sys.exit(0 if good else 1)


def _generate(wanted: int, seed: int, runs: int, jobs: int, out: Path | None) -> None:
    """Proposed variants to the file or to standard output, what was rejected to standard error."""
    if out and (os.path.lexists(out) or not out.parent.is_dir()):
        raise click.ClickException(
            f"the variants cannot go to {out}: name a new file in an existing folder with --out"
        )
    generated = grammar.generate(wanted, seed, runs, jobs, unposed)
    reasons = ", ".join(f"{number} {reason}" for reason, number in generated.rejected.most_common())
    click.echo(f"Candidates rejected: {reasons or 'none'}", err=True)
    if generated.variants:
        text = (
            f"# Made by: kfcourse variants --generate {wanted} --seed {seed} --runs "
            f"{runs}\n\n{generated.toml()}"
        )
        if out:
            save(text, out)
        else:
            click.echo(text, nl=False)
    if len(generated.variants) < wanted:
        raise click.ClickException(
            f"only {len(generated.variants)} of {wanted} variants found; ask for fewer, or try "
            f"another --seed"
        )


@main.command()
@click.argument("file", type=PATH)
@VARIANTS
@click.option(
    "--variant", help="Of which the derivation is; a heading of the file may name it as well."
)
def check(file: Path, variants_file: Path | None, variant: str | None) -> None:
    """Check a derivation line by line: FILE has chains of lines such as F = M[(g*x - h)^2] and =
    g^2*d.

    Each line is compared with the one above it, and the term that is wrong is named.  Exit status 0
    if all lines are right, 1 if one differs, 2 if one, or the file, cannot be read or compared.
    """

    def model(name: str) -> Model:
        return find_variant(name, variants_file).plain("derivations")

    try:
        text = read_text(file)
        report = check_text(text, model, of_model(model(variant)) if variant else None)
        if not report.chains:
            raise ValueError(
                f"{file} has no chain of lines, such as F = M[(g*x - h)^2] and, below it, = g^2*d"
            )
    except ValueError as error:
        click.echo(f"Error: {error}", err=True)
        sys.exit(2)
    click.echo(report)
    sys.exit(2 if report.undecided else 0 if report.right else 1)


@main.command()
@click.argument("file", type=PATH)
@click.option(
    "--model",
    "model_file",
    type=PATH,
    required=True,
    help="TOML file with the model.",
)
@click.option("--variant", "name", help="Its name in the file, if there are several.")
@click.option(
    "--column",
    "pairs",
    multiple=True,
    metavar="NAME=COLUMN",
    help="The model's name and the column's, where they differ, such as y1=east or time=time_s; "
    "may be repeated.",
)
@click.option(
    "--filter",
    "structure",
    type=click.Choice([*STRUCTURES]),
    default="linearised",
    show_default=True,
    help="Structural functions.",
)
@click.option(
    "--gate",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    metavar="PROBABILITY",
    help="Refuse measurements that a right filter would not see with this probability, such as "
    "0.999.",
)
@click.option(
    "--unknown",
    default="",
    metavar="NAMES",
    help="Parameters to find by likelihood first, separated by commas.",
)
@click.option(
    "--positive",
    default="",
    metavar="NAMES",
    help="Those of them that are positive, such as variances.",
)
@click.option("--out", type=PATH, help="Folder of the report.  [default: estimate-FILE]")
def estimate(
    file: Path,
    model_file: Path,
    name: str | None,
    pairs: tuple[str, ...],
    structure: str,
    gate: float | None,
    unknown: str,
    positive: str,
    out: Path | None,
) -> None:
    """Estimate the states from your own measurements, FILE (CSV): forward, looking back, and
    judged.

    A row is a step; its cells are found by the names in the first line: y (or y1, y2, ...), time,
    and the inputs.  An empty cell is a missing measurement.  The model may use dt, the interval to
    the next row, with inputs = { dt = [1] }, as in this file:

    \b
    [variants.walk]
    state = "x + sqrt(q*dt)*v"
    meter = "x + sqrt(r)*w"
    parameters = { q = 0.1, r = 3.0 }
    inputs = { dt = [1] }
    prior = { mean = 0, variance = 100 }
    """
    variant = model_of(model_file, name)
    folder = out or _below(f"estimate-{file.stem}")
    columns = dict(pair.partition("=")[::2] for pair in pairs)
    if not all(columns.values()):
        raise click.UsageError(
            "--column takes a name of the model and one of the file, such as --column y1=east"
        )
    _check_places(folder, None)  # before the long part
    click.echo(f"Model {variant.name}: {variant.title or variant.model}", err=True)
    result = estimate_record(
        file, variant, columns=columns, structure=structure, gate=gate,
        unknown=_names(unknown), positive=_names(positive),
    )  # fmt: skip
    click.echo("\n".join(result.says()))
    with _writing(folder):
        write_record(result, folder)
    click.echo(f"Report: {folder / 'report.html'}; numbers: {folder / 'estimate.csv'}")


def _names(text: str) -> list[str]:
    return re.findall(r"[^\s,]+", text)


def _below(name: str) -> Path:
    """A folder of this name, and no other."""
    return Path(re.sub(r"[^\w.-]+", "-", name))


def _check_places(folder: Path, json_file: Path | None) -> None:
    """ClickException if the report or the numbers cannot be written where they should."""
    there = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    try:  # permissions do not tell: of /proc, or of a disk that is only read
        with TemporaryDirectory(dir=there):
            pass
    except OSError:
        raise click.ClickException(
            f"the report cannot go to {folder}: {there} is no folder to write to; choose another "
            f"one with --out"
        ) from None
    if json_file and (json_file.is_dir() or not json_file.parent.is_dir()):
        raise click.ClickException(
            f"the numbers cannot go to {json_file}: name a file in an existing folder with --json"
        )
