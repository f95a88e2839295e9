"""A check ends: answers, comparisons and the search for the mistake are limited in time."""

import signal
import time

import pytest
from tiny import SUM, asks, endless, outcome, raises, stubborn, very_stubborn

from kfcourse.exercises.checks import engine, reference
from kfcourse.exercises.checks.question import Mistake
from kfcourse.limits import AGAIN, OutOfTime, time_limit

pytestmark = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no alarms here")


@pytest.mark.parametrize(
    "answer", [endless, stubborn, very_stubborn], ids=lambda answer: answer.__name__
)
def test_endless_loops_end(answer):
    start = time.monotonic()
    result = outcome(SUM, answer, seconds=0.2)
    assert result.status == "unusable"
    assert "still running after 0.2 s" in result.message
    # The last one is stopped only where the alarm finds it outside of its try, by one alarm of some
    # tens, 100 a second.
    assert time.monotonic() - start < 30


def test_comparing_is_limited_in_time_too(monkeypatch):
    monkeypatch.setattr(reference, "equal", lambda *_: endless())
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

    # on a busy machine the later ones
    assert any(outer_ends(seconds) >= 2 for seconds in (0.3, 3, 30))
    assert inner_ends() == "went on"


def test_the_stop_button_works():
    with pytest.raises(KeyboardInterrupt):
        outcome(SUM, raises(KeyboardInterrupt()))
