"""Kernels that crowd after panels: two for each cell, with the sum of all; and what the filter does with them."""

from functools import partial

import numpy as np
import pytest

from kfcourse import Model, filters, simulate
from kfcourse.filters import pointmass
from kfcourse.filters.densities import scalar_densities
from kfcourse.filters.exact import pointmasses
from kfcourse.filters.exact.constants import LOWEST
from kfcourse.filters.exact.kernels import Unresolved, add_bells
from kfcourse.filters.exact.merging import MERGED, merged

SPIKES = Model.define("0.95*x + 0.3*v", "0.1*x + sin(x)*w")  # the meter's noise vanishes at many states


def followed(one, y):
    state = one.init(y.shape[1])
    for measurement in y:
        state = one.step(state, measurement)
        yield state


def of_sum(at, mu, sigma, mass):
    return np.exp(-0.5 * ((at[:, None] - mu) / sigma) ** 2) @ (mass / (sigma * np.sqrt(2 * np.pi)))


@pytest.mark.parametrize(
    ("state", "centre", "deviation"),
    [
        ("0.95*x + 0.3*v", 0.4, 0.2),
        ("0.9*x + 0.3*(1 + 0.5*x**2)*v", -0.3, 0.3),  # kernels that widen
        ("0.45*(x - 1 + Abs(x + 1)) + 0.4*v", -1.0, 0.03),  # a kink, all in one cell of equal moments of the state
        ("sin(10*x)/2 + 0.4*v", np.pi / 20, 0.03),  # turns there
    ],
)
def test_the_sum_of_merged_kernels_is_that_of_all(state, centre, deviation):
    """Up to MERGED of the height by what a cell loses, and once more by what its moments may change."""
    law = scalar_densities(Model.define(state, "x + w"))
    x = np.stack([centre + deviation * np.linspace(-6, 6, 400), 5 + 0.1 * np.linspace(-1, 1, 400) ** 3])
    mass = np.stack([np.exp(-0.5 * ((x[0] - centre) / deviation) ** 2), np.full(400, 1.0)])
    mass /= mass.sum(axis=1, keepdims=True)
    found, (mu, sigma) = merged(x, mass, law), law.kernel(x)
    assert sorted(set(found.row.tolist())) == [0, 1]
    assert (found.mass > 0).all()
    for row in range(2):
        few = [array[found.row == row] for array in (found.mu, found.sigma, found.mass)]
        at = mu[row].mean() + np.linspace(-5, 5, 201) * sigma[row].max()
        every = of_sum(at, mu[row], sigma[row], mass[row])
        assert len(few[0]) < 400
        assert np.abs(of_sum(at, *few) - every).max() < 2 * MERGED * every.max()


def test_smooth_kernels_become_few():
    law = scalar_densities(SPIKES)
    x = np.linspace(-0.6, 0.6, 500)[None]
    assert len(merged(x, np.full((1, 500), 1 / 500), law).mu) <= 2 * (0.95 * 1.2 / (0.4 * 0.3) + 2)


def test_the_stated_error_holds_with_merged_kernels():
    _, y = simulate(SPIKES, 24, 5, seed=3)
    ours, fine = pointmass(SPIKES), filters.pointmass(SPIKES, accuracy=1e-7)
    a, b = ours.init(24), fine.init(24)
    crowded = 0
    for measurement in y:
        a, b = ours.step(a, measurement), fine.step(b, measurement)
        crowded += sum((kernels.panels and kernels.mu.shape[1] < 250) * len(rows) for rows, kernels in a.memory.groups)
        deviation = np.sqrt(b.posterior.cov[:, 0, 0])
        apart = np.abs(a.posterior.mean - b.posterior.mean)[:, 0] / deviation
        assert (apart <= 2 * a.memory.error).all()
    assert crowded > 60


def test_no_hump_of_the_prediction_is_lost():
    """A square tells no sign: both humps stay, hundreds of their widths apart, wherever the measurement finds its roots.

    So the mean is 0 by symmetry, and the deviation as large as the state.
    """
    model = Model.define("0.9*x + 1e-4*v", "x**2 + 0.001*w")
    _, y = simulate(model, 12, 12, seed=5)
    for state in followed(pointmass(model), y):
        assert (np.abs(state.posterior.mean[:, 0]) < state.memory.error * np.sqrt(state.posterior.cov[:, 0, 0])).all()


def test_where_panels_do_not_do_either_as_many_nodes_as_there_may_be(monkeypatch):
    """After panels few nodes are tried; if panels fail then, all nodes are, and panels are asked again."""
    _, y = simulate(SPIKES, 8, 2, seed=3)
    one = pointmass(SPIKES)
    state = one.step(one.init(8), y[0])
    expected = one.step(state, y[1])
    asked, on_panels = [], pointmasses._on_panels

    def failing(kernels, *others):
        if kernels.panels:
            asked.append(len(kernels.mu))
        if len(asked) == 1:
            raise Unresolved("no panels")
        return on_panels(kernels, *others)

    monkeypatch.setattr(pointmasses, "_on_panels", failing)
    found = one.step(state, y[1])
    assert len(asked) > 1
    assert asked[0] > asked[1]  # more nodes resolve more
    deviation = np.sqrt(expected.posterior.cov[:, 0, 0])
    apart = np.abs(found.posterior.mean - expected.posterior.mean)[:, 0] / deviation
    assert (apart <= found.memory.error + expected.memory.error).all()


def test_bells_are_added_as_without_numba():
    loops = pytest.importorskip("kfcourse.filters.exact.loops")
    rng = np.random.default_rng(1)
    x, rate, centre = rng.normal(size=(3, 40)), rng.uniform(0.5, 50, (3, 30)), rng.normal(size=(3, 30))
    for parts in (1, 3):
        weights = rng.uniform(size=(3, 30, parts))
        plain, quick = np.zeros((2, 3, parts, 40))
        for add, result in ((add_bells, plain), (partial(loops.add_bells), quick)):
            add(x, rate, centre, weights, LOWEST, result)
        np.testing.assert_allclose(quick, plain, rtol=1e-11)
        u = rate[2, :, None] * x[2] - centre[2, :, None]
        np.testing.assert_allclose(plain[2].T, np.exp(-np.minimum(u * u, LOWEST)).T @ weights[2], rtol=1e-12)
