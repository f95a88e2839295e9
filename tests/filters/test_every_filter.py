"""What holds for every filter: on a linear model the Kalman filter, no correction without a
measurement, one trajectory is an ensemble of one, a state is never changed, no NaN, the same seed
the same bytes, other units the same estimate."""

import pickle
from functools import cache, partial
from types import SimpleNamespace

import numpy as np
import oracles
import pytest
import sympy as sp
from numpy.testing import assert_allclose
from weekly import weekly

from kfcourse import (
    Ensemble,
    JumpModel,
    Model,
    design,
    gauss_hermite,
    gaussian,
    likelihood,
    linearised,
    predictions,
    run,
    simulate,
    smooth,
    unscented,
)
from kfcourse.filters import (
    EQUATIONS,
    adaptive,
    alpha_beta,
    aof,
    dfkp,
    dfmp,
    duof,
    fbp,
    fkp,
    fos,
    gated,
    gpb2,
    imm,
    iterated,
    kalman_filter,
    logic_dynamic,
    logic_dynamic_fbp,
    logic_dynamic_fkp,
    logic_dynamic_fos,
    mdfkp,
    mdfmp,
    mfkp,
    mfos,
    particle,
    pointmass,
    robust,
)
from kfcourse.filters.alphabeta import steady_beta
from kfcourse.lab import find_variant
from kfcourse.montecarlo.ensemble import Instant
from kfcourse.scenarios.radar import kinematic

STEPS = 6
CHAIN = [[0.9, 0.1], [0.3, 0.7]]
STRUCTURES = {
    "linearised": linearised,
    "gaussian": gaussian,
    "unscented": unscented,
    "gauss-hermite": lambda model: gauss_hermite(model, 3),
}
READY = {
    **{kind: lambda model, of=of: aof(of(model)) for kind, of in STRUCTURES.items()},
    "iterated": lambda model: iterated(linearised(model)),
    "robust": lambda model: robust(linearised(model)),
    "Huber": lambda model: robust(linearised(model), edge=1.5),
    "gated": lambda model: gated(aof(linearised(model))),
    "adaptive": lambda model: adaptive(linearised(model)),
    "imm": lambda model: imm([linearised(model), unscented(model)], CHAIN),
    "logic-dynamic": lambda model: logic_dynamic([linearised(model), unscented(model)], CHAIN),
    "gpb2": lambda model: gpb2([linearised(model), unscented(model)], CHAIN),
}
NEUTRAL = {  # what makes these filters the one that believes its model
    **{kind: READY[kind] for kind in (*STRUCTURES, "imm", "logic-dynamic", "gpb2")},
    "iterated": lambda model: iterated(unscented(model), 3),
    "robust": lambda model: robust(gaussian(model), degrees=np.inf),
    "Huber": lambda model: robust(linearised(model), edge=np.inf),
    "gated": lambda model: gated(kalman_filter(model), 1 - 1e-12),
    "adaptive": lambda model: adaptive(linearised(model), window=np.inf),
}
OF_MEASUREMENTS = (fkp, mfkp, dfkp, mdfkp)
WITH_MODES = (logic_dynamic_fos, logic_dynamic_fkp, logic_dynamic_fbp)


def designs(structure, memory):
    """All filters with coefficients; `memory` steps for those that remember measurements."""
    return [
        *(family(structure, arguments) for family in (fos, mfos) for arguments in (2, 3)),
        dfmp(structure),
        mdfmp(structure),
        fbp(structure, 3),
        *(of(structure, memory) for of in OF_MEASUREMENTS),
    ]


@cache
def every(name):
    """Measurements (STEPS, 8, p) of a shipped variant, all its filters, designed on 300
    trajectories, and the slow ones."""
    model = find_variant(name).model
    if isinstance(model, JumpModel):
        structures = [gaussian(mode) for mode in model.modes]
        ready = [of(structures, model) for of in (imm, logic_dynamic, gpb2)]
        plans = [of(model, structures) for of in WITH_MODES]
    else:
        ready = [build(model) for build in READY.values()]
        plans = [duof(model), *designs(gaussian(model), 2)]
    designed = design(plans, Ensemble(model, 300, STEPS, seed=1))
    slow = [particle(model, 100), *([pointmass(model)] if model.n == model.p == 1 else [])]
    return simulate(model, 8, STEPS, seed=2).y, ready + designed, slow


