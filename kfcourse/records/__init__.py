"""What a whole record of measurements tells: its past, once the rest is known, how likely it was,
and what in it is doubtful.

smoothing    `smooth`: the states given all measurements, or some steps ahead; `smooth_iterated`:
             linearised there again
evidence     `likelihood`: of each measurement, given all before it
estimation   `estimate`: parameters and noise variances of the largest likelihood, and what the
             record does not tell; `profile`
reading      `read_measurements`: measurements, times and inputs from a CSV file
examination  `examine`: all that a filter says of a record; `findings`: whether the record bears it
             out; `weights`: how much each measurement counted, behind a gate or where the filter
             doubts
"""

from kfcourse.records.estimation import estimate, profile
from kfcourse.records.evidence import likelihood
from kfcourse.records.examination import examine, findings, weights
from kfcourse.records.reading import read_measurements
from kfcourse.records.smoothing import smooth, smooth_iterated

__all__ = [
    "estimate",
    "examine",
    "findings",
    "likelihood",
    "profile",
    "read_measurements",
    "smooth",
    "smooth_iterated",
    "weights",
]
