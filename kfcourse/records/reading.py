"""From a file to a filter: measurements, their times and the inputs of a model, read from CSV.

::

    time,y1,y2,turn
    0.00,12.1,,0.02
    0.13,,40.7,
    0.41,12.9,41.3,0.03

A row is a step, a column is found by its name.  An empty cell of a measurement is missing, so
sensors of different rates share a file; where it is the only column, so is an empty line.  An input
holds until the next one is given.  The interval to the next row is the input `dt`, if the model has
one.
"""

from __future__ import annotations

import csv
import re
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kfcourse.errors import expect
from kfcourse.files import read_text
from kfcourse.laws import Array
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import shown

INTERVAL = "dt"
UNEVEN = 0.01  # intervals that differ by more than this part of their median are not of one length
DATE = r"\d{4}-\d\d?-\d\d?|\d+[:/.]\d+[:/.]\d+|\d\d?:\d\d"
# What to do about a cell that is no number, by the first pattern that is found in it.
ADVICE = {
    r"^(?=.*\.)(?=.*,)[-+.,\d]+$": "a point and a comma: nothing may stand between thousands",
    DATE: "a date or a clock's time: write seconds, such as "
    "datetime.fromisoformat(...).timestamp() gives, of UTC, which has no hour twice",
    "\u2212": "its sign is a typographic minus (U+2212): write the hyphen, -",
    ",": "if the comma separates decimals, separate cells by semicolons",
    r"^\D*$": "if this is a line of units, delete it: measurements begin below the names; leave a "
    "cell empty if it is missing",
    "": "leave the cell empty if it is missing",
}
# Names without signs that a column of times may have.
CLOCK = re.compile("t|ts|tsec|date|time.*")


class RecordError(ValueError):
    """A file of measurements cannot be used; the message names the line and the column."""


class RecordWarning(UserWarning):
    """A file of measurements can be used, but perhaps not as it is meant."""


class Record(NamedTuple):
    """A file of measurements, read for a model.

    Attributes
    ----------
    times : ndarray (steps,)
    y : ndarray (steps, 1, p)
        As for `run`; NaN where a cell is empty.
    model : Model
        The model with the record's inputs: that of the filter.
    """

    times: Array
    y: Array
    model: Model


def read_measurements(
    path: str | Path, model: Model, columns: Mapping[str, str] | None = None
) -> Record:
    """Measurements and inputs of a model from a CSV file.

    Parameters
    ----------
    path : path
        UTF-8, a line of names and a line for each step.  Cells are separated by commas, tabs, or
        semicolons; between semicolons decimals may have a comma.
    model : Model
        A column for each of `model.measured` (y, or y1, y2, ...) and for each input; a column
        `time` or `t`, in the unit of the model's formulas.  Of the inputs only the names count,
        `inputs={"dt": [1], "u": [0]}`: the record has their values.  The step k lasts from row k to
        row k + 1, so dt_k = t_{k+1} - t_k, and u_k acts in it; the last has the length of the one
        before.  Without times every step has the model's `interval`.
    columns : dict, optional
        The model's name to the column's, {"y1": "east", "time": "time_s"}, where they differ.

    Raises
    ------
    RecordError
        The file cannot be read, has no column of such a name or no rows, something in a cell that
        is no finite number, lines of different lengths, times that go back, no first value of an
        input.

    Warns
    -----
    RecordWarning
        The intervals are unequal, and the model's formulas know neither dt nor t; or a column that
        is not used may be that of the times.
    """
    expect(model, Model, "read_measurements")
    table = _table(Path(path))
    named = _columns(table, model, columns or {})
    values = {name: table.numbers(column) for name, column in named.items()}
    for name in model.measured:
        if np.isnan(values[name]).all():
            raise RecordError(
                f"{path}: the column {named[name]} has no number at all; leave it out of the model"
            )
    inputs = {
        name: table.held(values[name], named[name]) for name in model.known.inputs if name in values
    }
    single = float(model.known.interval)
    times = (
        _times(table, values["time"], named["time"])
        if "time" in named
        else single * np.arange(len(table.rows))
    )
    used = {symbol.name for symbol in model.known.symbols}
    if "t" in used - set(model.known.inputs):
        inputs["t"] = times
    steps = np.diff(times)
    if INTERVAL in model.known.inputs:
        inputs.setdefault(INTERVAL, intervals(times, single))
    elif "t" not in used and len(steps) > 1 and np.ptp(steps) > UNEVEN * np.median(steps):
        warnings.warn(
            f"{path}: the intervals are {steps.min():g} to {steps.max():g}, but the model takes "
            "every step alike: write dt into its formulas, with inputs = { dt = [1] }",
            RecordWarning,
            stacklevel=2,
        )
    y = np.stack([values[name] for name in model.measured], axis=-1)[:, None]
    return Record(times, y, model.with_inputs(inputs))


def intervals(times: Array, single: float = 1.0) -> Array:
    """dt_k = t_{k+1} - t_k, (steps,); the last is as long as the one before, a single one as
    given."""
    steps = np.diff(times)
    return np.append(steps, steps[-1] if len(steps) else single)


