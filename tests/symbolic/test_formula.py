"""Formulas typed by people: what is read is right, and nothing else is read."""

import json
import re
import subprocess
import sys

import pytest
import sympy as sp

from kfcourse import FormulaError
from kfcourse.symbolic.formula import check_name, parse, symbol

NAMES = {name: symbol(name) for name in ("x", "v", "w", "c", "f")}
x, v, c = NAMES["x"], NAMES["v"], NAMES["c"]


def read(formula):
    return parse(formula, NAMES)


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        ("c*x - v", c * x - v),
        ("  +x + v  ", x + v),
        ("-x**2", -(x**2)),
        ("2**-1*x", x / 2),
        ("x - v - c", x - v - c),
        ("x/v/c", x / (v * c)),
        ("0.1 + 0.2", sp.Rational(3, 10)),
        ("c*x\n\t+ v\r\n", c * x + v),
        ("x + 0.0e-5*v + 0x0*v + 00*v + .0e9*c", x),
        ("x**0.5", sp.sqrt(x)),
        ("abs(x)", sp.Abs(x)),
        ("sin(pi*x)", sp.sin(sp.pi * x)),
        ("exp(-x**2/2)", sp.exp(-(x**2) / 2)),
        ("atan2(x, v)", sp.atan2(x, v)),
        ("x + 0**2", x),
    ],
)  # fmt: skip
def test_a_formula_means_what_it_says(formula, expected):
    assert sp.simplify(read(formula) - expected) == 0


@pytest.mark.parametrize(
    ("formula", "cure"),
    [
        ("c*х", "write x of"),  # Cyrillic
        ("x − v", "write - of"),
        ("2·x", "write * of"),
        ("2×x", "write * of"),
        ("x²", "write **2"),
        ("x^2", "write ** for a power"),
        ("2x + v", "a product needs *, as in 2*x"),
        ("k*x", "unknown symbol 'k'; known here: c, f, pi, v, w, x"),
    ],
)
def test_what_is_typed_by_habit_is_told_how_to_write(formula, cure):
    with pytest.raises(FormulaError, match=re.escape(cure)):
        read(formula)


def test_a_message_shows_no_control_characters():
    with pytest.raises(FormulaError) as caught:
        read("x + \x1b[31m\x07\0v")
    assert caught.value.column == 4
    assert all(character.isprintable() or character == "\n" for character in str(caught.value))
    with pytest.raises(FormulaError) as caught:
        read("x + " + chr(0xDC80))  # half of a pair
    assert str(caught.value).encode("utf-8")


HOSTILE = [
    # formula, column of the pointer
    ("__import__('os').system('true')", 0),
    ("x + open('secret')", 4),
    ("c*x.real", 2),
    ("x + (lambda: v)()", 4),
    ("[x for x in (1, 2)]", 0),
    ("x + 'v'", 4),
    ("x + f'{v}'", 4),
    ("x + True", 4),
    ("x if v else c", 5),
    ("x < v", 0),
    ("x^2", 1),
    ("x v", 2),
    ("c*x + v)", 7),
    ("x + q*v", 4),
    ("ξ + x", 0),
    ("x + sin", 4),
    ("x + sin(x, v)", 4),
    ("x + sin(*x)", 8),
    ("x + 1e400", 4),
    ("x # + v", 2),
    ("1if x < v else c", 0),
    ("c*ｘ", 2),
    ("x + ſin(v)", 4),
    ("x**v", 3),
    ("2**x", 3),
    ("x**17", 3),
    ("x**(10**9)", 4),
    ("x + atan2(x, v, v)", 4),
    ("atan2(x, v=1)", 0),
    ("atan2(x, 10**3)", 0),
]


@pytest.mark.parametrize(("formula", "column"), HOSTILE)
def test_what_is_not_a_formula_is_refused_with_a_pointer_to_the_place(formula, column):
    with pytest.raises(FormulaError) as caught:
        read(formula)
    message = str(caught.value).split("\n")
    assert message[0].strip()
    assert message[1] == "    " + formula
    assert message[2] == "    " + " " * column + "^"
    assert (caught.value.formula, caught.value.column) == (formula, column)


NO_VALUE = [
    "1/0",
    "x/0",
    "x/(v - v)",
    "0**-1",
    "sqrt(-1)*x",
    "log(0)",
    "x*log(-1)",
    "sqrt(-4*x**2)",
    "x*(-8)**(1/3)",
    "x*(-1)**0.5",
    "atan2(0, 0)",
    "x + (x**16)**16",
]
NO_END = ["x + " * 3000 + "x", "(" * 300 + "x" + ")" * 300]
NO_FORMULA = [None, 3, ["x"], b"x", sp.Symbol("x"), "", "   ", "\n", "x + ", "*x", "\0", "x + \0"]


@pytest.mark.parametrize("formula", NO_VALUE + NO_END + NO_FORMULA)
def test_what_has_no_real_value_or_no_end_is_refused(formula):
    with pytest.raises(FormulaError):
        read(formula)


