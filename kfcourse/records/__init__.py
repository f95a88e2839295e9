"""What a whole record of measurements tells: its past, once the rest of it is known, and how likely it was.

smoothing    `smooth`: the states given all measurements, or some steps ahead; `smooth_iterated`: linearised there again
evidence     `likelihood`: of each measurement, given all before it
"""

from kfcourse.records.evidence import likelihood
from kfcourse.records.smoothing import smooth, smooth_iterated

__all__ = ["likelihood", "smooth", "smooth_iterated"]
