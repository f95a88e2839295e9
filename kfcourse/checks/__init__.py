"""Self-checks of the exercises: `exercise("a", variant="53").check("a1", answer)`."""

from kfcourse.checks.engine import Mistake, Question, Result
from kfcourse.checks.exercise import SETS, Exercise, ExerciseError, exercise

__all__ = ["SETS", "Exercise", "ExerciseError", "Mistake", "Question", "Result", "exercise"]
