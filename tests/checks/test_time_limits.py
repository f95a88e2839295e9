"""A check ends: answers, comparisons and the search for the mistake are limited in time."""

import contextlib
import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from tiny import SUM, asks, endless, outcome, raises, stubborn, very_stubborn

from kfcourse.checks import engine
from kfcourse.checks.question import Mistake
from kfcourse.limits import AGAIN, OutOfTime, time_limit

pytestmark = [
    pytest.mark.quick,
    pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no alarms here"),
]


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


def busy(seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        pass


def test_a_block_ends_in_time():
    def stopped():
        start = time.monotonic()
        with pytest.raises(OutOfTime), time_limit(0.2):
            stubborn()
        return time.monotonic() - start

    assert 0.2 <= stopped() < 10


def test_after_a_block_nothing_comes():
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

    assert 0 <= many() <= 200


def test_blocks_in_blocks_keep_their_own_limits():
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

    assert any(outer_ends(seconds) >= 2 for seconds in (0.3, 3, 30))  # on a busy machine the later ones
    assert inner_ends() == "went on"


def test_a_fork_inside_a_block_has_no_limit_but_its_own():
    with time_limit(0.1):
        child = os.fork()
        if not child:
            busy(0.3)
            try:
                with time_limit(0.05):
                    endless()
            except OutOfTime:
                os._exit(7)
        with contextlib.suppress(OutOfTime):
            busy(10)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7


def test_another_thread_is_not_limited():
    def long():
        with time_limit(0.05):
            busy(0.2)
        return "done"

    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(long).result() == "done"


def test_the_alarm_ends_what_only_looks_for_signals():
    """A wait, and the product of huge integers; without alarms these end by themselves first."""
    for long in (lambda: time.sleep(60), lambda: (7**2_000_000) ** 40):
        start = time.monotonic()
        with pytest.raises(OutOfTime), time_limit(0.2):
            long()
        assert time.monotonic() - start < 20


@pytest.mark.parametrize("seconds", [float("inf"), 1e300])
def test_a_block_without_end_is_not_stopped(seconds):
    def unlimited():
        with time_limit(seconds):
            return "done"

    assert unlimited() == "done"


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
