"""Self-checks of the exercises: `exercise("a", variant="53").check("a1", answer)`."""

from kfcourse.checks.exercises import Exercise, ExerciseError, exercise
from kfcourse.checks.question import Mistake, Question, Result
from kfcourse.checks.registry import ExerciseSet, sets

__all__ = ["Exercise", "ExerciseError", "ExerciseSet", "Mistake", "Question", "Result", "exercise", "sets"]
