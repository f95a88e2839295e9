"""Questions of sets c and d: filters whose coefficients are regressions over an ensemble.

Set c is Pugachev's two-step conditionally optimal filter (DUOF), set d Rudenko's filters of optimal structure (FOS, MFOS).
Answers are functions of arrays: vectors of N trajectories (N, n), matrices (r, c), covariances (n, n) or (N, n, n).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from kfcourse.checks.engine import Answer, Question, catalogue
from kfcourse.checks.gaussian_filters import full, functions, right_correction
from kfcourse.gaussian import Array, Moments

RUNS = 60  # hidden trajectories: a regression over so few differs clearly from one with N - 1 in the place of N

Fit = Callable[[Array, Array], tuple[Array, Array, Array]]


def right_regression(target: Array, regressor: Array) -> tuple[Array, Array, Array]:
    """matrix (r, s), offset (r,), residual covariance (r, r)."""
    matrix, offset, residual = Moments.of(target, regressor).regression(target.shape[1])
    return matrix, offset, residual


def ensemble(exercise: Any, name: str) -> tuple[Array, Array, Array]:
    """x_k, y_k and x_{k+1} of hidden trajectories, (N, ...), at a step when the filter is under way."""
    x, y = exercise.simulate(RUNS, 4, name)
    return x[2], y[2], x[3]


def predicted(exercise: Any, name: str, x: Array) -> Array:
    """What a filter may have predicted of x: near it, and biased a little."""
    spread = x.std(axis=0) + 0.1 * np.sqrt(np.diagonal(exercise.model.prior.cov))
    return x + spread * (0.1 + 0.5 * exercise.rng(name).normal(size=x.shape))


def noiseless(exercise: Any) -> tuple[Callable, Callable]:
    """a(x, m_v) and b(x, m_w) of the hidden model, (N, n) -> (N, n) and (N, p)."""
    return exercise.hidden_noiseless


# -- c1: the structure


def right_structure(lam: Array, z: Array, y: Array, a: Callable, b: Callable) -> tuple[Array, Array]:
    return y - b(lam), a(z)


def structure_arguments(exercise: Any) -> list[tuple]:
    x, y, _ = ensemble(exercise, "c1")
    return [(predicted(exercise, "c1-lam", x), predicted(exercise, "c1-z", x), y, *noiseless(exercise))]


WRONG_STRUCTURES: tuple[tuple[str, str, Answer], ...] = (
    ("omega-sign", "The innovation is what came minus what was expected.", lambda lam, z, y, a, b: (b(lam) - y, a(z))),
    (
        "omega-from-estimate",
        "What is expected of y follows from the prediction lam, not from z.",
        lambda lam, z, y, a, b: (y - b(z), a(z)),
    ),
    ("omega-is-y", "The measurement itself is not the innovation.", lambda lam, z, y, a, b: (y, a(z))),
    (
        "alpha-from-prediction",
        "alpha follows from the estimate z, which knows y already.",
        lambda lam, z, y, a, b: (y - b(lam), a(lam)),
    ),
    ("alpha-is-z", "The object moves: alpha is the state equation at z.", lambda lam, z, y, a, b: (y - b(lam), z)),
)

# -- c2 and d1: regression


def regression_arguments(exercise: Any) -> list[tuple]:
    rng = exercise.rng("c2")
    n, p = exercise.model.n, exercise.model.p
    regressor = 0.7 + rng.normal(size=(RUNS, p))
    target = regressor @ rng.normal(size=(p, n)) + 1.3 + 0.5 * rng.normal(size=(RUNS, n))
    constant = np.concatenate([regressor, np.full((RUNS, 1), 2.0)], axis=1)  # a component that never varies
    return [(target, regressor), (target, constant)]


def regression_with(moments: Callable[[Array, Array], tuple[Array, Array]], offset: bool = True, transposed: bool = False) -> Fit:
    """A regression from other second moments: (target, regressor) -> (cross (r, s), of the regressor (s, s))."""

    def fit(target: Array, regressor: Array) -> tuple[Array, Array, Array]:
        cross, own = moments(target, regressor)
        matrix = cross @ np.linalg.pinv(own)
        if transposed:
            matrix = (np.linalg.pinv(own) @ cross.T).reshape(matrix.shape)
        shift = target.mean(axis=0) - matrix @ regressor.mean(axis=0) if offset else target.mean(axis=0)
        return matrix, shift, _cov(target, target) - matrix @ _cov(target, regressor).T

    return fit


def _cov(a: Array, b: Array) -> Array:
    return (a - a.mean(axis=0)).T @ (b - b.mean(axis=0)) / len(a)


def _raw(a: Array, b: Array) -> Array:
    return a.T @ b / len(a)


def _over_components(a: Array, b: Array) -> Array:
    """Deviations from the mean over the components of each trajectory."""
    return (a - a.mean(axis=1, keepdims=True)).T @ (b - b.mean(axis=1, keepdims=True)) / len(a)


BIASED = (
    "Cross covariance and covariance are divided by different numbers, N and N - 1; np.cov divides by N - 1 unless told "
    "otherwise."
)
WRONG_REGRESSIONS: tuple[tuple[str, str, Fit], ...] = (
    (
        "means-not-subtracted",
        "The second moments are taken about zero; covariances are about the means.",
        regression_with(lambda t, r: (_raw(t, r), _raw(r, r))),
    ),
    (
        "offset-forgotten",
        "The offset is the target's mean; what the matrix makes of the regressor's mean has to be subtracted.",
        regression_with(lambda t, r: (_cov(t, r), _cov(r, r)), offset=False),
    ),
    (
        "wrong-index",
        "The mean seems to be taken over the components (the second index) instead of the trajectories (the first).",
        regression_with(lambda t, r: (_over_components(t, r), _over_components(r, r))),
    ),
    (
        "biased",
        BIASED,
        regression_with(lambda t, r: (_cov(t, r), _cov(r, r) * len(r) / (len(r) - 1))),
    ),
    (
        "biased",
        BIASED,
        regression_with(lambda t, r: (_cov(t, r) * len(r) / (len(r) - 1), _cov(r, r))),
    ),
    (
        "regularised",
        "Something was added to the covariance of the regressor to make it invertible: that biases every coefficient. The "
        "pseudo-inverse needs no such help.",
        regression_with(lambda t, r: (_cov(t, r), _cov(r, r) + 1e-3 * np.eye(r.shape[1]))),
    ),
    (
        "residual-is-variance",
        "The residual covariance is the whole covariance of the target; subtract what the regression explains.",
        lambda t, r: (*right_regression(t, r)[:2], _cov(t, t)),
    ),
    (
        "unbiased-residual",
        "The residual is divided by N - 1; use 1/N throughout, as for the coefficients.",
        lambda t, r: (*right_regression(t, r)[:2], right_regression(t, r)[2] * len(t) / (len(t) - 1)),
    ),
)

# -- c3: one step of the design


def duof_step(lam: Array, x: Array, y: Array, x_next: Array, a: Callable, b: Callable) -> tuple[Array, Array]:
    return duof_step_with()(lam, x, y, x_next, a, b)


def duof_step_with(
    fit: Fit = right_regression,
    first: Callable[[Array, Array], Array] = lambda x, lam: x - lam,
    base: Callable[[Array], Array] = lambda lam: lam,
    alpha: Callable[[Array, Array, Callable], Array] = lambda z, lam, a: a(z),
) -> Answer:
    """One step of the DUOF's design on an ensemble, with one thing changed."""

    def step(lam: Array, x: Array, y: Array, x_next: Array, a: Callable, b: Callable) -> tuple[Array, Array]:
        omega = y - b(lam)
        H, e, _ = fit(first(x, lam), omega)
        z = base(lam) + omega @ H.T + e
        regressor = alpha(z, lam, a)
        F, g, _ = fit(x_next, regressor)
        return z, regressor @ F.T + g

    return step