# ---------------------------------------------------------------- linear models


class Linear(SimpleNamespace):
    """x' = A x + B v + a, y = H x + C w + b with laws of x_0, v, w: matrices, and the model."""

    def at(self, k: int):
        return self.A, self.B, self.a, self.H, self.C, self.b

    def model(self) -> Model:
        names = {
            letter: [f"{letter}{i + 1}" for i in range(len(mean))]
            for letter, (mean, _) in zip("xvw", self.laws.values(), strict=True)
        }
        x, v, w = (sp.Matrix([sp.Symbol(n, real=True) for n in row]) for row in names.values())
        A, B, a, H, C, b = map(sp.Matrix, self.at(0))
        return Model.define(
            list(A * x + B * v + a),
            list(H * x + C * w + b),
            symbols=names,
            **oracles.as_tables(self.laws),
        )


def linear(n: int, p: int, v: int, w: int, seed: int) -> Linear:
    """Everything non-unit, non-zero and correlated; rounded so that the strings are exact."""
    rng = np.random.default_rng(seed)

    def matrix(rows, columns):
        return np.round(rng.normal(size=(rows, columns)), 2)

    def law(size):
        root = matrix(size, size)
        return np.round(rng.normal(size=size), 2), np.round(root @ root.T + 0.3 * np.eye(size), 4)

    A = matrix(n, n)
    A = np.round(0.9 * A / max(abs(np.linalg.eigvals(A))), 2)
    laws = {"prior": law(n), "state_noise": law(v), "meter_noise": law(w)}
    return Linear(
        A=A,
        B=matrix(n, v),
        a=matrix(1, n)[0],
        H=matrix(p, n),
        C=matrix(p, w),
        b=matrix(1, p)[0],
        laws=laws,
    )


LINEAR = {
    "scalar, more noises": linear(1, 1, 2, 3, 12),
    "n=2, p=2": linear(2, 2, 2, 2, 14),
    "n=3, p=2": linear(3, 2, 3, 2, 19),
    "n=1, p=2": linear(1, 2, 1, 2, 17),
    "changing": oracles.Changing(),
}


def exact_ensemble(system: Linear | oracles.Changing, steps: int, seed: int) -> list[Instant]:
    """Trajectories whose sample moments are exactly the model's.

    A random matrix (trajectories x all independent noises), centred, orthonormalised and scaled,
    has sample mean 0 and sample covariance I to rounding; the trajectories are affine functions of
    its columns.
    """
    sizes = {key: len(mean) for key, (mean, _) in system.laws.items()}
    columns = sizes["prior"] + steps * (sizes["state_noise"] + sizes["meter_noise"])
    draws = np.random.default_rng(seed).normal(size=(3 * columns, columns))
    orthonormal, _ = np.linalg.qr(draws - draws.mean(axis=0))
    standard = iter((orthonormal * np.sqrt(len(draws))).T)

    def draw(key):
        mean, cov = system.laws[key]
        return mean + np.stack([next(standard) for _ in mean], axis=-1) @ np.linalg.cholesky(cov).T

    x, moments = draw("prior"), []
    for k in range(steps):
        A, B, a, H, C, b = system.at(k)
        y = x @ H.T + draw("meter_noise") @ C.T + b
        x_next = x @ A.T + draw("state_noise") @ B.T + a
        moments.append(Instant(x, y, x_next))
        x = x_next
    return moments


