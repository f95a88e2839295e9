"""A check ends: answers, comparisons and the search for the mistake are limited in time."""

import signal
import threading
import time

import pytest
from tiny import SUM, asks, endless, outcome, raises, stubborn, very_stubborn

from kfcourse.checks import engine
from kfcourse.checks.question import Mistake
from kfcourse.limits import OutOfTime, time_limit

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("answer", [endless, stubborn, very_stubborn], ids=lambda answer: answer.__name__)
def test_endless_loops_end(answer):
    start = time.monotonic()
    result = outcome(SUM, answer, seconds=0.2)
    assert result.status == "unusable"
    assert "still running after 0.2 s" in result.message
    # The last one is stopped only where the alarm finds it outside of its try, by one alarm of some tens, 100 a second.
    assert time.monotonic() - start < 30
    assert signal.getitimer(signal.ITIMER_REAL) == (0, 0)


def test_comparing_is_limited_in_time_too(monkeypatch):
    monkeypatch.setattr(engine, "equal", lambda *_: endless())
    result = outcome(SUM, lambda a, b: a, seconds=0.2)
    assert (result.status, "simplify" in result.message) == ("unusable", True)


def test_a_long_search_for_the_mistake_still_says_wrong(monkeypatch):
    monkeypatch.setattr(engine, "DIAGNOSIS", 0.2)
    question = asks(SUM.key, SUM.arguments(None), [Mistake("slow", "", endless)])
    result = outcome(question, lambda a, b: a)
    assert (result.status, result.diagnosis) == ("wrong", ())


def test_time_limit_restores_the_alarm():
    before = signal.getsignal(signal.SIGALRM)
    with pytest.raises(OutOfTime), time_limit(0.05):
        endless()
    with time_limit(5.0):
        pass
    assert signal.getsignal(signal.SIGALRM) is before
    time.sleep(0.05)  # a left alarm would come now


def test_outside_the_main_thread_there_is_no_limit_but_a_result():
    found = []
    thread = threading.Thread(target=lambda: found.append(outcome(SUM, lambda a, b: a + 2 * b)))
    thread.start()
    thread.join()
    assert found[0].passed


def test_the_stop_button_works():
    with pytest.raises(KeyboardInterrupt):
        outcome(SUM, raises(KeyboardInterrupt()))
