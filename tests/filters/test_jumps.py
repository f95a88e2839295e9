"""Filters of models that jump: against all histories of modes, a plain grid, and the cases in which they are other filters."""

import math
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from test_filters import LINEAR, exact_ensemble
from test_multiple_models import follow
from test_particles import histories

from kfcourse import (
    Ensemble,
    Model,
    ModelError,
    NotFinite,
    compare,
    design,
    gaussian,
    likelihood,
    linearised,
    run,
    simulate,
    unscented,
)
from kfcourse.filters import aof, duof, fbp, fkp, fos, kalman_filter, mfos, pointmass
from kfcourse.filters.jump_optimal import logic_dynamic_fbp, logic_dynamic_fkp, logic_dynamic_fos
from kfcourse.filters.multiple_models import gpb2, imm, logic_dynamic
from kfcourse.lab.variants import find_variant
from kfcourse.montecarlo.ensemble import Instant
from kfcourse.symbolic.averaging import averaged, averaged_equations
from kfcourse.symbolic.jumping import JumpModel

pytestmark = pytest.mark.quick

ROUNDING = 1e-10
SEQUENTIAL = [imm, logic_dynamic, gpb2]
SENSOR = {"sound": {"parameters": {"C": 1.0}}, "faulty": {"parameters": {"C": 10.0}}}
LASTING, FIRST = [[0.9, 0.1], [0.3, 0.7]], [0.8, 0.2]


def failing(modes=SENSOR, transition=LASTING, first=FIRST):
    return JumpModel.define(
        "0.9*x + s*v", "x + C*w", {"s": 0.7}, modes=modes, transition=transition, first=first, prior={"mean": 3, "variance": 4}
    )


AFFINE = JumpModel.define(
    "c*x + r + s*v",
    "g*x + f*w",
    {"c": 0.9, "r": 0.0, "s": 0.5, "g": 1.0, "f": 0.5},
    modes={"calm": {}, "carried": {"parameters": {"c": 1.1, "r": 1.0, "g": 0.5}}, "wild": {"parameters": {"s": 2.0, "f": 1.0}}},
    transition=[[0.8, 0.15, 0.05], [0.3, 0.6, 0.1], [0.25, 0.25, 0.5]],
    first=[0.5, 0.3, 0.2],
)
TWO_CHAINS = JumpModel.define("x + v", "x + w", modes={"one": {}, "other": {}}, transition=LASTING, first=FIRST)
CURVED = JumpModel.define(
    "x - 0.4*sin(x) + s*v",
    "g*x + 0.3*x**2 + f*(1 + x**2)*w",
    {"s": 0.4, "g": 1.0, "f": 0.3},
    modes={"up": {}, "down": {"parameters": {"g": -1.0, "s": 0.8}}},
    transition=LASTING,
    first=FIRST,
)


def of(build, model, kind=gaussian):
    return build([kind(mode) for mode in model.modes], model.transition_at, model.first)


# --- the exact filter


@pytest.mark.parametrize("model", [failing(), AFFINE], ids=["sensor", "three modes"])
def test_the_exact_filter_is_the_sum_over_all_histories(model):
    y = simulate(model, 4, 6, seed=3).y
    mean, cov, probability, *_ = follow(pointmass(model), y)
    total = likelihood(pointmass(model), y).sum(axis=0)
    for trajectory in range(4):
        for k in (0, 1, 3, 5):
            z, variance, expected, evidence = histories(model, y[: k + 1, trajectory])
            # the accuracy of a step is 1e-3 standard deviations, and estimated with caution
            assert abs(mean[k, trajectory] - z) < 1e-3 * np.sqrt(variance)
            assert abs(cov[k, trajectory] / variance - 1) < 2e-3
            np.testing.assert_allclose(probability[k, trajectory], expected, atol=1e-3)
        assert abs(total[trajectory] - evidence) < 6e-3


