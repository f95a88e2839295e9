"""More known mistakes of set a: in the noise's part of a covariance, in moments of the normal
law."""

from __future__ import annotations

from collections.abc import Callable

import sympy as sp

from kfcourse.symbolic.sides import Side

# name, what to say, the part of the noise, or the covariance
Row = tuple[str, str, Callable[[Side], sp.MatrixBase]]
Moment = Callable[[int, sp.Expr, sp.Expr], sp.Expr]  # M x^k for x ~ N(m, d)

FUNCTION_FOR_DERIVATIVE = "The function itself stands where its derivative belongs."
NOT_SQUARED_AS_A_WHOLE = (
    "The noise's factor is squared as a whole: the parameter in it, and what depends on the state."
)
NOISE_IN_SLOPE = (
    "The slope by the state is taken with the noise at its mean; the factor of the "
    "noise does not belong to it."
)
NOISE_TIMES_VARIANCE = (
    "The noise's part does not come through the slope: the variance of the "
    "state does not multiply it."
)
NOISES_IN_ANOTHER_ORDER = (
    "The variances of the noises stand in another order: which noise is in which equation?"
)
CORRELATION_FORGOTTEN = "Only the variances are there; the components are correlated."
SECOND_MOMENT = "It is a second moment: the product of the means has not been subtracted."


def scalar_of(matrix: sp.MatrixBase) -> sp.Expr:
    """The entry of a one by one matrix; ValueError otherwise: some mistakes are possible for
    scalars only."""
    if matrix.shape != (1, 1):
        raise ValueError("only scalar variants allow this mistake")
    return matrix[0]


def factors(s: Side) -> tuple[sp.Expr, sp.Expr]:
    """The noise's factor, split: what is made of parameters, and what depends on the state."""
    B, z = scalar_of(s.B), scalar_of(s.mean)
    rest, dependent = B.as_independent(z, as_Add=False)
    return rest, dependent


def noise_part(s: Side) -> sp.MatrixBase:
    """B D B^T at the mean."""
    return s.B * s.D * s.B.T


def _scalar(value: sp.Expr) -> sp.Matrix:
    return sp.Matrix([value])


def _several(s: Side) -> Side:
    if s.mean.rows < 2 or s.D.rows < 2:
        raise ValueError("only vector variants allow this mistake")
    return s


def _slope_of_noise(s: Side) -> sp.Expr:
    """How the noise's factor changes with the state; ValueError if it does not: then it cannot get
    into the slope."""
    slope = scalar_of(s.B).diff(scalar_of(s.mean))
    if slope == 0:
        raise ValueError("only where the noise's factor depends on the state")
    return slope


def _slope_with_noise(s: Side) -> sp.Matrix:
    return _scalar(
        (scalar_of(s.A) + _slope_of_noise(s)) ** 2 * scalar_of(s.cov) + scalar_of(noise_part(s))
    )


# The covariance of the linearised function: A cov A^T + B D B^T.
WRONG_LINEARISED: tuple[Row, ...] = (
    (
        "noise-not-squared",
        NOT_SQUARED_AS_A_WHOLE,
        lambda s: _scalar(
            scalar_of(s.A) ** 2 * scalar_of(s.cov) + factors(s)[0] * factors(s)[1] ** 2
        ),
    ),
    (
        "noise-not-squared",
        NOT_SQUARED_AS_A_WHOLE,
        lambda s: _scalar(
            scalar_of(s.A) ** 2 * scalar_of(s.cov) + factors(s)[0] ** 2 * factors(s)[1]
        ),
    ),
    ("noise-in-slope", NOISE_IN_SLOPE, _slope_with_noise),
    (
        "noise-times-variance",
        NOISE_TIMES_VARIANCE,
        lambda s: _scalar((scalar_of(s.A) ** 2 + scalar_of(noise_part(s))) * scalar_of(s.cov)),
    ),
    (
        "second-moment",
        SECOND_MOMENT,
        lambda s: s.A * s.cov * s.A.T + noise_part(s) + s.value * s.value.T,
    ),
    (
        "noises-in-another-order",
        NOISES_IN_ANOTHER_ORDER,
        lambda s: (
            s.A * s.cov * s.A.T + sp.diag(*noise_part(_several(s)).diagonal().tolist()[0][::-1])
        ),
    ),
    (
        "correlation-forgotten",
        CORRELATION_FORGOTTEN,
        lambda s: sp.diag(*(_several(s).A * s.cov * s.A.T + noise_part(s)).diagonal()),
    ),
)


# -- moments of the normal law


def moment_with(
    central: tuple[int, ...] = (1, 0, 1, 0, 3, 0, 15, 0, 105),
    binomial: Callable[[int, int], sp.Expr] = sp.binomial,
) -> Moment:
    """M (m + deviation)^k multiplied out, with other central moments or other coefficients."""
    return lambda k, m, d: sum(
        (binomial(k, j) * m ** (k - j) * central[j] * d ** sp.Rational(j, 2) for j in range(k + 1)),
        sp.Integer(0),
    )


