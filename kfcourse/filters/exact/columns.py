"""What the columns of the exact filter's tables hold, for compiled and for plain code."""

Q = 8  # points of a panel: polynomials of degree 7

# A panel's row: log-densities at its points, its ends, log-likelihoods at its points.
LEFT, RIGHT, LIKELY, KEPT = Q, Q + 1, Q + 2, 2 * Q + 2

# A row for each trajectory and mode: mean, variance, ln p(y, mode | the past), error of this step,
# how it ended, the mode's probability before and after the measurement, the mass that is lost.
MEAN, VARIANCE, EVIDENCE, ERROR, STATUS, EXPECTED, PROBABILITY, LOST, NUMBERS = range(9)
