"""Monte Carlo: all filters on common trajectories, designed where they need it, compared with standard errors.

widths        how wide to draw their initial states
ensemble      the trajectories that a seed stands for, drawn in blocks
batches       how an ensemble is cut
designing     coefficients of DUOF, FOS, MFOS: regressions over an ensemble
experiment    `run`, `predictions`, `compare`: splits the seed into designing and comparing, runs all filters together
blocks        one block of trajectories: all filters advance together
exceptional   trajectories on which the fast filters disagree: the slow ones are to see them
slow_filters  on as many of the trajectories as a budget allows;  parallel: on all cores
statistics    means over batches of trajectories, standard errors
two_phase     the same where slow filters ran on a part of them, and where filters were designed several times
comparison    `Comparison`: error variances, paired differences, ranking, distance from the exact filter
cramer_rao    `posterior_bound`: what no filter can beat, without running one
"""
