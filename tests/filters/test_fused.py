"""Compiled filters: the numbers of the plain ones but for rounding, for every scalar variant, and what is not compiled."""

import os
import subprocess
import sys
from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp

from kfcourse import Model, compare, gaussian, linearised, load_variants, run, simulate, unscented
from kfcourse.filters import aof, dfmp, duof, fos, gated, mdfmp, mfos
from kfcourse.filters.designed import Design
from kfcourse.filters.fused import Fused, fuse
from kfcourse.montecarlo.designing import NotFinite, design, design_together
from kfcourse.montecarlo.ensemble import SMALL_BLOCK, Ensemble, Serial, workers
from kfcourse.montecarlo.statistics import Sums
from kfcourse.symbolic import compiled
from kfcourse.symbolic.model import Model as PlainModel

SCALAR = {
    name: one.model
    for name, one in load_variants().items()
    if isinstance(one.model, PlainModel) and one.model.n == one.model.p == 1
}
STEPS = 6


def family(model):
    both = [linearised(model), gaussian(model)]
    return [duof(model), *(build(one) for one in both for build in (aof, fos, mfos, dfmp, mdfmp))]


def ready(filters, model, runs):
    """All designed on the same trajectories, of one block; the compiled ones by two stretches of them, of some steps each."""
    record = list(Ensemble(model, runs, STEPS, 1).block(0))
    plain = [one for one in filters if isinstance(one, Design) and not isinstance(one, Fused)]
    quick = [one for one in filters if isinstance(one, Fused)]
    x = np.stack([record[0].x[:, 0], *(one.x_next[:, 0] for one in record)])
    y = np.stack([one.y[:, 0] for one in record])
    stretches = [(x[:5], y[:4]), (x[4:], y[4:])]
    found = iter([*design(plain, [[one] for one in record]), *design_together(quick, stretches, (runs, STEPS), Serial())])
    return [next(found) if isinstance(one, Design) else one for one in filters]


@pytest.fixture(scope="module")
def loops():
    return import_module("kfcourse.filters.loops")  # which compiles: not by each process that looks for tests here


@pytest.fixture
def interpreted(monkeypatch, loops):
    """The printed loops run by Python, which takes no seconds to compile, on NumPy's numbers."""

    def unchanged(*signature, **options):
        return lambda function: function

    def load(*texts):
        space = {"np": np, "nan": np.nan, "njit": unchanged, "cfunc": unchanged}
        exec("".join(texts), space)
        return SimpleNamespace(**space)

    monkeypatch.setattr(compiled, "load", load)
    monkeypatch.setattr(loops, "advance", loops.advance.py_func)
    monkeypatch.setattr(loops, "design", loops.design.py_func)
    monkeypatch.setattr("kfcourse.filters.fused._PRINTED", {})


def check(model, runs, filters):
    """Equal within 1e-9 of the spread of states.

    Rounding is 1e-16 a step; in regressions on nearly equal numbers, and where the filter itself is unstable, it grows: the
    largest found over all shipped variants, with other seeds and 8 steps too, was 3e-11.
    """
    y = simulate(model, runs, STEPS, seed=2).y
    y[2, ::7] = np.nan
    quick = [fuse(one) for one in filters]
    assert all(one is not other for one, other in zip(filters, quick, strict=True))
    with np.errstate(all="ignore"):
        pairs = zip(ready(filters, model, runs), ready(quick, model, runs), strict=True)
        for one, other in pairs:
            plain, found = run(one, y), run(other, y)
            np.testing.assert_allclose(found.mean, plain.mean, rtol=1e-9, atol=1e-9 * plain.mean.std(), err_msg=one.name)
            np.testing.assert_allclose(found.cov, plain.cov, rtol=1e-9, atol=1e-9 * plain.cov.mean(), err_msg=one.name)


@pytest.mark.parametrize("name", SCALAR)
def test_every_filter_of_every_scalar_variant(interpreted, name):
    check(SCALAR[name], 60, family(SCALAR[name]))


def test_compiled():
    """By numba: powers, and beside them a function of NumPy."""
    check(SCALAR["53"], 500, family(SCALAR["53"]))
    check(SCALAR["5"], 500, [aof(gaussian(SCALAR["5"])), fos(linearised(SCALAR["5"]))])


