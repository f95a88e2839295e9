"""Initial states drawn wider than the prior, and weighted: the same means, with smaller errors where far starts dominate."""

import numpy as np
import pytest
from scipy import stats

from kfcourse import Ensemble, Model, compare, lab_filters, load_variants
from kfcourse.filters import aof, kalman_filter
from kfcourse.lab import LAB
from kfcourse.montecarlo.widths import best_width
from kfcourse.symbolic.structure import gaussian

SIGMA = 4


@pytest.fixture(scope="module")
def vector():
    return Model.define(
        ["0.9*x1 + 0.2*x2 + 0.3*v1", "0.8*x2 + v2"], ["x1 + w1", "x2 - x1 + 0.5*w2"],
        prior={"mean": [1, -2], "variance": [[2, 0.5], [0.5, 1]]},
    )  # fmt: skip


def test_the_weight_is_the_ratio_of_the_two_densities(vector):
    ensemble = Ensemble(vector, 5, 1, np.random.SeedSequence(1), wide=1.7)
    x = next(ensemble.block(0)).x
    mean, cov = vector.prior
    prior, wide = (stats.multivariate_normal(mean, factor * cov).pdf(x) for factor in (1, 1.7**2))
    np.testing.assert_allclose(ensemble.weight(x), prior / (0.5 * prior + 0.5 * wide), rtol=1e-12)
    far = np.array([[1e3, 1e3], [1.0, -2.0]])
    assert (ensemble.weight(far) >= 0).all() and (ensemble.weight(far) <= 2).all()  # however far, and finite


def test_initial_states_are_spread_over_strata_half_of_them_wide():
    """In each set of 16, sorted within each half: one value in each of eight strata of the prior, and of the law 3 times as wide.

    Any part of a set is a fair sample: over many sets the first state of each follows the mixture.
    """
    model = Model.define("x + v", "x + w", prior={"mean": 5, "variance": 4})
    plain = next(Ensemble(model, 16 * 400, 1, np.random.SeedSequence(1), wide=1).block(0)).x[:, 0].reshape(400, 16)
    strata = np.floor(16 * stats.norm(5, 2).cdf(np.sort(plain, axis=1)))
    assert (strata == np.arange(16)).all()
    x = next(Ensemble(model, 16 * 1000, 1, np.random.SeedSequence(1), wide=3).block(0)).x[:, 0]
    mixture = lambda x: 0.5 * stats.norm(5, 2).cdf(x) + 0.5 * stats.norm(5, 6).cdf(x)  # noqa: E731
    assert stats.kstest(x.reshape(1000, 16)[:, 0], mixture).pvalue > 1e-4
    # A function of the start alone is known far better than from independent draws: sets scatter only within strata.
    weights = Ensemble(model, 16, 1, np.random.SeedSequence(1), wide=3).weight(x[:, None])
    means = (weights * (x - 5) ** 2).reshape(1000, 16).mean(axis=1)
    assert abs(means.mean() - 4) < SIGMA * means.std() / np.sqrt(1000)
    assert means.std() < 0.5 * (weights * (x - 5) ** 2).std() / 4


def test_a_component_that_is_known_has_no_weight():
    known = Model.define(["x1 + v", "x2"], "x1 + w", prior={"mean": [0, 3], "variance": [[4, 0], [0, 0]]})
    one = Model.define("x + v", "x + w", prior={"variance": 4})
    states = np.array([[0.5, 3.0], [-4.0, 3.0]])
    weights = [Ensemble(m, 2, 1, np.random.SeedSequence(1), wide=2).weight(x) for m, x in ((known, states), (one, states[:, :1]))]
    np.testing.assert_allclose(*weights, rtol=1e-14)


def test_without_widening_nothing_changes(vector):
    for wide in (None, 1):
        assert Ensemble(vector, 5, 1, np.random.SeedSequence(1), wide=wide).weight(np.zeros((5, 2))) is None
    for wide in (0.5, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="wide must be at least 1"):
            Ensemble(vector, 5, 1, np.random.SeedSequence(1), wide=wide)
    with pytest.raises(ValueError, match="same_ensemble"):
        compare([kalman_filter(vector)], vector, 50, 2, 1, same_ensemble=True, wide=2, progress=False)


def test_every_statistic_is_a_mean_over_the_prior(vector):
    """The Kalman filter's variance is known: error, claim, normalised error and bias, each within 4 standard errors."""
    result = compare([kalman_filter(vector)], vector, 40_000, 3, 2, wide=1.5, progress=False)
    state, expected = kalman_filter(vector).init(1), []
    for _ in range(3):
        state = kalman_filter(vector).step(state, np.zeros((1, 2)))
        expected.append(np.trace(state.posterior.cov))
    found = result.error_variance("kalman"), result.own_variance("kalman"), result.normalised_error("kalman")
    for estimate, truth in zip(found, (expected, expected, np.ones(3)), strict=True):
        # what the filter claims is the same for all trajectories: only rounding is left
        assert (abs(estimate.value - truth) < SIGMA * estimate.standard_error + 1e-14).all()
    bias = result.error_mean("kalman")
    assert (abs(bias.value) < SIGMA * bias.standard_error).all()


def test_on_variant_53_it_tells_the_same_with_less_error(variant53):
    filters = lab_filters(variant53, [*LAB, "aof-exact"])
    plain, wide = (
        compare(filters, variant53, 30_000, 4, 3, design_runs=50_000, slow_runs=2000, wide=factor, progress=False)
        for factor in (1, 2)
    )
    for name in ("aof-linearised", "mfos-gaussian"):  # designed on the same ensemble: the same filters
        for ask in ("gap", "error_variance"):
            a, b = (getattr(result, ask)(name) for result in (plain, wide))
            assert (abs(a.value - b.value) < SIGMA * np.hypot(a.standard_error, b.standard_error)).all(), (name, ask)
            assert np.median(a.standard_error / b.standard_error) > 1.3, (name, ask)  # strata alone help, too


def test_a_variance_that_serves_all_trajectories_is_weighted_too():
    model = Model.define("0.9*x + v", "x + w")
    one, each = aof(gaussian(model)), kalman_filter(model)
    result = compare([one, each], model, 2000, 2, 1, wide=2, progress=False)
    for k in range(2):
        assert result.own_variance("aof-gaussian").value[k] == pytest.approx(result.own_variance("kalman").value[k], rel=1e-12)


def test_states_that_the_prior_hardly_ever_has_are_not_drawn_where_they_lead_astray():
    """x - 0.05 x^3 leaves for ever from beyond 6.3, nine deviations of the prior away; variant 53's far states do not."""
    for name, steps, wide in (("8", 5, False), ("8", 6, False), ("53", 6, True)):
        model = load_variants()[name].model
        filters = lab_filters(model, ["aof-gaussian", "aof-linearised"])
        found = best_width(filters, Ensemble(model, 20_000, steps, 1))
        assert (found > 1) == wide
