"""The command line, as a student uses it and misuses it."""

import errno
import json
import math
import re
import time
from pathlib import Path

import pytest

from kfcourse import cli
from kfcourse.lab import FILTERS, LAB, report

QUICK = "--runs 100 --steps 3"
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
def call(command, tmp_path):
    (tmp_path / "mine.toml").write_text(EXAMPLE, encoding="utf-8")
    return command


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
    return {
        path.relative_to(folder): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


# --- listing


def test_variants_are_listed_with_titles_and_equations(call):
    result = call("variants")
    assert result.exit_code == 0
    assert re.search(r"^ +53  multiplicative noises", result.output, re.MULTILINE)
    assert "x' = c*x + e*x*v;  y = g*x + f*x**2*w" in result.output  # as the file has them
    assert len(re.findall(r"x' = ", result.output)) >= 12


def test_one_bad_variant_is_named_and_stops_no_other(call, no_report, tmp_path):
    (tmp_path / "mine.toml").write_text(
        EXAMPLE + '[variants.bad]\nstate = "0.9*x + q"\nmeter = "x + w"\n', encoding="utf-8"
    )
    listed = call("variants --variants mine.toml")
    assert (
        listed.exit_code == 1
        and "Error: variant bad in mine.toml: unknown symbol 'q'" in listed.output
    )
    assert len(re.findall(r"no title", listed.output)) == 4
    words = "variants --variants mine.toml --variant 53 --variant bad --check --runs 1000"
    checked = call(words)
    assert (
        checked.exit_code == 1
        and "Error: variant bad" in checked.output
        and re.search(r"(?m)^53 ", checked.output)
    )
    assert call("variants --variants mine.toml --variant 53").exit_code == 0
    assert call("lab 53 --variants mine.toml", QUICK).exit_code == 0
    refused(call("lab bad --variants mine.toml", QUICK), "variant bad in mine.toml", "'q'")


@pytest.mark.parametrize("option", ["-h", "--help", "--version"])
def test_help_and_version(call, option):
    assert call(option).exit_code == 0
    assert call("lab --help").exit_code == 0


# --- the lab


def test_the_lab_of_variant_53(call, no_figures, tmp_path):
    result = call("lab 53 --runs 1000 --steps 12 --scores --out report --json n.json")
    assert result.exit_code == 0, result.output
    assert "is more accurate than" in result.output
    scores = result.output.split("CRPS\n")[1].splitlines()
    assert len(scores) >= 8 and not [line for line in scores if line.endswith("–")]
    data = json.loads((tmp_path / "n.json").read_text(encoding="utf-8"))
    names = {*LAB, "aof-exact"}
    for key in ("error_variance", "standard_error"):
        assert set(data[key]) == names
        for values in data[key].values():
            assert len(values) == 12 and all(map(math.isfinite, values))
    assert (tmp_path / "report" / "report.html").is_file()  # what it holds: test_report
    assert str(Path("report") / "report.html") in result.output


def test_a_vector_variant_works(call, no_figures, tmp_path):
    """Without a bound, unless it is asked for: that is one of particles."""
    for options, names, bounded in (("", {*LAB}, False), ("--bound", {*LAB, "aof-exact"}, True)):
        result = call("lab 20", QUICK, options, "--json n.json")
        assert result.exit_code == 0, result.output
        data = json.loads((tmp_path / "n.json").read_text(encoding="utf-8"))
        assert set(data["error_variance"]) == names
        assert all(len(values) == 3 for values in data["error_variance"].values())
        assert ("No bound" in result.output) != bounded == ("above_bound" in data)
    assert all(all(map(math.isfinite, values)) for values in data["above_bound"].values())
    assert (tmp_path / "lab-20" / "report.html").is_file()


def test_a_variant_s_name_cannot_lead_out_of_the_folder(call, no_figures, tmp_path):
    assert call("lab ../elsewhere", QUICK, "--variants mine.toml").exit_code == 0
    (folder,) = [path for path in tmp_path.iterdir() if path.is_dir()]
    assert (folder / "report.html").is_file()
    assert not list(tmp_path.parent.glob("elsewhere*"))


# --- reproducibility


def test_the_same_seed_gives_the_same_bytes_whatever_the_threads_and_the_file(
    call, no_report, tmp_path
):
    common = "lab 53 --runs 200 --steps 6 --out report"
    numbers = []
    for options in ("", "", "--jobs 1", "--variants mine.toml", "--seed 2"):
        assert call(common, options, "--json n.json").exit_code == 0
        numbers.append((tmp_path / "n.json").read_bytes())
    *same, of_file, other = numbers
    assert len(set(same)) == 1 and other not in same
    own, shipped = json.loads(of_file), json.loads(same[0])
    assert own | {"model": shipped["model"]} == shipped  # its table may be written otherwise


# --- mistakes


def test_a_derivation_is_checked_line_by_line(call, tmp_path):
    file = tmp_path / "F.txt"
    right = "F = M[(g*x + f*x^2*w - h)^2]\n = g^2*M[(x-m)^2] + f^2*M[x^4]\n"
    for line, status, says in (
        ("g^2*d + f^2*(m^4 + 6*m^2*d + 3*d^2)", 0, "✓"),
        ("g^2*d + 3*f^2*d^2", 1, "✗ g^2*d + 3*f^2*d^2"),
        ("g^2*d + 3*f^2*k^2", 2, "unknown letter 'k'"),
    ):
        file.write_text(f"{right} = {line}\n", encoding="utf-8")
        done = call("check", file, "--variant 53")
        assert done.exit_code == status
        assert says in done.output
    file.write_text(f"{right}\n", encoding="utf-8-sig")  # as Windows' Notepad may save it
    assert call("check", file, "--variant 53").exit_code == 0


@pytest.mark.parametrize(
    ("words", "extra"),
    [("lab 53 --filters laof gaof", "gaof"), ("solutions --out . --sets f j", "j")],
)
def test_names_without_a_comma_are_told_how_they_are_separated(call, words, extra):
    done = call(words)
    assert (
        done.exit_code == 2 and f"extra argument ({extra}): separate names by commas" in done.output
    )


@pytest.mark.parametrize(
    ("content", "options", "says"),
    [
        (b"nonsense\n", "", "line 1: 'nonsense' has no =, and is no heading"),
        (b"", "", "has no chain of lines, such as"),
        (b"variant 53\n", "", "has no chain of lines, such as"),
        (b"\xd6\xff", "", "line 1: a byte that is not UTF-8"),
        (b"F = d\n", "--variant 999", "no variant '999'"),
        (None, "", "No such file"),
    ],
)
def test_what_is_no_derivation_is_said_in_a_sentence(call, tmp_path, content, options, says):
    file = tmp_path / "F.txt"
    if content is not None:
        file.write_bytes(content)
    done = call("check", file, options)
    assert done.exit_code == 2 and says in done.output and "Traceback" not in done.output


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("lab 999", ["'999'", "53, 1, 2"]),
        (
            "lab tan --variants mine.toml --filters aof-gaussian,fos-gaussian",
            ["tan(x)", "aof-gaussian", "unscented"],
        ),
        ("lab 53 --filters duof,ekf", ["'ekf'", *FILTERS]),
        *((f"lab 53 --filters '{names}'", ["at least one filter"]) for names in ("", ",", " , ")),
        *(
            (f"{command} --variants {file}", says)
            for command in ("variants", "lab 53")
            for file, says in (
                ("nothing.toml", ["nothing.toml"]),
                ("bad.toml", ["bad.toml", "not valid TOML"]),
                (".", ["cannot be read: Is a directory"]),
            )
        ),
        *(
            (f"lab 53 --out {out}", [out, "--out"])
            for out in ("mine.toml", "mine.toml/below", "/proc/below")
        ),
        *(
            (f"lab 53 --json {path}", [path, "--json"])
            for path in (".", "no/such/folder/n.json", "mine.toml/n.json")
        ),
    ],
)
def test_what_cannot_be_done_is_refused_before_the_computation(
    call, no_computation, tmp_path, words, says
):
    (tmp_path / "bad.toml").write_text("[variants.53", encoding="utf-8")
    refused(call(words), *says)


