"""The command `kfcourse variants`; SymPy and what examines models are imported when needed."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import click

from kfcourse.files import save
from kfcourse.lab.variants import RUNS, read_tables, read_variants, summary
from kfcourse.montecarlo import FEWEST
from kfcourse.montecarlo.parallel import cores

VARIANTS = click.option("--variants", "variants_file", type=click.Path(path_type=Path), help="Another TOML file of variants.")


@click.command()
@VARIANTS
@click.option("--variant", "names", multiple=True, help="Only this one; may be repeated.")
@click.option("--check", is_flag=True, help="Say of each whether it is well posed, and how hard; exit status 1 if one is not.")
@click.option("--generate", "wanted", type=click.IntRange(1, 200), help="Propose so many new variants that are well posed.")
@click.option("--seed", type=click.IntRange(min=0), default=1, show_default=True, help="Of the trajectories and proposals.")
@click.option(
    "--runs",
    type=click.IntRange(min=FEWEST),
    default=RUNS,
    show_default=True,
    help="Trajectories of a check, an eighth for vectors.",
)
@click.option("--jobs", type=click.IntRange(min=1), help="Does not change the results.  [default: all cores]")
@click.option("--dask", help="Address of a Dask scheduler whose workers check instead.")
@click.option("--out", type=click.Path(path_type=Path), help="New file for the proposed variants.  [default: print them]")
def variants(
    variants_file: Path | None,
    names: tuple[str, ...],
    check: bool,
    wanted: int | None,
    seed: int,
    runs: int,
    jobs: int | None,
    dask: str | None,
    out: Path | None,
) -> None:
    """List the variants of the lab, check them, or propose new ones."""
    if dask and not check:
        raise click.UsageError("--dask goes with --check")
    if wanted is not None and (check or names or variants_file):
        raise click.UsageError("--generate goes with --seed, --runs, --jobs and --out only")
    if wanted is None and out:
        raise click.UsageError("--out goes with --generate only")
    if wanted is not None:
        _generate(wanted, seed, runs, jobs or cores(), out)
        return
    if not check and variants_file is None:  # that the shipped ones are models was tested
        tables = read_tables(names=names)
        click.echo("\n".join(summary(name, table) for name, table in tables.items()))
        return

    chosen, faults = read_variants(variants_file, names)
    good = not faults
    if check and chosen:
        from kfcourse.checks.posing import unposed
        from kfcourse.lab.quality import examine_all, table

        found = list(examine_all(list(chosen.values()), runs, seed, jobs or cores(), unposed, dask))
        click.echo(table(found))
        good &= all(one.well_posed for one in found)
    else:
        for variant in chosen.values():
            click.echo(summary(variant.name, variant.table))
    for fault in faults.values():
        click.echo(f"Error: {fault}", err=True)
    sys.exit(0 if good else 1)


def _generate(wanted: int, seed: int, runs: int, jobs: int, out: Path | None) -> None:
    """Proposed variants to the file or to standard output, what was rejected to standard error."""
    if out and (os.path.lexists(out) or not out.parent.is_dir()):
        raise click.ClickException(f"the variants cannot go to {out}: name a new file in an existing folder with --out")
    from kfcourse.checks.posing import unposed
    from kfcourse.lab.grammar import generate

    found = generate(wanted, seed, runs, jobs, unposed)
    reasons = ", ".join(f"{number} {reason}" for reason, number in found.rejected.most_common())
    click.echo(f"{found.rejected.total()} candidates rejected{': ' if reasons else ''}{reasons}", err=True)
    if found.variants:
        text = f"# Made by: kfcourse variants --generate {wanted} --seed {seed} --runs {runs}\n\n{found.toml()}"
        if out:
            save(text, out)
        else:
            click.echo(text, nl=False)
    if len(found.variants) < wanted:
        raise click.ClickException(f"only {len(found.variants)} of {wanted} variants found; ask for fewer, or try another --seed")
