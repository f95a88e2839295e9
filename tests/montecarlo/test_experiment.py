"""The Monte Carlo engine: trajectories follow the model, and nothing but the seed decides the
numbers."""

import tracemalloc

import numpy as np
import pytest

from kfcourse.filters.approximations import aof
from kfcourse.filters.conditionally_optimal import duof
from kfcourse.filters.kalman import kalman_filter
from kfcourse.filters.optimal_structure import fos, mfos
from kfcourse.filters.particles import particle
from kfcourse.montecarlo.designing import NotFinite, design
from kfcourse.montecarlo.ensemble import Ensemble, instants, simulate
from kfcourse.montecarlo.experiment import Sample, compare, predictions, run
from kfcourse.records import likelihood, smooth
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import gaussian, linearised

pytestmark = pytest.mark.quick

SIGMA = 4  # standard errors: one chance in 16 000 a comparison


def lab_of(model):
    structures = [gaussian(model), linearised(model)]
    return [
        *(aof(one) for one in structures),
        duof(model),
        *(family(one) for family in (fos, mfos) for one in structures),
    ]


@pytest.fixture(scope="module")
def vector():
    return Model.define(
        ["0.9*x1 + 0.2*x2 + 0.3*v1", "0.8*x2 + v2 - v3"], ["x1 + w1", "x2 - x1 + 0.5*w2"],
        prior={"mean": [1, -2], "variance": [[2, 0.5], [0.5, 1]]},
        state_noise={"mean": [1, 0, -1], "variance": [[2, 0.3, 0], [0.3, 1, 0.5], [0, 0.5, 3]]},
        meter_noise={"mean": 0.5, "variance": [[1, 0.2], [0.2, 2]]},
    )  # fmt: skip


# ---------------------------------------------------------------- simulation


def test_trajectories_satisfy_the_equations(vector):
    x, y = simulate(vector, 1000, 5, seed=3)
    assert (x.shape, y.shape) == ((5, 1000, 2), (5, 1000, 2))
    # What the equations leave is noise: v and w recovered from x and y.
    v1 = (x[1:, :, 0] - 0.9 * x[:-1, :, 0] - 0.2 * x[:-1, :, 1]) / 0.3
    difference = x[1:, :, 1] - 0.8 * x[:-1, :, 1]
    w = np.stack([y[..., 0] - x[..., 0], (y[..., 1] - x[..., 1] + x[..., 0]) / 0.5])
    for sample, mean, variance in (
        (v1, 1, 2),
        (difference, 1, 1 + 3 - 2 * 0.5),
        (w[0], 0.5, 1),
        (w[1], 0.5, 2),
    ):
        n = sample.size
        assert abs(sample.mean() - mean) < SIGMA * np.sqrt(variance / n)
        assert abs(sample.var() - variance) < SIGMA * variance * np.sqrt(2 / n)
    for left, right, cov, product in ((v1, difference, 0.3, 2 * 3), (w[0], w[1], 0.2, 1 * 2)):
        found = np.mean((left - left.mean()) * (right - right.mean()))
        assert abs(found - cov) < SIGMA * np.sqrt((product + cov**2) / left.size)
    # independent of one another and in time
    for left, right in (
        (v1, w[0][:-1]),
        (v1[1:], v1[:-1]),
        (w[1][1:], w[1][:-1]),
        (v1, x[:-1, :, 0]),
    ):
        assert abs(np.corrcoef(left.ravel(), right.ravel())[0, 1]) < SIGMA / np.sqrt(left.size)


def test_the_prior_is_drawn_as_given(vector):
    x, n = simulate(vector, 20_000, 1, seed=5).x[0], 20_000
    np.testing.assert_allclose(x.mean(axis=0), [1, -2], rtol=0, atol=SIGMA * np.sqrt(2 / n))
    found, cov = np.cov(x.T), vector.prior.cov
    # Var of a sample covariance of Gaussians
    error = np.sqrt((np.outer(np.diag(cov), np.diag(cov)) + cov**2) / n)
    assert (abs(found - cov) < SIGMA * error).all()


def test_variant_53_decays_as_the_page_says(variant53):
    # Var x_k = (c^2 + e^2)^k; x is heavy-tailed, so the standard error is taken from the sample
    # itself.
    squares = simulate(variant53, 20_000, 12, seed=2).x[..., 0] ** 2
    expected = (0.9**2 + 0.05**2) ** np.arange(12)
    assert (
        abs(squares.mean(axis=1) - expected) < SIGMA * squares.std(axis=1) / np.sqrt(20_000)
    ).all()


def test_the_seed_decides_the_trajectories(variant53):
    first, again, other = (
        simulate(variant53, 50, 7, 1),
        simulate(variant53, 50, 7, 1),
        simulate(variant53, 50, 7, 2),
    )
    np.testing.assert_array_equal(first.y, again.y)
    assert not np.isin(first.x[0], other.x[0]).any()


