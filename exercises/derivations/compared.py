"""Are two lines equal?  By values at random points, with a bound of their rounding."""

from __future__ import annotations

import numpy as np

from kfcourse.exercises.derivations.setting import Setting
from kfcourse.exercises.derivations.terms import Node
from kfcourse.exercises.derivations.values import ROUNDING, Values, agree

EQUAL, DIFFERENT, IF_POSITIVE, NO_VALUE = "equal", "different", "equal if positive", "no value"
FEWEST = 4  # points at which both have values
# of a value: what its rounding may be, that it can be compared; tan(1e16) has no value
CLEAR = 1e-4


def compare(setting: Setting, first: Node, second: Node) -> str:
    """Whether two trees are equal: "equal", "different", "equal if positive" letters are meant, or
    "no value".

    Raises
    ------
    Uncomputed
        A mean is not computed here.
    """
    values = Values(setting, [first, second])
    pairs = values.sized(first), values.sized(second)
    defined = np.array(
        [
            np.isfinite(value) & (ROUNDING * size < CLEAR * (1 + np.abs(value)))
            for value, size in pairs
        ]
    )
    positive = np.arange(values.points) < values.points / 3
    same = agree(*pairs)
    if (defined.all(axis=0) & positive).sum() < FEWEST:
        return NO_VALUE
    if not same[defined.all(axis=0) & positive].all():
        return DIFFERENT
    # Where only one side has a value, as log(c^2) has and 2 log(c) has not, they are equal for
    # positive letters only.
    return EQUAL if same[defined.any(axis=0)].all() else IF_POSITIVE
