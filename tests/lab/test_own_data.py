"""`kfcourse estimate`: a file of measurements, a model, and what comes out; nothing
half-written."""

import csv
import re
from functools import partial

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.testing import assert_allclose, assert_array_equal

from kfcourse import Model, linearised, read_measurements, run, smooth
from kfcourse.filters import aof, gated
from kfcourse.lab import own_data
from kfcourse.lab.own_data import estimate_record, model_of
from kfcourse.records import estimate
from kfcourse.scenarios.irregular import irregular_track

MODELS = """
[variants.plane]
title = "a walk <b>in</b> the plane"
state = ["x + dt*u + dt*sqrt(q*dt)*v1/2", "z + dt*s + dt*sqrt(q*dt)*v2/2", "u + sqrt(q*dt)*v1", "s + sqrt(q*dt)*v2"]
meter = ["x + sqrt(r)*w1", "z + sqrt(r)*w2"]
symbols = { x = ["x", "z", "u", "s"] }
parameters = { q = 0.2, r = 4.0 }
inputs = { dt = [1] }
prior = { mean = [0, 0, 0, 0], variance = [100, 100, 200, 200] }

[variants.line]
state = "x + dt*v"
meter = "x + w"
inputs = { dt = [1] }

[variants.root]
state = "x + sqrt(u)*v"
meter = "x + w"
inputs = { u = [1] }
"""


def practitioner_s_track(seed):
    """300 unequal steps, 15 % missing, 5 % outliers: times, states, measurements."""
    track = irregular_track(seed)
    return track.time, track.x[:, 0], track.y[:, 0]


def written(path, times, y):
    cells = (
        ",".join("" if np.isnan(each) else f"{each:.6f}" for each in (t, *row))
        for t, row in zip(times, y, strict=True)
    )
    path.write_text(
        "\n".join(["time,y1,y2" if y.shape[1] == 2 else "time,y", *cells]), encoding="utf-8"
    )


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my.toml").write_text(MODELS, encoding="utf-8")
    (tmp_path / "line.csv").write_text("time,y\n0,1\n0.5,\n2,3\n2.5,300\n3,2\n", encoding="utf-8")
    return tmp_path


@pytest.fixture
def call(command, place):
    return partial(command, "estimate")


def numbers(path):
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name] or "nan") for row in rows]) for name in rows[0]}


def test_the_practitioner_s_track(place):
    """What the package's filter gives for the model typed in Python; smoothed it is better."""
    times, x, y = practitioner_s_track(2)
    written(place / "track.csv", times, y)
    variant = model_of(place / "my.toml", "plane")
    behind = estimate_record(place / "track.csv", variant, gate=0.999).examined
    record = read_measurements(place / "track.csv", variant.model)
    filter_ = gated(aof(linearised(record.model)), 0.999)
    assert_array_equal(behind.estimate.mean, run(filter_, record.y).mean)
    assert_array_equal(behind.smoothed.mean, smooth(filter_, record.y).mean)
    filtered, smoothed = (
        np.mean((law.mean[:, 0, :2] - x[:, :2]) ** 2) for law in (behind.estimate, behind.smoothed)
    )
    assert smoothed < 0.75**2 * filtered < 0.75**2 * 2.4**2 / 2


def test_a_long_curve_is_a_picture():
    ax = Figure().add_subplot()
    for size in (5000, 5001):
        ax.plot(np.zeros(size))
        own_data._labelled(ax, "time", "x")
        assert (ax.get_rasterization_zorder() == 3) == (size == 5001)


def test_the_command_writes_numbers_and_a_report(call, place):
    times, _, y = practitioner_s_track(3)
    written(place / "track.csv", times[:60], y[:60])
    call = partial(call, "track.csv --model my.toml --variant plane --out out")
    result = call("--gate 0.999")
    assert result.exit_code == 0, result.output
    assert (
        "60 rows, " in result.output
        and "The gate refused" in result.output
        and "Report: out/report.html" in result.output
    )
    analysis = estimate_record(
        place / "track.csv", model_of(place / "my.toml", "plane"), gate=0.999
    )
    table = numbers(place / "out" / "estimate.csv")
    assert len(table) == 1 + 4 * 4 + 2 * 2 + 2
    for name, column in (
        ("time", times[:60]),
        ("z", analysis.examined.estimate.mean[:, 0, 1]),
        ("u_smoothed_sd", np.sqrt(analysis.examined.smoothed.cov[:, 0, 2, 2])),
        ("y2_innovation", analysis.examined.innovations.value[:, 0, 1]),
        ("y1_innovation_sd", np.sqrt(analysis.examined.innovations.cov[:, 0, 0, 0])),
        ("weight", analysis.examined.weight[:, 0]),
        ("log_likelihood", analysis.examined.log_likelihood[:, 0]),
    ):
        # the file of measurements has six decimals
        assert_allclose(table[name], column, rtol=1e-6, atol=1e-6)
    html = (place / "out" / "report.html").read_text(encoding="utf-8")
    images = re.findall(r'<img src="([^"]+)" alt="([^"]+)"', html)
    assert len(images) == 4 + 2 * 2 and all((place / "out" / name).is_file() for name, _ in images)
    assert (
        "<math" in html and "<b>" not in html and "a walk &lt;b&gt;in&lt;/b&gt; the plane" in html
    )
    assert not re.search(r"""(src|href)\s*=\s*["']?\s*(https?:)?//""", html)
    for sentence in analysis.says():
        assert sentence.split(":")[0] in html


