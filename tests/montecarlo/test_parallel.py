"""The slow filters on several cores: the same numbers, the same budgets, and nothing left behind."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

import numpy as np
import psutil
import pytest
from endings import ended

from kfcourse import Model, compare, linearised
from kfcourse.filters import aof, particle, pointmass
from kfcourse.montecarlo import parallel, slow_filters
from kfcourse.symbolic.reading import ModelError

STEPS = 3
linux = pytest.mark.skipif(sys.platform != "linux", reason="forks, and limits of memory, are Linux's")


@pytest.fixture
def started(monkeypatch):
    """Processes are worth their start at once; how many there were each time."""
    counts = []

    @contextmanager
    def noted(count, work):
        counts.append(count)
        with parallel.processes(count, work) as submit:
            yield submit

    monkeypatch.setattr(slow_filters, "START", 0.0)
    monkeypatch.setattr(slow_filters, "processes", noted)
    return counts


def slow(one, name, before_step):
    """A slow filter that is like another, and does something before each step."""

    def step(state, y):
        before_step(state, y)
        return one.step(state, y)

    return replace(one, name=name, slow=True, step=step)


def same(one, other):
    """Whether two comparisons have the same sums over the same batches, bit by bit."""
    found = [(result.slow_part, result.smoothing and result.smoothing.slow_part) for result in (one, other)]
    for first, second in zip(*found, strict=True):
        if (first is None) != (second is None):
            return False
        if first is not None:
            for part in ("first", "exceptional"):
                sums, others = getattr(first, part), getattr(second, part)
                if (sums is None) != (others is None):
                    return False
                if sums is not None and not all(
                    np.array_equal(getattr(sums, name), getattr(others, name)) for name in sums.__dataclass_fields__
                ):
                    return False
    return one.available == other.available and dict(one.left_out) == dict(other.left_out)


def together(filters, model, runs=300, **options):
    return partial(compare, filters, model, runs, STEPS, 1, slow_runs=runs, progress=False, **options)


def test_the_exact_filter_finds_the_same_numbers_on_any_number_of_cores(model, control, started):
    exact = pointmass(model)
    found = together([control, exact], model, runs=136, smoothers=[control, exact])
    one, two, three = (found(threads=threads) for threads in (1, 2, 3))
    assert started == [2, 2, 3, 3]  # filtering and smoothing, each time
    assert one.slow_runs == one.smoothing.slow_runs == 136
    assert same(one, two) and same(one, three)


def test_particles_find_the_same_numbers_on_any_number_of_cores(started):
    """What they draw hangs on the size of a chunk."""
    model = Model.define(["x1 + 0.1*x2", "x2 - 0.1*sin(x1) + 0.1*v1"], ["sin(x1) + 0.1*w1"])
    found = together([aof(linearised(model)), particle(model, 100, name="aof-exact")], model)
    assert same(found(threads=1), found(threads=2))
    assert started == [2]


def test_processes_that_are_no_forks_find_the_same_numbers(model, control, started, monkeypatch):
    """As on macOS and Windows: filters, which are closures, are sent."""
    found = together([control, pointmass(model)], model, runs=112)
    one = found(threads=1)
    monkeypatch.setattr(parallel, "FORK", False)
    assert same(one, found(threads=2))
    assert started == [2]


def test_what_takes_a_moment_only_starts_no_process(model, control, started, monkeypatch):
    monkeypatch.setattr(slow_filters, "START", 60.0)
    together([control, pointmass(model)], model, runs=112, threads=2)()
    assert started == []


def test_where_no_process_can_be_had_one_is_enough(model, control, started, monkeypatch):
    found = together([control, pointmass(model)], model, runs=112)

    def refused(count, work):
        raise OSError("no more processes")

    monkeypatch.setattr(slow_filters, "processes", refused)
    assert same(found(threads=1), found(threads=2))


def test_a_worker_of_a_pool_starts_no_processes(model, control, started):
    """It may not: multiprocessing forbids it."""
    context = multiprocessing.get_context("fork" if parallel.FORK else "spawn")
    with context.Pool(1) as pool:
        assert pool.apply(parallel.may_start) is False
    assert parallel.may_start()


# --- failures


@pytest.mark.parametrize("threads", [1, 2])
def test_a_filter_that_fails_far_on_is_left_out_with_the_same_words(model, control, started, threads):
    def fails(state, y):
        if len(y) > 32 and state.step == 1:  # the fourth chunk
            raise ModelError("too narrow")

    filters = [control, slow(control, "failing", fails), slow(aof(linearised(model)), "other", lambda *_: None)]
    result = together(filters, model, threads=threads)()
    assert result.left_out == {"failing": "too narrow"}
    assert same(replace(result, left_out={}), replace(together([filters[0], filters[2]], model, threads=1)(), left_out={}))
    assert len(started) == 2 * (threads - 1)


@linux
def test_a_process_that_is_killed_is_told_in_words(model, control, started):
    parent = os.getpid()

    def dies(state, y):
        if os.getpid() != parent:
            os.kill(os.getpid(), signal.SIGKILL)

    result = together([control, slow(control, "dying", dies)], model, threads=2)()
    assert "was killed" in str(result.left_out["dying"]) and "fewer jobs" in str(result.left_out["dying"])
    assert result.available == ("aof-gaussian",)
    assert started == [2] and not multiprocessing.active_children()


# --- budgets


def test_the_time_decides_on_the_number_of_trajectories_and_on_nothing_else(model, control, started):
    sluggish = slow(control, "sluggish", lambda _, y: time.sleep(1e-3 * len(y)))  # 3 ms a trajectory
    found = together([control, sluggish], model, runs=4000)
    begun = time.monotonic()
    result = found(threads=2, slow_seconds=1.0)
    assert time.monotonic() - begun < 20  # and the fast filters, on a busy machine
    assert 16 <= result.slow_runs <= 666  # two cores at 3 ms a trajectory
    again = compare([control, sluggish], model, 4000, STEPS, 1, slow_runs=result.slow_runs, threads=1, progress=False)
    assert same(result, again) and not result.left_out
    assert started == [2]


def test_behind_a_chunk_that_is_out_of_time_nothing_counts(model, control, started):
    """Else the trajectories that are hard would be missing from the mean."""

    def hangs(state, y):
        if len(y) == 32 and state.step == 2:  # the third chunk; the fourth is done long before the end
            time.sleep(60)

    begun = time.monotonic()
    result = together([control, slow(control, "hanging", hangs)], model, threads=2, slow_seconds=2.0)()
    assert result.slow_runs == 32
    assert time.monotonic() - begun < 30
    assert started == [2]


@linux
def test_chunks_that_have_no_room_side_by_side_come_one_after_the_other(model, control, started):
    """Memory is shared out among processes; where a share is too small, it is the whole for one, with the same numbers."""

    def step(state, y):
        held = np.empty(int(6e6 / 8) * len(y))  # 16 trajectories 96 MB, the chunk of 64 384 MB
        return control.step(state, y)._replace(memory=held)

    greedy = replace(control, name="greedy", slow=True, step=step)
    found = together([control, greedy], model, runs=176, slow_memory=1100e6)  # two of the filter's arrays at a time: 768 MB
    assert same(found(threads=1), found(threads=9))
    assert started == [4, 2]  # the chunks of 16, 32, 64 and 48; then two: and at last one, in no process of its own


# --- the end

HANGING = """
import signal, sys, time
from dataclasses import replace
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job has it ignored
from kfcourse import Model, compare, linearised
from kfcourse.filters import aof
from kfcourse.montecarlo import slow_filters
slow_filters.START = 0.0
model = Model.define("0.9*x + 0.1*v", "x + w")
control = aof(linearised(model))
def step(state, y):
    if len(y) == 32:
        print("hanging", flush=True)
        time.sleep(60)
    return control.step(state, y)