def test_filters_that_the_model_does_not_admit_are_left_out_with_the_reason(
    call, no_figures, tmp_path
):
    result = call("lab tan", QUICK, "--variants mine.toml --out r --json r.json")
    assert result.exit_code == 0
    for name in ("GAOF", "GFOS", "GMFOS"):
        assert (
            f"{name} left out: the package knows no closed-form Gaussian mean of the term tan(x)"
            in result.output
        )
    numbers = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert set(numbers["left_out"]) == {"aof-gaussian", "fos-gaussian", "mfos-gaussian"}
    assert set(numbers["error_variance"]) == {*LAB, "aof-exact"} - set(numbers["left_out"])
    page = (tmp_path / "r" / "report.html").read_text(encoding="utf-8")
    assert "<td>GAOF</td><td>no</td>" in page and "Which filters this model admits" in page
    assert "<td>UKF</td>" in page and "<td>GHKF</td>" in page
    assert call("lab 20", QUICK, "--filters duof,aof-exact --out s").exit_code == 0


def test_filters_lists_which_are_admissible(call):
    result = call("filters tan --variants mine.toml")
    assert result.exit_code == 0
    lines = {line.split()[0]: line for line in result.output.splitlines()}
    assert [name for name in lines if name in FILTERS] == list(FILTERS)
    assert re.search(r" no .*tan\(x\)", lines["aof-gaussian"])
    assert lines["duof"].endswith("yes")
    assert "aof-exact" in call("filters 53").output
    refused(call("filters none --variants mine.toml"), "no variant 'none'")