def test_times_keep_all_their_digits(no_figures, call, place):
    """Stamps of Unix have ten digits before the point."""
    stamps = [1484649904.25 + 0.5 * k for k in range(6)]
    rows = [f"{stamp},{1 + k % 2},{1e3 if k == 3 else 1}" for k, stamp in enumerate(stamps)]
    (place / "stamps.csv").write_text("\n".join(["time,y1,y2", *rows]))
    arguments = "stamps.csv --model my.toml --variant plane --gate 0.999 --out out"
    assert "refused 1 of 6 measurements: row 4." in call(arguments).output
    assert_array_equal(numbers(place / "out" / "estimate.csv")["time"], stamps)
    (place / "stamps.csv").write_text("\n".join(["time,y1,y2", *rows[:2], rows[0]]))
    assert "1484649904.25 comes after 1484649904.75" in call(arguments).output


def test_the_model_in_the_help_can_be_copied(no_figures, call, place):
    model = re.search(r"(\[variants.*?)\n\nOptions:", call("--help").output, re.DOTALL)[1]
    (place / "copied.toml").write_text(model)
    result = call("line.csv --model copied.toml --unknown q,r --positive q,r")
    assert result.exit_code == 0 and "Report: estimate-line/report.html" in result.output


def test_unknown_parameters_are_found_first(no_figures, call, place):
    times, _, y = practitioner_s_track(4)
    written(place / "line.csv", times[:40], y[:40, :1])
    (place / "mine.toml").write_text(
        '[variants.walk]\nstate = "x + sqrt(q*dt)*v"\nmeter = "x + sqrt(r)*w"\nparameters = { q = '
        "100, r = 100 }\n"
        "inputs = { dt = [1] }\nprior = { mean = 0, variance = 1e4 }\n"
    )
    result = call("line.csv --model mine.toml --unknown q,r --positive 'q, r'")
    assert result.exit_code == 0, result.output
    printed = re.findall(r"^(q|r) = (\S+) ±", result.output, re.MULTILINE)
    record = read_measurements(place / "line.csv", model_of(place / "mine.toml", None).model)
    likeliest = estimate(
        record.model, record.y, ["q", "r"], ["q", "r"], lambda model: aof(linearised(model))
    )
    assert [float(value) for _, value in printed] == pytest.approx(likeliest.value, rel=1e-3)
    unfit = call("line.csv --model mine.toml --unknown x")
    assert unfit.exit_code == 1 and "unknown must name parameters" in unfit.output


@pytest.mark.parametrize("structure", [*own_data.STRUCTURES])
def test_every_filter_of_the_option(place, structure):
    analysis = estimate_record(
        place / "line.csv", model_of(place / "my.toml", "line"), structure=structure
    )
    expected = estimate_record(place / "line.csv", model_of(place / "my.toml", "line"))
    # a linear model
    assert_allclose(analysis.examined.smoothed.mean, expected.examined.smoothed.mean, rtol=1e-9)
    assert analysis.record.model == Model.define(
        "x + dt*v", "x + w", inputs={"dt": [0.5, 1.5, 0.5, 0.5, 0.5]}
    )


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (
            "missing.csv --model my.toml --variant line",
            1,
            ["missing.csv cannot be read: No such file"],
        ),
        ("line.csv --model my.toml", 1, ["3 models; say which", "--variant plane"]),
        ("line.csv --model my.toml --variant plane", 1, ["no column 'y1'"]),
        ("line.csv --model my.toml --variant line --column y", 2, ["--column"]),
        ("bad.csv --model my.toml --variant line", 1, ["bad.csv, line 3, column y"]),
        (
            "wild.csv --model my.toml --variant line",
            1,
            ["wild.csv: row 2, time 1, cannot be judged", "--gate"],
        ),
        (
            "negative.csv --model my.toml --variant root",
            1,
            ["state's noise from step 1 to 2 has a negative variance, -1"],
        ),
        (
            "line.csv --model my.toml --variant line --out my.toml",
            1,
            ["cannot go to my.toml"],
        ),
    ],
)
def test_what_cannot_be_done_is_said_and_nothing_is_written(call, place, arguments, code, words):
    (place / "bad.csv").write_text("time,y\n0,1\n1,one\n")
    (place / "wild.csv").write_text("time,y\n0,1\n1,1e300\n2,1\n")
    (place / "negative.csv").write_text("time,y,u\n0,1,1\n1,1,-1\n2,1,1\n")
    before = sorted(place.iterdir())
    result = call(arguments)
    assert result.exit_code == code and isinstance(result.exception, SystemExit)
    assert "Traceback" not in result.output
    for word in words:
        assert word in result.output
    assert sorted(place.iterdir()) == before
