"""The slow filters of a comparison: their budgets of time and memory, and what happens when one fails."""

import re
import subprocess
import sys
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kfcourse import Model, compare, linearised
from kfcourse.filters import aof, pointmass
from kfcourse.lab.short_names import exact
from kfcourse.montecarlo import slow_filters
from kfcourse.symbolic.reading import ModelError

STEPS = 3


def slow(one, name, seconds=0.0, error=None, at=0):
    """A slow filter that is like another; takes so long for a trajectory-step, and fails at a step if told to."""

    def step(state, y):
        if error is not None and state.step == at:
            raise error
        time.sleep(seconds * len(y))
        return one.step(state, y)

    return replace(one, name=name, slow=True, step=step)


def same(one, other):
    """Whether two comparisons found the same numbers, bit by bit."""
    for kind in ("error_variance", "own_variance", "normalised_error"):
        for name in set(one.available) & set(other.available):
            a, b = getattr(one, kind)(name), getattr(other, kind)(name)
            if not all(
                np.array_equal(getattr(a, part), getattr(b, part), equal_nan=True) for part in ("value", "standard_error")
            ):
                return False
    return one.available == other.available and one.slow_runs == other.slow_runs


def test_the_time_decides_on_the_number_of_trajectories_and_on_nothing_else(model, control):
    sluggish = slow(aof(linearised(model)), "sluggish", seconds=1e-3)  # 3 ms a trajectory
    result = compare([control, sluggish], model, 600, STEPS, 1, slow_runs=600, slow_seconds=0.3, progress=False)
    # 100 trajectories fit; on a busy machine fewer, but not more.
    assert 8 <= result.slow_runs <= 100
    again = compare([control, sluggish], model, 600, STEPS, 1, slow_runs=result.slow_runs, progress=False)
    assert same(result, again)
    assert not result.left_out


def test_the_time_is_used(model, control, monkeypatch):
    """A step of a trajectory takes a second, by a clock that only the filter moves; what would be late is done in part."""
    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr(slow_filters, "time", SimpleNamespace(monotonic=lambda: clock.now))

    def step(state, y):
        clock.now += len(y)
        return control.step(state, y)

    steady = replace(control, name="steady", slow=True, step=step)
    options = {"slow_runs": 2000, "slow_seconds": 1000 * STEPS, "threads": 1, "progress": False}
    result = compare([control, steady], model, 2000, STEPS, 1, **options)
    # MARGIN leaves less than ten trajectories unused
    assert 990 <= result.slow_runs == clock.now / STEPS <= 1000


def test_a_chunk_that_does_not_end_in_time_is_given_up(model, control):
    stuck = slow(aof(linearised(model)), "stuck", seconds=10.0)  # 160 s for the first chunk
    start = time.monotonic()
    result = compare([control, stuck], model, 50, STEPS, 1, slow_runs=50, slow_seconds=0.2, progress=False)
    assert time.monotonic() - start < 60
    assert result.left_out == {"stuck": "16 trajectories take more than 0.2 s: give it more time, some 0.2 s"}
    assert result.available == ("aof-gaussian",)
    assert result.slow_runs == 0


def test_the_first_set_alone_is_no_result(model, control):
    """Where there are exceptional trajectories it stands for the others only, and these come with the second set."""
    one, steps = aof(linearised(model)), []

    def step(state, y):
        steps.append(len(y))
        time.sleep(0.0 if len(steps) <= STEPS else 60.0)
        return one.step(state, y)

    stuck = replace(one, name="stuck", slow=True, step=step)
    result = compare([control, stuck], model, 3200, STEPS, 1, slow_runs=64, slow_seconds=1.0, threads=1, progress=False)
    assert steps == [16] * (STEPS + 1)
    assert result.slow_runs == 0
    assert result.left_out == {"stuck": "32 trajectories take more than 1 s: give it more time, some 1 s"}


