"""What a comparison reports: against direct per-trajectory formulas, theory, and the page's
table."""

import re
from dataclasses import replace

import numpy as np
import oracles
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from kfcourse import Comparison, Ensemble, Gaussian, Model, compare, gaussian, linearised, run
from kfcourse.filters import aof, duof, fos, kalman_filter, mfos, particle, pointmass
from kfcourse.montecarlo import BATCHES
from kfcourse.montecarlo.ensemble import side_by_side, stratified, weights
from kfcourse.montecarlo.experiment import WIDE, batch_sizes
from kfcourse.montecarlo.statistics import Estimate, claimed, rejected

SIGMA = 4  # standard errors: one chance in 16 000 a comparison
# relative error of a standard error from so many batches
BATCH_ERROR = 1 / np.sqrt(2 * (BATCHES - 1))


@pytest.fixture(scope="module")
def linear():
    return Model.define(
        ["0.9*x1 + 0.2*x2 + 0.3*v1", "0.8*x2 + v2"],
        ["x1 + w1", "x2 - x1 + 0.5*w2"],
        prior={"mean": [1, -2], "variance": [[2, 0.5], [0.5, 1]]},
        meter_noise={"variance": [[1, 0.2], [0.2, 2]]},
    )


def stored(model, runs, steps, seed):
    """The trajectories of compare(..., seed, same_ensemble=True): x (steps, runs, n) and y (steps,
    runs, p)."""
    sizes = batch_sizes(runs)
    _, *seeds = np.random.SeedSequence(seed).spawn(1 + len(sizes))
    batches = [Ensemble(model, *of) for of in zip(sizes, [steps] * len(sizes), seeds, strict=True)]
    x, y, *_ = zip(*side_by_side(batches), strict=True)
    return np.stack(x), np.stack(y)


RUNS, STEPS, SEED = 6000, 4, 5


@pytest.fixture(scope="module")
def direct(linear):
    """The comparison, and errors and covariances of each trajectory kept beside it."""
    single = Gaussian(np.zeros(2), np.eye(2))
    wrong = replace(linear, prior=Gaussian(np.zeros(2), 9 * np.eye(2)), meter_noise=single)
    filters = [aof(gaussian(linear)), duof(linear), replace(kalman_filter(wrong), name="wrong")]
    result = compare(filters, linear, RUNS, STEPS, SEED, same_ensemble=True)
    x, y = stored(linear, RUNS, STEPS, SEED)
    laws = {single.name: run(single, y) for single in (filters[0], filters[2])}
    return result, {name: (x - estimate.mean, estimate.cov) for name, estimate in laws.items()}


def jackknife(function, *values):
    """Value and standard error of a function of means of values (..., runs), from the definition:
    batch by batch left out."""
    batch = np.repeat(np.arange(BATCHES), batch_sizes(RUNS))
    without = np.array(
        [
            function(*(value[..., batch != b].mean(axis=-1) for value in values))
            for b in range(BATCHES)
        ]
    )
    error = np.sqrt((BATCHES - 1) / BATCHES * ((without - without.mean(axis=0)) ** 2).sum(axis=0))
    return function(*(value.mean(axis=-1) for value in values)), error


def agree(estimate, function, *values):
    value, error = jackknife(function, *values)
    assert_allclose(estimate.value, value, rtol=1e-11, atol=1e-13)
    assert_allclose(estimate.standard_error, error, rtol=1e-8, atol=1e-13)


def of_mean(estimate, values):
    """The estimate is the mean of per-trajectory values (..., runs), with the standard error they
    have."""
    agree(estimate, lambda mean: mean, values)
    exact = values.std(axis=-1) / np.sqrt(values.shape[-1])
    assert (abs(estimate.standard_error / exact - 1) < SIGMA * BATCH_ERROR).all()


