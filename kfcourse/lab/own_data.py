"""The report of a record: what a filter makes of measurements from a file (`kfcourse estimate`).

`estimate_record` reads, estimates and judges; `write_record` puts into one folder: estimate.csv
(numbers, a row for each row of the record), report.html (opens in any browser, without a network)
and its figures.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from kfcourse.files import replacing_together
from kfcourse.filters.approximations import aof
from kfcourse.filters.base import Filter
from kfcourse.filters.gate import gated
from kfcourse.lab.report import save_figure, save_texts
from kfcourse.lab.report_text import lines_of, ranges
from kfcourse.lab.variants import Variant, VariantError, find_variant, read_variants
from kfcourse.laws import Array, Gaussian
from kfcourse.linear.consistency import Innovations, autocorrelation
from kfcourse.records.estimation import Likeliest, estimate
from kfcourse.records.evidence import NoDensity
from kfcourse.records.examination import Examination, Finding, examine, findings, normal_bound
from kfcourse.records.reading import Record, RecordError, read_measurements
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.quadrature import gauss_hermite, unscented
from kfcourse.symbolic.structure import Structure, gaussian, linearised

STRUCTURES: dict[str, Callable[[Model], Structure]] = {
    "linearised": linearised,
    "gaussian": gaussian,
    "unscented": unscented,
    "gauss-hermite": gauss_hermite,
}
LAGS = 20  # of the autocorrelation
MANY = 5000  # steps above which curves are stored as points of a picture, not one by one
NAMED = 40  # refused measurements that the report lists
ESTIMATE, SMOOTHED, MEASURED, REFUSED = "#0072B2", "#009E73", "#777777", "#D55E00"
# Of each kind of finding: what it is, and what a bad one says.
KINDS = {
    "size": (
        "Size of the innovations: the mean of their squares over what the filter expects",
        "above, the noises are larger than the model says, or the motion is another; below, they "
        "are smaller",
    ),
    "mean": (
        "Mean of the innovations over their deviation",
        "the meter has an offset, or the model leaves out what acts all the time",
    ),
    "neighbours": (
        "Correlation of each innovation with the next",
        "the noise of the meter is not independent from one measurement to the next, the noise of "
        "the state is "
        "taken too small, or a delay is left out: the filter then claims more than it knows",
    ),
}


class Analysis(NamedTuple):
    """What a filter made of a record."""

    variant: Variant
    record: Record
    structure: str
    gate: float | None
    likeliest: Likeliest | None
    examined: Examination

    @property
    def findings(self) -> list[Finding]:
        return findings(self.examined)

    @property
    def laws(self) -> dict[str, tuple[Gaussian, str]]:
        """Filtered and smoothed laws, and their colours."""
        return {
            "estimate": (self.examined.estimate, ESTIMATE),
            "smoothed": (self.examined.smoothed, SMOOTHED),
        }

    def says(self) -> list[str]:
        """The result in sentences."""
        steps, missing = len(self.record.y), int(np.isnan(self.record.y[:, 0]).all(axis=-1).sum())
        likelihood = float(self.examined.log_likelihood.sum())
        sentences = [
            f"{steps} rows, {missing} of them without a measurement; log likelihood "
            f"{likelihood:.2f}."
        ]
        if self.gate is not None:
            # with some components at least
            refused = np.flatnonzero(self.examined.weight[:, 0] < 1)
            where = ": rows " + ranges((refused[:NAMED] + 1).tolist()) if len(refused) else ""
            more = ", ..." if len(refused) > NAMED else ""
            sentences.append(
                f"The gate refused {len(refused)} of {steps - missing} measurements{where}{more}."
            )
        if self.likeliest:
            values = zip(
                self.likeliest.names,
                self.likeliest.value,
                self.likeliest.standard_error,
                strict=True,
            )
            sentences += [f"{name} = {value:.4g} ± {error:.2g}" for name, value, error in values]
            sentences += [f"Warning: {flat}." for flat in self.likeliest.flat]
        return sentences + list(map(judged, self.findings))


def judged(finding: Finding) -> str:
    """A finding as a sentence."""
    kind, _, of = finding.name.partition(" of ")
    what, fails = KINDS[kind]
    within = (
        f"a filter that is right has {finding.low:.3f} to {finding.high:.3f} in 95 of 100 records"
    )
    verdict = "" if finding.fits else f"; not so here: {fails}"
    return f"{what}{f', {of}' if of else ''}: {finding.value:.3f} ({within}{verdict})."


def model_of(path: Path, name: str | None) -> Variant:
    """The model of a file of variants: the one named, or the only one."""
    if name is not None:
        return find_variant(name, path)
    variants, faults = read_variants(path)
    for fault in faults.values():
        raise fault
    if len(variants) > 1:
        raise VariantError(
            f"{path} has {len(variants)} models; say which: --variant "
            f"{' or --variant '.join([*variants][:4])}"
        )
    return next(iter(variants.values()))


def estimate_record(
    path: Path,
    variant: Variant,
    *,
    columns: Mapping[str, str] | None = None,
    structure: str = "linearised",
    gate: float | None = None,
    by_component: bool = False,
    unknown: Sequence[str] = (),
    positive: Sequence[str] = (),
) -> Analysis:
    """Read a file, find unknown parameters if any, and examine the record by a filter.

    Parameters
    ----------
    path : path
        CSV, as of `read_measurements`, with `columns`.
    variant : Variant
    structure : str
        A key of `STRUCTURES`.
    gate : float, optional
        Probability with which a measurement passes (`kfcourse.filters.gated`).
    by_component : bool
        Whether the gate judges each component of a measurement for itself.
    unknown, positive : sequence of str
        As of `kfcourse.records.estimate`.

    Raises
    ------
    ValueError
        The file, the model or the parameters cannot be used, or the filter left the finite numbers;
        the message says where.
    """
    if structure not in STRUCTURES:
        raise ValueError(f"structure must be one of {', '.join(STRUCTURES)}, got {structure!r}")
    record = read_measurements(path, variant.plain("estimates from a record"), columns)

    def build(model: Model) -> Filter:
        plain = aof(STRUCTURES[structure](model))
        return plain if gate is None else gated(plain, gate, by_component=by_component)

    build(record.model)  # what cannot be had is said before the long part
    try:
        likeliest = estimate(record.model, record.y, unknown, positive, build) if unknown else None
        if likeliest:
            record = record._replace(model=likeliest.model)
        examined = examine(
            build(record.model), record.y, 1.0 if gate is None else gate, by_component
        )
        result = Analysis(variant, record, structure, gate, likeliest, examined)
    except NoDensity as error:
        raise RecordError(
            f"{path}: row {error.step + 1}, time {record.times[error.step]:.16g}, cannot be "
            f"judged: what the filter expects "
            "there has a covariance that is singular or not finite; look at the measurements up "
            "to it (--gate refuses those out "
            "of all bounds) and at the formulas, and give every component of the meter a noise"
        ) from None
    for law, _ in result.laws.values():
        finite = np.isfinite(law.mean).all(axis=(1, 2)) & np.isfinite(law.cov).all(axis=(1, 2, 3))
        if not finite.all():
            k = int(np.argmin(finite))
            raise RecordError(
                f"{path}: the estimate is not finite from row {k + 1}, time "
                f"{record.times[k]:.16g}: look at the formulas there "
                "(an interval of 0, a root of what is negative), or begin with a smaller prior "
                "variance"
            )
    return result


def write_record(result: Analysis, folder: Path, track: tuple[str, str] | None = None) -> None:
    """Write estimate.csv, report.html and the figures, all of them or none."""
    model = result.record.model
    names = [symbol.name for symbol in model.x]
    pictures: dict[str, tuple[str, Callable[[Axes], Axes]]] = {}
    if track:
        across, up = map(names.index, track)
        pictures["track"] = (
            f"The track: {track[1]} against {track[0]}.",
            partial(_track, result, across, up),
        )
    for i, name in enumerate(names):
        about = (
            f"{name}: the estimate with a band of two standard deviations, and smoothed, "
            f"given the whole record."
        )
        pictures[f"state-{name}"] = (about, partial(_component, result, i))
    for i, name in enumerate(model.measured):
        about = (
            f"Innovations of {name} between bounds of two standard deviations; 95 of 100 lie "
            f"within if the filter is right."
        )
        pictures[f"innovations-{name}"] = (about, partial(_innovations, result, i))
        about = f"Correlation of the innovations of {name} with later ones; between the bounds "
        about += "in 95 of 100 lags if they are white."
        pictures[f"whiteness-{name}"] = (about, partial(_whiteness, result, i))
    content = {
        "result": result,
        "model": lines_of(model.latex()),
        "figures": [(name, caption) for name, (caption, _) in pictures.items()],
        "unfit": not all(finding.fits for finding in result.findings),
    }
    with replacing_together(folder) as place:
        write_numbers(result, place / "estimate.csv")
        for name, (_, draw) in pictures.items():
            save_figure(draw, place, name)
        save_texts(("record.html",), place, content)
        (place / "record.html").rename(place / "report.html")


def write_numbers(result: Analysis, path: Path) -> None:
    """The CSV file: a row for each row of the record; cells without a number are empty."""
    model, examined = result.record.model, result.examined
    columns = {}
    for i, symbol in enumerate(model.x):
        for name, law in (
            (symbol.name, examined.estimate),
            (f"{symbol.name}_smoothed", examined.smoothed),
        ):
            columns[name], columns[f"{name}_sd"] = law.mean[:, 0, i], _deviation(law.cov, i)
    for i, name in enumerate(model.measured):
        columns[f"{name}_innovation"] = examined.found.value[:, 0, i]
        columns[f"{name}_innovation_sd"] = _deviation(examined.found.cov, i)
    columns |= {"weight": examined.weight[:, 0], "log_likelihood": examined.log_likelihood[:, 0]}
    with path.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        # names of symbols, and numbers: nothing that a spreadsheet takes for a formula
        rows.writerow(["time", *columns])
        # with all their digits: stamps of Unix have ten before the point
        times = result.record.times.tolist()
        cells = (
            ["" if np.isnan(value) else f"{value:.10g}" for value in row]
            for row in zip(*columns.values(), strict=True)
        )
        rows.writerows([time, *row] for time, row in zip(times, cells, strict=True))


def _deviation(cov: Array, i: int) -> Array:
    return np.sqrt(cov[:, 0, i, i])


def _labelled(ax: Axes, across: str, up: str) -> Axes:
    ax.set_xlabel(across)
    ax.set_ylabel(up)
    ax.grid(True, alpha=0.3)
    if ax.get_legend_handles_labels()[1]:
        ax.legend(fontsize="small")
    return ax


def _component(result: Analysis, i: int, ax: Axes) -> Axes:
    """A component of the state with its band, and smoothed."""
    times = result.record.times
    for label, (law, colour) in result.laws.items():
        mean, two, many = law.mean[:, 0, i], 2 * _deviation(law.cov, i), len(times) > MANY
        ax.plot(times, mean, color=colour, linewidth=1, label=label, rasterized=many)
        ax.fill_between(
            times, mean - two, mean + two, color=colour, alpha=0.2, linewidth=0, rasterized=many
        )
    return _labelled(ax, "time", result.record.model.x[i].name)


def _track(result: Analysis, i: int, j: int, ax: Axes) -> Axes:
    """Two components against each other."""
    for label, (law, colour) in result.laws.items():
        ax.plot(
            *law.mean[:, 0, [i, j]].T,
            color=colour,
            linewidth=1,
            label=label,
            rasterized=len(law.mean) > MANY,
        )
    ax.set_aspect("equal", adjustable="datalim")
    return _labelled(ax, result.record.model.x[i].name, result.record.model.x[j].name)


def _innovations(result: Analysis, i: int, ax: Axes) -> Axes:
    """Innovations of a component of the meter, and what was expected of them."""
    times, value = result.record.times, result.examined.found.value[:, 0, i]
    two, many = 2 * _deviation(result.examined.found.cov, i), len(times) > MANY
    present = ~np.isnan(value)
    refused = present & ~result.examined.passed[:, 0, i]
    ax.fill_between(
        times[present],
        -two[present],
        two[present],
        color=ESTIMATE,
        alpha=0.2,
        linewidth=0,
        rasterized=many,
    )
    ax.plot(times[~refused], value[~refused], ".", color=MEASURED, markersize=4, rasterized=many)
    if refused.any():
        ax.plot(
            times[refused], value[refused], "x", color=REFUSED, label="refused", rasterized=many
        )
        ax.set_yscale("symlog", linthresh=float(np.nanmax(two)))
    return _labelled(ax, "time", f"innovation of {result.record.model.measured[i]}")


def _whiteness(result: Analysis, i: int, ax: Axes) -> Axes:
    """Autocorrelation of the innovations that were taken, from each to the next ones; nothing of
    fewer than three."""
    used = result.examined.passed[:, 0, i]
    if used.sum() >= 3:
        value, F = (
            result.examined.found.value[used][..., [i]],
            result.examined.found.cov[used][..., [i], :][..., [i]],
        )
        # as for `findings`: a wrong size alone is no correlation
        size = np.mean(value**2 / F[..., 0])
        white = autocorrelation(Innovations(value, size * F), min(LAGS, int(used.sum()) - 1))
        lags, bound = np.arange(1, len(white.value) + 1), normal_bound() * white.standard_deviation
        ax.fill_between(lags, -bound, bound, color=ESTIMATE, alpha=0.2, linewidth=0)
        ax.plot(lags, white.value, "o-", color=MEASURED, markersize=4)
    ax.axhline(0, color="black", linewidth=0.8)
    return _labelled(ax, "measurements between them", "correlation")
