"""Formulas are written in the order in which people write them, and stay what they are."""

import pytest
import sympy as sp
from sympy.codegen.cfunctions import expm1

from kfcourse import Model, gaussian
from kfcourse.symbolic.typesetting import Printer, with_index
from kfcourse.symbolic.writing import _Writer, formula_latex, formula_lines, number_latex

x, v, w, z, p, m, d = sp.symbols("x v w z p m d", real=True)
c = sp.Symbol("c", real=True)


@pytest.mark.parametrize(
    ("expression", "variables", "noises", "latex"),
    [
        (sp.S.Zero, [x], [], "0"),
        (-c * x, [x], [], "- c x"),
        (1 / (x**2 + 1), [x], [], r"\frac{1}{x^{2} + 1}"),
        (c / x, [x], [], r"\frac{c}{x}"),
    ],
)
def test_order(expression, variables, noises, latex) -> None:
    """More of it: the formulas of all variants in tests/golden."""
    assert formula_latex(sp.expand(expression), variables, noises) == latex


def test_what_is_written_is_what_was_given() -> None:
    model = Model.define(
        "x + T*sin(x)/s + s*exp(-x)*v", "sqrt(2)*x**2*cos(x) - w/3", dict(T=0.1, s=0.2)
    )
    for name in ("Theta", "F"):
        formula = gaussian(model)[name]
        assert (
            sp.Add(*_Writer(sorted(formula.free_symbols, key=str))._as_ordered_terms(formula))
            == formula
        )


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (1, "1"),
        (0.5, "0.5"),
        (5e-5, r"5 \cdot 10^{-5}"),
        (-3.986e14, r"-3.986 \cdot 10^{14}"),
        (-1e-6, "-10^{-6}"),
    ],
)
def test_powers_of_ten_of_a_value_are_written_as_people_do(value, expected):
    assert number_latex(value) == expected


def test_the_code_s_expm1_is_written_as_people_do():
    """Var sin x of x ~ N(m, d); SymPy would print expm_1 - d, which is no formula."""
    F = gaussian(Model.define("x + v", "sin(x) + w"))["F"]
    assert F.has(expm1)
    printed = formula_latex(F, (m, d))
    assert "expm" not in printed
    by_hand = (
        sp.Rational(1, 2) - sp.exp(-2 * d) / 2 + (sp.exp(-2 * d) - sp.exp(-d)) * sp.sin(m) ** 2 + 1
    )
    assert printed == formula_latex(sp.expand(by_hand), (m, d))  # sin^2 m + cos^2 m is 1
    assert "expm" not in " ".join(formula_lines(F, (m, d)))


def test_what_a_name_of_several_letters_multiplies_stands_apart() -> None:
    dt = sp.Symbol("dt")
    assert formula_latex(x + dt * z + v, [x, z], [v]) == r"x + \mathit{dt}\, z + v"
    assert formula_latex(dt**2 * z, [z]) == r"\mathit{dt}^{2}\, z"


def test_one_logarithm_one_identity_and_words_upright_below() -> None:
    latex = Printer().doprint
    assert latex(sp.log(x)) == r"\ln{\left(x \right)}"
    assert latex(sp.Identity(3)) == "I"
    assert (
        latex(sp.Symbol("G_tangent")) == latex(sp.Symbol("G_{tangent}")) == r"G_{\mathrm{tangent}}"
    )


def test_a_name_with_an_index_gets_another_behind_a_comma() -> None:
    assert with_index("x_{1}", "k+1") == "x_{1,k+1}"
    assert with_index(r"\psi", "k") == r"{\psi}_{k}"
