"""Filters of models that jump: against all histories of modes, and the cases in which they are
other filters."""

from dataclasses import replace
from functools import partial

import numpy as np
import oracles
import pytest
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal, norm
from test_every_filter import LINEAR, exact_ensemble
from test_multiple_models import follow
from test_particles import histories

from kfcourse import (
    Ensemble,
    JumpModel,
    ModelError,
    NotFinite,
    design,
    gaussian,
    likelihood,
    linearised,
    run,
    simulate,
)
from kfcourse.filters import (
    gpb2,
    imm,
    kalman_filter,
    logic_dynamic,
    logic_dynamic_fbp,
    logic_dynamic_fkp,
    logic_dynamic_fos,
    pointmass,
)
from kfcourse.lab import find_variant
from kfcourse.montecarlo.ensemble import Instant
from kfcourse.montecarlo.experiment import walk
from kfcourse.symbolic.averaging import averaged

ROUNDING = 1e-10
SEQUENTIAL = [imm, logic_dynamic, gpb2]
SENSOR = {"sound": {"parameters": {"C": 1.0}}, "faulty": {"parameters": {"C": 10.0}}}
FAULTS = {  # what a sensor measured that sooner or later was faulty
    "J1-lasting": "3.9 4.3 5.6 3.2 5.1 3.5 1.6 3 4 -3.6 9.9 -5 -4.5 1.9 -31.8 -9.1 3.3 -10.2 -1.1 "
    "-10.7 8.6 2.6 9.3 3.5 8.7 -19.9 -5.3 15.6 5.4 3.5 20.2 -5.8 10.1 18 14 4.5 -17.9 -10.6 8 -1.7 "
    "11.2 15.6 10.2 11.3 6.9 -7.4 3.8 -2.8 14.3 15.4 22.5",
    "J1-overload": "0.5 10.8 7.9 3.5 -0.5 11.9 -0.1 6.2 -7.3 17.7 -7 -16.2 -4.2 -23.1 -15.7 8.1 "
    "-10.4 8.2 8.8 7.4 6.6 -7.9 -9.4 -21.5",
}
LASTING, FIRST = [[0.9, 0.1], [0.3, 0.7]], [0.8, 0.2]


def failing(
    modes=SENSOR, transition=LASTING, first=FIRST, state="0.9*x + 0.7*v", mean=3, variance=4
):
    """A sensor that fails."""
    chain = {"modes": modes, "transition": transition, "first": first}
    return JumpModel.define(state, "x + C*w", **chain, prior={"mean": mean, "variance": variance})


AFFINE = JumpModel.define(
    "c*x + r + s*v",
    "g*x + f*w",
    {"c": 0.9, "r": 0.0, "s": 0.5, "g": 1.0, "f": 0.5},
    modes={
        "calm": {},
        "carried": {"parameters": {"c": 1.1, "r": 1.0, "g": 0.5}},
        "wild": {"parameters": {"s": 2.0, "f": 1.0}},
    },
    transition=[[0.8, 0.15, 0.05], [0.3, 0.6, 0.1], [0.25, 0.25, 0.5]],
    first=[0.5, 0.3, 0.2],
)
ONE_MODE = {"modes": {"a": {}}, "transition": [1]}
CHAINS = {
    1: JumpModel.define("x + v", "x + w", **ONE_MODE),
    2: JumpModel.define(
        "x + v", "x + w", modes={"a": {}, "b": {}}, transition=LASTING, first=FIRST
    ),
}
CURVED = JumpModel.define(
    "x - 0.4*sin(x) + s*v",
    "g*x + 0.3*x**2 + f*(1 + x**2)*w",
    {"s": 0.4, "g": 1.0, "f": 0.3},
    modes={"up": {}, "down": {"parameters": {"g": -1.0, "s": 0.8}}},
    transition=LASTING,
    first=FIRST,
)


def of(build, model, kind=gaussian):
    return build([kind(mode) for mode in model.modes], model)


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
            assert_allclose(probability[k, trajectory], expected, atol=1e-3)
        assert abs(total[trajectory] - evidence) < 6e-3