def duof_arguments(exercise: Any) -> list[tuple]:
    x, y, x_next = ensemble(exercise, "c3")
    return [(predicted(exercise, "c3-lam", x), x, y, x_next, *noiseless(exercise))]


WRONG_DUOF_STEPS: tuple[tuple[str, str, Answer], ...] = (
    (
        "state-for-error",
        "The correction is a regression of the prediction's error x - lam on the innovation, not of the state.",
        duof_step_with(first=lambda x, lam: x),
    ),
    (
        "prediction-not-added",
        "H omega + e is only the correction: it is added to lam.",
        duof_step_with(base=lambda lam: 0.0 * lam),
    ),
    (
        "alpha-from-prediction",
        "The prediction uses a(lam): the estimate z knows the measurement, lam does not.",
        duof_step_with(alpha=lambda z, lam, a: a(lam)),
    ),
    ("alpha-is-z", "The regressor of the prediction is alpha = a(z), not z itself.", duof_step_with(alpha=lambda z, lam, a: z)),
    (
        "means-not-subtracted",
        "The second moments are taken about zero; covariances are about the means.",
        duof_step_with(fit=WRONG_REGRESSIONS[0][2]),
    ),
    (
        "offset-forgotten",
        "The offset is the target's mean; what the matrix makes of the regressor's mean has to be subtracted.",
        duof_step_with(fit=WRONG_REGRESSIONS[1][2]),
    ),
)


