"""Linear systems given by matrices: the Kalman filter in four arithmetic forms, and tests of
consistency.

system        `LinearSystem`: A, H, Q, R, B, checked
arithmetic    one correction and prediction in four forms: textbook, symmetrised, Joseph, square
              root
runs          the filter along stored measurements; simulation
smoothing     the same looked back upon: Rauch, Tung and Striebel's backward pass, which every
              smoother shares
em            Q and R from a record, by expectation and maximisation
accuracy      covariances in advance, for any gains; the steady state of the Riccati equation
consistency   NEES, NIS, whiteness, confidence ellipses: is a filter right about its own errors?
"""

from kfcourse.linear.accuracy import covariances, steady_state
from kfcourse.linear.em import em_rounds
from kfcourse.linear.runs import Run, run, simulate
from kfcourse.linear.smoothing import smooth
from kfcourse.linear.system import LinearSystem

__all__ = [
    "LinearSystem",
    "Run",
    "covariances",
    "em_rounds",
    "run",
    "simulate",
    "smooth",
    "steady_state",
]
