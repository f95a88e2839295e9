"""Make .venv, or leave it as it is: every target of the Makefile runs this first, with the interpreter that .venv shall have.

An environment is kept if it was finished (.venv/installed tells), with this interpreter and in this folder; otherwise it is made
anew. If only requirements.txt or pyproject.toml changed since, it is brought up to date. What goes wrong is said in one line,
with the remedy.
"""

import hashlib
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
PYTHON = VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
FINISHED = VENV / "installed"
PIP = [str(PYTHON), "-m", "pip", "--disable-pip-version-check", "--no-input", "install"]

TEMPORARY = tempfile.gettempdir()
FULL = f"The disk is full: .venv takes about 1.2 GB, and pip 200 MB in {TEMPORARY} (another folder: TMPDIR=...). Make room"
READ_ONLY = "This folder cannot be written to. Take a copy of the project in a folder of your own"
NO_NETWORK = "The packages cannot be fetched. Connect to the network (a proxy: HTTPS_PROXY=...; another index: PIP_INDEX_URL=...)"
# What venv and pip say of a failure, and what to do. The first that fits counts.
REMEDIES = {
    "No space left|Errno 28|[Qq]uota exceeded": FULL,
    "Permission denied|Read-only file system": READ_ONLY,
    "connection broken|Max retries|[Tt]imed out|IncompleteRead|from versions: none": NO_NETWORK,
}


def wanted() -> list[str]:
    """What a finished environment is marked with: its interpreter and folder; what is installed."""
    interpreter = f"{sysconfig.get_config_var('EXT_SUFFIX')} {os.path.realpath(sys.base_prefix)} {ROOT}"
    files = b"".join((ROOT / name).read_bytes() for name in ("requirements.txt", "pyproject.toml"))
    return [interpreter, hashlib.sha256(files).hexdigest()]


def run(*command: str) -> None:
    """Run quietly: on a terminal one line tells how far it is. RuntimeError with the output if it fails."""
    output: list[str] = []
    terminal = sys.stdout.isatty()
    pipe, both = subprocess.PIPE, subprocess.STDOUT
    with subprocess.Popen(command, cwd=ROOT, stdout=pipe, stderr=both, text=True, errors="replace") as process:
        for line in process.stdout or ():
            output.append(line)
            if terminal and line.startswith(("Collecting ", "Installing ")):
                print(f"\r{line.split(' (')[0].strip():.70}\033[K", end="", flush=True)
    if terminal:
        print("\r\033[K", end="", flush=True)
    if process.returncode:
        raise RuntimeError("".join(output))


def explain(problem: str) -> str:
    """One line for a known problem; the end of the output for another."""
    for pattern, remedy in REMEDIES.items():
        if re.search(pattern, problem):
            return remedy
    if any(shutil.disk_usage(folder).free < 20e6 for folder in (ROOT, TEMPORARY)):  # venv hides the reason
        return FULL
    return "\n".join([*problem.strip().splitlines()[-12:], "The environment could not be made"])


def main(goals: str) -> None:
    again, mark = f"then again: make {goals}", wanted()
    major, minor, micro = sys.version_info[:3]
    found = FINISHED.read_text("utf-8").splitlines() if FINISHED.exists() and PYTHON.exists() else []
    if found == mark:
        return
    keep = found[:1] == mark[:1]
    if keep:
        print("requirements.txt or pyproject.toml changed: .venv is brought up to date", flush=True)
    else:
        try:
            import venv  # noqa: F401
            from ensurepip import version  # noqa: F401
        except ImportError:
            package = f"python{major}.{minor}-venv"
            sys.exit(f"This Python cannot make environments. On Debian and Ubuntu: sudo apt install {package}; {again}")
        print(f"Making .venv with Python {major}.{minor}.{micro}: about 1.2 GB, a minute or two", flush=True)
    try:
        if not keep:
            run(sys.executable, "-m", "venv", "--clear", str(VENV))
        FINISHED.unlink(missing_ok=True)
        run(*PIP, "--require-hashes", "-r", "requirements.txt")
        shutil.rmtree(ROOT / "kfcourse.egg-info", ignore_errors=True)  # one left by an older setuptools hides what is installed
        run(*PIP, "--no-deps", "--no-build-isolation", "--editable", ".")
        FINISHED.write_text("\n".join(mark), "utf-8")
    except (OSError, RuntimeError) as problem:
        message = explain(str(problem))
        if keep:
            FINISHED.write_text("\n".join(found), "utf-8")  # as it was: pip changes nothing before it has everything
        else:
            shutil.rmtree(VENV, ignore_errors=True)
        sys.exit(f"{message}; {again}")
    except KeyboardInterrupt:
        sys.exit(f"\nStopped half-way, and .venv is not finished; {again}")


if __name__ == "__main__":
    main(" ".join(sys.argv[1:]))