# -- c4: coefficients found on one ensemble, used on another

Ensemble = tuple[Array, Array]


def duof_run(designed_x: Array, designed_y: Array, y: Array, mean: Array, a: Callable, b: Callable) -> Array:
    return duof_run_with()(designed_x, designed_y, y, mean, a, b)


def duof_run_with(
    own_coefficients: bool = False, one_gain: bool = False, predictions: bool = False, object_alone: bool = False
) -> Answer:
    """Design over x, y (steps, N, ...), then filter other measurements; with one thing changed."""

    def run(x: Array, y_design: Array, y: Array, mean: Array, a: Callable, b: Callable) -> Array:
        lam, other = np.tile(mean, (x.shape[1], 1)), np.tile(mean, (y.shape[1], 1))
        estimates, first = [], None
        for k in range(len(x)):
            omega = y_design[k] - b(lam)
            H, e, _ = right_regression(x[k] - lam, omega)
            first = (H, e) if first is None else first
            if one_gain:
                H, e = first
            z = lam + omega @ H.T + e
            if own_coefficients:
                H, e = H, 0 * e
            z_other = other + (y[k] - b(other)) @ H.T + e
            estimates.append(other if predictions else z_other)
            if k + 1 < len(x):
                F, g, _ = right_regression(x[k + 1], a(z))
                lam, other = a(z) @ F.T + g, a(z_other) if object_alone else a(z_other) @ F.T + g
        return np.array(estimates)

    return run


def duof_run_arguments(exercise: Any) -> list[tuple]:
    x, y = exercise.simulate(RUNS, 4, "c4-design")
    return [(x, y, exercise.simulate(5, 4, "c4").y, exercise.model.prior.mean, *noiseless(exercise))]


WRONG_DUOF_RUNS: tuple[tuple[str, str, Answer], ...] = (
    (
        "part-of-ensemble",
        "The coefficients seem to come from a part of the design ensemble only; use all of its trajectories.",
        lambda x, yd, y, mean, a, b: duof_run(x[:, : y.shape[1]], yd[:, : y.shape[1]], y, mean, a, b),
    ),
    ("one-gain", "H and e of the first step are used at every step; each step has its own.", duof_run_with(one_gain=True)),
    ("predictions-returned", "These are the predictions; return the estimates.", duof_run_with(predictions=True)),
    (
        "prediction-not-fitted",
        "The prediction is a(z) as it is; its coefficients F and g, found in the design, are not used.",
        duof_run_with(object_alone=True),
    ),
    ("offset-not-used", "The offset e is not used when the filter runs.", duof_run_with(own_coefficients=True)),
)

DUOF = (
    Question(
        "c1",
        "innovation and alpha",
        "warm-up",
        lambda e: right_structure,
        structure_arguments,
        catalogue(WRONG_STRUCTURES),
        ("omega", "alpha"),
    ),
    Question(
        "c2",
        "regression over the ensemble",
        "core",
        lambda e: right_regression,
        regression_arguments,
        catalogue(WRONG_REGRESSIONS),
        ("matrix", "offset", "residual"),
    ),
    Question(
        "c3",
        "one step of the design",
        "core",
        lambda e: duof_step,
        duof_arguments,
        catalogue(WRONG_DUOF_STEPS),
        ("z", "lam_next"),
    ),
    Question("c4", "designed, then run", "core", lambda e: duof_run, duof_run_arguments, catalogue(WRONG_DUOF_RUNS)),
)

# -- set d: filters of optimal structure


def right_condition(x: Array, z: Array) -> tuple[Array, Array]:
    """u = Gamma z + chi and T: what the estimate says of the state."""
    matrix, offset, residual = right_regression(x, z)
    return z @ matrix.T + offset, residual


