"""The absolutely optimal filter itself: the Stratonovich equation by point masses, for scalar models.

    p(x_k | y_0..k) = C p(y_k | x_k) Integral p(x_{k-1} | y_0..k-1) p(x_k | x_{k-1}) dx_{k-1}

The posterior is held as masses on nodes (point masses), so the integral is a sum of normal kernels, one for each node.  Its
estimate, the posterior mean, has the least mean square error of all filters: it bounds what any approximation can reach.
Stratonovich (1960); the nodes that follow each trajectory are ours.

The lab's noises are multiplicative: densities are many orders of magnitude narrower at the end of a run than at its
beginning, and within one step the posterior may be thousands of times narrower than the prediction, far narrower than any
fixed grid would see.  So each trajectory gets its own nodes at every step.  A step takes these ways, read in this order:

pointmasses  the filter: a step, its ways, and the budget of its error
prediction   from a posterior to the next prediction: a sum of normal kernels (kernels), also between the nodes (narrow), or
             an integral over the noise (noise); where panels make kernels crowd, of fewer (merging)
places       where the new posterior lies: the states that explain the measurement
batch        nodes x = c + s sinh t there, Bayes' rule, and an estimate of the error: for many trajectories at once
roots        or, for a meter without noise, the few states that explain it
adaptive     for what they do not resolve, one trajectory at a time: panels that are halved until they do (panels)
evidence     and how likely the measurement was, for who asks
smoothing    what the whole record tells, once it is there
jumps        the same of state and mode, for models that jump
usual        the way that most trajectories take, compiled by numba (loops)
constants    what several of these share

Which models of the course need which: over 8 steps and 40 trajectories of each of the 13 shipped scalar variants, `narrow`
was called for 6 only and `adaptive` for 2 only, the rest is `batch` alone. Of the first 150 models that `kfcourse variants
--generate` draws with seed 1, well posed or not, 135 are scalar. Over 8 steps and 20 trajectories 69 of them need `narrow`
and 54 `adaptive`; `noise` takes part in two, of which one, the 105th, would end at its second step without it. A noise that
grows with the square of the state, as e*x**2*v, lives on it. `roots` is for meters without noise: none of these has one,
models of one's own may (f = 0).
"""