def test_a_comparison():
    """The same draws and the same statistics, of weighted trajectories too; their sums in another order: 1e-16 times some 100."""
    model = SCALAR["53"]
    filters = [aof(gaussian(model)), aof(unscented(model)), duof(model), fos(gaussian(model))]
    plain, quick = (
        compare(filters, model, 3000, STEPS, 1, wide=2.0, designs=2, slow_runs=0, progress=False, compiled=which)
        for which in (False, True)
    )
    for name in plain.names:
        one, other = plain.error_variance(name), quick.error_variance(name)
        np.testing.assert_allclose(other.value, one.value, rtol=1e-11)
        np.testing.assert_allclose(other.standard_error, one.standard_error, rtol=1e-9)
    for name in ("error", "square", "own", "normalised", "largest_square", "size", "weights"):
        one, other = getattr(plain.sums, name), getattr(quick.sums, name)
        np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-11 * np.abs(one).max(), err_msg=name)


def test_the_number_of_threads_changes_no_bit():
    """Of two blocks, in a design too; its trajectories, side by side, are those of the blocks."""
    model, runs = SCALAR["53"], 2 * SMALL_BLOCK + 1
    ensemble = Ensemble(model, runs, STEPS, 1, compiled=True)
    blocks = [list(ensemble.stretches(index)) for index in range(2)]
    sums = []
    for threads in (1, 3):
        with workers(threads) as pool:
            for k, found in enumerate(ensemble.together(pool)):
                for array, parts in zip(found, zip(*(block[k] for block in blocks), strict=True), strict=True):
                    np.testing.assert_array_equal(array, np.hstack(parts))
        assert k == len(blocks[0]) - 1
        filters = [aof(gaussian(model)), duof(model), fos(gaussian(model))]
        sums.append(compare(filters, model, runs, STEPS, 1, slow_runs=0, threads=threads, progress=False, compiled=True).sums)
    np.testing.assert_array_equal(sums[0].square, sums[1].square)


def test_a_design_that_meets_no_numbers_is_refused_as_without_numba():
    explodes = SCALAR["53"].replace(c=1e40)
    said = []
    for which in (False, True):
        with pytest.raises(NotFinite, match="infinite or NaN") as refused:
            compare([aof(linearised(explodes)), duof(explodes)], explodes, 500, 12, 1, progress=False, compiled=which)
        said.append(str(refused.value))
    assert said[0] == said[1]


def test_a_regressor_that_is_the_same_for_all(interpreted):
    sure = Model.define("0.9*x + 0.1*v", "x + 0.1*w", prior={"mean": 0.1, "variance": 0.0})
    check(sure, 60, family(sure))


def test_normal_numbers_are_numpys_to_the_last_bit(loops):
    """A million: some 260 of them from the tails; and where the generator goes on."""
    one, other = (np.random.Generator(np.random.SFC64(3)) for _ in range(2))
    found = np.empty(1_000_000)
    loops.normals(one, found)
    np.testing.assert_array_equal(found, other.standard_normal(1_000_000))
    assert one.random() == other.random()


def test_the_sums_of_several_steps_are_those_of_each(interpreted):
    """Batches of any size; a variance of 0 counts as nothing without an error and as infinity with one."""
    model, runs = SCALAR["53"], 50
    one, (x, y) = fuse(aof(gaussian(model))), simulate(model, runs, STEPS, seed=4)
    weight = np.random.default_rng(1).random(runs)
    expected, found = (Sums.empty(1, STEPS, 1, np.array([1, 30, runs - 31])) for _ in range(2))
    starts, room, state = np.append(found.starts, runs), np.empty((2, 30)), one.init(runs)
    for k in range(STEPS):
        state = one.step(state, y[k])
        expected.record(0, k, x[k], state.posterior, weight)
    with np.errstate(divide="ignore"):
        after = one.step.several(
            one.init(runs), y[:, :, 0].copy(), x[:, :, 0].copy(), weight, starts, found.of_scalar(0, slice(STEPS)), room
        )
    for name in ("error", "square", "own", "normalised", "largest_square"):  # sums of 30, in another order
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-13, atol=1e-14, err_msg=name)
    np.testing.assert_array_equal(after.predicted.mean, state.predicted.mean)
    sure = Model.define("x", "x + w", prior={"mean": 1.0, "variance": 0.0})
    quick, sums = fuse(aof(linearised(sure))), np.empty((5, 1, 2))
    for row, quotients in ((np.ones((1, 2)), [0.0, 0.0]), (np.array([[1.0, 3.0]]), [0.0, np.inf])):
        with np.errstate(divide="ignore"):
            quick.step.several(quick.init(2), np.ones((1, 2)), row, np.ones(2), np.arange(3), sums, np.empty((2, 1)))
        assert sums[3, 0].tolist() == quotients