@pytest.mark.parametrize("error", [ModelError("step 1: too narrow"), MemoryError(), FloatingPointError("overflow")])
def test_a_slow_filter_that_fails_leaves_the_others_as_they_are(model, control, error):
    other, failing = slow(aof(linearised(model)), "other"), slow(control, "failing", error=error, at=1)
    result = compare([control, failing, other], model, 60, STEPS, 1, slow_runs=60, progress=False)
    assert list(result.left_out) == ["failing"]
    assert (str(error) or "step 1: 16 trajectories need more memory than there is") in str(result.left_out["failing"])
    assert same(result, compare([control, other], model, 60, STEPS, 1, slow_runs=60, progress=False))


def test_a_slow_filter_that_is_not_finite_is_left_out(model, control):
    def step(state, y):
        after = control.step(state, y)
        return after._replace(posterior=after.posterior._replace(mean=np.full(y.shape, np.nan)))

    result = compare([control, replace(control, name="nan", slow=True, step=step)], model, 20, STEPS, 1, progress=False)
    assert "step 0: nan became infinite or NaN" in str(result.left_out["nan"])
    assert result.available == ("aof-gaussian",)


def test_a_fast_filter_that_fails_is_still_an_error(model, control):
    failing = replace(slow(control, "failing", error=ModelError("no")), slow=False)
    with pytest.raises(ModelError, match="no"):
        compare([control, failing], model, 20, STEPS, 1, progress=False)


def greedy(one, megabytes, taken):
    """A slow filter that is like another, with so much memory for a trajectory; notes how many it took to the end at once."""

    def step(state, y):
        held = np.empty(int(megabytes * 1e6 / 8) * len(y))  # address space is what is limited
        if state.step == STEPS - 1:
            taken.append(len(y))
        return one.step(state, y)._replace(memory=held)

    return replace(one, name="greedy", slow=True, step=step)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux can limit it")
@pytest.mark.parametrize(("runs", "most"), [(160, 64), (60, 28)])  # 28: half of them would not be whole batches
def test_what_has_no_room_at_once_is_taken_in_parts(model, control, runs, most):
    import resource

    before, free, tight = resource.getrlimit(resource.RLIMIT_AS), [], []
    filters = ([control, greedy(control, 12, taken)] for taken in (free, tight))
    options = {"slow_runs": runs, "progress": False, "threads": 1}
    found = compare(next(filters), model, runs, STEPS, 1, **options)
    # Two of the filter's arrays at a time: 16 trajectories want 384 MB, 28 of them 672.  What other tests have left to threads
    # may be freed meanwhile: tens of MB.
    limited = compare(next(filters), model, runs, STEPS, 1, slow_memory=500e6, **options)
    assert max(free) == most and max(tight) <= 16
    assert same(found, limited)
    assert resource.getrlimit(resource.RLIMIT_AS) == before


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux can limit it")
def test_what_has_no_room_at_all_is_left_out(model, control):
    result = compare([control, greedy(control, 40, [])], model, 40, STEPS, 1, slow_runs=40, slow_memory=100e6, progress=False)
    assert result.left_out == {
        "greedy": "step 0: 16 trajectories need more memory than the 100 MB that the slow filters may take"
    }
    assert result.available == ("aof-gaussian",)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux can limit it")
def test_what_leaves_no_room_for_a_fast_filter_is_left_out_too(model, control):
    """It runs on the same trajectories within the same limit; outside, without the slow one, it has all the room it wants."""

    def step(state, y):
        if state.step == 1:
            np.empty(int(80e6))  # 640 MB
        return control.step(state, y)

    filters = [replace(control, name="fast", step=step), greedy(control, 1, [])]
    result = compare(filters, model, 24, STEPS, 1, slow_runs=24, slow_memory=150e6, progress=False, threads=1)
    assert result.left_out == {"greedy": "16 trajectories need more memory than the 150 MB that the slow filters may take"}
    assert result.available == ("fast",)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux can limit it")
