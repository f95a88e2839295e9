"""What the columns of the exact filter's tables hold, for compiled and for plain code."""

Q = 8  # points of a panel: polynomials of degree 7

# A panel's row: log-densities at its points, its ends, log-likelihoods at its points.
LEFT, RIGHT, LIKELY, KEPT = Q, Q + 1, Q + 2, 2 * Q + 2

# A row for each trajectory and mode: mean, variance, ln p(y, mode | the past), error of this step,
# how it ended, the mode's probability; its probability, mean and variance at the next step; the
# mass that is lost.
MEAN, VARIANCE, EVIDENCE, ERROR, STATUS, PROBABILITY = range(6)
EXPECTED, NEXT_MEAN, NEXT_VARIANCE, LOST, NUMBERS = range(6, 11)