hanging = replace(control, name="hanging", slow=True, step=step)
compare([control, hanging], model, 500, 3, 1, threads=2, progress=False)
"""


@linux
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_the_end_of_the_program_is_the_end_of_its_processes(number):
    """Ctrl-C goes to all processes of a terminal at once; what kills the program outright tells the others nothing."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    program = subprocess.Popen([sys.executable, "-c", HANGING], start_new_session=True, **pipes)
    assert program.stdout.readline() == b"hanging\n"
    workers = psutil.Process(program.pid).children(recursive=True)
    assert workers
    begun = time.monotonic()
    if number == signal.SIGINT:
        for worker in workers:
            worker.send_signal(number)
        time.sleep(0.2)  # none of them may take it for itself, and say so
        os.killpg(program.pid, number)
    else:
        program.kill()
    errors = program.communicate(timeout=30)[1].decode()  # the pipes are open as long as anybody has them
    assert ended(*workers)
    assert time.monotonic() - begun < 30  # not the minute that is slept
    assert program.returncode == -number
    assert errors.count("Traceback") == errors.count("KeyboardInterrupt") == (number == signal.SIGINT)


HALF_SENT = """
import os, time
from kfcourse.montecarlo.parallel import processes

for wait in range(20):
    hear, tell = os.pipe()

    def work():
        os.write(tell, b"!")
        return bytes(10**8)

    with processes(1, work) as submit:
        submit()
        os.read(hear, 1)
        time.sleep(wait / 100)
"""


@linux
def test_a_result_that_is_half_sent_is_waited_for_by_nobody():
    """Forks that were ended while they sent a large result left the pool waiting for the rest: once in 60 times Ctrl-C hung."""
    assert subprocess.run([sys.executable, "-c", HALF_SENT], timeout=120).returncode == 0