def test_a_meter_that_cannot_vary_and_one_that_never_does():
    """F = 0 at x = 0: no correction there; and the same p = Psi R / F, never negative, where the meter is sharp."""
    model = Model.define("c*x + e*v*x", "g*x**2 + f*x**2*w", {"c": 0.9, "e": 0.05, "g": 1, "f": 1e-9}, prior={"mean": 0.0})
    one = aof(linearised(model))
    other, y = fuse(one), simulate(model, 300, STEPS, seed=3).y
    plain, found = run(one, y), run(other, y)
    np.testing.assert_allclose(found.mean, plain.mean, rtol=1e-9, atol=1e-12)
    assert (found.cov >= 0).all()


def test_what_has_no_formulas_or_another_step_stays_as_it_is():
    model = SCALAR["53"]
    one = aof(gaussian(model))
    vector = Model.define(["x1 + 0.1*x2", "x2 + v"], "x1 + w")
    timed = Model.define("x + v/(1 + k)", "x + w")
    others = [aof(unscented(model)), gated(one), replace(one, step=lambda state, y: state), fos(gaussian(model), arguments=3)]
    others += [aof(linearised(vector)), duof(vector), aof(linearised(timed))]
    assert [compiled.is_scalar(one) for one in (vector, timed, model)] == [False, False, True]
    for other in others:
        assert fuse(other) is other


def test_what_cannot_be_compiled_runs_as_it_is_and_says_so(monkeypatch):
    def load(*texts):
        raise TypeError("no such function")

    monkeypatch.setattr(compiled, "load", load)
    monkeypatch.setattr("kfcourse.filters.fused._PRINTED", {})
    one = aof(gaussian(SCALAR["53"]))
    with pytest.warns(UserWarning, match=r"aof-gaussian is not compiled, and runs as without compiled=True: no such function"):
        assert fuse(one) is one


def test_without_numba_it_is_said_what_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)
    monkeypatch.setattr("kfcourse.filters.fused._PRINTED", {})
    compiled.load.cache_clear()
    model = SCALAR["53"]
    with pytest.raises(ValueError, match=r"compiled=True needs numba: pip install 'kfcourse\[fast\]', or leave it out"):
        compare([aof(gaussian(model))], model, 100, 2, 1, compiled=True)
    assert compare([aof(gaussian(model))], model, 100, 2, 1, slow_runs=0).runs == 100


def test_a_second_process_finds_what_was_compiled(tmp_path):
    """Nothing is compiled again: numba counts what it read from its cache."""
    code = (
        "from kfcourse import load_variants, linearised; from kfcourse.filters import aof; "
        "from kfcourse.filters.fused import _program; one = aof(linearised(load_variants()['1'].model)); "
        "print(_program(one, one.printed[1]).compiled.step.cache_hits)"
    )
    environment = {"XDG_CACHE_HOME": str(tmp_path), "LOCALAPPDATA": str(tmp_path), "HOME": str(tmp_path)}
    found = [
        subprocess.run(
            [sys.executable, "-c", code], env={**os.environ, **environment}, capture_output=True, text=True, check=True
        ).stdout.strip()
        for _ in range(2)
    ]
    assert found == ["0", "1"]


def test_what_is_printed_does_not_depend_on_what_was_done_before(monkeypatch):
    """Or the machine code of another session would not be found: the number of a Dummy that has no name stood in the text."""
    texts, filters = [], family(SCALAR["53"])
    for _ in range(2):
        monkeypatch.setattr("kfcourse.filters.fused._PRINTED", {})
        monkeypatch.setattr(compiled, "load", lambda *text: texts.append(text) or SimpleNamespace())
        assert all(fuse(one) is not one for one in filters)
        sp.Dummy()
    assert len(filters) > 10
    assert texts[: len(filters)] == texts[len(filters) :]


def test_a_loop_in_full():
    x, c = sp.symbols("x c", real=True)
    value = c * x**2 + sp.Piecewise((sp.exp(-x), x > 0), (1, True))
    assert compiled.loop("f", {"x": x}, compiled.Pass({"value": value}, [c])) == (
        "\n\n"
        '@njit("void(float64[::1], float64[::1], float64[::1])", cache=True, nogil=True, error_model="numpy")\n'
        "def f(c, x, value):\n"
        "    c0 = c[0]  # c\n"
        "    for i in range(len(x)):\n"
        "        x_i = x[i]\n"
        "        s0 = x_i*x_i\n"
        "        value[i] = c0*s0 + (np.exp(-x_i) if (x_i > 0.0) else 1.0)\n"
    )
