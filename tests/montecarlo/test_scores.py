"""Scores of predictions: a slow loop, closed forms of a linear model, and that honesty pays."""

from itertools import pairwise

import numpy as np
import pytest
import scipy
from numpy.testing import assert_allclose, assert_array_equal

from kfcourse import Ensemble, Gaussian, JumpModel, Model, compare, gaussian, linearised
from kfcourse.continuous import sampled
from kfcourse.filters import aof, duof, gpb2, imm, kalman_filter, particle, pointmass
from kfcourse.lab import find_variant
from kfcourse.montecarlo.ensemble import side_by_side
from kfcourse.montecarlo.experiment import batch_sizes, states
from kfcourse.montecarlo.scores import crps, scored


def by_quadrature(y, means, deviations, weights=(1.0,)):
    """Integral of (P - [. >= y])^2 for a mixture, in pieces between all the places of note."""
    laws = [*zip(weights, np.atleast_1d(means), np.atleast_1d(deviations), strict=True)]

    def square(u):
        return (sum(w * scipy.special.ndtr((u - m) / d) for w, m, d in laws) - (u >= y)) ** 2

    edges = sorted([y, *(m + k * d for _, m, d in laws for k in (-9, 0, 9))])
    return sum(
        scipy.integrate.quad(square, a, b, limit=200)[0] for a, b in pairwise(edges) if a < b
    )


@pytest.mark.parametrize(
    ("y", "means", "deviations", "weights"),
    [
        (0.3, [0.0], [1.0], [1.0]),
        (-4.0, [1.0], [0.5], [1.0]),
        # two hills, three with the middle one sharp, and a point far from both
        (0.3, [-2.0, 1.5], [1.0, 0.4], [0.3, 0.7]),
        (1.2, [0.0, 1.0, 5.0], [2.0, 0.05, 1.0], [0.5, 0.2, 0.3]),
        (-7.0, [0.0, 4.0], [1.0, 1.0], [0.9, 0.1]),
    ],
)
def test_crps_is_the_integral(y, means, deviations, weights):
    ours = crps(*(np.array([row]) for row in (y - np.array(means), deviations, weights)))
    assert ours.item() == pytest.approx(by_quadrature(y, means, deviations, weights), rel=1e-6)


def test_crps_of_points():
    sure = crps(np.array([[-1.5], [0.0]]), np.zeros((2, 1)), np.ones((1, 1)))
    assert_array_equal(sure, [1.5, 0.0])
    point = crps(np.array([[0.0, 1.0]]), np.zeros((1, 2)), np.array([[0.5, 0.5]]))
    # P steps by a half at y and one below it: (1/2)^2 over a length of 1
    assert_allclose(point, 0.25, rtol=1e-15)


def test_a_slow_loop():
    """Two meters, correlated; a designed filter, whose F is that of the structure given."""
    model = Model.define(
        "0.9*x + 0.1*x**2 + 0.3*v",
        ["x + w1", "x**2 + w2"],
        prior={"mean": 0.4, "variance": 0},
        meter_noise={"variance": [[0.3, 0.1], [0.1, 0.2]]},
    )
    normal, tangent = gaussian(model), linearised(model)
    filters = [aof(tangent), duof(model)]
    compared = compare(filters, model, 66, 2, seed=4, scores=normal, same_ensemble=True)
    seeds = np.random.SeedSequence(4).spawn(65)[1:]
    sizes = zip(batch_sizes(66), seeds, strict=True)
    batches = [Ensemble(model, size, 2, seed) for size, seed in sizes]
    y = np.stack([each.y for each in side_by_side(batches)])
    law, norm = scipy.stats.multivariate_normal, scipy.stats.norm
    wanted = []
    for k, state in enumerate(states(filters[0], y)[:-1]):
        logs, sizes = [], []
        for run in range(66):
            of_run = Gaussian(
                state.predicted.mean[[run]],
                np.broadcast_to(state.predicted.cov, (66, 1, 1))[[run]],
            )
            h, _, F, _ = tangent.at(k).measure(*of_run)
            logs.append(law(h[0], F[0]).logpdf(y[k, run]))
            s = np.sqrt(np.diagonal(F[0]))
            z = (y[k, run] - h[0]) / s
            normal_crps = z * (2 * norm.cdf(z) - 1) + 2 * norm.pdf(z) - 1 / np.sqrt(np.pi)
            sizes.append(s @ normal_crps)
        wanted.append((np.mean(logs), np.mean(sizes)))
    ours = compared.log_score("aof-linearised"), compared.crps("aof-linearised")
    assert_allclose([each.value for each in ours], np.transpose(wanted), rtol=1e-6)
    # the first prediction is the same for all: the prior, by the Gaussian functions
    h, _, F, _ = normal.at(0).measure(*model.prior)
    assert compared.log_score("duof").value[0] == pytest.approx(law(h, F).logpdf(y[0]).mean())
    more = compared.log_score("duof", minus="aof-linearised")
    assert more.value == pytest.approx(compared.log_score("duof").value - ours[0].value)
    whole = compared.crps("duof", steps=slice(1, None))
    assert whole.value == pytest.approx(compared.crps("duof").value[1:].mean())


