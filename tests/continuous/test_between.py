"""Measurements at instants: Kalman's filter by matrix exponentials, slow Euler loops, closed forms,
published figures."""

import dataclasses

import numpy as np
import oracles
import pytest
import scipy.linalg
import sympy as sp
from numpy.testing import assert_allclose, assert_array_equal

from kfcourse import (
    Model,
    ModelError,
    NoClosedForm,
    NotFinite,
    compare,
    gauss_hermite,
    gaussian,
    likelihood,
    linearised,
    predictions,
    read_measurements,
    run,
    simulate,
    smooth,
    unscented,
)
from kfcourse.continuous import benes_filter, moment_equations, sampled
from kfcourse.filters import aof, duof, fos, kalman_filter
from kfcourse.lab import VariantError, find_variant, read_variant
from kfcourse.lab.variants import summary
from kfcourse.montecarlo.cramer_rao import posterior_bound
from kfcourse.records import estimate
from kfcourse.scenarios.benchmarks import (
    PUBLISHED,
    benes,
    double_well,
    exact_mul,
    jimenez_data,
)

INSTANTS = [0.2, 0.5, 1.7, 1.9, 4.0, 4.3]
A = np.array([[-0.2, 1.0], [-2.0, -0.7]])
B = np.array([[0.5, 0.2], [-0.3, 0.8]])
H = np.array([[1.0, 0.3], [0.2, -1.0]])
R = np.array([[0.3, 0.1], [0.1, 0.4]])
PRIOR = np.array([0.5, -0.4]), np.array([[0.8, 0.2], [0.2, 0.6]])
FORCE = [0.3, -1.0, 0.7, 2.0, 0.1, 0.0]
CUBIC = " - 1e-14*x1**3"  # so small that it is none, but the equations are integrated


def oscillator(extra="", **changes):
    """Two states, correlated noises and meters, a force that is known: nothing unit, nothing
    diagonal."""
    return sampled(
        [f"-0.2*x1 + x2{extra}", "-2*x1 - 0.7*x2 + u + 0.1"],
        [["0.5", "0.2"], ["-0.3", "0.8"]],
        ["x1 + 0.3*x2 + w1", "0.2*x1 - x2 + w2"],
        prior={"mean": PRIOR[0], "variance": PRIOR[1]},
        meter_noise={"variance": R},
        inputs={"u": FORCE},
        **({"instants": INSTANTS} | changes),
    )


def transitions():
    """exp(A dt), what the force adds, and the noise's covariance, the last two by Simpson's rule
    over two thousand intervals."""
    spans = [*np.diff(INSTANTS), 4.3 - 4.0]
    for span, u in zip(spans, FORCE, strict=True):
        s = np.linspace(0, span, 2001)
        rule = np.where(np.arange(2001) % 2, 4.0, 2.0)
        rule[[0, -1]] = 1
        rule *= span / 6000
        values, vectors = np.linalg.eig(A)
        powers = np.einsum(
            "ij,sj,jk->sik", vectors, np.exp(s[:, None] * values), np.linalg.inv(vectors)
        ).real
        shift = np.einsum("s,sij,j", rule, powers, np.array([0, u + 0.1]))
        Q = np.einsum("s,sij,jk,slk->il", rule, powers, B @ B.T, powers)
        yield scipy.linalg.expm(A * span), shift, Q


def record():
    y = np.random.default_rng(3).normal(size=(6, 4, 2))
    y[2, 1], y[4, :, 0] = np.nan, np.nan
    return y


STEPS = [(Phi, shift, Q, H, np.zeros(2), R) for Phi, shift, Q in transitions()]


@pytest.mark.parametrize(("extra", "allowed"), [("", 1e-11), (CUBIC, 1e-8)])
@pytest.mark.parametrize("structure", [linearised, gaussian, unscented, gauss_hermite])
def test_a_linear_model_has_kalmans_filter(structure, extra, allowed):
    """By the exponential of its matrix, but for Simpson's rule, 1e-13; or integrated, some tens of
    steps."""
    filter_, y = aof(structure(oscillator(extra, accuracy=1e-9))), record()
    ours = predictions(filter_, y), run(filter_, y)
    for i in range(4):
        for k, laws in enumerate(oracles.kalman_loop(STEPS, PRIOR, y[:, i])):
            for law, wanted in zip(ours, laws, strict=True):
                assert_allclose(law.mean[k, i], wanted[0], rtol=0, atol=allowed)
                assert_allclose(law.cov[k, i], wanted[1], rtol=0, atol=allowed)