@pytest.mark.parametrize("name", FAULTS)
def test_a_long_fault_leaves_the_exact_filter_sure_of_itself(name):
    """What panels lack lies at their ends, not where modes that hardly anybody believes have led;
    and where transitions depend on the state it goes one way, not all.

    The filter that thought otherwise saw its loss grow with each measurement of a fault, until the
    last had no posterior: the lab's comparisons of these variants had no bound.  The reference is a
    grid of both densities, 1,801 points, .05 apart, where the object's noise has the deviation .7.
    """
    model, y = find_variant(name).model, np.array(FAULTS[name].split(), dtype=float)
    x = np.linspace(-40, 50, 1801)
    kernel, (mean, cov) = norm.pdf(x[:, None], 0.9 * x, 0.5**0.5), model.prior
    chain = model.transition_of(x[:, None], 0)
    density = model.first[:, None] * norm.pdf(x, mean[0], cov[0, 0] ** 0.5)
    for measured, state in zip(y, list(walk(pointmass(model), y[:, None, None]))[1:], strict=True):
        density *= [norm.pdf(measured, x, deviation) for deviation in (1, 10)]
        density /= density.sum()
        expected = (density @ x).sum()
        sd = (density @ (x - expected) ** 2).sum() ** 0.5
        (error,) = state.memory.error
        assert error < 0.01
        assert abs(state.posterior.mean[0, 0] - expected) < error * sd
        assert abs(state.posterior.cov[0, 0, 0] ** 0.5 / sd - 1) < error
        density = np.einsum("im,mij->jm", density, chain) @ kernel.T


# --- filters of one law for each mode


def test_what_is_merged_when():
    """Nothing is merged before y_0, pairs of modes by GPB2 only after y_1: so far they are
    exact."""
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
                    assert_allclose(probability[k, trajectory], expected, atol=1e-9)


def test_a_mode_that_no_measurement_believes_does_not_take_the_filter_away():
    """The faulty accelerometers of the landing show a hundredth: corrected as if they did, a sound
    flight leaves the numbers.

    GPB2 went on from such a law, of probability 0, for ever.  Where all modes lead on, it must not
    matter: whoever merges sooner forgets it by himself, and as each measurement here leaves no
    doubt of the mode, both estimate the same.
    """
    model = find_variant("J3").model
    y = simulate(model, 100, 25, seed=1).y
    both = [run(of(build, model, linearised), y) for build in (gpb2, logic_dynamic)]
    assert all(np.isfinite(part).all() for law in both for part in law)
    spread = np.sqrt(np.diagonal(both[1].cov, axis1=-2, axis2=-1))
    assert (np.abs(both[0].mean - both[1].mean) < 1e-6 * spread).all()


def test_a_chain_that_changes_with_time():
    """The sensor fails at step 5 and at no other: from then on the second mode is certain."""
    model = failing(transition=[["Heaviside(3.5 - k)", "Heaviside(k - 3.5)"], [0, 1]], first=[1, 0])
    y = simulate(model, 3, 10, seed=1)
    assert (y.mode == (np.arange(10) >= 5)[:, None]).all()
    for filter_ in (of(logic_dynamic, model), of(gpb2, model), pointmass(model)):
        probability = follow(filter_, y.y)[2]
        assert_allclose(probability[..., 1], np.tile((np.arange(10) >= 5)[:, None], 3), atol=1e-12)


# --- the FOS with modes


# What each remembers of (y_k, y_k-1, ...), (z_k, z_k-1, ...).
REMEMBERING = {
    "fos": (logic_dynamic_fos, (0, 1)),
    "fkp": (partial(logic_dynamic_fkp, memory=5), (5, 0)),
    "fbp": (partial(logic_dynamic_fbp, memory=3), (0, 3)),
}


def in_each_mode(block, modes):
    """Each trajectory once in each mode."""
    mode = np.repeat(np.arange(modes), len(block.x))
    return Instant(*(np.concatenate([part] * modes) for part in block[:3]), mode, mode)


