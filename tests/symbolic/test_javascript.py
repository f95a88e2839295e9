"""The JavaScript printer: what it has not it refuses in words; tests/pages/test_browser.py runs
what it prints."""

import pytest
import sympy as sp

from kfcourse import ModelError
from kfcourse.symbolic import javascript

x, y, c = sp.symbols("x y c", real=True)


def printed(formula, **more):
    return javascript.loop("f", {"x": sp.Matrix([x])}, {"value": sp.Matrix([formula])}, **more)


def test_a_function_in_full():
    assert printed(c * x**2 + sp.exp(-x) / 3, constants=[c]) == (
        "function f(n, v, c, a) {\n"
        "  for (let i = 0; i < n; i++) {\n"
        "    const o0 = Math.pow(a.x[i], 2)*v.c + (1/3)*Math.exp(-a.x[i]);\n"
        "    a.value[i] = o0;\n"
        "  }\n"
        "}\n"
    )


def test_entries_of_vectors_and_what_is_written_in_place():
    text = javascript.loop("turn", {"p": sp.Matrix([x, y])}, {"p": sp.Matrix([y, x])})
    # all is read before anything is written
    assert (
        text.index("= a.p[2 * i + 1]")
        < text.index("= a.p[2 * i + 0]")
        < text.index("a.p[2 * i + 0] = ")
    )


@pytest.mark.parametrize(
    ("formula", "reason"),
    [
        (
            sp.erf(x),
            r"^erf\(x\) holds what the pages' JavaScript does not have: Unsupported .*: erf",
        ),
        (sp.gamma(x) + x, r"Unsupported .*: gamma"),
        (sp.Integral(sp.exp(-(x**2)), (x, 0, 1)), "Integral"),
        (sp.Sum(x, (y, 1, 3)), "sums and products"),
        (x + y, "the symbol y is nothing that .* nothing defines it"),
        (sp.I * x, "ImaginaryUnit|no finite real value"),
        (sp.zoo * x, "no finite real value"),
        (x * sp.Rational(10) ** 400, "beyond what a float can be"),
        (x * sp.Float("-1e400"), "beyond what a float can be"),
        (sp.Piecewise((x, x > 0)), "Piecewise"),
    ],
)
def test_what_it_does_not_have_is_refused(formula, reason):
    with pytest.raises(ModelError, match=reason):
        printed(formula)
