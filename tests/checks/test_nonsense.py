"""Nothing that a student hands in stops a check, and what comes of nonsense is a sentence that
helps."""

import datetime
import math

import numpy as np
import pytest
import sympy as sp
from tiny import asks, outcome, p, raises, z

from kfcourse.checks.question import catalogue


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


NOT_FUNCTIONS = {
    "None": None,
    "number": 3,
    "text": "z",
    "array": np.ones(3),
    "formula": z,
    "object": Evil(),
}
RETURNED = {
    "text": "z",
    "nothing": None,
    "nan": math.nan,
    "inf": math.inf,
    "complex": 1j,
    "true": True,
    "list": [1, 2],
    "empty": [],
    "ragged": [[1], [1, 2]],
    "objects": np.array([None, "a"], dtype=object),
    "strings": np.array(["a"]),
    "dates": np.array(["2020-01-01"], "datetime64[D]"),
    "booleans": np.array([True, False]),
    "shape": np.zeros((3, 4, 5)),
    "huge": 10**400,
    "set": {1, 2},
    "dict": {"z": 1},
    "function": lambda: 1,
    "class": int,
    "object": Evil(),
    "pair": (Evil(), Evil()),
    "sympy nan": sp.nan,
    "sympy inf": (sp.oo, sp.zoo),
    "imaginary": (sp.I, sp.I),
    "relation": (z > 1, z > 1),
    "unknown function": (sp.Function("u")(z), z),
    "matrix symbol": (sp.MatrixSymbol("A", 2, 2), sp.MatrixSymbol("A", 2, 2)),
    "lambda": (sp.Lambda(z, z), z),
    "not commuting": (sp.Symbol("q", commutative=False), z),
    "tower": (sp.exp(sp.exp(sp.exp(1000 * z))), z),
    "power": (z ** (10**9), (z**999 + 1) ** 999),
    "order": (sp.O(z), z),
    "matrix": sp.Matrix([[z, z, z]]),
}
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
    "exits": raises(SystemExit(1)),
    "closes": raises(GeneratorExit()),
    "stops": raises(StopIteration()),
    "memory": raises(MemoryError()),
    "own": raises(EvilError()),
    "lines": raises(ValueError("one\ntwo")),
} | {f"returns {name}": lambda *_, value=value: value for name, value in RETURNED.items()}

VECTOR, MATRIX = sp.ImmutableMatrix([z, p]), sp.ImmutableMatrix([[p, z], [z, p + 1]])
RNG = np.random.default_rng(5)
RUN = RNG.normal(size=(4, 3, 2))


def filtered(y, mean, measure, predict):
    """A question as that of a whole run: an array, of arrays and of functions."""
    return np.array([predict(mean + 0.5 * (one - measure(mean))) for one in y])


# A question of each kind, with a known mistake: formulas, matrices of formulas, an array with two
# hidden inputs, several arrays.
KINDS = {
    "formulas": asks(
        lambda z, p: (sp.sin(z), z**2 * p + 1),
        [(z, p)],
        catalogue(
            [("noise-forgotten", "the noise is missing", lambda z, p: (sp.sin(z), z**2 * p))]
        ),
        ("tau", "Theta"),
    ),
    "matrices": asks(
        lambda z, p: (2 * z, 4 * p),
        [(VECTOR, MATRIX)],
        catalogue([("once", "a factor enters once", lambda z, p: (2 * z, 2 * p))]),
        ("tau", "Theta"),
    ),
    "array": asks(
        filtered,
        [(values, np.ones(2), lambda x: 2 * x, lambda x: x + 1) for values in (RUN, RUN[::-1])],
        catalogue(
            [
                (
                    "not-predicted",
                    "not predicted",
                    lambda y, mean, measure, predict: filtered(y, mean, measure, lambda x: x),
                )
            ]
        ),
    ),
    "arrays": asks(
        lambda x, z: (((x - z) ** 2).mean(axis=1), (x - z).std(axis=1)),
        [(RNG.normal(size=(5, 8)), RNG.normal(size=(5, 8)))],
        catalogue(
            [
                (
                    "absolute",
                    "absolute values",
                    lambda x, z: (np.abs(x - z).mean(axis=1), (x - z).std(axis=1)),
                )
            ]
        ),
        ("value", "error"),
    ),
}


def judged(question, answer):
    return outcome(question, answer, seconds=5.0)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", NOT_FUNCTIONS)
def test_what_is_no_function_is_told(kind, name):
    result = judged(KINDS[kind], NOT_FUNCTIONS[name])
    assert result.status == "unusable"
    assert result.message.startswith("expected a function, got ")


# Each in one kind of question, in another one every week; in all of them every night.
WEEK = datetime.date.today().toordinal() // 7
CASES = [
    pytest.param(
        kind,
        name,
        id=f"{name}-{kind}",
        marks=[] if (WEEK + number - place) % len(KINDS) == 0 else pytest.mark.slow,
    )
    for number, name in enumerate(CALLED)
    for place, kind in enumerate(KINDS)
]


@pytest.mark.parametrize(("kind", "name"), CASES)
@pytest.mark.filterwarnings("ignore::sympy.utilities.exceptions.SymPyDeprecationWarning")
def test_nonsense_never_stops_a_check(kind, name):
    result = judged(KINDS[kind], CALLED[name])
    assert result.status in ("wrong", "unusable")
    assert 10 < len(result.message) < 1500
    assert "\n" not in result.message


@pytest.mark.parametrize("name", ["nan", "sympy nan", "sympy inf", "inf"])
def test_what_is_not_finite_is_told(name):
    value = RETURNED[name]
    value = value if isinstance(value, tuple) else (value, value)
    assert "NaN or infinity" in judged(KINDS["formulas"], lambda z, p: value).message
    arrays = lambda x, z: (np.full(len(x), math.nan),) * 2  # noqa: E731
    assert "NaN or infinity" in judged(KINDS["arrays"], arrays).message


def test_messages_help():
    assert "is `return` missing" in judged(KINDS["formulas"], lambda z, p: None).message
    assert "expected 2 results" in judged(KINDS["formulas"], lambda z, p: z).message
    assert "result 2 of 2" in judged(KINDS["formulas"], lambda z, p: (z, "p")).message
    assert "2 rows and 1 columns" in judged(KINDS["matrices"], lambda z, p: (z.T, p)).message
    assert "(4, 3, 2)" in judged(KINDS["array"], lambda *_: np.zeros(3)).message
    assert "sp.sin" in judged(KINDS["formulas"], lambda z, p: (math.sin(z), p)).message
    assert "sp.sin" in judged(KINDS["formulas"], lambda z, p: (np.sin(z), p)).message
    message = judged(KINDS["formulas"], lambda z, p: (1 / 0, p)).message
    assert "ZeroDivisionError" in message and "in line" in message
