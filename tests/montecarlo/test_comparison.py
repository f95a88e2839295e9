"""What a comparison reports: against direct per-trajectory formulas, theory, and the page's table."""

import itertools
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from kfcourse.filters.approximations import aof
from kfcourse.filters.conditionally_optimal import duof
from kfcourse.filters.exact.pointmasses import pointmass
from kfcourse.filters.kalman import kalman_filter
from kfcourse.filters.optimal_structure import fos, mfos
from kfcourse.laws import Gaussian
from kfcourse.montecarlo.batches import BATCHES
from kfcourse.montecarlo.comparison import Comparison, SlowPart
from kfcourse.montecarlo.ensemble import BLOCK, Ensemble
from kfcourse.montecarlo.exceptional import how_many
from kfcourse.montecarlo.experiment import compare, run
from kfcourse.montecarlo.slow_filters import BATCH
from kfcourse.montecarlo.statistics import Estimate, Sums, batch_mean
from kfcourse.scenarios.benchmarks import growth_model
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import gaussian, linearised

SIGMA = 4  # standard errors: one chance in 16 000 a comparison
BATCH_ERROR = 1 / np.sqrt(2 * (BATCHES - 1))  # relative error of a standard error from so many batches


@pytest.fixture(scope="module")
def linear():
    return Model.define(
        ["0.9*x1 + 0.2*x2 + 0.3*v1", "0.8*x2 + v2"], ["x1 + w1", "x2 - x1 + 0.5*w2"],
        prior={"mean": [1, -2], "variance": [[2, 0.5], [0.5, 1]]}, meter_noise={"variance": [[1, 0.2], [0.2, 2]]},
    )  # fmt: skip


def stored(model, runs, steps, seed):
    """The trajectories of compare(..., seed): x (steps, runs, n) and y (steps, runs, p)."""
    ensemble = Ensemble(model, runs, steps, np.random.SeedSequence(seed).spawn(2)[0])
    blocks = [list(ensemble.block(index)) for index in range(len(ensemble.sizes))]
    return tuple(np.stack([np.concatenate([block[k][i] for block in blocks]) for k in range(steps)]) for i in (0, 1))


RUNS, STEPS, SEED = 6000, 4, 5


@pytest.fixture(scope="module")
def direct(linear):
    """The comparison, and errors and covariances of each trajectory kept beside it."""
    filters = [aof(gaussian(linear)), duof(linear), replace(kalman_filter(linear), name="other")]
    wrong = Model.define(
        list(linear.state_equation),
        list(linear.meter_equation),
        prior={"variance": 9},
        symbols={"v": ["v1", "v2"], "w": ["w1", "w2"]},
    )
    filters[2] = replace(kalman_filter(wrong), name="wrong")
    result = compare(filters, linear, RUNS, STEPS, SEED, same_ensemble=True, progress=False)
    x, y = stored(linear, RUNS, STEPS, SEED)
    found = {one.name: run(one, y) for one in (filters[0], filters[2])}
    return result, {name: (x - estimate.mean, estimate.cov) for name, estimate in found.items()}


