"""The report of the lab that the book shows, as `kfcourse lab` writes it, and what it prints on the
way."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parent.parent / "_build" / "sample"
REPORT = FOLDER / "sample"  # into the book's folder goes what is in FOLDER
ARGUMENTS = ["lab", "53", "--report", "ru", "--runs", "20000", "--steps", "21"]


def write() -> None:
    """Write the report, if it is not there."""
    printed = REPORT / "printed.txt"
    if printed.exists():
        return
    print("Sample report ...", flush=True)
    shutil.rmtree(FOLDER, ignore_errors=True)
    command = [sys.executable, "-m", "kfcourse", *ARGUMENTS, "--out", str(REPORT)]
    done = subprocess.run(
        command, check=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    for path in REPORT.iterdir():
        if path.suffix == ".pdf":
            path.unlink()
    lines = [line for line in done.stdout.splitlines() if str(REPORT) not in line]
    printed.write_text(
        "\n".join([f"$ kfcourse {' '.join(ARGUMENTS)}", *lines, ""]), encoding="utf-8"
    )
