"""A course's notebooks: every set for every variant, made in parallel, resumed where it was
interrupted.

A job is one set for one variant.  It executes the worked solution once; from it come the solution's
notebook and page, and the student's notebook with the pictures to reach.  Files appear complete or
not at all.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import joblib
import nbformat
from nbformat import NotebookNode
from tqdm import tqdm

from kfcourse.exercises.checks import Exercise, sets
from kfcourse.exercises.checks.question import PASSED
from kfcourse.exercises.notebooks.execution import (
    NotebookFailed,
    execute,
    html,
    pdf,
    pictures,
    results,
)
from kfcourse.exercises.notebooks.kernels import prefer_forked
from kfcourse.exercises.notebooks.master import read, render, solution, student
from kfcourse.exercises.notebooks.nbgrader import source_notebook
from kfcourse.files import package_digest, replacing, save
from kfcourse.lab.variants import find_variant


@dataclass(frozen=True)
class Job:
    """One set for one variant, and what is wanted of it.

    Attributes
    ----------
    letter, variant : str
    folder : Path
        Where the files go.
    kind : {"exercises", "nbgrader", "solutions"}
    variants_file : Path or None
    masters : Path or None
        A folder like exercises/, in place of the shipped one.
    with_pdf : bool
    student : str
        Whose the notebook is; it says so in its metadata.
    """

    letter: str
    variant: str
    folder: Path
    kind: str
    variants_file: Path | None = None
    masters: Path | None = None
    with_pdf: bool = False
    student: str = ""

    @property
    def name(self) -> str:
        return f"variant {self.variant}, {sets()[self.letter].name}"

    @property
    def target(self) -> Path:
        suffix = "-solution" if self.kind == "solutions" else ""
        return self.folder / f"{sets()[self.letter].name}{suffix}.ipynb"


@dataclass(frozen=True)
class Outcome:
    """What became of a job: "written", "up to date" or "failed", with a message."""

    job: Job
    status: str
    message: str = ""


def make(job: Job) -> Outcome:
    """Do one job; what fails is told in the outcome."""
    try:
        text = read(job.letter, job.masters)
        notebook = render(text, Exercise(job.letter, find_variant(job.variant, job.variants_file)))
        notebook.metadata["kfcourse"]["fingerprint"] = fingerprint(notebook)
        if job.student:
            notebook.metadata["kfcourse"]["student"] = job.student
        wanted = [job.target]
        if job.kind == "solutions":
            wanted += [
                job.target.with_suffix(".html"),
                *([job.target.with_suffix(".pdf")] if job.with_pdf else []),
            ]
        if _up_to_date(job.target, notebook) and all(path.exists() for path in wanted):
            return Outcome(job, "up to date")
        executed = execute(solution(notebook))
        wrong = [result for result in results(executed) if result["status"] != PASSED]
        if wrong:
            return Outcome(
                job,
                "failed",
                f"the solution does not pass {wrong[0]['question']}: {wrong[0]['message']}",
            )
        _write(job, notebook, executed)
    except (NotebookFailed, ValueError, OSError) as error:
        return Outcome(job, "failed", str(error))
    except Exception as error:  # of a library: one notebook must not stop the others
        return Outcome(job, "failed", f"{type(error).__name__}: {error}")
    return Outcome(job, "written")


def _write(job: Job, notebook: NotebookNode, executed: NotebookNode) -> None:
    """The job's files; the notebook last, because its being there tells that all are."""
    job.folder.mkdir(parents=True, exist_ok=True)
    if job.kind != "solutions":
        own = job.kind == "exercises"
        made = student(notebook, pictures(executed)) if own else source_notebook(notebook)
        save(nbformat.writes(made), job.target)
        return
    page, printed = job.target.with_suffix(".html"), job.target.with_suffix(".pdf")
    save(html(executed, job.name), page)
    if job.with_pdf:
        with replacing(printed) as path:
            pdf(page, path)
    else:
        printed.unlink(missing_ok=True)  # of an earlier version
    save(nbformat.writes(executed), job.target)


def fingerprint(notebook: NotebookNode) -> str:
    """Hash of all that a notebook's outputs depend on: its cells and the package."""
    digest = hashlib.sha256(package_digest().encode())
    for cell in notebook.cells:
        digest.update(repr((cell.cell_type, cell.source, cell.metadata.get("tags", []))).encode())
    return digest.hexdigest()


def _up_to_date(path: Path, notebook: NotebookNode) -> bool:
    try:
        old = json.loads(path.read_bytes())["metadata"]["kfcourse"]["fingerprint"]
    # missing, or not a notebook of ours
    except (OSError, ValueError, RecursionError, LookupError, TypeError):
        return False
    return old == notebook.metadata["kfcourse"]["fingerprint"]


def run_all(
    jobs: Sequence[Any], work: Callable[[Any], Any], workers: int, what: str
) -> Iterator[Any]:
    """The outcomes of all jobs as they come, in so many processes, with a progress bar.

    Parameters
    ----------
    jobs : sequence
    work : callable
        Job -> outcome; never raises.
    workers : int
    what : str
        Label of the progress bar.

    Raises
    ------
    ValueError
        A process of ours was killed.
    """
    prefer_forked()
    parallel = joblib.Parallel(n_jobs=workers, return_as="generator_unordered")
    done = parallel(joblib.delayed(work)(job) for job in jobs)
    try:
        yield from tqdm(done, desc=what, total=len(jobs), unit="notebook", disable=None)
    except BrokenProcessPool:
        raise ValueError(
            "a working process was killed (out of memory?); run the same again, with fewer --jobs"
        ) from None
