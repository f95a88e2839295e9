"""The gate: refusing is missing, as many as promised, in every filter; and how a lost track is
found again."""

import numpy as np
import pytest
from scipy.stats import chi2

from kfcourse import (
    Model,
    gaussian,
    likelihood,
    linearised,
    predictions,
    run,
    simulate,
    smooth,
    unscented,
)
from kfcourse.filters import (
    aof,
    duof,
    fos,
    gated,
    imm,
    iterated,
    kalman_filter,
    mfos,
    particle,
    pointmass,
    robust,
)
from kfcourse.linear.consistency import innovations
from kfcourse.montecarlo.designing import design
from kfcourse.montecarlo.ensemble import Ensemble
from kfcourse.records import weights

pytestmark = pytest.mark.quick


def walk(**options):
    return Model.define(
        "0.95*x + 0.3*v", "x + 0.5*w", prior={"mean": 0.4, "variance": 0.7}, **options
    )


@pytest.fixture(scope="module")
def plane() -> Model:
    """Two components measured, with noises of different size and correlated."""
    return Model.define(
        ["x1 + 0.5*x3 + 0.1*v1", "x2 + 0.5*x4 + 0.1*v2", "x3 + 0.3*v3", "x4 + 0.3*v4"],
        ["x1 + w1", "x2 + 0.2*x1 + w2"],
        meter_noise={"variance": [[0.5, 0.2], [0.2, 0.3]]},
    )


def spoiled(y):
    """Three gross errors, of one run each, and two measurements missing."""
    y = y.copy()
    y[2, 0] += 40.0
    y[4, 1] -= 55.0
    y[5, 1, 0] += 70.0
    y[3, 2] = y[6, 0] = np.nan
    return y


def refused(one, y):
    return weights(one, y) == 0


def without(one, y):
    """The record with what was refused missing."""
    return np.where(refused(one, y)[..., None], np.nan, y)


def every_filter():
    model = walk()
    designs = [duof(model), fos(gaussian(model)), mfos(linearised(model))]
    designed = design(designs, Ensemble(model, 300, 9, seed=1))
    modes = [
        linearised(walk()),
        linearised(Model.define("0.5*x + v", "x + 0.5*w", prior={"mean": 0.4, "variance": 0.7})),
    ]
    return [
        aof(linearised(model)),
        aof(unscented(model)),
        iterated(gaussian(model), 3),
        kalman_filter(model),
        robust(gaussian(model)),
        *designed,
        imm(modes, [[0.9, 0.1], [0.2, 0.8]]),
        pointmass(model),
        particle(model, 200, seed=3),
    ]


def test_in_every_filter_what_is_refused_is_missing():
    y = spoiled(simulate(walk(), 4, 9, seed=2).y)
    expected = np.zeros((9, 4), dtype=bool)
    expected[2, 0] = expected[4:6, 1] = True
    for one in every_filter():
        guarded = gated(one, structure=linearised(walk()))
        np.testing.assert_array_equal(refused(guarded, y), expected, err_msg=one.name)
        np.testing.assert_array_equal(np.isnan(weights(guarded, y)), np.isnan(y[..., 0]))
        found, behind = run(guarded, y), run(one, without(guarded, y))
        np.testing.assert_array_equal(found.mean, behind.mean, err_msg=one.name)
        np.testing.assert_array_equal(found.cov, behind.cov, err_msg=one.name)
        if one.name != "aof-exact":  # which refuses without a gate what contradicts the model
            assert np.abs(run(one, y).mean - found.mean).max() > 0.5 or one.name.startswith(
                "robust"
            )


@pytest.mark.parametrize("probability", [0.9, 0.99])
def test_a_right_filter_loses_as_many_as_it_was_told(plane, probability):
    """Two, one or no component measured; the model is linear, so the innovations are normal and F
    is right."""
    y = simulate(plane, 400, 12, seed=5).y.copy()
    rng = np.random.default_rng(6)
    y[rng.random(y.shape) < 0.2] = np.nan
    one = gated(kalman_filter(plane), probability)
    found = refused(one, y)
    for count in (1, 2):
        # the first measurement of each kind in a record: what was refused before it would make F
        # too small afterwards
        first = (~np.isnan(y)).sum(axis=-1) == count
        share, size = found[0][first[0]].mean(), first[0].sum()
        assert abs(share - (1 - probability)) < 4 * np.sqrt(probability * (1 - probability) / size)
    assert not found[np.isnan(y).all(axis=-1)].any()


