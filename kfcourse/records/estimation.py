r"""What a record says of the model itself: parameters and noise variances at which it was
likeliest.

    theta = argmax ln p(y; theta),        Cov(theta) ≈ I^-1,   I = - d^2 ln p / dtheta^2  at theta

I is the observed information.  A direction in which it vanishes is one that the record does not
see: parameters along it may be changed together, and nothing measured tells.  Such a direction is
named, and its standard errors are infinite.

With the normal laws of a nonlinear filter ln p is an approximation, and so is theta: its bias does
not shrink with the record.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import scipy
from tqdm import tqdm

from kfcourse.errors import expect
from kfcourse.filters.approximations import aof
from kfcourse.filters.base import Filter
from kfcourse.laws import Array
from kfcourse.records.evidence import likelihood
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import gaussian

# of the differences that stand for derivatives, in units by which the likelihood changes by about
# 1: a second one of it errs by STEP^2, and by rounding, 1e-16 of it over STEP^2
STEP = 1e-3
# information of a parameter that is none: the likelihood of an e times larger variance differs by
# half of this
FLAT = 0.01
DIRECTION = 0.01  # of a direction of length 1: components below are rounding of differences
# part of their own information that directions have left where differences cannot tell it from none
TOGETHER = 1e-5


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
        Proportions are those of changes, of positive parameters those of their logarithms.
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
    model: Model,
    y: Array,
    unknown: Sequence[str],
    positive: Sequence[str] = (),
    build: Callable[[Model], Filter] = _normal_filter,
) -> Likeliest:
    """Parameters of a model from measurements, by maximum likelihood.

    Parameters
    ----------
    model : Model
        Its values are where the search begins.  Variances are parameters too:
        `meter_noise={"variance": "r"}`.
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
        No likelihood at the start, as of `likelihood`, or no maximum found.

    Examples
    --------
    >>> from kfcourse.records import estimate
    >>> from kfcourse.scenarios.benchmarks import local_level, nile
    >>> likeliest = estimate(local_level(q=1000, r=10000), nile(), ["q", "r"], positive=["q", "r"])
    >>> [round(value, 1) for value in likeliest.value.tolist()], round(likeliest.log_likelihood, 4)
    ([1468.5, 15099.7], -641.5856)
    """
    expect(model, Model, "estimate")
    names, logs, start = _checked(model, unknown, positive)

    def parameters(t: Array) -> Array:
        return np.where(logs, np.exp(np.where(logs, t, 0.0)), t)

    def at(t: Array) -> Model:
        return model.replace(**dict(zip(names, parameters(t).tolist(), strict=True)))

    def log_likelihood(t: Array) -> float:
        return float(likelihood(build(at(t)), y).sum())

    def cost(t: Array) -> float:
        bar.update()
        try:
            with np.errstate(all="ignore"):
                return -log_likelihood(t)
        # a step too far, where there is no model or no likelihood: the search takes a shorter one
        except ValueError:
            return np.inf

    t = np.where(logs, np.log(np.where(logs, start, 1.0)), start)
    unit = np.where(logs | (start == 0), 1.0, np.abs(start))
    # The likelihood itself says what else is wrong with the start.  The search squares derivatives:
    # beyond 1e100 they overflow.
    if abs(log_likelihood(t)) > 1e100:
        raise ValueError(
            "at the start of the search the measurements are many powers of ten away from what "
            "the model expects of them: look for the one that is wrong, or change the units"
        )
    with tqdm(desc="likelihood", unit=" evaluations", disable=None, delay=2) as bar:
        # the second time in the units that the likelihood has at its maximum
        for _ in range(1 if logs.all() else 2):
            unit = _units(cost, t, unit, logs)
            t, result, information = _climb(cost, t, unit, names)
    best = at(t)
    if not (result.success and np.linalg.eigvalsh(information).min() > -FLAT):
        last = ", ".join(f"{name} = {float(best.parameters[name]):.6g}" for name in names)
        # a gate's likelihood jumps where a measurement begins to pass
        raise ValueError(
            f"no maximum of the likelihood was found; the search ended at {last}: begin nearer to "
            "it, fix a parameter, or leave out the measurements that a gate refuses, in the place "
            "of the gate"
        )
    noise = 10 * np.finfo(float).eps * abs(result.fun) / STEP**2
    variance, flat = _inverse(information, unit, names, noise)
    error = np.sqrt(variance) * np.where(logs, parameters(t), 1.0)
    return Likeliest(names, parameters(t), error, -float(result.fun), best, flat)


def profile(
    model: Model,
    y: Array,
    unknown: Sequence[str],
    name: str,
    values: Sequence[float],
    positive: Sequence[str] = (),
) -> Array:
    """The largest ln p(y) for given values of one parameter, (values,): over all others that are
    unknown.

    Where it has fallen by 1.92 from its maximum ends the 95 % interval of a long record.
    Of the normal filter; arguments and errors as of `estimate`.
    """
    expect(model, Model, "profile")
    others = [other for other in unknown if other != name]
    largest = []
    for value in values:
        model = model.replace(**{name: value})
        if others:
            best = estimate(model, y, others, [other for other in positive if other != name])
            model = best.model  # the next search begins here
            largest.append(best.log_likelihood)
        else:
            largest.append(float(likelihood(_normal_filter(model), y).sum()))
    return np.array(largest)


def _checked(
    model: Model, unknown: Sequence[str], positive: Sequence[str]
) -> tuple[tuple[str, ...], Array, Array]:
    """Names, whether each is positive, and values at the start."""
    names = tuple(unknown)
    if not names or len(set(names)) < len(names) or not set(names) <= set(model.parameters):
        raise ModelError(
            f"unknown must name parameters of the model, each once: it has "
            f"{', '.join(model.parameters) or 'none'}; got {', '.join(names) or 'none'}"
        )
    if not set(positive) <= set(names):
        raise ModelError(
            f"positive names {', '.join(sorted(set(positive) - set(names)))}, which is not among "
            f"the unknown"
        )
    start = np.array([float(model.parameters[name]) for name in names])
    logs = np.array([name in positive for name in names])
    if (start[logs] <= 0).any():
        raise ModelError(
            f"what is positive must begin positive: {names[int(np.argmax(logs & (start <= 0)))]} "
            f"is not"
        )
    return names, logs, start


def _units(cost: Callable[[Array], float], t: Array, unit: Array, logs: Array) -> Array:
    """Changes of each parameter by which the likelihood changes by about 1; as given where none
    does, and of logarithms."""
    here, units = cost(t), unit.copy()
    for i in np.flatnonzero(~logs):
        step = unit[i] * np.eye(len(t))[i]
        for _ in range(20):
            change = max(abs(cost(t + step) - here), abs(cost(t - step) - here))
            if 0.05 < change < 5:
                units[i] = step[i]
                break
            step = step * 4 if change <= 0.05 else step / 4
    return units


def _climb(
    cost: Callable[[Array], float], start: Array, unit: Array, names: Sequence[str]
) -> tuple[Array, Any, Array]:
    """The least cost downhill from a start, what the search says, and second derivatives in these
    units; ValueError, which names the parameter, where the model ends."""

    def scaled(c: Array) -> float:
        return cost(start + unit * c)

    @cache
    def derivatives(c: tuple[float, ...]) -> tuple[Array, Array]:
        with np.errstate(invalid="ignore"):
            slopes, second = _derivatives(scaled, np.array(c))
        if not (inside := np.isfinite(second).all(axis=0)).all():
            name = names[int(np.argmin(inside))]
            raise ValueError(
                f"the search came to a place where a small change of {name} leaves no "
                f"likelihood, as a variance below zero does: declare {name} positive "
                f"(positive=[...], --positive), or begin elsewhere"
            )
        return slopes, second

    result = scipy.optimize.minimize(
        scaled,
        np.zeros(len(start)),
        method="trust-exact",
        jac=lambda c: derivatives(tuple(c))[0],
        hess=lambda c: derivatives(tuple(c))[1],
        options={"gtol": max(1e-4, 1e-8 * abs(cost(start))), "maxiter": 100},
    )
    return start + unit * result.x, result, derivatives(tuple(result.x))[1]


def _derivatives(function: Callable[[Array], float], c: Array) -> tuple[Array, Array]:
    """Gradient and second derivatives by central differences."""
    middle, axes = function(c), STEP * np.eye(len(c))
    ahead, behind = (np.array([function(c + sign * axis) for axis in axes]) for sign in (1, -1))
    second = np.diag((ahead - 2 * middle + behind) / STEP**2)
    for i in range(len(c)):
        for j in range(i):
            corners = [
                s * t * function(c + s * axes[i] + t * axes[j]) for s in (1, -1) for t in (1, -1)
            ]
            second[i, j] = second[j, i] = sum(corners) / (4 * STEP**2)
    return (ahead - behind) / (2 * STEP), second


def _inverse(
    information: Array, unit: Array, names: Sequence[str], noise: float
) -> tuple[Array, tuple[str, ...]]:
    """Variances of the parameters, and a sentence for each direction without information.

    Each parameter's own information comes first, then that of directions of those which have some,
    in units of the standard error that each would have if the others were known.
    """
    own = np.diagonal(information)
    blind = own < FLAT
    sentences = [
        f"the record does not tell {names[i]}: its likelihood does not depend on it here"
        for i in np.flatnonzero(blind).tolist()
    ]
    scale = np.sqrt(np.where(blind, 1.0, own))
    scaled = information / np.outer(scale, scale)
    related = np.where(blind[:, None] | blind, np.eye(len(own)), scaled)
    values, directions = np.linalg.eigh(related)
    known = values > max(TOGETHER, noise)
    variance = (directions[:, known] ** 2 / values[known]).sum(axis=1) * (unit / scale) ** 2
    variance[blind] = np.inf
    for direction in directions.T[~known]:
        part = np.flatnonzero(np.abs(direction) > DIRECTION)
        variance[part] = np.inf
        change = direction[part] * (unit / scale)[part]
        change /= change[np.argmax(np.abs(change))]
        together = ", ".join(
            f"{names[i]} ({size:+.2g})" for i, size in zip(part.tolist(), change, strict=True)
        )
        sentences.append(
            f"the record does not tell {together} apart: changed together in these proportions "
            f"they leave its likelihood as it is"
        )
    return variance, tuple(sentences)
