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
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from kfcourse.errors import expect
from kfcourse.laws import Array
from kfcourse.symbolic.angular import warn_of_degrees
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import shown

LARGEST = 100_000_000  # bytes; a million rows.  /dev/zero never ends
TIMES = ("time", "t")  # names of the column of times
INTERVAL = "dt"
UNEVEN = 0.01  # intervals that differ by more than this part of their median are not of one length
HOUR = 3600.0  # s: by so much clocks are set back in autumn
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
DATE = re.compile(r"\d{4}-\d\d?-\d\d?|\d+[:/.]\d+[:/.]\d+|\d\d?:\d\d")


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
    names, cells, lines, comma = _table(str(path), _text(path))
    named = _columns(str(path), names, model, columns or {})
    places = {name: names.index(column) for name, column in named.items()}
    _refuse_units(str(path), [cells[0][i] for i in places.values()], lines[0])
    table = {
        name: _numbers(str(path), names[i], [row[i] for row in cells], lines, comma)
        for name, i in places.items()
    }
    for name in model.measured:
        if np.isnan(table[name]).all():
            raise RecordError(
                f"{path}: the column {named[name]} has no number at all; leave it out of the model"
            )
    inputs = {
        name: _held(str(path), named[name], table[name])
        for name in model.known.inputs
        if name in table
    }
    times = _times(str(path), named, table, lines, float(model.known.interval))
    used = {symbol.name for symbol in model.known.symbols}
    if "t" in used - set(model.known.inputs):
        inputs["t"] = times
    if INTERVAL in model.known.inputs:
        inputs.setdefault(INTERVAL, intervals(times, float(model.known.interval)))
    elif "t" not in used and _uneven(times):
        steps = np.diff(times)
        warnings.warn(
            f"{path}: the intervals are {steps.min():g} to {steps.max():g}, but the model takes "
            f"every step alike: write dt into "
            "its formulas, with inputs = { dt = [1] }",
            RecordWarning,
            stacklevel=2,
        )
    y = np.stack([table[name] for name in model.measured], axis=-1)[:, None]
    warn_of_degrees(f"{path}: a measurement", y, model.measured, model.angles.y)
    return Record(times, y, model.with_inputs(inputs))


def intervals(times: Array, single: float = 1.0) -> Array:
    """dt_k = t_{k+1} - t_k, (steps,); the last is as long as the one before, a single one as
    given."""
    steps = np.diff(times)
    return np.append(steps, steps[-1] if len(steps) else single)


def _text(path: str | Path) -> str:
    try:
        with Path(path).open("rb") as file:
            content = file.read(LARGEST + 1)
    except FileNotFoundError:
        raise RecordError(f"no file of measurements at {path}; check the path") from None
    except OSError as error:
        raise RecordError(f"{path} cannot be read: {error.strerror or error}") from None
    if len(content) > LARGEST:
        raise RecordError(
            f"{path} has more than {LARGEST:,} bytes: cut it into parts, or keep the columns that "
            f"are needed"
        )
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise RecordError(f"{path} is UTF-16; save it as CSV in UTF-8")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise RecordError(
            f"{path}, line {line}: a byte that is not UTF-8; save the file as CSV in UTF-8"
        ) from None


def _table(name: str, text: str) -> tuple[list[str], list[list[str]], list[int], bool]:
    """Names of the columns, cells of each row, numbers of the rows' lines, and whether decimals
    have commas."""
    lines = re.split("\r\n|\r|\n", text.rstrip())
    delimiter = next((sign for sign in ";\t" if sign in text.lstrip().partition("\n")[0]), ",")
    names, rows, numbers, before = list[str](), list[list[str]](), list[int](), 0
    reader = csv.reader(lines, delimiter=delimiter, strict=True)
    try:
        for row in tqdm(reader, desc=name, total=len(lines), unit="row", disable=None, delay=2):
            # rows are lines: a cell must not swallow those below it
            if reader.line_num > before + 1:
                raise csv.Error("a cell of several lines")
            before = reader.line_num
            if not any(map(str.strip, row)) and len(row) < 2:
                if len(names) != 1:
                    continue
                row = [""]  # of one column an empty line is a row: a measurement that is missing
            if not names:
                names = _names(f"{name}, line {before}", row)
                continue
            if len(row) != len(names):
                comma = (
                    "; where a comma separates decimals, separate cells by semicolons"
                    if delimiter == ","
                    else ""
                )
                raise RecordError(
                    f"{name}, line {before}: {len(row)} cells, but the first line names "
                    f"{len(names)} columns{comma}"
                )
            rows.append(row)
            numbers.append(before)
    except csv.Error as error:
        raise RecordError(
            f"{name}, line {before + 1}: {error}; a quoted cell must end in its line"
        ) from None
    if not names:
        raise RecordError(f"{name} is empty; its first line names the columns, such as time,y")
    if not rows:
        raise RecordError(
            f"{name} has a line of names and no rows below it: there is nothing to estimate from"
        )
    if len(names) == 1 and min(len(line.split()) for line in (names[0], rows[0][0])) > 1:
        raise RecordError(
            f"{name} has one column, {shown(names[0])}, as spaces do not separate cells: "
            "write commas, tabs or semicolons between them"
        )
    return names, rows, numbers, delimiter == ";"