def test_ensembles_side_by_side_are_those_alone(variant53):
    seeds = np.random.SeedSequence(6).spawn(2)
    together = list(instants(variant53, [3, 5], 6, seeds))
    for here, size, seed in ((slice(3), 3, seeds[0]), (slice(3, 8), 5, seeds[1])):
        for one, both in zip(Ensemble(variant53, size, 6, seed), together, strict=True):
            for alone, side in zip(one[:3], both[:3], strict=True):
                np.testing.assert_array_equal(side[here], alone)


# ---------------------------------------------------------------- run


@pytest.mark.parametrize("kind", ["variant53", "vector"])
def test_one_trajectory_gets_the_numbers_it_gets_in_the_ensemble(kind, request):
    model = request.getfixturevalue(kind)
    y = simulate(model, 30, 10, seed=1).y
    for build in (gaussian, linearised):
        together = run(aof(build(model)), y)
        for i in (0, 29):
            alone = run(aof(build(model)), y[:, i : i + 1])
            # the library's matrix products may add in another order: a few roundings a step
            np.testing.assert_allclose(
                alone.mean[:, 0], together.mean[:, i], rtol=1e-12, atol=1e-14
            )
            np.testing.assert_allclose(alone.cov[:, 0], together.cov[:, i], rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("kind", ["variant53", "vector"])
def test_measurements_of_another_size_are_refused(kind, request):
    model = request.getfixturevalue(kind)
    for build in (lambda m: aof(linearised(m)), lambda m: aof(gaussian(m))):
        with pytest.raises(
            ValueError, match=rf"expects {model.p} measurement component\(s\), got 3"
        ):
            run(build(model), np.zeros((4, 5, 3)))


# ---------------------------------------------------------------- compare


def numbers(comparison):
    return [
        getattr(comparison.sums, name)
        for name in ("weight", "error", "square", "own", "normalised")
    ]


@pytest.mark.parametrize("runs", [37, 2345])
def test_the_number_of_jobs_changes_nothing(variant53, runs):
    results = [
        compare(lab_of(variant53), variant53, runs, 6, seed=7, jobs=jobs, progress=False)
        for jobs in (1, 2, 3)
    ]
    for other in results[1:]:
        for first, second in zip(numbers(results[0]), numbers(other), strict=True):
            np.testing.assert_array_equal(first, second)


def test_the_seed_changes_everything(variant53):
    first, second = (
        compare([aof(gaussian(variant53))], variant53, 100, 3, seed=seed, progress=False)
        for seed in (1, 2)
    )
    assert (
        first.error_variance("aof-gaussian").value != second.error_variance("aof-gaussian").value
    ).all()


def test_a_filter_s_numbers_do_not_depend_on_its_company(variant53):
    filters = lab_of(variant53)
    together = compare(filters, variant53, 500, 4, seed=7, progress=False)
    for filter_ in (filters[0], filters[2], filters[5]):
        alone = compare([filter_], variant53, 500, 4, seed=7, progress=False)
        np.testing.assert_array_equal(
            alone.error_variance(filter_.name).value, together.error_variance(filter_.name).value
        )


@pytest.mark.parametrize(("runs", "steps"), [(1, 1), (2, 1), (1, 5), (3, 4), (127, 3), (129, 2)])
@pytest.mark.filterwarnings("error")
def test_small_experiments_run(vector, runs, steps):
    result = compare(lab_of(vector), vector, runs, steps, seed=3, design_runs=200, progress=False)
    for name in result.names:
        assert result.error_variance(name).value.shape == (steps,)
        assert np.isfinite(result.error_variance(name).value).all()
        assert result.error_mean(name).value.shape == (steps, 2)


def test_the_design_ensemble_is_another_one(variant53):
    """On the design's own trajectories MFOS looks better than on fresh ones, and never worse than
    it would by chance."""
    filters = [aof(gaussian(variant53)), mfos(gaussian(variant53))]
    same = compare(filters, variant53, 60, 1, seed=11, same_ensemble=True, progress=False)
    fresh = compare(filters, variant53, 60, 1, seed=11, design_runs=20, progress=False)
    # At k = 0 the MFOS's correction is the best affine one over its own ensemble: no other
    # coefficients can be below.
    own, others = (result.gap("mfos-gaussian").value[0] for result in (same, fresh))
    assert own <= 0 < others


def test_memory_does_not_grow_with_the_number_of_steps(variant53):
    filters, runs = [aof(gaussian(variant53)), duof(variant53)], 20_000

    def peak(steps):
        tracemalloc.start()
        compare(filters, variant53, runs, steps, seed=1, jobs=1, progress=False)
        found = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return found

    peak(4)  # what is compiled and cached once
    # The sums: 2 filters x 60 more steps x 6 statistics x 64 batches x 8 bytes = 0.4 MB;
    # trajectories would be 20 MB.
    assert peak(80) - peak(20) < 1.5e6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"runs": 0}, "runs"),
        ({"runs": -5}, "runs"),
        ({"runs": 10.5}, "runs"),
        ({"runs": "10"}, "runs"),
        ({"runs": True}, "runs"),
        ({"steps": 0}, "steps"),
        ({"steps": 2.0}, "steps"),
        ({"jobs": 0}, "jobs"),
        ({"design_runs": 0}, "runs"),
        ({"seed": -1}, "negative|seed"),
        ({"seed": "one"}, "seed"),
        ({"seed": 1.5}, "seed"),
        ({"seed": None}, "seed"),
        ({"filters": []}, "at least one"),
        ({"filters": "twice"}, "name of its own"),
        ({"filters": "other model"}, "model"),
    ],
)
def test_bad_arguments_are_value_errors_that_name_them(variant53, arguments, message):
    one, other = (
        aof(gaussian(variant53)),
        Model.define(["x1 + v1", "x2 + v2"], ["x1 + w1", "x2 + w2"]),
    )
    filters = {"twice": [one, one], "other model": [one, duof(other)]}
    call = {
        "filters": [one, duof(variant53)],
        "model": variant53,
        "runs": 10,
        "steps": 2,
        "seed": 1,
    } | arguments
    call["filters"] = (
        filters.get(call["filters"], call["filters"])
        if isinstance(call["filters"], str)
        else call["filters"]
    )
    with pytest.raises(ValueError, match=message):
        compare(progress=False, **call)


