"""Generated formulas, models and tables of variants: each is right or refused, and none hangs,
crashes or lies.

300 cases with `make test`, always the same; 20,000 other ones with `make fuzz`.
"""

import datetime
import math
import operator
import os
import time
import warnings
from contextlib import contextmanager

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import HealthCheck, Phase, assume, event, given, settings
from hypothesis import strategies as st
from latex2mathml.converter import convert

from kfcourse import AngleWarning, FormulaError, Model, ModelError, simulate
from kfcourse.lab import VariantError, read_variant
from kfcourse.lab.variants import KEYS
from kfcourse.symbolic.equations import compile_model
from kfcourse.symbolic.formula import FUNCTIONS, parse, symbol
from kfcourse.symbolic.model import nothing_random

CASES = int(os.environ.get("KFCOURSE_CASES", "300"))
# seconds, ten times what the slowest case takes on a slow machine: whatever is longer hangs
SOON = 10.0

pytestmark = pytest.mark.filterwarnings(
    "ignore::RuntimeWarning", "ignore::sympy.utilities.exceptions.SymPyDeprecationWarning"
)


def cases(share):
    """So many of all cases; with `make test` the same each time."""
    return settings(
        max_examples=max(round(share * CASES), 1),
        derandomize=CASES <= 300,
        deadline=None,
        database=None,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )


@contextmanager
def soon():
    start = time.monotonic()
    yield
    assert time.monotonic() - start < SOON


# --- formulas: trees that are written as text and, independently, evaluated by mpmath

NUMBERS = [
    "0",
    "1",
    "2",
    "3",
    "7",
    "10",
    "0.5",
    ".25",
    "3.",
    "0.1",
    "1e-3",
    "2.5E2",
    "1_000",
    "0x10",
    "1e99",
    "1e-99",
    "0.0",
]
WILD = [
    "1e-400",
    "1e400",
    "1e308",
    "123456789012345678901234567890",
    "1e-320",
    "999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999",
    "1j",
    "0b11",
    "1__0",
    "01",
]
EXPONENTS = ["2", "3", "0.5", "-1", "4", "0", "1.5", "16", "-2"]
UNARY = sorted(set(FUNCTIONS) - {"atan2"})
COMPARE = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


def grown(inner):
    return st.one_of(
        st.tuples(st.sampled_from("+-*/"), inner, inner),
        st.tuples(st.just("neg"), inner),
        st.tuples(st.just("pow"), inner, st.sampled_from(EXPONENTS)),
        st.tuples(st.sampled_from(UNARY), inner),
        st.tuples(st.just("atan2"), inner, inner),
        st.tuples(st.just("if"), st.sampled_from(sorted(COMPARE)), inner, inner, inner, inner),
    )


# Built once, as that takes longer than to draw from it: leaves are the places of names and numbers
# in lists.
TREES = st.recursive(
    st.tuples(st.sampled_from(["name", "name", "number"]), st.integers(0, 59)), grown, max_leaves=7
)


def named(tree, names, numbers=NUMBERS):
    """The tree with names and numbers at its leaves."""
    kind, *parts = tree
    if kind in ("name", "number"):
        known = names if kind == "name" else numbers
        return kind, known[parts[0] % len(known)]
    return kind, *(
        named(part, names, numbers) if isinstance(part, tuple) else part for part in parts
    )


STRENGTH = {"+": 1, "-": 1, "neg": 2, "*": 2, "/": 2, "pow": 4}


def text(tree):
    """As a person types it: parentheses only where they are needed."""
    kind, *parts = tree
    if kind in ("name", "number"):
        return parts[0]
    if kind == "neg":
        return f"-{inside(parts[0], 3)}"
    if kind == "pow":
        return f"{inside(parts[0], 5)}**{parts[1] if parts[1][0] != '-' else f'({parts[1]})'}"
    if kind == "if":
        sign, first, a, b, second = parts
        return (
            f"({inside(first, 1)} if {inside(a, 1)} {sign} {inside(b, 1)} else {inside(second, 1)})"
        )
    if kind in "+-*/":
        own = STRENGTH[kind]
        return f"{inside(parts[0], own)} {kind} {inside(parts[1], own + 1)}"
    return f"{kind}({', '.join(map(text, parts))})"


def inside(tree, least):
    return text(tree) if STRENGTH.get(tree[0], 9) >= least else f"({text(tree)})"


def off_a_jump(number):
    """No value is claimed where rounding decides on which side of a jump it is: sign(sin(pi))."""
    if abs(number) < 1e-40:
        raise ValueError