def condition_with(fit: Fit) -> Callable[[Array, Array], tuple[Array, Array]]:
    def condition(x: Array, z: Array) -> tuple[Array, Array]:
        matrix, offset, residual = fit(x, z)
        return z @ matrix.T + offset, residual

    return condition


def condition_arguments(exercise: Any) -> list[tuple]:
    x, _, _ = ensemble(exercise, "d1")
    return [(x, 0.2 + predicted(exercise, "d1-z", 1.3 * x))]


def _standard_deviation(x: Array, z: Array) -> tuple[Array, Array]:
    u, T = right_condition(x, z)
    return u, np.sqrt(np.maximum(T, 0.0))


def _error_variance(x: Array, z: Array) -> tuple[Array, Array]:
    return z, (x - z).T @ (x - z) / len(x)


WRONG_CONDITIONS: tuple[tuple[str, str, Callable], ...] = (
    ("estimate-itself", "u is not z itself: the estimate's scale and bias are corrected by the regression.", _error_variance),
    (
        "regressed-the-other-way",
        "The estimate was regressed on the state; the filter knows z and asks for x.",
        lambda x, z: right_condition(z, x),
    ),
    (
        "residual-is-variance",
        "T is the whole covariance of the state; subtract what the estimate explains.",
        lambda x, z: (right_condition(x, z)[0], _cov(x, x)),
    ),
    ("deviation-for-variance", "T is a variance; its square root stands there.", _standard_deviation),
    (
        "means-not-subtracted",
        "The second moments are taken about zero; covariances are about the means.",
        condition_with(WRONG_REGRESSIONS[0][2]),
    ),
    (
        "offset-forgotten",
        "The offset chi is the state's mean; what Gamma makes of the estimate's mean has to be subtracted.",
        condition_with(WRONG_REGRESSIONS[1][2]),
    ),
    (
        "unbiased-residual",
        "T is divided by N - 1; use 1/N throughout.",
        lambda x, z: (right_condition(x, z)[0], right_condition(x, z)[1] * len(x) / (len(x) - 1)),
    ),
)

Condition = Callable[[Array, Array], tuple[Array, Array]]


def _predicting(predict: Callable, mean: Array, cov: Array) -> tuple[Array, Array]:
    return predict(mean, full(np.asarray(cov), len(mean)))


def fos_step(lam: Array, Psi: Array, x: Array, y: Array, measure: Callable, predict: Callable) -> tuple[Array, ...]:
    return fos_step_with()(lam, Psi, x, y, measure, predict)


def fos_step_with(
    condition: Condition = right_condition, choose: Callable[..., tuple[Array, Array]] = lambda u, T, z, p: (u, T)
) -> Answer:
    """One step of the FOS's design, with another condition or another choice of what the prediction starts from."""

    def step(lam: Array, Psi: Array, x: Array, y: Array, measure: Callable, predict: Callable) -> tuple[Array, ...]:
        h, G, F = measure(lam, Psi)
        z, p = right_correction(lam, Psi, h, G, F, y)
        return z, *_predicting(predict, *choose(*condition(x, z), z, p))

    return step


def fos_arguments(exercise: Any, name: str = "d2") -> list[tuple]:
    x, y, _ = ensemble(exercise, name)
    lam = predicted(exercise, f"{name}-lam", x)
    Psi = full(_cov(x - lam, x - lam), RUNS) * (1 + 0.3 * exercise.rng(f"{name}-Psi").random((RUNS, 1, 1)))
    return [(lam, Psi, x, y, *functions(exercise.hidden.gaussian))]


WRONG_FOS_STEPS: tuple[tuple[str, str, Answer], ...] = (
    (
        "predicted-as-aof",
        "That is the AOF's prediction, from z and p; the FOS carries no covariance: it predicts from u and T.",
        fos_step_with(choose=lambda u, T, z, p: (z, p)),
    ),
    ("mean-from-estimate", "The prediction's mean starts from u, not from z.", fos_step_with(choose=lambda u, T, z, p: (z, T))),
    (
        "variance-from-aof",
        "The uncertainty of the prediction is T, the same for all trajectories, not p.",
        fos_step_with(choose=lambda u, T, z, p: (u, p)),
    ),
    *((name, says, fos_step_with(wrong)) for name, says, wrong in WRONG_CONDITIONS),
)


