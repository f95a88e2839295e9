"""What a comparison of filters found: error statistics per step, differences, ranking, distance from the exact filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from kfcourse.montecarlo.statistics import Estimate, Sums, batch_mean, ratio
from kfcourse.montecarlo.two_phase import Replicas, Terms, batch_sums, estimate, with_design
from kfcourse.symbolic.model import Model

EXACT = "aof-exact"
FAR = 0.5  # excess over the bound, relative to it, from which on its tails are as heavy as those of the error itself


@dataclass(frozen=True)
class Subset:
    """Sums of all filters, the slow ones last, over the first of the common trajectories.

    `replaced` tells why another filter ran instead of a slow one that failed: name to the reason.
    """

    slow: list[str]
    sums: Sums
    replaced: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Comparison:
    """Statistics of filters on common trajectories; made by `kfcourse.compare`.

    The accuracy of a filter is D_k = M[(x_k - z_k)^T (x_k - z_k)], the course's error variance (for a
    vector state, the trace of M[(x - z)(x - z)^T]); `error_mean` tells how much of it is bias.

    The exact AOF is no filter among others, but their bound: `gap` tells how far above it each of them is.  By orthogonality
    (`excess`) that is known far better than any difference of two error variances, and so is the bound itself.

    Attributes
    ----------
    model : Model
    names : tuple of str
        All filters, in the order given.
    fast : tuple of str
        Those that ran on every trajectory; the others ran on a subset of them.
    runs, steps, seed : int
    left_out : dict
        Slow filters without results although they were wanted: name to the reason.
    replicas : Replicas, optional
        The designed filters designed again, on ensembles of their own: what they differ by is in every standard error.
    """

    model: Model
    names: tuple[str, ...]
    fast: tuple[str, ...]
    runs: int
    steps: int
    seed: int
    sums: Sums
    subset: Subset | None
    left_out: Mapping[str, str] = field(default_factory=dict)
    replicas: Replicas | None = None

    @cached_property
    def available(self) -> tuple[str, ...]:
        """Names with results: all, or without the slow ones if their subset was 0 or they were left out."""
        return tuple(name for name in self.names if name in self.fast or self._is_slow(name))

    @property
    def entrants(self) -> tuple[str, ...]:
        """The filters that are compared: all with results but the exact one, which bounds them."""
        return tuple(name for name in self.available if name != EXACT)

    @property
    def has_bound(self) -> bool:
        """Whether the exact AOF ran."""
        return self._is_slow(EXACT)

    @property
    def designs(self) -> int:
        """Ensembles that each of the designed filters was designed on; 0 if there is no such filter or one design only."""
        return len(self.replicas.sums) if self.replicas else 0

    @property
    def replaced(self) -> Mapping[str, str]:
        """Slow filters that failed, and for which another one ran (`Filter.instead`): name to the reason."""
        return {} if self.subset is None else self.subset.replaced

    @property
    def subset_runs(self) -> int:
        """Trajectories the slow filters ran on."""
        return 0 if self.subset is None else int(self.subset.sums.counts.sum())

    @property
    def control(self) -> str:
        """The fast filter that others are related to where there is no bound: the Gaussian AOF if there, else the first."""
        return "aof-gaussian" if "aof-gaussian" in self.fast else self.fast[0]

    @cached_property
    def carrier(self) -> str:
        """The fast filter through which the slow ones' errors are found: the Gaussian AOF if there, else the most accurate."""
        if "aof-gaussian" in self.fast:
            return "aof-gaussian"
        return min(self.fast, key=lambda name: float(self.error_variance(name).value.mean()))

    def error_variance(self, name: str) -> Estimate:
        """D_k per step, (steps,), with standard errors.

        For a slow filter, D = D(carrier, all trajectories) + (D(slow) - D(carrier)) on the subset: the
        difference varies far less than the error itself.  For the exact AOF that difference is -`excess(carrier)`.
        """
        return self._estimate(self._error(name))

    def difference(self, first: str, second: str) -> Estimate:
        """D_k(first) - D_k(second), (steps,), from paired trajectories."""
        return self._estimate(self._error(first).plus(self._error(second).times(-1.0)))

    def relative(self, name: str, reference: str | None = None) -> Estimate:
        """D_k(name) / D_k(reference), (steps,), with the standard error of the paired ratio.

        By the delta method: the ratio r of means varies as the mean of (e^2 - r e_ref^2) / D_ref.
        """
        own, base = self._error(name), self._error(reference or self.control)
        quotient = self._quotient(own, base)
        values = self._estimate(own).value, self._estimate(base).value
        # both know everything: equal
        return Estimate(ratio(*values, np.where(values[0] == 0, 1.0, np.inf)), quotient.standard_error, quotient.freedom)

    def score(self, name: str, steps: slice = slice(None)) -> Estimate:
        """The mean over steps of D_k(name) / D_k(control): one number for a filter, with its standard error."""
        return self._quotient(self._error(name), self._error(self.control), steps)

    def score_difference(self, first: str, second: str, steps: slice = slice(None)) -> Estimate:
        """score(first) - score(second), paired over all trajectories."""
        return self._quotient(self._error(first).plus(self._error(second).times(-1.0)), self._error(self.control), steps)

    # --- the exact filter as the bound

    def excess(self, name: str) -> Estimate:
        """D_k(name) - D_k(exact AOF), (steps,), by orthogonality.

        The error of the posterior mean is uncorrelated with every function of the measurements, so
        M|x - z|^2 - M|x - z_exact|^2 = M|z - z_exact|^2.  The right side never sees the error itself, so it is far less
        noisy than the paired difference as long as the two filters are close.  Where they are not, its own tails are
        heavy, and few trajectories underestimate it: then use `above_bound`.
        """
        return self._estimate(self._distance(name))

    def bound(self) -> Estimate:
        """D_k of the exact AOF, (steps,), as the mean of its own variance.

        M p_exact is the carrier's own variance over all trajectories plus M(p_exact - p_carrier) on the subset.
        """
        return self._estimate(self._bound())

    def above_bound(self, name: str) -> Estimate:
        """D_k(name) / D_k(exact) - 1 per step, (steps,), for a filter that ran on every trajectory, from its errors themselves.

        The numerator is M(e^2 - p_carrier) over all trajectories less M(p_exact - p_carrier) on the subset.
        """
        return self._quotient(self._above(name), self._bound())

    def gap(self, name: str) -> Estimate:
        """How far above the bound a filter is, D_k(name) / D_k(exact AOF) - 1 per step, (steps,).

        From `excess`; where the filter is far from the bound (by more than half of it) as `above_bound` is.  Without the exact
        AOF, how far above the control.
        """
        return self._quotient(self._over(name), self._reference())

    def gap_difference(self, first: str, second: str) -> Estimate:
        """gap(first) - gap(second) per step, (steps,), paired: it tells which of two filters is the more accurate."""
        return self._quotient(self._over(first, second), self._reference())

    def mean_gap(self, name: str, steps: slice = slice(None)) -> Estimate:
        """The mean over steps of `gap`: one number for a filter, with its standard error."""
        return self._quotient(self._over(name), self._reference(), steps)

    def mean_gap_difference(self, first: str, second: str, steps: slice = slice(None)) -> Estimate:
        """mean_gap(first) - mean_gap(second), paired: the difference that a ranking turns on."""
        return self._quotient(self._over(first, second), self._reference(), steps)

    def ranking(self, steps: slice = slice(None)) -> list[tuple[str, Estimate]]:
        """The entrants from the most accurate on, each with its `mean_gap`."""
        found = [(name, self.mean_gap(name, steps)) for name in self.entrants]
        return sorted(found, key=lambda item: float(item[1].value))

    def leaders(self, step: int, confidence: float = 0.95) -> list[str]:
        """The most accurate entrant at a step, then those that are not significantly worse, each by its own paired interval."""
        gaps = {name: float(self.gap(name).value[step]) for name in self.entrants}
        best, *others = sorted(gaps, key=lambda name: gaps[name])
        return [best, *(name for name in others if self.gap_difference(name, best)[step].interval(confidence)[0] <= 0)]

    def design_error(self, name: str) -> Estimate:
        """Standard deviation of D_k from one design of the filter to another, (steps,); 0 for filters that need none.

        Raises KeyError if nothing was designed more than once (`designs` of `compare`).
        """
        if self.replicas is None:
            raise KeyError("nothing was designed more than once: compare(..., designs=4)")
        variance, freedom = self.replicas.variance(self._error(name), total=False)
        deviation = np.sqrt(variance)
        return Estimate(deviation, deviation / np.sqrt(2 * freedom), freedom)

    # --- other statistics

    def error_mean(self, name: str) -> Estimate:
        """M[x_k - z_k] per step and component, (steps, n)."""
        sums, i = self._where(name)
        return batch_mean(sums.error[i], sums.counts)

    def component_variance(self, name: str) -> Estimate:
        """M[(x_i - z_i)^2] per step and component, (steps, n), over the trajectories the filter ran on."""
        sums, i = self._where(name)
        return batch_mean(sums.square[i], sums.counts)

    def own_variance(self, name: str) -> Estimate:
        """What the filter claims: the mean of its own variances, summed over components, (steps,)."""
        sums, i = self._where(name)
        return batch_mean(sums.own[i].sum(axis=1), sums.counts)

    def normalised_error(self, name: str) -> Estimate:
        """M[e^T p^-1 e] / n per step, (steps,): 1 for a filter whose covariance is right."""
        sums, i = self._where(name)
        return batch_mean(sums.normalised[i], sums.counts)

    def _is_slow(self, name: str) -> bool:
        return self.subset is not None and name in self.subset.slow

    def _where(self, name: str) -> tuple[Sums, int]:
        """Sums that hold the filter, and its place in them."""
        self._check(name)
        if name in self.fast or self.subset is None:
            return self.sums, self.fast.index(name)
        return self.subset.sums, len(self.fast) + self.subset.slow.index(name)

    def _check(self, *names: str) -> None:
        for name in names:
            if name not in self.available:
                raise KeyError(f"no results for {name!r}; this comparison has {', '.join(self.available)}")

    # --- estimates as terms: what of which filter, over all trajectories and over the subset

    def _error(self, name: str) -> Terms:
        """D_k."""
        self._check(name)
        if not self._is_slow(name):
            return Terms({("square", name): 1.0}, {})
        own = {("distance", self.carrier): -1.0} if name == EXACT else {("square", name): 1.0, ("square", self.carrier): -1.0}
        return Terms({("square", self.carrier): 1.0}, own)

    def _distance(self, name: str) -> Terms:
        """M|z - z_exact|^2."""
        if not self.has_bound:
            raise KeyError(f"the bound needs {EXACT} among the filters, with subset_runs above 0")
        self._check(name)
        return Terms({}, {("distance", name): 1.0})

    def _bound(self) -> Terms:
        """M p_exact."""
        if not self.has_bound:
            raise KeyError(f"the bound needs {EXACT} among the filters, with subset_runs above 0")
        return Terms({("own", self.carrier): 1.0}, {("own", EXACT): 1.0, ("own", self.carrier): -1.0})

    def _above(self, name: str) -> Terms:
        """M e^2 - M p_exact, for a fast filter."""
        bound = self._bound()
        if name not in self.fast:
            raise KeyError(f"{name!r} did not run on every trajectory: its distance from the bound is `gap`")
        return Terms({("square", name): 1.0}, {}).plus(bound.times(-1.0))

    def _reference(self) -> Terms:
        return self._bound() if self.has_bound else self._error(self.control)

    def _over(self, name: str, other: str | None = None) -> Terms:
        """D_k(name) less the reference, or less D_k(other): from errors where one is far from the bound, else from distances."""
        against = self._error(other or self.control)
        if not self.has_bound:
            return self._error(name).plus(against.times(-1.0))
        names = [name] if other is None else [name, other]
        near = self._distance(name) if other is None else self._distance(name).plus(self._distance(other).times(-1.0))
        if not all(one in self.fast for one in names):
            return near
        bound = self.bound().value
        far = np.zeros(self.steps, dtype=bool)
        for one in names:
            for terms in (self._distance(one), self._above(one)):
                far |= self._estimate(terms).value > FAR * bound
        direct = self._above(name) if other is None else self._error(name).plus(against.times(-1.0))
        return near.times(~far).plus(direct.times(far)) if far.any() else near

    def _quotient(self, numerator: Terms, denominator: Terms, steps: slice | None = None) -> Estimate:
        """numerator / denominator per step, or its mean over some steps, by the delta method as in `relative`."""
        below = self._estimate(denominator).value
        share = np.ones(self.steps)
        if steps is not None:
            counted = np.zeros(self.steps, dtype=bool)
            counted[steps] = below[steps] > 0
            share = counted / max(np.count_nonzero(counted), 1)
        above = self._estimate(numerator).value
        values = share * ratio(above, below, 0.0)
        inverse = ratio(np.ones_like(below), below, 0.0)
        linear = numerator.times(share * inverse).plus(denominator.times(-values * inverse))
        deviation = self._estimate(linear, total=steps is not None)
        if steps is None:  # of nothing any part is infinitely much
            values = np.where((below <= 0) & (above > 0), np.inf, values)
        return Estimate(values if steps is None else values.sum(), deviation.standard_error, deviation.freedom)

    def _estimate(self, terms: Terms, total: bool = False) -> Estimate:
        """The mean of the terms, (steps,), or summed over the steps, with its standard error."""
        full = batch_sums(self.sums, self.fast, terms.everywhere, total)
        if self.subset is None or not terms.on_subset:
            found = estimate(full, self.sums.counts)
        else:
            names = (*self.fast, *self.subset.slow)
            x, y = (batch_sums(self.subset.sums, names, weights, total) for weights in terms)
            found = estimate(full, self.sums.counts, x, y, self.subset.sums.counts)
        return found if self.replicas is None else with_design(found, *self.replicas.variance(terms, total))
