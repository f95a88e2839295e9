"""The exact filter with its usual way compiled: the numbers of the plain one but for rounding, for every scalar variant."""

import ast
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from kfcourse import Model, compare, gaussian, load_variants, simulate
from kfcourse.filters import aof, pointmass
from kfcourse.filters.exact import pointmasses
from kfcourse.filters.fused import fuse
from kfcourse.lab.short_names import exact
from kfcourse.records.evidence import likelihood
from kfcourse.records.smoothing import smooth
from kfcourse.symbolic.model import Model as PlainModel

SCALAR = {
    name: one.model
    for name, one in load_variants().items()
    if isinstance(one.model, PlainModel) and one.model.n == one.model.p == 1
}
EPSILON = np.finfo(float).eps
STEPS = 6


@pytest.fixture(scope="module")
def loops():
    return import_module("kfcourse.filters.exact.loops")  # which compiles: not by each process that looks for tests here


def both(model, runs, seed=2):
    """States of the plain filter and of the compiled one after every step."""
    plain, y = pointmass(model), simulate(model, runs, STEPS, seed).y
    y[2, ::7] = np.nan
    quick = fuse(plain)
    assert quick is not plain
    assert quick.step is not plain.step
    one, other = plain.init(runs), quick.init(runs)
    for k in range(STEPS):
        one, other = plain.step(one, y[k]), quick.step(other, y[k])
        yield one, other


@pytest.mark.parametrize("name", SCALAR)
def test_every_scalar_variant(name):
    """In posterior deviations: 1e-9 and the rounding of x itself, which is a part of each density's exponent.

    A node x is known to EPSILON x, and the logarithm of its density changes by EPSILON x / deviation; and that once a step.
    """
    for plain, quick in both(SCALAR[name], 64):
        deviation = np.sqrt(plain.posterior.cov[:, 0, 0])
        rounding = 50 * EPSILON * (np.abs(plain.posterior.mean[:, 0]) / deviation + 1)
        mean = np.abs(quick.posterior.mean - plain.posterior.mean)[:, 0] / deviation
        assert (mean < 1e-9 + rounding).all()
        np.testing.assert_allclose(quick.posterior.cov, plain.posterior.cov, rtol=1e-9)
        np.testing.assert_allclose(quick.predicted.cov, plain.predicted.cov, rtol=1e-9)
        np.testing.assert_array_equal([len(grid.x) for grid in quick.memory.fine], [len(grid.x) for grid in plain.memory.fine])
        np.testing.assert_array_equal(quick.memory.adaptive, plain.memory.adaptive)
        np.testing.assert_allclose(quick.memory.error, plain.memory.error, rtol=1e-3, atol=1e-9 + rounding.max())
    assert quick.memory.fine.usual.mean() > 0.5  # else nothing was tried


def test_what_the_loop_leaves_is_done_as_without_it():
    """A noise that vanishes at some states: narrow kernels beside usual ones, and panels."""
    model = Model.define("0.9*x + 0.5*sin(x)*v", "x + 0.1*w")
    kinds = set()
    for plain, quick in both(model, 40):
        kinds |= set(quick.memory.fine.usual.tolist())
        np.testing.assert_allclose(quick.posterior.mean, plain.posterior.mean, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(quick.posterior.cov, plain.posterior.cov, rtol=1e-9, atol=1e-300)
    assert kinds == {True, False}


def test_evidence_and_smoothing_take_its_posteriors():
    model = SCALAR["53"]
    plain, y = pointmass(model), simulate(model, 40, STEPS, 1).y
    quick = fuse(plain)
    one, other = (smooth(each, y) for each in (plain, quick))
    np.testing.assert_allclose(other.mean, one.mean, rtol=1e-7)
    one, other = (likelihood(each, y) for each in (plain, quick))
    np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-9)


def test_a_comparison_has_the_same_bound():
    model = SCALAR["53"]
    plain, quick = (
        compare([aof(gaussian(model)), exact(model)], model, 2000, STEPS, 1, slow_runs=160, progress=False, compiled=which)
        for which in (False, True)
    )
    assert quick.has_bound
    assert not quick.replaced
    for name in ("square", "distance", "doubt"):
        one, other = getattr(plain.slow_part.first, name), getattr(quick.slow_part.first, name)
        np.testing.assert_allclose(other, one, rtol=1e-6, atol=1e-9 * np.abs(one).max(), err_msg=name)