def value(tree, point):
    """The exact value to 400 digits; an exception or a complex number where there is none."""
    kind, *parts = tree
    if kind == "name":
        return point[parts[0]]
    if kind == "number":
        digits = parts[0].replace("_", "")
        return mpmath.mpf(int(digits, 16)) if digits.startswith("0x") else mpmath.mpf(digits)
    if kind == "pow":
        return value(parts[0], point) ** mpmath.mpf(parts[1])
    if kind == "if":
        sign, first, a, b, second = parts
        a, b = value(a, point), value(b, point)
        off_a_jump(a - b)
        return value(first if COMPARE[sign](a, b) else second, point)
    values = [value(part, point) for part in parts]
    if kind in ("sign", "Heaviside", "atan2"):
        off_a_jump(values[0])
    if kind == "neg":
        return -values[0]
    if kind in "+-*/":
        a, b = values
        return a + b if kind == "+" else a - b if kind == "-" else a * b if kind == "*" else a / b
    if kind in ("abs", "Abs"):
        return abs(values[0])
    if kind == "Heaviside":
        return (mpmath.sign(values[0]) + 1) / 2
    return getattr(mpmath, kind)(*values)


NAMES = {name: symbol(name) for name in ("x", "v", "c")}
POINT = {"x": "1.37", "v": "-0.59", "c": "0.83"}


@cases(0.36)
@given(TREES)
def test_a_formula_has_the_value_that_its_text_has(tree):
    tree = named(tree, [*NAMES, "pi"])
    try:
        with soon():
            formula = parse(text(tree), NAMES)
    except FormulaError:
        event("refused")
        return
    with mpmath.workdps(400):
        point = {name: mpmath.mpf(number) for name, number in POINT.items()} | {"pi": mpmath.pi}
        try:
            expected = value(tree, point)
        # the last of complex arguments
        except (ArithmeticError, ValueError, TypeError, AttributeError):
            expected = mpmath.nan
        # No real number there, or one in whose sines 400 digits are not enough:
        assume(
            isinstance(expected, mpmath.mpf) and mpmath.isfinite(expected) and abs(expected) < 1e150
        )
        own = formula.subs(
            {NAMES[name]: sp.Rational(number) for name, number in POINT.items()}
        ).evalf(30, maxn=300)
        assume(own.is_Float or own.is_Rational)
        assert abs(mpmath.mpf(str(own)) - expected) <= 1e-20 * (1 + abs(expected)), (
            text(tree),
            own,
            expected,
        )


ODD = [
    *"()*+-/.,:;#^_'\"\\[]{}=<>@!%&|~`$?\n\t\0\x1bｘſх²−π\udc80x01",
    "**",
    "//",
    "sin",
    "log(",
    "e9",
]


@st.composite
def mangled(draw, original):
    """A text with some places changed."""
    characters = list(draw(original))
    for _ in range(draw(st.integers(0, 4))):
        place = draw(st.integers(0, len(characters)))
        characters[place : place + draw(st.integers(0, 2))] = draw(st.sampled_from(ODD))
    return "".join(characters)


@cases(0.3)
@given(mangled(TREES.map(lambda tree: text(named(tree, [*NAMES, "pi", "q"], NUMBERS + WILD)))))
def test_any_text_is_a_formula_or_refused_with_its_place(formula):
    with soon():
        try:
            tree = parse(formula, NAMES)
        except FormulaError as error:
            assert str(error).encode("utf-8") and 0 <= error.column <= max(len(formula), 1)
            assert all(character.isprintable() or character == "\n" for character in str(error))
            return
    assert tree.free_symbols <= set(NAMES.values())
    assert {type(call) for call in tree.atoms(sp.Function)} <= {*FUNCTIONS.values()} | {
        sp.sec,
        sp.csc,
        sp.cot,
        sp.Piecewise,
    }
    assert formula.isascii() and "#" not in formula


# --- models

STATES = ["x", "x1", "q_1", "x_dot", "lambda_", "alpha", "E", "I", "S", "beta_1_2", "z", "s0", "np"]
SIZES = [0, 1, -1, 0.5, 2, 0.01, 1e-5, 1e5, 1e-60, 1e60, 1e99, -1e99, 1e-99, 3, sp.Rational(1, 3)]
EXTREME = [0.0, 1e-300, 1e300, 1e200, 6e23, -1.0, math.nan, math.inf, 1e-60, 1e60, 1e-101, 5e-324]


def laws(size):
    number = st.one_of(st.sampled_from([0.0, 1.0, 0.3, -0.5, 2]), st.sampled_from(EXTREME))
    variance = st.one_of(
        st.sampled_from([1.0, 0.25, 4, 0]),
        st.sampled_from(EXTREME),
        st.lists(number, min_size=size, max_size=size),
    )
    return st.fixed_dictionaries({}, optional={"mean": number, "variance": variance})


