"""The exercises and their machinery; installed, this folder is the package `kfcourse.exercises`.

sets         the exercise sets, a folder each
checks       is an answer right, and what kind of mistake is it?
derivations  a student's derivation, read and checked line by line
notebooks    student notebooks and worked solutions for any variant
grading      a folder of returned notebooks
commands     `kfcourse exercises`, `solutions`, `grade`
"""

from pathlib import Path

import kfcourse

_HERE, _PACKAGE = Path(__file__).resolve().parent, Path(kfcourse.__file__).resolve().parent
if _HERE not in (_PACKAGE / "exercises", _PACKAGE.parent / "exercises"):  # installed, in a checkout
    raise ImportError(
        f"kfcourse is that of {_PACKAGE}, but its exercises are those of {_HERE}: two copies of "
        f"the project are mixed. "
        f"Install the one you want (`pip install -e {_PACKAGE.parent}`) or take it off PYTHONPATH."
    )
# Notebooks that were handed out before there was the folder sets/ import a set's companion from
# here.
__path__.append(str(_HERE / "sets"))