def test_the_statistics_are_those_of_the_trajectories(direct):
    result, errors = direct
    for name, (error, cov) in errors.items():
        of_mean(result.error_variance(name), (error**2).sum(axis=-1))
        of_mean(result.error_mean(name), np.moveaxis(error, 1, -1))
        of_mean(result.component_variance(name), np.moveaxis(error**2, 1, -1))
        normalised = np.einsum("kni,knij,knj->kn", error, np.linalg.inv(cov), error) / 2
        of_mean(result.normalised_error(name), normalised)
        assert_allclose(
            result.own_variance(name).value,
            np.trace(cov, axis1=-2, axis2=-1).mean(axis=-1),
            rtol=1e-11,
        )


@pytest.mark.filterwarnings("error")
def test_a_claim_of_variance_0_is_right_without_an_error_and_infinitely_wrong_with_one():
    """A variance for each trajectory, and one for all."""
    x = np.array([1.0, -2.0, 3.0, 0.5, -1.5])
    p = np.array([0.0, 2.0, 0.0, 0.25, 1.0])

    def normalised(errors, cov):
        return claimed(errors[:, None], cov)[1].tolist()

    known, none = np.where(p > 0, x, 0.0), np.array([[0.0]])
    assert normalised(known, p[:, None, None]) == [0.0, 2.0, 0.0, 1.0, 2.25]
    assert normalised(known, none) == np.where(known, np.inf, 0.0).tolist()
    assert normalised(x, p[:, None, None]) == [np.inf, 2.0, np.inf, 1.0, 2.25]


def test_differences_and_ratios_are_paired(direct):
    result, errors = direct
    ours, theirs = ((errors[name][0] ** 2).sum(axis=-1) for name in ("aof-gaussian", "wrong"))
    agree(result.difference("wrong", "aof-gaussian"), lambda a, b: b - a, ours, theirs)
    agree(result.relative("wrong", "aof-gaussian"), lambda a, b: b / a, ours, theirs)
    agree(result.gap("wrong"), lambda a, b: b / a - 1, ours, theirs)
    agree(result.score("wrong"), lambda a, b: (b / a).mean(), ours, theirs)
    agree(result.mean_gap("wrong", slice(2)), lambda a, b: (b / a)[:2].mean() - 1, ours, theirs)
    agree(
        result.mean_gap_difference("wrong", "aof-gaussian"),
        lambda a, b: (b / a).mean() - 1,
        ours,
        theirs,
    )


def test_an_unknown_name_is_answered_with_the_known_ones(direct):
    with pytest.raises(KeyError, match="aof-gaussian, duof, wrong"):
        direct[0].error_variance("ekf")


def test_intervals_are_student_s(direct):
    estimate = direct[0].error_variance("duof")
    low, high = estimate.interval(0.9)
    half = stats.t.ppf(0.95, BATCHES - 1) * estimate.standard_error
    assert_allclose(high - estimate.value, half, rtol=1e-9)
    assert_allclose(estimate.value - low, half, rtol=1e-9)
    with pytest.raises(ValueError, match="confidence"):
        estimate.interval(95)


# ---------------------------------------------------------------- initial states


@pytest.mark.parametrize("size", [1, 7])
def test_every_half_of_the_initial_states_has_one_in_each_stratum(size):
    standard = stratified(np.random.default_rng(1), size, 2, 3.0)
    for half, scale in ((standard[::2], 1.0), (standard[1::2], 3.0)):
        strata = np.floor(len(half) * stats.norm.cdf(half / scale)).astype(int)
        assert_array_equal(np.sort(strata, axis=0), np.tile(np.arange(len(half))[:, None], (1, 2)))