@pytest.mark.parametrize(("extra", "allowed"), [("", 1e-10), (CUBIC, 1e-7)])
def test_smoother_and_likelihood_are_the_regression_on_the_whole_record(extra, allowed):
    y, filter_ = record(), aof(gaussian(oscillator(extra, accuracy=1e-9)))
    law, density = smooth(filter_, y), likelihood(filter_, y).sum(axis=0)
    for i in range(4):
        mean, cov, log = oracles.joint_posterior(STEPS, PRIOR, y[:, i])
        assert_allclose(law.mean[:, i], mean, atol=allowed)
        assert_allclose(law.cov[:, i], cov, atol=allowed)
        assert density[i] == pytest.approx(log, abs=10 * allowed)


def test_very_stiff_linear_models_are_exact():
    stiff = sampled(["-1e6*(x1 - x2)", "-x2"], [["0"], ["1"]], "x1 + w", interval=0.7)
    tau, Theta = linearised(stiff).at(0).predict(np.array([[3.0, 2.0]]), np.eye(2))
    left = np.exp(-0.7)
    # x2 is Ornstein and Uhlenbeck's; x1 follows it by 1e-6
    assert_allclose(tau, [[2 * left, 2 * left]], rtol=2e-6)
    assert_allclose(Theta, np.full((2, 2), left**2 + (1 - left**2) / 2), rtol=3e-6)


# ---------------------------------------------------------------- nonlinear: van der Pol, as the
# school's C2, from the page

L, W, ALPHA, BETA = 3.0, 0.1 * np.pi, 1.0, 0.25


def van_der_pol(**options):
    drift = ["x2", "-w0**2*x1 + al*x2*(1 - be*x1**2)"]
    values = {"w0": W, "al": ALPHA, "be": BETA}
    prior = {"mean": [2, -1], "variance": 0.15}
    return sampled(
        drift, [["0"], ["x1"]], ["x1 + w1", "x2 + w2"], values, interval=0.4, prior=prior, **options
    )


def of_page(exact):
    """tau-dot, A and Theta-dot of C2 at z, p: `exact` means over the normal law, or those at its
    mean."""

    def rates(z, p):
        z1, z2 = z
        p11, p12 = (p[0, 0], p[0, 1]) if exact else (0.0, 0.0)
        drift = -(W**2) * z1 + ALPHA * z2 - ALPHA * BETA * (z1**2 * z2 + z2 * p11 + 2 * z1 * p12)
        slopes = [
            [0, 1],
            [-(W**2) - 2 * ALPHA * BETA * (z1 * z2 + p12), ALPHA - ALPHA * BETA * (z1**2 + p11)],
        ]
        return np.array([z2, drift]), np.array(slopes), np.diag([0, z1**2 + p11])

    return rates


def by_euler(rates, z, p, span, steps):
    dt = span / steps
    for _ in range(steps):
        drift, slopes, intensity = rates(z, p)
        z, p = z + dt * drift, p + dt * (slopes @ p + p @ slopes.T + intensity)
    return z, p


@pytest.mark.parametrize(
    ("structure", "exact"), [(linearised, False), (gaussian, True), (gauss_hermite, True)]
)
def test_the_moment_equations_against_a_slow_loop(structure, exact):
    z, p = np.array([1.5, -0.8]), np.array([[0.3, 0.1], [0.1, 0.5]])
    tau, Theta = structure(van_der_pol()).at(0).predict(z[None], p[None])
    coarse, fine = (by_euler(of_page(exact), z, p, 0.4, steps) for steps in (1000, 2000))
    for got, less, more in zip((tau[0], Theta[0]), coarse, fine, strict=True):
        # Euler's error is halved, so twice the fine less the coarse has that of the next order,
        # (4e-4)^2
        assert_allclose(got, 2 * more - less, rtol=0, atol=1e-6)
        # it is that extrapolation which meets us, not either
        assert np.abs(more - less).max() > 1e-6


@pytest.mark.parametrize("name", ["", "CD2", "C2"])
def test_the_derived_equations_are_the_page_s(name):
    model = find_variant(name).model if name else van_der_pol()
    for structure, exact in ((linearised, False), (gaussian, True)):
        equations = moment_equations(model, structure)
        values = np.array([1.5, -0.8, 0.3, 0.1, 0.5])
        at = (
            dict(zip((*equations.z, *[equations.p[i] for i in (0, 1, 3)]), values, strict=True))
            | model.values
        )
        z, p = values[:2], np.array([[0.3, 0.1], [0.1, 0.5]])
        drift, slopes, intensity = of_page(exact)(z, p)
        for formula, value in zip(equations[2:], (drift[:, None], slopes, intensity), strict=True):
            assert_allclose(np.array(formula.subs(at), dtype=float), value, atol=1e-12)
        mean, spread = equations.rates
        assert_allclose(
            np.array(spread.subs(at), dtype=float),
            slopes @ p + p @ slopes.T + intensity,
            atol=1e-12,
        )
        assert mean == equations.drift