def test_the_exact_filter_with_the_least_memory_ends_in_numbers_or_is_left_out():
    """In a process of its own: linear algebra that finds no room for its buffers would end the process, not raise."""
    lines = (
        "from kfcourse import Model, compare, linearised",
        "from kfcourse.filters import aof, pointmass",
        "from kfcourse.montecarlo.slow_filters import LEAST",
        "model = Model.define('0.9*x + 0.05*x*v', 'x + 0.02*x**2*w')",
        "filters = [aof(linearised(model)), pointmass(model)]",
        "found = compare(filters, model, 112, 3, 1, slow_runs=112, slow_memory=LEAST, progress=False)",
        "print(found.slow_runs, found.left_out)",
    )
    done = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True)
    assert done.returncode == 0 and re.match(r"112 \{\}|0 \{'aof-exact': .*need more memory", done.stdout), done


@pytest.mark.parametrize("memory", [0, -1e9, 1e6, float("nan")])
def test_hardly_any_memory_is_refused(model, control, memory):
    with pytest.raises(ValueError, match=r"slow_memory must be at least 1e\+07"):
        compare([control], model, 20, STEPS, 1, slow_memory=memory)


def test_the_exact_filter_on_a_model_beyond_its_budget_is_left_out_within_seconds():
    model = Model.define("x**3 + 1e-6*v", "x + w")
    start = time.process_time()
    filters = [aof(linearised(model)), pointmass(model)]
    result = compare(filters, model, 112, 2, 1, slow_runs=112, slow_seconds=300, progress=False)
    assert time.process_time() - start < 15  # it takes 3 to 5, and by the clock, on a busy machine, many times that
    assert re.search(r"^step \d of Model\(x' = .* nodes.*--slow-runs 0", result.left_out["aof-exact"])


@pytest.mark.parametrize("seconds", [0, -1, float("nan")])
def test_no_time_at_all_is_refused(model, control, seconds):
    with pytest.raises(ValueError, match="slow_seconds must be positive"):
        compare([control], model, 20, STEPS, 1, slow_seconds=seconds)


def test_another_filter_runs_instead_of_one_that_fails(model, control):
    other = slow(control, "failing")
    failing = replace(slow(control, "failing", error=ModelError("no")), instead=other)
    result = compare([control, failing], model, 40, STEPS, 1, slow_runs=20, progress=False)
    assert dict(result.replaced) == {"failing": "no"}
    assert not result.left_out
    expected = compare([control, other], model, 40, STEPS, 1, slow_runs=20, progress=False)
    np.testing.assert_array_equal(result.error_variance("failing").value, expected.error_variance("failing").value)
    assert not expected.replaced


def test_another_filter_runs_instead_of_one_that_would_not_come_through_in_time(model, control):
    """It is told after the first sixteen, .5 s, while there is time: 84 more take 2.5.  What nothing can replace runs on."""
    crawling, other = slow(control, "aof-exact", seconds=1e-2), slow(control, "aof-exact")
    settings = {"slow_runs": 112, "slow_seconds": 2, "progress": False, "threads": 1}
    result = compare([control, replace(crawling, instead=other)], model, 112, STEPS, 1, **settings)
    assert re.search(r"^16 trajectories take .* s, 100 more than the .* s left$", result.replaced["aof-exact"])
    assert result.slow_runs == 112
    alone = compare([control, crawling], model, 112, STEPS, 1, **settings)
    assert not alone.replaced and "fewer than 100" in str(alone.left_out["aof-exact"])
    quick = replace(slow(control, "aof-exact", seconds=1e-4), instead=other)  # there is a minute for .03 s
    assert not compare([control, quick], model, 112, STEPS, 1, **settings | {"slow_seconds": 60}).replaced


def test_where_point_masses_fail_the_bound_is_found_by_particles():
    """A meter with thousands of humps is beyond the nodes; as a measurement it tells next to nothing."""
    model = Model.define("0.9*x + 0.1*v", "sin(1000*x) + w")
    result = compare([aof(linearised(model)), exact(model)], model, 400, 4, 1, slow_runs=112, progress=False)
    assert "nodes" in result.replaced["aof-exact"]
    assert result.has_bound
    bound = result.bound()
    spread = [1.0]
    for _ in range(3):
        spread.append(0.81 * spread[-1] + 0.01)
    assert (abs(bound.value - spread) < 5 * bound.standard_error + 0.01).all()