def test_weights_make_up_for_the_wider_law():
    """M 1, M x and M x^2 of the prior, singular or not, from 20,000 weighted states: four standard
    errors of each mean."""
    rng = np.random.default_rng(1)
    for cov in (np.array([[4.0]]), np.array([[4.0, 1.0], [1.0, 1.0]]), np.diag([4.0, 0.0])):
        prior = Gaussian(np.arange(1.0, 1 + len(cov)), cov)
        values, vectors = np.linalg.eigh(cov)
        root = vectors * np.sqrt(np.maximum(values, 0))
        standard = (
            rng.standard_normal((20_000, len(cov)))
            * np.where(np.arange(20_000) % 2, 2.0, 1.0)[:, None]
        )
        x = prior.mean + standard @ root.T
        w = weights(prior, x, 2.0)
        assert w.min() > 0 and w.max() <= 2
        for sample, truth in ((w, 1.0), (w * x[:, 0], 1.0), (w * (x[:, 0] - 1) ** 2, 4.0)):
            oracles.is_mean(truth, sample)
    assert (weights(prior, x, None) == 1).all()
    # of an estimate of M x^4, which far states carry, the variance is a third for it
    x = np.linspace(-14, 14, 2001)[:, None]
    carried = x[:, 0] ** 8 * stats.norm.pdf(x[:, 0])
    part = weights(Gaussian(np.zeros(1), np.eye(1)), x, WIDE) @ carried / carried.sum()
    assert part == pytest.approx(1 / 3, abs=0.05)


# ---------------------------------------------------------------- the bound


def by_hand(model, squares, own=None, distance=None):
    """A comparison over one step from squared errors of each trajectory, name -> (runs,); each is a
    batch of its own."""
    names, runs = tuple(squares), len(next(iter(squares.values())))
    square = np.array([*squares.values()])[:, None, None, :]
    sums = {"weight": np.ones(runs), "size": np.ones((1, runs)), "square": square}
    sums |= dict.fromkeys(("own", "distance"), 0 * square[:, :, 0]) | {"largest": square[:, :, 0]}
    for field, values in (("own", own), ("distance", distance)):
        if values:
            sums[field] = np.array([values[name] for name in names])[:, None, :]
    return Comparison(model, names, runs, 1, 0, sums)


@pytest.fixture
def bounded(variant53):
    squares = {
        "aof-gaussian": [2.0, 4, 6, 8],
        "other": [3.0, 5, 4, 12],
        "aof-exact": [9.0, 9, 9, 9],
    }
    own = {"aof-gaussian": [4.0, 5, 5, 6], "other": [1.0, 1, 1, 1], "aof-exact": [3.5, 4.5, 4, 4]}
    distance = {
        "aof-gaussian": [0.25, 0.75, 0.5, 0.5],
        "other": [1.0, 2, 1, 2],
        "aof-exact": [0.0, 0, 0, 0],
    }
    return by_hand(variant53, squares, own, distance)


def test_nothing_of_a_step_is_stated_better_than_to_a_thousandth_of_the_bound(bounded):
    """Distances that are small and alike in all batches: the trajectories that carry the gap may be
    missing in all."""
    small = replace(bounded, sums=bounded.sums | {"distance": 1e-6 * bounded.sums["distance"]})
    assert small.gap("other").value.item() == pytest.approx(1e-6 * 1.5 / 4, rel=1e-12)
    pair, bound = ("other", "aof-gaussian"), 4
    for estimate, unit in (
        (small.gap("other"), 1),
        (small.gap_difference(*pair), 1),
        (small.difference(*pair), bound),
    ):
        # of 3 degrees of freedom, Student's quantile is 3.18
        assert estimate.half_width().item() == pytest.approx(3.18 * 5e-4 * unit, rel=1e-2)
    assert small.leaders(0) == ["aof-gaussian", "other"], "a millionth of the bound is no lead"
    assert bounded.gap("other").standard_error.item() > 5e-4, "as scattered as the sample says"


def test_all_follows_from_the_bound_and_the_distances_from_it(bounded):
    """Bound 4, distances .5 and 1.5; the exact filter's own squares of the error, 9, are never
    looked at."""
    assert bounded.bound().value.item() == bounded.error_variance("aof-exact").value.item() == 4
    assert bounded.error_variance("other").value.item() == 5.5
    assert bounded.difference("other", "aof-exact").value.item() == 1.5
    assert bounded.difference("other", "aof-gaussian").value.item() == 1
    assert bounded.gap("other").value.item() == bounded.mean_gap("other").value == 1.5 / 4
    assert bounded.gap_difference("other", "aof-gaussian").value.item() == pytest.approx(
        1 / 4, rel=1e-14
    )
    distances = np.array([1.0, 2, 1, 2])
    assert_allclose(
        bounded.difference("other", "aof-exact").standard_error,
        distances.std(ddof=1) / 2,
        rtol=1e-13,
    )
    assert (
        [name for name, _ in bounded.ranking()] == ["aof-gaussian", "other"] == [*bounded.entrants]
    )
    assert bounded.reference == "aof-exact" and bounded.control == "aof-gaussian"


