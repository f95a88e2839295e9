"""Keys on top of a student's own earlier answers: is this step right, if only the one before is not?

`Question.on` of a question is one of these: its parameters have the names of the functions of earlier questions.  The right one
is the default, so that the result is the key where nothing is given.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp

from kfcourse.checks.question import Answer
from kfcourse.exercises.b_aof import keys as aof
from kfcourse.exercises.b_aof.mistakes import correction_with, step_with
from kfcourse.exercises.c_duof.keys import duof_run_with, duof_step_with
from kfcourse.exercises.d_fos.keys import condition as conditioned
from kfcourse.exercises.d_fos.keys import fos_step_with, mfos_step_with
from kfcourse.exercises.f_exact import keys as grid
from kfcourse.exercises.g_extended import keys as extended
from kfcourse.exercises.i_track import keys as track
from kfcourse.exercises.k_integration import keys as integration
from kfcourse.exercises.l_time_tags import keys as fusion
from kfcourse.exercises.m_smoothing import keys as smoothing
from kfcourse.exercises.o_modes import keys as modes
from kfcourse.exercises.o_modes.mistakes import mixed_with, two_steps_with
from kfcourse.exercises.shared import regression as fitted
from kfcourse.laws import Array, transpose

# -- set a


def unexplained(meter_gaussian: Answer) -> Answer:
    """a6 from F and G of a5."""

    def answer(m: Any, d: Any) -> Any:
        _, G, F = (sp.Matrix([part]) for part in meter_gaussian(m, d))
        return F - G * sp.Matrix([d]) * G.T

    return answer


# -- set b


def correct(gain: Answer = aof.gain) -> Answer:
    """b2 with the gain of b1."""
    return correction_with(of_gain=gain)


def step(gain: Answer = aof.gain, correct: Answer | None = None) -> Answer:
    """b3 with the correction of b2, or with the gain of b1."""
    return step_with(correct or correction_with(of_gain=gain))


def run_filter(gain: Answer = aof.gain, correct: Answer | None = None, step: Answer | None = None) -> Answer:
    """b4 with the step of b3, or with what that is made of."""
    one = step or step_with(correct or correction_with(of_gain=gain))
    return lambda *arguments: aof.run_with(one, *arguments)


def covariance(gain: Answer = aof.gain) -> Answer:
    """b5 with the gain of b1."""

    def answer(Psi: Array, G: Array, F: Array, R: Array) -> Array:
        K = gain(Psi, G, F)
        rest = np.eye(Psi.shape[-1]) - K @ G
        return rest @ Psi @ transpose(rest) + K @ R @ transpose(K)

    return answer


# -- sets c and d


def design_step(regression: Answer = fitted) -> Answer:
    """c3 with the regression of c2."""
    return duof_step_with(fit=regression)


def design_and_run(regression: Answer = fitted) -> Answer:
    """c4 with the regression of c2."""
    return duof_run_with(fit=regression)


def fos_step(condition: Answer = conditioned) -> Answer:
    """d2 with u and T of d1."""
    return fos_step_with(condition=condition)


def mfos_step(condition: Answer = conditioned) -> Answer:
    """d3 with u and T of d1."""
    return mfos_step_with(condition=condition)


# -- sets f and g


def grid_run(moments: Answer = grid.moments, correct: Answer = grid.correct, predict: Answer = grid.predict) -> Answer:
    """f4 with f1, f2 and f3."""
    return grid.run_with(correct, predict, moments)


def extended_run(predict: Answer = extended.predict, correct: Answer = extended.correct) -> Answer:
    """g5 with g3 and g4."""
    return extended.run_with(predict, correct)


# -- sets i, k, l and m


def process_noise(matrices: Answer = track.matrices) -> Answer:
    """i2 with B of i1."""

    def answer(dt: sp.Expr, sigma_a: sp.Expr) -> sp.Expr:
        B = matrices(dt)[1]
        return sigma_a**2 * B * B.T

    return answer


def gained(steady_state: Answer = integration.steady_state) -> Answer:
    """k4 with the steady state of k2."""

    def answer(sigma_xi: sp.Expr, sigma_n: sp.Expr, T: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
        _, p, K = steady_state(sigma_xi, sigma_n)
        return sigma_n / sp.sqrt(p), -T / sp.log(1 + K)

    return answer


def fuse(correct: Answer = fusion.correct, move: Answer = fusion.move) -> Answer:
    """l5 with l3 and l4."""

    def answer(
        tags: Array, arrivals: Array, values: Array, m: Array, P: Array, q: float, r: float, now: float
    ) -> tuple[Array, Array]:
        time = 0.0
        for i in (i for i in np.argsort(tags) if arrivals[i] <= now):
            m, P = move(m, P, float(tags[i]) - time, q)
            m, P = correct(m, P, values[i : i + 1], np.array([[1.0, 0.0]]), np.array([[r]]))
            time = float(tags[i])
        return move(m, P, now - time, q)

    return answer


def smoother(neighbours: Answer = smoothing.neighbours, step_back: Answer = smoothing.step_back) -> Answer:
    """m5 with m3 and m4."""
    return smoothing.smooth_with(neighbours, step_back)


# -- set o


def two_steps(chain: Answer = modes.chain, posterior: Answer = modes.posterior) -> Answer:
    """o3 with o1 and o2."""
    return two_steps_with(weights=chain, given=posterior)


def mixed(chain: Answer = modes.chain, merged: Answer = modes.merged) -> Answer:
    """o6 with o1 and o4."""
    return mixed_with(chain, merged)
