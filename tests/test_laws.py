"""The shared linear algebra: gains, corrections, regressions."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from kfcourse.filters.designed import Scatter
from kfcourse.laws import (
    Gaussian,
    Measurement,
    NegativeVariance,
    apply,
    correct,
    gain,
    log_density,
    product,
    square_root,
    symmetric,
    transpose,
)

pytestmark = pytest.mark.quick


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def covariances(rng, runs, size):
    root = rng.normal(size=(runs, size, size))
    return root @ root.swapaxes(1, 2) + 0.1 * np.eye(size)


@pytest.mark.parametrize(("n", "p"), [(1, 1), (2, 1), (1, 2), (3, 2), (2, 3)])
def test_the_products_are_matrix_products(rng, n, p):
    left, right, vector = rng.normal(size=(7, n, p)), rng.normal(size=(7, p, n)), rng.normal(size=(7, p))
    np.testing.assert_allclose(apply(left, vector), np.einsum("kij,kj->ki", left, vector), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(product(left, right), np.einsum("kij,kjl->kil", left, right), rtol=1e-13, atol=1e-13)
    np.testing.assert_array_equal(transpose(left), np.einsum("kij->kji", left))
    np.testing.assert_allclose(apply(left[0], vector), vector @ left[0].T, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize(("n", "p"), [(1, 1), (2, 1), (1, 2), (3, 3)])
def test_the_gain_solves_its_equation(rng, n, p):
    cov, cross = covariances(rng, 9, p), rng.normal(size=(9, n, p))
    # condition numbers up to 1e3 here
    np.testing.assert_allclose(product(gain(cross, cov), cov), cross, rtol=1e-11, atol=1e-11)


def test_among_many_matrices_a_singular_broken_or_unknown_one_does_not_disturb_the_others(rng):
    cov, cross = covariances(rng, 9, 3), rng.normal(size=(9, 2, 3))
    expected, others = gain(cross, cov), np.arange(9) != 7
    for bad in (np.diag([1.0, 0.0, 2.0]), np.ones((3, 3)), -np.eye(3), np.full((3, 3), np.nan)):
        cov[7] = bad
        np.testing.assert_allclose(gain(cross, cov, broken=True)[others], expected[others], rtol=1e-10, atol=1e-10)
    with pytest.raises(NegativeVariance):
        gain(cross, -np.abs(cov))


@pytest.mark.parametrize("ratio", [1e8, 1e12, 1e16])
@pytest.mark.parametrize("p", [2, 3])
def test_equal_components_of_one_quantity_share_their_information_whatever_the_prior(ratio, p):
    """Each of them adds 1/r to the information 1/P: after k steps the variance is 1 / (1/P + k p / r).

    The variance is a small difference, so the gain must be backward stable: its error, 1e-16 along the direction in which
    the measurements agree, is squared and multiplied by P in Joseph's form.
    """
    r = 1e-4
    law, G, R = Gaussian(np.zeros((1, 1)), np.full((1, 1, 1), ratio * r)), np.ones((1, p, 1)), r * np.eye(p)[None]
    for k, level in enumerate((100.0, 80.0, 80.0), 1):
        law = correct(law, measurement(G, R, law)._replace(h=np.tile(law.mean, p)), level + np.arange(p)[None])
        np.testing.assert_allclose(law.cov.item(), 1 / (1 / (ratio * r) + k * p / r), rtol=1e-7)
    # F holds r to 1e-16 of P, and no more: the weights are so wrong that the components share, squared in the variance
    np.testing.assert_allclose(law.mean.item(), 260 / 3 + (p - 1) / 2, rtol=1e-5)


def test_the_gain_does_not_depend_on_units(rng):
    cov, cross, units = covariances(rng, 4, 3), rng.normal(size=(4, 2, 3)), np.array([1e-9, 1.0, 1e8])
    scaled = gain(cross * units, cov * units[:, None] * units)
    np.testing.assert_allclose(scaled * units, gain(cross, cov), rtol=1e-11, atol=1e-11)


def test_where_nothing_can_vary_the_gain_is_zero():
    assert np.array_equal(gain(np.zeros((3, 1, 1)), np.array([0.0, 1.0, 2.0])[:, None, None]), np.zeros((3, 1, 1)))
    cov = np.array([[[2.0, 0.0], [0.0, 0.0]]])
    np.testing.assert_allclose(gain(np.array([[[1.0, 0.0]]]), cov), [[[0.5, 0.0]]], rtol=1e-14)
    assert np.array_equal(gain(np.zeros((1, 2, 2)), np.zeros((1, 2, 2))), np.zeros((1, 2, 2)))


@pytest.mark.parametrize("p", [1, 2])
def test_a_gain_of_nan_is_nan_and_the_others_do_not_notice(rng, p):
    cov, cross = covariances(rng, 5, p), rng.normal(size=(5, 2, p))
    expected = gain(cross, cov)
    cov[3, 0, 0] = np.nan
    found = gain(cross, cov)
    assert np.isnan(found[3]).all()
    others = [0, 1, 2, 4]
    np.testing.assert_allclose(found[others], expected[others], rtol=1e-11, atol=1e-11)  # condition numbers up to 1e3
    assert np.isnan(gain(np.ones((1, 1)), np.array([[np.nan]]))).all()


@pytest.mark.parametrize("cov", [[[-1.0]], [[1.0, 0.0], [0.0, -1.0]], [[[1.0]], [[-1e-300]]]])
def test_a_negative_variance_is_refused(cov):
    cov = np.array(cov)
    with pytest.raises(ValueError, match="must not be negative"):
        gain(np.ones((1, cov.shape[-1])), cov)


def test_an_unknown_variance_gives_an_unknown_correction():
    prior = Gaussian(np.zeros((2, 1)), np.ones((2, 1, 1)))
    F = np.array([[[np.nan]], [[2.0]]])
    posterior = correct(prior, Measurement(np.zeros((2, 1)), np.ones((2, 1, 1)), F, F - 1), np.ones((2, 1)))
    assert np.isnan(posterior.mean[0, 0])
    assert np.isnan(posterior.cov[0, 0, 0])
    np.testing.assert_allclose((posterior.mean[1, 0], posterior.cov[1, 0, 0]), 0.5, rtol=1e-15)


def test_where_a_filter_has_broken_down_a_negative_variance_is_divided_by(rng):
    cov = covariances(rng, 3, 2)
    cross = rng.normal(size=(3, 2, 2))
    cov[1, 1, 1] = -1.0
    np.testing.assert_allclose(gain(cross, cov, broken=True), cross @ np.linalg.inv(cov), rtol=1e-11, atol=1e-11)  # as above
    variances = np.array([[[-1.0]], [[2.0]], [[0.0]]])
    np.testing.assert_array_equal(gain(np.ones((3, 1, 1)), variances, broken=True)[:, 0, 0], [-1.0, 0.5, 0.0])


@pytest.mark.parametrize(("n", "p"), [(2, 1), (3, 1), (3, 2)])
def test_a_correction_adds_its_information_also_to_a_covariance_that_is_none(rng, n, p):
    """p^-1 = Psi^-1 + G^T R^-1 G needs no sign of Psi: a broken filter finds back, unless its corrections stop."""
    root, signs = rng.normal(size=(6, n, n)), np.array([1.0] * (n - 1) + [-1.0])
    prior = Gaussian(rng.normal(size=(6, n)), symmetric(root @ (signs[:, None] * transpose(root))))
    G, R, y = rng.normal(size=(6, p, n)), covariances(rng, 6, p), rng.normal(size=(6, p))
    meter = measurement(G, R, prior)
    assert (np.linalg.eigvalsh(meter.F)[:, 0] < 0).any()  # else nothing is tested
    found = correct(prior, meter, y)
    information = transpose(G) @ np.linalg.inv(R) @ G
    cov = np.linalg.inv(np.linalg.inv(prior.cov) + information)
    # condition numbers up to 1e4 here
    np.testing.assert_allclose(found.cov, cov, rtol=1e-8, atol=1e-8 * abs(cov).max())
    np.testing.assert_allclose(found.mean, prior.mean + apply(cov @ transpose(G) @ np.linalg.inv(R), y), rtol=1e-8, atol=1e-8)


def test_one_variance_that_a_rule_of_quadrature_made_negative_corrects_nothing():
    prior = Gaussian(np.zeros((2, 1)), np.ones((2, 1, 1)))
    F = np.array([[[-1.0]], [[2.0]]])
    posterior = correct(prior, Measurement(np.zeros((2, 1)), np.ones((2, 1, 1)), F, F - 1), np.ones((2, 1)))
    np.testing.assert_array_equal(posterior.mean[:, 0], [0.0, 0.5])
    np.testing.assert_array_equal(posterior.cov[:, 0, 0], [1.0, 0.5])


def test_a_variance_that_is_small_in_its_units_tells():
    # Var = 1e-32 beside 1: 1e-16 of a unit is much of another, and only the maker of the covariance knows which
    np.testing.assert_allclose(gain(np.array([[0.5, 1e-17]]), np.diag([1.0, 1e-32])), [[0.5, 1e15]], rtol=1e-14)


def test_a_singular_covariance_gets_its_pseudo_inverse(rng):
    # y2 = 2 y1: the gain of least norm in units of the standard deviations gives both the same weight.
    cov = np.array([[1.0, 2.0], [2.0, 4.0]])
    K = gain(np.array([[1.0, 2.0]]), cov)
    np.testing.assert_allclose(K @ cov, [[1.0, 2.0]], rtol=1e-12)
    np.testing.assert_allclose(K * [1, 2], np.full((1, 2), 0.5), rtol=1e-12)


def test_beside_a_singular_trajectory_a_nearly_singular_one_keeps_its_solution():
    """The pseudo-inverse takes the place of the solution for all of them, and drops rounding, not a correlation of 1 - 1e-9."""
    cov = np.array([[[1.0, 1.0], [1.0, 1.0]], [[1.0, 1 - 1e-9], [1 - 1e-9, 1.0]]])
    cross = np.array([[[1.0, 1.0]], [[1.0, 1 - 1e-9]]])
    K = gain(cross, cov)
    np.testing.assert_allclose(K[0], [[0.5, 0.5]], rtol=1e-12)
    np.testing.assert_allclose(K[1], [[1.0, 0.0]], rtol=0, atol=1e-6)  # rounding, 1e-16, over the smaller eigenvalue, 1e-9


@pytest.mark.parametrize("rounding", [0, 2e-15, 5e-15])
def test_a_covariance_that_is_singular_but_for_rounding_is_singular(rounding):
    """y2 = 2 y1 with a few roundings between them: a difference that is noise must not carry the estimate.

    Solving would put all weight on one of the two, or a large weight of either sign on both; the pseudo-inverse shares it.
    """
    cov = np.array([[1.0, 2.0], [2.0, 4.0 * (1 + rounding)]])
    K = gain(np.array([[1.0, 2.0]]), cov)
    # The rounding, 5e-15, against the variance 2 of the sum of the standardised pair.
    np.testing.assert_allclose(K * [1, 2], np.full((1, 2), 0.5), rtol=1e-12)


def test_one_singular_trajectory_does_not_disturb_the_others(rng):
    cov, cross = covariances(rng, 6, 2), rng.normal(size=(6, 2, 2))
    expected = gain(cross, cov)
    cov[2] = [[1.0, 1.0], [1.0, 1.0]]
    cross[2] = [[1.0, 1.0], [0.5, 0.5]]
    found = gain(cross, cov)
    others = [0, 1, 3, 4, 5]
    # By the pseudo-inverse of eigenvalues instead of a solution: condition numbers up to 1e3.
    np.testing.assert_allclose(found[others], expected[others], rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(found[2] @ cov[2], cross[2], rtol=1e-12)


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
    np.testing.assert_allclose(posterior.cov, cov, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(posterior.mean, prior.mean + apply(gained, y), rtol=1e-10, atol=1e-10)
    assert np.array_equal(posterior.cov, transpose(posterior.cov))


@pytest.mark.parametrize(("n", "p"), [(1, 1), (2, 1), (1, 2), (3, 2)])
@pytest.mark.parametrize("gap", [False, True])
def test_the_ensemble_may_have_several_axes(rng, n, p, gap):
    """Leading axes only number the trajectories: 8 in a row, or 2 by 4, are corrected alike."""
    prior = Gaussian(rng.normal(size=(8, n)), covariances(rng, 8, n))
    meter, y = measurement(rng.normal(size=(8, p, n)), covariances(rng, 8, p), prior), rng.normal(size=(8, p))
    if gap:
        y[5, 0] = np.nan

    def folded(arrays):
        return [array.reshape(2, 4, *array.shape[1:]) for array in arrays]

    found = correct(Gaussian(*folded(prior)), Measurement(*folded(meter)), *folded([y]))
    for array, expected in zip(found, folded(correct(prior, meter, y)), strict=True):
        np.testing.assert_allclose(array, expected, rtol=1e-13, atol=1e-14)  # the same products, perhaps added in another order


@pytest.mark.parametrize(("n", "p"), [(1, 1), (2, 1), (2, 2)])
def test_a_meter_that_sees_nothing_leaves_the_prior(rng, n, p):
    # No sensitivity and no variance either (a square meter linearised at 0): K = 0 and p = Psi.
    prior = Gaussian(rng.normal(size=(3, n)), covariances(rng, 3, n))
    blind = Measurement(np.zeros((3, p)), np.zeros((3, p, n)), np.zeros((3, p, p)), np.zeros((3, p, p)))
    posterior = correct(prior, blind, np.ones((3, p)))
    np.testing.assert_array_equal(posterior.mean, prior.mean)
    np.testing.assert_allclose(posterior.cov, prior.cov, rtol=1e-15)


@pytest.mark.parametrize("n", [1, 2])
def test_one_blind_trajectory_does_not_disturb_the_others(rng, n):
    prior = Gaussian(rng.normal(size=(4, n)), covariances(rng, 4, n))
    G, R, y = rng.normal(size=(4, 1, n)), covariances(rng, 4, 1), rng.normal(size=(4, 1))
    expected = correct(prior, measurement(G, R, prior), y)
    G[2], R[2] = 0, 0
    found = correct(prior, measurement(G, R, prior), y)
    others = [0, 1, 3]
    for array, alone, before in zip(found, expected, prior, strict=True):
        np.testing.assert_allclose(array[others], alone[others], rtol=1e-14)  # scalars multiply what they else divide
        np.testing.assert_array_equal(array[2], before[2])


def test_an_exact_meter_leaves_no_variance(rng):
    prior = Gaussian(np.array([[1.0]]), np.array([[[2.0]]]))
    posterior = correct(prior, measurement(np.array([[[3.0]]]), np.array([[[0.0]]]), prior), np.array([[6.0]]))
    np.testing.assert_allclose(posterior.mean, [[3.0]], rtol=1e-15)  # 1 + (2 * 3 / 18) * 6
    np.testing.assert_array_equal(posterior.cov, [[[0.0]]])


@pytest.mark.parametrize("sharpness", [1e-8, 1e-16, 1e-24])
@pytest.mark.parametrize("n", [1, 2])
def test_a_sharp_meter_leaves_a_positive_variance_with_its_digits(sharpness, n):
    prior = Gaussian(np.zeros((1, n)), np.eye(n)[None])
    G, R = np.eye(n)[None], sharpness * np.eye(n)[None]
    posterior = correct(prior, measurement(G, R, prior), np.ones((1, n)))
    expected = sharpness / (1 + sharpness)
    # Joseph's form adds (1 - K)^2 Psi, K rounded to 1e-16: an absolute 1e-32 beside the 1e-24 of the sharpest.
    np.testing.assert_allclose(posterior.cov[0], expected * np.eye(n), rtol=1e-7, atol=1e-7 * sharpness)


@pytest.mark.parametrize("p", [1, 2])
def test_a_missing_measurement_changes_nothing_and_the_others_do_not_notice(rng, p):
    prior = Gaussian(rng.normal(size=(5, 2)), covariances(rng, 5, 2))
    meter, y = measurement(rng.normal(size=(5, p, 2)), covariances(rng, 5, p), prior), rng.normal(size=(5, p))
    complete = correct(prior, meter, y)
    y[3] = np.nan
    posterior = correct(prior, meter, y)
    np.testing.assert_array_equal(posterior.mean[3], prior.mean[3])
    np.testing.assert_allclose(posterior.cov[3], prior.cov[3], rtol=1e-15)
    others = [0, 1, 2, 4]
    np.testing.assert_array_equal(posterior.mean[others], complete.mean[others])
    np.testing.assert_array_equal(posterior.cov[others], complete.cov[others])


def test_a_missing_component_is_a_meter_without_it(rng):
    prior = Gaussian(rng.normal(size=(4, 2)), covariances(rng, 4, 2))
    G, R, y = rng.normal(size=(4, 2, 2)), covariances(rng, 4, 2), rng.normal(size=(4, 2))
    alone = correct(prior, measurement(G[:, 1:], R[:, 1:, 1:], prior), y[:, 1:])
    y[:, 0] = np.nan
    posterior = correct(prior, measurement(G, R, prior), y)
    np.testing.assert_allclose(posterior.mean, alone.mean, rtol=1e-12)
    np.testing.assert_allclose(posterior.cov, alone.cov, rtol=1e-12)


@pytest.mark.parametrize(
    "cov",
    [
        np.diag([2.0, 0.0]),
        np.ones((2, 2)),
        np.array([[1.0, 1 + 4e-16], [1 + 4e-16, 1.0]]),  # an eigenvalue of -4e-16: singular, but for rounding
        np.zeros((2, 2)),
        np.array([[2.0, 1e-5], [1e-5, 1e-9]]),
    ],
)
def test_the_square_root_squares_to_the_covariance(cov):
    root = square_root(cov)
    np.testing.assert_allclose(root @ root.T, cov, atol=1e-15 * 2)  # rounding relative to the largest eigenvalue


def test_symmetric_is_symmetric(rng):
    matrix = rng.normal(size=(4, 3, 3))
    assert np.array_equal(symmetric(matrix), transpose(symmetric(matrix)))


@pytest.mark.parametrize(("r", "s"), [(1, 1), (2, 1), (1, 2), (2, 3)])
def test_a_regression_is_least_squares(rng, r, s):
    regressor = rng.normal(size=(60, s)) @ rng.normal(size=(s, s)) + 3
    target = regressor @ rng.normal(size=(s, r)) + rng.normal(size=(60, r)) - 2
    fit = Scatter.of(target, regressor).regression()
    assert np.array_equal(Scatter.of(target, regressor).regression(r).matrix, fit.matrix)  # of notebooks handed out earlier
    design = np.column_stack([regressor, np.ones(60)])
    solution, *_ = np.linalg.lstsq(design, target, rcond=None)
    np.testing.assert_allclose(fit.matrix, solution[:s].T, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(fit.offset, solution[s], rtol=1e-9, atol=1e-9)
    residual = target - design @ solution
    np.testing.assert_allclose(fit.residual, residual.T @ residual / 60, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(fit(regressor), design @ solution, rtol=1e-9, atol=1e-9)


def test_large_means_do_not_cancel(rng):
    target, regressor = rng.normal(size=(60, 2)) + 1e6, rng.normal(size=(60, 2)) - 1e5
    found = Scatter.of(target, regressor).scatter
    # Means of size 1e6 are rounded to 1e-10; deviations from them are of order 1.
    np.testing.assert_allclose(found, 60 * np.cov(np.hstack([target, regressor]).T, bias=True), rtol=1e-7, atol=1e-7)


def test_a_constant_regressor_predicts_the_mean(rng):
    target = rng.normal(size=(20, 1))
    fit = Scatter.of(target, np.full((20, 1), 0.5)).regression()
    np.testing.assert_allclose(fit(np.array([[0.5], [7.0]])), np.full((2, 1), target.mean()), rtol=1e-14)
    np.testing.assert_allclose(fit.residual, [[target.var()]], rtol=1e-14)


def test_one_trajectory_is_a_regression_on_a_constant():
    fit = Scatter.of(np.array([[2.0]]), np.array([[3.0]])).regression()
    assert (fit.matrix.item(), fit.offset.item(), fit.residual.item()) == (0.0, 2.0, 0.0)


@pytest.mark.parametrize("count", [8191, 8192, 8193, 20_000])
def test_long_sums_are_cut_without_loss(rng, count):
    column = rng.normal(size=(count, 1))
    np.testing.assert_allclose(Scatter.of(column, column).scatter, np.full((2, 2), count * column.var()), rtol=1e-11)


def test_a_perfect_regression_leaves_no_negative_variance(rng):
    # Cov(t) - matrix Cov(t, r)^T is a difference of equal numbers, and its rounding must not become a variance below 0.
    for _ in range(50):
        regressor = rng.normal(size=(30, 2))
        target = regressor @ rng.normal(size=(2, 2))
        fit = Scatter.of(target, regressor).regression()
        assert (np.diagonal(fit.residual) >= 0).all()
        # Rounding of sums of 30 products and of a solution whose condition is below 1e2.
        assert abs(fit.residual).max() < 1e-13 * target.var(axis=0).sum()
        assert Scatter.of(0.7 * regressor[:, :1], regressor[:, :1]).regression().residual.item() >= 0


def test_the_log_density_is_the_normal_law_s_of_what_was_measured():
    F = np.array([[2.0, 0.6], [0.6, 1.0]])
    h, y = np.array([[1.0, -1.0]]), np.array([[0.3, 0.2]])
    measurement = Measurement(h, np.zeros((2, 2)), F, F)
    expected = multivariate_normal(h[0], F).logpdf(y[0])
    assert log_density(measurement, y) == pytest.approx([expected])
    y[0, 0] = np.nan
    assert log_density(measurement, y) == pytest.approx([-0.5 * (1.2**2 / 1.0 + np.log(2 * np.pi))])
    assert log_density(measurement, np.full((1, 2), np.nan)) == pytest.approx([0.0])