def test_without_the_exact_filter_there_is_no_bound(variant53):
    result = by_hand(variant53, {"other": [2.0, 2, 2], "aof-gaussian": [1.0, 1, 1]})
    with pytest.raises(KeyError, match="no results for 'aof-exact'"):
        result.bound()
    assert result.gap("other").value.item() == 1 and result.reference == "aof-gaussian"


def test_what_is_better_than_the_exact_filter_refutes_it(variant53):
    """Squares 1 +- .1 of a filter where the exact one claims 4; or that states an error of its own
    of a fifth of its variance."""
    rng = np.random.default_rng(1)
    squares = {"aof-gaussian": 1 + 0.1 * rng.normal(size=50), "aof-exact": np.ones(50)}
    own = {"aof-gaussian": np.ones(50), "aof-exact": np.full(50, 4.0)}
    refuted = by_hand(variant53, squares, own)
    assert refuted.doubtful.all() and np.isnan(refuted.gap("aof-gaussian").value).all()
    noise = rng.normal(size=50)
    noise = (noise - noise.mean()) / noise.std(ddof=1)
    for errors, refutes in ((3, False), (6, True)):  # standard errors below the bound
        better = squares | {"aof-gaussian": 4 + noise - errors / np.sqrt(50)}
        assert by_hand(variant53, better, own).doubtful.all() == refutes
    healthy = by_hand(variant53, squares | {"aof-gaussian": 4 + noise}, own)
    for doubt, refutes in ((0.3, False), (0.5, True)):  # a tenth of the variance is .4
        unsure = replace(healthy, sums=healthy.sums | {"distance": np.full((2, 1, 50), doubt)})
        assert unsure.doubtful.all() == refutes


def test_a_filter_that_diverges_on_few_trajectories_is_named(variant53):
    """A thousand trajectories with the square 1, and one of 1e6 in one filter; another errs as much
    on all of them."""
    base = np.ones(1000)
    wild = np.where(np.arange(1000) == 7, 1e6, base)
    result = by_hand(variant53, {"aof-gaussian": wild, "good": base, "bad": 1000 * base})
    assert [*result.lost] == ["aof-gaussian"]
    assert result.control == "good"
    # a hundred times the best D_k, a tenth of it by one trajectory
    for ordinary, far, lost in (
        (1, 8e4, False), (1, 1.2e5, True), (200, 1.5e4, False), (200, 4e4, True),
    ):  # fmt: skip
        wild = np.where(np.arange(1000) == 7, far, ordinary)
        assert bool(by_hand(variant53, {"wild": wild, "good": base}).lost) == lost


def test_the_exact_filter_bounds_the_others_on_the_same_trajectories(variant53):
    filters = [aof(gaussian(variant53)), aof(linearised(variant53)), pointmass(variant53)]
    result = compare(filters, variant53, 300, 3, seed=2)
    above = Estimate.jackknife(
        result._means("square", "aof-gaussian")[:, 0] - result._means("own", "aof-exact")
    )
    gap = result.difference("aof-gaussian", "aof-exact")
    assert (abs(above.value - gap.value) < SIGMA * above.standard_error).all()
    assert (gap.standard_error < above.standard_error / 3).all()  # what the distances are for
    assert (gap.value > 0).all() and not result.doubtful.any()


def test_the_particles_own_error_is_not_in_the_bound(linear):
    """The Kalman filter is exact: what distances tell is the particles' error, of which a product
    of both halves holds little."""
    exact = replace(particle(linear, 50), name="aof-exact")
    result = compare([kalman_filter(linear), exact], linear, 12_800, 1, seed=1)
    excess = result.difference("kalman", "aof-exact")
    doubt = result._means("distance", "aof-exact")[:, 0]
    # The clouds of each batch draw the same numbers: 200 independent products, of errors whose mean
    # square is twice the doubt.
    allowed = SIGMA * np.hypot(excess.standard_error, 2 * doubt / np.sqrt(200))
    assert (abs(excess.value) < allowed).all()
    assert (doubt > allowed).all()