def batches(values):
    """Sums over the batches of one block, of whole sets of 16: values (..., runs)."""
    edges = np.append(np.linspace(0, RUNS, BATCHES + 1).astype(int)[:-1] // 16 * 16, RUNS)
    return np.add.reduceat(values, edges[:-1], axis=-1), np.diff(edges).astype(float)


def agree(estimate, values):
    """The estimate is the mean of per-trajectory values (..., runs), with the standard error they have."""
    np.testing.assert_allclose(estimate.value, values.mean(axis=-1), rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(estimate.standard_error, batch_mean(*batches(values)).standard_error, rtol=1e-9, atol=1e-13)
    exact = values.std(axis=-1) / np.sqrt(values.shape[-1])
    assert (abs(estimate.standard_error / exact - 1) < SIGMA * BATCH_ERROR).all()


def test_the_statistics_are_those_of_the_trajectories(direct):
    result, errors = direct
    for name, (error, cov) in errors.items():
        agree(result.error_variance(name), (error**2).sum(axis=-1))
        agree(result.error_mean(name), np.moveaxis(error, 1, -1))
        agree(result.component_variance(name), np.moveaxis(error**2, 1, -1))
        normalised = np.einsum("kni,knij,knj->kn", error, np.linalg.inv(cov), error) / 2
        agree(result.normalised_error(name), normalised)
        np.testing.assert_allclose(result.own_variance(name).value, np.trace(cov, axis1=-2, axis2=-1).mean(axis=-1), rtol=1e-11)


@pytest.mark.filterwarnings("error")
def test_the_normalised_error_of_a_scalar_filter_is_the_mean_of_e2_over_p():
    """Three ways to sum e^2 / p: a variance for each trajectory, one for all, and as a vector of one component beside another.

    A claim of variance 0 is right if there is no error (0), and infinitely wrong if there is (infinity).
    """
    x = np.array([1.0, -2.0, 3.0, 0.5, -1.5])
    p = np.array([0.5, 2.0, 4.0, 0.25, 1.0])
    still = np.zeros_like(x)  # the estimate is 0: x is the error

    def recorded(errors, cov):
        sums = Sums.empty(1, 1, errors.shape[1], np.array([2, 3]))
        sums.record(0, 0, errors, Gaussian(np.zeros_like(errors), cov))
        return sums.normalised[0, 0]

    def expected(quotients):
        return [quotients[:2].sum(), quotients[2:].sum()]

    np.testing.assert_allclose(recorded(x[:, None], p[:, None, None]), expected(x**2 / p), rtol=1e-14)
    np.testing.assert_allclose(recorded(x[:, None], np.array([[2.0]])), expected(x**2 / 2), rtol=1e-14)
    pairs, covs = np.stack([x, still], axis=1), p[:, None, None] * np.eye(2)
    np.testing.assert_allclose(recorded(pairs, covs), expected(x**2 / p / 2), rtol=1e-14)

    certain = np.array([0.0, 2.0, 0.0, 0.25, 1.0])
    known = np.where(certain > 0, x, 0.0)
    quotients = np.array([0.0, 2.0, 0.0, 1.0, 2.25])
    np.testing.assert_allclose(recorded(known[:, None], certain[:, None, None]), expected(quotients), rtol=1e-14)
    assert recorded(known[:, None], np.array([[0.0]])).tolist() == [np.inf, np.inf]
    assert recorded(still[:, None], np.array([[0.0]])).tolist() == [0, 0]
    assert recorded(x[:, None], certain[:, None, None]).tolist() == [np.inf, np.inf]


def test_differences_and_ratios_are_paired(direct):
    result, errors = direct
    ours, theirs = ((errors[name][0] ** 2).sum(axis=-1) for name in ("aof-gaussian", "wrong"))
    agree(result.difference("wrong", "aof-gaussian"), theirs - ours)
    ratio = result.relative("wrong", "aof-gaussian")
    np.testing.assert_allclose(ratio.value, theirs.mean(axis=1) / ours.mean(axis=1), rtol=1e-11)
    influence = (theirs - ratio.value[:, None] * ours) / ours.mean(axis=1, keepdims=True)
    np.testing.assert_allclose(ratio.standard_error, batch_mean(*batches(influence)).standard_error, rtol=1e-9)
    for score in (result.score("wrong"), result.score_difference("wrong", "aof-gaussian")):
        np.testing.assert_allclose(score.standard_error, batch_mean(*batches(influence.mean(axis=0))).standard_error, rtol=1e-9)
    assert float(result.score("wrong").value) == pytest.approx(ratio.value.mean(), rel=1e-11)
    assert float(result.score_difference("wrong", "aof-gaussian").value) == pytest.approx(ratio.value.mean() - 1, rel=1e-11)


@pytest.mark.parametrize("steps", [slice(2, 3), slice(0, 2)])
def test_a_score_is_over_the_steps_asked_for(direct, steps):
    """Over one step it is the ratio of that step, with its standard error: there is nothing to average."""
    result, _ = direct
    score, by_step = result.score("wrong", steps), result.relative("wrong")
    assert score.value == pytest.approx(by_step.value[steps].mean(), rel=1e-12)
    if steps == slice(2, 3):
        assert score.standard_error == pytest.approx(by_step.standard_error[2], rel=1e-9)


def test_pairing_pays(direct):
    result, _ = direct
    paired = result.difference("duof", "aof-gaussian").standard_error
    separate = np.hypot(result.error_variance("duof").standard_error, result.error_variance("aof-gaussian").standard_error)
    assert (paired < separate / 3).all()


def test_a_filter_does_not_differ_from_itself(direct):
    result, _ = direct
    own = result.difference("duof", "duof")
    assert not own.value.any()
    assert not own.standard_error.any()
    ratio = result.relative("duof", "duof")
    assert (ratio.value == 1).all()
    assert (ratio.standard_error == 0).all()


def test_an_unknown_name_is_answered_with_the_known_ones(direct):
    result, _ = direct
    for ask in (result.error_variance, result.error_mean, result.normalised_error, result.relative, result.score):
        with pytest.raises(KeyError, match="aof-gaussian, duof, wrong"):
            ask("ekf")


def test_the_optimal_filter_s_own_covariance_is_right_and_no_other_is_better(direct):
    result, _ = direct
    normalised = result.normalised_error("aof-gaussian")
    assert (abs(normalised.value - 1) < SIGMA * normalised.standard_error).all()
    claimed, actual = result.own_variance("aof-gaussian").value, result.error_variance("aof-gaussian")
    assert (abs(claimed - actual.value) < SIGMA * actual.standard_error).all()
    bias = result.error_mean("aof-gaussian")
    assert (abs(bias.value) < SIGMA * bias.standard_error).all()
    for name in ("duof", "wrong"):
        gap = result.difference(name, "aof-gaussian")
        assert (gap.value > -SIGMA * gap.standard_error).all()


def test_the_ranking_is_by_mean_relative_variance(direct):
    result, _ = direct
    ranking = result.ranking()
    assert sorted(name for name, _ in ranking) == sorted(result.names)
    values = [float(estimate.value) for _, estimate in ranking]
    assert values == sorted(values)
    assert ranking[-1][0] == "wrong"


def test_intervals_are_student_s(direct):
    estimate = direct[0].error_variance("duof")
    symmetric = replace(estimate, skewness=0.0)
    low, high = symmetric.interval(0.9)
    half = stats.t.ppf(0.95, BATCHES - 1) * estimate.standard_error
    np.testing.assert_allclose(high - estimate.value, half, rtol=1e-9)
    np.testing.assert_allclose(estimate.value - low, half, rtol=1e-9)
    np.testing.assert_allclose(symmetric.half_width(0.9), half, rtol=1e-9)
    for confidence in (0, 1, 95):
        with pytest.raises(ValueError, match="confidence"):
            estimate.interval(confidence)


def test_a_skewed_mean_has_intervals_by_hall_s_transformation():
    """g(t) = t + a t^2 / 3 + a^2 t^3 / 27 + a / 6 is Student's quantile at both limits, t = (mean - limit) / SE; a by hand."""
    sums, counts = np.array([0.0, 1, 2, 9]), np.ones(4)
    found = batch_mean(sums, counts)
    deviations = sums - 3
    a = (deviations**3).sum() / (deviations**2).sum() ** 1.5
    assert found.skewness == pytest.approx(a, rel=1e-14) and a > 0
    quantile = stats.t.ppf(0.975, 3)
    for limit, wanted in zip(found.interval(0.95), (quantile, -quantile), strict=True):
        t = (found.value - limit) / found.standard_error
        assert t + a * t**2 / 3 + a**2 * t**3 / 27 + a / 6 == pytest.approx(wanted, rel=1e-10)
    low, high = found.interval(0.95)
    assert high - found.value > found.value - low  # more room above


def test_intervals_of_skewed_means_cover_where_student_s_do_not():
    """Means of 60 values exp(2 u), u normal: skewed as a squared error with rare far starts is.

    95 % of 2000 samples would be covered.  Student's interval covers about 80 %, Hall's more by at least 6 %: four of the
    binomial's standard errors of a difference, 0.9 %, are less.
    """
    samples = np.exp(2 * np.random.default_rng(1).standard_normal((2000, 60)))
    found, truth = batch_mean(samples, np.ones(60)), np.exp(2.0)
    shares = []
    for one in (found, replace(found, skewness=0.0)):
        low, high = one.interval(0.95)
        shares.append(((low < truth) & (truth < high)).mean())
    assert shares[0] > shares[1] + 0.06


def test_intervals_cover_the_truth_as_often_as_they_say(linear):
    """95 % intervals of D_0 over 200 independent comparisons: the binomial's 4 standard errors around 190."""
    truth = float(np.trace(kalman_filter(linear).step(kalman_filter(linear).init(1), np.zeros((1, 2))).posterior.cov))
    hits = 0
    for seed in range(200):
        low, high = (
            compare([kalman_filter(linear)], linear, 400, 1, seed, threads=1, progress=False)
            .error_variance("kalman")
            .interval(0.95)
        )
        hits += bool(low[0] < truth < high[0])
    assert abs(hits - 190) < SIGMA * np.sqrt(200 * 0.95 * 0.05)


@pytest.mark.parametrize("size", [1, 2])
def test_the_standard_error_squared_is_unbiased(size):
    """Three batches of equal size: over all ensembles drawn from 0, 1 and 5 the mean of SE^2 is Var / N, Var = 14 / 3.

    It is the divisor B - 1 that makes it so: the deviations are from the sample's own mean.
    """
    counts = np.full(3, float(size))
    samples = np.array(list(itertools.product([0.0, 1.0, 5.0], repeat=3 * size)))
    found = batch_mean(samples.reshape(len(samples), 3, size).sum(axis=-1), counts)
    assert np.mean(found.standard_error**2) == pytest.approx(14 / 3 / (3 * size), rel=1e-12)
    np.testing.assert_allclose(found.value, samples.mean(axis=1), rtol=1e-14)
    assert found.freedom == 2


def test_batches_of_unequal_size_are_weighed():
    rng = np.random.default_rng(0)
    counts = np.array([50.0] * 60 + [1.0, 20.0, 30.0])
    errors, found = [], []
    for _ in range(300):
        sample = rng.normal(3.0, 2.0, size=int(counts.sum()))
        estimate = batch_mean(np.add.reduceat(sample, np.concatenate([[0], np.cumsum(counts[:-1])]).astype(int)), counts)
        errors.append(float(estimate.value) - 3.0)
        found.append(float(estimate.standard_error))
    # The average of SE^2 is the variance of the mean: known from 300 repetitions of 63 batches, its weights to 1/60.
    exact = 4.0 / counts.sum()
    assert np.mean(np.square(found)) == pytest.approx(exact, rel=SIGMA * np.sqrt(2 / 300 / 60) + 1 / 60)
    assert np.var(errors) == pytest.approx(exact, rel=SIGMA * np.sqrt(2 / 300))


def test_one_trajectory_has_no_standard_error(linear):
    estimate = compare([kalman_filter(linear)], linear, 1, 2, seed=1, progress=False).error_variance("kalman")
    assert np.isfinite(estimate.value).all()
    assert np.isnan(estimate.standard_error).all()


@pytest.mark.parametrize("runs", [700, BLOCK + 1])
def test_a_slow_filter_is_found_through_its_difference_from_the_control(variant53, runs):
    """On the first trajectories; of many, the exceptional ones, on which the control errs the most, count for themselves."""
    control, slow = aof(gaussian(variant53)), replace(aof(linearised(variant53)), name="slow", slow=True)
    result = compare([control, slow], variant53, runs, 4, seed=3, slow_runs=500, same_ensemble=True, progress=False)
    assert result.slow_runs == 500
    x, y = stored(variant53, runs, 4, 3)
    ours, theirs = ((x - run(one, y).mean)[..., 0] ** 2 for one in (control, slow))
    of_blocks = np.split(ours, np.cumsum(Ensemble(variant53, runs, 4, np.random.SeedSequence(0)).sizes)[:-1], axis=1)
    scores = np.concatenate([(block / block.mean(axis=1, keepdims=True)).max(axis=0) for block in of_blocks])
    exceptional = np.sort(np.argsort(-scores)[: how_many(runs)])
    known = exceptional[:64]  # sets 1, 9, 17 and 25 of 32; each stands for 496 / 64
    first = np.setdiff1d(np.arange(500 - len(exceptional[:64])), exceptional)
    part = len(exceptional) / runs
    apart = (1 - part) * (theirs - ours)[:, first].mean(axis=1)
    if part:
        apart += part * (theirs - ours)[:, known].mean(axis=1)
    np.testing.assert_allclose(result.error_variance("slow").value, ours.mean(axis=1) + apart, rtol=1e-10)
    difference = result.difference("slow", "aof-gaussian")
    np.testing.assert_allclose(difference.value, apart, rtol=1e-8, atol=1e-16)
    # the standard error of the difference is that of so many trajectories
    exact = (theirs - ours)[:, first].std(axis=1) / np.sqrt(len(first))
    if part:
        exact = np.hypot(exact, part * np.sqrt(((theirs - ours)[:, known] ** 2).mean(axis=1) / len(known)))
    found = difference.standard_error
    assert (found > 0).all()
    assert difference.freedom + 1 == -(-(500 - len(known)) // BATCH)
    # from 32 batches of 16 heavy-tailed values: not better than a factor 2
    assert ((found > exact / 2) & (found < 2 * exact)).all()


def test_a_slow_filter_on_all_trajectories_is_as_good_as_a_fast_one(variant53):
    control, fast = aof(gaussian(variant53)), aof(linearised(variant53))
    slow = replace(fast, name="slow", slow=True)
    result = compare([control, fast, slow], variant53, 640, 3, seed=3, slow_runs=640, progress=False)
    np.testing.assert_allclose(result.error_variance("slow").value, result.error_variance("aof-linearised").value, rtol=1e-11)


def test_the_excess_over_the_optimal_filter_is_the_distance_from_it(linear):
    """For a linear model the Kalman filter is exact: M|x - z|^2 - M|x - z_exact|^2 = M|z - z_exact|^2."""
    exact, other = replace(kalman_filter(linear), name="aof-exact", slow=True), duof(linear)
    result = compare(
        [aof(gaussian(linear)), other, exact], linear, 3000, 3, seed=8, design_runs=100, slow_runs=2000, progress=False
    )
    excess, gap = result.excess("duof"), result.difference("duof", "aof-exact")
    # A design on 100 trajectories errs by per cents, so the excess is far above its noise.
    assert (excess.value > SIGMA * excess.standard_error).any()
    assert (abs(gap.value - excess.value) < SIGMA * np.hypot(gap.standard_error, excess.standard_error)).all()
    assert (excess.standard_error < gap.standard_error).all()
    # Here the control is the exact filter too: no excess, and the bound is the variance that both claim.
    np.testing.assert_allclose(result.excess("aof-gaussian").value, 0, atol=1e-20)
    bound, actual = result.bound().value, result.component_variance("duof").value.sum(axis=-1)
    np.testing.assert_allclose(bound, result.own_variance("aof-gaussian").value, rtol=1e-12)
    above = result.above_bound("duof")
    np.testing.assert_allclose(above.value, actual / bound - 1, rtol=1e-9)
    optimal = result.above_bound("aof-gaussian")
    assert (abs(optimal.value) < SIGMA * optimal.standard_error).all()


def test_a_slow_part_larger_than_the_ensemble_is_all_of_it(variant53):
    """140 trajectories are all there are for a slow part of 500: the slow filter has the fast one's numbers."""
    control, fast = aof(gaussian(variant53)), aof(linearised(variant53))
    slow = replace(fast, name="slow", slow=True)
    result = compare([control, fast, slow], variant53, 140, 2, seed=3, slow_runs=500, progress=False)
    assert result.slow_runs == 140
    np.testing.assert_allclose(result.error_variance("slow").value, result.error_variance("aof-linearised").value, rtol=1e-11)


def by_hand(model, squares, slow, slow_runs, own=None):
    """A comparison over one step, every trajectory a batch of its own.

    squares, own : dict from name to the squared error and the claimed variance of each trajectory, (runs,); the filters
    named in `slow` ran on the first `slow_runs` of them.
    """
    fast = tuple(name for name in squares if name not in slow)

    def sums(names, runs):
        empty = Sums.empty(len(names), 1, 1, np.ones(runs))
        for i, name in enumerate(names):
            empty.square[i, 0, 0] = squares[name][:runs]
            empty.own[i, 0, 0] = own[name][:runs] if own else 0
        return empty

    names = (*fast, *slow)
    runs = len(squares[fast[0]])
    return Comparison(model, names, fast, runs, 1, 0, sums(fast, runs), SlowPart(list(slow), sums(names, slow_runs)))


def test_without_a_gaussian_aof_the_bound_still_has_its_digits():
    """The growth model, whose EKF errs forty times as much as the exact filter: through it D_k of the exact filter would have an
    error larger than itself, and come out negative.  Through the DUOF it agrees with the mean of the exact filter's variance."""
    model = growth_model()
    filters = [aof(linearised(model)), duof(model), pointmass(model)]
    result = compare(filters, model, 1000, 8, 1, slow_runs=150, designs=2, progress=False)
    exact, claimed = result.error_variance("aof-exact"), result.own_variance("aof-exact")
    assert result.carrier == "duof" and (exact.standard_error < exact.value).all()
    apart = np.abs(exact.value - claimed.value) / np.hypot(exact.standard_error, claimed.standard_error)
    assert (apart < 4).all()


def test_each_filter_is_judged_by_the_trajectories_it_ran_on(variant53):
    """The fast ones by all, a slow one by its slow part; only D goes through the carrier, which is the most accurate
    fast filter where there is no Gaussian AOF."""
    squares = {"first": np.array([1.0, 3, 5]), "second": np.array([2.0, 8, 2]), "slow": np.array([4.0, 2])}
    own = {"first": np.array([1.0, 1, 4]), "second": np.array([2.0, 2, 5]), "slow": np.array([3.0, 1])}
    result = by_hand(variant53, squares, ["slow"], slow_runs=2, own=own)
    assert result.control == result.carrier == "first"
    assert result.error_variance("slow").value.item() == 3 + (3 - 2)  # M e^2 of the first over all; of both over the slow part
    for name, square, claimed in (("first", 3, 2), ("second", 4, 3), ("slow", 3, 2)):
        assert result.component_variance(name).value.item() == square
        assert result.own_variance(name).value.item() == claimed
    assert result.error_variance("first").freedom == 3 - 1  # a slow part beside it does not make it less certain
    assert result.error_variance("slow").freedom == 2 - 1
    other_order = by_hand(variant53, {name: squares[name] for name in ("second", "first", "slow")}, ["slow"], slow_runs=2)
    assert other_order.carrier == "first" and other_order.control == "second"
    squares["aof-gaussian"] = squares["second"]
    assert by_hand(variant53, squares, ["slow"], slow_runs=2).control == "aof-gaussian"


@pytest.mark.parametrize("ask", [lambda c: c.error_variance("slow"), lambda c: c.difference("slow", "other")])
def test_the_variance_of_slow_part_and_whole_together_is_unbiased(variant53, ask):
    """X is a mean over N = 4 trajectories, Y over the first n = 2: Var = Var X / N + Var Y / n + 2 Cov(X, Y) / N.

    Drawn with replacement from three possible trajectories there are 81 ensembles, all equally likely.  Over all of them
    the mean of SE^2 is the variance of the estimate, exactly: sample variances and covariances of independent draws with
    the divisor n - 1 are unbiased.  X and Y grow together here, so that no estimate of Var is negative and cut at 0.
    """
    population = {"control": [0.0, 1, 4], "other": [0.0, 0.5, 1], "slow": [0.0, 2, 9]}
    values, variances = [], []
    for draw in itertools.product(range(3), repeat=4):
        squares = {name: np.array(possible)[list(draw)] for name, possible in population.items()}
        found = ask(by_hand(variant53, squares, ["slow"], slow_runs=2))
        values.append(found.value.item())
        variances.append(found.standard_error.item() ** 2)
    assert np.mean(variances) == pytest.approx(np.var(values), rel=1e-12)


def test_a_variance_that_comes_out_negative_is_taken_as_zero(variant53):
    """The covariance is known from the slow part alone; where it says that Y undoes X, the sum may come out below 0.

    X = 0, 4 and six times 2, Y = 1, 0:  Var X / 8 = 1/7,  Var Y / 2 = 1/4,  2 Cov / 8 = -1/2.
    """
    squares = {"control": np.array([0.0, 4, 2, 2, 2, 2, 2, 2]), "slow": np.array([1.0, 4])}
    error = by_hand(variant53, squares, ["slow"], slow_runs=2).error_variance("slow").standard_error
    assert error.item() == 0


def test_the_ranking_does_not_keep_the_order_given(variant53):
    squares = {name: np.array([d, d + 1]) for name, d in (("worst", 9.0), ("best", 1.0), ("middle", 4.0), ("slow", 2.0))}
    result = by_hand(variant53, squares, ["slow"], slow_runs=2)
    assert [name for name, _ in result.ranking()] == ["best", "slow", "middle", "worst"]


def test_filters_that_coincide_keep_their_order(variant53):
    """Rounding made now one of two equal filters the least accurate, now the other, in table, ranking and conclusion."""
    base = np.linspace(1, 2, 200)
    for first, second in ((1, 1 + 1e-15), (1 + 1e-15, 1)):
        squares = {"best": base, "also": first * (base[::-1] + 9), "same": second * (base[::-1] + 9)}
        result = replace(by_hand(variant53, squares, [], slow_runs=0), slow_part=None)
        assert [name for name, _ in result.ranking()] == ["best", "also", "same"]
        assert [(one.best, one.worst) for one in result.verdicts()] == [("best", "same")] * result.steps
        assert result.leaders(0)[0] == "best"


def test_without_the_exact_filter_there_is_no_bound(variant53):
    """Whether no slow filter ran, or only others: not a distance of 0 from nothing."""
    squares = {"aof-gaussian": np.ones(3), "slow": np.ones(2)}
    with_another = by_hand(variant53, squares, ["slow"], slow_runs=2)
    for result in (with_another, replace(with_another, slow_part=None)):
        for ask in (result.bound, lambda r=result: r.excess("aof-gaussian"), lambda r=result: r.above_bound("aof-gaussian")):
            with pytest.raises(KeyError, match="the bound needs aof-exact"):
                ask()


def test_above_the_bound_the_control_cancels_when_the_slow_part_is_everything(variant53):
    """M(e^2 - p_control) - M(p_exact - p_control), over the same trajectories, is M e^2 - M p_exact for any p_control."""
    squares = {"aof-gaussian": np.array([1.0, 3, 2]), "other": np.array([4.0, 2, 9]), "aof-exact": np.array([1.0, 2, 2])}
    own = {"aof-gaussian": np.array([7.0, 5, 6]), "other": np.array([1.0, 1, 1]), "aof-exact": np.array([1.0, 2, 3])}
    result = by_hand(variant53, squares, ["aof-exact"], slow_runs=3, own=own)
    assert result.bound().value.item() == pytest.approx(2, rel=1e-14)
    assert result.above_bound("other").value.item() == pytest.approx(5 / 2 - 1, rel=1e-14)


def test_the_bound_adds_what_all_trajectories_and_the_slow_part_tell(variant53):
    """M p_control over all, and M(p_exact - p_control) over the slow part, a part of all: Var X / N + Var Y / n + 2 Cov / N.

    p_control = 2, 4, 6, 4: mean 4, SE^2 = (8/3)/4;  p_exact - p_control = -1, -3: mean -2, SE^2 = 2/2, Cov = -2.
    The ratio 6/2 of e^2 to the bound varies as (e^2 - 3 bound) / 2: over all as -1/2, -7/2, -9/2, -7/2, SE^2 = 3/4,
    on the slow part as 3/2, 9/2, SE^2 = 4.5/2, Cov = -4.5.
    """
    squares = {"aof-gaussian": np.ones(4), "other": np.array([5.0, 5, 9, 5]), "aof-exact": np.ones(2)}
    own = {"aof-gaussian": np.array([2.0, 4, 6, 4]), "other": np.ones(4), "aof-exact": np.array([1.0, 1])}
    result = by_hand(variant53, squares, ["aof-exact"], slow_runs=2, own=own)
    bound, above = result.bound(), result.above_bound("other")
    assert (bound.value.item(), bound.freedom) == (4 - 2, 1)
    assert bound.standard_error.item() == pytest.approx(np.sqrt(2 / 3 + 1 - 1), rel=1e-14)
    assert (above.value.item(), above.freedom) == (6 / 2 - 1, 1)
    assert above.standard_error.item() == pytest.approx(np.sqrt(3 / 4 + 4.5 / 2 - 2 * 4.5 / 4), rel=1e-14)


def test_without_a_slow_part_slow_filters_are_left_out(variant53):
    slow = replace(aof(linearised(variant53)), name="slow", slow=True)
    result = compare([aof(gaussian(variant53)), slow], variant53, 50, 2, seed=3, slow_runs=0, progress=False)
    assert result.available == ("aof-gaussian",)
    assert result.slow_runs == 0
    with pytest.raises(KeyError, match="slow"):
        result.error_variance("slow")
    for filters in ([slow], []):
        with pytest.raises(ValueError, match=r"fast|at least one|slow_runs"):
            compare(filters, variant53, 50, 2, seed=3, progress=False)


def test_where_all_errors_are_zero_filters_are_equal(variant53):
    known = Model.define("0.9*x + 0.05*x*v", "x + 0.02*x**2*w", prior={"variance": 0})
    result = compare([aof(gaussian(known)), aof(linearised(known))], known, 200, 3, seed=1, progress=False)
    assert not result.error_variance("aof-linearised").value.any()
    assert result.without_error.all() and not result.usable.any()
    assert np.isnan(result.relative("aof-linearised").value).all()  # of nothing, nothing is a part
    assert result.score("aof-linearised").standard_error == 0


# ---------------------------------------------------------------- the table of the page

PAGE_RUNS = 1_000_000
COLUMNS = ("aof-gaussian", "aof-linearised", "duof", "fos-gaussian", "fos-linearised", "mfos-gaussian", "mfos-linearised")
PAGE = {  # D_k x 10^4, last digit
    1: ((6.506, 6.572, 6.478, 6.507, 6.486, 6.435, 6.424), 0.001),
    2: ((4.238, 4.240, 4.466, 4.333, 4.321, 4.298, 4.293), 0.001),
    3: ((2.853, 2.853, 3.018, 2.903, 2.897, 2.888, 2.885), 0.001),
    5: ((1.349, 1.350, 1.422, 1.360, 1.359, 1.358, 1.357), 0.001),
    10: ((0.1977, 0.1977, 0.2042, 0.1979, 0.1979, 0.1979, 0.1979), 0.0001),
}  # fmt: skip


@pytest.fixture(scope="module")
def lab_filters(variant53):
    structures = gaussian(variant53), linearised(variant53)
    return [*(aof(one) for one in structures), duof(variant53), *(family(one) for family in (fos, mfos) for one in structures)]


@pytest.fixture(scope="module")
def lab(lab_filters, variant53):
    return compare(lab_filters, variant53, 200_000, 11, seed=53, same_ensemble=True, progress=False)


@pytest.mark.parametrize("k", PAGE)
@pytest.mark.parametrize("name", COLUMNS)
def test_the_table_of_the_page_is_reproduced(lab, name, k):
    printed, digit = PAGE[k]
    # Two independent ensembles: ours, and the page's of 10^6, whose error is ours times the root of the sizes' ratio.
    both = np.sqrt(1 + lab.runs / PAGE_RUNS)
    reference = printed[COLUMNS.index(name)] * 1e-4
    found = lab.error_variance(name)[k]
    assert abs(found.value - reference) < SIGMA * both * found.standard_error + 0.5e-4 * digit


REPEATS = 8


@pytest.fixture(scope="module")
def repeated(lab_filters, variant53):
    """Ratios to the Gaussian AOF, (repeats, filters, steps), in independent runs that together are as large as the page's."""
    ratios = []
    for seed in range(REPEATS):
        result = compare(lab_filters, variant53, PAGE_RUNS // REPEATS, 11, seed, same_ensemble=True, progress=False)
        ratios.append([result.relative(name, "aof-gaussian").value for name in COLUMNS])
    return np.array(ratios)


@pytest.mark.parametrize("k", PAGE)
def test_the_ratios_to_the_gaussian_aof_are_the_page_s(repeated, k):
    """Ratios on common trajectories are known far better than the variances themselves.

    Their error is taken from the scatter of independent runs, each with a design of its own: a standard error from
    one run holds for the filter as designed there, and does not know how much its coefficients would vary.
    """
    printed, digit = PAGE[k]
    printed = np.array(printed)
    ratios = repeated[:, :, k]
    # Our mean and the page's run have the same size, so the same error; Student's quantile of 4 sigma for 8 runs.
    error = np.sqrt(2) * ratios.std(axis=0, ddof=1) / np.sqrt(REPEATS)
    quantile = stats.t.isf(stats.norm.sf(SIGMA), REPEATS - 1)
    rounding = 0.5 * digit / printed[0] * (1 + printed / printed[0])
    assert (abs(ratios.mean(axis=0) - printed / printed[0]) < quantile * error + rounding).all()


def test_at_the_start_all_filters_are_near_the_page_s_value(lab):
    for name in COLUMNS:
        found = lab.error_variance(name)[0]
        # "all near 11.92": filters of one step differ by less than a per cent
        assert abs(found.value - 11.92e-4) < SIGMA * np.sqrt(1.2) * found.standard_error + 0.01 * 11.92e-4


@pytest.mark.parametrize("name", sorted(set(COLUMNS) - {"duof"}))
def test_from_the_second_step_on_the_duof_is_the_least_accurate(lab, name):
    # Averaged over k = 2 ... 10, where the page's table has the DUOF last in every row.
    low, _ = lab.score_difference("duof", name, slice(2, None)).interval(0.95)
    assert low > 0


def test_a_printed_comparison_is_short_and_says_what_to_ask(variant53):
    found = compare(
        [aof(gaussian(variant53)), pointmass(variant53)], variant53, 1000, 2, 7, slow_runs=100,
        smoothers=[aof(gaussian(variant53))], progress=False,
    )  # fmt: skip
    heading, asked = str(found).splitlines()
    assert heading == "Comparison of aof-gaussian, aof-exact: 2 steps, 1000 trajectories (100 for aof-exact), seed 7"
    for name in re.findall(r"(\w+)\(", asked):
        assert callable(getattr(found, name))
    assert asked.endswith(".smoothing") and not repr(found.smoothing).endswith(".smoothing")
    without = replace(found, slow_part=None, left_out={"aof-exact": "too slow"})
    assert str(without).splitlines()[1] == "left out: aof-exact, too slow"
    assert str(replace(without, runs=10_000, seed=10_000)).splitlines()[0].endswith("10,000 trajectories, seed 10000")


def test_without_a_standard_error_nothing_is_significant():
    nan = np.full(3, np.nan)
    assert np.isnan(Estimate(np.array([np.nan, 1.0, 0.0]), nan, 5).p_value()).all()
    np.testing.assert_array_equal(Estimate(np.array([1.0, 0.0]), np.zeros(2), 5).p_value(), [0.0, 1.0])
    model = Model.define("0.9*x + 0.3*v", "x + 0.2*x**2 + 0.4*w")
    alone = compare([aof(gaussian(model)), aof(linearised(model))], model, 1, 3, seed=1, progress=False)
    assert not any(verdict.worst for verdict in alone.verdicts())


def test_means_over_no_steps():
    model = Model.define("0.9*x + 0.3*v", "x + 0.2*x**2 + 0.4*w")
    result = compare([aof(gaussian(model)), aof(linearised(model))], model, 256, 4, seed=1, progress=False)
    for ask in (result.ranking, lambda steps: result.score("aof-linearised", steps)):
        with pytest.raises(ValueError, match="none of the 4 steps"):
            ask(slice(4, None))
    object.__setattr__(result, "doubtful", np.array([True, True, False, False]))
    assert np.isnan(result.mean_gap("aof-linearised", slice(2)).value)
    assert np.isnan(result.mean_gap("aof-linearised", slice(2)).standard_error)
    assert result.mean_gap("aof-linearised", slice(3)).value == result.gap("aof-linearised").value[2]
