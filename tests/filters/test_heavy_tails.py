"""Weights instead of a gate: the equations of the fixed point, Huber's cost, and outliers."""

import numpy as np
import pytest
from scipy.optimize import minimize

from kfcourse import Model, linearised, run
from kfcourse.filters import robust
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
    """x ~ N(z, p) by one dense regression with R / w, and w by its own equation at that law; with
    missing components too."""
    degrees, H = 3.0, np.array([[1.0, 0.0], [0.2, 1.0]])[rows]
    R, y = NOISE[np.ix_(rows, rows)], np.full((1, 4, 2), np.nan)
    y[0][:, rows] = np.array([[0.9, -0.2], [3.0, 2.0], [-6.0, 1.0], [40.0, -90.0]])[:, rows]
    one = robust(linearised(plane), degrees, rounds=300)
    found, w = run(one, y), weights(one, y)[0]
    for i in range(4):
        information = np.linalg.inv(PRIOR_COV) + w[i] * H.T @ np.linalg.solve(R, H)
        p = np.linalg.inv(information)
        z = p @ (
            np.linalg.solve(PRIOR_COV, PRIOR_MEAN) + w[i] * H.T @ np.linalg.solve(R, y[0, i, rows])
        )
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
            return off @ np.linalg.solve(PRIOR_COV, off) / 2 + (
                size**2 / 2 if size < edge else edge * size - edge**2 / 2
            )

        best = minimize(cost, PRIOR_MEAN, method="BFGS", options={"gtol": 1e-9}).x
        # where the search stops is known to the root of the rounding of the cost, some hundreds
        np.testing.assert_allclose(found.mean[0, i], best, rtol=1e-5, atol=1e-5)
        r = y[0, i, rows] - H @ found.mean[0, i]
        assert w[i] == pytest.approx(min(1, edge / np.sqrt(r @ np.linalg.solve(R, r))), rel=1e-9)
    assert w[0] == 1 > w[1] > w[2] > 0