def test_what_the_loop_cannot_take_stays_as_it_is():
    timed = Model.define("x + v/(1 + k)", "x + w")
    noiseless = Model.define("x + v", "x**3")
    solved = Model.define("0.9*x + v", "exp(x + w)")
    other = pointmass(SCALAR["53"])
    other = replace(other, step=lambda state, y: state)
    for one in (pointmass(timed), pointmass(noiseless), pointmass(solved), other):
        assert fuse(one) is one


def test_the_first_step_is_taken_by_the_loop_too(monkeypatch):
    """From the prior, a single normal law; that its numbers are those of the plain step, `test_every_scalar_variant` says."""

    def refused(*_):
        raise AssertionError("left to NumPy")

    quick, y = fuse(pointmass(SCALAR["53"])), simulate(SCALAR["53"], 64, 1, 1).y
    monkeypatch.setattr(pointmasses, "likeliest", refused)
    assert quick.step(quick.init(64), y[0]).memory.fine.usual.all()


def test_exp_and_ln(monkeypatch, loops):
    """To 2e-13, 3e-14 and 1e-15, over all that densities are made of."""
    for name in ("_half", "_log"):
        monkeypatch.setattr(loops, name, getattr(loops, name).py_func)
    x = np.concatenate([np.linspace(-708, 708, 100_001), np.random.default_rng(1).normal(0, 3, 10_000)])
    exponentials = np.array([loops._exp.py_func(one) for one in x])
    np.testing.assert_allclose(exponentials, np.exp(x), rtol=2e-13)
    u = np.append(np.linspace(-1021, 1021, 100_001), loops._LOWEST2)
    powers = np.array([loops._half(one, loops._POLYNOMIAL) for one in u])
    np.testing.assert_allclose(powers, np.exp2(-u), rtol=3e-14)
    far = np.append(np.geomspace(1e-9, 1e150, 10_000), 0)
    areas = np.array([loops._asinh.py_func(one) for one in far])
    np.testing.assert_allclose(areas, np.arcsinh(far), rtol=1e-15, atol=1e-15)
    logarithms = np.array([loops._log(one) for one in np.exp(x)])
    np.testing.assert_allclose(logarithms, np.log(np.exp(x)), rtol=1e-15, atol=1e-15)
    assert [loops._log(one) for one in (0.0, np.inf)] == [-np.inf, np.inf]
    assert np.isnan(loops._log(np.nan))


def test_the_largest_of_many(monkeypatch, loops):
    """By bits: of both signs and zeros, and where one is infinite."""
    monkeypatch.setattr(loops, "_in_order", loops._in_order.py_func)
    rng = np.random.default_rng(1)
    for _ in range(200):
        values = rng.normal(0, 10.0 ** rng.integers(-300, 300), 7) - rng.integers(0, 2) * 10.0 ** rng.integers(-300, 300)
        values[rng.integers(0, 7)] = rng.choice([0.0, -np.inf, np.inf, values[0]], p=[0.3, 0.3, 0.1, 0.3])
        for count in (1, 4, 7):
            assert loops._highest.py_func(values, count) == values[:count].max()


def test_machine_code_is_kept_beside_every_constant(loops):
    """What a loop takes from elsewhere is in its closure, or a changed one would be read from the cache with its old value."""
    kept = set()
    for one in loops.steps.py_func.__closure__[0].cell_contents:
        kept |= {one} | ({part for part in one if isinstance(part, tuple | float | int)} if isinstance(one, tuple) else set())
    taken = ast.parse(Path(loops.__file__).read_text()).body
    names = [name.name for part in taken if isinstance(part, ast.ImportFrom) for name in part.names if name.name.isupper()]
    assert len(names) > 15
    for name in names:
        value = getattr(loops, name)
        assert (tuple(value) if isinstance(value, np.ndarray) else value) in kept, name
