"""Consistency tests against the loops of the page; whether they find what is wrong is tested with
records."""

import numpy as np
import pytest
import scipy.linalg
import scipy.stats
from numpy.testing import assert_allclose

from kfcourse import Gaussian
from kfcourse.laws import normalised_square
from kfcourse.linear.consistency import (
    Innovations,
    alarms,
    autocorrelation,
    chi_squared_bounds,
    confidence_ellipse,
    nees,
    nis,
)

# ---------------------------------------------------------------- quantities


def test_the_normalised_square_is_the_loop_of_the_page():
    rng = np.random.default_rng(1)
    root, vector = rng.normal(size=(4, 3, 2, 2)), rng.normal(size=(4, 3, 2))
    cov = root @ root.swapaxes(-1, -2) + 0.1 * np.eye(2)
    expected = [
        [v @ np.linalg.inv(P) @ v for v, P in zip(*row, strict=True)]
        for row in zip(vector, cov, strict=True)
    ]
    # two products of 2 x 2 matrices whose condition is below 1e3
    assert_allclose(normalised_square(vector, cov), expected, rtol=1e-12)
    shared = normalised_square(vector, cov[0, 0])  # one covariance for all
    assert_allclose(
        shared[2, 1], vector[2, 1] @ np.linalg.inv(cov[0, 0]) @ vector[2, 1], rtol=1e-12
    )
    assert_allclose(nees(vector, Gaussian(0.5 * vector, cov)), np.array(expected) / 4, rtol=1e-12)
    assert_allclose(nis(Innovations(vector, cov)), expected, rtol=1e-12)


# ---------------------------------------------------------------- autocorrelation


def test_the_autocorrelation_is_the_loop_of_the_page():
    rng = np.random.default_rng(3)
    value, root = rng.normal(size=(6, 4, 2)), rng.normal(size=(6, 4, 2, 2))
    cov = root @ root.swapaxes(-1, -2) + 0.1 * np.eye(2)
    white = [
        [
            scipy.linalg.solve_triangular(np.linalg.cholesky(cov[k, i]), value[k, i], lower=True)
            for i in range(4)
        ]
        for k in range(6)
    ]
    result = autocorrelation(Innovations(value, cov), 3)
    for lag in (1, 2, 3):
        products = [white[k][i] @ white[k + lag][i] / 2 for k in range(6 - lag) for i in range(4)]
        assert_allclose(result.value[lag - 1], np.mean(products), rtol=1e-12, atol=1e-14)
        assert_allclose(
            result.standard_deviation[lag - 1], 1 / np.sqrt(2 * len(products)), rtol=1e-14
        )


# ---------------------------------------------------------------- alarms


def test_the_alarms_are_the_sums_of_the_page():
    rng = np.random.default_rng(10)
    nu, steps = rng.normal(size=(40, 30, 2)), 40
    ours = alarms(Innovations(1.1 * nu, np.eye(2)), 0.8)
    expected = np.zeros((3, 30), dtype=bool)
    for i in range(30):
        s = 1.1 * nu[:, i]
        total = sum(float(row @ row) for row in s)
        s = s / np.sqrt(total / (2 * steps))
        neighbours = sum(s[k] @ s[k + 1] for k in range(steps - 1))
        expected[0, i] = (
            not scipy.stats.chi2.ppf(0.1, 2 * steps)
            <= total
            <= scipy.stats.chi2.ppf(0.9, 2 * steps)
        )
        expected[1, i] = s.sum(axis=0) @ s.sum(axis=0) / steps > scipy.stats.chi2.ppf(0.8, 2)
        expected[2, i] = neighbours**2 / (2 * (steps - 1)) > scipy.stats.chi2.ppf(0.8, 1)
    assert (
        np.array_equal(ours, expected)
        and expected.any(axis=1).all()
        and not expected.all(axis=1).any()
    )


# ---------------------------------------------------------------- predictions


def test_a_confidence_ellipse_is_a_level_of_the_chi_squared_law():
    law = Gaussian(np.array([3.0, -1.0]), np.array([[2.0, 1.9], [1.9, 2.0]]))
    off = (confidence_ellipse(law, 0.9, points=7) - law.mean[:, None]).T
    level = np.einsum("ki,ij,kj->k", off, np.linalg.inv(law.cov), off)
    # an inverse of condition 40
    assert_allclose(level, scipy.stats.chi2.ppf(0.9, 2), rtol=1e-12)


# ---------------------------------------------------------------- what is refused

WHOLE = Innovations(np.zeros((4, 2, 1)), np.ones((1, 1)))
HOLED = WHOLE._replace(value=np.where(np.arange(4) == 2, np.nan, 0.0)[:, None, None])
STANDARD = Gaussian(np.zeros(2), np.eye(2))


@pytest.mark.parametrize(
    ("call", "problem"),
    [
        (
            lambda: nees(np.ones((3, 2)), STANDARD._replace(cov=np.diag([1.0, 0.0]))),
            "leave out the components that the filter knows exactly",
        ),
        *(
            (
                lambda given=given: chi_squared_bounds(*given),
                "expected degrees >= 1, runs >= 1 and 0 < confidence < 1",
            )
            for given in ((0, 5), (2, 5, 95))
        ),
        *(
            (lambda lags=lags: autocorrelation(WHOLE, lags), "lags must be between 1 and 3")
            for lags in (0, 4)
        ),
        (lambda: autocorrelation(HOLED, 1), "measurements at every step"),
        (lambda: confidence_ellipse(STANDARD, 1), r"between 0 and 1, got a mean .* and 1"),
        (
            lambda: confidence_ellipse(Gaussian(np.zeros(3), np.eye(3))),
            r"two components of one run.* got a mean \(3,\)",
        ),
    ],
)
def test_what_cannot_be_tested_is_refused(call, problem):
    with pytest.raises(ValueError, match=problem):
        call()
