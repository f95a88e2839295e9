"""What a comparison of filters found: error statistics per step, differences, ranking, distance from the exact filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from kfcourse.errors import Reason
from kfcourse.laws import CONFIDENCE, Array
from kfcourse.montecarlo.statistics import Estimate, Sums, batch_mean, ratio, rejected
from kfcourse.montecarlo.two_phase import Replicas, Terms, batch_sums, estimate, with_design
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.writing import by_thousands

EXACT = "aof-exact"
ROUNDING = (64 * np.finfo(float).eps) ** 2  # an error variance less than this part of M|x|^2 is one of rounding
UNHEALTHY = 0.1  # squared error of the exact filter's substitute, in its variance, from which on it bounds nothing
BEATEN = 5.0  # standard errors by which a filter must be better than the "exact" one to refute it, at any step
BEATEN_IN_PLACE = 4.0  # and to refute what ran in its place, whose errors have no bound: by chance in a run of 200
LOST = 100.0  # times the most accurate filter's D_k: ten times its error
HEAVY = 0.1  # part of a sum over trajectories that a single one makes where its interval cannot be trusted
SKEWED = 0.5  # skewness of an error with which the transformation of `Estimate.interval` does not do any more
SAME = 1e-6  # of the bound: what the exact filter's own error of a thousandth of a deviation can make of a distance
ALIKE = 10  # decimals of D_k over the least and of `mean_gap`: filters that agree in them coincide but for rounding
FEW = 250  # batches: of fewer, the skewness is itself so uncertain that only as many 250ths are admitted


@dataclass(frozen=True)
class SlowPart:
    """Sums of all filters, the slow ones last, over a part of the common trajectories.

    Attributes
    ----------
    slow : list of str
    first : Sums
        Over the first trajectories, without those that are exceptional.
    exceptional : Sums, optional
        Over these of all trajectories, in the batches of the fast filters' sums.
    replaced : dict
        Why another filter ran instead of a slow one that failed: name to the reason.
    """

    slow: list[str]
    first: Sums
    exceptional: Sums | None = None
    replaced: Mapping[str, Reason] = field(default_factory=dict)

    def without_exact(self) -> SlowPart | None:
        """Without the exact AOF, if any other slow filter is left."""
        if not (slow := [name for name in self.slow if name != EXACT]):
            return None
        start = len(self.first.square) - len(self.slow)
        kept = [*range(start), *(i for i, name in enumerate(self.slow, start) if name != EXACT)]
        return replace(
            self, slow=slow, first=self.first.of_filters(kept), exceptional=self.exceptional and self.exceptional.of_filters(kept)
        )

    @property
    def runs(self) -> int:
        """Trajectories that the slow filters ran on."""
        return int(self.first.counts.sum() + (0 if self.exceptional is None else self.exceptional.counts.sum()))

    def part(self, weight: float) -> float:
        """The part of all trajectories, by their weight, that the first ones stand for."""
        return 1.0 if self.exceptional is None else 1 - self.exceptional.weights.sum() / weight

    def together(self, weight: float) -> Sums:
        """The sums as if over all trajectories, of that weight."""
        if self.exceptional is None:
            return self.first
        factor = self.part(weight) * weight / self.first.weights.sum()
        return Sums.concatenate([self.first.times(factor), self.exceptional])


class Verdict(NamedTuple):
    """At one step: the most accurate filter, those that are not significantly worse, and the least accurate if it is worse."""

    best: str
    not_worse: list[str]
    worst: str


@dataclass(frozen=True)
class Comparison:
    """Statistics of filters on common trajectories; made by `kfcourse.compare`.

    The accuracy of a filter is D_k = M[(x_k - z_k)^T (x_k - z_k)], the course's error variance (for a
    vector state, the trace of M[(x - z)(x - z)^T]); `error_mean` tells how much of it is bias.

    The exact AOF is no filter among others, but their bound: `gap` tells how far above it each of them is.  By orthogonality
    (`excess`) that is often known far better than any difference of two error variances, and so is the bound itself.

    There is one estimate of each D_k, from which all else follows, so that table, ranking and verdict cannot disagree: the bound
    and what the filter is above it, found from its distance from the exact filter and from its errors, each with the weight that
    makes the standard error least.

    Attributes
    ----------
    model : Model
    names : tuple of str
        All filters, in the order given.
    fast : tuple of str
        Those that ran on every trajectory; the slow ones ran on a part of them.
    runs, steps, seed : int
    left_out : dict
        Slow filters without results although they were wanted: name to the reason.
    replicas : Replicas, optional
        The designed filters designed again, on ensembles of their own: what they differ by is in every standard error.
    smoothing : Comparison, optional
        The same of smoothers on the same trajectories, if `compare` was given any: their error variances given the whole record,
        and how far they are above the exact smoother.
    """

    model: Model | JumpModel
    names: tuple[str, ...]
    fast: tuple[str, ...]
    runs: int
    steps: int
    seed: int
    sums: Sums
    slow_part: SlowPart | None
    left_out: Mapping[str, Reason] = field(default_factory=dict)
    replicas: Replicas | None = None
    smoothing: Comparison | None = None

    def __repr__(self) -> str:
        slow = f" ({self.slow_runs} for {', '.join(self.slow_part.slow)})" if self.slow_part else ""
        compared = f"Comparison of {', '.join(self.names)}: {self.steps} steps, {self.runs} trajectories{slow}"
        lines = [
            f"{by_thousands(compared)}, seed {self.seed}",
            *(f"left out: {name}, {why}" for name, why in self.left_out.items()),
            "ask ranking(), verdicts(), error_variance(name), gap(name), difference(first, second)"
            + (", and the same of .smoothing" if self.smoothing else ""),
        ]
        return "\n".join(lines)

    @cached_property
    def available(self) -> tuple[str, ...]:
        """Names with results: all, or without the slow ones if `slow_runs` was 0 or they were left out."""
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
    def rounding(self) -> Array:
        """Error variances, (steps,), that may be of rounding alone: of states so large, in doubles."""
        return ROUNDING * self.sums.size.sum(axis=-1) / self.sums.weights.sum()

    @cached_property
    def without_error(self) -> Array:
        """Steps, (steps,), at which the most accurate filter errs by rounding only: of such a bound no part can be told."""
        least = self.bound() if self.has_bound else self.error_variance(self.control)
        return np.asarray(least.value <= self.rounding)

    @cached_property
    def doubtful(self) -> Array:
        """Steps, (steps,), at which what should be exact is not: it errs by too much itself, or a filter is more accurate."""
        found = np.zeros(self.steps, dtype=bool)
        if self.slow_part is not None and self.has_bound:
            own = batch_mean(self._on_slow_part.doubt, self._on_slow_part.weights).value
            found |= ~(own <= UNHEALTHY * self.bound().value)
            limit = BEATEN_IN_PLACE if EXACT in self.replaced else BEATEN
            for name in self.fast:
                above = self._estimate(self._above(name))
                found |= above.value < -limit * above.standard_error
        return found & ~self.without_error

    @property
    def usable(self) -> Array:
        """Steps, (steps,), at which distances from the bound, or from the control, have a meaning."""
        return ~(self.without_error | self.doubtful)

    def without_unhealthy(self) -> Comparison:
        """Without the exact AOF, and with the reason, if what ran in its place can be relied on at no step."""
        if self.slow_part is None or not self.doubtful.any() or (self.usable | self.without_error).any():
            return self
        first = self.replaced.get(EXACT, "it does not resolve this model")
        why = f"{first}; and particles, which ran in its place, err by too much"
        return replace(self, slow_part=self.slow_part.without_exact(), left_out={**self.left_out, EXACT: why})

    def heavy(self, name: str) -> Array:
        """Part that the largest single trajectory makes of what is known of the filter, (steps,).

        Of its distances from the exact filter and of its errors, each by its weight.  Where it is more than `HEAVY`, there are
        too few trajectories for the interval to be trusted.  A distance from particles is a product that may be negative: then
        a single one may be more than their sum, and counts as all of it.
        """
        sums, i = self._where(name)
        by_errors = ratio(sums.largest_square[i].max(axis=-1), sums.square[i].sum(axis=(1, 2)), 0.0)
        if not self.has_bound:
            return by_errors
        sums, i = self._in_slow_part(name)
        share = self._shares.get(name, np.ones(self.steps))
        by_distances = ratio(sums.largest[i].max(axis=-1), np.abs(sums.distance[i].sum(axis=-1)), 0.0)
        return np.minimum(share * by_distances + (1 - share) * by_errors, 1.0)

    @cached_property
    def lost(self) -> dict[str, Array]:
        """Entrants that diverge on a few trajectories, and the steps, (steps,), at which these make `LOST` times the best D_k."""
        variances = {name: self.error_variance(name).value for name in self.entrants}
        most = LOST * np.min([*variances.values()], axis=0)
        bad = {name: self.usable & (self.heavy(name) > HEAVY) & (variances[name] > most) for name in variances}
        return {name: steps for name, steps in bad.items() if steps.any()}

    def trusted(self, found: Estimate, *names: str) -> Array:
        """Whether the interval of what was found of these filters (`gap`, `difference`, `bound`) can be trusted, (steps,).

        Not where rare trajectories make it: where a single one makes more than `HEAVY` of what the least accurate of the filters
        is known from, or where the error is `SKEWED`, of `FEW` batches less: there the standard error hangs on whether a
        rare trajectory has come.  `benchmarks/intervals.py` counts how often the others hold the truth.
        """
        good = self.usable & (np.abs(found.skewness) <= self.skewness_limit)
        if names:
            gaps = np.array([np.nan_to_num(self.gap(name).value, nan=-np.inf) for name in names])
            heavy = np.array([self.heavy(name) for name in names])
            good = good & (np.take_along_axis(heavy, gaps.argmax(axis=0)[None], axis=0)[0] <= HEAVY)
            good = good | (self.usable & (np.abs(found.value) + 2 * found.standard_error < SAME))
        return np.asarray(good)

    @property
    def skewness_limit(self) -> float:
        """The largest skewness of an error whose interval can be trusted."""
        sums = self.sums if self.slow_part is None else self.slow_part.first
        return min(SKEWED, len(sums.counts) / FEW)

    def missing(self, found: Estimate, *names: str) -> float:
        """How many times as many trajectories would make the interval trusted at every usable step; 1 if it is.

        A share falls as 1 / n, a skewness as 1 / sqrt(n), and what is admitted of it rises with n up to `SKEWED`.
        """
        skewness = float(np.max(np.where(self.usable, np.abs(found.skewness), 0.0), initial=0.0))
        heavy = max((float(np.max(np.where(self.usable, self.heavy(name), 0.0), initial=0.0)) for name in names), default=0.0)
        return max(1.0, heavy / HEAVY, (skewness / SKEWED) ** 2, (skewness / self.skewness_limit) ** (2 / 3))

    @property
    def designs(self) -> int:
        """Ensembles that each of the designed filters was designed on; 0 if there is no such filter or one design only."""
        return len(self.replicas.sums) if self.replicas else 0

    @property
    def replaced(self) -> Mapping[str, Reason]:
        """Slow filters that failed, and for which another one ran (`Filter.instead`): name to the reason."""
        return {} if self.slow_part is None else self.slow_part.replaced

    @property
    def slow_runs(self) -> int:
        """Trajectories the slow filters ran on."""
        return 0 if self.slow_part is None else self.slow_part.runs

    @cached_property
    def control(self) -> str:
        """The fast filter that others are related to where there is no bound: the Gaussian AOF if there, else the first.

        One that diverges, by the rule of `lost`, is passed over.
        """
        found = {name: self._estimate(self._mean_square(name)).value for name in self.fast}
        most = LOST * np.min([*found.values()], axis=0) + self.rounding
        steady = [name for name in self.fast if not ((found[name] > most) & (self.heavy(name) > HEAVY)).any()] or [*self.fast]
        return "aof-gaussian" if "aof-gaussian" in steady else steady[0]

    @cached_property
    def carrier(self) -> str:
        """The fast filter through which the slow ones' errors are found: the Gaussian AOF if there, else the most accurate."""
        if "aof-gaussian" in self.fast:
            return "aof-gaussian"
        return min(self.fast, key=lambda name: float(self._estimate(self._mean_square(name)).value.mean()))

    def error_variance(self, name: str) -> Estimate:
        """D_k per step, (steps,), with standard errors; for the exact AOF the mean of its own variance (`bound`)."""
        return self._estimate(self._error(name))

    def difference(self, first: str, second: str) -> Estimate:
        """D_k(first) - D_k(second), (steps,), from paired trajectories."""
        return self._estimate(self._error(first).plus(self._error(second).times(-1.0)))

    def relative(self, name: str, reference: str | None = None) -> Estimate:
        """D_k(name) / D_k(reference), (steps,), with the standard error of the paired ratio.

        By the delta method: the ratio r of means varies as the mean of (e^2 - r e_ref^2) / D_ref.
        """
        return self._quotient(self._error(name), self._error(reference or self.control))

    def score(self, name: str, steps: slice = slice(None)) -> Estimate:
        """The mean over steps of D_k(name) / D_k(control): one number for a filter, with its standard error.

        As all means over steps, over those that are `usable`; NaN if none is, but 0 if it errs by rounding only at all of them.
        """
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
        heavy, and few trajectories underestimate it: then `above_bound` is better.  `gap` weighs both.
        """
        return self._estimate(self._distance(name))

    def bound(self) -> Estimate:
        """D_k of the exact AOF, (steps,), as the mean of its own variance.

        M p_exact is the carrier's own variance over all trajectories plus M(p_exact - p_carrier) on the slow part.
        """
        return self._estimate(self._bound())

    def above_bound(self, name: str, steps: slice | None = None) -> Estimate:
        """D_k(name) / D_k(exact) - 1 per step, (steps,), for a filter that ran on every trajectory, from its errors themselves.

        The numerator is M(e^2 - p_carrier) over all trajectories less M(p_exact - p_carrier) on the slow part.  With steps, the
        mean over these.  `gap` is known better, but is too low where it is made by states so rare that the slow part has none.
        """
        return self._quotient(self._above(name), self._bound(), steps)

    def gap(self, name: str) -> Estimate:
        """How far above the bound a filter is, D_k(name) / D_k(exact AOF) - 1 per step, (steps,).

        Without the exact AOF, how far above the control.  NaN at steps that are not `usable`.
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
        """The entrants from the most accurate on, each with its `mean_gap`; those that coincide in their own order."""
        found = [(name, self.mean_gap(name, steps)) for name in self.entrants]
        return sorted(found, key=lambda item: round(float(item[1].value), ALIKE))

    @cached_property
    def _ranked(self) -> list[list[str]]:
        """The entrants at each step from the most accurate on; those that coincide in their own order."""
        found = np.array([self.error_variance(name).value for name in self.entrants])
        least = np.fmin.reduce(found)
        order = np.argsort(np.round(found / np.where(least > 0, least, 1.0), ALIKE), axis=0, kind="stable")
        return [[self.entrants[i] for i in column] for column in order.T]

    def leaders(self, step: int, confidence: float = CONFIDENCE) -> list[str]:
        """The most accurate entrant at a step, then those that are not significantly worse, each by its own paired interval."""
        best, *others = self._ranked[step]
        return [best, *(name for name in others if self.difference(name, best)[step].interval(confidence)[0] <= 0)]

    def verdicts(self, confidence: float = CONFIDENCE) -> list[Verdict]:
        """For each step the most accurate entrant, who is not significantly worse, and who is the least accurate.

        With the confidence all of them are right: Holm's test of everybody's difference from the most accurate, over all steps
        and filters.  Where all errors are rounding, nobody is better.
        """
        ranked = self._ranked
        pairs = {(name, best) for best, *others in ranked for name in others}
        by_pair = {pair: self.difference(*pair).p_value() for pair in pairs}
        p = np.array([[by_pair[name, best][k] for name in others] for k, (best, *others) in enumerate(ranked)])
        p = np.where(self.without_error[:, None], 1.0, p)
        worse = rejected(p, 1 - confidence)
        return [
            Verdict(
                best, [name for name, bad in zip(others, row, strict=True) if not bad], others[-1] if others and row[-1] else ""
            )
            for (best, *others), row in zip(ranked, worse, strict=True)
        ]

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
        return batch_mean(sums.error[i], sums.weights)

    def component_variance(self, name: str) -> Estimate:
        """M[(x_i - z_i)^2] per step and component, (steps, n), over the trajectories the filter ran on."""
        sums, i = self._where(name)
        return batch_mean(sums.square[i], sums.weights)

    def own_variance(self, name: str) -> Estimate:
        """What the filter claims: the mean of its own variances, summed over components, (steps,)."""
        sums, i = self._where(name)
        return batch_mean(sums.own[i].sum(axis=1), sums.weights)

    def normalised_error(self, name: str) -> Estimate:
        """M[e^T p^-1 e] / n per step, (steps,): 1 for a filter whose covariance is right."""
        sums, i = self._where(name)
        return batch_mean(sums.normalised[i], sums.weights)

    def _is_slow(self, name: str) -> bool:
        return self.slow_part is not None and name in self.slow_part.slow

    def _where(self, name: str) -> tuple[Sums, int]:
        """Sums that hold the filter, and its place in them."""
        self._check(name)
        if name in self.fast or self.slow_part is None:
            return self.sums, self.fast.index(name)
        return self._in_slow_part(name)

    def _in_slow_part(self, name: str) -> tuple[Sums, int]:
        """Sums over the slow part, and the filter's place in them."""
        self._check(name)
        if self.slow_part is None:
            raise KeyError(f"no filter ran on a part of the trajectories, so nothing is known of {name} there")
        return self._on_slow_part, (*self.fast, *self.slow_part.slow).index(name)

    @cached_property
    def _on_slow_part(self) -> Sums:
        assert self.slow_part is not None
        return self.slow_part.together(self.sums.weights.sum())

    def _check(self, *names: str) -> None:
        for name in names:
            if name not in self.available:
                raise KeyError(f"no results for {name!r}; this comparison has {', '.join(self.available)}")

    # --- estimates as terms: what of which filter, over all trajectories and over the slow part

    def _error(self, name: str) -> Terms:
        """D_k: the bound, and what is above it."""
        self._check(name)
        if self.has_bound:
            return self._bound() if name == EXACT else self._bound().plus(self._above_all(name))
        return self._mean_square(name)

    def _mean_square(self, name: str) -> Terms:
        """M|x - z|^2; for a slow filter by its difference from the carrier, which varies less than the error itself."""
        if not self._is_slow(name):
            return Terms({("square", name): 1.0}, {})
        return Terms({("square", self.carrier): 1.0}, {("square", name): 1.0, ("square", self.carrier): -1.0})

    def _distance(self, name: str) -> Terms:
        """M|z - z_exact|^2."""
        if not self.has_bound:
            raise KeyError(f"the bound needs {EXACT} among the filters, with slow_runs above 0")
        self._check(name)
        return Terms({}, {("distance", name): 1.0})

    def _bound(self) -> Terms:
        """M p_exact."""
        if not self.has_bound:
            raise KeyError(f"the bound needs {EXACT} among the filters, with slow_runs above 0")
        return Terms({("own", self.carrier): 1.0}, {("own", EXACT): 1.0, ("own", self.carrier): -1.0})

    def _above(self, name: str) -> Terms:
        """M e^2 - M p_exact, for a fast filter."""
        bound = self._bound()
        if name not in self.fast:
            raise KeyError(f"{name!r} did not run on every trajectory: its distance from the bound is `gap`")
        return self._mean_square(name).plus(bound.times(-1.0))

    def _above_all(self, name: str) -> Terms:
        """What a filter is above the bound: what the closest one is, and what this one is above that."""
        if self._is_slow(name):
            return self._distance(name)
        near, far = self._ways(name)
        weighed = near.times(self._shares[name]).plus(far.times(1 - self._shares[name]))
        return weighed if name == self._anchor else self._above_all(self._anchor).plus(weighed)

    def _ways(self, name: str) -> tuple[Terms, Terms]:
        """The two ways to what a filter is above the closest, and that above the bound: by distances, and by errors."""
        near, far = self._distance(name), self._above(name)
        if name == self._anchor:
            return near, far
        return near.plus(self._distance(self._anchor).times(-1.0)), far.plus(self._above(self._anchor).times(-1.0))

    @cached_property
    def _anchor(self) -> str:
        """The fast filter that is the closest to the exact one: what it is above the bound is known best."""
        bound = self._estimate(self._bound()).value
        return min(self.fast, key=lambda name: float(ratio(self._estimate(self._distance(name)).value, bound, 0.0).mean()))

    @cached_property
    def _shares(self) -> dict[str, Array]:
        """Weights (steps,) of the first of both ways: those with the least variance, as their errors hardly correlate.

        A sample that lacks rare large distances has too small a mean of them, and too small a standard error.  So that this does
        not give it weight, the error of the distances counts as twice what it seems, and their largest single term is added.
        """
        shares = {}
        for name in self.fast:
            sums, i = self._in_slow_part(name)
            single = sums.largest[i].max(axis=-1) / sums.weights.sum()
            near, far = (self._estimate(way).standard_error ** 2 for way in self._ways(name))
            shares[name] = np.where(self.doubtful, 0.0, ratio(far, 4 * near + single**2 + far, 1.0))
        return shares

    def _reference(self) -> Terms:
        return self._bound() if self.has_bound else self._error(self.control)

    def _over(self, name: str, other: str | None = None) -> Terms:
        """D_k(name) less the reference, or less D_k(other)."""
        against = self._reference() if other is None else self._error(other)
        return self._error(name).plus(against.times(-1.0))

    def _quotient(self, numerator: Terms, denominator: Terms, steps: slice | None = None) -> Estimate:
        """numerator / denominator per step, or its mean over the usable ones of some steps, by the delta method as in `relative`.

        NaN where there is nothing to be a part of; a mean is 0 where all errors are of rounding.  ValueError if `steps` are none.
        """
        below, share = self._estimate(denominator).value, np.ones(self.steps)
        usable = self.usable & (below > 0)
        if steps is not None:
            counted = np.zeros(self.steps, dtype=bool)
            counted[steps] = True
            if not counted.any():
                raise ValueError(f"{steps} are none of the {self.steps} steps of this comparison")
            counted &= usable
            share = counted / max(np.count_nonzero(counted), 1)
        below = np.where(usable, below, 0.0)
        values, inverse = share * ratio(self._estimate(numerator).value, below, 0.0), ratio(np.ones(self.steps), below, 0.0)
        linear = numerator.times(share * inverse).plus(denominator.times(-values * inverse))
        found = self._estimate(linear, total=steps is not None)
        if steps is not None:
            values, usable = values.sum(), np.asarray(counted.any() or self.without_error[steps].all())
        return replace(
            found, value=np.where(usable, values, np.nan), standard_error=np.where(usable, found.standard_error, np.nan)
        )

    def _estimate(self, terms: Terms, total: bool = False) -> Estimate:
        """The mean of the terms, (steps,), or summed over the steps, with its standard error."""
        full, weights = batch_sums(self.sums, self.fast, terms.everywhere, total), self.sums.weights
        part = self.slow_part
        if part is None or not terms.on_slow_part:
            found = estimate(full, weights)
        else:
            names = (*self.fast, *part.slow)
            if part.exceptional is not None:
                full = full + batch_sums(part.exceptional, names, terms.on_slow_part, total)
            x, y = (batch_sums(part.first, names, some, total) for some in terms)
            found = estimate(full, weights, x, y, part.first.weights, part.part(weights.sum()))
        return found if self.replicas is None else with_design(found, *self.replicas.variance(terms, total))