@pytest.mark.parametrize("name", LINEAR)
def test_on_a_linear_gaussian_model_every_filter_is_the_kalman_filter(name):
    """Every filter equals the Kalman filter when the model is linear and Gaussian; and that is the
    loop of the textbook, with the matrices of each step.

    AOF: the structural functions of a linear model are exact whatever the approximation, and the
    posterior is Gaussian, so its mean and covariance are the exact ones.  DUOF, FOS, MFOS: their
    estimates are affine in the noises, so all that the design takes from the ensemble is means and
    covariances of affine functions of the noises; in `exact_ensemble` these are the model's.
    Pugachev's corrections find the Kalman gain because nothing affine in the innovation does
    better, and the FOS's condition finds Cov(x, z) = Cov(z) (the error is orthogonal to the
    estimate), so Gamma is the identity on all values that z takes, u = z and T = p.  Where Cov(z),
    Cov(sigma) or Cov(y, z) is singular (fewer measurements than components; z_0 an affine function
    of y_0), the pseudo-inverse acts on the values that occur, and estimates are unchanged.

    Tolerance: rounding (1e-16) times the condition of the regressions (the least non-zero
    eigenvalue of the correlations of (y, z) is above 1e-7 here), and each of the six steps carries
    the error of the one before.
    """
    model, moments = LINEAR[name].model(), exact_ensemble(LINEAR[name], STEPS, seed=3)
    plans = [duof(model)]
    for build in (linearised, gaussian):
        plans += designs(build(model), STEPS)
    # all that there are
    assert {
        plan.name.rstrip("0123456789").partition("-")[0].rstrip("0123456789") for plan in plans
    } == {*EQUATIONS} - {"aof"}
    y = simulate(model, 5, STEPS, seed=8).y  # new trajectories, not those of the design
    y[0, 2] = y[2, 1] = np.nan
    expected, ahead = run(kalman_filter(model), y), predictions(kalman_filter(model), y)
    steps, prior = oracles.steps_of(LINEAR[name], STEPS), LINEAR[name].laws["prior"]
    for i in range(5):
        _, right = zip(*oracles.kalman_loop(steps, prior, y[:, i]), strict=True)
        for ours, wanted in zip(expected, zip(*right, strict=True), strict=True):
            assert_allclose(ours[:, i], wanted, rtol=1e-9, atol=1e-9)

    def agree(actual, wanted, tolerance):
        assert_allclose(actual, wanted, rtol=tolerance, atol=tolerance, err_msg=filter_.name)

    for filter_ in (build(model) for build in NEUTRAL.values()):
        for actual, wanted in zip(run(filter_, y), expected, strict=True):
            agree(actual, wanted, 1e-10)
    for filter_ in design(plans, moments):
        for actual, wanted in zip(run(filter_, y), expected, strict=True):
            agree(actual[:, [0, 3, 4]], wanted[:, [0, 3, 4]], 1e-9)
        # in the place of what is missing stands what was expected, also among what is remembered
        for trajectory, known in ((2, 2), (1, 4)):
            before = predictions(filter_, y).mean[:known, trajectory]
            agree(before, ahead.mean[:known, trajectory], 1e-9)


# a gate refuses 80 after 100
@pytest.mark.parametrize("kind", ["kalman", *(kind for kind in NEUTRAL if kind != "gated")])
@pytest.mark.parametrize(("variance", "r"), [(1e8, 1.0), (1e4, 1e-4), (1e14, 1.0)])
def test_two_components_of_one_quantity_share_their_information(kind, variance, r):
    """x' = x, y = (x + w1, x + w2) from a wide prior: means of all measurements, variances r / 2, r
    / 4, r / 6."""
    prior, noise = {"mean": 0, "variance": variance}, {"variance": [[r, 0], [0, r]]}
    model = Model.define("x + 0*v", ["x + w1", "x + w2"], prior=prior, meter_noise=noise)
    result = run(
        (NEUTRAL | {"kalman": kalman_filter})[kind](model),
        np.array([[100.3, 99.2], [80, 80], [80, 80]])[:, None],
    )
    # the prior's weight r / variance, and the rounding of variance + r, squared in the variance
    assert_allclose(result.cov.ravel() / r, [1 / 2, 1 / 4, 1 / 6], rtol=1e-3)
    assert_allclose(result.mean.ravel(), [99.75, 89.875, 259.75 / 3], rtol=1e-3)


# ---------------------------------------------------------------- any model


