"""A check ends: answers, comparisons and the search for the mistake are limited in time."""

import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import pytest
from tiny import SUM, asks, endless, outcome, raises, stubborn, very_stubborn

from kfcourse.checks import engine
from kfcourse.checks.question import Mistake
from kfcourse.limits import AGAIN, OutOfTime, time_limit

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("answer", [endless, stubborn, very_stubborn], ids=lambda answer: answer.__name__)
def test_endless_loops_end(answer):
    start = time.monotonic()
    result = outcome(SUM, answer, seconds=0.2)
    assert result.status == "unusable"
    assert "still running after 0.2 s" in result.message
    # The last one is stopped only where the alarm finds it outside of its try, by one alarm of some tens, 100 a second.
    assert time.monotonic() - start < 30


def test_comparing_is_limited_in_time_too(monkeypatch):
    monkeypatch.setattr(engine, "equal", lambda *_: endless())
    result = outcome(SUM, lambda a, b: a, seconds=0.2)
    assert (result.status, "simplify" in result.message) == ("unusable", True)


def test_a_long_search_for_the_mistake_still_says_wrong(monkeypatch):
    monkeypatch.setattr(engine, "DIAGNOSIS", 0.2)
    question = asks(SUM.key, SUM.arguments(None), [Mistake("slow", "", endless)])
    result = outcome(question, lambda a, b: a)
    assert (result.status, result.diagnosis) == ("wrong", ())


@pytest.fixture(params=["alarm", "no alarm", "other thread"])
def somewhere(request, monkeypatch):
    """Calls a function in the main thread, there without alarms, as on Windows, or in another thread."""
    if request.param == "alarm" and not hasattr(signal, "setitimer"):
        pytest.skip("no alarms here")
    if request.param == "no alarm":
        monkeypatch.delattr(signal, "setitimer", raising=False)
    if request.param != "other thread":
        return lambda function: function()

    def call(function):
        with ThreadPoolExecutor(1) as pool:
            return pool.submit(function).result()

    return call


def busy(seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        pass


def test_a_block_ends_in_time_anywhere(somewhere):
    def stopped():
        start = time.monotonic()
        with pytest.raises(OutOfTime), time_limit(0.2):
            stubborn()
        return time.monotonic() - start

    assert 0.2 <= somewhere(stopped) < 10


def test_a_check_ends_in_time_anywhere(somewhere):
    result = somewhere(lambda: outcome(SUM, endless, seconds=0.2))
    assert (result.status, "still running after 0.2 s" in result.message) == ("unusable", True)


def test_after_a_block_nothing_comes(somewhere):
    """Blocks that end in time and blocks that end with it, as close as can be: no limit strikes outside of its block."""

    def many():
        late = 0
        for i in range(200):
            try:
                with time_limit(0.0005 * (i % 5) + 1e-4):
                    busy(0.001)
            except OutOfTime:
                late += 1
        busy(5 * AGAIN)  # what was left would come now
        return late

    assert 0 <= somewhere(many) <= 200
    assert not [thread for thread in threading.enumerate() if thread.name == "time limit" and thread.join(1)]


def test_blocks_in_blocks_keep_their_own_limits(somewhere):
    def outer_ends(seconds):
        inner = 0
        with pytest.raises(OutOfTime), time_limit(seconds):
            while True:
                try:
                    with time_limit(0.05):
                        endless()
                except OutOfTime:
                    inner += 1
                busy(3 * AGAIN)
        return inner

    def inner_ends():
        with time_limit(30):
            with pytest.raises(OutOfTime), time_limit(0.05):
                endless()
            return "went on"

    assert any(somewhere(partial(outer_ends, seconds)) >= 2 for seconds in (0.3, 3, 30))  # on a busy machine the later ones
    assert somewhere(inner_ends) == "went on"


def test_a_new_thread_is_not_stopped_in_place_of_the_one_that_begins_it():
    """For a moment both have one number; a parent waits for ever for a child that ended before it could say that it is there."""
    stopped = []

    def begins_threads():
        for _ in range(50):
            with pytest.raises(OutOfTime), time_limit(0.01):
                while True:
                    threading.Thread(target=int, daemon=True).start()
            stopped.append(True)

    parent = threading.Thread(target=begins_threads, daemon=True)
    parent.start()
    parent.join(60)
    assert len(stopped) == 50


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no alarms here")
def test_the_alarm_ends_what_only_looks_for_signals():
    """A wait, and the product of huge integers; without alarms these end by themselves first."""
    for long in (lambda: time.sleep(60), lambda: (7**2_000_000) ** 40):
        start = time.monotonic()
        with pytest.raises(OutOfTime), time_limit(0.2):
            long()
        assert time.monotonic() - start < 20


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no alarms here")
@pytest.mark.parametrize("seconds", [float("inf"), 1e300])
def test_a_block_without_end_is_not_stopped(somewhere, seconds):
    def unlimited():
        with time_limit(seconds):
            return "done"

    assert somewhere(unlimited) == "done"


def test_time_limit_restores_the_alarm():
    before = signal.getsignal(signal.SIGALRM)
    with pytest.raises(OutOfTime), time_limit(0.05):
        endless()
    with time_limit(5.0):
        pass
    assert signal.getsignal(signal.SIGALRM) is before
    assert signal.getitimer(signal.ITIMER_REAL) == (0, 0)
    time.sleep(0.05)  # a left alarm would come now


def test_the_stop_button_works():
    with pytest.raises(KeyboardInterrupt):
        outcome(SUM, raises(KeyboardInterrupt()))
