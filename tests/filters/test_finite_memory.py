"""Filters that remember: what is missing, other regressors, angles, and what is refused."""

import numpy as np
import pytest
from test_filters import LINEAR, OF_MEASUREMENTS, exact_ensemble

from kfcourse.filters import fkp, kalman_filter
from kfcourse.filters.optimal_structure import Memory, Remembered
from kfcourse.montecarlo.designing import design
from kfcourse.montecarlo.ensemble import Ensemble, simulate
from kfcourse.montecarlo.experiment import run
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import linearised

pytestmark = pytest.mark.quick

CURVED = Model.define(
    "x/(1 + x**2) + 0.4*v", "x**3/5 + x + 0.3*w", prior={"mean": 0.1, "variance": 0.8}
)


def test_a_missing_measurement_is_remembered_as_what_was_expected():
    """On a linear model that is the mean of what it would have told: one gap in the window costs
    what the Kalman filter loses."""
    one = LINEAR["scalar"]
    model, steps = one.model(), 6
    moments = exact_ensemble(one, steps, seed=3)
    filters = design([family(linearised(model), steps) for family in OF_MEASUREMENTS], moments)
    y = simulate(model, 4, steps, seed=8).y
    y[2, 1] = np.nan
    for filter_ in filters:
        state, expected = filter_.init(4), kalman_filter(model).init(4)
        for k in range(steps):
            before = state.predicted.mean
            state, expected = filter_.step(state, y[k]), kalman_filter(model).step(expected, y[k])
            if k == 2:
                np.testing.assert_array_equal(state.posterior.mean[1], before[1])
            if k <= 2:
                np.testing.assert_allclose(
                    state.predicted.mean, expected.predicted.mean, rtol=1e-9, atol=1e-9
                )
            whole = np.arange(4) != 1
            np.testing.assert_allclose(
                state.posterior.mean[whole], expected.posterior.mean[whole], rtol=1e-8, atol=1e-9
            )


def test_a_longer_memory_holds_no_more_than_there_is():
    structure = linearised(CURVED)
    ensemble = Ensemble(CURVED, 300, 4, seed=3)
    y = simulate(CURVED, 5, 4, seed=4).y
    one, other = (run(design([fkp(structure, size)], ensemble)[0], y).mean for size in (4, 40))
    np.testing.assert_array_equal(one, other)


def test_angles_are_kept_together_where_estimates_are_remembered():
    """A turn that goes on through pi: what was estimated before is kept within half a turn of what
    is estimated now."""
    before = Remembered((np.array([[3.1, 2.0]]),))
    kept = before.and_now(np.array([[-3.1, 2.1]]), np.empty((1, 0)), Memory(2), turning=(0,))
    np.testing.assert_allclose(kept.regressor, [[-3.1, 2.1, 3.1 - 2 * np.pi, 2.0]])
