"""Derivations as answers: which line and which term are named, what right steps are worth, what is
refused in words."""

from functools import cache

import pytest
from weekly import weekly

from kfcourse.exercises.checks import derived, exercise
from kfcourse.exercises.derivations import check_text
from kfcourse.exercises.derivations.setting import of_model
from kfcourse.lab.variants import load_variants

BEGIN = "F = M[(y - h)^2]"
END = "g^2*d + f^2*(m^4 + 6*m^2*d + 3*d^2)"
NOISE = {
    "state": "c*x + v",
    "meter": "x + x**2*w",
    "parameters": {"c": 0.5},
    "meter_noise": {"variance": 2},
}
TIMED = {"state": "c*x + v + 0.1*k", "meter": "x + x**2*w", "parameters": {"c": 0.5}}
# its noise is squared: M[w^4]
ODD = {"state": "c*x + v", "meter": "x*(1 + w)**2", "parameters": {"c": 0.5}}


@cache
def opened(variant="53"):
    return exercise("a", variant)


def judged(*lines):
    task = opened()
    task.past.given.clear()
    return task.check("a7", lambda: "\n = ".join(lines))


@pytest.mark.parametrize("variant", weekly(zip(load_variants())))
def test_every_variant_has_a_right_derivation(variant):
    task = exercise("a", variant)
    assert task.derivation.model == task.model
    assert task.check("a7", lambda: task.derivation.text).passed


@pytest.mark.parametrize(("table", "own"), [(NOISE, False), (TIMED, False), (ODD, True)])
def test_where_derivations_are_not_checked_the_course_s_model_is_asked_for(table, own):
    task = exercise("a", {"name": "mine", **table})
    assert (task.derivation.model == task.model) is own
    assert task.check("a7", lambda: task.derivation.text).passed


MIDDLE = "g^2*d + f^2*M[x^4]"
SLIP = "g^2*d + 3*f^2*d^2"


def test_line_term_and_rule_are_named_and_what_stands_on_top_is_right():
    result = judged(BEGIN, MIDDLE, SLIP, "d*(g^2 + 3*f^2*d)")
    assert (result.status, result.diagnosis, result.share) == ("wrong", ("moment",), 0.75)
    for words in (
        f"line 3, `{SLIP}`",
        "`3*f^2*d^2` is not right",
        "Moments of a normal law",
        "right on top of it (1 step)",
        "3 of 4 steps are right",
    ):
        assert words in result.message
    # no right line
    for part in ("6*m^2*d", "m^4", "6*d*m^2", "\n"):
        assert part not in result.message.replace(" ", "")
    # a second slip is named too, and costs another step
    result = judged(BEGIN, MIDDLE, SLIP, "d*(g^2 - 3*f^2*d)")
    assert "slip of its own in line 4" in result.message and result.share == 0.5


def test_an_end_that_is_not_what_was_asked_for_does_not_pass(monkeypatch):
    """Whatever the lines may have made the checker believe: here it reads them as another
    variant's."""
    formulas = {
        "state": "c*x + v",
        "meter": "g*x + 2*f*x**2*w",
        "parameters": {"c": 1, "g": 1, "f": 1},
    }
    other = exercise("a", {"name": "mine", **formulas})
    setting = of_model(other.model)
    monkeypatch.setattr(
        derived, "check_text", lambda text, find, _: check_text(text, find, setting)
    )
    result = judged(BEGIN, "g^2*d + 4*f^2*M[x^4]", "g^2*d + 4*f^2*(m^4 + 6*m^2*d + 3*d^2)")
    assert (result.status, result.diagnosis, result.share) == ("wrong", ("other-meaning",), 0.0)


def test_the_same_again_gets_the_advice():
    opened().past.given.clear()
    messages = [opened().check("a7", lambda: f"{BEGIN}\n = g^2*d").message for _ in range(2)]
    assert ["cross out" in message for message in messages] == [False, True]


def test_a_step_can_be_split_up_at_will_and_earns_no_more():
    """Rewriting one line again and again does not hide that the next is wrong, nor that there is no
    end."""
    padding = [f"M[(y - h)^2] + {k} - {k}" for k in range(9)]
    same = ["M[(y - h)^2]"] * 9
    for lines, share in (((*padding, "g^2*d"), 0.8), (padding, 0.4), ((*same, "g^2*d"), 0.5)):
        assert judged(BEGIN, *lines).share == share
    nothing = judged("F = F", "F + 0", "2*F/2")
    assert (nothing.diagnosis, nothing.share) == (("open-end",), 0.0)
    assert nothing.message.startswith("nothing is derived yet. The last line still has F in it")


@pytest.mark.parametrize(
    ("kind", "words", "lines"),
    [
        ("open-end", "a mean is still to be taken", [BEGIN, "M[y^2] - h^2"]),
        (
            "open-end",
            "still has h in it",
            [BEGIN, "M[y^2] - h^2", "g^2*(m^2 + d) + f^2*(m^4 + 6*m^2*d + 3*d^2) - h^2"],
        ),
        ("open-end", "still has F in it", [BEGIN, "F"]),
        ("steps-missing", "begin with a mean", [f"F = {END}", f"{END} + 0", f"0 + {END}"]),
        ("steps-missing", "3 different lines", [BEGIN, END, END]),
        (
            "unreadable",
            "cannot be read at column",
            [BEGIN, MIDDLE, "g^2*d + 3*f^2*d^2*"],
        ),
    ],
)
def test_a_right_end_is_not_all(kind, words, lines):
    result = judged(*lines)
    assert (result.status, result.diagnosis) == ("wrong", (kind,))
    assert words in result.message and 0 < result.share < 1


def test_other_chains_may_stand_before_but_give_no_letter_another_meaning():
    assert judged("h = M[y]", "g*M[x]", f"g*m\n{BEGIN}", MIDDLE, END).passed
    assert judged(
        f"letters q\nq = M[x^4]\n = m^4 + 6*m^2*d + 3*d^2\n{BEGIN}", "g^2*d + f^2*q", END
    ).passed
    wrong = judged(f"h = 0\n{BEGIN}", "M[y^2]", "g^2*(m^2 + d) + f^2*(m^4 + 6*m^2*d + 3*d^2)")
    assert wrong.status == "wrong" and wrong.message.startswith(
        "line 1, `0`: the line differs from what h means"
    )
    for name in ("x", "w", "m", "g"):
        assert (
            f"`{name} =`, which has a meaning already"
            in judged(f"{name} = 1\n{BEGIN}", END).message
        )


@pytest.mark.parametrize(
    "text",
    [
        "F = __import__('os').system('true')",
        "F = " + "(" * 900 + "x" + ")" * 900,
        "F = x\n" + " = x\n" * 100,
        " = 5",
        f"{BEGIN}\n{BEGIN}",
        "F = 1/(x - x)",
    ],
    ids=lambda text: text[:20],
)
def test_what_cannot_be_read_is_refused_in_words(text):
    result = opened().check("a7", lambda: text)
    assert (result.status, result.trouble) == ("unusable", "")
    assert 20 < len(result.message) < 600 and "\n" not in result.message
