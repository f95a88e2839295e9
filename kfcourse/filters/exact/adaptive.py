"""The Stratonovich equation on panels that are halved until they resolve the posterior: slow, and takes anything.

One trajectory at a time.  Panels cover the support of the prediction, geometrically finer towards the states that would explain
the measurement without noise; they are split until a Gauss-Legendre rule resolves the posterior on each of them.

`on_panels` does one step of some trajectories, where equidistant nodes do not resolve it.  `adaptive_pointmass` is a filter of
nothing but such steps: it shares neither nodes nor rules with `kfcourse.filters.exact`, and so checks it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
import scipy

from kfcourse.errors import expect
from kfcourse.filters.base import Filter, State, initial_state
from kfcourse.filters.densities import ScalarDensities, scalar_densities
from kfcourse.filters.exact.batch import ROUNDING, Place
from kfcourse.filters.exact.constants import ELEMENTS, NEGLIGIBLE, ROOT, WIDTH
from kfcourse.filters.exact.kernels import Grid, Kernels, Unresolved
from kfcourse.filters.exact.merging import MERGED
from kfcourse.filters.exact.panels import PANEL_NODES, SPLITS, Rule, resolve
from kfcourse.filters.exact.places import Candidates, explanations
from kfcourse.filters.exact.roots import halved
from kfcourse.laws import Array, Gaussian
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError

FAR = 37.0  # sigmas covered where a measurement contradicts the prediction: exp(-37^2 / 2) is the smallest number
KERNEL = 3.0  # a panel is at most so many sigmas of the transition kernel wide, that the integral be smooth on it
SCALES = (0.5, 2.0, WIDTH)  # distances, in kernel sigmas, of panel borders from the prediction's own centres
QUANTILES = np.array([0.02, 0.25, 0.5, 0.75, 0.98])  # of the posterior, where those centres are
BORDER = 1e-10  # of the density at the ends of the support, relative: beyond them there must be nothing
ROUGH_RULE, FINE_RULE = Rule.of_order(8, 1e-4), Rule.of_order(12, 1e-7)  # of `on_panels`
TENTH = 1e-4  # accuracy from which on the rough one does
AROUND = 9  # borders of first panels towards a hump
HUMPS = 40  # states that explain the measurement, to which first panels lead
HUMPS_SEARCHED = 129  # points among which they are sought
SOME = 12  # kernels at which there are borders
WORK = 1e8  # nodes times kernels of a trajectory at a time: a second


class Panels(NamedTuple):
    """What the filter remembers of each trajectory: the posterior, and the same by a coarser rule."""

    fine: list[Grid]
    coarse: list[Grid]

    def discretisation_error(self) -> Array:
        """Estimated error of the posterior means, (runs,): the change from the coarser rule.

        The fine rule converges faster, so this overestimates its error.
        """
        return np.array([abs(fine.mean() - coarse.mean()) for fine, coarse in zip(self.fine, self.coarse, strict=True)])


def check_scalar(model: Model) -> None:
    """ModelError unless the model has one state and one measurement."""
    expect(model, Model, "an exact filter")
    if model.n != 1 or model.p != 1:
        raise ModelError(
            f"the point-mass filter is for scalar models; here the state has dimension {model.n}, the measurement {model.p}: "
            "use particle(model)"
        )


def on_panels(
    kernels: Kernels, y: Array, law: ScalarDensities, candidates: Candidates, accuracy: float
) -> list[tuple[Grid, float]]:
    """The posteriors of some trajectories, from the kernels of their predictions (T, M) and y (T, 1).

    Each with an estimate of its error in posterior standard deviations, see `resolve`; infinite if y contradicts the prediction
    so much that the posterior lies beyond its support.
    """
    rough = accuracy >= TENTH
    rule = ROUGH_RULE if rough else FINE_RULE
    found: list[tuple[Grid, float]] = [(Grid(*np.empty((3, 0))), np.inf)] * len(y)
    left = np.arange(len(y))
    for sigmas in (WIDTH, FAR):
        some, borders = kernels.rows(left), _first_borders(kernels.rows(left), y[left], law, candidates.rows(left), sigmas)

        def log_density(x: Array, rows: Array, some: Kernels = some, left: Array = left) -> Array:
            if x.shape[1] * some.mu.shape[1] > WORK:
                raise Unresolved(
                    f"the posterior needs more than {x.shape[1]:,} nodes at a time, the prediction is a sum of "
                    f"{some.mu.shape[1]:,} kernels"
                )
            chosen = some.rows(rows)
            with np.errstate(divide="ignore"):
                return np.log(chosen.density(x, chosen.mass)[:, :, 0]) + law.log_likelihood(y[left[rows]], x)

        narrow = borders[:, 0] == borders[:, -1]  # a prior without variance, a support narrower than rounding: the state is known
        borders[narrow, -1] = np.nextafter(borders[narrow, -1], np.inf)
        with np.errstate(all="ignore"):  # far states, where formulas leave the finite numbers, have no density
            grids = resolve(borders, log_density, _wider_than_kernels(law), rule)
        cut = np.array([_cut_off(grid, line) for (grid, _), line in zip(grids, borders, strict=True)])
        for place, (grid, error), bad, known in zip(left.tolist(), grids, cut, narrow, strict=True):
            if known:
                found[place] = Grid(grid.x[:1], np.ones(1), np.full(1, 1e300)), 0.0
            elif not bad and (variance := grid.variance()) > 0:
                rounding = ROUNDING * abs(grid.mean()) / np.sqrt(variance)
                found[place] = grid._replace(rough=rough), error + rounding + rough * MERGED
        left = left[cut & ~narrow]
        if not len(left):
            break
    return found


def _first_borders(kernels: Kernels, y: Array, law: ScalarDensities, candidates: Candidates, sigmas: float) -> Array:
    """Borders (T, B) of panels: ever closer towards where humps may be, and at some of the prediction's kernels."""
    low, high = kernels.support(sigmas)
    roots = explanations(kernels, y, law, low, high, HUMPS, HUMPS_SEARCHED)
    roots = roots[:, : max(1, np.isfinite(roots).sum(axis=1).max())]
    if roots.shape[1] == HUMPS:
        raise Unresolved(f"more than {HUMPS - 1} states explain a measurement: too many humps for any number of nodes")
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        centres = np.concatenate([candidates.centre, roots], axis=1)
        widths = np.concatenate([candidates.width, np.fmin(law.meter_width(roots), kernels.width)], axis=1)
        near = [Place(c[:, None], w[:, None], low, high).nodes(AROUND)[0] for c, w in zip(centres.T, widths.T, strict=True)]
    among = kernels.mu[:, :: max(1, kernels.mu.shape[1] // SOME)]  # they crowd where the posterior before had its humps
    borders = np.concatenate([low, *near, among, high], axis=1)
    return np.sort(np.clip(np.where(np.isfinite(borders), borders, low), low, high), axis=1)


def adaptive_pointmass(model: Model, order: int = 8, tolerance: float = 1e-5) -> Filter:
    """The exact AOF of a scalar model, every step of it on panels.

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
    Unresolved
        When it runs: a step would need more nodes than the budget has.
    """
    check_scalar(model)
    if order < 6 or not 0 < tolerance < 1:
        raise ModelError(f"the point-mass filter needs order >= 6 and 0 < tolerance < 1, got {order} and {tolerance}")
    densities = scalar_densities(model)
    if densities.noiseless:
        raise ModelError(f"{list(model.meter_equation)}: without noise there is no likelihood density; use pointmass(model)")
    rules = Rule.of_order(order, tolerance), Rule.of_order(order - 3, 30 * tolerance)
    init = initial_state(model)
    prior = model.prior.mean, np.maximum(np.sqrt(model.prior.cov[0]), 1e-150), np.ones(1)

    def kernels(before: Grid | None, k: int) -> tuple[Array, Array, Array]:
        """Those of the prediction of step k, from the posterior of step k - 1: the object's input is that of k - 1."""
        return prior if before is None else (*densities.at(k - 1).kernel(before.x), before.mass)

    def step(state: State, y: Array) -> State:
        law = densities.at(state.step)
        before = state.memory or ([None] * len(y), [None] * len(y))
        try:
            after = Panels(
                *(
                    [_corrected(kernels(grid, state.step), one, law, rule) for grid, one in zip(grids, y, strict=True)]
                    for grids, rule in zip(before, rules, strict=True)
                )
            )
        except Unresolved as error:
            raise Unresolved(f"step {state.step} of {model}: {error}") from None
        posterior = Gaussian(np.array([[g.mean()] for g in after.fine]), np.array([[[g.variance()]] for g in after.fine]))
        return State(state.step + 1, posterior, _predicted_moments(kernels(grid, state.step + 1) for grid in after.fine), after)

    return Filter("aof-exact", model, init, step, slow=True)


def _predicted_moments(predictions: Iterable[tuple[Array, Array, Array]]) -> Gaussian:
    """Mean (runs, 1) and variance (runs, 1, 1) of the next state: those of a mixture."""
    means, variances = [], []
    for mu, sigma, mass in predictions:
        means.append(mass @ mu)
        variances.append(mass @ (sigma**2 + (mu - means[-1]) ** 2))
    return Gaussian(np.array(means)[:, None], np.array(variances)[:, None, None])


def _wider_than_kernels(law: ScalarDensities) -> Callable[[Array, Array], Array]:
    """Panels on which the next prediction's kernel would not be a smooth function of its centre."""

    def too_wide(left: Array, right: Array) -> Array:
        (a, _), (b, _), (_, sigma) = law.kernel(left), law.kernel(right), law.kernel(0.5 * (left + right))
        return np.abs(b - a) > KERNEL * sigma

    return too_wide


def _corrected(prediction: tuple[Array, Array, Array], y: Array, law: ScalarDensities, rule: Rule) -> Grid:
    """The posterior of one trajectory: a prediction that is a sum of normal kernels (M,), corrected with y (1,).

    Where the measurement contradicts the prediction by more than `FAR` sigmas, what is within `WIDTH` of them.
    """
    mu, sigma, mass = prediction

    def log_density(x: Array) -> Array:
        if x.size > PANEL_NODES or x.size * mu.size > WORK:
            raise Unresolved(f"the posterior needs more than {x.size:,} nodes, the prediction is a sum of {mu.size:,} kernels")
        return _log_mixture(x, mu, sigma, mass) + law.log_likelihood(y, x)

    def within(width: float) -> tuple[Grid, bool]:
        """And whether it is complete."""
        borders = _prediction_borders(mu, sigma, mass, width)
        if not np.isnan(y):
            borders = np.union1d(borders, _towards_explanations(borders, y, law))
        if len(borders) < 2:  # a prior without variance, or a support narrower than rounding: the state is known
            return Grid(borders, np.ones(1), np.full(1, 1e300)), True
        grid, _ = resolve(borders[None], lambda x, _: log_density(x[0])[None], _wider_than_kernels(law), rule)[0]
        return grid, not _cut_off(grid, borders)

    near, complete = within(WIDTH)
    if complete:
        return near
    far, complete = within(FAR)
    return far if complete else near


def _towards_explanations(borders: Array, y: Array, law: ScalarDensities) -> Array:
    """Panel borders that approach, by halves, every state that explains y without noise."""
    x = np.unique(np.concatenate([borders, 0.5 * (borders[1:] + borders[:-1])]))
    negative = np.signbit(law.residual(y, x))
    left = np.flatnonzero(negative[1:] != negative[:-1])
    root = np.mean(halved(lambda at: np.signbit(law.residual(y, at)), x[left], x[left + 1], SPLITS), axis=0)[:, None, None]
    near = root + (borders[-1] - borders[0]) * np.array([[-1], [1]]) * 0.5 ** np.arange(SPLITS)
    # Stop approaching where the log-likelihood has become flat.
    flat = (law.log_likelihood(y, root) - law.log_likelihood(y, near) < 0.5).all(axis=1, keepdims=True)
    found = near[np.broadcast_to(np.cumsum(flat, axis=2) - flat == 0, near.shape)]
    return found[(found > borders[0]) & (found < borders[-1])]


def _cut_off(grid: Grid, borders: Array) -> bool:
    """Whether the posterior goes on beyond the support, or no number of it is within."""
    if not len(grid.x):
        return True
    second, last = np.searchsorted(borders, borders[0], "right"), np.searchsorted(borders, borders[-1]) - 1  # some may be equal
    at_border = np.array([grid.x[0] < borders[second], grid.x[-1] > borders[last]])
    return bool((at_border & (grid.density[[0, -1]] * (grid.x[-1] - grid.x[0]) > BORDER)).any())


def _prediction_borders(mu: Array, sigma: Array, mass: Array, width: float) -> Array:
    """Panel borders for a mixture of normal kernels: over its support, and around its centres."""
    matters = mass > NEGLIGIBLE
    low, high = (mu - width * sigma)[matters].min(), (mu + width * sigma)[matters].max()
    chosen = np.minimum(np.searchsorted(np.cumsum(mass), QUANTILES), len(mass) - 1)
    around = [mu[chosen] + sign * scale * sigma[chosen] for scale in SCALES for sign in (-1, 1)]
    return np.unique(np.clip(np.concatenate([np.linspace(low, high, 13), *around]), low, high))


def _log_mixture(x: Array, mu: Array, sigma: Array, mass: Array) -> Array:
    """log sum_j mass_j N(x; mu_j, sigma_j^2): the integral of the Stratonovich equation."""
    if len(x) * len(mu) > ELEMENTS:
        size = max(1, ELEMENTS // len(mu))
        return np.concatenate([_log_mixture(x[i : i + size], mu, sigma, mass) for i in range(0, len(x), size)])
    kernel = x[:, None] - mu
    kernel /= sigma
    kernel *= kernel
    kernel *= -0.5
    np.exp(kernel, out=kernel)
    total = kernel @ (mass / (sigma * ROOT))
    with np.errstate(divide="ignore"):
        logs = np.log(total)
        far = np.flatnonzero(total == 0)  # so far out that the exponentials underflow
        if len(far):
            logs[far] = scipy.special.logsumexp(-0.5 * ((x[far, None] - mu) / sigma) ** 2 + np.log(mass / (sigma * ROOT)), axis=1)
    return logs
