"""The report of a record: what a filter makes of measurements from a file (`kfcourse estimate`).

`estimate_record` reads, estimates and judges; `write_record` puts into one folder: estimate.csv (numbers, a row for each row of
the record), report.html (opens in any browser, without a network) and its figures.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

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
from kfcourse.linear.consistency import Autocorrelation, Innovations, autocorrelation
from kfcourse.records.estimation import Likeliest, NoMaximum, estimate
from kfcourse.records.evidence import NoDensity
from kfcourse.records.examination import Examination, Finding, examine, findings, normal_bound
from kfcourse.records.reading import Record, RecordError, read_measurements
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.quadrature import gauss_hermite, unscented
from kfcourse.symbolic.structure import Structure, gaussian, linearised

STRUCTURES: dict[str, Callable[[Model], Structure]] = {
    "linearised": linearised, "gaussian": gaussian, "unscented": unscented, "gauss-hermite": gauss_hermite
}  # fmt: skip
LAGS = 20  # of the autocorrelation
MANY = 5000  # steps above which curves are stored as points of a picture, not one by one
NAMED = 40  # refused measurements that the report lists
ESTIMATE, SMOOTHED, MEASURED, REFUSED = "#0072B2", "#009E73", "#777777", "#D55E00"
FITS = {
    "size": "Size of the innovations: the mean of their squares over what the filter expects",
    "mean": "Mean of the innovations over their deviation",
    "neighbours": "Correlation of each innovation with the next",
}
FAILS = {
    "size": "above, the noises are larger than the model says, or the motion is another; below, they are smaller",
    "mean": "the meter has an offset, or the model leaves out what acts all the time",
    "neighbours": "the noise of the meter is not independent from one measurement to the next, the noise of the state is "
    "taken too small, or a delay is left out: the filter then claims more than it knows",
}


class Told(NamedTuple):
    """What a filter made of a record."""

    variant: Variant
    record: Record
    structure: str
    gate: float | None
    likeliest: Likeliest | None
    examined: Examination
    without_refused: bool = False  # what the gate refuses near the maximum did not enter the search for it

    @property
    def refused(self) -> Array:
        """Steps whose measurement was refused, with some of its components at least."""
        return np.flatnonzero(self.examined.weight[:, 0] < 1)

    @property
    def findings(self) -> list[Finding]:
        return findings(self.examined)

    def says(self) -> list[str]:
        """The result in sentences."""
        y = self.record.y[:, 0]
        steps, missing = len(y), int(np.isnan(y).all(axis=-1).sum())
        sentences = [f"{steps} rows, {missing} of them without a measurement; log likelihood {self.log_likelihood:.2f}."]
        if self.gate is not None:
            where = ": rows " + ranges((self.refused[:NAMED] + 1).tolist()) if len(self.refused) else ""
            more = ", ..." if len(self.refused) > NAMED else ""
            sentences.append(f"The gate refused {len(self.refused)} of {steps - missing} measurements{where}{more}.")
        if self.likeliest:
            sentences += [
                f"{name} = {value:.4g} ± {error:.2g}"
                for name, value, error in zip(
                    self.likeliest.names, self.likeliest.value, self.likeliest.standard_error, strict=True
                )
            ]
            sentences += [f"Warning: {one}." for one in self.likeliest.flat]
        if self.without_refused:
            sentences.append(
                "Near its maximum the likelihood jumps, because a measurement begins to pass the gate: the values are those of "
                "the largest likelihood of the measurements that passed there."
            )
        return sentences + [judged(one) for one in self.findings]

    @property
    def log_likelihood(self) -> float:
        return float(self.examined.log_likelihood.sum())


def judged(one: Finding) -> str:
    """A finding as a sentence."""
    kind, _, of = one.name.partition(" of ")
    within = f"a filter that is right has {one.low:.3f} to {one.high:.3f} in 95 of 100 records"
    verdict = "" if one.fits else f"; not so here: {FAILS[kind]}"
    return f"{FITS[kind]}{f', {of}' if of else ''}: {one.value:.3f} ({within}{verdict})."


def model_of(path: Path, name: str | None) -> Variant:
    """The model of a file of variants: the one named, or the only one."""
    if name is not None:
        return find_variant(name, path)
    found, faults = read_variants(path)
    for fault in faults.values():
        raise fault
    if len(found) > 1:
        raise VariantError(f"{path} has {len(found)} models; say which: --variant {' or --variant '.join([*found][:4])}")
    return next(iter(found.values()))


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
) -> Told:
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
        The file, the model or the parameters cannot be used, or the filter left the finite numbers; the message says where.
    """
    if structure not in STRUCTURES:
        raise ValueError(f"structure must be one of {', '.join(STRUCTURES)}, got {structure!r}")
    record = read_measurements(path, variant.plain("estimates from a record"), columns)

    def plain(model: Model) -> Filter:
        return aof(STRUCTURES[structure](model))

    def build(model: Model) -> Filter:
        return plain(model) if gate is None else gated(plain(model), gate, by_component=by_component)

    build(record.model)  # what cannot be had is said before the long part
    without_refused = False
    try:
        try:
            likeliest = estimate(record.model, record.y, unknown, positive, build) if unknown else None
        except NoMaximum as stopped:
            if gate is None:
                raise
            without_refused = True
            passed = np.where(examine(build(stopped.model), record.y, gate, by_component).passed, record.y, np.nan)
            likeliest = estimate(stopped.model, passed, unknown, positive, plain)
        if likeliest:
            record = record._replace(model=likeliest.model)
        examined = examine(build(record.model), record.y, 1.0 if gate is None else gate, by_component)
    except NoDensity as error:
        raise RecordError(
            f"{path}: row {error.step + 1}, time {record.times[error.step]:.16g}, cannot be judged: what the filter expects "
            "there has a covariance that is singular or not finite; look at the measurements up to it (--gate refuses those out "
            "of all bounds) and at the formulas, and give every component of the meter a noise"
        ) from None
    for law in (examined.estimate, examined.smoothed):
        bad = ~(np.isfinite(law.mean).all(axis=(1, 2)) & np.isfinite(law.cov).all(axis=(1, 2, 3)))
        if bad.any():
            k = int(np.argmax(bad))
            raise RecordError(
                f"{path}: the estimate is not finite from row {k + 1}, time {record.times[k]:.16g}: look at the formulas there "
                "(an interval of 0, a root of what is negative), or begin with a smaller prior variance"
            )
    return Told(variant, record, structure, gate, likeliest, examined, without_refused)


