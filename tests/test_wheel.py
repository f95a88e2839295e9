"""Everything works from an installed wheel, in an empty folder, with no checkout around."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SOURCES = ("kfcourse", "exercises", "pyproject.toml", "setup.py", "README.md", "LICENSE")


@pytest.fixture(scope="module")
def kfcourse(tmp_path_factory):
    """The command of an installed wheel, run in an empty folder."""
    source, target, empty = (
        tmp_path_factory.mktemp(name) for name in ("source", "target", "empty")
    )
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(
                ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__")
            )
        else:
            shutil.copy(ROOT / name, source)
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run(
        [*pip, "install", "--no-deps", "--no-build-isolation", "--target", target, source],
        check=True,
    )
    shutil.rmtree(source)
    environment = os.environ | {"PYTHONPATH": str(target)}

    def call(*arguments):
        command = [sys.executable, "-m", "kfcourse", *map(str, arguments)]
        done = subprocess.run(command, cwd=empty, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    where = subprocess.run(
        [
            sys.executable,
            "-c",
            "import kfcourse, kfcourse.exercises as e; print(kfcourse.__file__, e.__file__, "
            "sep='\\n')",
        ],
        cwd=empty,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert all(Path(line).is_relative_to(target) for line in where.stdout.split())
    assert (target / "kfcourse" / "py.typed").exists()
    # with a licence of its own, which must stand beside it
    data = target / "kfcourse" / "scenarios" / "data"
    assert (data / "car-2014-03-26.csv").exists() and (data / "LICENSE-car-2014-03-26.txt").exists()
    return call, empty


def test_every_command_runs_without_a_checkout(kfcourse):
    call, folder = kfcourse
    assert "53" in call("variants")
    call("lab", 53, "--runs", 500, "--steps", 3)
    assert (folder / "lab-53" / "report.html").exists()
    call("exercises", "--variant", 53, "--sets", "e", "--out", "handed-out")
    assert "task.check" in (folder / "handed-out" / "53" / "e-comparison.ipynb").read_text(
        encoding="utf-8"
    )
    call("solutions", "--variant", 53, "--sets", "e", "--out", "solved")
    assert "<math" in (folder / "solved" / "53" / "e-comparison-solution.html").read_text(
        encoding="utf-8"
    )
    row = next(
        line for line in call("grade", "solved").splitlines() if "e-comparison-solution" in line
    )
    assert row.split()[1:6] == ["e", "53", "5", "of", "5"]
