"""Grading on the workers of a Dask cluster, here two processes of this machine with two threads each."""

import csv
import io
import json
import os
from pathlib import Path

import pytest
from click.testing import CliRunner
from distributed import LocalCluster
from endings import ended
from test_grade import FIXTURES, add, leaves, solved, wrong

from kfcourse import cli
from kfcourse.notebooks.grading import course, far
from kfcourse.notebooks.grading.far import LOST
from kfcourse.notebooks.grading.table import grade_all

KILLS = """
import os, pathlib, psutil
above = [one for one in psutil.Process().parents() if {what!r} in " ".join(one.cmdline())]
flag = pathlib.Path({flag!r})
if above and not flag.exists():
    {first}
    above[0].kill()
    import time
    time.sleep(60)
"""
POSIX = pytest.mark.skipif(os.name != "posix", reason="processes are kept by a keeper on POSIX only")


@pytest.fixture(scope="module")
def address():
    with LocalCluster(n_workers=2, threads_per_worker=2, dashboard_address=None) as workers:
        yield workers.scheduler_address


def kills(what, flag, first="pass"):
    """Kills the nearest process above it that has this in its command line, unless the file is there."""
    return add(solved(), KILLS.format(what=what, flag=str(flag), first=first), "def correct")


def command(folder, *options):
    return CliRunner().invoke(cli.main, ["grade", str(folder), "--masters", str(FIXTURES), "--seed", "s", *options])


def rows(folder):
    with (folder / "grades.csv").open(encoding="utf-8-sig") as file:
        return {row["notebook"]: row for row in csv.DictReader(io.StringIO(file.read()))}


@POSIX
def test_the_same_table_when_processes_are_killed(address, tmp_path, monkeypatch):
    """A worker is lost once, with all below it; one notebook kills the process above it whenever it is graded."""
    folder, killed, pid = tmp_path / "returned", tmp_path / "killed", tmp_path / "pid"
    folder.mkdir()
    notebooks = {
        "kills-a-worker": kills("spawn_main", killed, "flag.write_text(str(os.getpid()))"),
        "kills-its-own": kills("grading.far", tmp_path / "never"),
        "leaves": leaves(pid),
        "wrong": wrong(),
    }
    for name, notebook in notebooks.items():
        (folder / f"{name}.ipynb").write_text(json.dumps(notebook), encoding="utf-8")
    (folder / "cut.ipynb").write_text(json.dumps(solved())[:500], encoding="utf-8")
    begun = []

    def told(work, path, again, run_all):
        def run(works, started):
            return run_all(works, lambda one: (begun.append(one.name), started(one)))

        return grade_all(work, path, again, run)

    monkeypatch.setattr(course, "grade_all", told)
    there = command(folder, "--sandbox", "none", "--dask", address)
    assert "5 run, 0 unchanged since the last table" in there.output, there.output
    assert set(begun) == set(rows(folder))  # as the table says while it runs
    assert ended(int(killed.read_text()), int(pid.read_text()))
    far_rows = rows(folder)
    here = command(folder, "--sandbox", "none", "--again", "--jobs", "2")
    assert "sandbox: none" in here.output.lower(), here.output
    assert far_rows.pop("kills-its-own.ipynb")["note"] == LOST
    assert rows(folder).pop("kills-its-own.ipynb")["passed"] == "2"
    assert far_rows == {name: row for name, row in rows(folder).items() if name in far_rows}
    assert far_rows["kills-a-worker.ipynb"]["passed"] == "2"
    assert far_rows["wrong.ipynb"]["passed"] == "0"


def test_what_a_worker_lacks_is_said(address, tmp_path, monkeypatch):
    (tmp_path / "x.ipynb").write_text(json.dumps(solved()), encoding="utf-8")
    monkeypatch.setattr(far, "package_digest", lambda: "of another version")
    result = command(tmp_path, "--dask", address)
    assert result.exit_code == 1
    assert "another kfcourse is installed there" in result.output and "the Dask worker on" in result.output


def test_a_folder_that_is_not_shared(address, tmp_path):
    order = far.Order(Path("/nowhere/returned"), None, "none", "s")
    asked = far.Returned(Path("/nowhere/returned/x.ipynb"), "x.ipynb", "digest")
    with far.far_grading(order, address) as (run, _), pytest.raises(ValueError, match="it does not see"):
        list(run([asked], lambda _: None))