def _names(place: str, row: Sequence[str]) -> list[str]:
    """Names of the columns."""
    names = [cell.strip() for cell in row]
    if names[0].startswith(("#", "%", "//")) and len(names[0]) > 2:
        raise RecordError(
            f"{place}: {shown(names[0])} is a comment, but the first line must name the columns: "
            f"delete what stands above "
            'the names, or before them (numpy.savetxt: comments="")'
        )
    if twice := sorted({column for column in names if column and names.count(column) > 1}):
        raise RecordError(
            f"{place}: two columns are named {shown(twice[0])}; give each a name of its own"
        )
    return names


def _columns(
    path: str, names: Sequence[str], model: Model, given: Mapping[str, str]
) -> dict[str, str]:
    """The column of each thing that the model needs, by the model's names."""
    wanted = [*model.measured, *(name for name in model.known.inputs if name != INTERVAL)]
    if unknown := sorted(set(given) - {*wanted, INTERVAL, "time"}):
        known = ", ".join(sorted({*wanted, INTERVAL, "time"}))
        raise RecordError(f"columns are given for {', '.join(unknown)}; the model needs {known}")
    named = {name: given.get(name, name) for name in wanted}
    clock = given.get("time") or next(
        (name for name in TIMES if name in names and name not in wanted), None
    )
    interval, needed = given.get(INTERVAL, INTERVAL), INTERVAL in model.known.inputs
    if clock is not None:
        named["time"] = clock
    elif needed and interval in names:
        named[INTERVAL] = interval
    elif similar := _similar("time", set(names) - {*named.values()}):
        remedy = f"say so: columns={{'time': {similar!r}}}, or --column time={similar}"
        if needed or "t" in {symbol.name for symbol in model.known.symbols}:
            raise RecordError(
                f"{path} has no column time, which the model needs; if {shown(similar)} is it, "
                f"{remedy}"
            )
        message = f"{path}: the column {shown(similar)} is not used; if it has the times, {remedy}"
        warnings.warn(message, RecordWarning, stacklevel=3)
    elif needed:
        raise RecordError(f"{path} has no column {shown(interval)}{_what_may_be(INTERVAL, names)}")
    for name, column in named.items():
        if column not in names:
            raise RecordError(f"{path} has no column {shown(column)}{_what_may_be(name, names)}")
    return named


def _key(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.casefold())


def _similar(wanted: str, names: set[str]) -> str | None:
    """The column that may be the one wanted, in other letters or with a unit."""
    short = {"t", "ts", "tsec", "date"} if wanted == "time" else set[str]()
    keys = {name: _key(name) for name in sorted(names)}
    return next(
        (name for name, key in keys.items() if key in short or key.startswith(_key(wanted))), None
    )


def _what_may_be(name: str, names: Sequence[str]) -> str:
    """What a message adds where a column that the model needs is not there."""
    listed = ", ".join(map(shown, names[:20]))
    listed += f", ... ({len(names)} in all)" if len(names) > 20 else ""
    similar = _similar(name, set(names))
    remedy = (
        f'rename one, or say which it is, as in columns={{"{name}": "..."}} or --column {name}=...'
    )
    if similar:
        remedy = (
            f'if {shown(similar)} is it, say so: columns={{"{name}": "{similar}"}}, or '
            f"--column {name}={similar}"
        )
    needed = "; give it a column time" if name == INTERVAL else ""
    return f", which the model needs{needed}; it has {listed}: {remedy}"