@pytest.mark.parametrize("modes", CHAINS)
@pytest.mark.parametrize("family", REMEMBERING)
def test_without_jumps_a_linear_model_has_its_kalman_filter(family, modes):
    """With moments that are exact, and a memory that holds all there is; rounding as for the
    filters without modes."""
    system, steps = LINEAR["n=2, p=2"], 5
    plain = system.model()
    model = replace(CHAINS[modes], modes=(plain,) * modes)
    build, _ = REMEMBERING[family]
    moments = [in_each_mode(moment, modes) for moment in exact_ensemble(system, steps, seed=3)]
    (filter_,) = design([build(model, [gaussian(plain)] * modes)], moments)
    y = simulate(plain, 4, steps, seed=8).y
    for ours, expected in zip(run(filter_, y), run(kalman_filter(plain), y), strict=True):
        assert_allclose(ours, expected, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("family", REMEMBERING)
def test_filters_of_optimal_structure_with_modes_on_their_design_ensemble(family):
    """The note's equations by hand: regressions and normal laws over the trajectories of each mode,
    for a scalar sensor; a measurement that is missing is remembered as what all modes expect."""
    with_modes, (measurements, estimates) = REMEMBERING[family]
    model, runs, steps = failing(), 500, 6
    blocks = list(Ensemble(model, runs, steps, seed=3))
    (filter_,) = design([with_modes(model, [gaussian(mode) for mode in model.modes])], blocks)
    state, c = filter_.init(runs), np.tile(model.first, (runs, 1))
    m, d = np.full((2, runs), 3.0), np.full((2, runs), 4.0)
    variance, pi, ys, zs = np.array([1.0, 100.0]), np.array(LASTING), [], []
    for k, block in enumerate(blocks):
        x, y = block.x[:, 0], block.y[:, 0]
        L = norm.pdf(y, m, np.sqrt(d + variance[:, None]))
        mu = c.T * L / (c.T * L).sum(axis=0)
        z = (mu * (m + d / (d + variance[:, None]) * (y - m))).sum(axis=0)
        gap = filter_.step(state, np.where(np.arange(runs)[:, None] == 7, np.nan, block.y))
        expected = np.full(1 + bool(measurements), (c.T * m).sum(axis=0)[7])
        memory = gap.memory.kept.measurements[:1]
        holes = [gap.posterior.mean[7, 0], *(row[7, 0] for row in memory)]
        assert_allclose(holes, expected, rtol=1e-7)
        state = filter_.step(state, block.y)
        assert_allclose(state.posterior.mean[:, 0], z, rtol=1e-7)
        assert_allclose(state.memory.probability, mu.T, rtol=1e-6, atol=1e-9)
        ys, zs = [y, *ys], [z, *zs]
        zeta = np.stack(ys[:measurements] + zs[:estimates])
        u, T, xi = np.empty((2, runs)), np.empty(2), np.empty((2, runs))
        for i in (0, 1):
            there = block.mode == i
            rows = np.vstack([zeta, np.ones(runs)]).T
            u[i] = rows @ np.linalg.lstsq(rows[there], x[there])[0]
            T[i] = np.var((x - u[i])[there])
            law = multivariate_normal(
                zeta[:, there].mean(axis=1), np.cov(zeta[:, there], bias=True)
            )
            xi[i] = model.law_at(k)[i] * law.pdf(zeta.T)
        xi /= xi.sum(axis=0)
        c = xi.T @ pi
        for j in (0, 1):
            w = xi * pi[:, [j]] / c[:, j]
            tau = 0.9 * u
            m[j] = (w * tau).sum(axis=0)
            d[j] = (w * (0.81 * T[:, None] + 0.49 + (tau - m[j]) ** 2)).sum(axis=0)


def test_a_design_without_a_trajectory_in_a_mode_says_so():
    rare = failing(transition=[[1 - 1e-9, 1e-9], [0.5, 0.5]], first=[1, 0])
    with pytest.raises(NotFinite, match="no trajectory of the design is in a mode"):
        design(
            [logic_dynamic_fos(rare, [gaussian(mode) for mode in rare.modes])],
            Ensemble(rare, 100, 3, seed=1),
        )


TURNING = JumpModel.define("x + v", "x + w", **ONE_MODE, angles=["x", "y"])
PLANE = JumpModel.define(["x1 + v1", "x2 + v2"], "x1 + w", **ONE_MODE)


@pytest.mark.parametrize(
    ("build", "model", "problem"),
    [
        (pointmass, PLANE, "scalar models"),
        (pointmass, JumpModel.define("x + v", "x", **ONE_MODE), "no noise enters the meter"),
        *(
            (
                lambda model, build=build: build(model, [gaussian(mode) for mode in model.modes]),
                TURNING,
                f"the logic-dynamic {name} takes no components that are angles",
            )
            for build, name in (
                (logic_dynamic_fos, "FOS"),
                (logic_dynamic_fkp, "FKP4"),
                (logic_dynamic_fbp, "FBP4"),
            )
        ),
        (
            lambda model: averaged(model, [linearised(mode) for mode in model.modes]),
            TURNING,
            "angles have no average",
        ),
    ],
)
def test_models_that_a_filter_cannot_take_are_refused(build, model, problem):
    with pytest.raises(ModelError, match=problem):
        build(model)


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
    A, Q = structure.transition(mean, cov)

    for sample, first, second, slope in ((x_next, tau, theta, A), (y, h, F, G)):
        away = sample - sample.mean()
        oracles.is_mean(first.item(), sample)
        oracles.is_mean(second.item(), away**2)
        oracles.is_mean(0.5 * slope.item(), (x[:, 0] - 0.7) * away)
    assert_allclose(F, G * 0.5 * G + R, rtol=1e-12)
    assert_allclose(theta, A * 0.5 * A + Q, rtol=1e-12)