def write_record(told: Told, folder: Path, track: tuple[str, str] | None = None) -> None:
    """Write estimate.csv, report.html and the figures, all of them or none."""
    names = [symbol.name for symbol in told.record.model.x]
    pictures = {}
    if track:
        if len(track) != 2 or not {*track} <= {*names}:
            raise ValueError(f"track takes the names of two components of the state, {', '.join(names)}; got {track}")
        across, up = (names.index(name) for name in track)
        pictures["track"] = (f"The track: {track[1]} against {track[0]}.", partial(_track, told, across, up))
    for i, name in enumerate(names):
        pictures[f"state-{name}"] = (
            f"{name}: the estimate with a band of two standard deviations, and smoothed, given the whole record.",
            partial(_component, told, i),
        )
    for i, name in enumerate(told.record.model.measured):
        pictures[f"innovations-{name}"] = (
            f"Innovations of {name} between bounds of two standard deviations; 95 of 100 lie within if the filter is right.",
            partial(_innovations, told, i),
        )
        pictures[f"whiteness-{name}"] = (
            f"Correlation of the innovations of {name} with later ones; between the bounds in 95 of 100 lags if they are white.",
            partial(_whiteness, told, i),
        )
    with replacing_together(folder) as place:
        write_numbers(told, place / "estimate.csv")
        for name, (_, draw) in pictures.items():
            save_figure(draw, place, name)
        save_texts(("record.html",), place, _content(told, {name: caption for name, (caption, _) in pictures.items()}))
        (place / "record.html").rename(place / "report.html")


def write_numbers(told: Told, path: Path) -> None:
    """The CSV file: a row for each row of the record; cells without a number are empty."""
    model, found = told.record.model, told.examined.found
    deviations = np.sqrt(np.diagonal(found.cov, axis1=-2, axis2=-1))
    columns = {"time": told.record.times}
    for i, symbol in enumerate(model.x):
        for name, law in (("", told.examined.estimate), ("_smoothed", told.examined.smoothed)):
            columns[f"{symbol.name}{name}"] = law.mean[:, 0, i]
            columns[f"{symbol.name}{name}_sd"] = _deviation(law, i)
    for i, name in enumerate(model.measured):
        columns[f"{name}_innovation"], columns[f"{name}_innovation_sd"] = found.value[:, 0, i], deviations[:, 0, i]
    columns["weight"], columns["log_likelihood"] = told.examined.weight[:, 0], told.examined.log_likelihood[:, 0]
    with path.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(columns)  # names of symbols, and numbers: nothing that a spreadsheet takes for a formula
        times = columns.pop("time").tolist()  # with all their digits: stamps of Unix have ten before the point
        values = ([time, *map(_cell, row)] for time, *row in zip(times, *columns.values(), strict=True))
        rows.writerows(values)


