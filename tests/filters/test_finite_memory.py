"""Filters that remember: the note's loops, the best estimate from a window, identities, and what is refused."""

import warnings

import numpy as np
import oracles
import pytest
from test_filters import LINEAR, OF_MEASUREMENTS, STRUCTURES, designed_on, exact_ensemble

from kfcourse.filters import dfkp, dfmp, fbp, fkp, fos, kalman_filter, mdfkp, mdfmp, mfkp, mfos
from kfcourse.filters.optimal_structure import Memory, Recipe, Remembered, of_structure
from kfcourse.montecarlo.designing import design
from kfcourse.montecarlo.ensemble import Ensemble, Instant, simulate
from kfcourse.montecarlo.experiment import run
from kfcourse.scenarios.benchmarks import growth_model
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.quadrature import QuadratureWarning, gauss_hermite
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import gaussian, linearised

pytestmark = pytest.mark.quick

CURVED = Model.define("x/(1 + x**2) + 0.4*v", "x**3/5 + x + 0.3*w", prior={"mean": 0.1, "variance": 0.8})
FAMILIES = {one.__name__: one for one in (fos, mfos, dfmp, mdfmp, fkp, mfkp, dfkp, mdfkp, fbp)}


@pytest.fixture(scope="module")
def trajectories(variant53):
    x, y = (array[..., 0] for array in simulate(variant53, 40, 9, seed=22))
    return x[:-1], y[:-1], x[1:]


def by_name(family, structure, memory):
    return FAMILIES[family](structure, memory) if family.endswith(("kp", "bp")) else FAMILIES[family](structure)


@pytest.mark.parametrize("kind", ["linearised", "gaussian"])
@pytest.mark.parametrize(("family", "memory"), [(name, size) for name in FAMILIES for size in (1, 3)])
def test_each_is_the_loop_of_the_note(variant53, trajectories, kind, family, memory):
    """Whose memory is padded with zeros until it is full, and ours grows: the pseudo-inverse does not see zeros."""
    if memory > 1 and not family.endswith(("kp", "bp")):
        memory = 1
    (filter_,) = designed_on([by_name(family, STRUCTURES[kind](variant53), memory)], trajectories)
    found = run(filter_, trajectories[1][..., None]).mean[..., 0]
    expected = oracles.remembering_ensemble(kind, family, memory, *trajectories)
    # 40 trajectories and up to three regressors of correlation near 1, conditioned up to 1e5 here
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-9)


def test_a_memory_of_one_estimate_is_the_fos_to_the_last_bit(variant53):
    one, other = (
        design([each], Ensemble(variant53, 500, 6, seed=1))[0] for each in (fos(gaussian(variant53)), fbp(gaussian(variant53), 1))
    )
    y = simulate(variant53, 20, 6, seed=2).y
    np.testing.assert_array_equal(run(one, y).mean, run(other, y).mean)
    np.testing.assert_array_equal(run(one, y).cov, run(other, y).cov)


@pytest.mark.parametrize("name", ["scalar", "n=2, p=2", "n=2, p=1"])
@pytest.mark.parametrize("family", OF_MEASUREMENTS)
def test_on_a_linear_model_a_window_gives_the_best_estimate_from_its_measurements(name, family):
    """With moments that are exact, z_k is M[x_k | y_k, ..., y_{k-l}]: the prior and the newest l + 1 measurements, at once.

    Tolerance as for the Kalman filter: rounding times the condition of regressions on four measurements.
    """
    one, memory, steps = LINEAR[name], 2, 6
    model = one.model()
    moments = exact_ensemble(one, steps, seed=3)
    (filter_,) = design([family(linearised(model), memory)], moments)
    y = simulate(model, 2, steps, seed=8).y
    found = run(filter_, y)
    (m, d), (m_v, D_v), (m_w, D_w) = one.laws.values()
    Q, R = one.B @ D_v @ one.B.T, one.C @ D_w @ one.C.T
    system = [(one.A, one.B @ m_v + one.a, Q, one.H, one.C @ m_w + one.b, R)] * steps
    kalman = run(kalman_filter(model), y)
    for k in range(steps):
        for i in range(2):
            window = y[: k + 1, i].copy()
            window[: max(k - memory, 0)] = np.nan
            mean, cov, _ = oracles.joint_posterior(system[: k + 1], (m, d), window)
            np.testing.assert_allclose(found.mean[k, i], mean[-1], rtol=1e-8, atol=1e-8)
            np.testing.assert_allclose(found.cov[k, i], cov[-1], rtol=1e-8, atol=1e-8)
    assert np.abs(found.mean[-1] - kalman.mean[-1]).max() > 1e-6  # so what is lost is seen


