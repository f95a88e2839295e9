"""Keys of set n: intervals, their noise, missing measurements, a gate, held-out measurements, neighbouring innovations."""

from __future__ import annotations

import numpy as np
import scipy

from kfcourse.exercises.shared import vehicle
from kfcourse.laws import Array, Gaussian, normalised_square
from kfcourse.linear.arithmetic import FORMS
from kfcourse.linear.consistency import Innovations, autocorrelation
from kfcourse.linear.system import LinearSystem
from kfcourse.records.reading import intervals as intervals_of

H = np.array([[1.0, 0.0]])


def intervals(times: Array) -> Array:
    """From each row to the next; the last as long as the one before."""
    return intervals_of(times)


def process_noise(dt: Array, q: float) -> Array:
    """Covariances of what the interval adds."""
    return np.stack([vehicle(q).over(float(one)).Q for one in dt])


def follow(times: Array, y: Array, q: float, r: float, m: Array, P: Array) -> tuple[Array, Array]:
    """Estimates and covariances at the times."""
    laws, law = [], Gaussian(m, P)
    for k, value in enumerate(y):
        if k:
            step = vehicle(q).over(float(times[k] - times[k - 1]))
            law = Gaussian(step.A @ law.mean, step.A @ law.cov @ step.A.T + step.Q)
        system = LinearSystem(np.eye(2), H, np.zeros((2, 2)), np.array([[r]]))
        law = Gaussian(*FORMS["joseph"].correct(system, law, np.array([value])))
        laws.append(law)
    return np.stack([law.mean for law in laws]), np.stack([law.cov for law in laws])


def gate(nu: Array, F: Array, probability: float) -> tuple[Array, float]:
    """nu^T F^-1 nu of each measurement, and the gate's edge."""
    return normalised_square(nu, F), float(scipy.special.chdtri(nu.shape[-1], 1 - probability))


def held_out(errors: Array, F: Array) -> tuple[float, float, float]:
    """Root mean square of the errors, of what was claimed, and mean NIS."""
    size = np.mean(np.sum(errors**2, axis=-1))
    claimed = np.mean(np.trace(F, axis1=-2, axis2=-1))
    return float(np.sqrt(size)), float(np.sqrt(claimed)), float(normalised_square(errors, F).mean())


def neighbours(nu: Array, F: Array) -> tuple[float, float]:
    """Correlation of neighbouring innovations, and its deviation if they are white."""
    there = ~np.isnan(nu)
    found = autocorrelation(Innovations(nu[there][:, None, None], F[there][:, None, None, None]), 1)
    return float(found.value[0]), float(found.standard_deviation[0])
