"""What a comparison of filters found: error statistics per step, differences, ranking."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from kfcourse.laws import Array
from kfcourse.montecarlo.statistics import Estimate, Sums, batch_mean, ratio
from kfcourse.symbolic.model import Model

EXACT = "aof-exact"


@dataclass(frozen=True)
class Subset:
    """Sums of all filters, the slow ones last, over the first of the common trajectories."""

    slow: list[str]
    sums: Sums


@dataclass(frozen=True)
class Comparison:
    """Statistics of filters on common trajectories; made by `kfcourse.compare`.

    The accuracy of a filter is D_k = M[(x_k - z_k)^T (x_k - z_k)], the course's error variance (for a
    vector state, the trace of M[(x - z)(x - z)^T]); `error_mean` tells how much of it is bias.

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

    @cached_property
    def available(self) -> tuple[str, ...]:
        """Names with results: all, or without the slow ones if their subset was 0 or they were left out."""
        return tuple(name for name in self.names if name in self.fast or self._is_slow(name))

    @property
    def subset_runs(self) -> int:
        """Trajectories the slow filters ran on."""
        return 0 if self.subset is None else int(self.subset.sums.counts.sum())

    @property
    def control(self) -> str:
        """The fast filter through which the slow ones are compared: the Gaussian AOF if there."""
        return "aof-gaussian" if "aof-gaussian" in self.fast else self.fast[0]

    def error_variance(self, name: str) -> Estimate:
        """D_k per step, (steps,), with standard errors.

        For a slow filter, D = D(control, all trajectories) + (D(slow) - D(control)) on the subset: the
        difference varies far less than the error itself.
        """
        return self._combined({name: 1.0})

    def difference(self, first: str, second: str) -> Estimate:
        """D_k(first) - D_k(second), (steps,), from paired trajectories."""
        return self._combined({first: 1.0, second: -1.0}) if first != second else self._combined({first: 0.0})

    def relative(self, name: str, reference: str | None = None) -> Estimate:
        """D_k(name) / D_k(reference), (steps,), with the standard error of the paired ratio.

        By the delta method: the ratio r of means varies as the mean of (e^2 - r e_ref^2) / D_ref.
        """
        reference = reference or self.control
        base = self.error_variance(reference).value
        own = self.error_variance(name).value
        quotient = ratio(own, base, np.where(own == 0, 1.0, np.inf))  # both know everything: equal
        combination: dict[str, Array | float] = {name: _inverse(base)}
        combination[reference] = combination.get(reference, 0.0) - quotient * _inverse(base)
        deviation = self._combined(combination)
        return Estimate(quotient, deviation.standard_error, deviation.freedom)

    def score(self, name: str, steps: slice = slice(None)) -> Estimate:
        """The mean over steps of D_k(name) / D_k(control): one number for a filter, with its standard error."""
        return self._score({name: 1.0}, steps)

    def score_difference(self, first: str, second: str, steps: slice = slice(None)) -> Estimate:
        """score(first) - score(second), paired: the difference that a ranking turns on."""
        return self._score({first: 1.0, second: -1.0} if first != second else {first: 0.0}, steps)

    def _score(self, weights: dict[str, float], steps: slice) -> Estimate:
        """Mean over steps of sum_i weight_i D_k(i) / D_k(control), by the delta method as in `relative`."""
        base = self.error_variance(self.control).value
        mask = np.zeros(self.steps)
        mask[steps] = base[steps] > 0
        mask *= _inverse(base) / max(np.count_nonzero(mask), 1)  # 1 / D_control, averaged over the steps
        numerator = sum(weight * self.error_variance(name).value for name, weight in weights.items())
        combination: dict[str, Array | float] = {name: weight * mask for name, weight in weights.items()}
        combination[self.control] = combination.get(self.control, 0.0) - mask * numerator * _inverse(base)
        deviation = self._combined(combination, total=True)
        return Estimate(np.array(mask @ numerator), deviation.standard_error, deviation.freedom)

    def excess(self, name: str) -> Estimate:
        """D_k(name) - D_k(exact AOF), (steps,), by orthogonality.

        The error of the posterior mean is uncorrelated with every function of the measurements, so
        M|x - z|^2 - M|x - z_exact|^2 = M|z - z_exact|^2.  The right side never sees the error itself, so it is far less
        noisy than the paired difference as long as the two filters are close.  Where they are not, its own tails are
        heavy, and few trajectories underestimate it: then use `above_bound`.
        """
        subset = self._with_exact()
        return batch_mean(subset.sums.distance[self._place(name)], subset.sums.counts)

    def bound(self) -> Estimate:
        """D_k of the exact AOF, (steps,), as the mean of its own variance.

        M p_exact is the control's own variance over all trajectories plus M(p_exact - p_control) on the subset.
        """
        subset = self._with_exact()
        control = batch_mean(self._own(self.sums, self.control), self.sums.counts)
        correction = batch_mean(self._own(subset.sums, EXACT) - self._own(subset.sums, self.control), subset.sums.counts)
        error = np.hypot(control.standard_error, correction.standard_error)
        return Estimate(control.value + correction.value, error, correction.freedom)

    def above_bound(self, name: str) -> Estimate:
        """D_k(name) / D_k(exact) - 1 per step, (steps,), for a filter that ran on every trajectory.

        The numerator is M(e^2 - p_control) over all trajectories less M(p_exact - p_control) on the subset.
        """
        subset, bound = self._with_exact(), self.bound()
        square = self.sums.square[self.fast.index(name)].sum(axis=1)
        first = batch_mean(square - self._own(self.sums, self.control), self.sums.counts)
        second = batch_mean(self._own(subset.sums, EXACT) - self._own(subset.sums, self.control), subset.sums.counts)
        inverse = _inverse(bound.value)
        error = np.hypot(first.standard_error, second.standard_error)
        return Estimate((first.value - second.value) * inverse, error * inverse, second.freedom)

    def _with_exact(self) -> Subset:
        if self.subset is None or EXACT not in self.subset.slow:
            raise KeyError(f"the bound needs {EXACT} among the filters, with subset_runs above 0")
        return self.subset

    def _own(self, sums: Sums, name: str) -> Array:
        """Batch sums of a filter's own variance, (steps, batches), in the sums of all or of the subset."""
        return sums.own[self._place(name)].sum(axis=1)

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

    def ranking(self, steps: slice = slice(None)) -> list[tuple[str, Estimate]]:
        """Filters from the most accurate on, each with its `score`."""
        scored = [(name, self.score(name, steps)) for name in self.available]
        return sorted(scored, key=lambda item: float(item[1].value))

    def _is_slow(self, name: str) -> bool:
        return self.subset is not None and name in self.subset.slow

    def _where(self, name: str) -> tuple[Sums, int]:
        """Sums that hold the filter, and its place in them."""
        place = self._place(name)
        return (self.sums if name in self.fast or self.subset is None else self.subset.sums), place

    def _combined(self, weights: dict[str, Array | float], total: bool = False) -> Estimate:
        """A linear combination of D_k's, paired; `total` sums it over the steps.

        Slow filters s enter through the control g: with N trajectories in all and n in the subset (part
        of them), X = sum of fast terms + sum_s c_s g on all, Y = sum_s c_s (s - g) on the subset,

            estimate = M_N X + M_n Y,   Var = Var X / N + Var Y / n + 2 Cov(X, Y) / N
        """
        everywhere: dict[str, Array | float] = {}
        for name, weight in weights.items():
            key = self.control if self._is_slow(name) else name
            everywhere[key] = everywhere.get(key, 0.0) + weight
        full = batch_mean(self._combination(self.sums, everywhere, total), self.sums.counts)
        slow = {name: weight for name, weight in weights.items() if self._is_slow(name)}
        if not slow or self.subset is None:
            return full
        correction: dict[str, Array | float] = dict(slow)
        correction[self.control] = -sum(slow.values())
        sums = self.subset.sums
        on_subset = self._combination(sums, everywhere, total)
        corrections = self._combination(sums, correction, total)
        y = batch_mean(corrections, sums.counts)
        # Var(x + y) - Var(x - y) = 4 Cov(x, y), each a variance of means over the n of the subset
        plus = batch_mean(on_subset + corrections, sums.counts).standard_error ** 2
        minus = batch_mean(on_subset - corrections, sums.counts).standard_error ** 2
        covariance = (plus - minus) / 4 * self.subset_runs / self.runs
        variance = full.standard_error**2 + y.standard_error**2 + 2 * covariance
        return Estimate(full.value + y.value, np.sqrt(np.maximum(variance, 0.0)), y.freedom)

    def _combination(self, sums: Sums, weights: dict[str, Array | float], total: bool) -> Array:
        """Batch sums of the weighted squared errors, (steps, batches), or (batches,) in total."""
        result = np.zeros((self.steps, len(sums.counts)))
        for name, weight in weights.items():
            i = self._place(name)
            result += np.broadcast_to(weight, self.steps)[:, None] * sums.square[i].sum(axis=1)
        return result.sum(axis=0) if total else result

    def _place(self, name: str) -> int:
        """Place of a filter in the sums: the fast ones, then (in the subset only) the slow ones."""
        if name in self.fast:
            return self.fast.index(name)
        if self.subset is None or name not in self.subset.slow:
            raise KeyError(f"no results for {name!r}; this comparison has {', '.join(self.available)}")
        return len(self.fast) + self.subset.slow.index(name)


def _inverse(values: Array) -> Array:
    """1 / values, and 0 where there is nothing to compare with."""
    return ratio(np.ones_like(values), values, 0.0)