@pytest.mark.parametrize("name", ["53", "20", "J1"])
def test_a_missing_measurement_is_no_correction_and_the_others_do_not_notice(name):
    y, quick, slow = every(name)
    gaps, others = y.copy(), np.arange(8) != 4
    gaps[3, 4] = np.nan
    for filter_ in [*quick, *slow]:
        state, holed = filter_.init(8), filter_.init(8)
        for k in range(STEPS):
            predicted = holed.predicted
            state, holed = filter_.step(state, y[k]), filter_.step(holed, gaps[k])
            # resampled particles are others where one record is another
            if k <= 3 or filter_ in quick:
                assert_allclose(
                    holed.posterior.mean[others],
                    state.posterior.mean[others],
                    rtol=1e-12,
                    atol=1e-300,
                    err_msg=filter_.name,
                )
            if k == 3 and filter_ in quick:  # predictions of the others are such steps
                before, after = (
                    np.broadcast_to(law.cov, (8, *law.cov.shape[-2:]))[4]
                    for law in (predicted, holed.posterior)
                )
                off = np.abs(holed.posterior.mean[4] - predicted.mean[4])
                assert (off <= 1e-9 * np.sqrt(np.diagonal(before))).all(), filter_.name
                # a fitted correction has one covariance for all, whether a measurement came or not
                if not filter_.name.startswith(("duof", "m")):
                    assert_allclose(after, before, rtol=1e-3, err_msg=filter_.name)
        assert np.isfinite(holed.posterior.mean).all(), filter_.name


