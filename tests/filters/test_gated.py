"""The gate: refusing is missing, as many as promised, in every filter; and how a lost track is
found again."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import chi2
from test_every_filter import READY

from kfcourse import (
    Ensemble,
    Model,
    compare,
    design,
    gaussian,
    likelihood,
    linearised,
    predictions,
    run,
    simulate,
    smooth,
)
from kfcourse.filters import duof, fos, gated, imm, kalman_filter, mfos, particle, pointmass
from kfcourse.linear.consistency import innovations
from kfcourse.records import weights


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


def refused(filter_, y):
    return weights(filter_, y) == 0


def every_filter():
    model = walk()
    plans = [duof(model), fos(gaussian(model)), mfos(linearised(model))]
    return [
        *(build(model) for kind, build in READY.items() if kind != "gated"),
        *design(plans, Ensemble(model, 300, 9, seed=1)),
        kalman_filter(model),
        pointmass(model),
        particle(model, 200, seed=3),
    ]


def test_in_every_filter_what_is_refused_is_missing():
    y = spoiled(simulate(walk(), 4, 9, seed=2).y)
    expected = np.zeros((9, 4), dtype=bool)
    expected[2, 0] = expected[4:6, 1] = True
    for filter_ in every_filter():
        guarded = gated(filter_, structure=linearised(walk()))
        assert_array_equal(refused(guarded, y), expected, err_msg=filter_.name)
        assert_array_equal(np.isnan(weights(guarded, y)), np.isnan(y[..., 0]))
        law = run(guarded, y)
        behind = run(filter_, np.where(expected[..., None], np.nan, y))
        assert_array_equal(law.mean, behind.mean, err_msg=filter_.name)
        assert_array_equal(law.cov, behind.cov, err_msg=filter_.name)


@pytest.mark.parametrize("probability", [0.9, 0.99])
def test_a_right_filter_loses_as_many_as_it_was_told(plane, probability):
    """Two, one or no component measured; the model is linear, so the innovations are normal and F
    is right."""
    y = simulate(plane, 400, 12, seed=5).y.copy()
    rng = np.random.default_rng(6)
    y[rng.random(y.shape) < 0.2] = np.nan
    lost = refused(gated(kalman_filter(plane), probability), y)
    for count in (1, 2):
        # the first measurement of each kind in a record: what was refused before it would make F
        # too small afterwards
        first = (~np.isnan(y)).sum(axis=-1) == count
        share, size = lost[0][first[0]].mean(), first[0].sum()
        assert abs(share - (1 - probability)) < 4 * np.sqrt(probability * (1 - probability) / size)
    assert not lost[np.isnan(y).all(axis=-1)].any()


# ---------------------------------------------------------------- the lost track


def jump():
    """An object that jumps by 30 standard deviations of its measurement at step 10."""
    model = Model.define("x + 0.1*v", "x + w", prior={"mean": 0.0, "variance": 1.0})
    x, y = simulate(model, 50, 40, seed=8)
    late = np.arange(40)[:, None, None] >= 10
    return model, x + 30 * late, y + 30 * late


@pytest.mark.parametrize("patience", [1, 3])
def test_after_its_patience_the_gate_lets_the_next_one_through(patience):
    model, x, y = jump()
    y = y.copy()
    y[10 + patience, 3] = np.nan  # for this one the measurement after is the next
    filter_, plain = gated(kalman_filter(model), 1 - 1e-6, patience), kalman_filter(model)
    lost = refused(filter_, y)
    assert lost[10 : 10 + patience].all()
    assert not lost[10 + patience :].any() and not lost[:10].any()
    error = np.abs(run(filter_, y).mean - x)
    # let through with a prediction as wide as the jump, so the estimate is the measurement: four
    # standard deviations of it
    assert error[10 + patience, np.arange(50) != 3].max() < 4.5
    assert error[11 + patience, 3] < 4.5
    # and is on the track long before the filter without a gate, whose gain has settled at a tenth
    after = slice(11 + patience, 14 + patience)
    assert (error[after] ** 2).mean() < 0.2 * (np.abs(run(plain, y).mean - x)[after] ** 2).mean()


GAP = np.nan


@pytest.mark.parametrize(
    ("patience", "expected"),
    [(2, [1, 0, GAP, GAP, 0, GAP, 1, 0]), (None, [1, 0, GAP, GAP, 0, GAP, 0, 1])],
)
def test_gaps_neither_feed_nor_calm_impatience_and_the_next_passes_whatever_it_is(
    patience, expected
):
    """Without an end of patience a lost track stays lost."""
    model = Model.define("x + 0.1*v", "x + w", prior={"mean": 0.0, "variance": 1.0})
    y = np.array([0.0, 50.0, GAP, GAP, 51.0, GAP, -4000.0, 0.0])
    weight = weights(gated(kalman_filter(model), patience=patience), y)
    assert_array_equal(weight.ravel(), expected)


# ---------------------------------------------------------------- what is refused


def test_what_a_gate_cannot_stand_before_is_refused():
    with pytest.raises(TypeError, match=r"gated expects a Filter, got Design duof: .*design"):
        gated(duof(walk()))
    with pytest.raises(ValueError, match=r"a gate needs the structural functions.*imm has none"):
        gated(imm([linearised(walk())], [[1.0]]))
    # their own ways back need memories that the gate covers
    for filter_ in (pointmass(walk()), particle(walk(), 10)):
        problem = rf"looking back needs the structural functions.*gated-{filter_.name} has none"
        with pytest.raises(ValueError, match=problem):
            smooth(gated(filter_, structure=linearised(walk())), np.zeros(3))
    # and their scores are those of the likelihood alone
    filters = [
        gated(each, structure=linearised(walk())) for each in (READY["imm"](walk()), filter_)
    ]
    compared = compare(
        [*filters, kalman_filter(walk())], walk(), 64, 2, 1, scores=linearised(walk())
    )
    assert len(compared.names) == 3
    with pytest.raises(ValueError, match=r"kalman takes every measurement as it is: ask gated"):
        weights(kalman_filter(walk()), np.zeros(3))


def test_a_refused_measurement_is_as_likely_as_one_at_the_edge(plane):
    y, plain = spoiled(simulate(plane, 3, 9, seed=4).y), kalman_filter(plane)
    behind = gated(plain)
    beyond = refused(behind, y)
    F = innovations(linearised(plane).measure, predictions(behind, y), y).cov
    edge = -0.5 * (chi2(2).ppf(0.999) + np.linalg.slogdet(2 * np.pi * F).logabsdet)
    expected = np.where(beyond, edge, likelihood(plain, np.where(beyond[..., None], np.nan, y)))
    assert beyond.sum() == 3
    assert_allclose(likelihood(behind, y), expected, rtol=1e-12)
