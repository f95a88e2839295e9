"""Can every question of the exercises be posed for a variant?"""

from __future__ import annotations

from kfcourse.exercises.checks.exercises import Exercise, ExerciseError
from kfcourse.exercises.checks.registry import sets
from kfcourse.lab.quality import Finding
from kfcourse.lab.variants import Variant


def unposed(variant: Variant) -> Finding | None:
    """The first question about the variant's model that cannot be posed; None if all can.

    Its right answer fails, or is not accepted.
    """
    for letter, set_ in sets().items():
        if not set_.about_variant:
            continue
        try:
            exercise = Exercise(letter, variant)
        except ExerciseError as error:
            return Finding(False, str(error))
        for name, question in exercise.questions.items():
            try:
                result = exercise.check(name, question.answer(exercise))
                trouble = result.trouble
            except Exception as error:  # whatever a degenerate model leads to
                trouble = f"{type(error).__name__}: {error}"
            if trouble:
                return Finding(
                    False, f"question {name} of the exercises cannot be posed ({trouble})"
                )
            if not result.passed:
                return Finding(
                    False,
                    f"question {name} of the exercises does not accept its own answer: "
                    f"{result.message}",
                )
    return None
