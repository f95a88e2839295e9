"""The absolutely optimal filter itself: the Stratonovich equation on a grid, for scalar models.

    p(x_k | y_0..k) = C p(y_k | x_k) Integral p(x_{k-1} | y_0..k-1) p(x_k | x_{k-1}) dx_{k-1}

The posterior is held as masses on nodes (point masses).  Its estimate, the posterior mean, has the least
mean square error of all filters, so it bounds what any approximation can reach.

The lab's noises are multiplicative: densities are many orders of magnitude narrower at the end of a run
than at its beginning, and within one step the posterior may be thousands of times narrower than the
prediction, far narrower than any fixed grid would see.  So each trajectory gets its own panels at every step: over
the support of the prediction, geometrically finer towards the states that would explain the measurement
without noise, and then split until a Gauss-Legendre rule resolves the posterior on each of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.filters.densities import likelihood, transition
from kfcourse.laws import Array, Gaussian
from kfcourse.symbolic.equations import compile_noiseless
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError

WIDTH = 8.0  # sigmas covered: 1e-15 of a normal law lies outside
NEGLIGIBLE = 1e-14  # mass of a panel that may be left out
KERNEL = 3.0  # a panel is at most so many sigmas of the transition kernel wide, that the integral be smooth on it
SPLITS = 40  # times a panel may be halved
SECTIONS = np.linspace(0, 1, 257)  # of a bracket, in the search for a zero
SCALES = (0.5, 2.0, WIDTH)  # distances, in kernel sigmas, of panel borders from the prediction's own centres
QUANTILES = np.array([0.02, 0.25, 0.5, 0.75, 0.98])  # of the posterior, where those centres are


class Grid(NamedTuple):
    """A posterior as point masses: nodes x (M,), ascending, their masses (M,), and the density there (M,)."""

    x: Array
    mass: Array
    density: Array

    def mean(self) -> float:
        return float(self.mass @ self.x)

    def variance(self) -> float:
        return float(self.mass @ (self.x - self.mean()) ** 2)


class PointMass(NamedTuple):
    """What the filter remembers of each trajectory: the posterior, and the same by a coarser rule."""

    fine: list[Grid]
    coarse: list[Grid]

    def discretisation_error(self) -> Array:
        """Estimated error of the posterior means, (runs,): the change from the coarser rule.

        The fine rule converges faster, so this overestimates its error.
        """
        return np.array([abs(fine.mean() - coarse.mean()) for fine, coarse in zip(self.fine, self.coarse, strict=True)])


@dataclass(frozen=True)
class Rule:
    """A Gauss-Legendre rule on [-1, 1] that knows whether it resolves a function.

    Attributes
    ----------
    nodes, weights : ndarray (q,)
    tail : ndarray (2, q)
        Gives the two last Legendre coefficients of a function from its values at the nodes.
    tolerance : float
        Largest tail, relative to the mass of all panels, of a resolved panel.
    """

    nodes: Array
    weights: Array
    tail: Array
    tolerance: float

    @classmethod
    def of_order(cls, q: int, tolerance: float) -> Rule:
        nodes, weights = legendre.leggauss(q)
        vander = legendre.legvander(nodes, q - 1)
        scale = (2 * np.arange(q) + 1) / 2
        return cls(nodes, weights, (vander * weights[:, None] * scale).T[-2:], tolerance)


def pointmass(model: Model, order: int = 8, tolerance: float = 1e-5) -> Filter:
    """The exact AOF of a scalar model by point masses.

    Parameters
    ----------
    model : Model
        One state, one measurement, noises entering linearly (with any functions of x as factors).
    order : int
        Nodes on a panel; the error estimate uses order - 3.
    tolerance : float
        Unresolved part of the posterior that a panel may have.  `state.memory.discretisation_error()` tells
        what it leads to.

    Raises
    ------
    ModelError
        The model is not scalar, or a noise enters nonlinearly.
    """
    if model.n != 1 or model.p != 1:
        raise ModelError(
            f"the point-mass filter is for scalar models; this one has {model.n} states and {model.p} measurements: "
            "use particle(model)"
        )
    if order < 6 or not 0 < tolerance < 1:
        raise ModelError(f"the point-mass filter needs order >= 6 and 0 < tolerance < 1, got {order} and {tolerance}")
    bayes = _Bayes(model)
    rules = Rule.of_order(order, tolerance), Rule.of_order(order - 3, 30 * tolerance)
    init = initial_state(model)

    def step(state: State, y: Array) -> State:
        before = state.memory or ([None] * len(y), [None] * len(y))
        after = PointMass(
            *(
                [bayes.posterior(grid, value, rule) for grid, value in zip(grids, y[:, 0], strict=True)]
                for grids, rule in zip(before, rules, strict=True)
            )
        )
        posterior = Gaussian(np.array([[g.mean()] for g in after.fine]), np.array([[[g.variance()]] for g in after.fine]))
        return State(state.step + 1, posterior, bayes.predicted_moments(after.fine), after)

    return Filter("aof-exact", model, init, step, slow=True)


class _Bayes:
    """One step of the Stratonovich equation for one trajectory."""

    def __init__(self, model: Model):
        self.prior = model.prior
        law, log_likelihood, (_, meter) = transition(model), likelihood(model), compile_noiseless(model)
        self.law: Callable[[Array], Gaussian] = lambda x: law(x[:, None])
        self.meter: Callable[[Array], Array] = lambda x: meter(x[:, None])[:, 0] + np.zeros(len(x))
        self.log_likelihood: Callable[[float, Array], Array] = lambda y, x: log_likelihood(np.array([[y]]), x[:, None])

    def posterior(self, before: Grid | None, y: float, rule: Rule) -> Grid:
        """Predict from the posterior before (None: take the prior) and correct with y."""
        mu, sigma, mass = self._kernels(before)
        borders = _prediction_borders(mu, sigma, mass)
        if not np.isnan(y):
            borders = np.union1d(borders, self._explanations(borders, y))

        def log_density(x: Array) -> Array:
            return _log_mixture(x, mu, sigma, mass) + self.log_likelihood(y, x)

        return _resolve(borders, log_density, self._too_wide, rule)

    def predicted_moments(self, grids: list[Grid]) -> Gaussian:
        """Mean (runs, 1) and variance (runs, 1, 1) of the next state: those of a mixture."""
        means, variances = [], []
        for grid in grids:
            mu, sigma, mass = self._kernels(grid)
            means.append(mass @ mu)
            variances.append(mass @ (sigma**2 + (mu - means[-1]) ** 2))
        return Gaussian(np.array(means)[:, None], np.array(variances)[:, None, None])

    def _kernels(self, before: Grid | None) -> tuple[Array, Array, Array]:
        """Means, sigmas and masses (M,) of the normal kernels whose sum is the predicted density."""
        if before is None:
            return self.prior.mean, np.maximum(np.sqrt(self.prior.cov[0]), 1e-150), np.ones(1)
        law = self.law(before.x)
        mu = np.broadcast_to(law.mean[..., 0], before.x.shape)
        sigma = np.sqrt(np.broadcast_to(law.cov[..., 0, 0], before.x.shape))
        return mu, np.maximum(sigma, 1e-150), before.mass

    def _too_wide(self, left: Array, right: Array) -> Array:
        """Panels on which the next prediction's kernel would not be a smooth function of its centre."""
        (a, _), (b, _), (_, variance) = self.law(left), self.law(right), self.law(0.5 * (left + right))
        sigma = np.sqrt(np.broadcast_to(variance[..., 0, 0], left.shape))
        return np.broadcast_to(np.abs(b - a)[..., 0], left.shape) > KERNEL * sigma

    def _explanations(self, borders: Array, y: float) -> Array:
        """Panel borders that approach, by halves, every state that explains y without noise."""
        x = np.unique(np.concatenate([borders, 0.5 * (borders[1:] + borders[:-1])]))
        residual = y - self.meter(x)
        result = []
        for i in np.flatnonzero(np.signbit(residual[1:]) != np.signbit(residual[:-1])):
            low, high = x[i], x[i + 1]
            while True:  # shrink the bracket 256 times at each pass, to the last bit
                inner = low + (high - low) * SECTIONS
                j = int(np.argmax(np.signbit(y - self.meter(inner)[1:]) != np.signbit(residual[i])))
                if not inner[j + 1] - inner[j] < high - low:
                    break
                low, high = inner[j], inner[j + 1]
            offsets = (borders[-1] - borders[0]) * 0.5 ** np.arange(SPLITS)
            near = np.concatenate([low - offsets, low + offsets])
            # Stop approaching where the log-likelihood has become flat.
            drop = self.log_likelihood(y, np.array([low])) - self.log_likelihood(y, near)
            flat = (drop < 0.5).reshape(2, -1).all(axis=0)
            last = int(np.argmax(flat)) + 1 if flat.any() else SPLITS
            result += [low - offsets[:last], low + offsets[:last]]
        found = np.concatenate([*result, np.empty(0)])
        return found[(found > borders[0]) & (found < borders[-1])]


