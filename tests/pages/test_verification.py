"""Statements on pages raise when they do not hold; and are printed as they should be."""

import numpy as np
import pytest
import sympy as sp

from kfcourse.pages import Unverified, agree, claim, typeset, verified
from kfcourse.pages.verification import VERIFIED

x, z = sp.symbols("x z", real=True)
p = sp.Symbol("p", positive=True)
K = sp.Symbol("K")


def test_an_identity_is_printed_with_its_mark_and_its_label():
    shown = verified(((x + z) ** 2, x**2 + 2 * x * z + z**2), label="eq-square", how="for every x")
    assert shown.markdown.startswith(
        "$$\n\\begin{aligned}\n\\left(x + z\\right)^{2} &= x^{2} + 2 x z + z^{2}\n"
    )
    assert "$$ (eq-square)\n" in shown.markdown
    assert "✓ identity, by SymPy; for every x" in shown.markdown
    record = shown._repr_mimebundle_()[VERIFIED]
    assert (record["label"], record["equations"]) == ("eq-square", 1)


@pytest.mark.parametrize(
    "wrong",
    [
        ((x + z) ** 2, x**2 - 2 * x * z + z**2),
        (sp.Matrix([[1, x]]), sp.Matrix([[1, -x]])),
        (sp.Matrix([[1, x]]), sp.Matrix([[1], [x]])),
        (sp.log(x**2), sp.log(x**2) + sp.log(2)),
        (r"\text{three sides}", x, x, z),
    ],
)
def test_a_false_equation_raises(wrong):
    with pytest.raises(Unverified):
        verified(wrong)


def test_the_message_says_what_is_left():
    with pytest.raises(Unverified, match=r"left - right = 2\*x"):
        verified((x + z, z - x))


def test_letters_of_matrices_stand_for_their_entries():
    A, B, C = (sp.MatrixSymbol(name, 2, 2) for name in "ABC")
    entries = {A: sp.Matrix([[x, z], [0, 1]]), B: sp.Matrix([[1, 0], [x, z]]), C: A * B}
    shown = verified((C.T, B.T * A.T), where=entries)
    assert "C^{T} &= B^{T} A^{T}" in shown.markdown
    with pytest.raises(Unverified):
        verified((C.T, A.T * B.T), where=entries)


def test_numbers_to_so_many_digits():
    fourier = sp.Integral(sp.exp(-(x**2) / (2 * p)) * sp.cos(x), (x, -sp.oo, sp.oo))
    right = sp.sqrt(2 * sp.pi * p) * sp.exp(-p / 2)
    assert "to 10 digits, at 3 points" in verified((fourier, right), digits=10).markdown
    with pytest.raises(Unverified, match="the left side is"):
        verified((fourier, right * (1 + sp.Rational(1, 10**9))), digits=10)
    with pytest.raises(ValueError, match="no number is left"):
        verified((sp.Function("f")(x), x), digits=5)


def test_what_is_printed_alike_needs_a_name():
    alike = sp.expand((x + 1) ** 2 - x**2 - 2 * x), sp.S.One
    assert r"s &= 1" in verified(("s", *alike)).markdown
    for sides in (alike, (sp.diag(*alike), sp.eye(2))):
        with pytest.raises(ValueError, match="say what both sides are"):
            verified(sides)


def test_there_must_be_something_to_verify():
    for nothing in ((), ((r"\tau", x),), ("x = 1",)):
        with pytest.raises(ValueError, match=r"nothing to verify|needs an equation"):
            verified(*nothing)
    with pytest.raises(ValueError, match="condition"):
        claim("Everything is well.")


def test_definitions_say_so():
    shown = typeset((sp.Symbol("K"), p / (p + 1)), label="eq-gain")
    assert "kf-verified" not in shown.markdown and shown.markdown.endswith(
        '<p class="kf-said">definition</p>'
    )
    assert shown._repr_mimebundle_()[VERIFIED]["equations"] == 0


def test_claims_hold_or_raise():
    assert claim(
        "The gain is below **0.7**.", 0.6 < 0.7, np.array([True, True])
    ).markdown.startswith("The gain is below **0.7**.\u00a0<span")
    assert claim(f"{0.62:.0%} of them, or 3 %.", True).markdown.startswith(
        "62\u00a0% of them, or 3 %."
    )
    shown = claim(f"From {1e-9:.0e} to {7.25e12:.1e}, $1e-9$ and the variant a1e3.", True).markdown
    assert shown.startswith(r"From $10^{-9}$ to $7.2 \cdot 10^{12}$, $1e-9$ and the variant a1e3.")
    shown = claim(
        f"It is {-0.26:+.2f} (-3 before), {-2e-5:.0e} in the years 1960-61, $x_k-1$ and `a[-1]`.",
        True,
    ).markdown
    assert shown.startswith(
        r"It is −0.26 (−3 before), −$2 \cdot 10^{-5}$ in the years 1960-61, $x_k-1$ and `a[-1]`."
    )
    shown = claim(
        f"{195959} of {9999} or {12908.44:.1f}, 0.123456, $x=10000$ and `runs=20000`.", True
    ).markdown
    assert shown.startswith("195,959 of 9999 or 12,908.4, 0.123456, $x=10000$ and `runs=20000`.")
    with pytest.raises(Unverified, match=r"condition 2 of 2.*The gain"):
        claim("The gain is below 0.7.", True, np.array([True, False]))


def test_agreement_within_a_tolerance():
    agree("They agree.", [1.0, 2.0], [1.0, 2.0 + 1e-13], within=1e-12)
    for other in ([1.0, 2.1], [1.0, np.nan], [1.0, 2.0, 3.0]):
        with pytest.raises(Unverified, match="They agree"):
            agree("They agree.", [1.0, 2.0], other, within=1e-12)
    with pytest.raises(Unverified):
        agree("They agree.", 1e-3, 0.0, within=1e-6, relative=False)


def test_sums_are_printed_in_the_order_people_write_them():
    lam, K, S, x, y = sp.symbols("lambda K S x y")
    assert "\\lambda + K \\left(y - S\\right)" in typeset((x, lam + K * (y - S))).markdown
    assert (
        "\\lambda + K \\left(y - S \\lambda\\right)"
        in typeset((x, lam + K * (y - S * lam))).markdown
    )
    shown = verified(lambda: [(x - K * S * y, -y * K * S + x)]).markdown
    assert "x - K S y &= - y K S + x" in shown  # as a function has them
    assert "1 + x^{2}" in typeset((y, x**2 + 1)).markdown
    assert "x^{2} + x + 1" in typeset((y, x + 1 + x**2)).markdown  # powers descend