# ---------------------------------------------------------------- published figures


@pytest.mark.parametrize(
    ("model", "data", "printed", "allowed"),
    [
        (exact_mul(*PUBLISHED["exact_mul"][:2]), "exact-mul", PUBLISHED["exact_mul"][2], 5e-4),
        pytest.param(
            double_well(*PUBLISHED["double_well"][:-1]),
            "double-well",
            PUBLISHED["double_well"][-1],
            1e-4,
            marks=pytest.mark.slow,
        ),
    ],
)
def test_log_likelihoods_are_the_published_ones(model, data, printed, allowed):
    """Jimenez's sum: over the innovations after the first, and (1/2) ln 2 pi once more.  The first
    measurement of the double well is without error."""
    y = jimenez_data(data)[1]
    y[0] = np.nan if data == "double-well" else y[0]
    total = likelihood(aof(gaussian(model)), y)[1:].sum() - 0.5 * np.log(2 * np.pi)
    assert total == pytest.approx(printed, abs=allowed)


@pytest.mark.slow
def test_the_estimates_of_the_exact_multiplicative_object():
    fitted = estimate(exact_mul(-0.1, 0.1), jimenez_data("exact-mul")[1], ["a", "b"], ["b"])
    # his sum leaves the first measurement out
    assert fitted.value == pytest.approx(PUBLISHED["exact_mul"][:2], abs=2e-3)


# ---------------------------------------------------------------- Benes


def test_benes_filter_refuses_other_objects():
    for model in (
        sampled("tanh(2*x)", "1", "x + w"),
        sampled("tanh(x)", "2", "x + w"),
        Model.define("tanh(x) + v", "x + w"),
    ):
        with pytest.raises(ModelError, match="tanh"):
            benes_filter(model)
    with pytest.raises(ModelError, match="linear in x"):
        benes_filter(sampled("tanh(x)", "1", "x**2 + w"))


# ---------------------------------------------------------------- simulation