def test_the_exact_filter_is_a_plain_grid_of_both():
    x = np.linspace(-9, 9, 2001)  # 44 points to the narrowest kernel's deviation: sums are as good as integrals
    kernels = [np.exp(-0.5 * ((x[:, None] - (x - 0.4 * np.sin(x))) / s) ** 2) / s for s in (0.4, 0.8)]
    y = simulate(CURVED, 3, 8, seed=5).y
    mean, cov, probability, *_ = follow(pointmass(CURVED), y)
    for trajectory in range(3):
        density = np.stack([q * np.exp(-0.5 * x * x) for q in CURVED.first])
        for k, value in enumerate(y[:, trajectory, 0]):
            if k:
                density = np.stack([kernels[j] @ (np.array(LASTING)[:, j] @ density) for j in range(2)])
            for j, g in enumerate((1.0, -1.0)):
                f = 0.3 * (1 + x * x)
                density[j] *= np.exp(-0.5 * ((value - g * x - 0.3 * x * x) / f) ** 2) / f
            density /= density.sum()
            total = density.sum(axis=0)
            z = total @ x
            variance = total @ (x - z) ** 2
            assert abs(mean[k, trajectory, 0] - z) < 1e-3 * math.sqrt(variance), k
            assert abs(cov[k, trajectory, 0, 0] / variance - 1) < 2e-3, k
            np.testing.assert_allclose(probability[k, trajectory], density.sum(axis=1), atol=1e-3)


def test_its_own_estimate_of_the_error_covers_what_finer_nodes_change():
    y = simulate(failing(), 40, 15, seed=8).y
    rough, fine = (pointmass(failing(), accuracy) for accuracy in (1e-2, 1e-6))
    states = [rough.init(40), fine.init(40)]
    for measured in y:
        states = [one.step(state, measured) for one, state in zip((rough, fine), states, strict=True)]
    change = np.abs(states[0].posterior.mean - states[1].posterior.mean)[:, 0]
    claimed = states[0].memory.discretisation_error()
    assert (change <= claimed + 1e-12).all()
    assert (states[1].memory.discretisation_error() < 1e-3).all()


def test_one_mode_is_the_exact_filter():
    plain = Model.define("0.9*x + 0.3*x*v", "x + 0.2*x**2*w")
    model = JumpModel.define("0.9*x + 0.3*x*v", "x + 0.2*x**2*w", modes={"only": {}}, transition=[1.0])
    y = simulate(plain, 20, 8, seed=2).y
    found, expected = run(pointmass(model), y), run(pointmass(plain), y)
    np.testing.assert_array_equal(found.mean, expected.mean)
    np.testing.assert_array_equal(found.cov, expected.cov)


def test_two_equal_modes_are_the_exact_filter():
    model = failing(modes={"one": {"parameters": {"C": 1}}, "other": {"parameters": {"C": 1}}})
    y = simulate(model, 10, 8, seed=2).y
    found, expected = run(pointmass(model), y), run(pointmass(model.modes[0]), y)
    sd = np.sqrt(expected.cov[..., 0])
    assert (np.abs(found.mean - expected.mean) < 1e-3 * sd).all()  # both of that accuracy


def test_missing_measurements_leave_the_exact_filter_as_predicted():
    y = simulate(failing(), 2, 4, seed=1).y
    one = pointmass(failing())
    state = one.init(2)
    for measured in y:
        state = one.step(state, measured)
    after = one.step(state, np.full((2, 1), np.nan))
    np.testing.assert_allclose(after.memory.probability, state.memory.expected, atol=1e-9)
    np.testing.assert_allclose(after.posterior.mean, state.predicted.mean, atol=1e-3)


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (JumpModel.define(["x1 + v1", "x2 + v2"], "x1 + w", modes={"a": {}}, transition=[1]), "scalar models"),
        (JumpModel.define("x + v", "x", modes={"a": {}}, transition=[1]), "no noise enters the meter"),
    ],
)
def test_the_exact_filter_says_what_it_cannot_do(model, message):
    with pytest.raises(ModelError, match=message):
        pointmass(model)


# --- filters of one law for each mode


@pytest.mark.parametrize("build", SEQUENTIAL)
@pytest.mark.parametrize("kind", [linearised, gaussian, unscented])
def test_one_mode_is_the_plain_filter_bit_for_bit(build, kind):
    model = Model.define("x - 0.4*sin(x) + 0.4*x*v", "x + 0.3*x**2*w")
    y = simulate(model, 5, 20, seed=4).y
    y[3, 0] = np.nan
    found, expected = run(build([kind(model)], [[1.0]]), y), run(aof(kind(model)), y)
    np.testing.assert_array_equal(found.mean, expected.mean)
    np.testing.assert_array_equal(found.cov, expected.cov)


