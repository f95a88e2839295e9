"""Known mistakes of set h, question by question: edits of the keys, and what is said of each."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.h_continuous.keys import (
    derivatives,
    filter_step,
    noise_variances,
    riccati,
    simulate_step,
    steady_state,
)

GAIN_NOT_DIVIDED = "The gain is not divided by the intensity of the meter's noise."

# -- h1: variances of means over a step; h2: a step of a simulation

BOTH = "S_xi / (2 * T), N / (2 * T)"
WRONG_VARIANCES = edits(
    noise_variances,
    ("one-sided", messages.BOTH_ONE_SIDED, BOTH, "S_xi / T, N / T"),
    (
        "factor-wrong-way",
        "From a one-sided density to an intensity the factor goes the other way.",
        BOTH,
        "2 * S_xi / T, 2 * N / T",
    ),
    (
        "times-step",
        "Multiplied by the step; the longer a mean is taken over, the less it varies.",
        BOTH,
        "S_xi * T / 2, N * T / 2",
    ),
    (
        "step-forgotten",
        "The step is missing: that is an intensity, with other units.",
        BOTH,
        "S_xi / 2, N / 2",
    ),
    (
        "deviation",
        messages.DEVIATION_FOR_VARIANCE,
        BOTH,
        "np.sqrt(S_xi / (2 * T)), np.sqrt(N / (2 * T))",
    ),
    (
        "step-squared",
        "Divided by the step once too often: the variance of an integral over a step is "
        "proportional to the step.",
        BOTH,
        "S_xi / (2 * T**2), N / (2 * T**2)",
    ),
)

WRONG_SIMULATIONS = edits(
    simulate_step,
    (
        "noise-times-step",
        "The noise grows with the step like the drift; over a step its variance does, its size "
        "with the root of it.",
        "np.sqrt(S_xi * T / 2)",
        "T * np.sqrt(S_xi / 2)",
        "np.sqrt(N / (2 * T))",
        "np.sqrt(N / 2) / T",
    ),
    ("one-sided", messages.BOTH_ONE_SIDED, "S_xi * T / 2", "S_xi * T", "N / (2 * T)", "N / T"),
    (
        "mean-for-integral",
        "That is the mean of the noise over the step; the state changes by its integral.",
        "S_xi * T / 2",
        "S_xi / (2 * T)",
    ),
    (
        "integral-for-mean",
        "The noise of the measurement grows with the step; a mean over a longer step varies less.",
        "N / (2 * T)",
        "N * T / 2",
    ),
    (
        "variance-for-deviation",
        "A variance multiplies the standard normal number; its root belongs there.",
        "np.sqrt(S_xi * T / 2)",
        "(S_xi * T / 2)",
        "np.sqrt(N / (2 * T))",
        "(N / (2 * T))",
    ),
    (
        "step-forgotten-in-drift",
        "The drift is a velocity: over a step the state changes by it times the step.",
        "T * f(x)",
        "f(x)",
    ),
    (
        "factor-at-end",
        "The factor of the noise is taken at the end of the step; in Ito's sense it does not know "
        "this step's noise yet.",
        "+ g(x) * shaken",
        "+ g(x + T * f(x) + g(x) * shaken) * shaken",
    ),
    (
        "measured-at-end",
        "The signal is taken after the step; y_k belongs to the step that starts at x.",
        "S(x)",
        "S(x_next)",
    ),
)

# -- h3: the Riccati equation; h4: its steady state

WRONG_RATES = edits(
    riccati,
    (
        "one-side-only",
        "Both factors of M[e e^T] change with the drift; a term is missing, and the result is not "
        "symmetric.",
        " + D @ A.T",
        "",
    ),
    ("transposed", "The matrix of the drift is transposed.", "A @ D + D @ A.T", "A.T @ D + D @ A"),
    (
        "discrete",
        "That is the term of a discrete filter; in continuous time the covariance has a rate, and "
        "A enters it once.",
        "A @ D + D @ A.T",
        "A @ D @ A.T",
    ),
    ("process-one-sided", messages.PROCESS_ONE_SIDED, "G.T / 2", "G.T"),
    ("meter-one-sided", messages.METER_ONE_SIDED, "N / 2", "N"),
    (
        "densities-for-intensities",
        messages.DENSITIES_FOR_INTENSITIES,
        "G.T / 2",
        "G.T",
        "N / 2",
        "N",
    ),
    ("riccati-sign", messages.RICCATI_SIGN, "- learnt", "+ learnt"),
    (
        "noise-not-inverted",
        "The density of the meter's noise multiplies; the noisier the meter, the less is learnt: "
        "its inverse belongs there.",
        "np.linalg.solve(N / 2, H @ D)",
        "(N / 2) @ H @ D",
    ),
    ("discrete-gain", messages.DISCRETE_GAIN, "solve(N / 2,", "solve(H @ D @ H.T + N / 2,"),
)

WRONG_STEADY = edits(
    steady_state,
    ("negative-root", messages.NEGATIVE_ROOT, "(np.sqrt", "(-np.sqrt"),
    ("process-one-sided", messages.PROCESS_ONE_SIDED, "S_xi / 2", "S_xi"),
    ("meter-one-sided", messages.METER_ONE_SIDED, "2 * h**2 / N", "h**2 / N", "2 * D * h", "D * h"),
    (
        "densities-for-intensities",
        messages.DENSITIES_FOR_INTENSITIES,
        "S_xi / 2, 2 * h**2",
        "S_xi, h**2",
        "2 * D * h",
        "D * h",
    ),
    (
        "drift-sign",
        "The sign of the drift: this process decays by itself.",
        "    q, c",
        "    a = -a; q, c",
    ),
    (
        "one-side-only",
        "The drift enters the equation of the variance on both sides; one of them is missing.",
        "    q, c",
        "    a = a / 2; q, c",
    ),
    ("gain-one-sided", messages.GAIN_ONE_SIDED, "2 * D * h", "D * h"),
    ("gain-discrete", messages.DISCRETE_GAIN, "2 * D * h / N", "D * h / (h**2 * D + N / 2)"),
    ("gain-not-divided", GAIN_NOT_DIVIDED, "2 * D * h / N", "D * h"),
)

# -- h5: a step of the filter

WRONG_STEPS = edits(
    filter_step,
    (
        "step-forgotten",
        "The equations give rates; over a step z and D change by them times the step.",
        "    K =",
        "    T = 1; K =",
    ),
    ("signal-for-derivative", messages.SIGNAL_FOR_DERIVATIVE, "    K =", "    S_x = S; K ="),
    ("gain-one-sided", messages.GAIN_ONE_SIDED, "D * S_x(z) * 2 / N", "D * S_x(z) / N"),
    ("meter-one-sided", messages.METER_ONE_SIDED, "    K =", "    N = 2 * N; K ="),
    ("process-one-sided", messages.PROCESS_ONE_SIDED, "S_xi / 2", "S_xi"),
    ("innovation-sign", messages.INNOVATION_SIGN, "y - S(z)", "S(z) - y"),
    (
        "expected-by-slope",
        "The estimate is multiplied by the slope; what is expected of y is the signal itself at "
        "the estimate.",
        "y - S(z)",
        "y - S_x(z) * z",
    ),
    (
        "one-side-only",
        "The slope of the drift acts on both factors of the variance; one of the two equal terms "
        "is missing.",
        "2 * f_x",
        "f_x",
    ),
    (
        "z-first",
        "The rate of the variance is taken at the new estimate; both rates belong to the "
        "beginning of the step.",
        "    D_next",
        "    learnt = D**2 * S_x(z_next) ** 2 * 2 / N\n    D_next",
        "f_x(z) * D + g(z)",
        "f_x(z_next) * D + g(z_next)",
    ),
)

# -- h6: derivatives of the log-likelihood

FIRST, SECOND = "k * S1 * (y - S)", "k * S2 * (y - S) - k * S1**2"
WRONG_DERIVATIVES = edits(
    derivatives,
    (
        "curvature-dropped",
        "The second derivative of the signal is missing: the usual filter drops that part, here "
        "it is asked for.",
        SECOND,
        "-k * S1**2",
    ),
    (
        "curvature-sign",
        "The sign of the part with the second derivative of the signal.",
        ", k * S2",
        ", -k * S2",
    ),
    (
        "slope-dropped",
        "The innovation depends on x as well: differentiate the product.",
        " - k * S1**2",
        "",
    ),
    (
        "slope-sign",
        "The sign of the part without noise: at the top of the likelihood the second derivative "
        "is negative.",
        "- k * S1**2",
        "+ k * S1**2",
    ),
    (
        "one-sided",
        "Divided by the one-sided density; the intensity belongs there.",
        "2 / N",
        "1 / N",
    ),
    (
        "half-forgotten",
        "In the logarithm of the likelihood half of the signal is subtracted from y; the "
        "derivative has the whole then.",
        f"{FIRST}, {SECOND}",
        "k * S1 * (y - 2 * S), k * S2 * (y - 2 * S) - 2 * k * S1**2",
    ),
    (
        "signal-for-derivative",
        messages.SIGNAL_FOR_DERIVATIVE,
        "S.diff(x), S.diff(x, 2)",
        "S, S.diff(x)",
    ),
    (
        "gain-without-slope",
        "The slope of the signal is missing: the chain rule.",
        f"{FIRST}, {SECOND}",
        "k * (y - S), -k * S1",
    ),
)
