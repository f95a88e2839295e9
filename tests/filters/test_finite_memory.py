"""Filters that remember: what is missing, other regressors, angles, and what is refused."""

import numpy as np
import pytest
from test_filters import LINEAR, OF_MEASUREMENTS, exact_ensemble

from kfcourse.filters import fbp, fkp, kalman_filter
from kfcourse.filters.optimal_structure import Memory, Recipe, Remembered, of_structure
from kfcourse.montecarlo.designing import design
from kfcourse.montecarlo.ensemble import Ensemble, simulate
from kfcourse.montecarlo.experiment import run
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import gaussian, linearised

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


def test_any_regressor_can_be_remembered():
    """Two measurements beside the last estimate: on a linear model the filter is Kalman's, as with
    the estimate alone."""
    one = LINEAR["n=2, p=2"]
    model = one.model()
    mixed = of_structure("mixed", gaussian(model), Recipe(), Memory(estimates=1, measurements=2))
    (filter_,) = design([mixed], exact_ensemble(one, 6, seed=3))
    y = simulate(model, 3, 6, seed=7).y
    np.testing.assert_allclose(
        run(filter_, y).mean, run(kalman_filter(model), y).mean, rtol=1e-8, atol=1e-8
    )
    assert filter_.name == "mixed-gaussian"


def test_a_longer_memory_holds_no_more_than_there_is():
    structure = linearised(CURVED)
    ensemble = Ensemble(CURVED, 300, 4, seed=3)
    y = simulate(CURVED, 5, 4, seed=4).y
    one, other = (run(design([fkp(structure, size)], ensemble)[0], y).mean for size in (4, 40))
    np.testing.assert_array_equal(one, other)


def test_angles_are_kept_together_where_estimates_are_remembered():
    """A turn that goes on through pi: a filter that remembers two estimates, against the same
    motion without a circle."""
    state, meter = ["x1 + x2 + 0.02*v1", "x2 + 0.01*v2"], "x1 + 0.05*w"
    laws = {"prior": {"mean": [2.5, 0.3], "variance": [0.01, 0.001]}}
    turning, straight = (
        Model.define(state, meter, angles=angles, **laws) for angles in (["x1", "y"], [])
    )
    estimates = []
    for model in (turning, straight):
        (filter_,) = design([fbp(linearised(model), 2)], Ensemble(model, 2000, 8, seed=6))
        estimates.append(run(filter_, simulate(model, 200, 8, seed=7).y).mean[..., 0])
    wrapped, unwrapped = estimates
    x = simulate(straight, 200, 8, seed=7).x[..., 0]
    assert (x[-1] > np.pi).mean() > 0.9 and (np.abs(wrapped) <= np.pi).all()
    away = wrapped - unwrapped
    away -= 2 * np.pi * np.round(away / (2 * np.pi))
    kept = Remembered((np.array([[3.1, 2.0]]),)).and_now(
        np.array([[-3.1, 2.1]]), np.empty((1, 0)), Memory(2), turning=(0,)
    )
    np.testing.assert_allclose(kept.regressor, [[-3.1, 2.1, 3.1 - 2 * np.pi, 2.0]])
    # Turns draw the coefficients of the angle towards 1, where they nearly are; a jump would be an
    # error of 6 beside 0.04.
    assert np.sqrt((away**2).mean()) < 0.2 * np.sqrt(((unwrapped - x) ** 2).mean())
