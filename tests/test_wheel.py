"""Everything works from an installed wheel, in an empty folder, with no checkout around."""

import os
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SOURCES = ("kfcourse", "exercises", "pyproject.toml", "setup.py", "README.md", "LICENSE")


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The command of an installed wheel, run in an empty folder."""
    source, target, empty = (
        tmp_path_factory.mktemp(name) for name in ("source", "target", "empty")
    )
    for name in SOURCES:
        if (ROOT / name).is_dir():
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / name, source / name, ignore=ignored)
        else:
            shutil.copy(ROOT / name, source)
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run(
        [*pip, "install", "--no-deps", "--no-build-isolation", "--target", target, source],
        check=True,
    )
    shutil.rmtree(source)
    environment = os.environ | {"PYTHONPATH": str(target)}

    def call(*command):
        process = subprocess.run(
            [sys.executable, *map(str, command)],
            cwd=empty,
            env=environment,
            capture_output=True,
            text=True,
        )
        assert process.returncode == 0, process.stderr
        return process.stdout

    code = "import kfcourse, kfcourse.exercises as e; print(kfcourse.__file__, e.__file__)"
    assert all(Path(file).is_relative_to(target) for file in call("-c", code).split())
    assert (target / "kfcourse" / "py.typed").exists()
    # with a licence of its own, which must stand beside it
    data = target / "kfcourse" / "scenarios" / "data"
    assert (data / "car-2014-03-26.csv").exists() and (data / "LICENSE-car-2014-03-26.txt").exists()
    return partial(call, "-m", "kfcourse"), empty, target


def test_it_is_complete(installed):
    """Every file of both folders came with it, not only programs."""
    call, _, target = installed
    assert "53" in call("variants")
    places = {"kfcourse": target / "kfcourse", "exercises": target / "kfcourse" / "exercises"}
    for name, place in places.items():
        files = [path for path in (ROOT / name).rglob("*") if path.is_file()]
        wanted = {
            path.relative_to(ROOT / name) for path in files if "__pycache__" not in path.parts
        }
        assert [file for file in wanted if not (place / file).exists()] == []


@pytest.mark.slow
def test_every_command_runs_without_a_checkout(installed):
    call, folder, _ = installed
    # without the exact filter, which a fresh installation compiles first: half a minute
    call("lab", 53, "--filters", "aof-gaussian,duof", "--runs", 500, "--steps", 3)
    assert (folder / "lab-53" / "report.html").exists()
    call("exercises", "--variant", 53, "--sets", "b", "--out", "handed-out")
    handed_out = folder / "handed-out" / "53" / "b-aof.ipynb"
    assert "task.check" in handed_out.read_text(encoding="utf-8")
    call("solutions", "--variant", 53, "--sets", "b", "--out", "solved")
    solved = folder / "solved" / "53" / "b-aof-solution.html"
    assert "<math" in solved.read_text(encoding="utf-8")
    rows = call("grade", "solved").splitlines()
    row = next(row for row in rows if "b-aof-solution" in row)
    assert row.split()[1:6] == ["b", "53", "5", "of", "5"]
