"""Known mistakes in the filter: the error as the state (k1), the filter itself (k3)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.checks.question import Answer
from kfcourse.exercises.k_integration.keys import integrate
from kfcourse.laws import Array

# -- k1: the error of the slow sensor as the state


def _slope(signal: Callable, at: sp.Expr) -> sp.Expr:
    """The derivative of the signal by its argument."""
    x = sp.Dummy("x", real=True)
    return sp.diff(signal(x), x).subs(x, at)


WRONG_METERS: tuple[tuple[str, str, Answer], ...] = (
    (
        "error-sign",
        "The error of the slow sensor is added; it measures too much by it, so the quantity itself is smaller.",
        lambda signal, y, eps: (signal(y + eps), sp.diff(signal(y + eps), eps)),
    ),
    (
        "slope-sign",
        "The derivative is taken by the quantity, not by the error: what does the chain rule add?",
        lambda signal, y, eps: (signal(y - eps), _slope(signal, y - eps)),
    ),
    (
        "slope-at-reading",
        "The derivative is taken at the sensor's reading; the error has to be removed from it first.",
        lambda signal, y, eps: (signal(y - eps), -_slope(signal, y)),
    ),
    (
        "signal-of-error",
        "The receiver measures the quantity; its error alone was put into the signal function.",
        lambda signal, y, eps: (signal(eps), sp.diff(signal(eps), eps)),
    ),
    (
        "reading-minus-signal",
        "The reading is inside the signal function, not outside.",
        lambda signal, y, eps: (y - signal(eps), -_slope(signal, eps)),
    ),
    (
        "difference-reversed",
        "The difference is reversed: it is the reading minus its error.",
        lambda signal, y, eps: (signal(eps - y), _slope(signal, eps - y)),
    ),
    (
        "second-derivative",
        "The slope is the first derivative.",
        lambda signal, y, eps: (signal(y - eps), sp.diff(signal(y - eps), eps, 2)),
    ),
    (
        "reading-subtracted",
        "The reading's own signal is subtracted; the signal function of the error is asked for.",
        lambda signal, y, eps: (signal(y - eps) - signal(y), sp.diff(signal(y - eps), eps)),
    ),
)


# -- k3: the filter

Scalar = Callable[..., Any]  # of numbers and of arrays alike


def filter_with(
    gain: Scalar = lambda Psi, n: -Psi / (Psi + n**2),
    innovation: Scalar = lambda sr, ins, eps: sr - (ins - eps),
    velocity: Scalar = lambda ins, eps: ins - eps,
    variance: Scalar = lambda K, Psi: (1 + K) * Psi,
    drift: Scalar = lambda p, xi: p + xi**2,
    frozen: bool = False,
    drift_in_gap: bool = True,
    filled: float | None = None,
) -> Answer:
    """The filter as a loop, with one thing changed."""

    def answer(y_ins: Array, y_sr: Array, sigma_xi: float, sigma_n: float, p0: float) -> tuple[Array, Array]:
        eps, Psi, rows = np.zeros(y_ins.shape[1:]), p0, []
        for ins, received in zip(y_ins, y_sr, strict=True):
            lost = filled is None and np.isnan(received).any()
            sr = received if filled is None else np.nan_to_num(received, nan=filled)
            p = Psi
            if not lost:
                K = gain(Psi, sigma_n)
                eps = eps + K * innovation(sr, ins, eps)
                p = variance(K, Psi)
            rows.append((velocity(ins, eps), p))
            if not frozen and (drift_in_gap or not lost):
                Psi = drift(p, sigma_xi)
        return np.array([row[0] for row in rows]), np.array([row[1] for row in rows], dtype=float)

    return answer


def _predicted_first(y_ins: Array, y_sr: Array, sigma_xi: float, sigma_n: float, p0: float) -> tuple[Array, Array]:
    return integrate(y_ins, y_sr, sigma_xi, sigma_n, p0 + sigma_xi**2)


def _shrinks_in_gap(y_ins: Array, y_sr: Array, sigma_xi: float, sigma_n: float, p0: float) -> tuple[Array, Array]:
    without_gaps = filter_with()(y_ins, np.nan_to_num(y_sr), sigma_xi, sigma_n, p0)[1]
    eps, Psi, rows = np.zeros(y_ins.shape[1:]), p0, []
    for ins, sr in zip(y_ins, y_sr, strict=True):
        K = -Psi / (Psi + sigma_n**2)
        eps = eps + K * np.nan_to_num(sr - (ins - eps))
        rows.append(ins - eps)
        Psi = (1 + K) * Psi + sigma_xi**2
    return np.array(rows), without_gaps


GAIN_BY_NOISE = "The gain is divided by the receiver's noise alone; the prediction's error belongs to the innovation too."

WRONG_FILTERS: tuple[tuple[str, str, Answer], ...] = (
    (
        "error-added",
        "The estimated error is added to the reading of the INS; it reads too much by that.",
        filter_with(velocity=lambda ins, eps: ins + eps),
    ),
    (
        "gain-sign",
        "The gain has the wrong sign: the INS reads too much where the receiver's minus its velocity is negative.",
        filter_with(gain=lambda Psi, n: Psi / (Psi + n**2), variance=lambda K, Psi: (1 - K) * Psi),
    ),
    (
        "variance-grows",
        "The variance grows with a measurement: K is negative, so it is 1 + K that is less than 1.",
        filter_with(variance=lambda K, Psi: (1 - K) * Psi),
    ),
    (
        "drift-forgotten",
        "The drift of the INS is not added to the variance: the filter becomes surer and surer and falls asleep.",
        filter_with(drift=lambda p, xi: p),
    ),
    (
        "receiver-for-difference",
        "The receiver's velocity is compared with the error; compare it with what the INS reads, less its error.",
        filter_with(innovation=lambda sr, ins, eps: sr - eps),
    ),
    (
        "error-not-removed",
        "The innovation is made with the raw reading of the INS; its estimated error has to be taken off first.",
        filter_with(innovation=lambda sr, ins, eps: sr - ins),
    ),
    (
        "deviation-for-variance",
        "Standard deviations stand where variances belong: sigma_n and sigma_xi have to be squared.",
        filter_with(gain=lambda Psi, n: -Psi / (Psi + n), drift=lambda p, xi: p + xi),
    ),
    (
        "noise-as-deviation",
        "In the gain the receiver's noise is a standard deviation beside a variance: square sigma_n.",
        filter_with(gain=lambda Psi, n: -Psi / (Psi + n)),
    ),
    (
        "drift-as-deviation",
        "A standard deviation is added to the variance from step to step: square sigma_xi.",
        filter_with(drift=lambda p, xi: p + xi),
    ),
    ("gain-frozen", "The gain never changes: hand the variance on from step to step.", filter_with(frozen=True)),
    (
        "predicted-first",
        "The drift is added before the first measurement; p0 is the variance at that moment already.",
        _predicted_first,
    ),
    (
        "missing-as-zero",
        "A missing measurement is treated as the number 0; it says nothing, so the error keeps its estimate.",
        filter_with(filled=0.0),
    ),
    (
        "no-drift-in-gap",
        "While the receiver is lost the variance stands still; the INS drifts on.",
        filter_with(drift_in_gap=False),
    ),
    ("error-returned", "That is the error of the INS; the velocity is asked for.", filter_with(velocity=lambda ins, eps: eps)),
    (
        "variance-before",
        "That is the variance before the correction; return the one after it.",
        lambda *a: (integrate(*a)[0], np.concatenate([[a[4]], integrate(*a)[1][:-1] + a[2] ** 2])),
    ),
    (
        "gain-by-noise-alone",
        GAIN_BY_NOISE,
        filter_with(gain=lambda Psi, n: -Psi / n**2),
    ),
    (
        "missing-shrinks",
        "Where a measurement is missing the variance shrinks all the same: nothing has been learnt there.",
        _shrinks_in_gap,
    ),
    (
        "innovation-plus",
        "The estimated error is added to the reading in the innovation; it has to be taken off.",
        filter_with(innovation=lambda sr, ins, eps: sr - (ins + eps)),
    ),
)
