"""Tables and typeset equations."""

import numpy as np
import pytest
import sympy as sp

from kfcourse.pages import table
from kfcourse.symbolic.typesetting import WIDTH, equation_latex, symbols


def test_a_table_aligns_numbers_and_marks_what_is_not_there():
    shown = table(
        {"filter": ["a", "b"], "$D$ (m²)": [1.0, -2.25], "e": [(1.0, 0.125), np.nan]},
        ".2f",
        caption="Errors",
    )
    assert shown.markdown == (
        '<span class="kf-caption">Errors</span>\n\n'
        "| filter | $D$ (m²) | e |\n| :-- | --: | --: |\n| a | 1.00 | 1.00 ± 0.12 |\n| b | −2.25 "
        "| – |"
    )
    assert "| +1.0 |" in table({"D": [1.0]}, {"D": "+.1f"}).markdown
    assert "| 12.5\u00a0% |" in table({"D": [0.125]}, ".1%").markdown
    assert "| 9999 |\n| −12,908.4 |" in table({"D": [9999, -12908.4]}).markdown


def test_columns_of_a_table_have_one_length():
    with pytest.raises(ValueError, match="zip"):
        table({"a": [1], "b": [1, 2]})


def test_long_equations_are_broken_between_terms():
    a, b = sp.symbols("a b")
    lines = equation_latex((sp.Symbol("f"), sp.expand((a + b) ** 9))).split("\\\\\n")
    assert len(lines) > 1 and all(symbols(line) < WIDTH + 8 for line in lines)
    assert all(line.startswith(r"&\quad ") for line in lines[1:])
    again = sp.sympify(
        " ".join(lines)
        .split("= ", 1)[1]
        .replace(r"&\quad ", "")
        .replace("{", "(")
        .replace("}", ")")
        .replace(" + ", "+")
        .replace("^", "**")
        .replace(" ", "*")
    )
    assert sp.expand(again - (a + b) ** 9) == 0


def test_a_side_that_prints_like_the_one_before_is_printed_once():
    a, b = sp.symbols("a b")
    assert equation_latex(("f", a * b, b * a, 2 * a)) == "f &= a b = 2 a"
