"""The package as a returned notebook sees it: a copy without the right answers, and personal
numbers in their place."""

from __future__ import annotations

import compileall
import shutil
from importlib import resources
from pathlib import Path

from kfcourse.exercises.checks import sets

LEFT_OUT = "cli.py", "__main__.py", "exercises"  # what a student's notebook has no use for
# What it needs of the exercises.
NEEDED = (
    "__init__.py",
    "checks/*.py",
    "derivations/*.py",
    *(f"grading/{name}.py" for name in ("__init__", "channel", "session", "values")),
    "sets/*/companion.py",  # what the notebooks of a set import; never a key
)
ANSWERS = "derivations/worked.py"  # writes right derivations
FONTS = "fonts"  # on the stage: those that matplotlib has found

REGISTRY = '''"""The exercise sets without their questions: what a notebook is graded with."""

from pathlib import Path

from kfcourse.exercises.checks.registry import ExerciseSet, register

NUMBERS = {}  # "letter variant" to personal numbers


def _numbers(task):
    try:
        return dict(NUMBERS[f"{task.letter} {task.variant.name}"])
    except KeyError:
        name = f"set {task.letter}, variant {task.variant.name}"
        raise ValueError(f"personal numbers of {name} are not yours") from None


for _letter, _title, _name, _about, _angles in {rows!r}:
    _folder = Path(__file__).parent / _name
    register(
        ExerciseSet(
            _letter, _title, _folder, (), numbers=_numbers, about_variant=_about, angles=_angles
        )
    )
'''


def stage(folder: Path) -> Path:
    """Write the package into a folder for graded notebooks: a copy without keys, questions,
    mistakes and masters.

    Only that copy is on the path where a returned notebook runs.

    Returns
    -------
    Path
        What belongs on the path.
    """
    own, machinery = packages()
    target = folder / "kfcourse"
    shutil.copytree(own, target, ignore=lambda at, names: LEFT_OUT if Path(at) == own else ())
    for path in (path for pattern in NEEDED for path in machinery.glob(pattern)):
        copied = target / "exercises" / path.relative_to(machinery)
        if path != machinery / ANSWERS:
            copied.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(path, copied)
    rows = [
        (set_.letter, set_.title, set_.folder.name, set_.about_variant, set_.angles)
        for set_ in sets().values()
    ]
    (target / "exercises" / "sets" / "__init__.py").write_text(
        REGISTRY.replace("{rows!r}", repr(rows)), encoding="utf-8"
    )
    compileall.compile_dir(target, quiet=2)
    (folder / FONTS).mkdir()
    # otherwise each process searches for fonts again
    for path in _cache_of_matplotlib().glob("fontlist*.json"):
        shutil.copy(path, folder / FONTS)
    return folder


def _cache_of_matplotlib() -> Path:
    import matplotlib  # a tenth of the start of a grading process, which stages nothing

    return Path(matplotlib.get_cachedir())


def packages() -> list[Path]:
    """Folders of the package and of the exercises, with the right answers: no notebook may read
    them."""
    return [Path(str(resources.files(name))) for name in ("kfcourse", "kfcourse.exercises")]