# ---------------------------------------------------------------- who is better


def test_holm_s_test_of_four():
    """Levels .05 / 4, .05 / 3, .05 / 2, .05: the third is too large, so the fourth is not rejected
    either."""
    assert rejected(np.array([[0.001, 0.03], [0.016, 0.04]]), 0.05).tolist() == [
        [True, False],
        [True, False],
    ]
    assert rejected(np.array([0.0125, 0.016, 0.024, 0.05]), 0.05).all()


def test_filters_that_coincide_keep_their_order_and_nobody_is_better(variant53):
    """Rounding made now one of two equal filters the least accurate, now the other, in table,
    ranking and conclusion."""
    base = np.linspace(1, 2, 200)
    for first, second in ((1, 1 + 1e-15), (1 + 1e-15, 1)):
        squares = {
            "also": first * (base[::-1] + 9),
            "same": second * (base[::-1] + 9),
            "best": base,
        }
        result = by_hand(variant53, squares)
        assert [name for name, _ in result.ranking()] == ["best", "also", "same"]
        assert [(single.best, single.worst) for single in result.verdicts()] == [
            ("best", "same")
        ] * result.steps
        assert result.leaders(0) == ["best"]
        assert by_hand(variant53, {name: squares[name] for name in ("also", "same")}).leaders(
            0
        ) == ["also", "same"]
    for more, worst in ((0.7e-8, ""), (1.5e-8, "worse")):  # parts of D_k
        result = by_hand(variant53, {"best": base, "worse": (1 + more) * base})
        assert result.verdicts()[0].worst == worst


def test_where_all_errors_are_zero_filters_are_equal(variant53):
    known = Model.define("0.9*x + 0.05*x*v", "x + 0.02*x**2*w", prior={"variance": 0})
    result = compare([aof(gaussian(known)), aof(linearised(known))], known, 200, 3, seed=1)
    assert not result.error_variance("aof-linearised").value.any()
    assert result.without_error.all() and not result.usable.any()
    assert np.isnan(result.relative("aof-linearised").value).all()  # of nothing, nothing is a part
    assert result.score("aof-linearised").standard_error == 0
    assert not any(verdict.worst for verdict in result.verdicts())
    # of states of size 1 in doubles, (64 eps)^2 = 2e-28
    for square, rounded in ((1.5e-28, True), (3e-28, False)):
        result = by_hand(variant53, {"aof-gaussian": np.full(4, square)})
        assert result.without_error.all() == rounded


@pytest.mark.slow
def test_intervals_cover_the_truth_as_often_as_they_say(linear):
    """95 % intervals of D_0 over 200 independent comparisons: the binomial's 4 standard errors
    around 190."""
    single = kalman_filter(linear)
    truth = float(np.trace(single.step(single.init(1), np.zeros((1, 2))).posterior.cov))
    hits = 0
    for seed in range(200):
        low, high = (
            compare([single], linear, 400, 1, seed, jobs=1).error_variance("kalman").interval(0.95)
        )
        hits += bool(low[0] < truth < high[0])
    assert abs(hits - 190) < SIGMA * np.sqrt(200 * 0.95 * 0.05)


# ---------------------------------------------------------------- the table of the page

COLUMNS = (
    "aof-gaussian",
    "aof-linearised",
    "duof",
    "fos-gaussian",
    "fos-linearised",
    "mfos-gaussian",
    "mfos-linearised",
)
PAGE = {  # D_k x 10^4, last digit
    1: ((6.506, 6.572, 6.478, 6.507, 6.486, 6.435, 6.424), 0.001),
    2: ((4.238, 4.240, 4.466, 4.333, 4.321, 4.298, 4.293), 0.001),
    3: ((2.853, 2.853, 3.018, 2.903, 2.897, 2.888, 2.885), 0.001),
    5: ((1.349, 1.350, 1.422, 1.360, 1.359, 1.358, 1.357), 0.001),
    10: ((0.1977, 0.1977, 0.2042, 0.1979, 0.1979, 0.1979, 0.1979), 0.0001),
}  # fmt: skip