RIGHT_MOMENT = moment_with()


def coefficient(instead: int) -> Callable[[int, int], sp.Expr]:
    """Binomial coefficients with another one in the middle of the fourth power."""
    return lambda k, j: sp.Integer(instead) if (k, j) == (4, 2) else sp.binomial(k, j)


def averaged(s: Side, moment: Moment) -> sp.Expr:
    """The mean of the squared factor of the noise over the law, by a formula for the moments.

    ValueError if the factor is no polynomial, or the same everywhere, so that no moment is taken.
    """
    x = s.x[0]
    factor = scalar_of(s.equation.jacobian(sp.Matrix(s.noise))).subs(
        dict(zip(s.noise, s.law.mean, strict=True))
    )
    powers = sp.Poly(factor**2 * scalar_of(s.D), x)
    terms = [(k, c) for (k,), c in powers.terms()]
    if any(k % 2 or k > 8 for k, _ in terms) or not any(k for k, _ in terms):
        raise ValueError("no polynomial of even powers that depends on the state")
    return sum(
        (c * moment(k, scalar_of(s.mean), scalar_of(s.cov)) for k, c in terms), sp.Integer(0)
    )


def exact_noise_part(s: Side) -> sp.MatrixBase:
    """The noise's part of the covariance over the law."""
    if not s.equation.jacobian(sp.Matrix(s.noise)).free_symbols & set(s.x):
        return noise_part(s)
    return _scalar(averaged(s, RIGHT_MOMENT))


POWER_OF_MOMENT = "A higher moment is not a power of the mean square, nor a multiple of it."
CENTRAL_MOMENT = (
    "The fourth central moment of the normal law is missing, or has another coefficient."
)
COEFFICIENT = "A coefficient is wrong: multiply out the power of mean plus deviation once more."
MEAN_SQUARE = "The mean square is wrong: a variance is a difference of two moments, which are they?"
VARIANCE_FOR_MOMENT = (
    "That takes the variance of the noise's factor; as the noise has mean zero, "
    "its mean square belongs there."
)

WRONG_MOMENTS: tuple[tuple[str, str, Moment], ...] = (
    ("power-of-moment", POWER_OF_MOMENT, lambda k, m, d: (m**2 + d) ** (k // 2)),
    ("power-of-moment", POWER_OF_MOMENT, lambda k, m, d: 3 * (m**2 + d) ** (k // 2)),
    ("central-moment", CENTRAL_MOMENT, moment_with((1, 0, 1, 0, 1, 0, 1, 0, 1))),
    ("central-moment", CENTRAL_MOMENT, moment_with((1, 0, 1, 0, 0, 0, 0, 0, 0))),
    ("coefficient", COEFFICIENT, moment_with(binomial=coefficient(3))),
    ("mean-square", MEAN_SQUARE, lambda k, m, d: (m + d) ** k),
    (
        "variance-for-moment",
        VARIANCE_FOR_MOMENT,
        lambda k, m, d: RIGHT_MOMENT(k, m, d) - RIGHT_MOMENT(k // 2, m, d) ** 2,
    ),
    ("noise-not-squared", NOT_SQUARED_AS_A_WHOLE, lambda k, m, d: RIGHT_MOMENT(k // 2, m, d)),
)

# What stands in the place of the noise's part of the exact covariance.
WRONG_NOISE_PARTS: tuple[Row, ...] = (
    *(
        (name, says, lambda s, moment=moment: _scalar(averaged(s, moment)))
        for name, says, moment in WRONG_MOMENTS
    ),
    ("noise-not-squared", NOT_SQUARED_AS_A_WHOLE, lambda s: exact_noise_part(s) / factors(s)[0]),
    ("noise-times-variance", NOISE_TIMES_VARIANCE, lambda s: noise_part(s) * scalar_of(s.cov)),
    (
        "noises-in-another-order",
        NOISES_IN_ANOTHER_ORDER,
        lambda s: sp.diag(*noise_part(_several(s)).diagonal().tolist()[0][::-1]),
    ),
)


def _slope_power(s: Side) -> sp.Matrix:
    """A p in place of A p A, for a linear function."""
    return _scalar(scalar_of(s.A) * scalar_of(s.cov) - scalar_of(s.A) ** 2 * scalar_of(s.cov))


# What is added to the exact covariance.
WRONG_STATE_PARTS: tuple[Row, ...] = (
    ("slope-power", "The slope enters only once: a variance goes with its square.", _slope_power),
    (
        "noise-in-slope",
        NOISE_IN_SLOPE,
        lambda s: _slope_with_noise(s) - s.A**2 * s.cov - exact_noise_part(s),
    ),
)
