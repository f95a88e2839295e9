"""The command line, as a student uses it and misuses it."""

import json
import math
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from kfcourse import cli
from kfcourse.lab.short_names import FILTERS, LAB

QUICK = ("--runs", "400", "--steps", "4", "--exact-runs", "0")
EXAMPLE = """
[variants.53]
state = "c*x + e*x*v"
meter = "g*x + f*x**2*w"
parameters = { c = 0.9, e = 0.05, g = 1.0, f = 0.02 }

[variants.tan]
state = "0.9*x + 0.1*v"
meter = "tan(x) + 0.1*w"

[variants.diverging]
state = "2*x**3 + v"
meter = "x + w"

[variants."../elsewhere"]
state = "0.9*x + v"
meter = "x + w"
"""


@pytest.fixture
def call(tmp_path, monkeypatch):
    """Run a command in an empty folder; its result."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(EXAMPLE, encoding="utf-8")

    def invoke(*arguments):
        return CliRunner().invoke(cli.main, [str(argument) for argument in arguments])

    return invoke


@pytest.fixture
def no_computation(monkeypatch):
    def never(*_, **__):
        raise AssertionError("the computation began")

    monkeypatch.setattr(cli, "compare", never)


@pytest.fixture
def no_report(monkeypatch):
    """Drawing takes most of the time of a small run; for tests of the numbers only."""
    monkeypatch.setattr(cli, "write_report", lambda *_: [])


def refused(result, *words):
    """A single line says what is wrong, with an exit code, and no traceback."""
    assert result.exit_code == 1
    assert isinstance(result.exception, SystemExit)
    assert "Traceback" not in result.output
    (line,) = [line for line in result.output.splitlines() if line.startswith("Error: ")]
    for word in words:
        assert word in line
    return line


def snapshot(folder):
    return {path.relative_to(folder): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


# --- listing


@pytest.mark.quick
def test_variants_are_listed_with_titles_and_equations(call):
    result = call("variants")
    assert result.exit_code == 0
    assert re.search(r"^ +53  multiplicative noises", result.output, re.MULTILINE)
    assert "x' = c*x + e*v*x;  y = f*w*x**2 + g*x" in result.output
    assert len(re.findall(r"x' = ", result.output)) >= 12


def test_another_file_is_listed(call):
    result = call("variants", "--variants", "mine.toml")
    assert result.exit_code == 0
    assert re.findall(r"^ *(\S+)  no title", result.output, re.MULTILINE) == ["53", "tan", "diverging", "../elsewhere"]


@pytest.mark.parametrize("option", ["-h", "--help", "--version"])
def test_help_and_version(call, option):
    assert call(option).exit_code == 0
    assert call("lab", "--help").exit_code == 0


# --- the lab


def test_the_lab_of_variant_53(call, tmp_path):
    result = call("lab", "53", "--runs", 4000, "--steps", 12, "--exact-runs", 20, "--out", "report", "--json", "n.json")
    assert result.exit_code == 0, result.output
    assert "is more accurate than" in result.output
    data = json.loads((tmp_path / "n.json").read_text(encoding="utf-8"))
    names = {*LAB, "aof-exact"}
    for key in ("error_variance", "standard_error"):
        assert set(data[key]) == names
        for values in data[key].values():
            assert len(values) == 12
            assert all(isinstance(value, float) and math.isfinite(value) for value in values)
    assert all(error >= 0 for errors in data["standard_error"].values() for error in errors)
    for name in LAB:  # they are variances; all begin near the note's 11.9e-4 and fall a thousandfold in eleven steps
        assert all(value > 0 for value in data["error_variance"][name])
        assert abs(data["error_variance"][name][0] - 11.92e-4) <= 5 * data["standard_error"][name][0]
        assert data["error_variance"][name][11] < 1e-4
    html = (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    assert "<math" in html
    assert not re.search(r"""(src|href)\s*=\s*["']?\s*(https?:)?//""", html)
    images = re.findall(r'<img src="([^"]+)"', html)
    assert images
    for image in images:
        assert (tmp_path / "report" / image).is_file()
    assert (tmp_path / "report" / "report.tex").is_file()
    assert str(Path("report") / "report.html") in result.output
    assert "on 20 of 4000 trajectories" in result.output