@pytest.fixture(scope="module")
def repeated(variant53):
    """Error variances (repeats, filters, steps) in eight independent comparisons, each with a
    design of its own, that together are as large as the page's, of 10^6 trajectories."""
    structures = gaussian(variant53), linearised(variant53)
    filters = [
        *(aof(structure) for structure in structures),
        duof(variant53),
        *(family(structure) for family in (fos, mfos) for structure in structures),
    ]
    results = (
        compare(filters, variant53, 125_000, 11, seed, same_ensemble=True) for seed in range(8)
    )
    return np.array([[each.error_variance(name).value for name in COLUMNS] for each in results])


@pytest.mark.slow  # the golden comparison of variant 53 is the same with 20,000 trajectories
@pytest.mark.parametrize("k", PAGE)
def test_the_table_of_the_page_is_reproduced(repeated, k):
    """Variances, and their ratios to the Gaussian AOF's, which common trajectories tell far better.

    Their error is taken from the scatter of the comparisons: a standard error from one holds for
    the filters as designed there.
    """
    printed, digit = np.array(PAGE[k][0]), PAGE[k][1]
    variances = 1e4 * repeated[:, :, k]
    # Our mean and the page's run have the same size, so the same error; Student's quantile of 4
    # sigma for 8 runs.
    quantile = stats.t.isf(stats.norm.sf(SIGMA), 7)
    ratios, expected = variances / variances[:, :1], printed / printed[0]
    for sample, value, rounding in (
        (variances, printed, 0.5 * digit),
        (ratios, expected, 0.5 * digit / printed[0] * (1 + expected)),
    ):
        error = np.sqrt(2) * sample.std(axis=0, ddof=1) / np.sqrt(8)
        assert (abs(sample.mean(axis=0) - value) < quantile * error + rounding).all()


def test_a_printed_comparison_says_what_to_ask(variant53):
    outcome = compare(
        [aof(gaussian(variant53)), pointmass(variant53)], variant53, 100, 2, 7,
        smoothers=[aof(gaussian(variant53))],
    )  # fmt: skip
    heading, asked = str(outcome).splitlines()
    assert heading == "Comparison of aof-gaussian, aof-exact: 2 steps, 100 trajectories, seed 7"
    for name in re.findall(r"(\w+)\(", asked):
        assert callable(getattr(outcome, name))
    without = replace(outcome, left_out={"aof-exact": "too slow"})
    assert str(without).splitlines()[1] == "left out: aof-exact, too slow"


BENT = Model.define("0.9*x + 0.3*v", "x + 0.2*x**2 + 0.4*w")
BOTH = [aof(gaussian(BENT)), aof(linearised(BENT))]


def test_without_a_standard_error_nothing_is_significant():
    """Of one trajectory, or of a zero that is certain."""
    certain = Estimate(np.array([1.0, 0.0]), np.zeros(2), 5)
    assert_array_equal(certain.p_value(), [0.0, 1.0])
    alone = compare(BOTH, BENT, 1, 3, seed=1)
    assert np.isnan(alone.error_variance("aof-gaussian").standard_error).all()
    assert np.isnan(alone.difference(*alone.names).p_value()).all()
    assert not any(verdict.worst for verdict in alone.verdicts())


def test_means_over_no_steps():
    result = compare(BOTH, BENT, 256, 4, seed=1)
    with pytest.raises(ValueError, match="none of the 4 steps"):
        result.ranking(slice(4, None))
    object.__setattr__(result, "doubtful", np.array([True, True, False, False]))
    none, three = (result.mean_gap("aof-linearised", slice(k)) for k in (2, 3))
    assert np.isnan(none.value) and np.isnan(none.standard_error)
    assert three.value == result.gap("aof-linearised").value[2]
