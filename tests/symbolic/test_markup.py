"""Formulas as MathML: functions keep their distance, relations are relations."""

import re

import pytest

from kfcourse.symbolic.markup import mathml


def shown(latex):
    """The text with a | for every thin space."""
    text = mathml(latex, "inline").replace('<mspace width="0.167em" />', "|")
    return (
        re.sub(r"<[^>]*>", "", text)
        .replace("&#x00028;", "(")
        .replace("&#x00029;", ")")
        .replace("&#x0002B;", "+")
    )


@pytest.mark.parametrize(
    ("latex", "text"),
    [
        (r"h \sin x", "h|sin|x"),
        (r"h \sin{\left(x \right)}", "h|sin(x)"),
        (r"x + \sin x", "x+sin|x"),
        (r"2 \cos^{2} x", "2|cos2|x"),
        (r"e^{2} \sin x", "e2|sin|x"),
        (r"\operatorname{Cov} a", "Cov|a"),
        ("a b", "ab"),
    ],
)
def test_a_function_keeps_its_distance(latex, text):
    assert shown(latex) == text


def test_is_distributed_as_is_a_relation_and_letters_are_calligraphic():
    text = mathml(r"x \sim \mathcal{N}(z, p)", "inline")
    assert "<mo>&#x0223C;</mo>" in text and "&#x1D4A9;" in text