@pytest.mark.parametrize("kind", STRUCTURES)
def test_with_one_component_missing_the_other_counts(kind):
    state, meter = (
        ["x1 + 0.1*x2 + 0.1*v1", "x2 - 0.1*x1**3 + 0.2*v2"],
        ["x1**2 + x2 + 0.3*w1", "x1 + x1*x2/2 + 0.2*w2"],
    )
    both = Model.define(state, meter)
    alone = Model.define(state, [meter[1]], symbols={"w": ["w1", "w2"]})
    y = simulate(both, 6, 5, seed=12).y
    holed = y.copy()
    holed[:, :, 0] = np.nan
    for of in (aof, iterated, robust):
        result, expected = (
            run(of(STRUCTURES[kind](both)), holed),
            run(of(STRUCTURES[kind](alone)), y[..., 1:]),
        )
        assert_allclose(result.mean, expected.mean, rtol=1e-9, atol=1e-10)
        assert_allclose(result.cov, expected.cov, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("name", ["53", "20", "J1"])
def test_one_trajectory_is_an_ensemble_of_one(name):
    y, quick, slow = every(name)
    for filter_ in [*quick, *slow[1:]]:  # not particles: each ensemble has its own
        result, alone = run(filter_, y), run(filter_, y[:, 5:6])
        for many, single in zip(result, alone, strict=True):
            assert_allclose(many[:, 5], single[:, 0], rtol=1e-9, atol=1e-300, err_msg=filter_.name)


@pytest.mark.parametrize("name", ["53", "20", "J1"])
def test_a_step_changes_no_state_and_gives_the_same_bytes_again(name):
    y, quick, slow = every(name)
    for filter_ in [*quick, *slow]:
        state = filter_.step(filter_.init(8), y[0])
        before = pickle.dumps(state)
        first, second = filter_.step(state, y[1]), filter_.step(state, y[1])
        assert pickle.dumps(state) == before, filter_.name
        assert [law.mean.tobytes() for law in first[1:3]] == [
            law.mean.tobytes() for law in second[1:3]
        ], filter_.name
        assert (state.step, first.step) == (1, 2), filter_.name
        assert filter_.slow == (filter_.name == "particle"), filter_.name


@pytest.mark.parametrize("name", ["53", "20", "J1"])
@pytest.mark.parametrize("value", [0.0, 1e3, -1e3])
def test_no_measurement_makes_nan(name, value):
    y, quick, slow = every(name)
    for filter_ in [*quick, slow[0]]:  # the exact filter says what it does not resolve
        result = run(filter_, np.full_like(y[:3, :2], value))
        assert np.isfinite(result.mean).all() and np.isfinite(result.cov).all(), filter_.name


def test_the_same_seed_gives_the_same_bytes():
    model = find_variant("53").model
    x, y = simulate(model, 200, 3, seed=1)
    again = [
        design([duof(model), mfos(gaussian(model))], [Instant(x[0], y[0], x[1])]) for _ in range(2)
    ]
    for left, right in zip(*again, strict=True):
        assert run(left, y[:1]).mean.tobytes() == run(right, y[:1]).mean.tobytes()
    left, right, other = (
        run(particle(model, 40, seed), y[:, :3]).mean.tobytes() for seed in (1, 1, 2)
    )
    assert left == right != other


OF_A_STRUCTURE = [*(partial(f, memory=2) for f in OF_MEASUREMENTS), aof, iterated, robust]
OF_A_STRUCTURE += [adaptive, fos, dfmp]
OF_A_MODEL = [kalman_filter, duof, particle, pointmass, linearised, gaussian, unscented]


@pytest.mark.parametrize(
    ("build", "wanted"),
    [
        *((build, "a Structure, got Model") for build in OF_A_STRUCTURE),
        *((build, "a Model, got Structure") for build in OF_A_MODEL),
    ],
)
def test_what_is_of_the_wrong_kind_is_refused(build, wanted):
    model = find_variant("53").model
    with pytest.raises(TypeError, match=f"expects {wanted}"):
        build(model if wanted.endswith("Model") else linearised(model))


SCALAR = linearised(Model.define("0.9*x + v", "x + w"))
ANGULAR = linearised(Model.define("x + 0.1*v", "x + 0.1*w", angles=["x", "y"]))
JUMPING = find_variant("J1").model
WITHIN_MODES = [gaussian(mode) for mode in JUMPING.modes]
MEMORY = "memory must be a positive whole number, got "
NAN = float("nan")
REFUSED = [  # what is called, with what: what the message says
    (lambda p: gated(aof(SCALAR), p), (0, 1, 1.5, NAN), "probability must lie between"),
    (
        lambda n: gated(aof(SCALAR), patience=n),
        (0, 2.0, True, "3"),
        "patience must be a positive whole number",
    ),
    (lambda d: robust(SCALAR, degrees=d), (0, -1, NAN), "degrees must be positive"),
    (lambda c: robust(SCALAR, edge=c), (0, -1.0, NAN), "edge must be positive"),
    (lambda n: robust(SCALAR, rounds=n), (0, 1.5, True), "rounds must be a positive whole number"),
    (
        lambda n: iterated(SCALAR, n),
        (0, 1.5, True, "3", NAN),
        "iterations must be a positive whole number",
    ),
    *((partial(of, SCALAR), (1, "2"), "2 or 3 arguments") for of in (fos, mfos)),
    *((partial(of, SCALAR), (0, 2.5, True, "4"), MEMORY) for of in (*OF_MEASUREMENTS, fbp)),
    *((partial(of, JUMPING, WITHIN_MODES), (2.5,), MEMORY) for of in WITH_MODES[1:]),
    (
        fkp,
        (ANGULAR,),
        r"fkp4 regresses the state on measurements, and angles jump.*fbp\(structure, memory\)",
    ),
    (lambda a: pointmass(SCALAR.model, a), (0, 1, -1e-3, 1e-9, NAN), "1e-06 <= accuracy < 1"),
    (lambda n: particle(SCALAR.model, n), (1, 10.0), "at least 2 particles, got "),
    (particle, (Model.define("x + v", "x + w**2"),), "noise enters nonlinearly"),
    (kalman_filter, (find_variant("53").model,), "not linear"),
    (lambda w: adaptive(SCALAR, window=w), (1, 0, NAN), "window must be more than one"),
    (steady_beta, (0.0, 1.0, -0.1, NAN), "lies between 0 and 1"),
    (
        lambda pair: alpha_beta(kinematic(0.7), *pair),
        ((0.3, 0.0), (0.3, 3.5), (-0.1, 0.01), (2.5, 0.1), (NAN, 0.1)),
        "is unstable",
    ),
]


@pytest.mark.parametrize(
    ("build", "value", "problem"), [(b, v, text) for b, values, text in REFUSED for v in values]
)
def test_what_no_filter_can_be_built_of_is_refused(build, value, problem):
    with pytest.raises(ValueError, match=problem):
        build(value)


# ---------------------------------------------------------------- units

# Old units in new ones.  They are powers of two: each number then rounds as before.
OF_STATE, OF_METER = np.array([2.0**20, 2.0**-30]), np.array([2.0**-11, -(2.0**16)])
# in standard deviations, and of ln p: SymPy may order the terms of a formula otherwise
ROUNDING = 1e-9


def in_units(model: Model) -> Model:
    """z = S x and u = T y in place of x and y, S and T diagonal."""
    s, t = OF_STATE[: model.n], OF_METER[: model.p]
    S, T = (sp.diag(*map(sp.Rational, scale.tolist())) for scale in (s, t))
    state, meter = model.state_equation.subs(model.values), model.meter_equation.subs(model.values)
    old = dict(zip(model.x, S.inv() * sp.Matrix(model.x), strict=True))
    return Model.define(
        list(S * state.subs(old)),
        list(T * meter.subs(old)),
        symbols={name: [str(symbol) for symbol in getattr(model, name)] for name in "xvw"},
        prior={"mean": s * model.prior.mean, "variance": s[:, None] * model.prior.cov * s},
        state_noise=dict(zip(("mean", "variance"), model.state_noise, strict=True)),
        meter_noise=dict(zip(("mean", "variance"), model.meter_noise, strict=True)),
    )


def assert_same(result, expected):
    """Laws in new units and in old ones: both as in old ones, in standard deviations."""
    s = OF_STATE[: expected.mean.shape[-1]]
    sd = np.sqrt(np.diagonal(expected.cov, axis1=-2, axis2=-1))
    assert_allclose(result.mean / s / sd, expected.mean / sd, rtol=0, atol=ROUNDING)
    assert_allclose(
        result.cov / s / s[:, None] / sd[..., None] / sd[..., None, :],
        expected.cov / sd[..., None] / sd[..., None, :],
        rtol=0,
        atol=ROUNDING,
    )


@pytest.mark.parametrize("name", weekly(zip(["3", "9", "20", "21"])))
def test_filters_smoothers_and_likelihoods_are_the_same_in_other_units(name):
    model = find_variant(name).model
    other, y = in_units(model), simulate(model, 20, 8, seed=1).y.copy()
    y[3, ::3] = np.nan
    seen, log_of_units = OF_METER[: model.p] * y, np.log(np.abs(OF_METER[: model.p])).sum()
    exact = (
        {"pointmass": lambda model: pointmass(model, accuracy=1e-6)}
        if model.n == model.p == 1
        else {}
    )
    smoothed = [*STRUCTURES, "iterated", "robust", "gated", "adaptive", *exact]
    for kind, build in {**READY, **exact}.items():
        assert_same(run(build(other), seen), run(build(model), y))
        if kind in smoothed:
            assert_same(smooth(build(other), seen), smooth(build(model), y))
        expected = likelihood(build(model), y) - np.where(np.isnan(y[..., 0]), 0, log_of_units)
        assert_allclose(likelihood(build(other), seen), expected, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("name", ["53", "9", "20"])
def test_designs_from_the_same_trajectories_are_the_same_in_other_units(name):
    model, steps = find_variant(name).model, 5
    scaled, s, t = in_units(model), OF_STATE, OF_METER
    families = [
        duof,
        *(lambda model, of=of: of(gaussian(model)) for of in (fos, mfos, partial(fkp, memory=2))),
    ]
    x, y = simulate(model, 400, steps + 1, seed=2)
    z, u = s[: model.n] * x, t[: model.p] * y
    here = design(
        [of(model) for of in families], (Instant(x[k], y[k], x[k + 1]) for k in range(steps))
    )
    there = design(
        [of(scaled) for of in families], (Instant(z[k], u[k], z[k + 1]) for k in range(steps))
    )
    for filter_, other in zip(here, there, strict=True):
        assert_same(run(other, u[:steps, :50]), run(filter_, y[:steps, :50]))
