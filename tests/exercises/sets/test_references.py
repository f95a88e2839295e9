"""Keys of sets f, g, h, l, o against independent references: the package's filters,
derivatives, an integrator."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from kfcourse import (
    Gaussian,
    Model,
    gaussian,
    linearised,
    load_variants,
    predictions,
    run,
    simulate,
)
from kfcourse.continuous import ContinuousModel, steady_state
from kfcourse.exercises.checks import exercise
from kfcourse.exercises.sets.f_exact import companion
from kfcourse.exercises.sets.f_exact import keys as grid
from kfcourse.exercises.sets.g_extended import keys as extended
from kfcourse.exercises.sets.g_extended.companion import linearisation
from kfcourse.exercises.sets.g_extended.hidden import hidden_functions
from kfcourse.exercises.sets.h_continuous import keys as continuous_time
from kfcourse.exercises.sets.h_continuous import questions as continuous_questions
from kfcourse.exercises.sets.o_modes import keys as modes
from kfcourse.exercises.sets.o_modes import questions as modes_questions
from kfcourse.filters import aof, kalman_filter, logic_dynamic
from kfcourse.lab import find_variant
from kfcourse.linear.consistency import innovations, nees, nis
from kfcourse.scenarios.navigation import Dynamics, Observation, Sensor, fuse


def test_the_grid_is_the_kalman_filter_on_a_linear_model():
    model = Model.define(
        "c*x + e*v",
        "g*x + f*w",
        dict(c=0.8, e=0.6, g=1.7, f=0.7),
        prior=dict(mean=0.4, variance=1.3),
    )
    y = simulate(model, 1, 9, seed=3).y
    y[4] = np.nan
    x = np.linspace(-9, 9, 700)
    prior = grid.normal(x, 0.4, 1.3)
    z, p, total = grid.run_filter(y[:, 0, 0], x, prior, *companion.laws(model))
    law, before = run(kalman_filter(model), y), predictions(kalman_filter(model), y)
    # step 0.026, narrowest density 0.4: the rule's error is below rounding (formula of the
    # chapter); 8 steps of rounding
    assert_allclose(z, law.mean[:, 0, 0], rtol=0, atol=1e-12)
    assert_allclose(p, law.cov[:, 0, 0, 0], rtol=1e-11)
    F = 1.7**2 * before.cov[:, 0, 0, 0] + 0.49
    logs = -0.5 * ((y[:, 0, 0] - 1.7 * before.mean[:, 0, 0]) ** 2 / F + np.log(2 * np.pi * F))
    assert total == pytest.approx(np.nansum(logs), abs=1e-11)


@pytest.mark.parametrize("name", sorted(load_variants()))
def test_the_extended_filter_is_the_package_s(name):
    model = find_variant(name).model
    x, y = simulate(model, 5, 8, seed=2)
    lin = linearised(model)
    functions = linearisation(model)
    mean, cov = model.prior.mean + 0.3 * np.sqrt(np.diagonal(model.prior.cov)), model.prior.cov
    shifted = replace(model, prior=Gaussian(mean, cov))
    z, p, lam, Psi = extended.run_filter(y, mean, cov, *functions)
    ekf = aof(linearised(shifted))
    law, before = run(ekf, y), predictions(ekf, y)
    for mine, theirs in ((z, law.mean), (p, law.cov), (lam, before.mean), (Psi, before.cov)):
        assert_allclose(mine, theirs, rtol=1e-9, atol=1e-12)
    theirs = extended.consistency(x, z, p, y, lam, Psi, functions.S, functions.H, functions.D_n)
    assert_allclose(theirs[0], nees(x, law).mean(axis=1), rtol=1e-6)
    assert_allclose(theirs[1], nis(innovations(lin.measure, before, y)).mean(axis=1), rtol=1e-6)


def test_hidden_jacobians_are_derivatives():
    for n, r, p in ((3, 3, 2), (1, 1, 1), (2, 1, 2)):
        hidden = hidden_functions(exercise("g", "53"), "test", n, r, p)
        x = np.random.default_rng(1).normal(size=(4, n))
        for function, jacobian in ((hidden.f, hidden.Phi), (hidden.S, hidden.H)):
            # third derivatives of order one: error of the order step^2
            assert_allclose(extended.jacobian(function, x, 1e-4), jacobian(x), atol=1e-7)
        assert np.linalg.eigvalsh(hidden.D_n(x)).min() > 0


def riccati(t, D, a, s, h, S_xi, N):
    return -2 * a * D + s * s * S_xi / 2 - 2 * h * h / N * D**2


def test_continuous_numbers():
    assert continuous_time.noise_variances(3.0, 0.4, 0.05) == (pytest.approx(30), pytest.approx(4))
    for arguments in continuous_questions.steady_arguments(exercise("h", "7")):
        D, K = continuous_time.steady_state(*arguments)
        a, s, h, S_xi, N = arguments
        letters = {"a": a, "s": s, "h": h}
        model = ContinuousModel.define(
            "-a*x", "s", "h*x", letters, spectral_density=S_xi, noise_density=N
        )
        assert tuple(pytest.approx(matrix.item()) for matrix in steady_state(model)) == (D, K)
        scalar = [np.array([[v]]) for v in (D, -a, s, h, S_xi, N)]
        assert abs(continuous_time.riccati(*scalar).item()) < 1e-9
        late = solve_ivp(riccati, (0, 60), [3.0], args=tuple(arguments), rtol=1e-10, atol=1e-12)
        assert late.y[0, -1] == pytest.approx(float(D), rel=1e-6)


@pytest.mark.parametrize("variant", ["53", "21"])
def test_two_steps_of_modes_are_the_package_s_filter(variant):
    for y, m, d, a, q, C, pi, first in modes_questions.two_measurements(exercise("o", variant)):
        models = [
            Model.define(
                "a*x + s*v",
                "x + C*w",
                {"a": a, "s": np.sqrt(q), "C": c},
                prior={"mean": m, "variance": d},
            )
            for c in C
        ]
        filter_ = logic_dynamic([gaussian(model) for model in models], pi, first)
        before = filter_.step(filter_.init(1), y[:1, None])
        after = filter_.step(before, y[1:, None])
        theirs = modes.two_steps(y, m, d, a, q, C, pi, first)
        assert_allclose(
            theirs, [before.memory.probability[0], after.memory.probability[0]], rtol=1e-12
        )


# -- keys that are formulas: the package has them otherwise


def asked(letter, name):
    """Key and hidden arguments of a question."""
    task = exercise(letter, "21")
    question = task.questions[name]
    return question.key, question.arguments(task)


def test_late_measurements_are_fused_as_by_the_package():
    key, calls = asked("l", "l5")
    for tags, arrivals, values, m, P, q, r, now in calls:
        sensor = Sensor.define("receiver", ["s", "V"], "s + w", variance=r, period=1.0)
        rows = zip(tags, arrivals, values, strict=True)
        seen = [
            Observation("receiver", float(tag), float(at), np.array([[value]]))
            for tag, at, value in rows
        ]
        vehicle = Dynamics(np.array([[0.0, 1.0], [0.0, 0.0]]), np.diag([0.0, q]))
        law = fuse(vehicle, [sensor], Gaussian(m, P), seen, np.array([now]))
        mean, cov = key(tags, arrivals, values, m, P, q, r, now)
        assert_allclose(mean, law.mean[0, 0], rtol=1e-9)
        assert_allclose(cov, law.cov[0, 0], rtol=1e-9)