def test_a_real_process_does_it_too(tmp_path):
    command = shutil.which("kfcourse", path=str(Path(sys.executable).parent))
    assert command, "the package is not installed beside this Python"
    lab = [command, "lab", "53", *QUICK, "--filters", "aof-gaussian,duof", "--json", "n.json"]
    done = subprocess.run(lab, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert "GAOF" in done.stdout
    assert "Traceback" not in done.stderr
    assert (tmp_path / "lab-53" / "report.html").is_file()
    wrong = subprocess.run([command, "lab", "999"], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert wrong.returncode == 1
    assert wrong.stdout == ""
    assert wrong.stderr.startswith("Error: no variant '999'")
    assert wrong.stderr.count("\n") == 1


@pytest.mark.filterwarnings("ignore:No artists with labels")  # the control relative to itself is not drawn
def test_without_exact_runs_the_exact_filter_is_left_out(call, tmp_path):
    assert call("lab", "53", *QUICK, "--json", "n.json").exit_code == 0
    data = json.loads((tmp_path / "n.json").read_text(encoding="utf-8"))
    assert set(data["error_variance"]) == set(LAB)
    assert data["exact_runs"] == 0
    assert call("lab", "53", *QUICK, "--filters", "duof,aof-exact,particle", "--json", "n.json").exit_code == 0
    assert set(json.loads((tmp_path / "n.json").read_text(encoding="utf-8"))["error_variance"]) == {"duof"}


def test_an_exact_filter_without_time_is_left_out_and_the_others_reported(call, tmp_path):
    options = ("--runs", "400", "--steps", "4", "--exact-runs", "400", "--exact-seconds", "0.001")
    result = call("lab", "53", *options, "--json", "n.json")
    assert result.exit_code == 0, result.output
    reason = "8 trajectories take more than 0.001 s"
    assert f"exact AOF left out: {reason}" in result.output
    data = json.loads((tmp_path / "n.json").read_text(encoding="utf-8"))
    assert set(data["error_variance"]) == set(LAB)
    assert data["exact_runs"] == 0
    assert data["left_out"] == {"aof-exact": reason}
    assert f"exact AOF left out: {reason}" in (tmp_path / "lab-53" / "report.html").read_text(encoding="utf-8")


@pytest.mark.quick
def test_filters_can_be_chosen(call, no_report, tmp_path):
    result = call("lab", "53", *QUICK, "--filters", "fos3-gaussian, duof ,aof-unscented", "--json", "n.json")
    assert result.exit_code == 0, result.output
    data = json.loads((tmp_path / "n.json").read_text(encoding="utf-8"))
    assert list(data["error_variance"]) == ["fos3-gaussian", "duof", "aof-unscented"]


def test_every_filter_can_be_chosen(call, no_report, tmp_path):
    result = call("lab", "53", "--runs", 200, "--steps", 3, "--exact-runs", 4, "--filters", ",".join(FILTERS), "--json", "n.json")
    assert result.exit_code == 0, result.output
    assert set(json.loads((tmp_path / "n.json").read_text(encoding="utf-8"))["error_variance"]) == set(FILTERS)


def test_the_issue_s_file_of_variants_works(call, no_report, tmp_path):
    assert call("lab", "53", *QUICK, "--variants", "mine.toml", "--json", "a.json", "--out", "a").exit_code == 0
    assert call("lab", "53", *QUICK, "--json", "b.json", "--out", "b").exit_code == 0
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


def test_a_vector_variant_works(call, tmp_path):
    result = call("lab", "20", "--runs", 400, "--steps", 4, "--json", "n.json")
    assert result.exit_code == 0, result.output
    data = json.loads((tmp_path / "n.json").read_text(encoding="utf-8"))
    assert set(data["error_variance"]) == {*LAB, "aof-exact"}  # by particles
    assert all(all(map(math.isfinite, values)) for values in data["above_bound"].values())
    assert all(len(values) == 4 for values in data["error_variance"].values())
    assert (tmp_path / "lab-20" / "report.html").is_file()


def test_a_variant_s_name_cannot_lead_out_of_the_folder(call, tmp_path):
    assert call("lab", "../elsewhere", *QUICK, "--variants", "mine.toml").exit_code == 0
    (folder,) = [path for path in tmp_path.iterdir() if path.is_dir()]
    assert (folder / "report.html").is_file()
    assert not list(tmp_path.parent.glob("elsewhere*"))


# --- reproducibility


def test_the_same_seed_gives_the_same_bytes_whatever_the_threads(call, no_report, tmp_path):
    common = ("lab", "53", "--runs", 2000, "--steps", 6, "--exact-runs", 40, "--out", "report")
    for name, options in {"a": (), "b": (), "c": ("--threads", 1), "d": ("--seed", 2)}.items():
        assert call(*common, *options, "--json", f"{name}.json").exit_code == 0
    a, b, c, d = ((tmp_path / f"{name}.json").read_bytes() for name in "abcd")
    assert a == b
    assert a == c
    assert a != d


def test_designing_on_the_same_ensemble_is_another_result(call, no_report, tmp_path):
    for name, options in {"a": (), "b": ("--same-ensemble",)}.items():
        assert call("lab", "53", *QUICK, *options, "--json", f"{name}.json").exit_code == 0
    a, b = (json.loads((tmp_path / f"{name}.json").read_text(encoding="utf-8"))["error_variance"] for name in "ab")
    assert a["aof-gaussian"] == b["aof-gaussian"]
    assert a["duof"] != b["duof"]


# --- mistakes


@pytest.mark.quick
def test_an_unknown_variant_names_the_known_ones(call, no_computation):
    refused(call("lab", "999", *QUICK), "'999'", "53, 1, 2")


def test_an_unknown_filter_names_the_known_ones(call, no_computation):
    refused(call("lab", "53", *QUICK, "--filters", "duof,ekf"), "'ekf'", *FILTERS)


@pytest.mark.parametrize("names", ["", ",", " , "])
def test_no_filter_is_an_error(call, names):
    refused(call("lab", "53", *QUICK, "--filters", names), "at least one filter")


def test_the_exact_filter_alone_asks_for_a_fast_one(call):
    refused(call("lab", "53", "--runs", 100, "--steps", 2, "--exact-runs", 4, "--filters", "aof-exact"), "aof-gaussian")


def test_a_model_without_closed_form_names_the_term_and_the_way_out(call, no_computation):
    line = refused(call("lab", "tan", *QUICK, "--variants", "mine.toml"), "tan(x)", "aof-gaussian")
    assert "unscented" in line or "gauss_hermite" in line


def test_the_way_out_is_open(call, no_report):
    names = "aof-unscented,aof-gauss-hermite,aof-linearised,duof"
    assert call("lab", "tan", *QUICK, "--variants", "mine.toml", "--filters", names).exit_code == 0


@pytest.mark.parametrize("arguments", [("variants",), ("lab", "53", *QUICK)])
def test_a_missing_or_bad_file_of_variants_is_named(call, no_computation, tmp_path, arguments):
    refused(call(*arguments, "--variants", "nothing.toml"), "nothing.toml")
    (tmp_path / "bad.toml").write_text("[variants.53", encoding="utf-8")
    refused(call(*arguments, "--variants", "bad.toml"), "bad.toml", "not valid TOML")
    refused(call(*arguments, "--variants", tmp_path), "cannot be read")


@pytest.mark.parametrize("out", ["mine.toml", "mine.toml/below"])
def test_a_bad_out_is_refused_before_the_computation(call, no_computation, out):
    refused(call("lab", "53", *QUICK, "--out", out), out, "--out")


@pytest.mark.parametrize("path", [".", "no/such/folder/n.json", "mine.toml/n.json"])
def test_a_bad_json_is_refused_before_the_computation(call, no_computation, path):
    refused(call("lab", "53", *QUICK, "--json", path), path, "--json")


@pytest.mark.quick
@pytest.mark.parametrize(
    "option",
    [
        ("--runs", "1"),
        ("--runs", "many"),
        ("--steps", "0"),
        ("--seed", "-1"),
        ("--threads", "0"),
        ("--exact-runs", "-1"),
        ("--exact-seconds", "0"),
    ],
)
def test_impossible_numbers_are_refused(call, no_computation, option):
    result = call("lab", "53", *option)
    assert result.exit_code == 2
    assert option[0] in result.output
    assert "Traceback" not in result.output


@pytest.mark.filterwarnings("ignore:.*encountered in:RuntimeWarning")  # the overflow is the point
def test_a_failing_run_leaves_the_report_that_was_there(call, tmp_path):
    assert call("lab", "53", *QUICK, "--out", "report", "--json", "n.json").exit_code == 0
    before = snapshot(tmp_path)
    failing = ("lab", "diverging", "--variants", "mine.toml", "--runs", 200, "--steps", 30, "--exact-runs", 0)
    line = refused(call(*failing, "--out", "report", "--json", "n.json"), "step")
    assert "infinite" in line
    assert snapshot(tmp_path) == before


def test_an_interrupt_leaves_the_report_that_was_there(call, tmp_path, monkeypatch):
    assert call("lab", "53", *QUICK, "--out", "report", "--json", "n.json").exit_code == 0
    before = snapshot(tmp_path)

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "compare", interrupted)
    result = call("lab", "53", *QUICK, "--out", "report", "--json", "n.json")
    assert result.exit_code == 130
    assert "Interrupted" in result.output
    assert snapshot(tmp_path) == before


def test_one_exact_run_has_no_standard_error_and_is_refused(call):
    refused(call("lab", "53", "--runs", 100, "--steps", 2, "--exact-runs", 1), "at least 2")
