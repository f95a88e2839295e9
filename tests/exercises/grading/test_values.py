"""Values come over as they were; nothing else is read, and nothing runs when it is."""

import base64
import io
import json

import numpy as np
import pytest
import sympy as sp

from kfcourse.exercises.checks import Exercise, exercise, sets
from kfcourse.exercises.grading.asking import salted, steady
from kfcourse.exercises.grading.channel import Channel, Closed
from kfcourse.exercises.grading.values import LARGEST, Other, ProtocolError, decode, encode

x, y = sp.Symbol("x", positive=True), sp.Symbol("y", real=True)


def sent(value):
    return decode(json.loads(json.dumps(encode(value))))


@pytest.mark.parametrize(
    "value",
    [
        *(
            None,
            True,
            "text",
            7,
            -(10**50),
            0.1,
            float("inf"),
            np.complex128(2 - 3j),
            [1, (2.0, [None])],
            (),
        ),
        *(sp.Integer(1), sp.Float(1), sp.oo, sp.pi),
        sp.Float("0.9") * x + sp.sqrt(x) / 3 - sp.Rational(10**30, 7),
        sp.exp(x) * sp.erf(y) + sp.atan2(x, y) + sp.Max(x, y) + sp.Abs(y),
        sp.Integral(x**2, (x, 0, y)) + sp.Derivative(sp.sin(x) * y, x),
        sp.Piecewise((x, x > y), (y, True)),
        sp.I * x + sp.E**y + sp.Symbol("x"),
        sp.Float("0.1", 50) * x,
        sp.Heaviside(x) * sp.KroneckerDelta(1, sp.Symbol("n", integer=True)),
    ],
)
def test_values_and_formulas(value):
    received = sent(value)
    assert (received, type(received)) == (value, type(value))
    assert sp.srepr(received) == sp.srepr(value)


@pytest.mark.parametrize("kind", ["?", "i1", "<u2", ">i8", "f2", "f4", "f8", "c8", "c16"])
@pytest.mark.parametrize("shape", [(), (3,), (2, 0), (2, 3, 4)])
def test_arrays(kind, shape):
    array = np.random.default_rng(1).normal(size=shape).astype(kind)
    if shape == ():
        assert type(sent(array[()])) is type(array[()])
    for value in (array, array[::-1] if shape else array):
        received = sent(value)
        assert received.shape == shape and received.dtype == array.dtype.newbyteorder("=")
        np.testing.assert_array_equal(received, value)
        assert received.flags.writeable


@pytest.mark.parametrize("value", [{1: 2}, {1}, len, object()])
def test_anything_else_is_its_type_only(value):
    received = sent(value)
    assert isinstance(received, Other)
    assert type(received).__name__ == type(value).__name__


def test_functions_are_called_on_the_other_side():
    functions = []
    data = encode([len], lambda function: functions.append(function) or 0)
    assert functions == [len]
    assert decode(data, lambda number: functions[number]) == [len]
    with pytest.raises(ProtocolError):
        decode(data)


def saved(array):
    data = io.BytesIO()
    np.save(data, array, allow_pickle=True)
    return data.getvalue()


FORMULAS = (
    *("", "x", "1", "-pi", "f'{1}'", "S.One", "(lambda: 1)()", "[pi for x in (1,)]"),
    *("Lambda(Symbol('x'), Symbol('x'))", "__import__('os')", "Function('f')(Symbol('x'))"),
    *("sympify('1')", "Symbol('x').free_symbols", "Symbol('x', real=open('f'))", "Symbol(Symbol)"),
    *("Integer(1 << 99)", "Float('1', precision=open('f'))", "Add(*[1])"),
    *(
        "Add(Symbol('x'), evaluate=False)",
        "Add(" * 300 + "pi" + ")" * 300,
        "Symbol('x')if 1 else pi",
    ),
)
ARRAYS = (saved(np.array([{}], dtype=object)), b"\x80\x04N.", saved(np.zeros(1, "f8,f8")))
STRANGE = [
    *({}, [], ["list"], ["list", 3], [["list"]], ["array", "AAAA"], ["array", "???"]),
    *(["formulas", 2, 2, []], ["function", 0], ["exec", "1"]),
    *(["formula", text] for text in FORMULAS),
    # objects are not unpickled
    *(["array", base64.b64encode(data).decode()] for data in ARRAYS),
]


@pytest.mark.parametrize("data", STRANGE, ids=lambda data: str(data)[:40])
def test_strange_messages_are_refused(data):
    with pytest.raises(ProtocolError):
        decode(data)


@pytest.mark.parametrize("letter", sets())
def test_every_question_can_be_asked_with_numbers_of_the_graders_own(letter):
    """Arguments come over as they are.  Formulas in fixed symbols hide nothing."""
    own = exercise(letter, "53")
    hidden = Exercise(letter, own.variant, "salt")
    for question in own.questions.values():
        texts = []
        for task in (own, hidden):
            data = []
            for values in question.arguments(task):
                functions = [value for value in values if callable(value)]
                data.append(json.dumps(encode(tuple(values), functions.index)))
                received = decode(json.loads(data[-1]), functions.__getitem__)
                assert [type(a) for a in received] == [type(b) for b in values], question.name
            texts.append(" ".join(data))
        numbers = "array" in texts[0] or "." in texts[0]
        assert texts[0] != texts[1] or "function" in texts[0] or not numbers, question.name
        # the first arguments that are good
        asked = salted(letter, '"53"', question.name, "salt")
        assert asked.salt.startswith("salt/"), question.name


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
    assert steady(question, asked)
    assert salted("g", '"20"', "g7", "salt") is asked  # the same for all notebooks of a run


# -- messages


def channel(data):
    return Channel(io.BytesIO(data), io.BytesIO())


def test_messages():
    assert channel(b'{"a": 1}\n').receive() == {"a": 1}
    for error, messages in (
        (Closed, (b"", b'{"a": 1}')),
        (ProtocolError, (b"[1]\n", b"{\n", b"[" * 10**5 + b"\n", b"\xff\n", b"1" * (LARGEST + 1))),
    ):
        for data in messages:
            with pytest.raises(error):
                channel(data).receive()
    sink = io.BytesIO()
    Channel(io.BytesIO(), sink).send({"b": [1.5]})
    assert channel(sink.getvalue()).receive() == {"b": [1.5]}
