"""From a file to a filter: what is read is what stands there, and what cannot be used is named by
line and column."""

import re
import warnings

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from kfcourse import Model, ModelError, read_measurements
from kfcourse.records.reading import RecordError, RecordWarning

WALK = Model.define(
    ["x + dt*u", "u + a*dt + sqrt(q*dt)*v"],
    ["x + w1", "u + w2"],
    {"q": 0.3},
    symbols={"x": ["x", "u"]},
    inputs={"dt": [1], "a": [0]},
)
PLAIN = Model.define("0.9*x + v", "x + w")
GOOD = "time,y1,y2,a\n0,1.5,,2\n0.5,,-3e0,\n2,1,nan,4\n2,7,8,5\n"


@pytest.fixture
def read(tmp_path):
    def of(content, model=WALK, **options):
        path = tmp_path / "mine.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_measurements(path, model, **options)

    return of


def expected(record):
    assert_array_equal(record.times, [0, 0.5, 2, 2])
    assert_array_equal(record.y[:, 0], [[1.5, np.nan], [np.nan, -3], [1, np.nan], [7, 8]])
    assert record.model.known.inputs == {"dt": (0.5, 1.5, 0.0, 0.0), "a": (2.0, 2.0, 4.0, 5.0)}


@pytest.mark.parametrize(
    "content",
    [
        GOOD,
        "\ufeff" + GOOD,
        GOOD.replace("\n", "\r\n"),
        GOOD.replace("\n", "\r"),
        GOOD.replace(",", "\t"),
        GOOD.replace(",", ";").replace(".", ","),
        GOOD.replace(",", " ; "),
        GOOD.replace("time", "t"),
        GOOD.replace("1.5", '"1.5"').replace("\n2,1", "\n\n2,1"),
        "other,a,y2,time,y1\nno,2,,0,1.5\nmatter,,-3,.5,\nwhat,4,,2,1.\n=1+1,5,8,2,7\n",
    ],
    ids=[
        "plain",
        "bom",
        "crlf",
        "cr",
        "tabs",
        "decimal commas",
        "spaces",
        "t",
        "quotes, blank line",
        "other columns",
    ],
)
def test_the_same_record_in_many_forms(read, content):
    expected(read(content))


def test_columns_may_have_other_names(read):
    content = GOOD.replace("time,y1,y2,a", "seconds,east,y2,push")
    expected(read(content, columns={"time": "seconds", "y1": "east", "a": "push"}))
    with pytest.raises(RecordError, match=r"no column 'north'.*--column y1=\.\.\."):
        read(content, columns={"time": "seconds", "y1": "north", "a": "push"})
    with pytest.raises(
        RecordError, match="columns are given for b; the model needs a, time, y1, y2"
    ):
        read(content, columns={"b": "push"})
    with pytest.raises(RecordError, match="no column 'minutes'"):
        read(GOOD, columns={"time": "minutes"})


def test_the_time_in_formulas_is_the_recorded_one(read):
    model = Model.define("x + sin(t)*v", "x + w")
    assert read("time,y\n5,1\n7.5,1\n", model).model.known.at(1) == [7.5]
    assert read("y\n1\n1\n", model).model.known.at(1) == [1.0]


def test_uneven_steps_that_the_model_does_not_know_of(read):
    with pytest.warns(RecordWarning, match=r"intervals are 1 to 4.*dt = \[1\]"):
        read("time,y\n0,1\n1,1\n5,1\n", PLAIN)
    # a clock's jitter is no warning
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(read("time,y\n0,1\n1,1\n2.008,1\n", PLAIN).y) == 3


def test_a_column_that_may_be_the_times_is_named(read):
    """A model that takes every step alike needs no times: a warning."""
    with pytest.warns(
        RecordWarning,
        match="no column 'time'; it has .* if 'Time' is it.*--column time=Time; every step",
    ):
        assert len(read("Time,y\n0,1\n1,1\n", PLAIN).y) == 2
    with pytest.warns(RecordWarning, match="intervals are 1 to 4"):
        read("Time,y\n0,1\n1,1\n5,1\n", PLAIN, columns={"time": "Time"})