def test_the_imm_is_the_logic_dynamic_filter_for_affine_objects_and_no_other():
    y = simulate(AFFINE, 6, 25, seed=1).y
    one, other = (follow(of(build, AFFINE), y) for build in (imm, logic_dynamic))
    for left, right in zip(one, other, strict=True):
        np.testing.assert_allclose(left, right, rtol=1e-9, atol=ROUNDING)
    y = simulate(CURVED, 6, 25, seed=1).y
    one, other = (run(of(build, CURVED), y).mean for build in (imm, logic_dynamic))
    assert np.abs(one - other).max() > 1e-3


@pytest.mark.parametrize("build", SEQUENTIAL)
def test_a_mode_that_stays_is_one_of_a_bank(build):
    model = JumpModel.define(
        "x - 0.4*sin(x) + s*v",
        "x + w",
        {"s": 0.4},
        modes={"calm": {}, "wild": {"parameters": {"s": 2}}},
        transition=[[1, 0], [0, 1]],
        first=[0.7, 0.3],
    )
    y = simulate(model, 6, 20, seed=2).y
    mean, _, probability, *_ = follow(of(build, model), y)
    bank = [aof(gaussian(mode)) for mode in model.modes]
    logs = np.log(model.first) + np.stack([np.cumsum(likelihood(one, y), axis=0) for one in bank], axis=-1)
    weights = np.exp(logs - logs.max(axis=-1, keepdims=True))
    weights /= weights.sum(axis=-1, keepdims=True)
    np.testing.assert_allclose(probability, weights, atol=1e-9)
    means = np.stack([run(one, y).mean[..., 0] for one in bank], axis=-1)
    np.testing.assert_allclose(mean[..., 0], (weights * means).sum(axis=-1), atol=1e-9)


def test_what_is_merged_when():
    """Nothing is merged before y_0, pairs of modes by GPB2 only after y_1: so far they are exact."""
    y = simulate(AFFINE, 5, 3, seed=6).y
    for build, exact in ((imm, 1), (logic_dynamic, 1), (gpb2, 2)):
        mean, cov, probability, *_ = follow(of(build, AFFINE), y)
        for trajectory in range(5):
            for k in range(3):
                z, variance, expected, _ = histories(AFFINE, y[: k + 1, trajectory])
                same = abs(mean[k, trajectory] - z) < 1e-9 * np.sqrt(variance)
                assert same == (k < exact)
                if k < exact:
                    assert abs(cov[k, trajectory] / variance - 1) < 1e-9
                    np.testing.assert_allclose(probability[k, trajectory], expected, atol=1e-9)


@pytest.mark.parametrize("build", SEQUENTIAL)
def test_a_mode_that_is_observed_is_known(build):
    """The second component tells the mode: what is left is a filter that is told at each step which model holds."""
    model = JumpModel.define(
        ["0.9*x + s*v"],
        ["x + C*w1", "b + 1e-3*w2"],
        {"s": 0.7, "b": 0, "C": 1},
        modes={"sound": {}, "faulty": {"parameters": {"b": 1, "C": 10}}},
        transition=LASTING,
        first=FIRST,
        symbols={"x": ["x"], "w": ["w1", "w2"]},
    )
    _, y, mode = simulate(model, 8, 25, seed=3)
    mean, cov, probability, *_ = follow(of(build, model), y)
    np.testing.assert_allclose(np.take_along_axis(probability, mode[..., None].astype(int), axis=-1), 1.0, atol=1e-9)
    z, p = 0.0, 1.0
    for k in range(25):
        R = np.where(mode[k] == 0, 1.0, 100.0)
        gain = p / (p + R)
        z, p = z + gain * (y[k, :, 0] - z), p * R / (p + R)
        np.testing.assert_allclose(mean[k, :, 0], z, atol=1e-6)
        np.testing.assert_allclose(cov[k, :, 0, 0], p, atol=1e-6)
        z, p = 0.9 * z, 0.81 * p + 0.49


def test_a_mode_that_no_measurement_believes_does_not_take_the_filter_away():
    """The faulty accelerometers of the landing show a hundredth: corrected as if they did, a sound flight leaves the numbers.

    GPB2 went on from such a law, of probability 0, for ever.  Where all modes lead on, it must not matter: whoever merges sooner
    forgets it by himself, and as each measurement here leaves no doubt of the mode, both estimate the same.
    """
    model = find_variant("J3").model
    y = simulate(model, 300, 25, seed=1).y
    both = [run(of(build, model, linearised), y) for build in (gpb2, logic_dynamic)]
    assert all(np.isfinite(one.mean).all() and np.isfinite(one.cov).all() for one in both)
    spread = np.sqrt(np.diagonal(both[1].cov, axis1=-2, axis2=-1))
    assert (np.abs(both[0].mean - both[1].mean) < 1e-6 * spread).all()