class _Table(NamedTuple):
    """The cells of a file: names of the columns, rows, and the line of each row."""

    path: Path
    names: list[str]
    rows: list[list[str]]
    lines: list[int]

    def error(self, row: int, column: str, problem: str) -> RecordError:
        return RecordError(f"{self.path}, line {self.lines[row]}, column {column}: {problem}")

    def missing(self, name: str, column: str) -> str:
        """What a message says where a column is not there: which may be it, and how to say so."""
        listed = ", ".join(map(shown, self.names[:20])) + ", ..." * (len(self.names) > 20)
        similar = self.similar(name)
        if_it = f"if {shown(similar)} is it" if similar else "if one of them is it"
        alone = "; commas, tabs or semicolons separate cells" if len(self.names) == 1 else ""
        return (
            f"{self.path} has no column {shown(column)}; it has {listed}{alone}: {if_it}, say so "
            f"by columns={{{name!r}: {similar or '...'!r}}}, or --column {name}={similar or '...'}"
        )

    def similar(self, wanted: str) -> str | None:
        """The column that may be what is wanted, in other letters or with a unit."""
        pattern = CLOCK if wanted == "time" else re.compile(f"{re.escape(wanted.lower())}.*")
        keys = {name: re.sub(r"[^a-z0-9]", "", name.casefold()) for name in self.names}
        return next((name for name, key in keys.items() if pattern.fullmatch(key)), None)

    def numbers(self, column: str) -> Array:
        """The numbers of a column; NaN where a cell is empty."""
        place, values = self.names.index(column), np.empty(len(self.rows))
        for k, row in enumerate(self.rows):
            cell = row[place]
            try:
                values[k] = float(cell or "nan")
            except ValueError:
                advice = next(text for sign, text in ADVICE.items() if re.search(sign, cell))
                raise self.error(
                    k, column, f"expected a number or nothing, got {shown(cell)}; {advice}"
                ) from None
            if np.isinf(values[k]):
                raise self.error(k, column, f"{shown(cell)} is beyond numbers of double precision")
        return values

    def held(self, values: Array, column: str) -> Array:
        """An input with its gaps filled by the value before."""
        if np.isnan(values[0]):
            raise self.error(0, column, "an input needs a value from the first row on")
        return values[np.maximum.accumulate(np.where(np.isnan(values), 0, np.arange(len(values))))]


def _table(path: Path) -> _Table:
    """The cells of a file.  Of a single column an empty line is a row, too: a measurement that is
    missing."""
    text = read_text(path, RecordError)
    delimiter = next((sign for sign in ";\t" if sign in text.lstrip().partition("\n")[0]), ",")
    table = _Table(path, [], [], [])
    for number, line in enumerate(text.rstrip("\r\n ").splitlines(), 1):
        try:
            cells = next(csv.reader([line], delimiter=delimiter, strict=True)) or [""]
        except csv.Error as error:
            raise RecordError(
                f"{path}, line {number}: {error}; a quoted cell must end in its line"
            ) from None
        row = [cell.strip() for cell in cells]
        if row == [""] and len(table.names) != 1:
            continue
        if not table.names:
            table.names.extend(row)
            continue
        if len(row) != len(table.names):
            raise RecordError(
                f"{path}, line {number}: {len(row)} cells, but the first line names "
                f"{len(table.names)} columns; delete what stands above the names, separate cells "
                "by commas, or by semicolons if commas separate decimals"
            )
        if delimiter == ";":  # a comma may stand before decimals
            row = [re.sub(r"^([^.,]*),([^.,]*)$", r"\1.\2", cell) for cell in row]
        table.rows.append(row)
        table.lines.append(number)
    if not table.rows:
        raise RecordError(
            f"{path} {'has no rows below its names' if table.names else 'is empty'}; its first "
            "line names the columns, such as time,y, and each other line is a step"
        )
    if twice := sorted({name for name in table.names if name and table.names.count(name) > 1}):
        raise RecordError(
            f"{path}: two columns are named {shown(twice[0])}; give each a name of its own"
        )
    return table


def _columns(table: _Table, model: Model, given: Mapping[str, str]) -> dict[str, str]:
    """The column of each thing that the model needs, by the model's names."""
    wanted = [*model.measured, *(name for name in model.known.inputs if name != INTERVAL)]
    known = sorted({*wanted, "time"})
    if unknown := sorted(set(given) - set(known)):
        raise RecordError(
            f"columns are given for {', '.join(unknown)}; the model needs {', '.join(known)}"
        )
    named = {name: given.get(name, name) for name in wanted}
    clocks = [name for name in ("time", "t") if name in table.names and name not in wanted]
    needed = INTERVAL in model.known.inputs
    if "time" in given or clocks:
        named["time"] = given.get("time") or clocks[0]
    elif needed or table.similar("time") not in (None, *named.values()):
        problem = table.missing("time", "time")
        if needed or "t" in {symbol.name for symbol in model.known.symbols}:
            raise RecordError(f"{problem}, and the model needs the times")
        warnings.warn(f"{problem}; every step is taken alike", RecordWarning, stacklevel=3)
    for name, column in named.items():
        if column not in table.names:
            raise RecordError(table.missing(name, column))
    return named


def _times(table: _Table, times: Array, column: str) -> Array:
    """Times of the rows; RecordError if one is missing, or they go back."""
    if (empty := np.isnan(times)).any():
        raise table.error(int(np.argmax(empty)), column, "empty; every row needs its time")
    if (back := np.diff(times) < 0).any():
        k = int(np.argmax(back))
        raise table.error(
            k + 1,
            column,
            f"{times[k + 1]:.16g} comes after {times[k]:.16g}; sort the rows by time, but where a "
            "clock was set back write times that only grow, such as UTC",
        )
    return times
