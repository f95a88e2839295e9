"""In the kernel of a notebook that is graded: limits of its process, and the exercise as it was handed out.

kfcourse_watch = Watch("a", "53", memory=4 * 2**30)    # the first cell
task = kfcourse_watch()                                # before each check: whatever the notebook has made of `task`
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from types import FunctionType, ModuleType
from typing import Any

from kfcourse.checks import Exercise, exercise

FILE = 100 * 2**20  # bytes a notebook may write to one file


class Changed(Exception):
    """The notebook has replaced functions that the checks are made of; the message names them."""


class Watch:
    """Opens an exercise, sets the limits, and remembers the functions that the checks use.

    Parameters
    ----------
    letter, variant
        As `exercise` takes them.
    memory : int
        Bytes the process may have, where the system can limit it.
    """

    def __init__(self, letter: str, variant: str | Mapping[str, Any], memory: int):
        self._exercise = exercise(letter, variant)
        self._functions = dict(_functions())
        limit(memory)

    def __call__(self) -> Exercise:
        """The exercise; Changed if a check could not be relied on any more."""
        now = dict(_functions())
        changed = [".".join(place) for place, function in self._functions.items() if now.get(place) is not function]
        if changed:
            raise Changed(f"the notebook replaces {', '.join(changed[:3])}")
        return self._exercise


def _functions() -> Iterator[tuple[tuple[str, ...], Any]]:
    """Functions, their code, and classes of this package, and those of NumPy and SymPy that have a short name: by place."""
    for name, module in list(sys.modules.items()):
        if not isinstance(module, ModuleType) or not (name in ("numpy", "sympy") or name.split(".")[0] == "kfcourse"):
            continue
        for key, value in list(vars(module).items()):
            if not callable(value):
                continue
            yield (name, key), value
            if isinstance(value, FunctionType):
                yield (name, key, "__code__"), value.__code__
            elif isinstance(value, type) and value.__module__ == name:
                for attribute, method in vars(value).items():
                    if callable(method) or isinstance(method, property | classmethod | staticmethod):
                        yield (name, key, attribute), method


def limit(memory: int) -> None:
    """Limit this process and its children, where the system can: memory, size of files, no core dumps."""
    try:
        import resource
    except ImportError:  # Windows
        return
    for kind, bound in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_FSIZE, FILE), (resource.RLIMIT_CORE, 0)):
        try:
            _, hard = resource.getrlimit(kind)
            bound = bound if hard == resource.RLIM_INFINITY else min(bound, hard)
            resource.setrlimit(kind, (bound, bound))
        except (ValueError, OSError):  # this system knows no such limit
            continue
