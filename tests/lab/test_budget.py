"""How many trajectories the lab takes by default: counted, told, and left to who asks for a number."""

import html
import shlex

import pytest
from click.testing import CliRunner

from kfcourse import Model, cli
from kfcourse.cli import main
from kfcourse.lab import find_variant, lab_filters
from kfcourse.lab.admission import admissions
from kfcourse.lab.budget import SIZES, USUAL, Budget, usual_runs
from kfcourse.lab.short_names import LAB, Structures

pytestmark = pytest.mark.quick


def work(model, steps, names, designs=4):
    return [one.one for one in admissions(model, names) if one.one], model, steps, designs


@pytest.mark.parametrize(
    ("steps", "runs"), [(1, 100_000), (476, 100_000), (477, 20_000), (2380, 20_000), (2381, 5_000), (99_999, 5_000)]
)
def test_as_many_as_the_usual_work_allows_and_never_none(steps, runs):
    """The lab's seven on a scalar model: two of one pass, five of two times four: 42 units a trajectory and step."""
    assert int(2e9 / 42 / 100_000) == 476
    found = usual_runs(*work(find_variant("53").model, steps, LAB))
    assert found.runs == runs
    assert bool(found.says) == (runs < SIZES[0])
    if found.says:
        told, times = {20_000: "20,000", 5_000: "5000"}[runs], f"{steps * 42 * 1e5 / USUAL:.2g}"
        assert (
            found.says.startswith(f"{told} trajectories: with 100,000 these filters have {times} times")
            and "--runs" in found.says
        )


MODES = ("aof-jump-linearised", "imm", "gpb2", "fos-jump-linearised", "duof")


@pytest.mark.parametrize(
    ("name", "names", "units"),
    [
        ("D2", LAB, 42 * 4),  # n = 2
        ("D3", ("aof-linearised", "duof", "fos-linearised"), (1 + 8 + 8) * 9),
        ("53", ("aof-unscented",), 1 + 5),  # two points an axis, of state and noise, and their mean
        ("D2", ("aof-unscented", "aof-gauss-hermite"), 4 + 2 * (2 * (2 + 2) + 1) + 4 + 2 * 5**2),
        ("J1", MODES, 2 + 2 + 4 + 2 * 8 + 8),  # two modes, four pairs; DUOF knows of none
        ("J1-overload", ("imm",), 2 * (1 + 32)),  # transitions of the state by 32 points
    ],
)
def test_the_work_is_that_of_passes_laws_and_points(name, names, units):
    filters, model, _, designs = work(find_variant(name).model, 1, names)
    steps = int(USUAL / SIZES[0] / units)
    assert usual_runs(filters, model, steps, designs).runs == SIZES[0] > usual_runs(filters, model, steps + 1, designs).runs


def test_where_means_are_sums_over_points_the_points_count():
    model = Model.define("x/(1 + x**2) + 0.1*v", "x + w")
    filters, points = lab_filters(model, ["aof-gaussian", "aof-linearised"]), Structures(model).quadrature.points
    steps = int(USUAL / SIZES[0] / (1 + points + 1))
    assert points >= 3 and usual_runs(filters, model, steps, 1).runs == SIZES[0] > usual_runs(filters, model, steps + 1, 1).runs


def test_no_clock_takes_part(monkeypatch):
    """On a machine without any the same numbers come; the slow filters do not count, whose trajectories time decides."""

    def stopped():
        raise AssertionError("the clock was asked")

    filters, model, steps, designs = work(find_variant("53").model, 51, [*LAB, "aof-exact"])
    for clock in ("time", "process_time", "perf_counter", "monotonic"):
        monkeypatch.setattr(f"time.{clock}", stopped)
    assert usual_runs(filters, model, steps, designs) == usual_runs(filters[:-1], model, steps, designs) == Budget(SIZES[0])


def test_the_lab_tells_why_it_takes_fewer_and_takes_what_it_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(cli, "usual_runs", lambda *given, **options: Budget(300, "300 trajectories: told so"))
    few = ["lab", "53", "--steps", "3", "--slow-runs", "0", "--filters", "duof,aof-gaussian", "--designs", "1"]
    for asked, runs in (([], 300), (["--runs", "400"], 400)):
        place, numbers = tmp_path / f"r{runs}", tmp_path / f"{runs}.json"
        result = CliRunner().invoke(cli.main, [*few, *asked, "--out", str(place), "--json", str(numbers)])
        assert result.exit_code == 0, result.output
        assert f'"runs": {runs},' in numbers.read_text()
        for text in (result.output, (place / "report.html").read_text(), (place / "report.tex").read_text()):
            assert ("told so" in text) == (runs == 300)


def test_the_command_that_is_told_repeats_the_numbers(tmp_path, monkeypatch):
    """What is chosen is written out: trajectories, and how many of them the slow filters came through in time."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my variants.toml").write_text('[variants.a]\nstate = "0.9*x + v"\nmeter = "x + 0.1*x**2*w"\n', encoding="utf-8")
    call = ["lab", "a", "--variants", "my variants.toml", "--runs", "400", "--steps", "3", "--designs", "2", "--slow-runs", "112"]
    first = CliRunner().invoke(main, [*call, "--filters", "aof-gaussian,duof,aof-exact", "--out", "a", "--json", "a.json"])
    assert first.exit_code == 0, first.output
    (told,) = (line for line in first.output.splitlines() if line.startswith("The same numbers again: "))
    assert "--runs 400" in told and "--slow-runs 112 --slow-seconds 3600" in told and told in report_text(tmp_path / "a")
    program, *again = shlex.split(told.partition(": ")[2])
    second = CliRunner().invoke(main, [*again, "--out", "b", "--json", "b.json"])
    assert program == "kfcourse" and second.exit_code == 0, second.output
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


def report_text(folder):
    return html.unescape((folder / "report.html").read_text(encoding="utf-8"))
