"""Weights instead of a gate: the equations of the fixed point, limits, brute force over heavy tails, and outliers."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import t as student

from kfcourse import Model, linearised, run, simulate, smooth
from kfcourse.filters import aof, gated, kalman_filter, robust
from kfcourse.records import weights

pytestmark = pytest.mark.quick

PRIOR_MEAN, PRIOR_COV = np.array([1.0, -0.5]), np.array([[0.9, 0.3], [0.3, 0.6]])
NOISE = np.array([[0.5, 0.2], [0.2, 0.3]])


@pytest.fixture(scope="module")
def plane() -> Model:
    return Model.define(
        ["x1 + 0.5*x2 + 0.1*v1", "0.9*x2 + 0.3*v2"], ["x1 + w1", "x2 + 0.2*x1 + w2"],
        prior={"mean": PRIOR_MEAN, "variance": PRIOR_COV}, meter_noise={"variance": NOISE},
    )  # fmt: skip


@pytest.mark.parametrize("rows", [[0, 1], [0], [1]])
def test_it_settles_where_weight_and_law_agree(plane, rows):
    """x ~ N(z, p) by one dense regression with R / w, and w by its own equation at that law; with missing components too."""
    degrees, H = 3.0, np.array([[1.0, 0.0], [0.2, 1.0]])[rows]
    R, y = NOISE[np.ix_(rows, rows)], np.full((1, 4, 2), np.nan)
    y[0][:, rows] = np.array([[0.9, -0.2], [3.0, 2.0], [-6.0, 1.0], [40.0, -90.0]])[:, rows]
    one = robust(linearised(plane), degrees, rounds=300)
    found, w = run(one, y), weights(one, y)[0]
    for i in range(4):
        information = np.linalg.inv(PRIOR_COV) + w[i] * H.T @ np.linalg.solve(R, H)
        p = np.linalg.inv(information)
        z = p @ (np.linalg.solve(PRIOR_COV, PRIOR_MEAN) + w[i] * H.T @ np.linalg.solve(R, y[0, i, rows]))
        np.testing.assert_allclose(found.mean[0, i], z, rtol=1e-9)
        np.testing.assert_allclose(found.cov[0, i], p, rtol=1e-9)
        r = y[0, i, rows] - H @ z
        size = r @ np.linalg.solve(R, r) + np.trace(np.linalg.solve(R, H @ p @ H.T))
        assert w[i] == pytest.approx((degrees + len(rows)) / (degrees + size), rel=1e-9)


@pytest.mark.parametrize("rows", [[0, 1], [0], [1]])
def test_with_huber_s_weights_it_is_the_least_of_his_cost(plane, rows):
    edge, H = 1.3, np.array([[1.0, 0.0], [0.2, 1.0]])[rows]
    R, y = NOISE[np.ix_(rows, rows)], np.full((1, 3, 2), np.nan)
    y[0][:, rows] = np.array([[0.9, -0.2], [-6.0, 7.0], [40.0, -90.0]])[:, rows]
    one = robust(linearised(plane), rounds=400, edge=edge)
    found, w = run(one, y), weights(one, y)[0]
    for i in range(3):

        def cost(z, i=i):
            off, r = z - PRIOR_MEAN, y[0, i, rows] - H @ z
            size = np.sqrt(r @ np.linalg.solve(R, r))
            return off @ np.linalg.solve(PRIOR_COV, off) / 2 + (size**2 / 2 if size < edge else edge * size - edge**2 / 2)

        best = minimize(cost, PRIOR_MEAN, method="BFGS", options={"gtol": 1e-9}).x
        # where the search stops is known to the root of the rounding of the cost, some hundreds
        np.testing.assert_allclose(found.mean[0, i], best, rtol=1e-5, atol=1e-5)
        r = y[0, i, rows] - H @ found.mean[0, i]
        assert w[i] == pytest.approx(min(1, edge / np.sqrt(r @ np.linalg.solve(R, r))), rel=1e-9)
    assert w[0] == 1 > w[1] > w[2] > 0


def test_the_further_off_the_less_it_counts():
    model = Model.define("x + 0.1*v", "x + w")
    y = np.array([0.0, 1.0, 3.0, 10.0, 100.0, 1e6])[None, :, None]
    one = robust(linearised(model))
    w, z = weights(one, y)[0], run(one, y).mean[0, :, 0]
    assert (np.diff(w) < 0).all()
    assert w[0] > 1  # better than a normal one is expected to fit
    assert z[2] > z[1] > 0
    assert z[-1] < z[-2] < z[-3] < 1  # beyond some distance it moves the estimate less the further it is
    assert z[-1] < 1e-4


def test_its_law_is_near_the_posterior_under_student_noise():
    """Brute force: x ~ N(0, 1), y = x + Student noise.  The product of two laws is the posterior but for their dependence."""
    degrees, sigma = 4.0, 0.6
    model = Model.define("x + v", "x + s*w", {"s": sigma})
    y = np.array([0.0, 0.5, 1.5, 4.0, 12.0])
    found = run(robust(linearised(model), degrees, rounds=200), y[None, :, None])
    x = np.linspace(-8, 16, 24001)
    for i, value in enumerate(y):
        mass = np.exp(-0.5 * x**2) * student.pdf((value - x) / sigma, degrees)
        mass /= mass.sum()
        mean = mass @ x
        sd = np.sqrt(mass @ (x - mean) ** 2)
        assert abs(found.mean[0, i, 0] - mean) < 0.2 * sd
        # between believing and refusing (y = 4) the posterior has two humps' width; a normal law with one weight stands on one
        assert 0.65 < np.sqrt(found.cov[0, i, 0, 0]) / sd < 1.05


def test_outliers_hurt_it_less_and_whole_records_are_smoothed(plane):
    x, y = simulate(plane, 500, 20, seed=3)
    rng = np.random.default_rng(4)
    bad = rng.random((20, 500, 1)) < 0.05
    y = y + bad * 12 * rng.standard_normal(y.shape)
    believing, doubting, guarded = aof(linearised(plane)), robust(linearised(plane)), gated(aof(linearised(plane)))

    def errors(laws):
        return ((laws.mean - x) ** 2).sum(axis=-1).mean(axis=0)

    worst, weighted, refusing, later = (
        errors(laws) for laws in (run(believing, y), run(doubting, y), run(guarded, y), smooth(doubting, y))
    )
    for more, less in ((worst, weighted), (worst, refusing), (weighted, later)):
        difference = more - less
        assert difference.mean() > 4 * difference.std() / np.sqrt(difference.size)
    w = weights(doubting, y)[..., None]
    assert np.median(w[bad]) < 0.2 < 0.7 < np.median(w[~bad])


def test_a_missing_measurement_has_no_weight_and_moves_nothing(plane):
    y = simulate(plane, 3, 4, seed=5).y.copy()
    y[1, 0] = np.nan
    one = robust(linearised(plane))
    state = one.step(one.init(3), y[0])
    after = one.step(state, y[1])
    np.testing.assert_allclose(after.posterior.mean[0], state.predicted.mean[0], rtol=1e-14)
    assert np.isnan(after.memory.weight).tolist() == [True, False, False]
    assert one.name == "robust-linearised"


def test_a_gate_may_stand_before_it(plane):
    y = simulate(plane, 3, 6, seed=6).y.copy()
    y[3, 1] += 1e3
    one = gated(robust(linearised(plane)))
    assert weights(one, y)[3, 1] == 0
    assert np.isfinite(smooth(one, y).mean).all()
    assert np.abs(run(one, y).mean - run(kalman_filter(plane), y).mean).max() > 1