def test_of_a_single_column_an_empty_line_is_a_missing_measurement(read):
    """But not those before the names or after the last row, nor of several columns, where a missing
    row has its commas."""
    for end in ("", "\n", "\n\n\n"):
        assert_array_equal(read(f"\n\ny\n1\n\n  \n4{end}", PLAIN).y.ravel(), [1, np.nan, np.nan, 4])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "is empty"),
        ("time,y1,y2,a\n", "no rows"),
        ("time,y1,a\n0,1,2\n", "no column 'y2'"),
        ("time,y1,y2,a,y1\n0,1,2,3,4\n", "two columns are named 'y1'"),
        (GOOD.replace("-3e0", "three"), "line 3, column y2: expected a number or nothing, got "
"'three'"),
        (GOOD.replace("-3e0", "1e999"), "line 3, column y2: '1e999' is beyond"),
        (GOOD.replace("-3e0", '"1,5"'), "line 3, column y2:.*separate cells by semicolons"),
        (GOOD.replace("-3e0", "1,5"), "line 3: 5 cells, but the first line names 4 columns; .* "
"if commas separate decimals"),
        (GOOD.replace("0.5,,", "0.5,"), "line 3: 3 cells"),
        (GOOD.replace("0.5,", ","), "line 3, column time: empty"),
        (GOOD.replace("\n2,1", "\n0.25,1"), "line 4, column time: 0.25 comes after 0.5; sort .*such "
"as UTC"),
        (GOOD.replace("0.5,", "2014-03-26,"), "line 3, column time: expected a number"),
        (GOOD.replace(",2\n", ",\n"), "column a: an input needs a value from the first row"),
        (GOOD.replace("1.5", '"1.5'), "line 2.*a quoted cell must end in its line"),
        ("time,y1,y2,a\n0,1,,3\n1,2,,3\n", "column y2 has no number at all"),
        ("dt,y1,y2,a\n1,1,2,3\n", "no column 'time'; .* the model needs the times"),
        (GOOD.encode("utf-16"), r"line 1: a byte that is not UTF-8 \(perhaps UTF-16"),
        (GOOD.replace("-3e0", "é").encode("latin-1"), "line 3: a byte that is not UTF-8"),
        # what people bring
        (GOOD.replace("time", "Time"), "no column 'time'; it has .* if 'Time' is it, .*"
"--column time=Time, and the model needs the times"),
        (GOOD.replace("y2", "Y2 [m]"), r"no column 'y2'.*if 'Y2 \[m\]' is it, say so"),
        (GOOD.replace("0.5,", "2014-03-26T10:00:00Z,"), "line 3, column time: .*a date or a "
"clock's time: write seconds"),
        (GOOD.replace("-3e0", "\u22123"), r"line 3, column y2: .*typographic minus \(U\+2212\)"),
        ("time;y1;y2;a\n0;1,5;1.234,5;1\n", r"column y2: .* got '1\.234,5'; a point and a comma"),
        (GOOD.replace("a\n", "a\ns,m,m,N\n"), "line 2, column y1: .* got 'm'; if this is a line of "
"units, delete it"),
        (GOOD.replace(",", " "), "it has 'time y1 y2 a'; commas, tabs or semicolons separate"),
        ("# recorded by me\n" + GOOD, "line 2: 4 cells, .*delete what stands above the names"),
        ("# " + GOOD, "no column 'time'; it has '# time', 'y1'"),
        ("time,y1,y2,a\n1484649904.25,1,2,3\n1484649904.2,1,2,3\n", "1484649904.2 comes after "
"1484649904.25"),
    ],
)  # fmt: skip
def test_a_bad_file_is_refused_with_its_place(read, content, message):
    with pytest.raises(RecordError, match=message) as refused:
        read(content)
    assert re.search(r"mine\.csv", str(refused.value)) and len(str(refused.value)) < 500


def test_what_is_no_file(tmp_path):
    for path, why in ((tmp_path / "missing.csv", "No such file"), (tmp_path, "Is a directory")):
        with pytest.raises(RecordError, match=f"{path} cannot be read: {why}"):
            read_measurements(path, WALK)


def test_inputs_of_a_model_are_replaced_by_name():
    assert WALK.with_inputs({"a": [1.0, 2.0]}).known.inputs == {"dt": (1.0,), "a": (1.0, 2.0)}
    with pytest.raises(ModelError, match="no input b; it has dt, a"):
        WALK.with_inputs({"b": [1.0]})
    with pytest.raises(ModelError, match="finite"):
        WALK.with_inputs({"a": [np.nan]})


def test_an_input_holds_until_the_next_one(read):
    content = "time,y1,y2,a\n0,1,2,3\n1,1,2,4\n2,1,2,\n3,1,2,5\n4,1,2,\n"
    for record in (read(content), read(content.replace(",", "\t"))):
        assert record.model.known.inputs["a"] == (3.0, 4.0, 4.0, 5.0, 5.0)
