"""Keys of set f: moments, correction and prediction of a density at nodes, a run, and how many
nodes are needed."""

from __future__ import annotations

import numpy as np

from kfcourse.exercises.sets.f_exact.companion import Law
from kfcourse.laws import Array


def moments(density: Array, x: Array) -> tuple[Array, Array, Array]:
    """The normalised density, its mean and its variance."""
    h = x[1] - x[0]
    q = density / (h * density.sum())
    mean = h * np.sum(q * x)
    variance = h * np.sum(q * (x - mean) ** 2)
    return q, mean, variance


def normal(value: Array, mean: Array, variance: Array) -> Array:
    """The normal density at the value."""
    return np.exp(-((value - mean) ** 2) / (2 * variance)) / np.sqrt(2 * np.pi * variance)


def correct(predicted: Array, y: float, x: Array, see: Law) -> tuple[Array, Array]:
    """Bayes' rule: the posterior density, and the density of the measurement."""
    joint = predicted * normal(np.asarray(y), *see(x))
    evidence = (x[1] - x[0]) * joint.sum()
    return joint / evidence, evidence


def predict(posterior: Array, x: Array, move: Law) -> Array:
    """The transition density integrated over the posterior; P[i, j] leads from node j to node i,
    (M, M)."""
    h, (mean, variance) = x[1] - x[0], move(x)
    P = normal(x[:, None], mean, variance)
    return h * P @ posterior


def run_filter(y: Array, x: Array, prior: Array, move: Law, see: Law) -> tuple[Array, Array, Array]:
    """Means, variances and ln p(y); a missing measurement (NaN) leaves the prediction."""
    predicted, laws, total = prior, [], np.zeros(())
    for y_k in y:
        missing = np.isnan(y_k)
        q, evidence = (predicted, 1.0) if missing else correct(predicted, y_k, x, see)
        laws.append(moments(q, x)[1:])
        total = total + np.log(evidence)
        predicted = predict(q, x, move)
    z, p = np.array(laws).T
    return z, p, total


def nodes_needed(low: float, high: float, sigma: float, error: float) -> Array:
    """Nodes from low to high so that the rule's error, 2 exp(-2 (pi sigma/h)^2), is at most
    `error`."""
    step = np.pi * sigma * np.sqrt(2 / np.log(2 / error))
    return np.asarray(np.ceil((high - low) / step) + 1)
