"""The exercise sets, a folder each.

    <letter>_<name>/statement.md    text, stubs and typed solution; Jinja fills in the variant
    <letter>_<name>/questions.py    `SET`: titles, levels, and the hidden arguments
                    keys.py         the right answers: plain functions with the student's names
                    mistakes.py     the known mistakes: edits of the keys, and what is said of each
                    companion.py    what the notebook itself imports, besides the package; no key
    messages.py                     what is said of a mistake that is made in more than one place
    shared.py                       what the questions of several sets share

A new folder is a new set: there is no list to add it to.  Only questions.py with its SET is looked
for; a small set may hold its keys and mistakes there too, as set a does.
"""

from importlib import import_module
from pathlib import Path

from kfcourse.exercises.checks.registry import ExerciseSet, register


def discover(package: str, folder: Path) -> list[ExerciseSet]:
    """The sets of a package: `SET` of the questions.py in each subfolder that has one."""
    names = sorted(path.parent.name for path in folder.glob("*/questions.py"))
    return [import_module(f"{package}.{name}.questions").SET for name in names]


for _set in discover(__name__, Path(__file__).parent):
    register(_set)