def _refuse_units(name: str, cells: Sequence[str], line: int) -> None:
    """RecordError for a first row of words: units, or more names."""
    words = [cell.strip() for cell in cells if cell.strip() and cell.strip().lower() != "nan"]
    if words and not any(re.search(r"\d", word) for word in words) and len(words) == len(cells):
        raise RecordError(
            f"{name}, line {line}: {shown(', '.join(words))} and no number; if these are units, "
            f"delete the "
            "line: measurements begin below the names"
        )


def _numbers(
    name: str, column: str, cells: Sequence[str], lines: Sequence[int], comma: bool
) -> Array:
    """The numbers of a column; NaN where it is empty."""
    values = np.full(len(cells), np.nan)
    for k, cell in enumerate(cells):
        text = cell.strip()
        if not text or text.lower() == "nan":
            continue
        if comma and text.count(",") == 1 and "." not in text:
            text = text.replace(",", ".")
        if not NUMBER.fullmatch(text):
            fault = f"expected a number or nothing, got {shown(cell)}; {_cause(text)}"
        elif not np.isfinite(value := float(text)):
            fault = f"{shown(cell)} is beyond all numbers of double precision"
        else:
            values[k] = value
            continue
        raise RecordError(f"{name}, line {lines[k]}, column {column}: {fault}")
    return values


def _cause(text: str) -> str:
    """Why a cell may be no number, and what to do."""
    if DATE.match(text):
        return (
            "a date or a clock's time: write seconds, such as "
            "datetime.fromisoformat(...).timestamp() gives, "
            "of UTC, which has no hour twice"
        )
    if "\u2212" in text:
        return "its sign is a typographic minus (U+2212): write the hyphen, -"
    if "," in text:
        return "if the comma separates decimals, separate cells by semicolons"
    return "leave the cell empty if it is missing"


def _held(name: str, column: str, values: Array) -> Array:
    """An input with its gaps filled by the value before."""
    if np.isnan(values[0]):
        raise RecordError(
            f"{name}, first row, column {column}: an input needs a value from the first row on"
        )
    return values[np.maximum.accumulate(np.where(np.isnan(values), 0, np.arange(len(values))))]


def _times(
    name: str,
    named: Mapping[str, str],
    table: Mapping[str, Array],
    lines: Sequence[int],
    interval: float,
) -> Array:
    """Times of the rows, from their column, from that of intervals, or by the model's; RecordError
    if they go back."""
    if "time" not in table:
        steps = table.get(INTERVAL, np.full(len(lines), interval))
        if (steps < 0).any():
            place = f"{name}, line {lines[int(np.argmax(steps < 0))]}, column {named[INTERVAL]}"
            raise RecordError(f"{place}: an interval must not be negative")
        return np.concatenate([[0.0], np.cumsum(_held(name, INTERVAL, steps)[:-1])])
    times, column = table["time"], named["time"]
    if (empty := np.isnan(times)).any():
        raise RecordError(
            f"{name}, line {lines[int(np.argmax(empty))]}, column {column}: empty; every row "
            f"needs its time"
        )
    steps = np.diff(times)
    if not (back := steps < 0).any():
        return times
    k = int(np.argmax(back))
    remedy = "sort the rows by time"
    if back.sum() == 1 and (times[k + 1 :] <= times[k]).sum() > 1:  # not one row in a wrong place
        usual = float(np.median(steps))
        hour = " of daylight saving" if abs(steps[k] + HOUR - usual) <= usual else ""
        remedy = (
            f"the clock was set back once, here: an hour{hour} that is there twice, or a second "
            f"record? Do not sort, "
            "which would interleave the two: write times that only grow, such as UTC"
        )
    place = f"{name}, line {lines[k + 1]}, column {column}"
    raise RecordError(f"{place}: {times[k + 1]:.16g} comes after {times[k]:.16g}; {remedy}")


def _uneven(times: Array) -> bool:
    steps = np.diff(times)
    return len(steps) > 1 and bool(np.ptp(steps) > UNEVEN * np.median(steps))
