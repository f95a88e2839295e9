"""Build the book: execute the chapters, write _build/html, treat every warning as an error.

    python book/build.py

Sphinx itself always starts afresh, so that no warning is lost and no stale page is left; only the
outputs of executed cells are kept (_build/.jupyter_cache), as long as the package, the requirements
and the interpreter are the same. Where nothing at all has changed since a book was built, it stays.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import chapters
import equations
import manual
import package
import sample

from kfcourse.files import package_digest

ROOT = Path(__file__).resolve().parent.parent
BUILD = ROOT / "_build"
CACHE = BUILD / ".jupyter_cache"
KEPT = (CACHE, sample.FOLDER, BUILD / "solutions")  # made anew by themselves when stale
KEY = BUILD / ".executed-with"
SOURCES = ("_config.yml", "requirements.txt", "book", "exercises", "kfcourse")
MADE = (
    "book/manual",
    "book/package",
    "book/reference/equations.md",
    "book/reference/equations-beyond.md",
)  # by the build
BUILT = BUILD / ".built-from"
PAGE = BUILD / "html" / "index.html"
NOT_BUILT = "\nThe book was NOT built: see the errors and warnings above."


def fingerprint() -> str:
    """Hash of all that the outputs of the chapters depend on, besides their own cells."""
    parts = (
        sys.version.encode(),
        package_digest().encode(),
        (ROOT / "requirements.txt").read_bytes(),
    )
    return hashlib.sha256(b"\n".join(parts)).hexdigest()


def sources() -> str:
    """Hash of all files that the book is made of, and of the interpreter."""
    digest = hashlib.sha256(sys.version.encode())
    for path in sorted(
        file
        for name in SOURCES
        for file in (ROOT / name, *(ROOT / name).rglob("*"))
        if file.is_file()
    ):
        name = path.relative_to(ROOT).as_posix()
        if not name.startswith(MADE) and "__pycache__" not in name:
            digest.update(f"{name}\n{hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest()


def prepare() -> None:
    """Remove the last build, and the cached outputs if they may be stale."""
    key = fingerprint()
    if not (KEY.exists() and KEY.read_text() == key):
        for stale in (CACHE, sample.FOLDER):
            shutil.rmtree(stale, ignore_errors=True)
    for entry in BUILD.iterdir() if BUILD.exists() else ():
        if entry.is_dir() and entry not in KEPT:
            shutil.rmtree(entry)
    BUILD.mkdir(exist_ok=True)
    KEY.write_text(key)


def main() -> int:
    begun_with = sources()
    if PAGE.exists() and BUILT.exists() and BUILT.read_text() == begun_with:
        print("Nothing has changed since the book was built.")
        return tell()
    BUILT.unlink(missing_ok=True)
    prepare()
    # Small matrices: several threads inside one kernel cost more than they gain, and the kernels
    # share the processors.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    # On a new machine matplotlib announces its font cache on stderr; not in a chapter, please.
    subprocess.run(
        [sys.executable, "-c", "import matplotlib.font_manager"],
        stderr=subprocess.DEVNULL,
        check=True,
    )
    failures = chapters.execute_all(CACHE, manual.solutions())
    for failure in failures:
        print(f"\nFAILED {failure}", file=sys.stderr)
    if failures:
        print(NOT_BUILT, file=sys.stderr)
        return 1
    manual.write()
    package.write()
    sample.write()
    made = chapters.executed(CACHE)
    listed = equations.pages((name, equations.records(notebook)) for name, notebook in made)
    for name, text in listed.items():
        (ROOT / "book" / f"{name}.md").write_text(text, encoding="utf-8")
    jupyter_book = [sys.executable, "-c", "from jupyter_book.cli.main import main; main()"]
    options = ["--config", "_config.yml", "--path-output", ".", "-W", "--keep-going", "-n"]
    result = subprocess.run([*jupyter_book, "build", "book", *options], cwd=ROOT)
    if result.returncode:
        for report in sorted((BUILD / "html" / "reports").rglob("*.log")):
            print(
                f"\n{report.relative_to(ROOT)}:\n{report.read_text(encoding='utf-8')}",
                file=sys.stderr,
            )
        shutil.rmtree(BUILD / "html", ignore_errors=True)
        print(NOT_BUILT, file=sys.stderr)
        return 1
    BUILT.write_text(begun_with)
    return tell()


def tell() -> int:
    """Where the book is."""
    print(f"\nThe book: {PAGE}\nTo read it, open that file in a browser, for instance with:")
    print(f"\n    {sys.executable} -m webbrowser {PAGE.as_uri()}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
