"""What the questions of several sets share: personal numbers, hidden laws, regressions over an
ensemble."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse.exercises.checks.exercises import COURSE, Exercise
from kfcourse.exercises.checks.steps import STEP, Function
from kfcourse.laws import Array, transpose

Map = Callable[[Array], Array]


def personal(
    exercise: Exercise, name: str, **numbers: tuple[float, float, float]
) -> dict[str, float]:
    """Of each number the course's own, for the course's variant, or one of two digits from the
    range that stands after it.

    It is always the same for a variant and `name`.
    """
    rng, course = exercise.rng(name), exercise.variant.name == COURSE
    return {
        key: own if course else float(f"{rng.uniform(low, high):.2g}")
        for key, (own, low, high) in numbers.items()
    }


def covariance(rng: np.random.Generator, size: int, scale: float = 1.0) -> Array:
    """A hidden covariance: correlated, and well away from singular."""
    root = np.eye(size) + 0.4 * rng.normal(size=(size, size))
    return scale * root @ root.T


# -- other functions than the variant's: where it is linear, or has a zero or a one, a mistake would
# not show


def _like(function: Function, changed: Function) -> Function:
    """The changed function, which takes the step if the first does."""
    changed.__dict__.update(vars(function))
    return changed


def other_functions(
    exercise: Exercise, measure: Function, predict: Function
) -> tuple[Function, Function]:
    """Structural functions with another h, a full G with its F, a curved tau, and a Theta that
    depends on p.

    What is added has the units of the model: else a component of large numbers makes F singular to
    rounding, and an answer with an inverse would be wrong by its last digits.
    """
    prior, p = exercise.model.prior, exercise.model.p
    rng, of_state = exercise.rng("other-functions"), np.sqrt(np.diagonal(prior.cov))
    F = measure(
        prior.mean[None], prior.cov[None], *([STEP] if vars(measure).get("of_steps") else [])
    )[2]
    of_meter = np.sqrt(np.diagonal(F[0]))
    more = rng.uniform(0.3, 0.6, (p, len(of_state))) * of_meter[:, None] / of_state
    shift = rng.uniform(0.3, 0.6, p) * of_meter

    def other_measure(m: Array, d: Array, *k: int) -> tuple[Array, Array, Array]:
        h, G, F = measure(m, d, *k)
        full_G = G + more
        return (
            h + (m - prior.mean) @ more.T + shift,
            full_G,
            1.1 * (F - G @ d @ transpose(G)) + full_G @ d @ transpose(full_G),
        )

    def other_predict(z: Array, p: Array, *k: int) -> tuple[Array, Array]:
        tau, Theta = predict(z, p, *k)
        return tau + 0.3 * np.sin(2 * tau + 0.5), 1.2 * Theta + 0.2 * p

    return _like(measure, other_measure), _like(predict, other_predict)


def other_equations(exercise: Exercise, a: Function, b: Function) -> tuple[Function, Function]:
    """Functions a and b of the state, curved."""
    more = exercise.rng("other-equations").uniform(0.3, 0.6, (exercise.model.p, exercise.model.n))

    def other_a(x: Array, *k: int) -> Array:
        return a(x, *k) + 0.3 * np.sin(2 * a(x, *k) + 0.5)

    def other_b(x: Array, *k: int) -> Array:
        return b(x, *k) + np.sin(x + 0.4) @ more.T + 0.3

    return _like(a, other_a), _like(b, other_b)


# -- regressions over an ensemble

# hidden trajectories: a regression over so few differs clearly from one with N - 1 in the place of
# N
RUNS = 60


def regression(target: Array, regressor: Array) -> tuple[Array, Array, Array]:
    """matrix (r, s), offset (r,), residual covariance (r, r)."""
    t, r = target - target.mean(axis=0), regressor - regressor.mean(axis=0)
    cross, own = t.T @ r / len(t), r.T @ r / len(r)
    matrix = cross @ np.linalg.pinv(own, hermitian=True)
    offset = target.mean(axis=0) - matrix @ regressor.mean(axis=0)
    return matrix, offset, t.T @ t / len(t) - matrix @ cross.T


# Edits of it that are mistakes in more than one question: second moments about zero, and no offset.
MOMENTS = (
    "t.T @ r / len(t), r.T @ r / len(r)",
    "target.T @ regressor / len(t), regressor.T @ regressor / len(r)",
)
OFFSET = "target.mean(axis=0) - matrix @ regressor.mean(axis=0)", "target.mean(axis=0)"


def ensemble(exercise: Exercise, name: str) -> tuple[Array, Array, Array]:
    """x_k, y_k and x_{k+1} of hidden trajectories, (N, ...), at a step when the filter is under
    way."""
    x, y = exercise.simulate(RUNS, 4, name)
    return x[2], y[2], x[3]


def predicted(exercise: Exercise, name: str, x: Array) -> Array:
    """What a filter may have predicted of x: near it, and biased a little."""
    spread = x.std(axis=0) + 0.1 * np.sqrt(np.diagonal(exercise.model.prior.cov))
    return x + spread * (0.1 + 0.5 * exercise.rng(name).normal(size=x.shape))
