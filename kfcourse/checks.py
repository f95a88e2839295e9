"""What a notebook opens its exercise with: `from kfcourse.checks import exercise`.  The machinery
is in `kfcourse.exercises.checks`."""

from kfcourse.exercises.checks import exercise

__all__ = ["exercise"]