def _prediction_borders(mu: Array, sigma: Array, mass: Array) -> Array:
    """Panel borders for a mixture of normal kernels: over its support, and around its centres."""
    matters = mass > NEGLIGIBLE
    low, high = (mu - WIDTH * sigma)[matters].min(), (mu + WIDTH * sigma)[matters].max()
    chosen = np.minimum(np.searchsorted(np.cumsum(mass), QUANTILES), len(mass) - 1)
    around = [mu[chosen] + sign * scale * sigma[chosen] for scale in SCALES for sign in (-1, 1)]
    return np.unique(np.clip(np.concatenate([np.linspace(low, high, 13), *around]), low, high))


def _log_mixture(x: Array, mu: Array, sigma: Array, mass: Array) -> Array:
    """log sum_j mass_j N(x; mu_j, sigma_j^2): the integral of the Stratonovich equation."""
    kernel = x[:, None] - mu
    kernel /= sigma
    kernel *= kernel
    kernel *= -0.5
    np.exp(kernel, out=kernel)
    with np.errstate(divide="ignore"):
        return np.log(kernel @ (mass / (sigma * np.sqrt(2 * np.pi))))


def _resolve(
    borders: Array, log_density: Callable[[Array], Array], too_wide: Callable[[Array, Array], Array], rule: Rule
) -> Grid:
    """Nodes and masses of exp(log_density), its panels split until the rule resolves it on each."""
    left, right = borders[:-1], borders[1:]
    x, logs = _evaluate(left, right, log_density, rule)
    for _ in range(SPLITS):
        values = _relative(logs)
        half = 0.5 * (right - left)
        mass = half * (values @ rule.weights)
        total = mass.sum()
        kept = mass > NEGLIGIBLE * total
        unresolved = half * np.abs(values @ rule.tail.T).sum(axis=1) > rule.tolerance * total
        split = kept & (unresolved | (too_wide(left, right) & (mass > rule.tolerance * total)))
        middle = 0.5 * (left + right)
        split &= (middle > left) & (middle < right)
        if not split.any():
            break
        stay = kept & ~split
        a = np.concatenate([left[split], middle[split]])
        b = np.concatenate([middle[split], right[split]])
        new_x, new_logs = _evaluate(a, b, log_density, rule)
        left, right = np.concatenate([left[stay], a]), np.concatenate([right[stay], b])
        x, logs = np.concatenate([x[stay], new_x]), np.concatenate([logs[stay], new_logs])
    values = _relative(logs)
    masses = 0.5 * (right - left)[:, None] * rule.weights * values
    kept = masses.sum(axis=1) > NEGLIGIBLE * masses.sum()
    order = np.argsort(x[kept].ravel())
    total = masses[kept].sum()
    return Grid(*(array[kept].ravel()[order] for array in (x, masses / total, values / total)))


def _relative(logs: Array) -> Array:
    """The density relative to its peak; flat if no value is finite."""
    peak = logs.max()
    return np.exp(logs - peak) if np.isfinite(peak) else np.ones_like(logs)


def _evaluate(left: Array, right: Array, log_density: Callable[[Array], Array], rule: Rule) -> tuple[Array, Array]:
    """Nodes of each panel (panels, q) and the log-density there."""
    x = 0.5 * (left + right)[:, None] + 0.5 * (right - left)[:, None] * rule.nodes
    return x, log_density(x.ravel()).reshape(x.shape)
