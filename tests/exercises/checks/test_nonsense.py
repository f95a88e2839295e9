"""Nothing that a student hands in stops a check, and what comes of nonsense is a sentence that
helps."""

import math
from itertools import product

import numpy as np
import pytest
import sympy as sp
from tiny import asks, outcome, p, raises, z
from weekly import weekly

from kfcourse.exercises.checks import engine
from kfcourse.exercises.checks.question import Mistake


class Evil:
    """Fails at whatever is done to it."""

    def __array__(self, *_, **__):
        raise KeyError("array")

    def __iter__(self):
        raise ZeroDivisionError("iter")

    def __len__(self):
        raise OSError("len")

    def __str__(self):
        raise RuntimeError("str")

    __repr__ = __str__


class EvilError(Exception):
    def __str__(self):
        raise RuntimeError("str")


def recursion(*_):
    return recursion(*_)


def deep(first, *_):
    for _ in range(400):
        first = sp.sin(first, evaluate=False) + 1
    return first


def generator(*_):
    yield 1


def ruins_its_arguments(*arguments):
    for argument in arguments:
        if isinstance(argument, np.ndarray):
            argument[...] = np.nan
    return arguments[0]


u, q, A = sp.Function("u"), sp.Symbol("q", commutative=False), sp.MatrixSymbol("A", 2, 2)
RETURNED = [
    *("z", None, True, [], [[1], [1, 2]], 10**400, 1j, {"z": 1}, lambda: 1, int),
    *(np.array([None, "a"], dtype=object), np.array(["a"])),
    *(np.array(["2020-01-01"], "datetime64[D]"), np.zeros((3, 4, 5)), Evil(), (Evil(), Evil())),
    *((sp.I, sp.I), (z > 1, z > 1), (u(z), z), (A, A), (sp.Lambda(z, z), z), (q, z), (sp.O(z), z)),
    *((sp.exp(sp.exp(sp.exp(1000 * z))), z), (z ** (10**9), (z**999 + 1) ** 999)),
    sp.Matrix([[z, z, z]]),
]
NOT_FINITE = [math.nan, math.inf, sp.nan, (sp.oo, sp.zoo)]
CALLED = {
    "no arguments": lambda: 1,
    "too many": lambda a, b, c, d, e, f, g, h: a,
    "class": int,
    "generator": generator,
    "recursion": recursion,
    "deep": deep,
    "ruins its arguments": ruins_its_arguments,
    "allocates": lambda *_: np.zeros(10**14),
    "math": lambda first, *_: math.sin(first),
    "index": lambda *arguments: arguments[9],
    "attribute": lambda first, *_: first.nothing,
} | {
    f"raises {type(error).__name__}": raises(error)
    for error in (
        *(SystemExit(1), GeneratorExit(), StopIteration(), MemoryError(), EvilError()),
        ValueError("two\nlines"),
    )
}
CALLED |= {
    f"returns {number}": lambda *_, value=value: value
    for number, value in enumerate([*RETURNED, *NOT_FINITE])
}

VECTOR, MATRIX = sp.ImmutableMatrix([z, p]), sp.ImmutableMatrix([[p, z], [z, p + 1]])
RNG = np.random.default_rng(5)
RUN = RNG.normal(size=(4, 3, 2))


def filtered(y, mean, measure, predict):
    """A question as that of a whole run: an array, of arrays and of functions."""
    return np.array([predict(mean + 0.5 * (measured - measure(mean))) for measured in y])


# A question of each kind, one with a known mistake: formulas, matrices of formulas, an array with two
# hidden inputs.
KINDS = {
    "formulas": asks(
        lambda z, p: (sp.sin(z), z**2 * p + 1),
        [(z, p)],
        [Mistake("noise-forgotten", "the noise is missing", lambda z, p: (sp.sin(z), z**2 * p))],
        ("tau", "Theta"),
    ),
    "matrices": asks(
        lambda z, p: (2 * z, 4 * p),
        [(VECTOR, MATRIX)],
        parts=("tau", "Theta"),
    ),
    "array": asks(
        filtered,
        [(values, np.ones(2), lambda x: 2 * x, lambda x: x + 1) for values in (RUN, RUN[::-1])],
    ),
}


def judged(question, answer):
    return outcome(question, answer, seconds=5.0)


@pytest.mark.parametrize("value", [None, 3, "z", np.ones(3), z, Evil()], ids=type)
def test_what_is_no_function_is_told(value):
    result = judged(KINDS["formulas"], value)
    assert result.status == "unusable"
    assert result.message.startswith("expected a function, got ")


@pytest.mark.parametrize(("kind", "name"), weekly(product(KINDS, CALLED)))
@pytest.mark.filterwarnings("ignore::sympy.utilities.exceptions.SymPyDeprecationWarning")
def test_nonsense_never_stops_a_check(kind, name, monkeypatch):
    monkeypatch.setattr(engine, "DIAGNOSIS", 5.0)
    result = judged(KINDS[kind], CALLED[name])
    assert result.status in ("wrong", "unusable")
    assert 10 < len(result.message) < 1500
    assert "\n" not in result.message


@pytest.mark.parametrize(
    ("kind", "answer", "words"),
    [
        *(
            ("formulas", lambda z, p, v=v: v if isinstance(v, tuple) else (v, v), "NaN or infinity")
            for v in NOT_FINITE
        ),
        ("array", lambda y, *_: math.nan * y, "NaN or infinity"),
        ("formulas", lambda z, p: None, "is `return` missing"),
        ("formulas", lambda z, p: z, "expected 2 results"),
        ("formulas", lambda z, p: (z, "p"), "result 2 of 2"),
        ("matrices", lambda z, p: (z.T, p), "2 rows and 1 columns"),
        ("array", lambda *_: np.zeros(3), "(4, 3, 2)"),
        ("formulas", lambda z, p: (math.sin(z), p), "sp.sin"),
        ("formulas", lambda z, p: (np.sin(z), p), "sp.sin"),
        ("formulas", lambda z, p: (1 / 0, p), "ZeroDivisionError: division by zero, in line"),
    ],
)
def test_messages_help(kind, answer, words):
    assert words in judged(KINDS[kind], answer).message