@st.composite
def models(draw):
    """Keyword arguments of Model.define."""
    n = draw(st.integers(1, 2))
    x = draw(st.lists(st.sampled_from(STATES), min_size=n, max_size=n, unique=True))
    parameters = draw(st.dictionaries(st.sampled_from("abc"), st.sampled_from(SIZES), max_size=2))
    names = [*x, *parameters]

    def formulas(noise, count):
        body = [text(named(draw(TREES), [*names, noise])) for _ in range(count)]
        return [f"{formula} + 0.3*{noise}" if draw(st.booleans()) else formula for formula in body]

    meters = formulas("w", draw(st.integers(1, 2)))
    meters[0] += f" + {x[0]}" if draw(st.booleans()) else ""
    given = {
        "state": formulas("v", n),
        "meter": meters,
        "parameters": parameters,
        "symbols": {"x": x},
        "angles": [],
    }
    for what, size in {"prior": n, "state_noise": 1, "meter_noise": 1}.items():
        if draw(st.booleans()):
            given[what] = draw(laws(size))
    return given


def defined(given):
    """The model, or None if it is refused."""
    with soon():
        try:
            return Model.define(**given)
        except (FormulaError, ModelError) as error:
            assert 10 < len(str(error)) < 1500
            event(type(error).__name__)
            return None


def turns(formula, model, point):
    """Whether an angle is so large at the point that a float keeps no digit of it."""
    angles = [
        call.args[0].subs(model.values).subs(point)
        for call in formula.atoms(sp.sin, sp.cos, sp.tan)
    ]
    return any(not angle.is_number or abs(angle.evalf()) > 1e8 for angle in angles)


@cases(0.14)
@given(models())
def test_a_model_is_refused_or_computes_what_its_formulas_say(given):
    model = defined(given)
    assume(model is not None)
    for line in model.latex().split("\\\\\n"):
        assert "<math" in convert(
            line.replace("&", "").replace(r"\begin{aligned}", "").replace(r"\end{aligned}", "")
        )
    assert isinstance(nothing_random(model), str) and str(model)
    state, meter = compile_model(model)
    point = {s: 0.3 + 0.2 * i for i, s in enumerate((*model.x, *model.v, *model.w))}
    x, v, w = (np.array([point[s] for s in group]) for group in (model.x, model.v, model.w))
    with np.errstate(all="ignore"):
        for function, noise, equation in (
            (state, v, model.state_equation),
            (meter, w, model.meter_equation),
        ):
            numbers = np.broadcast_to(function(x, noise), (len(equation),))
            for number, formula in zip(numbers, equation, strict=True):
                try:
                    exact = (
                        formula.subs(model.values)
                        .subs({s: sp.Rational(str(p)) for s, p in point.items()})
                        .evalf(20)
                    )
                except TypeError:  # a comparison of what is not real there
                    continue
                computable = exact.is_Float and 1e-250 < abs(exact) < 1e250 and np.isfinite(number)
                if not computable or turns(formula, model, point):
                    continue
                # Terms that cancel cost digits: compared with the size of the terms.
                terms = [
                    abs(term.subs(model.values).subs(point)) for term in sp.Add.make_args(formula)
                ]
                assert abs(number - float(exact)) <= 1e-6 * float(sum(terms) + abs(exact)), (
                    formula,
                    number,
                    exact,
                )
        with soon():
            tracks = simulate(model, 4, 3, seed=1)
    assert tracks.x.shape == (3, 4, model.n) and tracks.y.shape == (3, 4, model.p)


# --- laws, tables and files


ANYTHING = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(-(10**30), 10**400),
        st.floats(),
        st.sampled_from(
            [
                "0.9*x + v",
                "x + w",
                "",
                "__import__('os')",
                "x" * 3000,
                *["v", "w", "c", "x", "x1", "y", "1", "lambda"],
            ]
        ),
        st.just(datetime.date(2024, 2, 29)),
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(
            st.sampled_from(["mean", "variance", "x", "v", "w", "y", "c", "lambda", ""]),
            inner,
            max_size=3,
        ),
    ),
    max_leaves=4,
)
SOUND = {"state": "c*x + 0.1*v", "meter": "x + w", "parameters": {"c": 0.9}}


@cases(0.1)
@given(
    st.dictionaries(st.sampled_from([*sorted(KEYS), "speed"]), ANYTHING, min_size=1, max_size=3),
    st.booleans(),
)
def test_any_table_is_a_variant_or_refused_by_its_name(table, completed):
    with soon(), warnings.catch_warnings():
        warnings.simplefilter("ignore", AngleWarning)
        try:
            variant = read_variant("name", (SOUND if completed else {}) | table, "here")
        except VariantError as error:
            assert str(error).startswith("variant name in here: ")
            assert len(str(error)) > len("variant name in here: ") + 5
            return
    assert not nothing_random(variant.model)
