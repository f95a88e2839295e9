"""The shared linear algebra: gains, corrections, regressions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import multivariate_normal

from kfcourse import Gaussian
from kfcourse.filters.designed import Scatter
from kfcourse.laws import (
    Measurement,
    NegativeVariance,
    apply,
    correct,
    gain,
    is_covariance,
    log_density,
    product,
    square_root,
    transpose,
)


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def covariances(rng, runs, size):
    root = rng.normal(size=(runs, size, size))
    return root @ root.swapaxes(1, 2) + 0.1 * np.eye(size)


def test_among_many_matrices_a_singular_broken_or_unknown_one_does_not_disturb_the_others(rng):
    cov, cross = covariances(rng, 9, 3), rng.normal(size=(9, 2, 3))
    expected, others = gain(cross, cov), np.arange(9) != 7
    for bad in (np.diag([1.0, 0.0, 2.0]), np.ones((3, 3)), -np.eye(3), np.full((3, 3), np.nan)):
        cov[7] = bad
        assert_allclose(
            gain(cross, cov, broken=True)[others], expected[others], rtol=1e-10, atol=1e-10
        )


@pytest.mark.parametrize("cov", [[[-1.0]], [[1.0, 0.0], [0.0, -1.0]], [[[1.0]], [[-1e-300]]]])
def test_a_negative_variance_is_refused(cov):
    cov = np.array(cov)
    with pytest.raises(NegativeVariance, match="must not be negative"):
        gain(np.ones((1, cov.shape[-1])), cov)


@pytest.mark.parametrize("rounding", [0, 2e-15, 5e-15])
def test_a_covariance_that_is_singular_but_for_rounding_is_singular(rounding):
    """y2 = 2 y1 with a few roundings between them: a difference that is noise must not carry the
    estimate.

    Solving would put all weight on one of the two, or a large weight of either sign on both; the
    pseudo-inverse shares it.
    """
    cov = np.array([[1.0, 2.0], [2.0, 4.0 * (1 + rounding)]])
    K = gain(np.array([[1.0, 2.0]]), cov)
    # The rounding, 5e-15, against the variance 2 of the sum of the standardised pair.
    assert_allclose(K * [1, 2], np.full((1, 2), 0.5), rtol=1e-12)


def measurement(G, R, prior):
    explained = product(product(G, prior.cov), transpose(G))
    return Measurement(np.zeros(G.shape[:-1]), G, explained + R, R)


@pytest.mark.parametrize(("n", "p"), [(1, 1), (2, 1), (1, 2), (2, 2), (3, 2)])
def test_the_correction_is_the_conditional_law(rng, n, p):
    prior = Gaussian(rng.normal(size=(8, n)), covariances(rng, 8, n))
    G, R, y = rng.normal(size=(8, p, n)), covariances(rng, 8, p), rng.normal(size=(8, p))
    posterior = correct(prior, measurement(G, R, prior), y)
    # information form: an algebraically different route
    information = np.linalg.inv(prior.cov) + transpose(G) @ np.linalg.inv(R) @ G
    cov = np.linalg.inv(information)
    gained = cov @ transpose(G) @ np.linalg.inv(R)
    assert_allclose(posterior.cov, cov, rtol=1e-10, atol=1e-10)
    assert_allclose(posterior.mean, prior.mean + apply(gained, y), rtol=1e-10, atol=1e-10)
    assert np.array_equal(posterior.cov, transpose(posterior.cov))


@pytest.mark.parametrize(("n", "p"), [(1, 1), (2, 1), (2, 2)])
def test_a_meter_that_sees_nothing_leaves_the_prior(rng, n, p):
    # No sensitivity and no variance either (a square meter linearised at 0): K = 0 and p = Psi.
    prior = Gaussian(rng.normal(size=(3, n)), covariances(rng, 3, n))
    blind = Measurement(
        np.zeros((3, p)), np.zeros((3, p, n)), np.zeros((3, p, p)), np.zeros((3, p, p))
    )
    posterior = correct(prior, blind, np.ones((3, p)))
    assert_array_equal(posterior.mean, prior.mean)
    assert_allclose(posterior.cov, prior.cov, rtol=1e-15)


@pytest.mark.parametrize("sharpness", [1e-8, 1e-16, 1e-24])
@pytest.mark.parametrize("n", [1, 2])
def test_a_sharp_meter_leaves_a_positive_variance_with_its_digits(sharpness, n):
    prior = Gaussian(np.zeros((1, n)), np.eye(n)[None])
    G, R = np.eye(n)[None], sharpness * np.eye(n)[None]
    posterior = correct(prior, measurement(G, R, prior), np.ones((1, n)))
    expected = sharpness / (1 + sharpness)
    # Joseph's form adds (1 - K)^2 Psi, K rounded to 1e-16: an absolute 1e-32 beside the 1e-24 of
    # the sharpest.
    assert_allclose(posterior.cov[0], expected * np.eye(n), rtol=1e-7, atol=1e-7 * sharpness)


@pytest.mark.parametrize(
    "cov",
    [
        np.diag([2.0, 0.0]),
        np.ones((2, 2)),
        # an eigenvalue of -4e-16: singular, but for rounding
        np.array([[1.0, 1 + 4e-16], [1 + 4e-16, 1.0]]),
        np.zeros((2, 2)),
        np.array([[2.0, 1e-5], [1e-5, 1e-9]]),
    ],
)
def test_the_square_root_squares_to_the_covariance(cov):
    root = square_root(cov)
    # rounding relative to the largest eigenvalue
    assert_allclose(root @ root.T, cov, atol=1e-15 * 2)


@pytest.mark.parametrize(("r", "s"), [(1, 1), (2, 1), (1, 2), (2, 3)])
def test_a_regression_is_least_squares(rng, r, s):
    regressor = rng.normal(size=(60, s)) @ rng.normal(size=(s, s)) + 3
    target = regressor @ rng.normal(size=(s, r)) + rng.normal(size=(60, r)) - 2
    fit = Scatter.of(target, regressor).regression()
    # of notebooks handed out earlier
    assert np.array_equal(Scatter.of(target, regressor).regression(r).matrix, fit.matrix)
    design = np.column_stack([regressor, np.ones(60)])
    solution, *_ = np.linalg.lstsq(design, target, rcond=None)
    assert_allclose(fit.matrix, solution[:s].T, rtol=1e-9, atol=1e-9)
    assert_allclose(fit.offset, solution[s], rtol=1e-9, atol=1e-9)
    residual = target - design @ solution
    assert_allclose(fit.residual, residual.T @ residual / 60, rtol=1e-9, atol=1e-9)
    assert_allclose(fit(regressor), design @ solution, rtol=1e-9, atol=1e-9)


def test_large_means_do_not_cancel(rng):
    target, regressor = rng.normal(size=(60, 2)) + 1e6, rng.normal(size=(60, 2)) - 1e5
    scatter = Scatter.of(target, regressor).scatter
    # Means of size 1e6 are rounded to 1e-10; deviations from them are of order 1.
    assert_allclose(
        scatter, 60 * np.cov(np.hstack([target, regressor]).T, bias=True), rtol=1e-7, atol=1e-7
    )


def test_a_perfect_regression_leaves_no_negative_variance(rng):
    # Cov(t) - matrix Cov(t, r)^T is a difference of equal numbers, and its rounding must not become
    # a variance below 0.
    for _ in range(50):
        regressor = rng.normal(size=(30, 2))
        target = regressor @ rng.normal(size=(2, 2))
        fit = Scatter.of(target, regressor).regression()
        assert (np.diagonal(fit.residual) >= 0).all()
        # Rounding of sums of 30 products and of a solution whose condition is below 1e2.
        assert abs(fit.residual).max() < 1e-13 * target.var(axis=0).sum()
        assert (
            Scatter.of(0.7 * regressor[:, :1], regressor[:, :1]).regression().residual.item() >= 0
        )


def test_the_log_density_is_the_normal_law_s_of_what_was_measured():
    F = np.array([[2.0, 0.6], [0.6, 1.0]])
    h, y = np.array([[1.0, -1.0]]), np.array([[0.3, 0.2]])
    measurement = Measurement(h, np.zeros((2, 2)), F, F)
    expected = multivariate_normal(h[0], F).logpdf(y[0])
    assert log_density(measurement, y) == pytest.approx([expected])
    y[0, 0] = np.nan
    assert log_density(measurement, y) == pytest.approx([-0.5 * (1.2**2 / 1.0 + np.log(2 * np.pi))])
    assert log_density(measurement, np.full((1, 2), np.nan)) == pytest.approx([0.0])


@pytest.mark.parametrize(
    ("cov", "right"),
    [
        ([[1.0, 0.5], [0.5, 1.0]], True),
        ([[1.0, 1.0], [1.0, 1.0]], True),  # singular
        ([[0.0, 0.0], [0.0, 1.0]], True),
        ([[1.0, 1.5], [1.5, 1.0]], False),
        ([[0.0, 0.1], [0.1, 1.0]], False),  # what does not vary is correlated with nothing
        ([[1e10, 0.0], [0.0, -1e-3]], False),  # not to be taken for rounding of the other component
        ([[1e10, 1.001], [1.001, 1e-10]], False),  # a correlation above 1, in very different units
        ([[1e10, 1.0], [1.0, 1e-10]], True),
    ],
)
def test_a_covariance_is_one_in_any_units(cov, right):
    assert is_covariance(np.array(cov)) is right