def test_an_innovation_of_a_turn_is_none():
    model = Model.define(
        "x + 0.1*v",
        "x + 0.2*w",
        angles={"x": ["x"], "y": ["y"]},
        prior={"mean": 3.1, "variance": 0.01},
    )
    y = np.array([3.1, -3.1, 3.12, 1.0, -3.13])
    np.testing.assert_array_equal(
        weights(gated(aof(linearised(model))), y).ravel(), [1, 1, 1, 0, 1]
    )


# ---------------------------------------------------------------- the lost track


def jump():
    """An object that jumps by 30 standard deviations of its measurement at step 10."""
    model = Model.define("x + 0.1*v", "x + w", prior={"mean": 0.0, "variance": 1.0})
    x, y = simulate(model, 50, 40, seed=8)
    late = np.arange(40)[:, None, None] >= 10
    return model, x + 30 * late, y + 30 * late


def test_without_an_end_of_patience_a_lost_track_stays_lost():
    model, x, y = jump()
    one = gated(kalman_filter(model), patience=None)
    assert refused(one, y)[10:30].all()
    assert np.abs(run(one, y).mean - x)[29].min() > 25


@pytest.mark.parametrize("patience", [1, 3, 5])
def test_after_its_patience_the_gate_lets_the_next_one_through(patience):
    model, x, y = jump()
    y = y.copy()
    y[10 + patience, 3] = np.nan  # for this one the measurement after is the next
    one, plain = gated(kalman_filter(model), 1 - 1e-6, patience), kalman_filter(model)
    found = refused(one, y)
    assert found[10 : 10 + patience].all()
    assert not found[10 + patience :].any()
    assert not found[:10].any()
    error = np.abs(run(one, y).mean - x)
    # let through with a prediction as wide as the jump, so the estimate is the measurement: four
    # standard deviations of it
    assert error[10 + patience, np.arange(50) != 3].max() < 4.5
    assert error[11 + patience, 3] < 4.5
    # and is on the track long before the filter without a gate, whose gain has settled at a tenth
    after = slice(11 + patience, 14 + patience)
    assert (error[after] ** 2).mean() < 0.2 * (np.abs(run(plain, y).mean - x)[after] ** 2).mean()


def test_gaps_neither_feed_nor_calm_impatience_and_the_next_measurement_passes_whatever_it_is():
    one = gated(
        kalman_filter(Model.define("x + 0.1*v", "x + w", prior={"mean": 0.0, "variance": 1.0})),
        patience=2,
    )
    gap = np.nan
    y = np.array([0.0, 50.0, gap, gap, 51.0, gap, -4000.0, 0.0])
    np.testing.assert_array_equal(weights(one, y).ravel(), [1, 0, gap, gap, 0, gap, 1, 0])


# ---------------------------------------------------------------- what is refused


def test_what_a_gate_cannot_stand_before_is_told():
    with pytest.raises(TypeError, match=r"gated expects a Filter, got Design duof: .*design"):
        gated(duof(walk()))
    with pytest.raises(ValueError, match=r"a gate needs the structural functions.*imm has none"):
        gated(imm([linearised(walk())], [[1.0]]))
    # their own ways back need memories that the gate covers
    for one in (pointmass(walk()), particle(walk(), 10)):
        with pytest.raises(
            ValueError,
            match=rf"looking back needs the structural functions.*gated-{one.name} has none",
        ):
            smooth(gated(one, structure=linearised(walk())), np.zeros(3))
    with pytest.raises(ValueError, match=r"kalman takes every measurement as it is: ask gated"):
        weights(kalman_filter(walk()), np.zeros(3))


def test_components_are_judged_each_for_itself_on_request(plane):
    """A gross error of one component costs that component alone; the likelihood counts it as one at
    the gate's edge."""
    y = spoiled(simulate(plane, 3, 9, seed=4).y)
    one = aof(linearised(plane))
    behind = gated(one, 0.999, by_component=True)
    seen = y.copy()
    seen[2, 0] = seen[4, 1] = seen[5, 1, 0] = np.nan
    found = run(behind, y)
    np.testing.assert_allclose(found.mean, run(one, seen).mean, rtol=1e-12)
    np.testing.assert_array_equal(weights(behind, y)[5], [1, 0.5, 1])
    assert weights(gated(one, 0.999), y)[5, 1] == 0  # the whole row
    edge = chi2(1).ppf(0.999)
    _, F = innovations(plane_meter(plane), predictions(behind, y), y)
    expected = likelihood(one, seen)[5, 1] - 0.5 * (edge + np.log(2 * np.pi * F[5, 1, 0, 0]))
    assert likelihood(behind, y)[5, 1] == pytest.approx(expected, rel=1e-12)


def plane_meter(plane):
    return linearised(plane).measure
