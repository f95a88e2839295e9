"""What the notebook of set f is given: a scalar model with noises that enter linearly, and its two
conditional laws.

A variant's own model is used if the exact filter exists for it and it is the same at every step;
else a companion of it, with numbers of the variant's own.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.lab.short_names import has_exact
from kfcourse.laws import Array
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import linearised

Law = Callable[[Array], tuple[Array, Array]]

# A companion's numbers: from, to; m is the mean of its x_0.
COMPANION = {
    "c": (0.75, 0.95),
    "e": (0.3, 0.5),
    "g": (0.4, 0.8),
    "h": (0.4, 0.7),
    "f": (0.3, 0.5),
    "m": (0.2, 0.8),
}


def companion_numbers(exercise: Exercise) -> dict[str, float]:
    """Numbers of a scalar companion of the variant; none if the variant's own model is used.

    A grid that spans the prior, and one transition density for all steps, are not for a model with
    time, inputs or angles.
    """
    if has_exact(exercise.model) and not exercise.model.timed and not any(exercise.model.angles):
        return {}
    rng = exercise.rng("companion")
    return {name: round(float(rng.uniform(*limits)), 2) for name, limits in COMPANION.items()}


def scalar_model(exercise: Exercise) -> Model:
    """The variant's model if the set can use it, else a scalar companion with numbers of the
    variant's own.

    x_{k+1} = c x_k + e v_k,    y_k = g x_k + h x_k^2 + f w_k,    x_0 ~ N(m, 1)
    """
    numbers = companion_numbers(exercise)
    if not numbers:
        return exercise.model
    prior = {"mean": numbers.pop("m"), "variance": 1}
    return Model.define("c*x + e*v", "g*x + h*x**2 + f*w", numbers, prior=prior)


def laws(model: Model) -> tuple[Law, Law]:
    """move(x) and see(x) of a scalar model: mean (M,) and variance (M,) of the next state and of y,
    given the state x (M,).

    These are the linearised structural functions at a state that is known exactly.
    """
    structure = linearised(model)

    def given(x: Array, law: Callable[[Array, Array], tuple[Array, Array]]) -> tuple[Array, Array]:
        x = np.asarray(x, dtype=float)
        mean, variance = law(x[:, None], np.zeros((len(x), 1, 1)))
        return np.array(np.broadcast_to(mean[..., 0], x.shape)), np.array(
            np.broadcast_to(variance[..., 0, 0], x.shape)
        )

    def measured(x: Array, known: Array) -> tuple[Array, Array]:
        measurement = structure.measure(x, known)
        return measurement.h, measurement.F

    return lambda x: given(x, structure.predict), lambda x: given(x, measured)
