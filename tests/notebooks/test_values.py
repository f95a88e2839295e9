"""Values come over as they were; nothing else is read, and nothing runs when it is."""

import base64
import io
import json
import struct

import numpy as np
import pytest
import sympy as sp

from kfcourse.checks import Exercise, exercise, sets
from kfcourse.notebooks.grading.asking import salted, steady
from kfcourse.notebooks.grading.channel import Channel, Closed
from kfcourse.notebooks.grading.values import Other, ProtocolError, decode, encode

x, y = sp.Symbol("x", positive=True), sp.Symbol("y", real=True)


def sent(value):
    return decode(json.loads(json.dumps(encode(value))))


@pytest.mark.quick
@pytest.mark.parametrize(
    "value",
    [
        None,
        True,
        "text",
        7,
        -(10**50),
        0.1,
        float("inf"),
        2 - 3j,
        [1, (2.0, [None])],
        (),
        sp.Integer(1),
        sp.Float(1),
        sp.oo,
        sp.pi,
    ],
)
def test_plain_values(value):
    found = sent(value)
    assert (found, type(found)) == (value, type(value))


@pytest.mark.parametrize("kind", ["?", "i1", "<u2", ">i8", "f2", "f4", "f8", "c8", "c16"])
@pytest.mark.parametrize("shape", [(), (3,), (2, 0), (2, 3, 4)])
def test_arrays(kind, shape):
    array = np.random.default_rng(1).normal(size=shape).astype(kind)
    found = sent(array)
    assert found.shape == shape and found.dtype == array.dtype.newbyteorder("=")
    np.testing.assert_array_equal(found, array)
    assert found.flags.writeable
    if shape == ():
        assert type(sent(array[()])) is type(array[()])
    assert (
        sent(array[..., ::-1] if shape else array).tobytes()
        == np.ascontiguousarray(array[..., ::-1] if shape else array)
        .astype(array.dtype.newbyteorder("="))
        .tobytes()
    )


@pytest.mark.parametrize(
    "value",
    [
        sp.Float("0.9") * x + sp.sqrt(x) / 3 - sp.Rational(10**30, 7),
        sp.exp(x) * sp.erf(y) + sp.atan2(x, y) + sp.Max(x, y) + sp.Abs(y),
        sp.Integral(x**2, (x, 0, y)) + sp.Derivative(sp.sin(x) * y, x),
        sp.Piecewise((x, x > y), (y, True)),
        sp.I * x + sp.E**y + sp.Symbol("x"),
        sp.Float("0.1", 50) * x,
        sp.Heaviside(x) * sp.KroneckerDelta(1, sp.Symbol("n", integer=True)),
    ],
)
def test_formulas(value):
    assert sp.srepr(sent(value)) == sp.srepr(value)


@pytest.mark.parametrize(
    ("value", "name"),
    [
        ({1: 2}, "dict"),
        ({1}, "set"),
        (len, "builtin_function_or_method"),
        (object(), "object"),
    ],
)
def test_anything_else_is_its_type_only(value, name):
    found = sent(value)
    assert isinstance(found, Other)
    assert type(found).__name__ == name


def test_functions_are_called_on_the_other_side():
    functions = []
    data = encode([len], lambda function: functions.append(function) or 0)
    assert functions == [len]
    assert decode(data, lambda number: functions[number]) == [len]
    with pytest.raises(ProtocolError):
        decode(data)


def formula(text):
    return ["formula", text]


STRANGE = [
    {},
    [],
    ["list"],
    ["list", 3],
    ["array", "AAAA"],
    ["array", "???"],
    ["int", "1" * 5000 + "g"],
    ["int", "__"],
    ["complex", "1", 2],
    ["formulas", 2, 2, []],
    ["function", 0],
    ["objects", [2], [1]],
    ["exec", "1"],
    [["list"]],
    *map(
        formula,
        (
            "",
            "x",
            "1",
            "Lambda(Symbol('x'), Symbol('x'))",
            "__import__('os')",
            "Function('f')(Symbol('x'))",
            "sympify('1')",
            "Symbol('x').free_symbols",
            "Symbol('x', real=open('f'))",
            "Symbol(Symbol)",
            "Integer(1 << 99)",
            "S.One",
            "Float('1', precision=open('f'))",
            "Add(*[1])",
            "Add(Symbol('x'), evaluate=False)",
            "(lambda: 1)()",
            "-pi",
            "f'{1}'",
            "Add(" * 300 + "pi" + ")" * 300,
            "Symbol('x')if 1 else pi",
            "[pi for x in (1,)]",
        ),
    ),
]


