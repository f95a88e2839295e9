"""The benchmarks of the field: their models against what the sources say.  What they print is
held against the filters in the chapter on the literature."""

import numpy as np
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from kfcourse.scenarios.benchmarks import (
    cubic_sensor,
    inverse_cube_root,
    logistic,
    lorenz,
    lorenz_data,
)
from kfcourse.symbolic.equations import compile_noiseless


def test_the_attractor_is_that_of_lorenz():
    """One step of Heun's rule against SciPy's: it errs by some hundredths here, as its error is of
    third order; Euler's by .3."""

    def slope(t, u):
        return [10 * (u[1] - u[0]), 28 * u[0] - u[1] - u[0] * u[2], u[0] * u[1] - 8 * u[2] / 3]

    step, _ = compile_noiseless(lorenz(0.3))
    for u in ([1.509, -1.531, 25.46], [-8.0, -3.0, 30.0], [5.0, 9.0, 15.0]):
        after = solve_ivp(slope, (0, 0.01), u, rtol=1e-10, atol=1e-12).y[:, -1]
        assert np.abs(step(np.array([u]))[0] - after).max() < 0.02
    x, y = lorenz_data(200, 12, seed=1)
    assert x.shape == y.shape == (301, 200, 3)
    seen = ~np.isnan(y).any(axis=(1, 2))
    assert np.flatnonzero(seen).tolist() == list(range(25, 301, 25))
    noise = (y - x)[seen]
    assert abs(noise.std() / np.sqrt(2) - 1) < 4 / np.sqrt(2 * noise.size)
    assert_allclose(x[1:], step(x[:-1]), rtol=1e-9, atol=1e-9)  # nothing disturbs it


def test_the_conditionally_minimax_models_are_those_of_the_source():
    """Their equations typed apart: without noise, at states on both sides of every border."""
    x = np.array([-300.0, -8.0, -0.001, 1e-7, 0.001, 0.4, 1.0, 27.0, 200.0])
    for model, following, seen in (
        (cubic_sensor(), x / (1 + x**2), x**3 + x),
        (logistic(), np.maximum(-1e4, np.minimum(1e4, x * (1 - x))), x),
        (inverse_cube_root(), np.minimum(100, 1 / np.cbrt(x)), x),
    ):
        a, b = compile_noiseless(model)
        assert_allclose(a(x[:, None])[:, 0], following, rtol=1e-12)
        assert_allclose(b(x[:, None])[:, 0], seen, rtol=1e-12)
        for law in (model.state_noise, model.meter_noise):
            assert (law.mean, law.cov) == (0, 1)