@pytest.mark.parametrize(
    ("fits", "too_much", "message"),
    [
        (" " * 1999 + "x", " " * 2000 + "x", "at most 2000 characters"),
        ("x**16", "x**17", "at most 16"),
        ("(x**8)**3", "(x**5)**5", "above degree 24"),
        ("x**8*v**16", "x**9*v**16", "above degree 24"),
        ("(10**15)**2*x", "(10**16)**2*x", "too large or too small"),
        ("(1/10**15)**2*x", "(1/10**16)**2*x", "too large or too small"),
        ("sin(" * 5 + "x" + ")" * 5, "sin(" * 6 + "x" + ")" * 6, "more than 5 deep"),
        ("atan2(x, " * 5 + "x" + ")" * 5, "atan2(x, " * 6 + "x" + ")" * 6, "more than 5 deep"),
        ("exp(499)*x", "exp(500)*x", "argument of exp is too large"),
        ("1e99*x", "1e100*x", "number is too large or too small"),
        ("1e-99*x", "1e-400*x", "number is too large or too small"),
        ("sin(x)", "sin(x, v)", "sin takes 1 argument"),
        ("atan2(x, v)", "atan2(x)", "atan2 takes 2 arguments"),
    ],
)
def test_a_limit_is_where_the_message_says(fits, too_much, message):
    read(fits)
    with pytest.raises(FormulaError, match=message):
        read(too_much)


def test_a_long_formula_is_cut_in_the_message():
    with pytest.raises(FormulaError) as caught:
        read("x + " * 100 + "?")
    assert all(len(line) <= 104 for line in str(caught.value).split("\n"))


BOMBS = [
    "9**9**9",
    "((10**16)**16)**16",
    "((((10**15)**16+1)*0+10)**15)**16",
    "(((x+1)**16)**16)**16",
    "(" * 9 + "2*x" + ")**16" * 9,
    "exp(exp(exp(exp(9))))",
    "log(" * 20 + "2" + ")" * 20,
    "log(" * 30 + "0.3" + ")" * 30,
    "tanh(" * 90 + "2" + ")" * 90,
    "tan(" * 90 + "2" + ")" * 90,
    "sqrt(" * 90 + "x" + ")" * 90,
    "sin(" * 90 + "x" + ")" * 90,
    "(1e99*x)**16",
    "1e999999999*x",
    "1e-999999999*x",
    "0e999999999 + x",
    "((1e99*x)**8)**8",
    "(499.123456789012345678)**15.999",
    "(2**0.9999999999)**15.99999",
    "sin(10**15*10**15)",
    "cos(pi/65537)",
    "1/(sqrt(2)+sqrt(3)+sqrt(5)+sqrt(7)+sqrt(11))",
    "*".join(f"(x+{i})" for i in range(60)),
    "(" * 90 + "x" + ")" * 90,
    "-" * 1900 + "x",
    "x+" * 999 + "x",
    "x*" * 999 + "x",
    "(" * 1000 + "x" + ")" * 1000,
    "x" * 10_000,
]

TIMER = """
import json, sys, time
from kfcourse.symbolic.formula import FormulaError, parse, symbol
for formula in json.load(sys.stdin):
    start = time.perf_counter()
    try:
        parse(formula, {"x": symbol("x")})
    except FormulaError:
        pass
    print(time.perf_counter() - start, flush=True)
"""


def test_no_formula_takes_a_second_to_read_or_refuse():
    # In a process of its own, so that a formula that never ends is a failure, not a hanging test.
    try:
        done = subprocess.run(
            [sys.executable, "-c", TIMER],
            input=json.dumps(BOMBS),
            capture_output=True,
            text=True,
            timeout=20,
        )
        output, error = done.stdout, done.stderr
    except subprocess.TimeoutExpired as expired:
        output, error = (expired.stdout or b"").decode(), "timeout"
    times = [float(line) for line in output.split()]
    assert len(times) == len(BOMBS), f"{BOMBS[len(times)][:60]!r} is not done ({error[-300:]})"
    slow = [formula[:60] for formula, seconds in zip(BOMBS, times, strict=True) if seconds > 1]
    assert not slow


@pytest.mark.parametrize("name", ["x", "x1", "alpha_2", "E", "I", "S", "N", "Q"])
def test_an_ordinary_word_names_a_symbol(name):
    assert check_name(name) == name
    assert parse(f"2*{name}", {name: symbol(name)}) == 2 * symbol(name)


@pytest.mark.parametrize(
    "name",
    [
        "",
        "1x",
        "_x",
        "x y",
        "x-y",
        "lambda",
        "if",
        "None",
        "sin",
        "pi",
        "ξ",
        "x" * 40,
        "__class__",
        "x\n",
        3,
        None,
    ],
)
def test_other_words_do_not(name):
    with pytest.raises(ValueError, match=r"cannot name|already means"):
        check_name(name)
