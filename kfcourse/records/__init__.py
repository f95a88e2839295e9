"""What a whole record of measurements tells: its past, once the rest is known, how likely it was, and what in it is doubtful.

smoothing    `smooth`: the states given all measurements, or some steps ahead; `smooth_iterated`: linearised there again
evidence     `likelihood`: of each measurement, given all before it; `likelihood_error`: how good it is
estimation   `estimate`: parameters and noise variances of the largest likelihood, and what the record does not tell; `profile`
outliers     `weights`: how much each counted, behind a gate or where the filter doubts
"""

from kfcourse.records.estimation import estimate, profile
from kfcourse.records.evidence import likelihood, likelihood_error
from kfcourse.records.outliers import weights
from kfcourse.records.smoothing import smooth, smooth_iterated

__all__ = ["estimate", "likelihood", "likelihood_error", "profile", "smooth", "smooth_iterated", "weights"]
