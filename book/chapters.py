"""The chapters, executed several at once into the cache from which Sphinx takes their outputs.

Sphinx would execute them one after another.  The worked solutions of the lab manual run in the same
processes.

    python book/chapters.py beyond/literature      execute one chapter, print what its cells say
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import joblib
import yaml
from jupyter_cache import get_cache
from jupyter_cache.base import CacheBundleIn
from jupyter_cache.executors.utils import single_nb_execution
from myst_nb.core.read import is_myst_markdown_notebook, myst_nb_reader_plugin
from nbclient.exceptions import DeadKernelError
from nbformat import NotebookNode

from kfcourse.exercises.notebooks.execution import first_error
from kfcourse.exercises.notebooks.jobs import Job, Outcome, make, run_all

BOOK = Path(__file__).resolve().parent
SETTINGS = yaml.safe_load((BOOK.parent / "_config.yml").read_text(encoding="utf-8"))["execute"]


class Executed(NamedTuple):
    """A chapter with its outputs; or the traceback, if it failed."""

    path: Path
    notebook: NotebookNode
    seconds: float
    traceback: str | None

    @property
    def failure(self) -> str | None:
        return self.traceback and f"{self.path.name}:\n{self.traceback}"


def notebooks() -> list[Path]:
    """The chapters of the book that have code."""
    toc = yaml.safe_load((BOOK / "_toc.yml").read_text(encoding="utf-8"))
    pages = [
        toc["root"],
        *(chapter["file"] for part in toc["parts"] for chapter in part["chapters"]),
    ]
    paths = [BOOK / f"{page}.md" for page in pages if not page.startswith("manual/")]
    made = [path for path in paths if path.exists()]  # the build writes a page of its own
    return [path for path in made if is_myst_markdown_notebook(path.read_text(encoding="utf-8"))]


def execute(chapter: Path) -> Executed:
    """Execute a chapter, in the folder of the book."""
    notebook = myst_nb_reader_plugin(str(chapter))
    try:
        done = single_nb_execution(
            notebook,
            cwd=str(BOOK),
            timeout=SETTINGS["timeout"],
            allow_errors=False,
            extra_arguments=["--log-level=ERROR"],  # kernels tell of their connections
        )
    except (DeadKernelError, RuntimeError) as error:  # RuntimeError: no kernel starts
        return Executed(chapter, notebook, 0.0, f"{type(error).__name__}: {error}")
    traceback = done.exc_string
    if not traceback and (error_ := first_error(done.nb)):
        cell, shown = error_
        traceback = f"{cell.source}\n\n{shown.ename}: {shown.evalue}"
    return Executed(chapter, done.nb, done.time, traceback)


def work(job: Path | Job) -> Executed | Outcome:
    """Execute a chapter, or make a worked solution."""
    return execute(job) if isinstance(job, Path) else make(job)


def execute_all(folder: Path, solutions: Sequence[Job]) -> list[str]:
    """Execute the chapters that the cache does not hold, and make the solutions; what failed, in
    words."""
    cache = get_cache(folder)
    new = [path for path in notebooks() if not _cached(cache, path)]
    failures = []
    for done in run_all([*new, *solutions], work, joblib.cpu_count(), "executing"):
        if isinstance(done, Outcome):
            if done.status == "failed":
                failures.append(f"{done.job.name}: {done.message}")
        elif done.failure:
            failures.append(done.failure)
        else:
            bundle = CacheBundleIn(
                done.notebook, str(done.path), data={"execution_seconds": done.seconds}
            )
            cache.cache_notebook_bundle(bundle, check_validity=False, overwrite=True)
    return failures


def executed(folder: Path) -> Iterator[tuple[str, NotebookNode]]:
    """The documents of the chapters with code, in the order of the book, each with its outputs from
    the cache."""
    cache = get_cache(folder)
    for path in notebooks():
        _, notebook = cache.merge_match_into_notebook(myst_nb_reader_plugin(str(path)))
        yield path.relative_to(BOOK).with_suffix("").as_posix(), notebook


def show(name: str) -> int:
    """Execute a chapter and print the texts that its cells display."""
    done = execute(BOOK / f"{name}.md")
    for cell in done.notebook.cells:
        for output in cell.get("outputs", []):
            text = output.get("text") or output.get("data", {}).get("text/markdown")
            if text:
                print(re.sub(r"</?(p|span)[^>]*>", "", text), end="\n\n")
    if done.failure:
        print(done.failure, file=sys.stderr)
    return bool(done.failure)


def _cached(cache, path: Path) -> bool:
    try:
        cache.match_cache_notebook(myst_nb_reader_plugin(str(path)))
    except KeyError:
        return False
    return True


if __name__ == "__main__":
    sys.exit(show(sys.argv[1]))