def _cell(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.10g}"


def _deviation(law: Gaussian, i: int) -> Array:
    return np.sqrt(law.cov[:, 0, i, i])


def _content(told: Told, figures: Mapping[str, str]) -> dict[str, Any]:
    return {
        "variant": told.variant,
        "told": told,
        "model": lines_of(told.record.model.latex()),
        "sentences": told.says(),
        "figures": [*figures.items()],
        "unfit": [one for one in told.findings if not one.fits],
    }


def _axes(ax: Axes, name: str) -> Axes:
    ax.set_xlabel("time")
    ax.set_ylabel(name)
    ax.grid(True, alpha=0.3)
    return ax


def _component(told: Told, i: int, ax: Axes) -> Axes:
    """A component of the state with its band, and smoothed."""
    times, many = told.record.times, len(told.record.times) > MANY
    for law, colour, label in ((told.examined.estimate, ESTIMATE, "estimate"), (told.examined.smoothed, SMOOTHED, "smoothed")):
        mean, two = law.mean[:, 0, i], 2 * _deviation(law, i)
        ax.plot(times, mean, color=colour, linewidth=1, label=label, rasterized=many)
        ax.fill_between(times, mean - two, mean + two, color=colour, alpha=0.2, linewidth=0, rasterized=many)
    ax.legend(fontsize="small")
    return _axes(ax, told.record.model.x[i].name)


def _track(told: Told, i: int, j: int, ax: Axes) -> Axes:
    """Two components against each other."""
    for law, colour, label in ((told.examined.estimate, ESTIMATE, "estimate"), (told.examined.smoothed, SMOOTHED, "smoothed")):
        ax.plot(*law.mean[:, 0, [i, j]].T, color=colour, linewidth=1, label=label, rasterized=len(law.mean) > MANY)
    ax.set_aspect("equal", adjustable="datalim")
    ax.legend(fontsize="small")
    _axes(ax, told.record.model.x[j].name).set_xlabel(told.record.model.x[i].name)
    return ax


def _innovations(told: Told, i: int, ax: Axes) -> Axes:
    """Innovations of a component of the meter, and what was expected of them."""
    times, value = told.record.times, told.examined.found.value[:, 0, i]
    two, many = 2 * np.sqrt(told.examined.found.cov[:, 0, i, i]), len(times) > MANY
    there = ~np.isnan(value)
    refused = there & ~told.examined.passed[:, 0, i]
    ax.fill_between(times[there], -two[there], two[there], color=ESTIMATE, alpha=0.2, linewidth=0, rasterized=many)
    ax.plot(times[~refused], value[~refused], ".", color=MEASURED, markersize=4, rasterized=many)
    if refused.any():
        ax.plot(times[refused], value[refused], "x", color=REFUSED, label="refused", rasterized=many)
        ax.set_yscale("symlog", linthresh=float(np.nanmax(two)))
        ax.legend(fontsize="small")
    return _axes(ax, f"innovation of {told.record.model.measured[i]}")


def _whiteness(told: Told, i: int, ax: Axes) -> Axes:
    """Autocorrelation of the innovations that were taken."""
    found = _autocorrelation(told.examined, i)
    if found is not None:
        lags = np.arange(1, len(found.value) + 1)
        bound = normal_bound() * found.standard_deviation
        ax.fill_between(lags, -bound, bound, color=ESTIMATE, alpha=0.2, linewidth=0)
        ax.plot(lags, found.value, "o-", color=MEASURED, markersize=4)
    ax.axhline(0, color="black", linewidth=0.8)
    _axes(ax, "correlation").set_xlabel("measurements between them")
    return ax


def _autocorrelation(examined: Examination, i: int) -> Autocorrelation | None:
    """Of one component, from each measurement that was taken to the next ones; None of fewer than three."""
    used = examined.passed[:, 0, i]
    if used.sum() < 3:
        return None
    value, F = examined.found.value[used][..., [i]], examined.found.cov[used][..., [i], :][..., [i]]
    size = np.mean(value**2 / F[..., 0])  # as for `findings`: a wrong size alone is no correlation
    return autocorrelation(Innovations(value, size * F), min(LAGS, int(used.sum()) - 1))
