"""The exercise sets that there are.  Sets register; nothing here knows one of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any

from kfcourse.exercises.checks.question import Question

_registered: dict[str, ExerciseSet] = {}


@dataclass(frozen=True)
class ExerciseSet:
    """An exercise set.

    Attributes
    ----------
    letter, title : str
    folder : Path
        Holds statement.md.
    questions : tuple of Question
    chapters : tuple of str
        Files of the book that the set belongs to.
    numbers : callable, optional
        Exercise -> personal numbers by name, for a set that needs others than the variant's.
    about_variant : bool
        Whether the questions are about the variant's model; otherwise the set has a model of its
        own.
    angles : tuple of {"x", "y"}
        Which of state and measurement may have components that are angles, if the questions are
        about the variant's model.
    """

    letter: str
    title: str
    folder: Path
    questions: tuple[Question, ...]
    chapters: tuple[str, ...] = ()
    numbers: Callable[[Any], dict[str, float]] | None = None
    about_variant: bool = True
    angles: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of its files: "a-structural-functions"."""
        return self.folder.name.replace("_", "-")


def register(set_: ExerciseSet) -> None:
    """Add a set; ValueError if its letter is taken."""
    if set_.letter in _registered:
        raise ValueError(
            f"two exercise sets {set_.letter!r}: {_registered[set_.letter].folder} and "
            f"{set_.folder}"
        )
    _registered[set_.letter] = set_


def folders() -> set[Path]:
    """Folders in which the sets that are registered now live."""
    return {set_.folder for set_ in _registered.values()}


def sets() -> Mapping[str, ExerciseSet]:
    """All exercise sets by letter; the package of sets, which registers them, is imported at the
    first call."""
    import_module("kfcourse.exercises.sets")
    return MappingProxyType(_registered)