@pytest.mark.parametrize(
    ("drift", "diffusion", "counts", "order", "exact"),
    [
        (
            "0.5*x",
            "0.8*x",
            [4, 16, 64, 256],
            0.5,
            lambda w: np.exp(0.5 - 0.32 + 0.8 * w.sum(axis=1) / np.sqrt(256))[:, None],
        ),
        ("-sin(2*x)", "0.8", [4, 16], 1.0, None),
    ],
)
def test_the_strong_order_of_the_simulation(drift, diffusion, counts, order, exact):
    """Mean absolute errors at the end of an interval, on common Wiener paths: of the exact
    solution, or of the finest steps where the noise is added."""
    model, finest, x = (
        sampled(drift, diffusion, "x + w"),
        256 if exact else 1024,
        np.ones((1000, 1)),
    )
    path = np.random.default_rng(5).standard_normal((1000, finest))

    def end(count):
        noise = path.reshape(1000, count, -1).sum(axis=-1) / np.sqrt(finest // count)
        return dataclasses.replace(model.between, substeps=count).motion(model)(x, noise, 0)

    wanted = exact(path) if exact else end(finest)
    errors = np.log([np.abs(end(count) - wanted).mean() for count in counts])
    assert_allclose(-np.diff(errors) / np.log(4), order, atol=0.15)


def test_an_ensemble_has_the_moments_that_are_integrated():
    model = oscillator(substeps=32)
    runs = 5000
    x = simulate(model, runs, 6, seed=2).x
    mean, cov = PRIOR
    for k, (Phi, shift, Q, *_) in enumerate(STEPS[:5]):
        mean, cov = Phi @ mean + shift, Phi @ cov @ Phi.T + Q
        error = np.sqrt(np.diag(cov) / runs)
        # and (1/32)^2 of weak error
        assert (np.abs(x[k + 1].mean(axis=0) - mean) < 4.5 * error + 1e-3).all()
        sample = np.cov(x[k + 1].T)
        assert (
            np.abs(sample - cov)
            < 4.5 * np.sqrt(2 / runs) * np.sqrt(np.outer(np.diag(cov), np.diag(cov))) + 2e-3
        ).all()


# ---------------------------------------------------------------- what works as everywhere


def test_stratonovich_adds_half_of_b_db():
    model = sampled(
        "-a*x", "s*x", "x + w", {"a": 0.5, "s": 0.8}, stratonovich=True, interval=2, accuracy=1e-9
    )
    s, x = sp.Symbol("s", real=True), model.x[0]
    assert model.between.correction[0].subs(model.values) == sp.Rational(8, 25) * x
    tau, Theta = gaussian(model).at(0).predict(np.array([[1.5]]), np.array([[[0.2]]]))
    rate = -0.5 + 0.32
    assert tau.item() == pytest.approx(1.5 * np.exp(2 * rate), abs=1e-8)
    second = (1.5**2 + 0.2) * np.exp(2 * (2 * rate + 0.64))
    assert Theta.item() == pytest.approx(second - (1.5 * np.exp(2 * rate)) ** 2, abs=1e-7)
    two = sampled(["0", "0"], [["x2", "1"], ["x1*x2", "x2"]], ["x1 + w"], stratonovich=True)
    x1, x2 = two.x
    # by hand: 1/2 sum_j (dB_j/dx) B_j with B_1 = (x2, x1 x2), B_2 = (1, x2)
    assert sp.expand(
        two.between.correction - sp.Matrix([x1 * x2, x2**2 + x1**2 * x2 + x2]) / 2
    ) == sp.zeros(2, 1)
    assert s not in two.between.correction.free_symbols


def test_fos_and_duof_tend_to_kalmans_filter():
    model = sampled("-0.5*x + 0.2", "0.9", "x + 0.5*w", interval=0.8, substeps=16)
    filters = [aof(linearised(model)), fos(gaussian(model)), duof(model)]
    compared = compare(filters, model, 1000, 8, seed=3, design_runs=5000)
    for name in compared.names[1:]:
        relative = compared.relative(name, "aof-linearised")
        # coefficients of 5000 trajectories cost some of their 5000th parts, and (1/16)^2 of weak
        # error
        assert np.abs(relative.value - 1).max() < 0.01


def test_a_record_brings_its_instants(tmp_path):
    path = tmp_path / "record.csv"
    rows = [
        f"{t},{'' if np.isnan(y) else y}"
        for t, y in zip([0.0, 0.3, 1.1, 1.2], [0.1, np.nan, -0.5, 0.7], strict=True)
    ]
    path.write_text("time,y\n" + "\n".join(rows) + "\n", encoding="utf-8")
    settings = {"parameters": {"a": 0.5}, "meter_noise": {"variance": 0.2}}
    given = read_measurements(path, sampled("-a*x", "1", "x + w", **settings))
    listed = sampled("-a*x", "1", "x + w", **settings, instants=[0, 0.3, 1.1, 1.2])
    ours = run(aof(linearised(given.model)), given.y)
    assert_array_equal(ours.mean, run(aof(linearised(listed)), given.y).mean)
    far = run(aof(linearised(sampled("-a*x", "1", "x + w", **settings))), given.y)
    assert np.abs(far.mean - ours.mean).max() > 0.01


def test_angles_stay_on_the_circle():
    model = sampled(
        "2",
        "0.1",
        "x + w",
        interval=1,
        angles=["x", "y"],
        prior={"mean": 3, "variance": 0.01},
    )
    tau, _ = linearised(model).at(0).predict(np.array([[3.0]]), np.array([[[0.01]]]))
    assert tau.item() == pytest.approx(5 - 2 * np.pi)


def test_a_changed_parameter_moves_the_law_otherwise():
    """What is printed in LaTeX: test_report_between."""
    model = sampled("-a*x", "s*x", "x + w", {"a": 0.5, "s": 1})
    assert str(model).startswith("Model(dx/dt = -a*x + s*v*x, y = w + x;")
    changed = model.replace(a=2)
    tau, _ = linearised(changed).at(0).predict(np.array([[1.0]]), np.array([[[0.0]]]))
    assert tau.item() == pytest.approx(np.exp(-2), abs=1e-6)


# ---------------------------------------------------------------- refused, in words


@pytest.mark.parametrize(
    ("arguments", "options", "error", "words"),
    [
        (("x", ["1"]), {}, ModelError, "list of rows"),
        (("x", [["1"], ["2"]]), {}, ModelError, "a row for each of x: it has 2"),
        (("x + v", "1"), {}, ModelError, "holds noise"),
        (("x", "1"), {"parameters": {"t": 1}}, ModelError, "t is the time"),
        (("x", "1"), {"instants": [0, 1, 0.5]}, ModelError, "t_2 = 0.5 comes after t_1 = 1"),
        (("x", "1"), {"accuracy": 0}, ModelError, "accuracy"),
        (("x", "1"), {"substeps": 0}, ValueError, "substeps"),
    ],
)
def test_what_is_no_model(arguments, options, error, words):
    names = {"x": arguments[0]} if isinstance(arguments[0], list) else {}
    with pytest.raises(error, match=words):
        sampled(*arguments, "x + w", **options, **({"symbols": names} if names else {}))


def test_what_such_models_are_not_for():
    with pytest.raises(NoClosedForm, match="tanh"):
        gaussian(benes())
    for other in (kalman_filter, lambda model: posterior_bound(model, 10, 3, 1)):
        with pytest.raises(ModelError, match="moves in continuous time between"):
            other(sampled("-x", "1", "x + w"))


@pytest.mark.parametrize("drift", ["x**3", "-500*x"])
def test_trajectories_that_leave_all_bounds_are_named(drift):
    """The second by its sub-steps alone: each multiplies the state."""
    with pytest.raises(NotFinite, match=r"a trajectory becomes infinite: .*give more `substeps`"):
        simulate(sampled(drift, "1", "x + w", substeps=10), runs=5, steps=16, seed=1)


def test_a_drift_that_explodes_is_named():
    model = sampled("0.01*x**3 - 0.5*x", "1.5", "x + w", prior={"mean": 8}, interval=5)
    with pytest.raises(
        NotFinite, match=r"infinite [\d.]+ after an instant, and the next is 5 after it"
    ):
        run(aof(gaussian(model)), np.full(3, np.nan))


@pytest.mark.parametrize("few", [2, pytest.param(64, marks=pytest.mark.slow)])
def test_stiff_equations_are_left_to_an_implicit_method(few):
    """A fast component follows sin(t) at the distance (cos(t) + sin(t)^3) / c, with the variance
    1 / (2 (c + 3 x^2)), but for 1 / c^2."""
    c = 1e5
    model = sampled("-1e5*(x - sin(t)) - x**3", "1", "x + w")
    z, p = np.linspace(-1, 1, few)[:, None], np.full((few, 1, 1), 0.2)
    tau, Theta = gaussian(model).at(0).predict(z, p)
    slow = np.sin(1) - (np.cos(1) + np.sin(1) ** 3) / c
    assert_allclose(tau, np.full((few, 1), slow), rtol=0, atol=2e-8)
    assert_allclose(Theta, np.full((few, 1, 1), 1 / (2 * c + 6 * np.sin(1) ** 2)), rtol=1e-4)
    # 150 steps of many trajectories tell that 30,000 would not do
    with pytest.raises(NotFinite, match=r"stiff, or turn .* 20000 trajectories"):
        gaussian(model).at(0).predict(np.zeros((20_000, 1)), np.ones((1, 1)))


def test_many_trajectories_that_turn_fast_are_no_stiff_ones():
    """Fifty turns between two measurements: some 2,400 steps, each within 1e-6 deviations."""
    model = sampled(["300*x2 + 1e-9*x1**3", "-300*x1"], [["0.1", "0"], ["0", "0.1"]], "x1 + w")
    z = np.random.default_rng(1).standard_normal((65, 2))
    turn = np.array([[np.cos(300), np.sin(300)], [-np.sin(300), np.cos(300)]])
    tau = gaussian(model).at(0).predict(z, np.eye(2)).mean
    assert_allclose(tau, z @ turn.T, rtol=0, atol=4e-3)


@pytest.mark.parametrize("name", ["CD1", "C1"])
def test_a_table_has_drift_and_diffusion(name):
    variant, z, p = find_variant(name), 0.7, 0.4
    equations = moment_equations(variant.model)
    at = {equations.z[0]: z, equations.p[0]: p} | variant.model.values
    # the page's: a1 z + a3 (z^3 + 3 z p), a1 + 3 a3 (z^2 + p), 2.25
    wanted = [-0.5 * z - 0.01 * (z**3 + 3 * z * p), -0.5 - 0.03 * (z**2 + p), 2.25]
    assert [float(part[0].subs(at)) for part in equations[2:]] == pytest.approx(wanted, abs=1e-12)
    assert "dx/dt = a1*x + a3*x**3 + (1.5) v" in summary(name, variant.table)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({}, "no diffusion"),
        ({"diffusion": "1", "state": "x"}, "unknown key state"),
    ],
)
def test_tables_that_are_no_variant_are_refused(change, words):
    with pytest.raises(VariantError, match=words):
        read_variant("own", {"drift": "-x", "meter": "x + w"} | change, "here")
