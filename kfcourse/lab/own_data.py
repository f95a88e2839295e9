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
from kfcourse.lab.variants import MANY, Variant, VariantError, find_variant, read_tables
from kfcourse.laws import Array
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
PICTURE = 5000  # steps above which curves are stored as a picture, not point by point
ESTIMATE, SMOOTHED, MEASURED, REFUSED = "#0072B2", "#009E73", "#777777", "#D55E00"
# What is drawn of the state: ends of names of columns, and colours.
CURVES = {"estimate": ("", ESTIMATE), "smoothed": ("_smoothed", SMOOTHED)}
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

    def says(self) -> list[str]:
        """The result in sentences."""
        steps, y, weight = len(self.record.y), self.record.y[:, 0], self.examined.weight[:, 0]
        missing = int(np.isnan(y).all(axis=-1).sum())
        likelihood = float(self.examined.log_likelihood.sum())
        sentences = [
            f"{steps} rows, {missing} of them without a measurement; log likelihood "
            f"{likelihood:.2f}."
        ]
        if self.gate is not None:
            refused = np.flatnonzero(weight < 1) + 1
            rows = f": row{'s' * (len(refused) > 1)} {ranges(refused[:MANY].tolist())}"
            where = rows if len(refused) else ""
            more = ", ..." if len(refused) > MANY else ""
            sentences.append(
                f"The gate refused {len(refused)} of {steps - missing} measurements{where}{more}."
            )
        if best := self.likeliest:
            values = zip(best.names, best.value, best.standard_error, strict=True)
            sentences += [f"{name} = {value:.4g} ± {error:.2g}" for name, value, error in values]
            sentences += [f"Warning: {flat}." for flat in best.flat]
        return sentences + list(map(judged, self.findings))


def judged(finding: Finding) -> str:
    """A finding as a sentence."""
    kind, _, of = finding.name.partition(" of ")
    what, fails = KINDS[kind]
    within = f"{finding.low:.3f} to {finding.high:.3f} in 95 of 100 records"
    verdict = "" if finding.fits else f"; not so here: {fails}"
    return (
        f"{what}{f', {of}' if of else ''}: {finding.value:.3f} (a filter that is right has "
        f"{within}{verdict})."
    )


def model_of(path: Path, name: str | None) -> Variant:
    """The model of a file of variants: the one named, or the only one."""
    names = [*read_tables(path)] if name is None else [name]
    if len(names) > 1:
        raise VariantError(
            f"{path} has {len(names)} models; say which: --variant "
            f"{' or --variant '.join(names[:4])}"
        )
    return find_variant(names[0], path)


