"""Adding a set touches one folder: it is found, checked and rendered without a word anywhere
else."""

from textwrap import dedent

import pytest

from kfcourse.exercises.checks import exercise, registry, sets
from kfcourse.exercises.notebooks.master import read, render
from kfcourse.exercises.sets import discover

QUESTIONS = """
from pathlib import Path

from kfcourse.exercises.checks import ExerciseSet, Question
from kfcourse.exercises.checks.question import Mistake


def twice(x):
    return 2 * x


QUESTION = Question("y1", "twice", "warm-up", twice, lambda e: [(3.0,)], (Mistake("once", "A factor.", lambda x: x),))
SET = ExerciseSet("y", "Doubling", Path(__file__).parent, (QUESTION,))
"""
STATEMENT = """
# [= title =]

[= heading("y1") =]

```{code-cell} python
def twice(x):
    # BEGIN SOLUTION
    return x + x
    # END SOLUTION
```

[= check("y1") =]
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of sets beside the course's own."""
    folder = tmp_path / "own_sets"
    for name, text in {
        "y_doubling/questions.py": QUESTIONS,
        "y_doubling/statement.md": STATEMENT,
        "notes/no_set.py": "",
    }.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(dedent(text).lstrip())
    monkeypatch.syspath_prepend(tmp_path)
    return folder


def test_a_new_folder_is_a_new_set(package, monkeypatch):
    (discovered,) = discover(package.name, package)
    assert (discovered.letter, discovered.name, discovered.folder) == (
        "y",
        "y-doubling",
        package / "y_doubling",
    )
    monkeypatch.setattr(registry, "_registered", dict(sets()))
    registry.register(discovered)
    task = exercise("y", "53")
    assert task.check("y1", lambda x: x + x).passed
    assert task.check("y1", lambda x: x).diagnosis == ("once",)
    cells = [cell.source for cell in render(read("y"), task).cells]
    assert cells[0] == "# Doubling\n\n## Question 1 (warm-up): twice"
    assert cells[-1] == 'task.check("y1", twice)'


def test_a_letter_is_taken_once():
    with pytest.raises(ValueError, match="two exercise sets 'a'"):
        registry.register(sets()["a"])


def test_every_folder_is_a_set():
    folder = sets()["a"].folder.parent
    assert sorted(set_.folder for set_ in sets().values()) == sorted(
        path.parent for path in folder.glob("*/statement.md")
    )
