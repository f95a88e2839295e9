"""Known mistakes of set g, question by question: edits of the keys, and what is said of each."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.g_extended.keys import (
    bounds,
    consistency,
    correct,
    information,
    jacobian,
    predict,
    run_filter,
)

# -- g1: a Jacobian by differences; g2: bounds

WRONG_JACOBIANS = edits(
    jacobian,
    (
        "one-sided",
        messages.ONE_SIDED_DIFFERENCE,
        "function(x - h * e)) / (2 * h)",
        "function(x)) / h",
    ),
    (
        "one-sided",
        messages.ONE_SIDED_DIFFERENCE,
        "(function(x + h * e)",
        "(function(x)",
        "(2 * h)",
        "h",
    ),
    ("divided-by-one-step", "The two points are two steps apart.", "(2 * h)", "h"),
    (
        "all-at-once",
        "All components are shifted at once; a partial derivative shifts one.",
        "for e in np.eye(x.shape[-1])",
        "for e in np.ones((x.shape[-1], 1))",
    ),
    (
        "multiplied-by-step",
        "The distance of the points multiplies; it divides.",
        "/ (2 * h)",
        "* 2 * h",
    ),
    (
        "half-step",
        "The points are half a step away; take a whole step to either side.",
        "    columns",
        "    h = h / 2; columns",
    ),
    (
        "second-difference",
        "That is the second derivative; the first is asked for.",
        "(function(x + h * e) - function(x - h * e)) / (2 * h)",
        "(function(x + h * e) - 2 * function(x) + function(x - h * e)) / h**2",
    ),
)

WRONG_BOUNDS = edits(
    bounds,
    (
        "one-value",
        "These are the bounds of a single value. The mean of many runs varies less: the degrees "
        "of freedom of a sum add up.",
        "    total",
        "    runs = 1; total",
    ),
    (
        "not-divided",
        "These are the bounds of the sum over the runs; those of the mean are asked for.",
        "low / runs, high / runs",
        "low, high",
    ),
    (
        "runs-only",
        "The degrees of freedom are not only the number of runs: each run adds as many as the "
        "vector has components.",
        "degrees * runs",
        "runs",
    ),
    (
        "per-component",
        "Divided by the number of components too; the mean itself is asked for.",
        "low / runs, high / runs",
        "low / total, high / total",
    ),
    (
        "one-value-divided",
        "The sum of the runs has more degrees of freedom than one value: they add up.",
        "degrees * runs",
        "degrees",
    ),
    (
        "one-sided",
        "Each bound leaves out the whole of the small probability; both together may leave it "
        "out, one half each.",
        "(1 - confidence) / 2",
        "1 - confidence",
    ),
    (
        "half-confidence",
        "Halve what lies outside, not the confidence.",
        "(1 - confidence) / 2",
        "confidence / 2",
    ),
    (
        "normal",
        "That is the normal approximation; the chi-squared law itself is not symmetric.",
        "low / runs, high / runs",
        "degrees + scipy.special.ndtri(outside) * np.sqrt(2 * degrees / runs), "
        "degrees - scipy.special.ndtri(outside) * np.sqrt(2 * degrees / runs)",
    ),
    (
        "one-less",
        "One degree of freedom is taken off; nothing is estimated here: all of them count.",
        "degrees * runs",
        "degrees * runs - 1",
    ),
)

# -- g3: the prediction

WRONG_PREDICTIONS = edits(
    predict,
    (
        "jacobian-at-prediction",
        "The Jacobian is taken at the prediction; the function is expanded where the state is "
        "believed to be, at the estimate.",
        "Phi(z)",
        "Phi(f(z))",
    ),
    (
        "noise-at-prediction",
        "The factor of the noise is taken at the prediction; the noise acts on the state before "
        "the step.",
        " g(z)",
        " g(f(z))",
    ),
    (
        "jacobian-transposed",
        "The Jacobian is transposed: in M p M^T the transposed one stands on the right.",
        "A @ p @ transpose(A)",
        "transpose(A) @ p @ A",
    ),
    (
        "noise-forgotten",
        "The noise of the object is not added: a filter that believes its object to be "
        "undisturbed stops learning.",
        " + B @ D_xi @ transpose(B)",
        "",
    ),
    (
        "factor-forgotten",
        "The covariance of the noise is added without its factor g.",
        "B @ D_xi @ transpose(B)",
        "D_xi",
    ),
    (
        "noise-covariance-forgotten",
        "The covariance of the noise is missing between its factors.",
        "B @ D_xi @",
        "B @",
    ),
    (
        "slope-power",
        "The Jacobian enters only once: a covariance goes with it on both sides.",
        "A @ p @ transpose(A)",
        "A @ p",
    ),
    (
        "mean-by-jacobian",
        "The estimate is multiplied by the Jacobian; the prediction is the function itself at the "
        "estimate.",
        "return f(z)",
        "return apply(A, z)",
    ),
)

# -- g4: the correction

DIVIDED = "gain(Psi @ transpose(G), G @ Psi @ transpose(G) + R)"
WRONG_CORRECTIONS = edits(
    correct,
    (
        "noise-of-meter-forgotten",
        "The noise of the meter is missing in the covariance that the gain is divided by: the "
        "meter is taken as perfect.",
        " + R",
        "",
    ),
    (
        "forms-mixed",
        "That gain puts the covariance of the prediction into the information form's formula, "
        "which has that of the estimate.",
        "G @ Psi @ transpose(G) + R",
        "R",
    ),
    ("noise-squared", messages.NOISE_SQUARED, " + R", " + R @ R"),
    (
        "gain-not-divided",
        "The gain is not divided by the covariance of the innovation.",
        DIVIDED,
        "Psi @ transpose(G)",
    ),
    (
        "expected-by-jacobian",
        "The prediction is multiplied by the Jacobian; what is expected of y is the signal itself "
        "at the prediction.",
        "y - S(lam)",
        "y - apply(G, lam)",
    ),
    ("innovation-without-S", messages.MEASUREMENT_FOR_INNOVATION, "y - S(lam)", "y"),
    ("innovation-sign", messages.INNOVATION_SIGN, "y - S(lam)", "S(lam) - y"),
    ("covariance-kept", messages.COVARIANCE_KEPT, " - K @ G @ Psi", ""),
    ("covariance-added", messages.COVARIANCE_ADDED, "- K @ G", "+ K @ G"),
)

# -- g5: a whole run

WRONG_RUNS = edits(
    run_filter,
    (
        "predicted-first",
        messages.PREDICTED_FIRST,
        "    history = []",
        "    history = []\n    lam, Psi = predict(lam, Psi, at_step(f, 0), at_step(Phi, 0), "
        "at_step(g, 0), D_xi)",
    ),
    (
        "meter-jacobian-at-old-estimate",
        "The Jacobian of the meter is taken at the last estimate; the object has moved since: "
        "expand around the prediction.",
        "y_k, S_k, H_k, D_k",
        "y_k, S_k, (lambda _, at=z if k else lam, H_k=H_k: H_k(at)), D_k",
    ),
    (
        "object-jacobian-at-prediction",
        "The Jacobian of the object is taken at the prediction for y_k; after the correction the "
        "estimate is the better place.",
        "f_k, Phi_k, g_k, D_xi",
        "f_k, (lambda _, at=lam, Phi_k=Phi_k: Phi_k(at)), g_k, D_xi",
    ),
    (
        "covariance-frozen",
        "The covariance starts anew at every step: hand Psi on, not only lam.",
        "lam, Psi = predict",
        "lam, _ = predict",
    ),
    (
        "covariance-not-predicted",
        "The gain is made of the covariance of the last estimate; it needs that of the "
        "prediction, after the object has moved.",
        "lam, Psi = predict(z, p, f_k, Phi_k, g_k, D_xi)",
        "lam, Psi = f_k(z), p",
    ),
    (
        "predictions-for-estimates",
        "The first two results are the predictions, before each measurement; return the "
        "estimates, after it.",
        "append((z, p, lam, Psi))",
        "append((lam, Psi, lam, Psi))",
    ),
    ("innovation-sign", messages.INNOVATION_SIGN, "y - S(lam)", "S(lam) - y"),
    (
        "step-not-passed",
        messages.STEP_NOT_PASSED,
        "at_step(function, k) for function in (f,",
        "at_wrong_step(function, 0) for function in (f,",
        "at_step(function, k) for function in (S,",
        "at_wrong_step(function, 0) for function in (S,",
    ),
    (
        "steps-from-one",
        messages.STEPS_FROM_ONE,
        "at_step(function, k) for function in (f,",
        "at_wrong_step(function, k + 1) for function in (f,",
        "at_step(function, k) for function in (S,",
        "at_wrong_step(function, k + 1) for function in (S,",
    ),
    (
        "input-of-next-step",
        messages.INPUT_OF_NEXT_STEP,
        "at_step(function, k) for function in (f,",
        "at_wrong_step(function, k + 1) for function in (f,",
    ),
    (
        "input-of-step-before",
        messages.INPUT_OF_STEP_BEFORE,
        "at_step(function, k) for function in (S,",
        "at_wrong_step(function, k - 1) for function in (S,",
    ),
)

# -- g6: NEES and NIS; g7: the information form

WRONG_NORMALISED = edits(
    consistency,
    (
        "inverse-forgotten",
        messages.INVERSE_FORGOTTEN,
        "np.linalg.solve(cov, vector[..., None])",
        "(cov @ vector[..., None])",
    ),
    (
        "noise-for-innovation",
        "The innovation is compared with the noise of the meter alone; its covariance has the "
        "part of the state too.",
        "F = G @ Psi @ transpose(G) + R",
        "F = R",
    ),
    (
        "residual-for-innovation",
        "The measurement is compared with the estimate, which knows it already; an innovation is "
        "taken from the prediction.",
        "y - S(lam)",
        "y - S(z)",
    ),
    (
        "prediction-for-estimate",
        "That is the error of the prediction; NEES is about the estimate.",
        "square(x - z, p)",
        "square(x - lam, Psi)",
    ),
    (
        "covariance-of-prediction",
        "The error of the estimate is compared with the covariance of the prediction.",
        "square(x - z, p)",
        "square(x - z, Psi)",
    ),
    (
        "correlations-ignored",
        messages.CORRELATIONS_IGNORED,
        "vector * np.linalg.solve(cov, vector[..., None])[..., 0]",
        "vector**2 / np.diagonal(cov, axis1=-2, axis2=-1)",
    ),
    (
        "per-component",
        "Divided by the number of components; the plain mean is asked for: it should be n, or p.",
        "np.sum(vector",
        "np.mean(vector",
    ),
)

WRONG_INFORMATION = edits(
    information,
    (
        "inverse-forgotten",
        messages.INFORMATION_FOR_COVARIANCE,
        "p = np.linalg.inv(total)",
        "p = total",
    ),
    ("inverse-forgotten-in-p", messages.INFORMATION_FOR_COVARIANCE, "return p", "return total"),
    (
        "noise-not-inverted",
        "The covariance of the noise multiplies; a noisy measurement must tell less: its inverse "
        "belongs there.",
        "np.linalg.solve(D_n, H)",
        "D_n @ H",
    ),
    (
        "prior-inverted",
        "W is an information already and is not inverted again; where nothing is known it has no "
        "inverse.",
        "total = W",
        "total = np.linalg.pinv(W)",
    ),
    (
        "prior-ignored",
        "Only the measurement's information is there: what was known before is added to it.",
        "total = W + ",
        "total = ",
    ),
    (
        "information-subtracted",
        "Information is added: a measurement cannot take any away.",
        "W + transpose",
        "W - transpose",
    ),
    (
        "gain-from-prediction",
        "The gain of this form has the covariance of the estimate, not that of the prediction.",
        "gain(p @",
        "gain(np.linalg.pinv(W) @",
    ),
    (
        "gain-not-divided",
        "The gain is not divided by the covariance of the noise.",
        "gain(p @ transpose(H), D_n)",
        "p @ transpose(H)",
    ),
    (
        "through-the-inverse",
        "The inverse of W is taken; where nothing is known before there is none.",
        "p = np.linalg.inv(total)",
        "Psi = np.linalg.pinv(W); p = Psi - gain(Psi @ transpose(H), H @ Psi @ transpose(H) + "
        "D_n) @ H @ Psi",
    ),
)
