"""The exercise sets, a folder each.

    <letter>_<name>/statement.md    text, stubs and typed solution; Jinja fills in the variant
    <letter>_<name>/questions.py    `SET`: titles, levels, and the hidden arguments
                    keys.py         the right answers: plain functions with the student's names
                    mistakes.py     the known mistakes: edits of the keys, and what is said of each
                    companion.py    what the notebook itself imports, besides the package; no key
    messages.py                     what is said of a mistake that is made in more than one place
    shared.py                       what the questions of several sets share

A new folder is a new set: there is no list to add it to.  Only questions.py with its SET is looked
for; a small set may hold its keys and mistakes there too, as set a does.  Installed, this package
is `kfcourse.exercises`.
"""

from importlib import import_module
from pathlib import Path

import kfcourse
from kfcourse.checks.registry import ExerciseSet, register

_HERE, _PACKAGE = Path(__file__).resolve().parent, Path(kfcourse.__file__).resolve().parent
if _HERE not in (_PACKAGE / "exercises", _PACKAGE.parent / "exercises"):  # installed, in a checkout
    raise ImportError(
        f"kfcourse is that of {_PACKAGE}, but its exercises are those of {_HERE}: two copies of "
        f"the project are mixed. "
        f"Install the one you want (`pip install -e {_PACKAGE.parent}`) or take it off PYTHONPATH."
    )


def discover(package: str, folder: Path) -> list[ExerciseSet]:
    """The sets of a package: `SET` of the questions.py in each subfolder that has one."""
    names = sorted(path.parent.name for path in folder.glob("*/questions.py"))
    return [import_module(f"{package}.{name}.questions").SET for name in names]


for _set in discover(__name__, Path(__file__).parent):
    register(_set)
