"""Self-checks of the exercises: `exercise("a", variant="53").check("a1", answer)`.

question    what a question is: key, hidden arguments, known mistakes; what a check says
registry    the sets that there are; they register, nothing here knows one
exercises   a set for a variant: what a notebook opens
steps       questions about a model with time and inputs: functions that take the step
derived     a question whose answer is a derivation, checked line by line
reference   a question in an exercise: its hidden arguments, what our own answers give
engine      is an answer right, or a step on top of a wrong one?  How long may it take?
diagnosis   what kind of mistake does a wrong answer look like?
hints       what can be said of any wrong answer
case        one result of a wrong answer beside the right one, with other arguments too
editing     known mistakes and other slips: changes of a key's source
failing     one input of a wrong answer, and what it gives there
equality    are two formulas, two arrays equal?
posing      can every question be posed for a variant?
"""

from kfcourse.exercises.checks.derived import Derivation
from kfcourse.exercises.checks.exercises import Exercise, ExerciseError, exercise
from kfcourse.exercises.checks.question import Attempts, Mistake, Question, Result
from kfcourse.exercises.checks.registry import ExerciseSet, sets

__all__ = [
    "Attempts",
    "Derivation",
    "Exercise",
    "ExerciseError",
    "ExerciseSet",
    "Mistake",
    "Question",
    "Result",
    "exercise",
    "sets",
]