def test_where_the_object_is_linear_the_dfkp_regresses_on_the_memory_itself():
    """lambda' = L tau(u, T) + n with u = Reg[x | zeta] is then Reg[x' | zeta], but for what the object's noise and the
    memory have in common over a design ensemble; so this object has no noise.
    """
    quiet = Model.define("0.8*x + 0.3", "x + 0.1*x**2*w + 0.2*w", prior={"mean": 0.5, "variance": 1})
    x, y = simulate(quiet, 60, 7, seed=4)
    blocks = [Instant(x[k], y[k], x[k + 1]) for k in range(6)]
    structure = gaussian(quiet)
    filter_ = design([dfkp(structure, 2)], blocks)[0]
    state = filter_.init(60)
    for k in range(6):
        state = filter_.step(state, y[k])
        rows = y[max(k - 1, 0) : k + 1, :, 0]
        matrix, offset, residual = oracles.regression(x[k + 1, :, 0], *rows)
        np.testing.assert_allclose(state.predicted.mean[:, 0], matrix @ rows + offset, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(np.squeeze(state.predicted.cov), residual, rtol=1e-7)


@pytest.mark.parametrize("family", ["dfmp", "mfos", "mdfmp", "mfkp", "dfkp", "mdfkp"])
def test_a_regression_leaves_no_error_on_its_ensemble_that_it_could_take_away(family):
    """Fitted predictions have the mean of x, and an error that is uncorrelated with what they come from; so have corrections."""
    ensemble = [Instant(*step) for step in stored(CURVED, 400, 7, seed=5)]
    (filter_,) = design([by_name(family, linearised(CURVED), 3)], ensemble)
    state = filter_.init(400)
    for x, y, x_next, *_ in ensemble:
        lam, Psi = state.predicted
        measurement = linearised(CURVED).measure(lam, Psi)
        state = filter_.step(state, y)
        error = x_next - state.predicted.mean
        assert abs(error.mean()) < 1e-12  # rounding of sums of 400
        assert abs((error * state.predicted.mean).mean()) < 1e-12
        if family.endswith(("dfmp", "dfkp")):
            assert state.predicted.cov.item() == pytest.approx(error.var(), rel=1e-9)
        if family.startswith("m"):
            sigma = Psi[..., 0] * measurement.G[..., 0] / measurement.F[..., 0] * (y - measurement.h)
            fitted = x - state.posterior.mean
            assert abs(fitted.mean()) < 1e-12 and abs((fitted * sigma).mean()) < 1e-12
            assert fitted.var() <= (x - lam - sigma).var() + 1e-12  # "change nothing" was admissible
            assert state.posterior.cov.item() == pytest.approx(fitted.var(), rel=1e-9)


def stored(model, runs, steps, seed):
    x, y = simulate(model, runs, steps, seed)
    return list(zip(x[:-1], y[:-1], x[1:], strict=True))


def test_a_missing_measurement_is_remembered_as_what_was_expected():
    """On a linear model that is the mean of what it would have told: one gap in the window costs what the Kalman filter loses."""
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
                np.testing.assert_allclose(state.predicted.mean, expected.predicted.mean, rtol=1e-9, atol=1e-9)
            whole = np.arange(4) != 1
            np.testing.assert_allclose(state.posterior.mean[whole], expected.posterior.mean[whole], rtol=1e-8, atol=1e-9)


def test_any_regressor_can_be_remembered():
    """Two measurements beside the last estimate: on a linear model the filter is Kalman's, as with the estimate alone."""
    one = LINEAR["n=2, p=2"]
    model = one.model()
    mixed = of_structure("mixed", gaussian(model), Recipe(), Memory(estimates=1, measurements=2))
    (filter_,) = design([mixed], exact_ensemble(one, 6, seed=3))
    y = simulate(model, 3, 6, seed=7).y
    np.testing.assert_allclose(run(filter_, y).mean, run(kalman_filter(model), y).mean, rtol=1e-8, atol=1e-8)
    assert filter_.name == "mixed-gaussian"


def test_a_longer_memory_holds_no_more_than_there_is():
    structure = linearised(CURVED)
    ensemble = Ensemble(CURVED, 300, 4, seed=3)
    y = simulate(CURVED, 5, 4, seed=4).y
    one, other = (run(design([fkp(structure, size)], ensemble)[0], y).mean for size in (4, 40))
    np.testing.assert_array_equal(one, other)


def test_angles_are_kept_together_where_estimates_are_remembered():
    """A turn that goes on through pi: a filter that remembers two estimates, against the same motion without a circle."""
    state, meter = ["x1 + x2 + 0.02*v1", "x2 + 0.01*v2"], "x1 + 0.05*w"
    laws = {"prior": {"mean": [2.5, 0.3], "variance": [0.01, 0.001]}}
    turning, straight = (Model.define(state, meter, angles=angles, **laws) for angles in (["x1", "y"], []))
    estimates = []
    for model in (turning, straight):
        (filter_,) = design([fbp(linearised(model), 2)], Ensemble(model, 2000, 8, seed=6))
        estimates.append(run(filter_, simulate(model, 200, 8, seed=7).y).mean[..., 0])
    wrapped, unwrapped = estimates
    x = simulate(straight, 200, 8, seed=7).x[..., 0]
    assert (x[-1] > np.pi).mean() > 0.9 and (np.abs(wrapped) <= np.pi).all()
    away = wrapped - unwrapped
    away -= 2 * np.pi * np.round(away / (2 * np.pi))
    kept = Remembered((np.array([[3.1, 2.0]]),)).and_now(np.array([[-3.1, 2.1]]), np.empty((1, 0)), Memory(2), turning=(0,))
    np.testing.assert_allclose(kept.regressor, [[-3.1, 2.1, 3.1 - 2 * np.pi, 2.0]])
    # Turns draw the coefficients of the angle towards 1, where they nearly are; a jump would be an error of 6 beside 0.04.
    assert np.sqrt((away**2).mean()) < 0.2 * np.sqrt(((unwrapped - x) ** 2).mean())


def test_what_cannot_be_is_refused():
    angular = linearised(Model.define("x + 0.1*v", "x + 0.1*w", angles={"x": ["x"], "y": []}))
    with pytest.raises(ModelError, match=r"fkp4 regresses the state on measurements, and angles jump.*fbp\(structure, memory\)"):
        fkp(angular)
    assert fbp(angular, 2).name == "fbp2-linearised"
    for memory in (0, -1, 2.5, True, "4"):
        for family in (*OF_MEASUREMENTS, fbp):
            with pytest.raises(ValueError, match=f"a memory holds so many steps, a positive whole number.*got {memory!r}"):
                family(linearised(CURVED), memory)
    with pytest.raises(ValueError, match="2 or 3 arguments, not 4"):
        fos(linearised(CURVED), 4)


def test_an_estimate_that_tells_nothing_is_no_measurement_in_disguise():
    """The growth model's meter is even: z_0 is 0 for all, and one that it is remembered beside adds nothing to z_1."""
    model = growth_model()
    with warnings.catch_warnings(action="ignore", category=QuadratureWarning):
        structure = gauss_hermite(model, 20)
    filters = design([fbp(structure, 1), fbp(structure, 2)], Ensemble(model, 400, 3, seed=1))
    y = simulate(model, 50, 3, seed=2).y
    one, two = (run(each, y).mean for each in filters)
    np.testing.assert_array_equal(one[0], 0.0)
    # the same regression, of two numbers instead of one: rounding, which the steep object takes ten times further
    np.testing.assert_allclose(one, two, rtol=1e-10, atol=1e-10)