@pytest.mark.parametrize("filters", ["ready", "designed"])
@pytest.mark.filterwarnings("error")
def test_a_diverging_model_says_so(filters):
    model = Model.define("x**3*2 + v", "x + w")
    chosen = {"ready": [aof(linearised(model)), aof(gaussian(model))], "designed": [duof(model)]}[
        filters
    ]
    with pytest.raises(NotFinite, match=r"(become infinite|diverges)"):
        compare(chosen, model, 200, 12, seed=1, progress=False)


@pytest.mark.filterwarnings("error")
def test_a_diverging_filter_is_named():
    # Stable object, exact meter of sharp curvature: the trajectories stay finite.
    model = Model.define("0.5*x + 0.1*v", "x + 0.1*w")
    good = kalman_filter(model)
    bad = type(good)(
        "bad",
        model,
        good.init,
        lambda state, y: good.step(state, np.where(state.step == 2, np.inf, y)),
    )
    with pytest.raises(
        NotFinite, match="step 2: bad became infinite or NaN although the trajectories are finite"
    ):
        compare([good, bad], model, 50, 4, seed=1, progress=False)


# ---------------------------------------------------------------- seeds and shapes


def test_one_trajectory_of_a_scalar_meter_may_be_a_vector(variant53, vector):
    y, one = simulate(variant53, 1, 5, seed=1).y, aof(gaussian(variant53))
    for given in (y[:, 0, 0], y[:, 0, 0].tolist()):
        for found, expected in zip(run(one, given), run(one, y), strict=True):
            np.testing.assert_array_equal(found, expected)
    missing = np.where(np.arange(5) == 2, np.nan, y[:, 0, 0])
    np.testing.assert_array_equal(run(one, missing).mean, run(one, missing[:, None, None]).mean)

    pair = aof(gaussian(vector))
    for filter_, measurements, message in (
        (one, np.zeros((5, 4)), r"\(5, 4\); of two axes give y\[:, None, :\] .* y\[:, :, None\]"),
        (pair, np.zeros(5), r"must have the shape \(steps, runs, 2\), got \(5,\)"),
        (one, np.zeros((5, 1, 2)), "expects 1 measurement component"),
        (one, np.zeros((5, 3, 1, 1)), r"got \(5, 3, 1, 1\)"),
        (one, [], r"no measurements to run over.* is \(0, 1, 1\)$"),
        (one, np.zeros((5, 0, 1)), r"no measurements to run over"),
        (one, [0.1, -np.inf], "step 1, run 0 is infinite; write NaN where one is missing"),
    ):
        for use in (run, predictions, smooth, likelihood):
            with pytest.raises(ValueError, match=message):
                use(filter_, measurements)


def test_a_design_that_is_run_says_what_to_do(variant53):
    y = simulate(variant53, 2, 3, seed=1).y
    with pytest.raises(
        TypeError, match=r"got Design duof: .*design\(\.\.\.\) makes one of a design"
    ):
        run(duof(variant53), y)
    one = design([duof(variant53)], Ensemble(variant53, 1000, 3, seed=1))[0]
    assert np.isfinite(run(one, y).mean).all()


def test_each_batch_of_a_comparison_has_particles_of_its_own(vector):
    """Errors of particles that were the same in all batches would not average out, and no interval
    would know."""
    seeds, cloud = np.random.SeedSequence(1).spawn(2), particle(vector, particles=20)
    sample = Sample(vector, 1, [50, 50], seeds)
    starts = [sample.part(slice(b, b + 1)).begun(cloud) for b in (0, 1, 0)]
    first, second, again = (
        cloud.step(state, np.zeros((50, vector.p))).posterior.mean for state in starts
    )
    np.testing.assert_array_equal(first, again)
    assert (first != second).all()
