"""The lab's commands: `kfcourse lab 53`, `kfcourse filters 53`, `kfcourse estimate`."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile

import click

from kfcourse.commands import main as main  # scripts that were installed before call it here
from kfcourse.derivations import check_text
from kfcourse.derivations.setting import of_model
from kfcourse.files import replacing_together
from kfcourse.lab.admission import admissions, on_trial
from kfcourse.lab.admission import table as table_of_filters
from kfcourse.lab.budget import SIZES, Budget, usual_runs
from kfcourse.lab.handin import LANGUAGES, write_handin
from kfcourse.lab.own_data import STRUCTURES, estimate_record, model_of, write_record
from kfcourse.lab.report import conclusions, recognised_modes, remarks_in_words, write_json, write_report
from kfcourse.lab.short_names import FILTERS, JUMP_FILTERS, JUMP_LAB, LAB, OF_BEST, has_bound, title
from kfcourse.lab.variants import STEPS, find_variant
from kfcourse.listing import VARIANTS
from kfcourse.montecarlo.comparison import EXACT, Comparison
from kfcourse.montecarlo.experiment import without_failing
from kfcourse.montecarlo.slow_filters import FEWEST as FEWEST_SLOW
from kfcourse.montecarlo.slow_filters import LEAST
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.writing import by_thousands

DERIVATION = 180.0  # seconds for the formulas of the filters: a busy machine must not leave out what a quiet one has
STANDARD_OUTPUT = ("-", "/dev/stdout")
LONGEST = 1_000_000  # bytes of a derivation; /dev/zero never ends
ENOUGH = 3600  # seconds for slow filters, where their number is given
DESIGNS = 4  # with fewer, the deviation between designs is hardly known; with more, the lab takes longer


@click.command()
@click.argument("variant")
@VARIANTS
@click.option(
    "--runs",
    type=click.IntRange(min=2),
    help=f"Trajectories.  [default: {SIZES[0]}, or {' or '.join(map(str, SIZES[1:]))} where the filters have more to compute]",
)
@click.option(
    "--steps", type=click.IntRange(min=1), help=f"Measurements of each trajectory.  [default: {STEPS}, or what the variant says]"
)
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="The same seed gives the same numbers.")
@click.option(
    "--filters",
    "names",
    help=f"Short names, separated by commas. Known: {', '.join(FILTERS)}; for variants with modes: {', '.join(JUMP_FILTERS)}.  "
    "[default: the lab's seven and the exact AOF; for variants with modes all but those that remember several steps]",
)
@click.option(
    "--slow-runs",
    type=click.IntRange(min=0),
    default=4000,
    show_default=True,
    help="Trajectories for the slow filters, if the time allows; 0 leaves them out.",
)
@click.option(
    "--slow-seconds",
    type=click.FloatRange(min=0, min_open=True),
    default=30.0,
    show_default=True,
    help="Time for the slow filters: what fits is computed, and the report says on how many trajectories.",
)
@click.option(
    "--slow-memory",
    type=click.FloatRange(min=LEAST / 1e6),
    default=1000.0,
    show_default=True,
    help="Megabytes for the slow filters (Linux): they take as many trajectories at once as have room.",
)
@click.option(
    "--designs",
    type=click.IntRange(min=1),
    help="Ensembles to design DUOF, FOS and MFOS on: how much they differ goes into the standard errors.  [default: 4]",
)
@click.option(
    "--wide",
    type=click.FloatRange(min=1),
    help="Draw half of the initial states from a law so many times as wide, and weight the trajectories.  [default: by a pilot]",
)
@click.option("--same-ensemble", is_flag=True, help="Design DUOF, FOS and MFOS on the trajectories they are compared on, once.")
@click.option(
    "--jobs",
    "--threads",
    "threads",
    type=click.IntRange(min=1),
    help="Processor cores to use; does not change the numbers.  [default: all]",
)
@click.option("--dask", help="Address of a Dask scheduler whose workers run the filters instead.")
@click.option(
    "--compiled",
    is_flag=True,
    help="Run compiled filters (scalar variants; needs numba): equal but for rounding, for many trajectories.",
)
@click.option("--out", type=click.Path(path_type=Path), help="Folder of the report.  [default: lab-VARIANT]")
@click.option(
    "--report", "language", type=click.Choice(LANGUAGES), help="Also write the student's report, handin.html and handin.tex."
)
@click.option(
    "--json", "json_file", type=click.Path(path_type=Path), help="Also write the numbers to this file; - is standard output."
)
def lab(
    variant: str,
    variants_file: Path | None,
    runs: int | None,
    steps: int | None,
    seed: int,
    names: str | None,
    slow_runs: int,
    slow_seconds: float,
    slow_memory: float,
    designs: int | None,
    wide: float | None,
    same_ensemble: bool,
    threads: int | None,
    dask: str | None,
    compiled: bool,
    out: Path | None,
    language: str | None,
    json_file: Path | None,
) -> None:
    """Compare the filters on VARIANT (such as 53) and write the report.

    The same seed gives the same numbers, bit by bit on one machine; another one's linear algebra (BLAS) may round
    otherwise, by 1e-13 or so.
    """
    if 0 < slow_runs < FEWEST_SLOW:
        raise click.ClickException(
            f"on {slow_runs} trajectories the rare ones that matter are missing: give --slow-runs 0, or at least {FEWEST_SLOW}"
        )
    if same_ensemble and designs not in (None, 1):
        raise click.UsageError("--same-ensemble designs once, on the ensemble of the comparison: leave --designs out")
    chosen = find_variant(variant, variants_file)
    model = chosen.model
    if names is None:
        usual = JUMP_LAB if isinstance(model, JumpModel) else LAB
        wanted = [*usual, "aof-exact"] if slow_runs and has_bound(model) else list(usual)
    else:
        wanted = [name.strip() for name in names.split(",") if name.strip()]
    found = admissions(model, wanted, DERIVATION)
    refused = {one.name: one.reason for one in found if one.one is None}
    for one in found:
        for warning in one.warnings:
            click.echo(f"Warning: {title(one.name)}: {warning}", err=True)
    of_functions = [one for one in found if one.name.endswith("-gaussian") or one.name in OF_BEST]
    for remark in dict.fromkeys(remark for one in of_functions for remark in one.remarks):
        whose = ", ".join(title(one.name) for one in of_functions if remark in one.remarks)
        click.echo(f"{whose}: {remark}", err=True)
    if len(refused) == len(found):
        raise click.ClickException(
            "; ".join(f"{name}: {reason}" for name, reason in refused.items())
            or "give at least one filter: --filters duof,aof-gaussian"
        )
    folder = out or Path("lab-" + re.sub(r"[^\w.-]+", "-", chosen.name))  # no folder but this one
    _check_places(folder, json_file)  # before the long part
    click.echo(f"Variant {chosen.name}: {chosen.title or model}", err=True)
    filters = [one.one for one in found if one.one]
    many = 1 if same_ensemble else designs or DESIGNS
    budget = Budget(runs) if runs else usual_runs(filters, model, steps or chosen.steps, many)
    if budget.says:
        click.echo(budget.says, err=True)
    result = without_failing(
        filters,
        model,
        budget.runs,
        steps or chosen.steps,
        seed,
        left_out=refused,
        slow_runs=slow_runs,
        slow_seconds=slow_seconds,
        slow_memory=1e6 * slow_memory,
        same_ensemble=same_ensemble,
        wide=wide,
        threads=threads,
        dask=dask,
        designs=many,
        compiled=compiled,
    )
    for name, reason in result.left_out.items():
        click.echo(f"{title(name)} left out: {reason}", err=True)
    for name, reason in result.replaced.items():
        click.echo(f"{title(name)} by particles: {reason}", err=True)
    to_error = str(json_file) in STANDARD_OUTPUT
    _tell(result, to_error)
    again = _again(result, variant, variants_file, seed, names, designs, wide, same_ensemble, compiled)
    click.echo(again, err=to_error)
    if json_file:
        write_json(chosen, result, json_file)
    with _kept(folder), replacing_together(folder) as place:
        modes = recognised_modes(result, filters)
        write_report(chosen, result, place, [one for one in (budget.says, again) if one], found, modes)
        if language:
            write_handin(chosen, result, place, language, modes)
    if not language and (older := folder / "handin.html").exists():
        click.echo(f"{older} is of an earlier run; --report en, or ru, writes it anew", err=True)
    click.echo(f"Report: {folder / 'report.html'}" + (f"; numbers: {json_file}" if json_file else ""), err=to_error)


def _tell(result: Comparison, to_error: bool) -> None:
    """The ranking; to standard error if standard output takes the numbers."""
    reference = EXACT if result.has_bound else result.control
    lines = [f"D_k above that of {title(reference)}, %, mean over the steps ± standard error:"]
    for name, gap in result.ranking():
        found = f"{100 * float(gap.value):8.3f} ± {100 * float(gap.standard_error):.3f}"
        lines.append(f"{title(name):<18} {'diverges' if name in result.lost else found}")
    if result.slow_runs:
        lines.append(by_thousands(f"Slow filters: on {result.slow_runs} of {result.runs} trajectories"))
    click.echo("\n".join([*lines, *remarks_in_words(result), *conclusions(result)]), err=to_error)


def _again(
    result: Comparison,
    variant: str,
    variants_file: Path | None,
    seed: int,
    names: str | None,
    designs: int | None,
    wide: float | None,
    same_ensemble: bool,
    compiled: bool,
) -> str:
    """The command that repeats the comparison wherever it runs: what was chosen by count or by time is written out."""
    slow = result.slow_runs if result.slow_runs >= FEWEST_SLOW else 0
    options: dict[str, object] = {
        "--variants": variants_file,
        "--runs": result.runs,
        "--steps": result.steps,
        "--seed": seed,
        "--filters": names,
        "--slow-runs": slow,
        "--slow-seconds": ENOUGH if slow else None,
        "--designs": designs,
        "--wide": wide,
    }
    words = [str(one) for option, value in options.items() if value is not None for one in (option, value)]
    flags = [flag for flag, given in (("--same-ensemble", same_ensemble), ("--compiled", compiled)) if given]
    but = ", but for the slow filters, which the time decided" if result.replaced or slow != result.slow_runs else ""
    return f"The same numbers again{but}: kfcourse lab {shlex.join([variant, *words, *flags])}"


@contextmanager
def _kept(folder: Path) -> Iterator[None]:
    """A report that fails changes nothing in its folder."""
    try:
        yield
    except (OSError, MemoryError):
        raise
    except Exception as error:
        reason = " ".join(str(error).split())[:200] or "no reason given"
        raise click.ClickException(
            f"no report was written to {folder} ({type(error).__name__}: {reason}); what was there is there, the ranking holds"
        ) from None


@click.command()
@click.argument("places", nargs=-1, required=True, metavar="[FILE] VARIANT")
@VARIANTS
@click.option("--trial/--no-trial", default=True, show_default=True, help="Also run each filter on a few hundred trajectories.")
def filters(places: tuple[str, ...], variants_file: Path | None, trial: bool) -> None:
    """Say of each filter whether VARIANT, of FILE or of the lab, admits it, and why not."""
    if len(places) > 2 or (len(places) == 2 and variants_file):
        raise click.UsageError("give a VARIANT, or a FILE of variants and a VARIANT of it")
    chosen = find_variant(places[-1], Path(places[0]) if len(places) == 2 else variants_file)
    found = admissions(chosen.model, seconds=DERIVATION)
    click.echo(f"Variant {chosen.name}: {chosen.title or chosen.model}", err=True)
    click.echo(table_of_filters(on_trial(chosen.model, found) if trial else found))


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@VARIANTS
@click.option("--variant", help="Of which the derivation is; a heading of the file may name it as well.")
def check(file: Path, variants_file: Path | None, variant: str | None) -> None:
    """Check a derivation line by line: FILE has chains of lines such as F = M[(g*x - h)^2] and = g^2*d.

    Each line is compared with the one above it, and the term that is wrong is named.  Exit status 0 if all lines are right, 1
    if one differs, 2 if one, or the file, cannot be read or compared.
    """

    def model(name: str) -> Model:
        return find_variant(name, variants_file).plain("derivations")

    try:
        with file.open("rb") as stream:
            content = stream.read(LONGEST + 1)
        if len(content) > LONGEST:
            raise ValueError(f"{file} has more than {LONGEST:,} bytes: it is no derivation; check the path")
        report = check_text(content.decode("utf-8-sig"), model, of_model(model(variant)) if variant else None)
    except UnicodeDecodeError:
        fault = f"{file} is no text in UTF-8: save it as such"
    except OSError as error:
        fault = f"{file}: {error.strerror}"
    except ValueError as error:
        fault = str(error)
    else:
        fault = "" if report.chains else f"{file} has no chain of lines, such as F = M[(g*x - h)^2] and, below it, = g^2*d"
    if fault:
        click.echo(f"Error: {fault}", err=True)
        sys.exit(2)
    click.echo(report)
    sys.exit(2 if report.undecided else 0 if report.right else 1)


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--model", "model_file", type=click.Path(path_type=Path), required=True, help="TOML file with the model.")
@click.option("--variant", "name", help="Its name in the file, if there are several.")
@click.option(
    "--column",
    "pairs",
    multiple=True,
    metavar="NAME=COLUMN",
    help="The model's name and the column's, where they differ, such as y1=east or time=time_s; may be repeated.",
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
    help="Refuse measurements that a right filter would not see with this probability, such as 0.999.",
)
@click.option("--by-component", is_flag=True, help="Let the gate judge each component of a row, y1, y2, ..., for itself.")
@click.option("--unknown", default="", metavar="NAMES", help="Parameters to find by likelihood first, separated by commas.")
@click.option("--positive", default="", metavar="NAMES", help="Those of them that are positive, such as variances.")
@click.option("--track", metavar="X,Y", help="Two components of the state, drawn against each other.")
@click.option("--out", type=click.Path(path_type=Path), help="Folder of the report.  [default: estimate-FILE]")
def estimate(
    file: Path,
    model_file: Path,
    name: str | None,
    pairs: tuple[str, ...],
    structure: str,
    gate: float | None,
    by_component: bool,
    unknown: str,
    positive: str,
    track: str | None,
    out: Path | None,
) -> None:
    """Estimate the states from your own measurements, FILE (CSV): forward, looking back, and judged.

    A row is a step; its cells are found by the names in the first line: y (or y1, y2, ...), time, and the inputs.  An empty cell
    is a missing measurement.  The model may use dt, the interval to the next row, with inputs = { dt = [1] }, as in this file:

    \b
    [variants.walk]
    state = "x + sqrt(q*dt)*v"
    meter = "x + sqrt(r)*w"
    parameters = { q = 0.1, r = 3.0 }
    inputs = { dt = [1] }
    prior = { mean = 0, variance = 100 }
    """
    variant = model_of(model_file, name)
    folder = out or Path("estimate-" + re.sub(r"[^\w.-]+", "-", file.stem))
    drawn = _pair(track, [symbol.name for symbol in variant.model.x]) if track else None
    columns = dict(pair.partition("=")[::2] for pair in pairs)
    if not all(columns.values()):
        raise click.UsageError("--column takes a name of the model and one of the file, such as --column y1=east")
    _check_places(folder, None)  # before the long part
    click.echo(f"Model {variant.name}: {variant.title or variant.model}", err=True)
    told = estimate_record(
        file, variant, columns=columns, structure=structure, gate=gate, by_component=by_component,
        unknown=_names(unknown), positive=_names(positive),
    )  # fmt: skip
    click.echo("\n".join(told.says()))
    with _kept(folder), replacing_together(folder) as place:
        write_record(told, place, drawn)
    click.echo(f"Report: {folder / 'report.html'}; numbers: {folder / 'estimate.csv'}")


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _pair(text: str, known: list[str]) -> tuple[str, str]:
    names = _names(text)
    if len(names) != 2 or not set(names) <= set(known):
        raise click.UsageError(f"--track takes two components of the state, separated by a comma; there are {', '.join(known)}")
    return names[0], names[1]


def _check_places(folder: Path, json_file: Path | None) -> None:
    """ClickException if the report or the numbers cannot be written where they should; leaves nothing there."""
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        TemporaryFile(dir=folder).close()
    except OSError as error:
        raise click.ClickException(
            f"the report cannot go to {folder}: {error.strerror}; choose another folder with --out"
        ) from None
    finally:
        for place in made:
            if place.is_dir():
                place.rmdir()
    if json_file is None or str(json_file) in STANDARD_OUTPUT:
        return
    if json_file.is_dir() or not json_file.parent.is_dir():
        raise click.ClickException(f"the numbers cannot go to {json_file}: name a file in an existing folder with --json")
    if json_file.exists() and not json_file.is_file():  # a pipe or a device is written to, not replaced
        return
    try:
        TemporaryFile(dir=json_file.parent).close()
    except OSError as error:
        raise click.ClickException(
            f"the numbers cannot go to {json_file}: {error.strerror}; name a file in another folder with --json"
        ) from None
