"""Opening a set for a variant, and what is said if there is none."""

import pytest

from kfcourse.exercises.checks import ExerciseError, exercise
from kfcourse.lab import VariantError


def test_no_such_set_question_or_variant():
    with pytest.raises(ExerciseError, match="no exercise set 'zz'; there are a, b"):
        exercise("zz")
    with pytest.raises(ExerciseError, match="no question 'b1'; it has a1, a2"):
        exercise("a", "53").check("b1", None)
    with pytest.raises(VariantError, match="no variant 'none'; there are 53"):
        exercise("a", "none")
    with pytest.raises(VariantError, match="variant own in this notebook"):
        exercise("a", {"state": "x +", "meter": "x + w"})
    with pytest.raises(VariantError, match="variant J1 jumps between modes"):
        exercise("r", "J1")  # its questions do not use the model, its checks do
