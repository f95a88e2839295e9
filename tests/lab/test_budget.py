"""How many trajectories the lab takes by default: measured by a pilot, told, and left to who asks for a number."""

import html
import shlex

import pytest
from click.testing import CliRunner

from kfcourse import cli
from kfcourse.cli import main
from kfcourse.lab import budget, find_variant, lab_filters
from kfcourse.lab.budget import PILOT, SECONDS, SIZES, STEPS, Budget, usual_runs, within

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("each", "runs"), [(0.0, 100_000), (0.99, 100_000), (1.01, 20_000), (4.9, 20_000), (5.1, 5_000), (500, 5_000)]
)
def test_as_many_as_there_is_time_for_and_never_none(each, runs):
    found = within(each * SECONDS / SIZES[0])
    assert found.runs == runs
    assert bool(found.says) == (runs < SIZES[0])
    if found.says:
        assert found.says.startswith(f"{runs} trajectories: 100000 would take some") and "--runs" in found.says


def test_a_pilot_measures_what_more_trajectories_cost(monkeypatch):
    """The clock is the test's: nine seconds the first time, then three, and two more for more trajectories at 4 steps."""
    model = find_variant("53").model
    filters, ticks = lab_filters(model, ["duof", "aof-gaussian"]), iter([0.0, 9.0, 10.0, 13.0, 20.0, 25.0])
    monkeypatch.setattr(budget.time, "process_time", lambda: next(ticks))
    each = 2 / (PILOT[1] - PILOT[0]) * 51 / STEPS
    assert usual_runs(filters, model, 51, designs=1) == within(each)
    assert within(each).runs == 5000


def test_what_is_wrong_is_left_to_the_comparison():
    model = find_variant("53").model
    assert usual_runs(lab_filters(model, ["duof"]), model, 5, designs=0) == Budget(SIZES[0])


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
    """What pilots and the clock choose is written out: trajectories, and how many of them the slow filters came through."""
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
