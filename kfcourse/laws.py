"""Normal laws, their correction by a measurement, and the little linear algebra that every filter
shares.

Shapes: vectors are (..., n), matrices (..., r, c); the leading axes run over the ensemble, and an
array without them is the same for every trajectory.  Scalar models keep their axes of length 1;
for them the products below are plain multiplications, which is what makes the engine fast.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from kfcourse.angles import Components, difference

Array: TypeAlias = NDArray[Any]
Vectors: TypeAlias = Array  # (..., n)
Matrices: TypeAlias = Array  # (..., r, c)
CONFIDENCE = 0.95  # of intervals, ellipses and tests, where nothing else is asked for


class NegativeVariance(ValueError):
    """What should be a covariance has a negative variance."""


class Gaussian(NamedTuple):
    """A normal law N(mean, cov): mean (..., n), cov (..., n, n)."""

    mean: Vectors
    cov: Matrices


class Measurement(NamedTuple):
    """What a correction must know of the meter: its structural functions at N(m, d).

    h (..., p), G (..., p, n), F (..., p, p): mean of y, its sensitivity dh/dm, covariance of y.

    R = F - G d G^T, (..., p, p), is the part of F that the state does not explain.  It is derived,
    not subtracted: where the meter is far sharper than the prediction the difference would be
    rounding.
    """

    h: Vectors
    G: Matrices
    F: Matrices
    R: Matrices

    def innovation(self, y: Vectors) -> Vectors:
        """y - h, (..., p); for components that are angles the short way round."""
        return y - self.h


class Transition(NamedTuple):
    """What looking back must know of the object beside tau and Theta: its structural functions at
    N(z, p), like G and R.

    A (..., n, n), Q (..., n, n): the sensitivity dtau/dz of the next state's mean, and Q = Theta -
    A p A^T, the part of its covariance that this state does not explain.  Q is derived, not
    subtracted, as R is.
    """

    A: Matrices
    Q: Matrices


@cache
def measurement_of(angles: Components) -> type[Measurement]:
    """`Measurement`, or one whose innovations know which components are angles."""
    if not angles:
        return Measurement

    class AngularMeasurement(Measurement):
        __slots__ = ()

        def innovation(self, y: Vectors) -> Vectors:
            return difference(y, self.h, angles)

    return AngularMeasurement


def apply(matrix: Matrices, vector: Vectors) -> Vectors:
    """matrix @ vector: (..., r, c), (..., c) -> (..., r)."""
    if matrix.shape[-2:] == (1, 1):
        return matrix[..., 0] * vector
    # of many small matrices twice as fast as their products
    return np.einsum("...ij,...j", matrix, vector)


def product(left: Matrices, right: Matrices) -> Matrices:
    """left @ right: (..., r, m), (..., m, c) -> (..., r, c)."""
    if left.shape[-2:] == (1, 1) == right.shape[-2:]:
        return left * right
    return left @ right


def transpose(matrix: Matrices) -> Matrices:
    """The transpose of the last two axes, row by row in memory: products of many small matrices are
    then twice as fast."""
    return matrix if matrix.shape[-2:] == (1, 1) else np.ascontiguousarray(matrix.swapaxes(-1, -2))


def symmetric(matrix: Matrices) -> Matrices:
    """(P + P^T) / 2: rounding must not make a covariance asymmetric."""
    return matrix if matrix.shape[-1] == 1 else 0.5 * (matrix + transpose(matrix))


def gain(cross: Matrices, cov: Matrices, broken: bool = False) -> Matrices:
    """The regression gain cross cov^+, the solution K of K cov = cross of least norm.

    Parameters
    ----------
    cross : (..., n, p)
        Cov(x, y).
    cov : (..., p, p)
        Cov(y), symmetric and non-negative; where it is singular the pseudo-inverse takes the place
        of the inverse, so a measurement that cannot vary gets the gain 0.  Where it is NaN the gain
        is NaN. How small a variance may be depends on its units, which are free: 1e-32 is a good
        variance.  A variance that is only rounding must therefore be made 0 where it arises.
    broken : bool
        Whether `cov` comes from a filter whose covariance rounding may have broken.  A negative
        variance is then divided by like any other: P^-1 + H^T R^-1 H holds for every P, so each
        measurement still adds its information, and the filter
        finds back.  A gain of 0 there would stop the corrections for good.

    Raises
    ------
    NegativeVariance
        A variance is negative (beside others, by more than rounding), and not `broken`.
    """
    if cov.shape[-1] == 1:
        if np.minimum.reduce(cov, axis=None) > 0:
            return cross / cov
        if not broken:
            _refuse_negative(cov, 0.0)
        zero = np.zeros(
            np.broadcast_shapes(cross.shape, cov.shape), dtype=np.result_type(cross, cov)
        )
        return np.divide(cross, cov, out=zero, where=cov != 0)
    singular = rounding(cov.dtype)
    # Scaling to correlations first: components may differ by orders of magnitude in size.
    variance = np.diagonal(cov, axis1=-2, axis2=-1)
    scale = np.sqrt(np.abs(variance))
    scale = np.where(scale > 0, scale, 1.0)
    correlation = cov / (scale[..., :, None] * scale[..., None, :])
    scaled_cross = cross / scale[..., None, :]
    try:
        if np.diagonal(np.linalg.cholesky(correlation), axis1=-2, axis2=-1).min() > singular:
            return (
                transpose(np.linalg.solve(correlation, transpose(scaled_cross)))
                / scale[..., None, :]
            )
    except np.linalg.LinAlgError:
        pass
    if not broken:
        _refuse_negative(variance, singular**2)
    unknown = np.isnan(cov).any(axis=(-2, -1), keepdims=True)
    inverse = np.linalg.pinv(np.where(unknown, 0.0, correlation), rcond=singular**2, hermitian=True)
    return np.where(unknown, np.nan, scaled_cross @ inverse / scale[..., None, :])


# A Cholesky pivot of a correlation matrix below this is rounding, in units of the root of the
# precision (1.5e-8 in float64).
SINGULAR = 7.0


@cache
def rounding(dtype: np.dtype[Any]) -> float:
    """A Cholesky pivot of a correlation matrix below this, 1e-7 in float64, is rounding."""
    return SINGULAR * float(np.sqrt(np.finfo(dtype).eps))


def _refuse_negative(variance: Array, rounding: float) -> None:
    """NegativeVariance if a variance is negative by more than this part of the largest."""
    if (variance < -rounding * np.nanmax(variance, initial=0.0)).any():
        raise NegativeVariance(
            f"a covariance has the variance {np.nanmin(variance):.6g}, which must not be negative: "
            "check the formula that it comes from, or give its square root to be multiplied out"
        )


def correct(prior: Gaussian, measurement: Measurement, y: Vectors) -> Gaussian:
    """The correction of the normal (Gaussian) filter, N(lambda, Psi) -> N(z, p).

    K = Psi G^T F^+,   z = lambda + K (y - h),   p = Psi - K G Psi

    K and p as of `regression`.  A trajectory with a missing measurement (NaN) keeps its prior for
    the missing components.
    """
    innovation, (_, G, F, R) = measurement.innovation(y), measurement
    if any_missing(innovation):
        innovation, G, F, R = without_missing(innovation, G, F, R)
    K, cov = regression(prior.cov, G, F, R)
    return Gaussian(prior.mean + apply(K, innovation), cov)


def regression(cov: Matrices, G: Matrices, F: Matrices, R: Matrices) -> tuple[Matrices, Matrices]:
    """The regression of a state with this covariance on y = G x + e, Cov(y) = F, Cov(e) = R: its
    gain, and what y leaves of cov.

    K = `cov` G^T F^+,   `cov` - K G `cov`

    The last is evaluated as (I - K G) cov (I - K G)^T + K R K^T (Joseph's form, with R = F - G cov
    G^T), for scalars as cov R / F: equal, but never negative.  Where rounding has broken the
    covariance F may be negative, and is divided by (see `gain`); of one state and one measurement
    it is negative only if a rule of quadrature made it so, and tells nothing.
    """
    if G.shape[-2:] == (1, 1):
        varies = np.minimum.reduce(F, axis=None) > 0
        share = cov / F if varies else gain(cov, np.maximum(F, 0.0))
        # what cannot vary tells nothing
        return share * G, share * R if varies else np.where(F <= 0, cov, share * R)
    K = gain(product(cov, transpose(G)), F, broken=True)
    rest = np.eye(cov.shape[-1], dtype=cov.dtype) - product(K, G)
    return K, symmetric(
        product(product(rest, cov), transpose(rest)) + product(product(K, R), transpose(K))
    )


def without_missing(
    innovation: Vectors, G: Matrices, F: Matrices, R: Matrices
) -> tuple[Vectors, Matrices, Matrices, Matrices]:
    """Take missing components out: no innovation, no sensitivity, a variance of their own."""
    missing = np.isnan(innovation)
    either = missing[..., :, None] | missing[..., None, :]
    own = np.eye(innovation.shape[-1], dtype=F.dtype)
    return (
        np.where(missing, 0.0, innovation),
        np.where(missing[..., :, None], 0.0, G),
        np.where(either, own, F),
        np.where(either, own, R),
    )


def any_missing(y: Array) -> bool:
    """Whether any entry is NaN: the minimum is then NaN too, and is the fastest pass over an
    array."""
    return bool(np.isnan(np.minimum.reduce(y, axis=None)))


def where_measured(y: Vectors, correction: Vectors) -> Vectors:
    """The correction, or 0 for trajectories whose measurement is missing (NaN)."""
    if any_missing(y):
        return np.where(np.isnan(y).any(axis=-1, keepdims=True), 0.0, correction)
    return correction


def square_root(cov: Matrices) -> Matrices:
    """A matrix S with S S^T = cov, for any non-negative cov (..., n, n), singular or not."""
    values, vectors = np.linalg.eigh(cov)
    return vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]


def is_covariance(cov: Array) -> bool:
    """Whether a symmetric matrix has no negative eigenvalue, in whatever units its components
    are."""
    variances = cov.diagonal()
    scale = 1 / np.sqrt(np.where(variances > 0, variances, 1.0))
    correlations = cov * scale[:, None] * scale
    rounding = 1e-12 * len(cov)  # of eigvalsh, and of a covariance that was itself computed
    return bool((variances >= 0).all() and np.linalg.eigvalsh(correlations).min() >= -rounding)


def normalised_square(vector: Vectors, cov: Matrices) -> Array:
    """vector^T cov^+ vector: (..., n), (..., n, n) -> (...); NaN where a component is NaN.

    Directions in which cov is singular do not enter.
    """
    return apply(gain(vector[..., None, :], cov), vector)[..., 0]


def log_density(measurement: Measurement, y: Vectors) -> Array:
    """Logarithm of the normal density N(y; h, F), (runs,); what is missing (NaN) does not enter;
    inf where F is singular.

    -1/2 nu^T F^-1 nu - 1/2 ln det(2 pi F),      nu = y - h
    """
    innovation, F = measurement.innovation(y), measurement.F
    present: Array | int = F.shape[-1]
    if any_missing(innovation):
        present = (~np.isnan(innovation)).sum(axis=-1)
        innovation, _, F, _ = without_missing(innovation, measurement.G, F, measurement.R)
    with np.errstate(invalid="ignore"):  # a law that left the finite numbers has no density
        log_determinant = np.linalg.slogdet(F).logabsdet
    square = normalised_square(innovation, F)
    return -0.5 * (square + log_determinant + present * np.log(2 * np.pi))


def stacked(laws: Sequence[Gaussian]) -> Gaussian:
    """Laws of successive steps as one: mean (steps, runs, n), cov (steps, runs, n, n).

    Covariances that are the same for all runs are stored once and shown to each: a read-only view.
    """
    mean = np.stack([law.mean for law in laws])
    covs = np.stack(np.broadcast_arrays(*(law.cov for law in laws)))
    by_run = covs if covs.ndim == mean.ndim + 1 else covs[:, None]
    return Gaussian(mean, np.broadcast_to(by_run, (*mean.shape, mean.shape[-1])))