def test_an_array_of_objects_is_not_unpickled():
    data = io.BytesIO()
    np.save(data, np.array([{}], dtype=object), allow_pickle=True)
    for array in (data.getvalue(), b"\x80\x04N."):
        with pytest.raises(ProtocolError, match="pickle"):
            decode(["array", base64.b64encode(array).decode()])
    structured = io.BytesIO()
    np.save(structured, np.zeros(1, "f8,f8"))
    with pytest.raises(ProtocolError, match="an array of"):
        decode(["array", base64.b64encode(structured.getvalue()).decode()])


@pytest.mark.quick
@pytest.mark.parametrize("data", STRANGE, ids=lambda data: str(data)[:40])
def test_strange_messages_are_refused(data):
    with pytest.raises(ProtocolError):
        decode(data)


def test_arguments_of_all_questions_can_be_sent():
    for letter, one in sets().items():
        task = Exercise(letter, exercise(letter, "53").variant, "salt")
        for question in one.questions:
            for values in question.arguments(task):
                functions = [value for value in values if callable(value)]
                data = encode(tuple(values), functions.index)
                found = decode(json.loads(json.dumps(data)), functions.__getitem__)
                assert not [value for value in found if isinstance(value, Other)], question.name
                assert [type(a) for a in found] == [type(b) for b in values], question.name


def test_the_grader_asks_with_numbers_of_its_own():
    """Every question that has numbers or functions among its arguments; formulas in fixed symbols
    hide nothing."""
    asked = 0
    for letter, one in sets().items():
        task = exercise(letter, "53")
        salted = Exercise(letter, task.variant, "salt")
        for question in one.questions:
            seen, hidden = (
                json.dumps([encode(tuple(values)) for values in question.arguments(each)])
                for each in (task, salted)
            )
            if any(word in seen for word in ("array", "function", ".")):
                asked += 1
                assert seen != hidden or "function" in seen, question.name
    assert asked > 40


def test_the_grader_asks_nothing_that_rounding_decides():
    """An information matrix with a condition of 1e8: a right answer that rounds in another order is
    off by 1e-8."""
    bad = Exercise("g", exercise("g", "20").variant, "salt1")
    question = bad.questions["g7"]
    W, H, D_n = question.arguments(bad)[0]
    total = W + np.swapaxes(H, -1, -2) @ np.linalg.solve(D_n, H)
    assert np.linalg.cond(total).max() > 1e7
    assert not steady(question, bad)
    asked = salted("g", '"20"', "g7", "salt")
    assert asked.salt.startswith("salt/") and steady(question, asked)
    assert salted("g", '"20"', "g7", "salt") is asked  # the same for all notebooks of a run


def test_all_questions_can_be_asked_with_the_first_arguments_that_are_good():
    for letter, one in sets().items():
        for question in one.questions:
            assert salted(letter, '"53"', question.name, "salt").salt.startswith("salt/"), (
                question.name
            )


# -- messages


def channel(data):
    return Channel(io.BytesIO(data), io.BytesIO())


def frame(text):
    return struct.pack(">Q", len(text)) + text


def test_messages():
    assert channel(frame(b'{"a": 1}')).receive() == {"a": 1}
    for data in (b"", b"\0\0", frame(b'{"a": 1}')[:-1]):
        with pytest.raises(Closed):
            channel(data).receive()
    for data in (
        struct.pack(">Q", 2**40),
        frame(b"[1]"),
        frame(b"{"),
        frame(b"[" * 100_000),
        frame(b"\xff"),
    ):
        with pytest.raises(ProtocolError):
            channel(data).receive()
    sink = io.BytesIO()
    Channel(io.BytesIO(), sink).send({"b": [1.5]})
    assert channel(sink.getvalue()).receive() == {"b": [1.5]}
