"""The pages of the lab manual, made from the masters of the exercises for one variant.

Into book/manual/ go, for every set, its page (questions, hints, no solutions), the pictures to reach, and the student's
notebook to download.  The worked solutions are executed for that, and kept in _build/solutions.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import nbformat

from kfcourse.checks import exercise, sets
from kfcourse.notebooks.execute import pictures
from kfcourse.notebooks.jobs import jobs, make, run_all
from kfcourse.notebooks.master import read, render, statement, student

VARIANT = "53"
PAGES = Path(__file__).resolve().parent / "manual"
SOLUTIONS = Path(__file__).resolve().parent.parent / "_build" / "solutions"
NOTE = """
```{{admonition}} Your own notebook
The formulas and pictures on this page are those of variant {variant}.
{{download}}`Download its notebook <notebooks/{file}.ipynb>`, or ask your instructor for the notebook of your variant.
Open it in Jupyter, in an environment in which `kfcourse` is installed: {{doc}}`../lab-manual`.
```
"""


def write() -> bool:
    """Write the pages; False, with a message, if a solution fails."""
    work = jobs("solutions", SOLUTIONS, [VARIANT], list(sets()))
    failed = [outcome for outcome in run_all(work, make, 2, "lab manual") if outcome.status == "failed"]
    for outcome in failed:
        print(f"FAILED {outcome.job.name}: {outcome.message}", file=sys.stderr)
    if failed:
        return False
    shutil.rmtree(PAGES, ignore_errors=True)
    (PAGES / "notebooks").mkdir(parents=True)
    for job in work:
        notebook = render(read(job.letter), exercise(job.letter, VARIANT))
        found = pictures(nbformat.read(job.target, as_version=4))
        for name, png in found.items():
            (PAGES / f"{name}.png").write_bytes(png)
        file = sets()[job.letter].name
        heading, rest = statement(notebook, {name: f"{name}.png" for name in found}).split("\n", 1)
        (PAGES / f"{file}.md").write_text(f"{heading}\n{NOTE.format(variant=VARIANT, file=file)}{rest}", encoding="utf-8")
        nbformat.write(student(notebook, found), PAGES / "notebooks" / f"{file}.ipynb")
    return True
