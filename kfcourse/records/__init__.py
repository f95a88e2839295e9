"""What a whole record of measurements tells: its past, once the rest of it is known.

smoothing    `smooth`: the states given all measurements, or some steps ahead; `smooth_iterated`: linearised there again
"""

from kfcourse.records.smoothing import smooth, smooth_iterated

__all__ = ["smooth", "smooth_iterated"]