def mfos_step(
    lam: Array, Psi: Array, x: Array, y: Array, x_next: Array, measure: Callable, predict: Callable
) -> tuple[Array, ...]:
    return mfos_step_with()(lam, Psi, x, y, x_next, measure, predict)


def mfos_step_with(
    fit: Fit = right_regression,
    correction: bool = True,
    prediction: bool = True,
    target: Callable[[Array, Array], Array] = lambda x, lam: x - lam,
    condition: Condition = right_condition,
    own_variance: bool = False,
) -> Answer:
    """One step of the MFOS's design, with one thing changed."""

    def step(
        lam: Array, Psi: Array, x: Array, y: Array, x_next: Array, measure: Callable, predict: Callable
    ) -> tuple[Array, ...]:
        h, G, F = measure(lam, Psi)
        z, p = right_correction(lam, Psi, h, G, F, y)
        sigma = z - lam
        if correction:
            H, e, _ = fit(target(x, lam), sigma)
            z = lam + sigma @ H.T + e
        u, T = condition(x, z)
        s, Psi_next = _predicting(predict, u, p if own_variance else T)
        if prediction:
            F, g, _ = fit(x_next, s)
            s = s @ F.T + g
        return z, s, Psi_next

    return step


def mfos_arguments(exercise: Any) -> list[tuple]:
    x, y, x_next = ensemble(exercise, "d3")
    lam, Psi, _, _, measure, predict = fos_arguments(exercise, "d3")[0]
    return [(lam, Psi, x, y, x_next, measure, predict)]


WRONG_MFOS_STEPS: tuple[tuple[str, str, Answer], ...] = (
    (
        "correction-not-fitted",
        "The correction of the FOS is used as it is; the MFOS fits its size and offset over the ensemble.",
        mfos_step_with(correction=False),
    ),
    (
        "prediction-not-fitted",
        "The prediction of the FOS is used as it is; the MFOS fits it to x_next over the ensemble.",
        mfos_step_with(prediction=False),
    ),
    (
        "state-for-error",
        "The correction is fitted to the prediction's error x - lam, not to the state.",
        mfos_step_with(target=lambda x, lam: x),
    ),
    ("variance-from-aof", "Psi for the next step is Theta(u, T), not Theta(u, p).", mfos_step_with(own_variance=True)),
    (
        "means-not-subtracted",
        "The second moments are taken about zero; covariances are about the means.",
        mfos_step_with(fit=WRONG_REGRESSIONS[0][2]),
    ),
    (
        "offset-forgotten",
        "An offset is the target's mean; what the matrix makes of the regressor's mean has to be subtracted.",
        mfos_step_with(fit=WRONG_REGRESSIONS[1][2]),
    ),
    *((name, says, mfos_step_with(condition=wrong)) for name, says, wrong in WRONG_CONDITIONS[:3]),
)


def three_arguments(x: Array, y: Array, z: Array) -> tuple[Array, Array]:
    """u and T from the measurement and the estimate together."""
    return right_condition(x, np.concatenate([y, z], axis=1))


def three_arguments_hidden(exercise: Any) -> list[tuple]:
    x, y, _ = ensemble(exercise, "d4")
    return [(x, y, predicted(exercise, "d4-z", x))]


FOS = (
    Question(
        "d1",
        "what the estimate says of the state",
        "warm-up",
        lambda e: right_condition,
        condition_arguments,
        catalogue(WRONG_CONDITIONS),
        ("u", "T"),
    ),
    Question(
        "d2",
        "one step of the FOS",
        "core",
        lambda e: fos_step,
        fos_arguments,
        catalogue(WRONG_FOS_STEPS),
        ("z", "lam_next", "Psi_next"),
    ),
    Question(
        "d3",
        "one step of the MFOS",
        "core",
        lambda e: mfos_step,
        mfos_arguments,
        catalogue(WRONG_MFOS_STEPS),
        ("z", "lam_next", "Psi_next"),
    ),
    Question(
        "d4",
        "three arguments",
        "stretch",
        lambda e: three_arguments,
        three_arguments_hidden,
        catalogue(
            (
                (
                    "measurement-unused",
                    "Only the estimate is used; the measurement may tell more.",
                    lambda x, y, z: right_condition(x, z),
                ),
                (
                    "estimate-unused",
                    "Only the measurement is used; the estimate knows the past.",
                    lambda x, y, z: right_condition(x, y),
                ),
            )
        ),
        ("u", "T"),
    ),
)
