"""The exact filter between measurements: Kalman's filter, Benes' filter, and finite volumes for the
equation of Fokker and Planck."""

from itertools import pairwise

import numpy as np
import pytest
import scipy.sparse.linalg
import sympy as sp
from numpy.testing import assert_allclose

from kfcourse import compare, gaussian, likelihood, linearised, predictions, run, simulate
from kfcourse.continuous import benes_filter, sampled
from kfcourse.continuous.exact import phi
from kfcourse.filters import aof, pointmass
from kfcourse.filters.exact.pointmasses import Unresolved
from kfcourse.montecarlo.experiment import states
from kfcourse.scenarios.benchmarks import benes


def finite_volumes(a, b, spans, meter, deviation, y, reach=7.0, cells=500):
    """Means, deviations and log densities of one record: dp/dt = -d/dx (a p - d(b p)/dx / 2),
    second order in the width of a cell; the flow of every span by the exponential of its matrix."""
    edge = np.linspace(-reach, reach, cells + 1)
    x, h = 0.5 * (edge[1:] + edge[:-1]), edge[1] - edge[0]
    density = np.exp(-0.5 * x**2) / np.sqrt(2 * np.pi)
    rows = []
    for k, value in enumerate(y):
        if not np.isnan(value):
            density = density * np.exp(-0.5 * ((value - meter(x)) / deviation) ** 2)
            density /= np.sqrt(2 * np.pi) * deviation
        total = density.sum() * h
        density = density / total
        mean = (x * density).sum() * h
        rows.append((mean, np.sqrt(((x - mean) ** 2 * density).sum() * h), np.log(total)))
        if k < len(spans):
            for start, length in spans[k]:  # coefficients in the middle of it
                inner, t = edge[1:-1], start + length / 2
                left = a(inner, t) / 2 + b(x[:-1]) / (2 * h)
                right = a(inner, t) / 2 - b(x[1:]) / (2 * h)
                inflow = [np.append(-left, 0) + np.append(0, right), left, -right]
                flow = scipy.sparse.diags_array(inflow, offsets=[0, -1, 1], format="csr")
                density = scipy.sparse.linalg.expm_multiply(flow * (length / h), density)
    return np.array(rows).T


def agrees(model, y, wanted, accuracy=1e-3, beyond=3e-4):
    """Within what the filter states, and the reference's own error."""
    mean, sd, logs = wanted
    visited = states(pointmass(model, accuracy), y)[1:]
    stated = np.array([state.memory.error[0] for state in visited])
    ours = np.array([state.posterior.mean[0, 0] for state in visited])
    spread = np.sqrt([state.posterior.cov[0, 0, 0] for state in visited])
    assert (np.abs(ours - mean) < (stated + beyond) * sd).all()
    assert (np.abs(spread / sd - 1) < stated + beyond).all()
    assert (np.abs(likelihood(pointmass(model, accuracy), y)[:, 0] - logs) < stated + beyond).all()
    return stated


Y = np.array([0.4, 1.5, np.nan, -0.2, 3.0])


def test_a_noise_that_depends_on_the_state_and_a_drift_on_time():
    instants = [0.0, 0.3, 0.5, 1.1, 1.2]
    model = sampled("-x + 2*cos(3*t)", "1 + 0.4*sin(x)", "x + 0.7*w", instants=instants)
    spans = [
        [(t + i * (s - t) / 10, (s - t) / 10) for i in range(10)] for t, s in pairwise(instants)
    ]
    wanted = finite_volumes(
        lambda x, t: -x + 2 * np.cos(3 * t),
        lambda x: (1 + 0.4 * np.sin(x)) ** 2,
        spans,
        lambda x: x,
        0.7,
        Y,
        reach=7.0,
        cells=250,
    )
    agrees(model, Y, wanted, beyond=1e-3)