def test_the_exact_filter_has_the_most():
    model = Model.define("0.9*x + 0.5*v", "x + 0.4*x**2 + 0.5*w")
    filters = [pointmass(model), aof(gaussian(model))]
    compared = compare(filters, model, 4000, 4, seed=3, scores=gaussian(model))
    more = compared.log_score("aof-exact", minus="aof-gaussian", steps=slice(None))
    assert more.value > 4 * more.standard_error
    less = compared.crps("aof-exact", minus="aof-gaussian", steps=slice(None))
    assert less.value < -4 * less.standard_error


LINEAR = Model.define("0.9*x + 0.5*v", "x + 0.5*w", prior={"mean": 1, "variance": 0.4})


@pytest.mark.parametrize(
    ("model", "build"),
    [
        (LINEAR, pointmass),
        (LINEAR, lambda model: particle(model, 200)),
        (sampled("-0.5*x", "0.8", "x + 0.5*w", interval=0.7), pointmass),
    ],
    ids=["exact", "particles", "in continuous time"],
)
def test_what_is_drawn_from_a_prediction_has_its_crps(model, build):
    """Of a linear model all predictions are one normal law; a draw that lacked a noise of the
    object or of the meter would be off by a fifth."""
    normal = aof(gaussian(model))
    filters = [build(model), normal]
    compared = compare(filters, model, 1000, 4, seed=3, scores=gaussian(model))
    apart = compared.crps(filters[0].name, minus=normal.name)
    assert (np.abs(apart.value) < 4 * apart.standard_error).all()
    # with 16 draws 0.0103; half as many have 0.0135
    assert (apart.standard_error / compared.crps(normal.name).value).mean() < 0.0117


def test_where_the_density_is_nothing_at_a_point():
    """Variant 53's, at x = 0: its logarithm there is -1e100."""
    model = find_variant("53").model
    filters = [pointmass(model), aof(gaussian(model))]
    compared = compare(filters, model, 500, 3, seed=3, scores=gaussian(model))
    apart = compared.crps("aof-exact", minus="aof-gaussian")
    assert (apart.value < 4 * apart.standard_error).all()


def test_modes_are_drawn_with_their_states():
    """The meter's noise lasts: the mode tells much of the next measurement."""
    model = JumpModel.define(
        "0.9*x + 0.6*v",
        "1.5*x + g*w",
        {"g": 0.2},
        modes={"good": {}, "bad": {"parameters": {"g": 6}}},
        transition=[[0.95, 0.05], [0.05, 0.95]],
        first=[0.5, 0.5],
    )
    structures = [linearised(mode) for mode in model.modes]
    filters = [imm(structures, model, model.first), pointmass(model)]
    compared = compare(filters, model, 2000, 4, seed=3, scores=structures[0])
    apart = compared.crps("aof-exact", minus="imm")
    assert (np.abs(apart.value) < 4 * apart.standard_error).all()
    assert (apart.standard_error < 0.03 * compared.crps("imm").value).all()


@pytest.mark.parametrize("build", [imm, gpb2])
def test_the_mixture_of_a_filter_with_modes(build):
    """Two correlated meters in two modes, one trajectory by quadrature: weights and
    laws are those of the state before the measurement."""
    model = JumpModel.define(
        "a*x + 0.6*v",
        ["x + g*w1", "x**2 + w2"],
        {"a": 0.9, "g": 0.5},
        meter_noise={"variance": [[0.3, 0.1], [0.1, 0.2]]},
        modes={"good": {}, "bad": {"parameters": {"g": 6, "a": -0.5}}},
        transition=[[0.8, 0.2], [0.4, 0.6]],
        first=[0.7, 0.3],
    )
    structures = [linearised(mode) for mode in model.modes]
    chosen = build(structures, model, model.first)
    y = np.random.default_rng(2).standard_normal((2, 1, 2))
    before = states(chosen, y)
    for k, now in [*enumerate(y)][1:]:
        memory = before[k].memory
        laws = [structures[i % 2].at(k).measure(*law) for i, law in enumerate(memory.predicted)]
        F = [np.broadcast_to(law.F, (1, 2, 2))[0] for law in laws]
        weights = memory.expected[0]
        assert len(weights) == len(laws) and weights.sum() == pytest.approx(1)
        wanted = sum(
            by_quadrature(
                now[0, i], [law.h[0, i] for law in laws], [np.sqrt(f[i, i]) for f in F], weights
            )
            for i in (0, 1)
        )
        log = np.log(
            sum(
                w * scipy.stats.multivariate_normal(law.h[0], f).pdf(now[0])
                for w, law, f in zip(weights, laws, F, strict=True)
            )
        )
        ours = scored(chosen, structures[0], before[k], now, before[k + 1], None)
        assert ours[0].item() == pytest.approx(log, rel=1e-10)
        assert ours[1].item() == pytest.approx(wanted, rel=1e-6)


def test_not_asked_for():
    model = Model.define("0.9*x + 0.6*v", "1.5*x + w")
    compared = compare([kalman_filter(model)], model, 64, 2, seed=1)
    with pytest.raises(KeyError, match="scores="):
        compared.log_score("kalman")
