"""The absolutely optimal filter itself: the Stratonovich equation, for scalar models with modes or
without.

    p(x_k | y_0..k) = C p(y_k | x_k) Integral p(x_{k-1} | y_0..k-1) p(x_k | x_{k-1}) dx_{k-1}

Its estimate, the posterior mean, has the least mean square error of all filters: it bounds what any
approximation can reach.  Stratonovich (1960); panels that follow each trajectory are ours.  The
lab's noises are multiplicative: densities are many orders of magnitude narrower at the end of a run
than at its beginning, and within one step the posterior may be thousands of times narrower than the
prediction, far narrower than any fixed grid would see.  So each trajectory gets its own panels at
every step.

pointmasses  the filter, its smoother, likelihood and refusals
panels       a step of it, compiled
laws         the model, printed as a small function that the step calls
columns      what their tables hold
"""
