"""The exercise sets, a folder each.

    <letter>_<name>/statement.md    text, stubs and typed solution; Jinja fills in the variant
    <letter>_<name>/questions.py    `SET`: the keys, the known mistakes with what to say of them, hidden arguments
    shared.py                       what the questions of several sets share

A new folder is a new set: there is no list to add it to.  Installed, this package is `kfcourse.exercises`.
"""

from importlib import import_module
from pathlib import Path

from kfcourse.checks.registry import register

for _folder in sorted(path.parent.name for path in Path(__file__).parent.glob("*/questions.py")):
    register(import_module(f"{__name__}.{_folder}.questions").SET)
