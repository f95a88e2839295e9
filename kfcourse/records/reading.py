"""From a file to a filter: measurements, their times and the inputs of a model, read from CSV.

::

    time,y1,y2,turn
    0.00,12.1,,0.02
    0.13,,40.7,
    0.41,12.9,41.3,0.03

A row is a step, a column is found by its name.  An empty cell of a measurement is missing, so sensors of different rates share
a file; where it is the only column, so is an empty line.  An input holds until the next one is given.  The interval to the next
row is the input `dt`, if the model has one.
"""

from __future__ import annotations

import csv
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kfcourse.errors import expect
from kfcourse.laws import Array
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import shown

LARGEST = 100_000_000  # bytes; a million rows.  /dev/zero never ends
TIMES = ("time", "t")  # names of the column of times
INTERVAL = "dt"
UNEVEN = 0.01  # intervals that differ by more than this part of their median are not of one length
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


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


def read_measurements(path: str | Path, model: Model, columns: Mapping[str, str] | None = None) -> Record:
    """Measurements and inputs of a model from a CSV file.

    Parameters
    ----------
    path : path
        UTF-8, a line of names and a line for each step.  Cells are separated by commas, tabs, or semicolons; between semicolons
        decimals may have a comma.
    model : Model
        A column for each of `model.measured` (y, or y1, y2, ...) and for each input; a column `time` or `t`, in the unit of the
        model's formulas.  Of the inputs only the names count, `inputs={"dt": [1], "u": [0]}`: the record has their values.
        The step k lasts from row k to row k + 1, so dt_k = t_{k+1} - t_k, and u_k acts in it; the last has the length of the one
        before.  Without times every step has the model's `interval`.
    columns : dict, optional
        The model's name to the column's, {"y1": "east", "time": "time_s"}, where they differ.

    Raises
    ------
    RecordError
        The file cannot be read, has no column of such a name or no rows, something in a cell that is no finite number, lines of
        different lengths, times that go back, no first value of an input.

    Warns
    -----
    RecordWarning
        The intervals are unequal, and the model's formulas know neither dt nor t.
    """
    expect(model, Model, "read_measurements")
    source = _Source(str(path))
    lines = _lines(source, Path(path))
    names, delimiter = _header(source, lines)
    places = _places(source, names, model, dict(columns or {}))
    rows = list(_rows(source, lines, names, places, delimiter))
    if not rows:
        raise RecordError(f"{path} has a line of names and no rows below it: there is nothing to estimate from")
    table = dict(zip(places, np.array([cells for _, cells in rows]).T, strict=True))
    numbers = [number for number, _ in rows]
    for name in model.measured:
        if np.isnan(table[name]).all():
            raise RecordError(f"{path}: the column {names[places[name]]} has no number at all; leave it out of the model")
    inputs = {name: _held(source, names[place], table[name]) for name, place in places.items() if name in model.known.inputs}
    times = _times(source, {name: names[place] for name, place in places.items()}, table, numbers, model, inputs)
    used = {symbol.name for symbol in model.known.symbols}
    if "t" in used and "t" not in model.known.inputs:
        inputs["t"] = times
    if INTERVAL in model.known.inputs and INTERVAL not in inputs:
        inputs[INTERVAL] = intervals(times, float(model.known.interval))
    elif not used & {INTERVAL, "t"} and _uneven(times):
        steps = np.diff(times)
        warnings.warn(
            f"{path}: the intervals are {steps.min():g} to {steps.max():g}, but the model takes every step alike: write dt into "
            "its formulas, with inputs = { dt = [1] }",
            RecordWarning,
            stacklevel=2,
        )
    return Record(times, np.stack([table[name] for name in model.measured], axis=-1)[:, None], model.with_inputs(inputs))


def intervals(times: Array, single: float = 1.0) -> Array:
    """dt_k = t_{k+1} - t_k, (steps,); the last is as long as the one before, a single one as given."""
    steps = np.diff(times)
    return np.append(steps, steps[-1] if len(steps) else single)


class _Source(NamedTuple):
    """A file, for messages."""

    name: str

    def fault(self, line: int, column: str, problem: str) -> RecordError:
        return RecordError(f"{self.name}, line {line}, column {column}: {problem}")


def _lines(source: _Source, path: Path) -> Iterator[tuple[int, str]]:
    """Number and text of each line, without the blank ones at either end."""
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST + 1)
    except FileNotFoundError:
        raise RecordError(f"no file of measurements at {source.name}; check the path") from None
    except OSError as error:
        raise RecordError(f"{source.name} cannot be read: {error.strerror or error}") from None
    if len(content) > LARGEST:
        raise RecordError(
            f"{source.name} has more than {LARGEST:,} bytes: cut it into parts, or keep the columns that are needed"
        )
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise RecordError(f"{source.name} is UTF-16; save it as CSV in UTF-8")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise RecordError(f"{source.name}, line {line}: a byte that is not UTF-8; save the file as CSV in UTF-8") from None
    # A quoted cell must not swallow the lines below it: rows are lines.
    lines = list(enumerate(re.split("\r\n|\r|\n", text), start=1))
    told = [place for place, (_, line) in enumerate(lines) if line.strip()]
    return iter(lines[told[0] : told[-1] + 1] if told else [])


