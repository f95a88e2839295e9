"""Monte Carlo: all filters on common trajectories, compared with standard errors.

ensemble    the trajectories that a seed stands for
designing   coefficients of DUOF, FOS, MFOS: regressions over an ensemble
experiment  `run`, `predictions`, `compare`: all filters, the exact one too, on the same batches of
            trajectories
scores      how good predictions of measurements are, doubt and all
statistics  means over batches, and the jackknife over them
comparison  `Comparison`: error variances, paired differences, ranking, distance from the exact
            filter
modes       how well filters know the mode of a model that jumps
cramer_rao  `posterior_bound`: what no filter can beat, without running one
parallel    the workers of a Dask scheduler in the place of threads
"""

BATCHES = 64  # of a comparison: standard errors from 64 batches are themselves good to 9 %
FEWEST = 2 * BATCHES  # trajectories of a comparison that is to decide something
