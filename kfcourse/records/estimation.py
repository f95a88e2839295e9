r"""What a record says of the model itself: parameters and noise variances at which it was likeliest.

    theta = argmax ln p(y; theta),        Cov(theta) ≈ I^-1,   I = - d^2 ln p / dtheta^2  at theta

I is the observed information.  A direction in which it vanishes is one that the record does not see: parameters along it may be
changed together, and nothing measured tells.  Such a direction is named, and its standard errors are infinite.

With the normal laws of a nonlinear filter ln p is an approximation, and so is theta: its bias does not shrink with the record.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import scipy

from kfcourse.errors import expect
from kfcourse.filters.approximations import aof
from kfcourse.filters.base import Filter
from kfcourse.laws import Array
from kfcourse.records.evidence import likelihood
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import gaussian

STEP = 1e-3  # of the differences that stand for derivatives, in the coordinates below
FLAT = 0.01  # information that is none: the likelihood of an e times larger variance differs by half of this


class NoMaximum(ValueError):
    """The search found none; `model` is where it ended.

    The likelihood of a gated filter jumps where a measurement begins to pass, and a maximum beside a jump has no derivatives.
    """

    def __init__(self, reason: str, model: Model, names: Sequence[str]) -> None:
        at = ", ".join(f"{name} = {float(model.parameters[name]):.6g}" for name in names)
        super().__init__(
            f"no maximum of the likelihood was found ({reason}; last at {at}): begin nearer to it, fix a parameter, or leave out "
            "the measurements that a gate refuses, in the place of the gate"
        )
        self.model = model


class Likeliest(NamedTuple):
    """Parameters of the largest likelihood.

    Attributes
    ----------
    names : tuple of str
    value, standard_error : ndarray (parameters,)
        Infinite errors where the record does not tell.
    log_likelihood : float
    model : Model
        The model with these values.
    flat : tuple of str
        What the record does not tell, one sentence for each direction; empty if it tells all.
    """

    names: tuple[str, ...]
    value: Array
    standard_error: Array
    log_likelihood: float
    model: Model
    flat: tuple[str, ...]


def _normal_filter(model: Model) -> Filter:
    return aof(gaussian(model))


def estimate(
    model: Model | Mapping[str, Any],
    y: Array,
    unknown: Sequence[str],
    positive: Sequence[str] = (),
    build: Callable[[Model], Filter] = _normal_filter,
) -> Likeliest:
    """Parameters of a model from measurements, by maximum likelihood.

    Parameters
    ----------
    model : Model, or a table as of [variants.NAME]
        Its values are where the search begins.  Variances are parameters too: `meter_noise={"variance": "r"}`.
    y : ndarray (steps, runs, p)
        As for `run`; several runs are independent records of the same object.
    unknown : sequence of str
        Names of the parameters to find.
    positive : sequence of str
        Those among them that are positive, such as variances: they are sought on the logarithm.
    build : callable
        Model -> Filter, whose likelihood it is; `aof(gaussian(model))` by default.

    Returns
    -------
    Likeliest
        The nearest maximum uphill; start elsewhere to see whether there is another.

    Raises
    ------
    ModelError
        Names that are no parameters, or a start that is not positive.
    ValueError
        No likelihood at the start, as of `likelihood`, or no maximum found (`NoMaximum`).

    Examples
    --------
    >>> from kfcourse.records import estimate
    >>> from kfcourse.scenarios.benchmarks import local_level, nile
    >>> found = estimate(local_level(q=1000, r=10000), nile(), ["q", "r"], positive=["q", "r"])
    >>> [round(value, 1) for value in found.value.tolist()], round(found.log_likelihood, 4)
    ([1468.5, 15099.7], -641.5856)
    """
    expect(model, Model, "estimate", Mapping)
    model = model if isinstance(model, Model) else Model.of_table(model)
    names, logs, start = _checked(model, unknown, positive)
    # Coordinates: the logarithm of what is positive; what may have any sign in units of its start.
    unit = np.where(logs | (start == 0), 1.0, np.abs(start))

    def parameters(c: Array) -> Array:
        return np.where(logs, np.exp(np.where(logs, c, 0.0)), c * unit)

    def log_likelihood(c: Array) -> float:
        here = model.replace(**dict(zip(names, parameters(c).tolist(), strict=True)))
        return float(likelihood(build(here), y).sum())

    def cost(c: Array) -> float:
        try:
            with np.errstate(all="ignore"):
                return -log_likelihood(c)
        except ValueError:  # a step too far, where there is no model or no likelihood: the search takes a shorter one
            return np.inf

    derivatives = cache(lambda c: _derivatives(cost, np.array(c)))
    first = np.where(logs, np.log(np.where(logs, start, 1.0)), start / unit)
    log_likelihood(first)  # says what is wrong with the start
    found = scipy.optimize.minimize(
        cost, first, method="trust-exact", jac=lambda c: derivatives(tuple(c))[0], hess=lambda c: derivatives(tuple(c))[1],
        options={"gtol": 1e-6 * max(1.0, abs(cost(first))), "maxiter": 60},
    )  # fmt: skip
    value, information = parameters(found.x), derivatives(tuple(found.x))[1]
    if not (found.success and np.isfinite(information).all() and np.linalg.eigvalsh(information).min() > -FLAT):
        raise NoMaximum(found.message, model.replace(**dict(zip(names, value.tolist(), strict=True))), names)
    covariance, flat = _inverse(information, names)
    error = np.sqrt(covariance) * np.where(logs, value, unit)
    best = model.replace(**dict(zip(names, value.tolist(), strict=True)))
    return Likeliest(names, value, error, -float(found.fun), best, flat)


def profile(
    model: Model,
    y: Array,
    unknown: Sequence[str],
    name: str,
    values: Sequence[float],
    positive: Sequence[str] = (),
) -> Array:
    """The largest ln p(y) for given values of one parameter, (values,): over all others that are unknown.

    Where it has fallen by 1.92 from its maximum ends the 95 % interval of a long record.
    Of the normal filter; arguments and errors as of `estimate`.
    """
    expect(model, Model, "profile")
    others = [other for other in unknown if other != name]
    found = []
    for value in values:
        model = model.replace(**{name: value})
        if others:
            best = estimate(model, y, others, [other for other in positive if other != name])
            model = best.model  # the next search begins here
            found.append(best.log_likelihood)
        else:
            found.append(float(likelihood(_normal_filter(model), y).sum()))
    return np.array(found)


def _checked(model: Model, unknown: Sequence[str], positive: Sequence[str]) -> tuple[tuple[str, ...], Array, Array]:
    """Names, whether each is positive, and values at the start."""
    names = (unknown,) if isinstance(unknown, str) else tuple(unknown)
    positive = (positive,) if isinstance(positive, str) else tuple(positive)
    if not names or len(set(names)) < len(names) or not set(names) <= set(model.parameters):
        raise ModelError(
            f"unknown must name parameters of the model, each once: it has {', '.join(model.parameters) or 'none'}; "
            f"got {', '.join(names) or 'none'}"
        )
    if not set(positive) <= set(names):
        raise ModelError(f"positive names {', '.join(sorted(set(positive) - set(names)))}, which is not among the unknown")
    start = np.array([float(model.parameters[name]) for name in names])
    logs = np.array([name in positive for name in names])
    if (start[logs] <= 0).any():
        raise ModelError(f"what is positive must begin positive: {names[int(np.argmax(logs & (start <= 0)))]} is not")
    return names, logs, start


def _derivatives(function: Callable[[Array], float], c: Array) -> tuple[Array, Array]:
    """Gradient and second derivatives by central differences."""
    middle, axes = function(c), STEP * np.eye(len(c))
    ahead, behind = (np.array([function(c + sign * axis) for axis in axes]) for sign in (1, -1))
    second = np.diag((ahead - 2 * middle + behind) / STEP**2)
    for i in range(len(c)):
        for j in range(i):
            corners = [s * t * function(c + s * axes[i] + t * axes[j]) for s in (1, -1) for t in (1, -1)]
            second[i, j] = second[j, i] = sum(corners) / (4 * STEP**2)
    return (ahead - behind) / (2 * STEP), second


def _inverse(information: Array, names: Sequence[str]) -> tuple[Array, tuple[str, ...]]:
    """Variances of the coordinates, and a sentence for each direction without information."""
    values, directions = np.linalg.eigh(information)
    blind = values < FLAT
    variance = (directions[:, ~blind] ** 2 / values[~blind]).sum(axis=1)
    sentences = []
    for direction in directions.T[blind]:
        part = {name: one for name, one in zip(names, direction.tolist(), strict=True) if abs(one) > 0.1}
        variance[[names.index(name) for name in part]] = np.inf
        together = ", ".join(f"{name} ({one / max(part.values(), key=abs):+.2g})" for name, one in part.items())
        sentences.append(
            f"the record does not tell {together} apart: changed together in these proportions they leave its likelihood as it is"
            if len(part) > 1
            else f"the record does not tell {', '.join(part)}: its likelihood does not depend on it here"
        )
    return variance, tuple(sentences)