@pytest.mark.parametrize("option", ["--runs 1", "--steps 0", "--seed -1", "--jobs 0"])
def test_impossible_numbers_are_refused(call, no_computation, option):
    result = call("lab 53", option)
    assert result.exit_code == 2 and option.split()[0] in result.output


def test_formulas_that_are_not_found_in_time_are_refused_with_a_way_out(
    call, no_computation, monkeypatch, tmp_path
):
    product = "*".join(f"(x + {k})" for k in range(23))
    table = f'[variants.long]\nstate = "1e-30*{product} + v"\nmeter = "x + w"\n'
    (tmp_path / "long.toml").write_text(table, encoding="utf-8")
    monkeypatch.setattr(cli, "DERIVATION", 0.5)
    start = time.monotonic()
    names = "aof-gaussian,fos-gaussian"
    result = call("lab long", QUICK, "--variants long.toml --filters", names)
    line = refused(result, "aof-gaussian: its formulas", "0.5 s", "aof-unscented")
    assert time.monotonic() - start < 20
    assert "simplify" in line


@pytest.mark.parametrize(
    ("error", "says"),
    [
        (RuntimeError("double\nsubscript"), "RuntimeError: double subscript"),
        (OSError(errno.ENOSPC, "No space left on device", "f"), "No space left"),
        (KeyboardInterrupt(), "files written before are as they were"),
    ],
)
def test_a_report_that_fails_keeps_ranking_numbers_and_the_report_before(
    call, no_figures, tmp_path, monkeypatch, error, says
):
    common = f"lab 53 {QUICK} --filters aof-gaussian,duof --out r"
    assert call(common, "--report ru").exit_code == 0
    before = snapshot(tmp_path)

    def failing(*_):
        raise error

    monkeypatch.setattr(report, "save_texts", failing)
    result = call(common, "--seed 2 --json n.json")
    assert result.exit_code == (130 if isinstance(error, KeyboardInterrupt) else 1)
    assert says in result.output and "GAOF" in result.output
    numbers = json.loads((tmp_path / "n.json").read_text(encoding="utf-8"))
    assert set(numbers["error_variance"]) == {"aof-gaussian", "duof"}
    (tmp_path / "n.json").unlink()
    assert snapshot(tmp_path) == before


def test_a_warning_is_one_line_and_numpy_s_are_none(call, no_report):
    result = call("lab tan", QUICK, "--variants mine.toml --filters aof-unscented,duof")
    (line,) = [line for line in result.output.splitlines() if "may be infinite" in line]
    assert line.startswith("Warning: UKF: unscented: ")
