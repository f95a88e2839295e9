"""Known mistakes of set j, question by question: edits of the keys, and what is said of each."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.j_radar.keys import (
    alpha_beta,
    cartesian,
    lag,
    meter_jacobian,
    noise_left,
    steady_gain,
)

# -- j1, j2: what the radar measures

SLANT = "sp.sqrt(X**2 + Y**2 + Z**2)"
WRONG_CARTESIANS = edits(
    cartesian,
    ("azimuth-from-y", messages.AZIMUTH_FROM_Y, "(r, phi, eps)", "(r, sp.pi / 2 - phi, eps)"),
    (
        "azimuth-sense",
        "The azimuth turns the other way: it grows from x towards y.",
        "(r, phi, eps)",
        "(r, -phi, eps)",
    ),
    (
        "from-the-zenith",
        "The elevation is counted from the vertical; here it is the angle above the horizon.",
        "(r, phi, eps)",
        "(r, phi, sp.pi / 2 - eps)",
    ),
    (
        "slant-range",
        "The range is taken along the ground; it goes to the aircraft, and only its projection "
        "lies on the ground.",
        "return tuple",
        "return r * sp.cos(phi), r * sp.sin(phi), r * sp.sin(eps)\n    tuple",
    ),
    (
        "height-by-tangent",
        "The height is found as if the range were the distance along the ground.",
        "CARTESIAN.subs",
        "sp.Matrix([*CARTESIAN[:2], RANGE * sp.tan(ELEVATION)]).subs",
    ),
    (
        "degrees",
        "The angles are turned from degrees into radians; they are in radians already.",
        "(r, phi, eps)",
        "(r, phi * sp.pi / 180, eps * sp.pi / 180)",
    ),
)

WRONG_JACOBIANS = edits(
    meter_jacobian,
    (
        "inverse",
        "These are the derivatives of the position by range and angles; the meter goes the other "
        "way.",
        "sp.Matrix([r, phi, eps]).jacobian(POSITION)",
        "CARTESIAN.jacobian(MEASURED).subs(dict(zip(MEASURED, SPHERICAL, strict=True)), "
        "simultaneous=True)",
    ),
    (
        "azimuth-reversed",
        "All signs in the row of the azimuth are reversed: it is counted from x towards y.",
        "[r, phi, eps]",
        "[r, -phi, eps]",
    ),
    (
        "height-over-slant",
        "The tangent of the elevation is the height over the distance along the ground.",
        "[r, phi, eps]",
        f"[r, phi, sp.atan(Z / {SLANT})]",
    ),
    (
        "height-over-x",
        "The distance along the ground is made of x and y both.",
        "[r, phi, eps]",
        "[r, phi, sp.atan(Z / X)]",
    ),
    (
        "range-squared",
        "The square of the range is differentiated, not the range.",
        "[r, phi, eps]",
        "[r**2, phi, eps]",
    ),
    (
        "degrees",
        "The angles are in degrees; radians are asked for.",
        "[r, phi, eps]",
        "[r, phi * 180 / sp.pi, eps * 180 / sp.pi]",
    ),
    (
        "tangent-for-angle",
        "The tangents of the angles are differentiated, not the angles.",
        "[r, phi, eps]",
        "[r, Y / X, Z / sp.sqrt(X**2 + Y**2)]",
    ),
    (
        "order",
        "The rows are in another order: range, azimuth, elevation.",
        "[r, phi, eps]",
        "[r, eps, phi]",
    ),
    (
        "ground-range",
        "The first measurement is the range to the aircraft, not the distance along the ground.",
        "[r, phi, eps]",
        "[sp.sqrt(X**2 + Y**2), phi, eps]",
    ),
)

# -- j3: the constant gain

BETA, INDEX = "2 * (2 - alpha) - 4 * np.sqrt(1 - alpha)", "beta / np.sqrt(1 - alpha)"
WRONG_GAINS = edits(
    steady_gain,
    (
        "other-root",
        "The other root of the quadratic equation was taken: with it the filter is unstable.",
        "- 4 * np.sqrt",
        "+ 4 * np.sqrt",
    ),
    (
        "benedict-bordner",
        "That is Benedict and Bordner's relation, from another criterion; take the stationary "
        "Kalman filter's.",
        BETA,
        "alpha**2 / (2 - alpha)",
    ),
    ("small-alpha", messages.SMALL_ALPHA, BETA, "alpha**2 / 2"),
    (
        "white-in-continuous-time",
        messages.WHITE_IN_CONTINUOUS_TIME,
        "return beta",
        "return 3 * (2 - alpha - np.sqrt((2 - alpha) ** 2 - 2 * alpha**2 / 3))",
    ),
    (
        "coefficient-of-root",
        "The coefficient of the root in beta is wrong.",
        "- 4 * np.sqrt",
        "- 2 * np.sqrt",
    ),
    (
        "index-without-root",
        "A square root is missing in the tracking index: the noise of the meter enters by its "
        "standard deviation.",
        INDEX,
        "beta / (1 - alpha)",
    ),
    (
        "alpha-for-beta",
        "alpha stands in the tracking index where beta belongs.",
        INDEX,
        "alpha / np.sqrt(1 - alpha)",
    ),
    (
        "root-of-alpha",
        "The index is divided by the wrong root: by that of the share of the innovation that is "
        "noise.",
        INDEX,
        "beta / np.sqrt(alpha)",
    ),
)

# -- j4: the filter

WRONG_FILTERS = edits(
    alpha_beta,
    (
        "beta-not-divided",
        "The gain of the velocity is not divided by T: check its units.",
        "beta / T",
        "beta",
    ),
    (
        "beta-multiplied",
        "The gain of the velocity is multiplied by T: check its units.",
        "beta / T",
        "beta * T",
    ),
    (
        "prediction-forgotten",
        "The position is never moved on by the velocity: predict before the next measurement.",
        "z + T * u",
        "z",
    ),
    (
        "time-missing",
        "The prediction adds the velocity to the position without the time between measurements.",
        "z + T * u",
        "z + u",
    ),
    (
        "gain-on-measurement",
        "The gains multiply the measurement itself; they belong to the innovation, what came "
        "minus what was expected.",
        "y_k - r",
        "y_k",
    ),
    ("innovation-sign", messages.INNOVATION_SIGN, "y_k - r", "r - y_k"),
    (
        "position-first",
        "The velocity is corrected with what is left after the position was corrected: use one "
        "innovation for both.",
        "beta / T * nu",
        "beta / T * (1 - alpha) * nu",
    ),
    (
        "predicted-first",
        "The start is moved on before the first measurement; r and v are the prediction for it "
        "already.",
        "positions, velocities =",
        "r = r + T * v; positions, velocities =",
    ),
    (
        "weights-exchanged",
        "Prediction and measurement have changed their weights: for alpha = 1 the estimate is the "
        "measurement.",
        "alpha * nu",
        "(1 - alpha) * nu",
    ),
    (
        "alpha-with-time",
        "alpha has no unit: the interval does not belong to it.",
        "alpha * nu",
        "alpha / T * nu",
    ),
)

# -- j5, j6: lag and noise

WRONG_LAGS = edits(
    lag,
    (
        "prediction",
        "That is the lag of the prediction; the correction takes part of it away.",
        "return",
        "r, v = A * sp.Matrix([r, v]) + push\n    return",
    ),
    (
        "gains-swapped",
        messages.GAINS_SWAPPED,
        "    rest",
        "    alpha, beta = beta, alpha\n    rest",
    ),
    (
        "half-interval",
        "The factor 1/2 of a parabola has no place here: the second difference of a t^2/2 is a "
        "T^2.",
        "simplify(r)",
        "simplify(r / 2)",
    ),
    (
        "alpha-for-rest",
        "The share of the error that a correction leaves is 1 - alpha, not alpha.",
        "simplify(r)",
        "simplify(r * alpha / (1 - alpha))",
    ),
    (
        "position-not-accelerated",
        "Between measurements the acceleration moves the position too, by a T^2/2; that was left "
        "out.",
        "[T**2 / 2, T]",
        "[0, T]",
    ),
    (
        "beta-not-divided",
        "A gain of the velocity of beta instead of beta/T was used.",
        "beta / T",
        "beta",
    ),
    ("time-missing", messages.POWER_OF_T, "simplify(r)", "simplify(r / T)"),
    ("time-missing", messages.POWER_OF_T, "simplify(v)", "simplify(v / T)"),
    (
        "lag-over-time",
        "The lag of the velocity is not that of the position over T.",
        "simplify(v)",
        "simplify(r / T)",
    ),
)

LAST_ALONE = (
    "That is the noise of the last measurement alone; the earlier ones are still in the estimate."
)
VARIANCE = "float(P[0, 0])"
WRONG_SHARES = edits(
    noise_left,
    (
        "kalman-covariance",
        "alpha is the Kalman filter's own variance, in which the unknown acceleration is "
        "contained; ask for the noise alone.",
        VARIANCE,
        "alpha",
    ),
    (
        "alpha-filter",
        "That is a filter without velocity; beta lets noise through too.",
        VARIANCE,
        "alpha / (2 - alpha)",
    ),
    ("one-step", LAST_ALONE, VARIANCE, "alpha**2"),
    ("one-step", LAST_ALONE, VARIANCE, "alpha**2 + beta**2"),
    (
        "prediction",
        "That is the variance of the prediction; take it after the correction.",
        VARIANCE,
        "(A @ P @ A.T)[0, 0]",
    ),
    (
        "velocity",
        "That is the variance of the velocity (in units of sigma^2/T^2).",
        VARIANCE,
        "P[1, 1]",
    ),
    ("gains-swapped", messages.GAINS_SWAPPED, "[[alpha], [beta]]", "[[beta], [alpha]]"),
    (
        "correlation-forgotten",
        "One and the same noise enters position and velocity: it is correlated.",
        "K @ K.T",
        "np.diag([alpha**2, beta**2])",
    ),
    (
        "gains-not-squared",
        "The gains enter the noise's part squared.",
        "K @ K.T",
        "np.diag([alpha, beta])",
    ),
)