def _header(source: _Source, lines: Iterator[tuple[int, str]]) -> tuple[list[str], str]:
    """Names of the columns, and what separates them; the rest of the lines is left."""
    number, line = next(lines, (1, ""))
    if not line:
        raise RecordError(f"{source.name} is empty; its first line names the columns, such as time,y")
    delimiter = next((one for one in (";", "\t") if one in line), ",")
    names = [name.strip() for name in _cells(source, number, line, delimiter)]
    if twice := sorted({name for name in names if names.count(name) > 1 and name}):
        raise RecordError(f"{source.name}, line {number}: two columns are named {shown(twice[0])}; give each a name of its own")
    return names, delimiter


def _cells(source: _Source, number: int, line: str, delimiter: str) -> list[str]:
    try:
        return next(csv.reader(StringIO(line), delimiter=delimiter, strict=True), [""])
    except csv.Error as error:
        raise RecordError(f"{source.name}, line {number}: {error}; a quoted cell must end in its line") from None


def _places(source: _Source, names: Sequence[str], model: Model, columns: dict[str, str]) -> dict[str, int]:
    """Where the columns stand that the model needs, by the model's names."""
    wanted = [*model.measured, *(name for name in model.known.inputs if name != INTERVAL)]
    known = {*wanted, INTERVAL, "time"}
    if unknown := sorted(set(columns) - known):
        raise RecordError(f"columns are given for {', '.join(unknown)}; the model needs {', '.join(sorted(known))}")
    clock = next((name for name in (columns.get("time"), *TIMES) if name in names and name not in wanted), None)
    if "time" in columns and clock != columns["time"]:
        raise RecordError(f"{source.name} has no column {shown(columns['time'])}; it has {_listed(names)}")
    if clock is not None:
        columns["time"] = clock
        wanted.insert(0, "time")
    elif INTERVAL in model.known.inputs:
        wanted.insert(0, INTERVAL)
    places = {}
    for name in wanted:
        column = columns.get(name, name)
        if column not in names:
            remedy = "; give it a column time" if name == INTERVAL else ""
            raise RecordError(
                f"{source.name} has no column {shown(column)}, which the model needs{remedy}; it has {_listed(names)}: rename "
                f'one, or say which it is, as in columns={{"{name}": "..."}} or --column {name}=...'
            )
        places[name] = names.index(column)
    return places


def _listed(names: Sequence[str]) -> str:
    return ", ".join(map(shown, names[:20])) + (f", ... ({len(names)} in all)" if len(names) > 20 else "")


def _rows(
    source: _Source, lines: Iterator[tuple[int, str]], names: Sequence[str], places: Mapping[str, int], delimiter: str
) -> Iterator[tuple[int, list[float]]]:
    """Number of the line, and the numbers in the places wanted."""
    comma = delimiter == ";"
    for number, line in lines:
        if len(names) > 1 and not line.strip():
            continue  # of one column it is a row: a measurement that is missing
        cells = _cells(source, number, line, delimiter)
        if len(cells) != len(names):
            raise RecordError(
                f"{source.name}, line {number}: {len(cells)} cells, but the first line names {len(names)} columns"
                + ("; where a comma separates decimals, separate cells by semicolons" if delimiter == "," else "")
            )
        yield number, [_number(source, number, names[place], cells[place], comma) for place in places.values()]


def _number(source: _Source, line: int, column: str, cell: str, comma: bool) -> float:
    """The number in a cell; NaN if it is empty."""
    text = cell.strip()
    if not text or text.lower() == "nan":
        return np.nan
    if comma and text.count(",") == 1 and "." not in text:
        text = text.replace(",", ".")
    if not NUMBER.fullmatch(text):
        if "," in text:
            remedy = "; if the comma separates decimals, separate cells by semicolons"
        else:
            remedy = "; leave the cell empty if it is missing"
        raise source.fault(line, column, f"expected a number or nothing, got {shown(cell)}{remedy}")
    value = float(text)
    if not np.isfinite(value):
        raise source.fault(line, column, f"{shown(cell)} is beyond all numbers of double precision")
    return value


def _held(source: _Source, column: str, values: Array) -> Array:
    """An input with its gaps filled by the value before."""
    given = ~np.isnan(values)
    if not given[0]:
        raise RecordError(f"{source.name}, first row, column {column}: an input needs a value from the first row on")
    return values[np.maximum.accumulate(np.where(given, np.arange(len(values)), 0))]


def _times(
    source: _Source,
    named: Mapping[str, str],
    table: Mapping[str, Array],
    numbers: Sequence[int],
    model: Model,
    inputs: Mapping[str, Array],
) -> Array:
    """Times of the rows, from their column, from intervals, or by the model's."""
    if "time" in table:
        times = table["time"]
        if (empty := np.isnan(times)).any():
            raise source.fault(numbers[int(np.argmax(empty))], named["time"], "empty; every row needs its time")
        if (back := np.diff(times) < 0).any():
            k = int(np.argmax(back)) + 1
            problem = f"{times[k]:.10g} comes after {times[k - 1]:.10g}; sort the rows by time"
            raise source.fault(numbers[k], named["time"], problem)
        return times
    if INTERVAL in inputs:
        steps = inputs[INTERVAL]
        if (steps < 0).any():
            raise source.fault(numbers[int(np.argmax(steps < 0))], named[INTERVAL], "an interval must not be negative")
        return np.concatenate([[0.0], np.cumsum(steps[:-1])])
    return float(model.known.interval) * np.arange(len(numbers))


def _uneven(times: Array) -> bool:
    steps = np.diff(times)
    return len(steps) > 1 and bool(np.ptp(steps) > UNEVEN * np.median(steps))
