"""The Monte Carlo engine: trajectories follow the model, and nothing but the seed decides the
numbers."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from kfcourse import (
    Ensemble,
    Model,
    NotFinite,
    compare,
    gaussian,
    likelihood,
    linearised,
    predictions,
    run,
    simulate,
    smooth,
)
from kfcourse.filters import aof, duof, fos, mfos, particle
from kfcourse.laws import gain
from kfcourse.montecarlo.ensemble import side_by_side
from kfcourse.montecarlo.experiment import _begun

SIGMA = 4  # standard errors: one chance in 16 000 a comparison


def lab_of(model):
    structures = [gaussian(model), linearised(model)]
    return [
        *(aof(each) for each in structures),
        duof(model),
        *(family(each) for family in (fos, mfos) for each in structures),
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


def test_ensembles_side_by_side_are_those_alone(variant53):
    seeds = np.random.SeedSequence(6).spawn(2)
    ensembles = [Ensemble(variant53, *part) for part in ((3, 6, seeds[0]), (5, 6, seeds[1]))]
    together = list(side_by_side(ensembles))
    for here, ensemble in zip((slice(3), slice(3, 8)), ensembles, strict=True):
        for each, both in zip(ensemble, together, strict=True):
            for alone, side in zip(each[:3], both[:3], strict=True):
                assert_array_equal(side[here], alone)


# ---------------------------------------------------------------- compare


def numbers(comparison):
    return [comparison.sums[name] for name in ("weight", "error", "square", "own", "normalised")]


def test_the_number_of_jobs_changes_nothing(variant53):
    results = [compare(lab_of(variant53), variant53, 2345, 6, seed=7, jobs=jobs) for jobs in (1, 3)]
    for first, second in zip(*map(numbers, results), strict=True):
        assert_array_equal(first, second)


def test_a_filter_s_numbers_do_not_depend_on_its_company(variant53):
    filters = lab_of(variant53)
    together = compare(filters, variant53, 500, 4, seed=7)
    for filter_ in (filters[0], filters[2], filters[5]):
        alone = compare([filter_], variant53, 500, 4, seed=7)
        assert_array_equal(
            alone.error_variance(filter_.name).value, together.error_variance(filter_.name).value
        )


@pytest.mark.parametrize(("runs", "steps"), [(1, 1), (3, 4), (129, 2)])
@pytest.mark.filterwarnings("error")
def test_small_experiments_run(vector, runs, steps):
    result = compare(lab_of(vector), vector, runs, steps, seed=3, design_runs=200)
    for name in result.names:
        assert result.error_variance(name).value.shape == (steps,)
        assert result.error_mean(name).value.shape == (steps, 2)


def test_the_design_ensemble_is_another_one(variant53):
    """On the design's own trajectories MFOS looks better than on fresh ones, and never worse than
    it would by chance."""
    filters = [aof(gaussian(variant53)), mfos(gaussian(variant53))]
    same = compare(filters, variant53, 60, 1, seed=11, same_ensemble=True)
    fresh = compare(filters, variant53, 60, 1, seed=11, design_runs=20)
    # At k = 0 the MFOS's correction is the best affine one over its own ensemble: no other
    # coefficients can be below.
    own, others = (result.gap("mfos-gaussian").value[0] for result in (same, fresh))
    assert own <= 0 < others


def test_memory_does_not_grow_with_the_number_of_steps(variant53):
    filters, runs = [aof(gaussian(variant53)), duof(variant53)], 10_000

    def peak(steps):
        tracemalloc.start()
        compare(filters, variant53, runs, steps, seed=1, jobs=1)
        outcome = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return outcome

    peak(2)  # what is compiled and cached once
    # The sums: 2 filters x 30 more steps x 6 statistics x 64 batches x 8 bytes = 0.2 MB;
    # trajectories would be 5 MB.
    assert peak(40) - peak(10) < 1e6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"runs": 0}, "runs"),
        ({"runs": 10.5}, "runs"),
        ({"steps": 0}, "steps"),
        ({"jobs": 0}, "jobs"),
        ({"design_runs": 0}, "runs"),
        ({"seed": -1}, "negative|seed"),
        ({"seed": 1.5}, "seed"),
        ({"filters": []}, "at least one"),
        ({"filters": "twice"}, "name of its own"),
        ({"filters": "other model"}, "model"),
    ],
)
def test_bad_arguments_are_value_errors_that_name_them(variant53, arguments, message):
    good = aof(gaussian(variant53))
    vector = Model.define(["x1 + v1", "x2 + v2"], ["x1 + w1", "x2 + w2"])
    call = {"filters": [good], "model": variant53, "runs": 10, "steps": 2, "seed": 1} | arguments
    if call["filters"] == "twice":
        call["filters"] = [good, good]
    if call["filters"] == "other model":
        call["filters"] = [good, duof(vector)]
    with pytest.raises(ValueError, match=message):
        compare(**call)


@pytest.mark.parametrize("build", [lambda model: aof(gaussian(model)), duof])
@pytest.mark.filterwarnings("error")
def test_a_diverging_model_says_so(build):
    model = Model.define("x**3*2 + v", "x + w")
    with pytest.raises(NotFinite, match=r"(become infinite|diverges)"):
        compare([build(model)], model, 200, 12, seed=1)


@pytest.mark.filterwarnings("error")
def test_a_comparison_goes_on_without_the_filters_that_fail():
    """A filter that becomes infinite, or meets a negative variance as it is designed, is named, and
    the comparison is that of the others."""
    model = Model.define("0.9*x + 0.3*v", "x + w")

    def broken(name):
        good = aof(gaussian(model))

        def step(state, y):
            after = good.step(state, y)
            mean = after.posterior.mean * (np.inf if state.step == 2 else 1.0)
            return after._replace(posterior=after.posterior._replace(mean=mean))

        return type(good)(name, model, good.init, step)

    def cancelling(state, y):
        yield gain(np.ones((1, 1)), np.array([[-165.0]]))

    def fails(state, y):
        raise ValueError("it cannot")

    size, options = (model, 300, 4, 1), {"jobs": 1}
    good = [duof(model), aof(gaussian(model))]
    four = replace(good[1], name="four", step=fails)
    three = replace(good[0], name="three", equations=cancelling)
    bad = [broken("first"), broken("two"), three, four]
    result = compare([*bad, *good], *size, **options)
    assert result.names == ("duof", "aof-gaussian")
    assert {name: why.kind for name, why in result.left_out.items()} == {
        "first": "infinite",
        "two": "infinite",
        "three": "negative",
        "four": "",
    }
    assert str(result.left_out["four"]) == "step 0: four failed: it cannot"
    infinite = "step 2: first became infinite or NaN although the trajectories are finite"
    assert infinite in str(result.left_out["first"])
    failed = "step 0: three failed: a covariance has the variance -165"
    assert str(result.left_out["three"]).startswith(failed)
    with pytest.raises(KeyError, match="no results for 'first': step 2: first became infinite"):
        result.error_variance("first")
    assert_array_equal(
        result.error_variance("duof").value,
        compare(good, *size, **options).error_variance("duof").value,
    )
    with pytest.raises(NotFinite, match="two became infinite"):
        compare([broken("two")], *size, **options)


# ---------------------------------------------------------------- seeds and shapes


def test_one_trajectory_of_a_scalar_meter_may_be_a_vector(variant53, vector):
    y, scalar = simulate(variant53, 1, 5, seed=1).y, aof(gaussian(variant53))
    for given in (y[:, 0, 0], y[:, 0, 0].tolist()):
        for outcome, expected in zip(run(scalar, given), run(scalar, y), strict=True):
            assert_array_equal(outcome, expected)
    missing = np.where(np.arange(5) == 2, np.nan, y[:, 0, 0])
    assert_array_equal(run(scalar, missing).mean, run(scalar, missing[:, None, None]).mean)

    pair = aof(gaussian(vector))
    for filter_, measurements, message in (
        (
            scalar,
            np.zeros((5, 4)),
            r"\(5, 4\); of two axes give y\[:, None, :\] .* y\[:, :, None\]",
        ),
        (pair, np.zeros(5), r"must have the shape \(steps, runs, 2\), got \(5,\)"),
        (scalar, np.zeros((5, 1, 2)), "expects 1 measurement component"),
        (scalar, [], r"no measurements to run over.* is \(0, 1, 1\)$"),
        (scalar, [0.1, -np.inf], "step 1, run 0 is infinite; write NaN where one is missing"),
    ):
        for use in (run, predictions, smooth, likelihood):
            with pytest.raises(ValueError, match=message):
                use(filter_, measurements)


def test_each_batch_of_a_comparison_has_particles_of_its_own(vector):
    """Errors of particles that were the same in all batches would not average out, and no interval
    would know."""
    seeds, cloud = np.random.SeedSequence(1).spawn(2), particle(vector, particles=20)
    batches = [Ensemble(vector, 50, 1, seed) for seed in seeds]
    starts = [_begun(cloud, [batches[b]]) for b in (0, 1, 0)]
    first, second, again = (
        cloud.step(state, np.zeros((50, vector.p))).posterior.mean for state in starts
    )
    assert_array_equal(first, again)
    assert (first != second).all()
