"""Weights instead of a gate: the equations of the fixed point."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from kfcourse import Model, linearised, run
from kfcourse.filters import robust
from kfcourse.records import weights

PRIOR_MEAN, PRIOR_COV = np.array([1.0, -0.5]), np.array([[0.9, 0.3], [0.3, 0.6]])
NOISE = np.array([[0.5, 0.2], [0.2, 0.3]])


@pytest.fixture(scope="module")
def plane() -> Model:
    return Model.define(
        ["x1 + 0.5*x2 + 0.1*v1", "0.9*x2 + 0.3*v2"], ["x1 + w1", "x2 + 0.2*x1 + w2"],
        prior={"mean": PRIOR_MEAN, "variance": PRIOR_COV}, meter_noise={"variance": NOISE},
    )  # fmt: skip


def student(degrees, square, trace, size):
    return (degrees + size) / (degrees + square + trace)


def huber(edge, square, trace, size):
    return min(1, edge / np.sqrt(square))


@pytest.mark.parametrize("rows", [[0, 1], [0], [1]])
@pytest.mark.parametrize(
    ("weigh", "parameter", "options"),
    [(student, 3.0, {"degrees": 3.0}), (huber, 1.3, {"edge": 1.3})],
)
def test_it_settles_where_weight_and_law_agree(plane, rows, weigh, parameter, options):
    """x ~ N(z, p) by one dense regression with R / w, and w by its own equation at that law; with
    missing components too.  For Huber's weights these are the conditions of the least of his
    cost."""
    H = np.array([[1.0, 0.0], [0.2, 1.0]])[rows]
    R, y = NOISE[np.ix_(rows, rows)], np.full((1, 4, 2), np.nan)
    y[0][:, rows] = np.array([[0.9, -0.2], [3.0, 2.0], [-6.0, 1.0], [40.0, -90.0]])[:, rows]
    filter_ = robust(linearised(plane), rounds=150, **options)
    law, w = run(filter_, y), weights(filter_, y)[0]
    for i in range(4):
        p = np.linalg.inv(np.linalg.inv(PRIOR_COV) + w[i] * H.T @ np.linalg.solve(R, H))
        z = p @ (
            np.linalg.solve(PRIOR_COV, PRIOR_MEAN) + w[i] * H.T @ np.linalg.solve(R, y[0, i, rows])
        )
        assert_allclose(law.mean[0, i], z, rtol=1e-9)
        assert_allclose(law.cov[0, i], p, rtol=1e-9, atol=1e-15)
        r, trace = y[0, i, rows] - H @ z, np.trace(np.linalg.solve(R, H @ p @ H.T))
        expected = weigh(parameter, r @ np.linalg.solve(R, r), trace, len(rows))
        assert w[i] == pytest.approx(expected, rel=1e-9)
    assert w[0] > w[3] > 0