def estimate_record(
    path: Path,
    variant: Variant,
    *,
    columns: Mapping[str, str] | None = None,
    structure: str = "linearised",
    gate: float | None = None,
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
    unknown, positive : sequence of str
        As of `kfcourse.records.estimate`.

    Raises
    ------
    ValueError
        The file, the model or the parameters cannot be used, or the filter left the finite numbers;
        the message says where.
    """
    record = read_measurements(path, variant.plain("estimates from a record"), columns)

    def build(model: Model) -> Filter:
        plain = aof(STRUCTURES[structure](model))
        return plain if gate is None else gated(plain, gate)

    build(record.model)  # what cannot be had is said before the long part
    try:
        likeliest = estimate(record.model, record.y, unknown, positive, build) if unknown else None
        if likeliest:
            record = record._replace(model=likeliest.model)
        examined = examine(build(record.model), record.y)
    except NoDensity as error:
        raise RecordError(
            f"{path}: row {error.step + 1}, time {record.times[error.step]:.16g}, cannot be "
            f"judged: what the filter expects "
            "there has a covariance that is singular or not finite; look at the measurements up "
            "to it (--gate refuses those out "
            "of all bounds) and at the formulas, and give every component of the meter a noise"
        ) from None
    return Analysis(variant, record, structure, gate, likeliest, examined)


def columns_of(result: Analysis) -> dict[str, Array]:
    """What the file of numbers has, and what figures show: a number for each row of the record."""
    model, examined, columns = result.record.model, result.examined, {}
    nu = examined.innovations
    for i, symbol in enumerate(model.x):
        for key, law in (("", examined.estimate), ("_smoothed", examined.smoothed)):
            columns[symbol.name + key] = law.mean[:, 0, i]
            columns[f"{symbol.name}{key}_sd"] = np.sqrt(law.cov[:, 0, i, i])
    for i, name in enumerate(model.measured):
        columns[f"{name}_innovation"] = nu.value[:, 0, i]
        columns[f"{name}_innovation_sd"] = np.sqrt(nu.cov[:, 0, i, i])
    weight, likelihood = examined.weight[:, 0], examined.log_likelihood[:, 0]
    return columns | {"weight": weight, "log_likelihood": likelihood}


def write_record(result: Analysis, folder: Path) -> None:
    """Write estimate.csv, report.html and the figures, all of them or none."""
    model, times, columns = result.record.model, result.record.times, columns_of(result)
    figures: dict[str, Callable[[Axes], None]] = {
        f"state-{symbol}": partial(_component, times, columns, symbol.name) for symbol in model.x
    }
    for name in model.measured:
        figures[f"innovations-{name}"] = partial(_innovations, times, columns, name)
        figures[f"whiteness-{name}"] = partial(_whiteness, columns, name)
    content = {"result": result, "model": lines_of(model.latex()), "figures": [*figures]}
    with replacing_together(folder) as place:
        with (place / "estimate.csv").open("w", encoding="utf-8", newline="") as file:
            rows = csv.writer(file, lineterminator="\n")
            # names of symbols, and numbers: nothing that a spreadsheet takes for a formula
            rows.writerow(["time", *columns])
            # times with all their digits: stamps of Unix have ten before the point
            for time, *row in zip(times.tolist(), *columns.values(), strict=True):
                rows.writerow(
                    [time, *("" if np.isnan(value) else f"{value:.10g}" for value in row)]
                )
        for name, draw in figures.items():
            save_figure(draw, place, name)
        save_texts(("record.html",), place, content)
        (place / "record.html").rename(place / "report.html")


def _labelled(ax: Axes, across: str, up: str) -> None:
    ax.set(xlabel=across, ylabel=up)
    ax.grid(True, alpha=0.3)
    if max(np.size(line.get_xdata()) for line in ax.lines) > PICTURE:
        ax.set_rasterization_zorder(3)  # all but the legend
    if ax.get_legend_handles_labels()[1]:
        ax.legend(fontsize="small")


def _band(ax: Axes, x: Array, y: Array, half: Array, colour: str) -> None:
    """What is within so much of a curve."""
    ax.fill_between(x, y - half, y + half, alpha=0.2, linewidth=0, color=colour)


def _component(times: Array, columns: Mapping[str, Array], name: str, ax: Axes) -> None:
    """A component of the state with its band, and smoothed."""
    for label, (key, colour) in CURVES.items():
        ax.plot(times, columns[name + key], linewidth=1, color=colour, label=label)
        _band(ax, times, columns[name + key], 2 * columns[f"{name}{key}_sd"], colour)
    _labelled(ax, "time", name)


def _innovations(times: Array, columns: Mapping[str, Array], name: str, ax: Axes) -> None:
    """Innovations of a component of the meter, and what was expected of them."""
    value, two = columns[f"{name}_innovation"], 2 * columns[f"{name}_innovation_sd"]
    measured = ~np.isnan(value)
    refused = measured & (columns["weight"] == 0)
    _band(ax, times[measured], np.zeros(measured.sum()), two[measured], ESTIMATE)
    ax.axhline(0, color="black", linewidth=0.8)
    ax.plot(times[~refused], value[~refused], ".", markersize=4, color=MEASURED)
    if refused.any():
        ax.plot(times[refused], value[refused], "x", markersize=4, color=REFUSED, label="refused")
        ax.set_yscale("symlog", linthresh=float(np.nanmax(two)))
    _labelled(ax, "time", f"innovation of {name}")


def _whiteness(columns: Mapping[str, Array], name: str, ax: Axes) -> None:
    """Autocorrelation of the innovations that were taken, from each to the next ones; nothing of
    fewer than three."""
    s = columns[f"{name}_innovation"] / columns[f"{name}_innovation_sd"]
    s = s[~np.isnan(s) & (columns["weight"] > 0), None, None]
    if len(s) >= 3:
        # as for `findings`: a wrong size alone is no correlation
        of_size_1 = Innovations(s, np.mean(s**2) * np.ones((len(s), 1, 1, 1)))
        white = autocorrelation(of_size_1, min(LAGS, len(s) - 1))
        lags, bound = np.arange(1, len(white.value) + 1), normal_bound() * white.standard_deviation
        _band(ax, lags, 0 * bound, bound, ESTIMATE)
        ax.plot(lags, white.value, "o-", linewidth=1, markersize=4, color=MEASURED)
    ax.axhline(0, color="black", linewidth=0.8)
    _labelled(ax, "measurements between them", "correlation")