def test_a_chain_that_changes_with_time():
    """The sensor fails at step 5 and at no other: from then on the second mode is certain."""
    model = failing(transition=[["Heaviside(3.5 - k)", "Heaviside(k - 3.5)"], [0, 1]], first=[1, 0])
    y = simulate(model, 3, 10, seed=1)
    assert (y.mode == (np.arange(10) >= 5)[:, None]).all()
    for one in (of(logic_dynamic, model), of(gpb2, model), pointmass(model)):
        probability = follow(one, y.y)[2]
        np.testing.assert_allclose(probability[..., 1], np.tile((np.arange(10) >= 5)[:, None], 3), atol=1e-12)


# --- the FOS with modes


# Each filter with modes, the one that it is without, and what both remember of (y_k, y_k-1, ...), (z_k, z_k-1, ...).
REMEMBERING = {
    "fos": (logic_dynamic_fos, fos, (0, 1)),
    "fkp": (partial(logic_dynamic_fkp, memory=3), partial(fkp, memory=3), (3, 0)),
    "fbp": (partial(logic_dynamic_fbp, memory=3), partial(fbp, memory=3), (0, 3)),
}
OF_EACH = pytest.mark.parametrize("family", REMEMBERING)


@OF_EACH
@pytest.mark.parametrize("kind", [gaussian, linearised])
def test_one_mode_is_the_filter_without_modes_bit_for_bit(family, kind):
    with_modes, without, _ = REMEMBERING[family]
    model = JumpModel.define("x - 0.4*sin(x) + 0.4*x*v", "x + 0.3*x**2*w", modes={"only": {}}, transition=[1])
    plain = model.modes[0]
    y = simulate(plain, 20, 8, seed=4).y
    y[3, 0] = y[5, :] = np.nan
    (found,), (expected,) = (
        design([one], Ensemble(plain, 2000, 8, seed=1)) for one in (with_modes(model, [kind(plain)]), without(kind(plain)))
    )
    np.testing.assert_array_equal(run(found, y).mean, run(expected, y).mean)
    np.testing.assert_array_equal(run(found, y).cov, run(expected, y).cov)


def in_each_mode(block, modes):
    """Each trajectory once in each mode."""
    mode = np.repeat(np.arange(modes), len(block.x))
    return Instant(*(np.concatenate([one] * modes) for one in block[:3]), mode, mode)


