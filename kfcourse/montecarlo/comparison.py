"""What a comparison of filters found: error statistics per step, differences, ranking, distance
from the exact filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from kfcourse.errors import Reason
from kfcourse.laws import CONFIDENCE, Array
from kfcourse.montecarlo.statistics import Estimate, Sums, ratio, rejected, without_each
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.writing import by_thousands

EXACT = "aof-exact"
# an error variance less than this part of M|x|^2 is one of rounding
ROUNDING = (64 * np.finfo(float).eps) ** 2
# squared error of the exact filter's own, in its variance, from which on it bounds nothing
UNHEALTHY = 0.1
# standard errors by which a filter must be better than the exact one to refute it, at any step
BEATEN = 5.0
LOST = 100.0  # times the most accurate filter's D_k: ten times its error
HEAVY = 0.1  # part of D_k that a single trajectory makes where the filter diverges on a few
# of the bound: standard error at least of what is said of a single step, as rare trajectories carry
# what is smaller
RESOLUTION = 5e-4
# of D_k: filters that differ by less coincide, as half of their digits may be lost on the way
ALIKE = 1e-8


class Verdict(NamedTuple):
    """At one step: the most accurate filter, those that are not significantly worse, and the least
    accurate if it is worse."""

    best: str
    not_worse: list[str]
    worst: str


@dataclass(frozen=True)
class Comparison:
    """Statistics of filters on common trajectories; made by `kfcourse.compare`.

    The accuracy of a filter is D_k = M[(x_k - z_k)^T (x_k - z_k)], the course's error variance (for
    a vector state, the trace of M[(x - z)(x - z)^T]); `error_mean` tells how much of it is bias.

    The exact AOF is no filter among others, but their bound: `gap` tells how far above it each of
    them is.  Where it ran, D_k is its own variance and what the filter is above it (`excess`), by
    orthogonality; else it is the mean of the squared errors. There is one estimate of each D_k,
    from which all else follows, so that table, ranking and verdict cannot disagree.  An interval
    speaks of the filters as they were designed: another design ensemble gives somewhat other
    coefficients.

    Attributes
    ----------
    model : Model
    names : tuple of str
        All filters with results, in the order given.
    runs, steps, seed : int
    sums : Sums
    designed : tuple of str
        Those whose coefficients were found over an ensemble of their own.
    left_out : dict
        Filters without results although they were wanted: name to the reason.
    smoothing : Comparison, optional
        The same of smoothers on the same trajectories, if `compare` was given any: their error
        variances given the whole record, and how far they are above the exact smoother.
    """

    model: Model | JumpModel
    names: tuple[str, ...]
    runs: int
    steps: int
    seed: int
    sums: Sums
    designed: tuple[str, ...] = ()
    left_out: Mapping[str, Reason] = field(default_factory=dict)
    smoothing: Comparison | None = None

    def __repr__(self) -> str:
        compared = (
            f"Comparison of {', '.join(self.names)}: {self.steps} steps, {self.runs} trajectories"
        )
        lines = [
            f"{by_thousands(compared)}, seed {self.seed}",
            *(f"left out: {name}, {why}" for name, why in self.left_out.items()),
            "ask ranking(), verdicts(), error_variance(name), gap(name), difference(first, second)"
            + (", and the same of .smoothing" if self.smoothing else ""),
        ]
        return "\n".join(lines)

    @property
    def entrants(self) -> tuple[str, ...]:
        """The filters that are compared: all but the exact one, which bounds them."""
        return tuple(name for name in self.names if name != EXACT)

    @property
    def has_bound(self) -> bool:
        """Whether the exact AOF ran."""
        return EXACT in self.names

    @property
    def scored(self) -> bool:
        """Whether predictions were judged: `log_score` and `crps`."""
        return "crps" in self.sums

    @cached_property
    def control(self) -> str:
        """The filter that others are related to where there is no bound: the Gaussian AOF if there,
        else the first.

        One that diverges is passed over.
        """
        steady = [name for name in self.entrants if name not in self.lost] or self.names
        return "aof-gaussian" if "aof-gaussian" in steady else steady[0]

    @property
    def reference(self) -> str:
        """What gaps are above: the exact AOF, or the control."""
        return EXACT if self.has_bound else self.control

    # --- steps at which there is nothing to be said

    @property
    def rounding(self) -> Array:
        """Error variances, (steps,), that may be of rounding alone: of states so large, in
        doubles."""
        return ROUNDING * self.sums["size"].sum(axis=-1) / self.sums["weight"].sum()

    @cached_property
    def without_error(self) -> Array:
        """Steps, (steps,), at which the reference errs by rounding only: of such a bound no part
        can be told."""
        return np.asarray(self._variance(self.reference)[:, 0] <= self.rounding)

    @cached_property
    def doubtful(self) -> Array:
        """Steps, (steps,), at which what should be exact is not: it errs by too much itself, or a
        filter is more accurate."""
        if not self.has_bound:
            return np.zeros(self.steps, dtype=bool)
        bound = self._means("own", EXACT)
        beaten = ~(self._means("distance", EXACT)[:, 0] <= UNHEALTHY * bound[:, 0])
        for name in self.entrants:
            above = Estimate.jackknife(self._means("square", name).sum(axis=1) - bound)
            beaten |= above.value < -BEATEN * above.standard_error
        return beaten & ~self.without_error

    @property
    def usable(self) -> Array:
        """Steps, (steps,), at which distances from the bound, or from the control, have a
        meaning."""
        return ~(self.without_error | self.doubtful)

    @cached_property
    def lost(self) -> dict[str, Array]:
        """Entrants that diverge on a few trajectories, and the steps, (steps,), at which these make
        `LOST` times the best D_k."""
        squares = {name: self._means("square", name)[..., 0].sum(axis=1) for name in self.entrants}
        most = LOST * np.min([*squares.values()], axis=0, initial=np.inf) + self.rounding
        largest = dict(zip(self.names, self.sums["largest"].max(axis=-1), strict=True))
        heavy = HEAVY * self.sums["weight"].sum()
        diverged = {
            name: (square > most) & (largest[name] > heavy * square)
            for name, square in squares.items()
        }
        return {name: steps for name, steps in diverged.items() if steps.any()}

    # --- accuracy

    def error_variance(self, name: str) -> Estimate:
        """D_k per step, (steps,), with standard errors; for the exact AOF the mean of its own
        variance (`bound`)."""
        return Estimate.jackknife(self._variance(name))

    def difference(self, first: str, second: str) -> Estimate:
        """D_k(first) - D_k(second), (steps,), from paired trajectories; no finer than `gap`.

        From the exact AOF it is what a filter is above the bound, by orthogonality: the error of
        the posterior mean is uncorrelated with every function of the measurements, so
        M|x - z|^2 - M|x - z_exact|^2 = M|z - z_exact|^2.  The right side never sees the error
        itself, so it is far less noisy as long as the two filters are close.
        """
        difference = Estimate.jackknife(self._variance(first) - self._variance(second))
        return self._resolved(difference, self._variance(self.reference)[:, 0])

    def relative(self, name: str, reference: str | None = None) -> Estimate:
        """D_k(name) / D_k(reference or control), (steps,)."""
        return Estimate.jackknife(
            ratio(self._variance(name), self._variance(reference or self.control), np.nan)
        )

    def score(self, name: str, steps: slice = slice(None)) -> Estimate:
        """The mean over steps of D_k(name) / D_k(control): one number for a filter."""
        return self._mean(self._variance(name), self._variance(self.control), steps)

    def bound(self) -> Estimate:
        """D_k of the exact AOF, (steps,), as the mean of its own variance."""
        return self.error_variance(EXACT)

    def gap(self, name: str) -> Estimate:
        """How far above the bound a filter is, D_k(name) / D_k(exact AOF) - 1 per step, (steps,).

        Without the exact AOF, how far above the control.  NaN at steps that are not `usable`.

        Rare trajectories carry a gap that has become small, a sample may lack them, and then its
        scatter does not show them.  So nothing is said of a single step more finely than to
        `RESOLUTION`: a 95 % interval has a thousandth of the bound to each side.  Of variant 53
        these intervals hold true gaps and differences in 99 % of the cases, and in 85 % at the
        worst step of the worst filter; those of `mean_gap` hold 95 % (20,000 trajectories, 200
        seeds, `benchmarks/intervals.py`).  Of variant 2 the three are 99, 92 and 94 %, with 100
        seeds of variant 6 99, 89 and 97 %, of variant 7 93, 83 and 96 %.  Of variant 5 one
        trajectory in some thirty thousand carries a part of the gap: its 100,000 hold 92 %, 69 % at
        the worst step of the linearised AOF, and 92 % in the mean (of fives of 90 comparisons with
        20,000, which hold 85, 32 and 83 %).
        """
        return self._resolved(Estimate.jackknife(self._gap(name)), 1.0)

    def gap_difference(self, first: str, second: str) -> Estimate:
        """gap(first) - gap(second) per step, (steps,), paired: it tells which of two filters is the
        more accurate; no finer than `gap`."""
        return self._resolved(Estimate.jackknife(self._gap(first) - self._gap(second)), 1.0)

    def mean_gap(self, name: str, steps: slice = slice(None)) -> Estimate:
        """The mean over steps of `gap`: one number for a filter.

        As all means over steps, over those that are `usable`; NaN if none is, but 0 if all errors
        are of rounding.
        """
        reference = self._variance(self.reference)
        return self._mean(self._variance(name) - reference, reference, steps)

    def mean_gap_difference(self, first: str, second: str, steps: slice = slice(None)) -> Estimate:
        """mean_gap(first) - mean_gap(second), paired: the difference that a ranking turns on."""
        return self._mean(
            self._variance(first) - self._variance(second), self._variance(self.reference), steps
        )

    # --- who is better

    def ranking(self, steps: slice = slice(None)) -> list[tuple[str, Estimate]]:
        """The entrants from the most accurate on, each with its `mean_gap`; those that coincide in
        their own order."""
        gaps = [(name, self.mean_gap(name, steps)) for name in self.entrants]
        return sorted(gaps, key=lambda item: round(float(item[1].value) / ALIKE))

    @cached_property
    def _ranked(self) -> list[list[str]]:
        """The entrants at each step from the most accurate on; those that coincide in their own
        order."""
        variances = np.array([self._variance(name)[:, 0] for name in self.entrants])
        least = np.fmin.reduce(variances)
        order = np.argsort(
            np.round(variances / np.where(least > 0, least, 1.0) / ALIKE), axis=0, kind="stable"
        )
        return [[self.entrants[i] for i in column] for column in order.T]

    def leaders(self, step: int) -> list[str]:
        """The most accurate entrant at a step, then those that are not significantly worse, each by
        its own paired interval."""
        best, *others = self._ranked[step]
        return [
            best,
            *(name for name in others if self._p_value(name, best)[step] > 1 - CONFIDENCE),
        ]

    def verdicts(self) -> list[Verdict]:
        """For each step the most accurate entrant, who is not significantly worse, and who is the
        least accurate.

        With a confidence of 95 % all of them are right: Holm's test of everybody's difference from
        the most accurate, over all steps and filters.  Where all errors are rounding, nobody is
        better.
        """
        ranked = self._ranked
        pairs = {(name, best) for best, *others in ranked for name in others}
        by_pair = {pair: self._p_value(*pair) for pair in pairs}
        p = np.array(
            [
                [by_pair[name, best][k] for name in others]
                for k, (best, *others) in enumerate(ranked)
            ]
        )
        worse = rejected(p, 1 - CONFIDENCE)
        return [
            Verdict(
                best,
                [name for name, bad in zip(others, row, strict=True) if not bad],
                others[-1] if others and row[-1] else "",
            )
            for (best, *others), row in zip(ranked, worse, strict=True)
        ]

    def _p_value(self, name: str, best: str) -> Array:
        """Of their difference at each step; 1 where they coincide but for rounding."""
        difference = self.difference(name, best)
        alike = np.abs(difference.value) <= ALIKE * self._variance(best)[:, 0]
        return np.where(alike | self.without_error, 1.0, difference.p_value())

    # --- other statistics

    def error_mean(self, name: str) -> Estimate:
        """M[x_k - z_k] per step and component, (steps, n)."""
        return Estimate.jackknife(self._means("error", name))

    def component_variance(self, name: str) -> Estimate:
        """M[(x_i - z_i)^2] per step and component, (steps, n)."""
        return Estimate.jackknife(self._means("square", name))

    def own_variance(self, name: str) -> Estimate:
        """What the filter claims: the mean of its own variances, summed over components,
        (steps,)."""
        return Estimate.jackknife(self._means("own", name))

    def normalised_error(self, name: str) -> Estimate:
        """M[e^T p^-1 e] / n per step, (steps,): 1 for a filter whose covariance is right."""
        return Estimate.jackknife(self._means("normalised", name))

    def log_score(
        self, name: str, minus: str | None = None, steps: slice | None = None
    ) -> Estimate:
        """M[ln p(y_k | y_0, ..., y_{k-1})] by the filter's prediction per step, (steps,): the more
        the better, and the exact filter has the most.

        With `minus` the difference from another filter, paired; with `steps` the mean over them,
        one number.  A filter that is sure and wrong loses without limit.

        Of a linear model, whose scores are known in closed form, the 95 % intervals of 2,000
        trajectories hold them in 94.6 % of the cases, those of `crps` in 94.7 % (300 seeds, 12
        steps); at the worst step, the first, in 91 and 92 %.
        """
        return self._score("log_score", name, minus, steps)

    def crps(self, name: str, minus: str | None = None, steps: slice | None = None) -> Estimate:
        """M[Integral (P(y) - [y >= y_k])^2 dy] per step, (steps,), P the predicted distribution:
        the less the better; in the units of y, the sum over its components.

        M|e| of a filter that claims to be sure.  For the exact filter and for particles,
        measurements are drawn from their predictions: the 95 % intervals of 2,000 trajectories of a
        linear model hold the exact filter's in 94.9 % of the cases, in 92 % at the worst step (300
        seeds, 12 steps); those of 100 particles on variant 53 their mean in 93.8 %, in 92.5 % at
        the worst step, in 93 % of the means over steps (200 seeds, 4 steps).  NaN for gated filters
        and others whose predictions are neither normal laws nor mixtures of some (T. Gneiting and
        A. Raftery, Strictly proper scoring rules, J. Am. Stat. Assoc. 102, 2007).
        """
        return self._score("crps", name, minus, steps)

    def _score(self, kind: str, name: str, minus: str | None, steps: slice | None) -> Estimate:
        if not self.scored:
            raise KeyError("predictions are judged by compare(..., scores=gaussian(model))")
        value = self._means(kind, name) - (self._means(kind, minus) if minus else 0.0)
        return Estimate.jackknife(value if steps is None else value[steps].mean(axis=0))

    # --- what the estimates are made of: of all batches, and without each of them, (..., 1 +
    # batches)

    def _means(self, kind: str, name: str) -> Array:
        if name not in self.names:
            why = f": {self.left_out[name]}" if name in self.left_out else ""
            raise KeyError(
                f"no results for {name!r}{why}; this comparison has {', '.join(self.names)}"
            )
        sums = self.sums[kind][self.names.index(name)]
        return without_each(sums) / without_each(self.sums["weight"])

    def _variance(self, name: str) -> Array:
        """D_k, (steps, ...)."""
        if not self.has_bound:
            return self._means("square", name).sum(axis=1)
        bound = self._means("own", EXACT)
        return bound if name == EXACT else bound + self._means("distance", name)

    def _resolved(self, estimate: Estimate, unit: Array | float) -> Estimate:
        """An estimate of single steps, where there is a bound with a standard error of `RESOLUTION`
        units at least."""
        if not self.has_bound:
            return estimate
        least = RESOLUTION * unit
        return replace(estimate, standard_error=np.maximum(estimate.standard_error, least))

    def _gap(self, name: str) -> Array:
        reference = np.where(self.usable[:, None], self._variance(self.reference), 0.0)
        return ratio(self._variance(name) - reference, reference, np.nan)

    def _mean(self, numerator: Array, denominator: Array, steps: slice) -> Estimate:
        """The mean over the usable ones of some steps of a quotient; ValueError if the steps are
        none."""
        chosen = np.zeros(self.steps, dtype=bool)
        chosen[steps] = True
        if not chosen.any():
            raise ValueError(f"{steps} are none of the {self.steps} steps of this comparison")
        counted = chosen & self.usable
        if not counted.any():
            value = np.asarray(0.0 if self.without_error[chosen].all() else np.nan)
            return Estimate(value, value, 1)
        return Estimate.jackknife((numerator[counted] / denominator[counted]).mean(axis=0))