def test_kalmans_filter_where_the_object_is_linear():
    model = sampled(
        "-0.5*x + 0.2 + u", "0.9", "x + 0.5*w", interval=0.8, inputs={"u": [1, -2, 0, 3]}
    )
    y = simulate(model, 30, 4, 3).y
    y[1, :7] = np.nan
    exact = pointmass(model, accuracy=1e-3)
    for law in (run, predictions):
        for ours, kalman in zip(law(exact, y), law(aof(linearised(model)), y), strict=True):
            assert_allclose(ours, kalman, rtol=0, atol=2e-5)
    # one of them would do, two tell
    assert {state.memory.substeps for state in states(exact, y)[2:]} == {2}


def test_the_functions_of_a_sub_step_lose_no_digits_near_0():
    u, at = sp.Symbol("u"), np.linspace(-0.1, 0.1, 998)
    for order in (1, 2):
        terms = [(sp.Float(1, 40) / sp.factorial(i + order)) * u**i for i in range(15)]
        exact = [float(sum(terms).evalf(40, {u: sp.Float(x, 40)})) for x in at]
        assert_allclose(sp.lambdify(u, phi(order, u))(at), exact, rtol=1e-12)


def test_benes_filter_and_the_order_of_a_sub_step():
    model = benes(interval=1.0)
    y = simulate(model, 10, 5, 3).y
    y[2, 0] = np.nan
    closed = run(benes_filter(model), y)
    errors = []
    for accuracy in (1e-2, 1e-3):
        visited = states(pointmass(model, accuracy), y)[1:]
        off = [
            (np.abs(state.posterior.mean - mean)[:, 0] / np.sqrt(cov[..., 0, 0]))
            for state, mean, cov in zip(visited[1:], closed.mean[1:], closed.cov[1:], strict=True)
        ]
        stated = [state.memory.error for state in visited[1:]]
        assert (np.array(off) < np.array(stated)).all()
        spread = np.array([state.posterior.cov for state in visited[1:]]) / closed.cov[1:]
        assert (np.abs(np.sqrt(spread)[..., 0, 0] - 1) < np.array(stated)).all()
        errors.append((visited[1].memory.substeps, np.max(off)))
    logs = [likelihood(filter_, y)[1:] for filter_ in (benes_filter(model), pointmass(model, 1e-3))]
    assert_allclose(*logs, rtol=0, atol=2 * np.max(stated))
    (few, first), (many, then) = errors
    assert then < 2 * first * (few / many) ** 2


@pytest.mark.slow
def test_the_bound_of_a_comparison():
    model = sampled("-0.5*x - 0.1*x**3", "1.5", "x + 0.5*x**2 + w")
    filters = [pointmass(model), aof(gaussian(model)), aof(linearised(model))]
    compared = compare(filters, model, 600, 4, seed=1)
    assert compared.has_bound and not compared.doubtful.any()
    gap = compared.mean_gap("aof-gaussian")
    assert gap.value > 4 * gap.standard_error
    assert compared.mean_gap("aof-linearised").value > gap.value
    # its own variance is that of its errors
    own, actual = compared.own_variance("aof-exact"), compared.component_variance("aof-exact")
    pooled = np.hypot(own.standard_error, actual.standard_error[:, 0])
    assert (np.abs(own.value - actual.value[:, 0]) < 4.5 * pooled).all()


def test_what_is_refused_in_words():
    with pytest.raises(ValueError, match="for scalar models"):
        pointmass(sampled(["x2", "-x1"], [["0"], ["1"]], "x1 + w"))
    with pytest.raises(ValueError, match="no noise enters the object"):
        pointmass(sampled("-x", "0*x", "x + w"))
    explosive = pointmass(sampled("x**3", "1", "x + w", prior={"mean": 3}))
    with pytest.raises(
        Unresolved, match=r"step 1 of Model\(dx/dt = v \+ x\*\*3.*leave the exact filter"
    ):
        run(explosive, np.zeros(2))