@OF_EACH
def test_modes_that_are_equal_on_the_ensemble_too_are_the_filter_without_modes(family):
    """The same trajectories in both modes, so that their regressions are the same, and no measurement tells the mode."""
    with_modes, without, _ = REMEMBERING[family]
    model = failing(modes={"one": {"parameters": {"C": 1}}, "other": {"parameters": {"C": 1}}})
    plain = model.modes[0]
    blocks = list(Ensemble(plain, 400, 8, seed=1))
    (found,) = design([with_modes(model, [gaussian(one) for one in model.modes])], [in_each_mode(one, 2) for one in blocks])
    (expected,) = design([without(gaussian(plain))], blocks)
    y = simulate(plain, 20, 8, seed=4).y
    mean, cov, probability, *_ = follow(found, y)
    np.testing.assert_allclose(mean, run(expected, y).mean, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(cov, np.broadcast_to(run(expected, y).cov, cov.shape), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(probability, np.tile([[model.law_at(k)] for k in range(8)], (20, 1)), atol=1e-9)


@pytest.mark.parametrize("family", ["fos", "fkp", "fbp"])
def test_without_jumps_a_linear_model_has_its_kalman_filter(family):
    """With moments that are exact, and a memory that holds all there is; rounding as for the filters without modes."""
    one, steps = LINEAR["n=2, p=2"], 5
    plain = one.model()
    model = replace(TWO_CHAINS, modes=(plain, plain))
    build = {"fos": logic_dynamic_fos, "fkp": partial(logic_dynamic_fkp, memory=steps), "fbp": logic_dynamic_fbp}[family]
    moments = [in_each_mode(moment, 2) for moment in exact_ensemble(one, steps, seed=3)]
    (found,) = design([build(model, [gaussian(plain)] * 2)], moments)
    y = simulate(plain, 4, steps, seed=8).y
    expected = run(kalman_filter(plain), y)
    np.testing.assert_allclose(run(found, y).mean, expected.mean, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(run(found, y).cov, expected.cov, rtol=1e-8, atol=1e-8)


def test_a_memory_of_one_estimate_is_the_fos_with_modes():
    model = failing()
    structures = [gaussian(mode) for mode in model.modes]
    y = simulate(model, 20, 6, seed=2).y
    one, other = (
        run(design([each], Ensemble(model, 500, 6, seed=1))[0], y)
        for each in (logic_dynamic_fos(model, structures), logic_dynamic_fbp(model, structures, 1))
    )
    np.testing.assert_array_equal(one.mean, other.mean)
    np.testing.assert_array_equal(one.cov, other.cov)


def test_modes_that_stay_are_a_bank_of_windows():
    """Each mode's prediction is that of the FKP designed on its trajectories: estimates are not fed back."""
    model = failing(transition=[[1, 0], [0, 1]])
    structures = [gaussian(mode) for mode in model.modes]
    blocks = list(Ensemble(model, 600, 7, seed=1))
    (found,) = design([logic_dynamic_fkp(model, structures, 3)], blocks)
    y = simulate(model, 10, 7, seed=2).y
    state, there = found.init(10), [blocks[0].mode == j for j in (0, 1)]
    bank = [
        design([fkp(one, 3)], [Instant(*(part[mine] for part in block[:3])) for block in blocks])[0]
        for one, mine in zip(structures, there, strict=True)
    ]
    alone = [one.init(10) for one in bank]
    for k in range(7):
        state, alone = found.step(state, y[k]), [one.step(before, y[k]) for one, before in zip(bank, alone, strict=True)]
        logs = np.empty((2, 10))
        for j in (0, 1):
            np.testing.assert_allclose(state.memory.predicted[j].mean, alone[j].predicted.mean, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(np.squeeze(state.memory.predicted[j].cov), np.squeeze(alone[j].predicted.cov), rtol=1e-9)
            windows = np.concatenate([block.y for block in blocks[max(k - 2, 0) : k + 1]], axis=1)[there[j]]
            law = multivariate_normal(windows.mean(axis=0), np.cov(windows.T, bias=True))
            logs[j] = np.log(model.first[j]) + law.logpdf(y[max(k - 2, 0) : k + 1, :, 0].T)
        np.testing.assert_allclose(state.memory.expected.T, np.exp(logs - np.logaddexp(*logs)), rtol=1e-6, atol=1e-9)


@OF_EACH
def test_filters_of_optimal_structure_with_modes_on_their_design_ensemble(family):
    """The note's equations by hand: regressions and normal laws over the trajectories of each mode, for a scalar sensor."""
    with_modes, _, (measurements, estimates) = REMEMBERING[family]
    model, runs, steps = failing(), 500, 6
    blocks = list(Ensemble(model, runs, steps, seed=3))
    (one,) = design([with_modes(model, [gaussian(mode) for mode in model.modes])], blocks)
    state, c = one.init(runs), np.tile(model.first, (runs, 1))
    m, d = np.full((2, runs), 3.0), np.full((2, runs), 4.0)
    variance, pi, ys, zs = np.array([1.0, 100.0]), np.array(LASTING), [], []
    for k, block in enumerate(blocks):
        x, y = block.x[:, 0], block.y[:, 0]
        L = np.array([np.exp(-0.5 * (y - m[j]) ** 2 / (d[j] + variance[j])) / np.sqrt(d[j] + variance[j]) for j in (0, 1)])
        mu = c.T * L / (c.T * L).sum(axis=0)
        z = (mu * np.array([m[j] + d[j] / (d[j] + variance[j]) * (y - m[j]) for j in (0, 1)])).sum(axis=0)
        state = one.step(state, block.y)
        np.testing.assert_allclose(state.posterior.mean[:, 0], z, rtol=1e-7)
        np.testing.assert_allclose(state.memory.probability, mu.T, rtol=1e-6, atol=1e-9)
        ys, zs = [y, *ys], [z, *zs]
        zeta = np.stack(ys[:measurements] + zs[:estimates])
        u, T, xi = np.empty((2, runs)), np.empty(2), np.empty((2, runs))
        for i in (0, 1):
            there = block.mode == i
            rows = np.vstack([zeta, np.ones(runs)]).T
            u[i] = rows @ np.linalg.lstsq(rows[there], x[there])[0]
            T[i] = np.var((x - u[i])[there])
            law = multivariate_normal(zeta[:, there].mean(axis=1), np.cov(zeta[:, there], bias=True))
            xi[i] = model.law_at(k)[i] * law.pdf(zeta.T)
        xi /= xi.sum(axis=0)
        c = xi.T @ pi
        for j in (0, 1):
            w = xi * pi[:, [j]] / c[:, j]
            tau = 0.9 * u
            m[j] = (w * tau).sum(axis=0)
            d[j] = (w * (0.81 * T[:, None] + 0.49 + (tau - m[j]) ** 2)).sum(axis=0)


def test_a_missing_measurement_is_remembered_as_what_all_modes_expect():
    model = failing()
    structures = [gaussian(mode) for mode in model.modes]
    (one,) = design([logic_dynamic_fkp(model, structures, 2)], Ensemble(model, 500, 4, seed=3))
    y = simulate(model, 5, 4, seed=4).y
    y[2, 1] = np.nan
    state = one.init(5)
    for measured in y[:3]:
        before, state = state, one.step(state, measured)
    np.testing.assert_array_equal(state.memory.kept.measurements[0][[0, 2, 3, 4]], y[2][[0, 2, 3, 4]])
    expected = sum(before.memory.expected[1, j] * before.memory.predicted[j].mean[1] for j in (0, 1))
    np.testing.assert_allclose(state.memory.kept.measurements[0][1], expected, rtol=1e-12)
    np.testing.assert_allclose(state.posterior.mean[1], expected, rtol=1e-12)


def test_longer_windows_tell_more_of_the_mode():
    """On a failing meter each longer window is better, the longest is still behind the estimate, and nobody beats the AOF."""
    model = failing()
    structures = [gaussian(mode) for mode in model.modes]
    windows = [logic_dynamic_fkp(model, structures, memory) for memory in (1, 2, 4)]
    filters = [*windows, logic_dynamic_fos(model, structures), logic_dynamic_fbp(model, structures), of(logic_dynamic, model)]
    result = compare(filters, model, 8000, 12, 1, progress=False, jobs=1)
    names = [one.name for one in filters]
    for worse, better in (*pairwise(names[:4]), (names[3], names[5]), (names[4], names[5])):
        gap = result.mean_gap_difference(worse, better, slice(4, None))
        assert gap.value > 4 * gap.standard_error, (worse, better)


def test_the_fos_with_modes_says_what_it_cannot_do():
    rare = failing(transition=[[1 - 1e-9, 1e-9], [0.5, 0.5]], first=[1, 0])
    with pytest.raises(NotFinite, match="no trajectory of the design is in a mode"):
        design([logic_dynamic_fos(rare, [gaussian(one) for one in rare.modes])], Ensemble(rare, 100, 3, seed=1))
    turning = JumpModel.define("x + v", "x + w", modes={"a": {}}, transition=[1], angles={"x": ["x"], "y": []})
    for build, name in ((logic_dynamic_fos, "FOS"), (logic_dynamic_fkp, "FKP4"), (logic_dynamic_fbp, "FBP4")):
        with pytest.raises(ModelError, match=f"the logic-dynamic {name} takes no components that are angles"):
            build(turning, [gaussian(turning.modes[0])])
    for memory in (0, 2.5, True):
        for build in (logic_dynamic_fkp, logic_dynamic_fbp):
            with pytest.raises(ValueError, match=f"a memory holds so many steps, a positive whole number.*got {memory!r}"):
                build(rare, [gaussian(one) for one in rare.modes], memory)


# --- the average over modes


def test_the_average_has_the_moments_of_the_next_state_and_the_measurement():
    k, size, rng = 2, 1_000_000, np.random.default_rng(1)
    mean, cov = np.array([0.7]), np.array([[0.5]])
    x = mean + np.sqrt(0.5) * rng.normal(size=(size, 1))
    now, after = (rng.random(size) < CURVED.law_at(k + i)[0] for i in (0, 1))
    v, w = rng.normal(size=(2, size))
    s, g = np.where(after, 0.4, 0.8), np.where(now, 1.0, -1.0)
    x_next = x[:, 0] - 0.4 * np.sin(x[:, 0]) + s * v
    y = g * x[:, 0] + 0.3 * x[:, 0] ** 2 + 0.3 * (1 + x[:, 0] ** 2) * w
    structure = averaged(CURVED, [gaussian(mode) for mode in CURVED.modes]).at(k)
    tau, theta = structure.predict(mean, cov)
    h, G, F, R = structure.measure(mean, cov)
    for sample, first, second in ((x_next, tau, theta), (y, h, F)):
        assert abs(sample.mean() - first.item()) < 4 * sample.std() / np.sqrt(size)
        square = (sample - sample.mean()) ** 2
        assert abs(square.mean() - second.item()) < 4 * square.std() / np.sqrt(size)
    cross = (x[:, 0] - 0.7) * (y - y.mean())
    assert abs(cross.mean() - 0.5 * G.item()) < 4 * cross.std() / np.sqrt(size)
    np.testing.assert_allclose(F, G * 0.5 * G + R, rtol=1e-12)
    A, Q = structure.transition(mean, cov)
    np.testing.assert_allclose(theta, A * 0.5 * A + Q, rtol=1e-12)
    cross = (x[:, 0] - 0.7) * (x_next - x_next.mean())
    assert abs(cross.mean() - 0.5 * A.item()) < 4 * cross.std() / np.sqrt(size)


def test_modes_that_move_apart_spread_the_average():
    """tau = sum q (c z + r), Theta = sum q (c^2 p + s^2) + sum q (c z + r - tau)^2 with the modes of the step to come."""
    z, p, q = 2.0, 0.3, AFFINE.law_at(4)
    c, r, s = np.array([0.9, 1.1, 0.9]), np.array([0.0, 1.0, 0.0]), np.array([0.5, 0.5, 2.0])
    each = c * z + r
    tau, theta = averaged(AFFINE, [gaussian(mode) for mode in AFFINE.modes]).at(3).predict(np.array([z]), np.array([[p]]))
    assert tau.item() == pytest.approx(q @ each, rel=1e-12)
    assert theta.item() == pytest.approx(q @ (c * c * p + s * s) + q @ (each - q @ each) ** 2, rel=1e-12)


def test_with_modes_drawn_anew_the_averaged_filter_is_the_best_linear_one():
    """Its noise has the variance sum q C^2, and the Kalman filter with it is the best affine filter, as DUOF finds by itself."""
    model = failing(transition=[0.8, 0.2], first=None)
    plain = Model.define("0.9*x + 0.7*v", "x + f*w", {"f": math.sqrt(0.8 + 20)}, prior={"mean": 3, "variance": 4})
    y = simulate(model, 5, 15, seed=1).y
    found, expected = run(aof(averaged(model, [gaussian(mode) for mode in model.modes])), y), run(aof(gaussian(plain)), y)
    np.testing.assert_allclose(found.mean, expected.mean, atol=ROUNDING)
    np.testing.assert_allclose(found.cov, np.broadcast_to(expected.cov, found.cov.shape), atol=ROUNDING)


def test_who_wins():
    """Knowing the modes pays, nobody is below the bound, and merging later is better: the order of the theory."""
    model = failing()
    structure = averaged(model, [gaussian(mode) for mode in model.modes])
    result = compare(
        [
            of(logic_dynamic, model),
            of(gpb2, model),
            aof(structure),
            duof(model.modes[0], averaged_equations(model)),
            fos(structure),
            mfos(structure),
            pointmass(model),
        ],
        model,
        200,
        10,
        1,
        design_runs=4000,
        progress=False,
        jobs=1,
    )
    ranked = dict(result.ranking(slice(2, None)))
    assert list(ranked)[:2] == ["gpb2", "aof-jump-gaussian"]
    assert all(gap.value > -4 * gap.standard_error for gap in ranked.values())
    for name in ("aof-averaged", "duof", "fos-averaged", "mfos-averaged"):
        better = result.mean_gap_difference(name, "aof-jump-gaussian", slice(2, None))
        assert better.value > 4 * better.standard_error, name


def test_of_angles_there_is_no_average():
    model = JumpModel.define(
        "x + v",
        "x + C*w",
        {"C": 1},
        modes={"a": {}, "b": {"parameters": {"C": 2}}},
        transition=[0.5, 0.5],
        angles={"x": ["x"], "y": []},
    )
    with pytest.raises(ModelError, match="angles have no average"):
        averaged(model, [linearised(mode) for mode in model.modes])
