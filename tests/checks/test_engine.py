"""Self-checks: right answers pass, wrong ones are told apart, and nothing that a student hands in stops a check."""

import ast
import math
import random
import signal
import threading
import time
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp

from kfcourse.checks import ExerciseError, engine, exercise, sets
from kfcourse.checks.engine import check
from kfcourse.checks.equality import Unusable, equal, equal_formulas, like
from kfcourse.checks.question import MIME, ForVariant, Mistake, Question, catalogue
from kfcourse.lab.variants import VariantError
from kfcourse.limits import OutOfTime, time_limit

VARIANTS = ("53", "7", "9", "12", "20", "21")
FIRST = "abcde"  # the sets for which wrong answers are typed by hand below
x, y, z, p, m, d = sp.symbols("x y z p m d", real=True)
c, e, g, f = sp.symbols("c e g f", real=True)


@cache
def opened(letter, variant):
    return exercise(letter, variant)


# -- the engine, with questions of its own


NOTHING = SimpleNamespace(model=SimpleNamespace(values={}))


def asks(right, arguments, mistakes=(), parts=(), **options):
    return Question("t1", "a test", "core", right, lambda _: arguments, tuple(mistakes), parts, **options)


SUM = asks(lambda a, b: a + 2 * b, [(np.array([1.0, 2.5]), np.array([-0.3, 4.0])), (np.array([0.7, -1.0]), np.array([3.0, 0.2]))])
FORMULA = asks(lambda a, b: a**2 + sp.sin(b), [(x, y)])


def outcome(question, answer, seconds=1.0, exercise=NOTHING):
    return check(question, exercise, answer, seconds)


def test_a_right_answer_passes_in_any_form():
    assert outcome(SUM, lambda a, b: a + b + b).passed
    assert outcome(SUM, lambda a, b: [float(u + 2 * v) for u, v in zip(a, b, strict=True)]).passed  # a list of numbers
    assert outcome(SUM, lambda a, b: (a + 2 * b).astype(object)).passed
    assert outcome(FORMULA, lambda a, b: (a + 1) ** 2 - 2 * a - 1 + sp.sin(b)).passed
    assert outcome(FORMULA, lambda a, b: a**2 + sp.sqrt(1 - sp.cos(b) ** 2) * sp.sign(sp.sin(b))).passed
    assert outcome(FORMULA, lambda a, b: sp.Matrix([a**2 + sp.sin(b)])).passed  # one by one
    assert outcome(FORMULA, lambda a, b: sp.Derivative(a**3 / 3, a) + sp.Integral(sp.cos(b), b)).passed


def test_a_wrong_answer_does_not_pass_by_little():
    assert outcome(SUM, lambda a, b: a + 2 * b + 1e-7).status == "wrong"
    assert outcome(FORMULA, lambda a, b: a**2 + sp.sin(b) + sp.Rational(1, 10**25)).status == "wrong"


@pytest.mark.parametrize(
    "wrong",
    [
        lambda a, b: sp.Abs(a) ** 3 + sp.Abs(b),
        lambda a, b: sp.sqrt(a**2) ** 3 + b,
        lambda a, b: a**3 + sp.Max(b, 0),
        lambda a, b: sp.Piecewise((a**3, a > 0), (0, True)) + b,
        lambda a, b: sp.sign(a) * a**3 + b,
    ],
)
def test_a_formula_must_hold_for_both_signs(wrong):
    assert outcome(asks(lambda a, b: a**3 + b, [(x, y)]), wrong).status == "wrong"


def test_parameters_have_the_sign_of_their_values():
    question, exercise = asks(lambda a: c * a, [(x,)]), SimpleNamespace(model=SimpleNamespace(values={c: sp.Rational(-1, 2)}))
    assert check(question, exercise, lambda a: -sp.Abs(c) * a).passed
    assert check(question, exercise, lambda a: sp.Abs(c) * a).status == "wrong"
    assert check(question, exercise, lambda a: -a / 2).passed  # the value put in
    assert check(question, exercise, lambda a: -0.5 * a).passed
    assert check(question, exercise, lambda a: sp.symbols("c") * a).passed  # a symbol of the student's own, by its name


def test_variances_may_stand_under_roots():
    question = asks(lambda a, b: sp.sqrt(a * b), [(p, d)])
    assert outcome(question, lambda a, b: sp.sqrt(a) * sp.sqrt(b)).passed  # not equal where both are negative


def test_a_known_mistake_is_named_and_its_message_shown():
    mistakes = catalogue((("once", "b enters twice", lambda a, b: a + b), ("minus", "the sign of b", lambda a, b: a - 2 * b)))
    question = asks(SUM.key, SUM.arguments(None), mistakes)
    result = outcome(question, lambda a, b: b + a)
    assert (result.status, result.diagnosis) == ("wrong", ("once",))
    assert "b enters twice" in result.message
    assert outcome(question, lambda a, b: a - b - b).diagnosis == ("minus",)
    assert "does not look like" in outcome(question, lambda a, b: a * b).message


def test_parts_are_told_apart():
    mistakes = catalogue((("both", "squared", lambda a, b: (a**2, b**2)),))
    question = asks(lambda a, b: (a, b), SUM.arguments(None), mistakes, ("first", "second"))
    result = outcome(question, lambda a, b: (a, b**2))
    assert result.message == "first right, the rest not. second: squared"
    assert result.diagnosis == ("both",)
    assert outcome(question, lambda a, b: (a, -b)).diagnosis == ("sign",)
    assert outcome(question, lambda a, b: (a, b)).passed


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("sign", lambda a: -a),
        ("root", np.sqrt),
        ("square", lambda a: a**2),
        ("factor-2", lambda a: a / 2),
        ("factor-half", lambda a: 2 * a),
        ("inverse", lambda a: 1 / a),
    ],
)
def test_usual_changes_are_recognised(name, wrong):
    question = asks(lambda a: a, [(np.array([2.0, 3.5]),)])
    assert outcome(question, wrong).diagnosis == (name,)


def test_a_transposed_matrix_is_recognised():
    matrix = np.array([[1.0, 2.0], [3.0, 5.0]])
    assert outcome(asks(lambda a: a, [(matrix,)]), lambda a: a.T).diagnosis == ("transposed",)
    symbolic = sp.ImmutableMatrix([[x, y], [1, 2]])
    assert outcome(asks(lambda a: a, [(symbolic,)]), lambda a: a.T).diagnosis == ("transposed",)


def test_right_for_some_inputs_only():
    result = outcome(SUM, lambda a, b: a + 2 * b if a[0] == 1.0 else a)
    assert result.diagnosis == ("sometimes",)
    assert "1 of 2" in result.message


def test_a_mistake_that_the_variant_does_not_allow_is_left_out():
    def impossible(exercise):
        raise IndexError

    question = asks(SUM.key, SUM.arguments(None), [Mistake("no", "no", ForVariant(impossible))])
    assert outcome(question, lambda a, b: a - b).status == "wrong"


def test_result_shows_itself_and_carries_its_data():
    result = outcome(SUM, lambda a, b: a + 2 * b)
    assert repr(result) == "✓ t1 a test: right"
    data = result._repr_mimebundle_()
    assert data["text/plain"] == repr(result)
    assert data[MIME] == {"question": "t1", "status": "passed", "diagnosis": [], "message": "right"}
    assert repr(outcome(SUM, lambda a, b: a)).startswith("✗ t1")


def test_arguments_are_the_students_own_copies():
    def spoils(a, b):
        result = a + 2 * b
        a[:] = b[:] = math.nan
        return result

    question = asks(SUM.key, SUM.arguments(None))
    given = [(np.ones(2), np.ones(2))] * 2
    kept = Question("t1", "", "core", question.key, lambda _: given)
    assert outcome(kept, spoils).passed
    assert np.isfinite(given[0]).all()


# -- nonsense


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


def raises(error):
    def answer(*_):
        raise error

    return answer


def recursion(*_):
    return recursion(*_)


def endless(*_):
    while True:
        pass


def stubborn(*_):
    while True:
        try:
            sum([1, 2])
        except Exception:
            continue


def very_stubborn(*_):
    while True:
        try:
            sum([1, 2])
        except:  # noqa: E722
            continue


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


NOT_FUNCTIONS = {"None": None, "number": 3, "text": "z", "array": np.ones(3), "formula": z, "object": Evil()}
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

# A question of each kind: formulas, matrices of formulas, arrays with two hidden inputs, several arrays.
KINDS = [("a", "53", "a2"), ("a", "21", "a2"), ("b", "53", "b4"), ("e", "53", "e2")]


def judged(kind, answer, seconds=5.0):
    letter, variant, name = kind
    lab = opened(letter, variant)
    return check(lab.questions[name], lab, answer, seconds)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: f"{kind[1]}-{kind[2]}")
@pytest.mark.parametrize("name", NOT_FUNCTIONS)
def test_what_is_no_function_is_told(kind, name):
    result = judged(kind, NOT_FUNCTIONS[name])
    assert result.status == "unusable"
    assert result.message.startswith("expected a function, got ")


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: f"{kind[1]}-{kind[2]}")
@pytest.mark.parametrize("name", CALLED)
@pytest.mark.filterwarnings("ignore::sympy.utilities.exceptions.SymPyDeprecationWarning")
def test_nonsense_never_stops_a_check(kind, name):
    result = judged(kind, CALLED[name])
    assert result.status in ("wrong", "unusable")
    assert 10 < len(result.message) < 1500
    assert "\n" not in result.message


@pytest.mark.parametrize("name", ["nan", "sympy nan", "sympy inf", "inf"])
def test_what_is_not_finite_is_told(name):
    value = RETURNED[name]
    value = value if isinstance(value, tuple) else (value, value)
    assert "NaN or infinity" in judged(("a", "53", "a2"), lambda z, p: value).message
    arrays = lambda x, z: (np.full(len(x), math.nan),) * 2  # noqa: E731
    assert "NaN or infinity" in judged(("e", "53", "e2"), arrays).message


def test_messages_help():
    assert "is `return` missing" in judged(("a", "53", "a2"), lambda z, p: None).message
    assert "expected 2 results" in judged(("a", "53", "a2"), lambda z, p: z).message
    assert "result 2 of 2" in judged(("a", "53", "a2"), lambda z, p: (z, "p")).message
    assert "2 rows and 1 columns" in judged(("a", "21", "a2"), lambda z, p: (z.T, p)).message
    assert "(6, 6, 1)" in judged(("b", "53", "b4"), lambda *_: np.zeros(3)).message
    assert "sp.sin" in judged(("a", "53", "a2"), lambda z, p: (math.sin(z), p)).message
    assert "sp.sin" in judged(("a", "53", "a2"), lambda z, p: (np.sin(z), p)).message
    message = judged(("a", "53", "a2"), lambda z, p: (1 / 0, p)).message
    assert "ZeroDivisionError" in message and "in line" in message


@pytest.mark.parametrize("answer", [endless, stubborn, very_stubborn], ids=lambda answer: answer.__name__)
def test_endless_loops_end(answer):
    start = time.monotonic()
    result = outcome(SUM, answer, seconds=0.2)
    assert result.status == "unusable"
    assert "still running after 0.2 s" in result.message
    # The last one is stopped only where the alarm finds it outside of its try, by one alarm of some tens, 100 a second.
    assert time.monotonic() - start < 30
    assert signal.getitimer(signal.ITIMER_REAL) == (0, 0)


def test_comparing_is_limited_in_time_too(monkeypatch):
    monkeypatch.setattr(engine, "equal", lambda *_: endless())
    result = outcome(SUM, lambda a, b: a, seconds=0.2)
    assert (result.status, "simplify" in result.message) == ("unusable", True)


def test_a_long_search_for_the_mistake_still_says_wrong(monkeypatch):
    monkeypatch.setattr(engine, "DIAGNOSIS", 0.2)
    question = asks(SUM.key, SUM.arguments(None), [Mistake("slow", "", endless)])
    result = outcome(question, lambda a, b: a)
    assert (result.status, result.diagnosis) == ("wrong", ())


def test_time_limit_restores_the_alarm():
    before = signal.getsignal(signal.SIGALRM)
    with pytest.raises(OutOfTime), time_limit(0.05):
        endless()
    with time_limit(5.0):
        pass
    assert signal.getsignal(signal.SIGALRM) is before
    time.sleep(0.05)  # a left alarm would come now


def test_outside_the_main_thread_there_is_no_limit_but_a_result():
    found = []
    thread = threading.Thread(target=lambda: found.append(outcome(SUM, lambda a, b: a + 2 * b)))
    thread.start()
    thread.join()
    assert found[0].passed


def test_not_implemented_is_the_students_own_word():
    assert outcome(SUM, raises(NotImplementedError())).status == "not implemented"
    assert outcome(SUM, lambda *_: raises(NotImplementedError())()).status == "not implemented"  # of a helper of theirs
    result = outcome(FORMULA, lambda a, b: sp.Matrix(np.zeros((2, 2, 2))))  # raised by SymPy
    assert (result.status, "NotImplementedError" in result.message) == ("unusable", True)


def test_the_stop_button_works():
    with pytest.raises(KeyboardInterrupt):
        outcome(SUM, raises(KeyboardInterrupt()))


# -- comparison


def test_like_keeps_numbers_and_shapes():
    assert like([1, 2], np.zeros(2)).dtype == float
    assert like(3, np.asarray(0.0)).shape == ()
    with pytest.raises(Unusable, match=r"shape \(2,\).*got the shape \(3,\)"):
        like([1, 2, 3], np.zeros(2))
    assert like(0.9 * z, z) == sp.Rational(9, 10) * z  # a decimal means its digits
    assert like([[z], [1]], sp.Matrix([z, p])) == sp.Matrix([z, 1])
    assert like(5.0, z) == 5


def test_equal_allows_rounding_relative_to_the_largest_entry():
    right = np.array([1e6, 1.0, 1e-8])
    assert equal(right * (1 + 1e-12), right, 1e-9, {})
    assert not equal(right + np.array([0.0, 1e-2, 0.0]), right, 1e-9, {})  # ten times 1e-9 of the largest
    assert equal(np.array([math.nan, 1.0]), np.array([math.nan, 1.0]), 1e-9, {})
    assert not equal(np.array([1.0]), np.array([1.0, 1.0]), 1e-9, {})
    assert equal((z, np.ones(2)), (z, np.ones(2)), 1e-9, {})


def test_equal_formulas_by_value():
    assert equal_formulas([sp.cos(2 * z)], [1 - 2 * sp.sin(z) ** 2], {})
    assert not equal_formulas([sp.Symbol("other")], [z], {})
    assert not equal_formulas([sp.Function("u")(z)], [z], {})
    assert equal_formulas([sp.Rational(81, 100) * z], [c**2 * z], {c: sp.Rational(9, 10)})
    assert not equal_formulas([sp.Rational(8, 10) * z], [c**2 * z], {c: sp.Rational(9, 10)})
    # As a difference of large numbers: 25 of 60 digits are lost.
    assert equal_formulas([(z + 10**25) - 10**25 + sp.sin(z) ** 2 + sp.cos(z) ** 2], [z + 1], {})


# -- the exercises


def test_no_such_set_question_or_variant():
    with pytest.raises(ExerciseError, match="no exercise set 'zz'; there are a, b"):
        exercise("zz")
    with pytest.raises(ExerciseError, match="no question 'b1'; it has a1, a2"):
        opened("a", "53").check("b1", None)
    with pytest.raises(VariantError, match="no variant 'none'; there are 53"):
        exercise("a", "none")
    with pytest.raises(VariantError, match="variant own in this notebook"):
        exercise("a", {"state": "x +", "meter": "x + w"})


def test_a_variant_of_ones_own():
    lab = exercise("a", {"name": "mine", "state": "q*x + v", "meter": "x + w", "parameters": {"q": 0.5}})
    q = sp.Symbol("q", real=True)
    assert lab.check("a2", lambda z, p: (q * z, q**2 * p + 1)).passed


QUESTIONS = [pytest.param(letter, question, id=question.name) for letter, one in sets().items() for question in one.questions]


def test_names_follow_the_set():
    for letter, one in sets().items():
        assert [question.name for question in one.questions] == [f"{letter}{i + 1}" for i in range(len(one.questions))]
        assert {question.level for question in one.questions} <= {"warm-up", "core", "stretch"}


@pytest.mark.parametrize(("letter", "question"), QUESTIONS)
def test_core_questions_know_five_mistakes(letter, question):
    for mistake in question.mistakes:
        assert len(mistake.says) > 15, mistake.name
    if question.level == "core":
        assert len({mistake.name for mistake in question.mistakes}) >= 5


@cache
def right_numbers(letter, variant, name):
    """Hidden arguments and the right results, as numbers."""
    lab = opened(letter, variant)
    arguments = list(lab.questions[name].arguments(lab))
    return arguments, [numbers(lab.questions[name].answer(lab)(*values)) for values in arguments]


def numbers(result):
    """A result as arrays; formulas at a random point, the same for the same name."""
    if isinstance(result, tuple | list):
        return [array for part in result for array in numbers(part)]
    if not isinstance(result, sp.Basic | sp.MatrixBase):
        return [np.asarray(result, dtype=complex)]
    point = {s: 0.2 + random.Random(s.name).random() for s in result.free_symbols}
    entries = result.tolist() if isinstance(result, sp.MatrixBase) else result
    return [np.vectorize(lambda entry: complex(sp.sympify(entry).subs(point)), otypes=[complex])(np.array(entries, dtype=object))]


def equal_in_fact(letter, variant, name, wrong):
    """Whether a mistake gives the right numbers, to rounding; None if its numbers have another shape, or there are none."""
    arguments, right = right_numbers(letter, variant, name)
    try:
        with np.errstate(all="ignore"):
            theirs = [numbers(wrong(*values)) for values in arguments]
    except Exception:  # a mistake that this variant does not allow
        return None
    pairs = [(a, b) for found, expected in zip(theirs, right, strict=True) for a, b in zip(found, expected, strict=True)]
    if any(a.shape != b.shape for a, b in pairs):
        return None
    # Formulas are evaluated in doubles, sums of some tens of terms: 1e-9 is far above their rounding.
    return all(np.allclose(a, b, rtol=1e-9, atol=1e-9 * np.abs(b).max()) for a, b in pairs)


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize(("letter", "question"), QUESTIONS)
def test_every_answer_and_every_mistake(letter, question, variant):
    """The right answer passes.  A mistake is diagnosed by its name, or it is the same as the right answer here, or impossible.

    No message gives the answer away.
    """
    lab = opened(letter, variant)
    assert lab.check(question.name, question.answer(lab)).passed
    given_away = telling(letter, variant, question)
    for mistake in question.mistakes:
        try:
            wrong = mistake.answer(lab)
        except ValueError:
            continue
        result = lab.check(question.name, wrong)
        assert not [text for text in given_away if text in result.message.replace(" ", "")]
        fact = equal_in_fact(letter, variant, question.name, wrong)
        if mistake.name in result.diagnosis:
            assert mistake.says in result.message
            assert fact is not True
        else:
            expected = {True: "passed", None: "unusable", False: "diagnosed"}[fact]
            assert result.status == expected, f"{mistake.name}: {result}"


def telling(letter, variant, question):
    """The right formulas, in the usual ways of writing them."""
    lab = opened(letter, variant)
    arguments, _ = right_numbers(letter, variant, question.name)
    formulas = [q for values in arguments for q in flat(question.answer(lab)(*values)) if isinstance(q, sp.Expr)]
    forms = {form(q) for q in formulas for form in (str, sp.latex, lambda q: str(sp.expand(q)))}
    return [text for text in (form.replace(" ", "") for form in forms) if len(text) > 3]


def flat(result):
    return [entry for part in result for entry in flat(part)] if isinstance(result, tuple | list | sp.MatrixBase) else [result]


# -- wrong answers as a student would type them, for variant 53: x' = c x + e x v, y = g x + f x^2 w


def T(matrix):
    return np.swapaxes(matrix, -1, -2)


def times(matrix, vector):
    return (matrix @ vector[..., None])[..., 0]


def kalman_gain(Psi, G, F):
    return T(np.linalg.solve(F, G @ Psi))


def corrected(lam, Psi, h, G, F, y):
    K = kalman_gain(Psi, G, F)
    return lam + times(K, y - h), Psi - K @ G @ Psi


def b2(gain=kalman_gain, innovation=lambda y, h: y - h, cov=lambda Psi, K, G: Psi - K @ G @ Psi):
    def answer(lam, Psi, h, G, F, y):
        K = gain(Psi, G, F)
        return lam + times(K, innovation(y, h)), cov(Psi, K, G)

    return answer


def b3(change):
    """A step; `change` gets lam, Psi, z, p and returns what is predicted from."""

    def answer(lam, Psi, y, measure, predict):
        z, p = corrected(lam, Psi, *measure(lam, Psi), y)
        return z, p, *change(lam, Psi, z, p, predict)

    return answer


def predicts_first(lam, Psi, y, measure, predict):
    lam, Psi = predict(lam, Psi)
    z, p = corrected(lam, Psi, *measure(lam, Psi), y)
    return z, p, lam, Psi


def b4(first=False, returns="z", frozen=False, missing=np.nan, sign=1, shrink=True):
    def answer(y, mean, cov, measure, predict):
        N = y.shape[1]
        lam, Psi = np.tile(mean, (N, 1)), np.tile(cov, (N, 1, 1))
        if first:
            lam, Psi = predict(lam, Psi)
        found = []
        for y_k in y:
            gone = np.isnan(y_k)[:, 0]
            if not np.isnan(missing):
                y_k, gone = np.where(np.isnan(y_k), missing, y_k), np.zeros(N, dtype=bool)
            h, G, F = measure(lam, Psi)
            K = kalman_gain(Psi, G, F)
            z = np.where(gone[:, None], lam, lam + sign * times(K, np.nan_to_num(y_k) - h))
            p = np.where(gone[:, None, None], Psi, Psi - K @ G @ Psi if shrink else Psi)
            found.append(z if returns == "z" else lam)
            lam, following = predict(z, p)
            Psi = Psi if frozen else following
        return np.array(found)

    return answer


def covariance(a, b, centred=True):
    if centred:
        a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    return a.T @ b / len(a)


def regression(t, r, centred=True, offset=True, ridge=0.0, biased=1.0, residual=None):
    cross, own = covariance(t, r, centred), covariance(r, r, centred) * biased + ridge * np.eye(r.shape[1])
    A = cross @ np.linalg.pinv(own)
    shift = t.mean(axis=0) - A @ r.mean(axis=0) if offset else t.mean(axis=0)
    whole = covariance(t, t)
    rest = whole - A @ covariance(t, r).T
    return A, shift, {None: rest, "whole": whole, "n-1": rest * len(t) / (len(t) - 1)}[residual]


def c3(fit=regression, target=lambda x, lam: x - lam, base=lambda lam: lam, alpha=lambda a, z, lam: a(z)):
    def answer(lam, x, y, x_next, a, b):
        omega = y - b(lam)
        H, e, _ = fit(target(x, lam), omega)
        z = base(lam) + omega @ H.T + e
        F, g, _ = fit(x_next, alpha(a, z, lam))
        return z, alpha(a, z, lam) @ F.T + g

    return answer


def c4(part=None, one_gain=False, offset=True, returns="z"):
    def answer(x, y_design, y, mean, a, b):
        x, y_design = x[:, :part], y_design[:, :part]
        lam, other = np.tile(mean, (x.shape[1], 1)), np.tile(mean, (y.shape[1], 1))
        found = []
        for k in range(len(x)):
            if k == 0 or not one_gain:
                H, e, _ = regression(x[k] - lam, y_design[k] - b(lam))
            z = lam + (y_design[k] - b(lam)) @ H.T + e
            estimate = other + (y[k] - b(other)) @ H.T + (e if offset else 0)
            found.append({"z": estimate, "lam": other, "-z": -estimate}[returns])
            if k + 1 < len(x):
                F, g, _ = regression(x[k + 1], a(z))
                lam, other = a(z) @ F.T + g, a(estimate) @ F.T + g
        return np.array(found)

    return answer


def condition(x, z, fit=regression):
    A, shift, T_ = fit(x, z)
    return z @ A.T + shift, T_


def d2(condition=condition, choose=lambda u, T, z, p: (u, T)):
    def answer(lam, Psi, x, y, measure, predict):
        z, p = corrected(lam, Psi, *measure(lam, Psi), y)
        mean, cov = choose(*condition(x, z), z, p)
        return z, *predict(mean, np.broadcast_to(cov, Psi.shape))

    return answer


def d3(fit=regression, correct=True, predicted=True, target=lambda x, lam: x - lam, own=False):
    def answer(lam, Psi, x, y, x_next, measure, predict):
        z, p = corrected(lam, Psi, *measure(lam, Psi), y)
        sigma = z - lam
        if correct:
            H, e, _ = fit(target(x, lam), sigma)
            z = lam + sigma @ H.T + e
        u, T_ = condition(x, z)
        s, Psi_next = predict(u, p if own else np.broadcast_to(T_, Psi.shape))
        if predicted:
            F, g, _ = fit(x_next, s)
            s = s @ F.T + g
        return z, s, Psi_next

    return answer


def square(x, z):
    return ((x - z) ** 2).sum(axis=2)


def error(values, ddof=1):
    return values.std(axis=1, ddof=ddof) / np.sqrt(values.shape[1])


def partial_regression(**options):
    return lambda t, r: regression(t, r, **options)


WRONG_BY_HAND = [
    ("a2", "noise-forgotten", lambda z, p: (c * z, c**2 * p)),
    ("a2", "noise-forgotten", lambda z, p: (0.9 * z, 0.81 * p)),
    ("a2", "noise-power", lambda z, p: (0.9 * z, 0.81 * p + 0.05 * z)),
    ("a2", "noise-power", lambda z, p: (c * z, c**2 * p + e * z)),
    ("a2", "slope-power", lambda z, p: (0.9 * z, 0.9 * p + 0.0025 * z**2)),
    ("a2", "state-forgotten", lambda z, p: (c * z, (e * z) ** 2)),
    ("a2", "function-for-derivative", lambda z, p: (c * z, (c * z) ** 2 * p + (e * z) ** 2)),
    ("a2", "variance-squared", lambda z, p: (c * z, c**2 * p**2 + e**2 * z**2)),
    ("a2", "variance-root", lambda z, p: (c * z, c**2 * sp.sqrt(p) + e**2 * z**2)),
    ("a2", "sign", lambda z, p: (-c * z, c**2 * p + e**2 * z**2)),
    ("a3", "noise-forgotten", lambda m, d: (g * m, g, g**2 * d)),
    ("a3", "noise-power", lambda m, d: (m, 1, d + 0.02 * m**2)),
    ("a3", "slope-power", lambda m, d: (g * m, g, g * d + f**2 * m**4)),
    ("a3", "state-forgotten", lambda m, d: (g * m, g, f**2 * m**4)),
    ("a3", "variance-squared", lambda m, d: (g * m, g, g**2 * d**2 + f**2 * m**4)),
    ("a3", "variance-root", lambda m, d: (g * m, g, g**2 * sp.sqrt(d) + f**2 * m**4)),
    ("a3", "function-for-derivative", lambda m, d: (g * m, g, (g * m) ** 2 * d + f**2 * m**4)),
    ("a4", "noise-not-averaged", lambda z, p: (c * z, c**2 * p + e**2 * z**2)),
    ("a4", "linearised", lambda z, p: (0.9 * z, 0.81 * p + 0.0025 * z**2)),
    ("a4", "noise-forgotten", lambda z, p: (c * z, c**2 * p)),
    ("a4", "second-moment", lambda z, p: (c * z, (c**2 + e**2) * (z**2 + p))),
    ("a4", "variance-squared", lambda z, p: (c * z, c**2 * p**2 + e**2 * (z**2 + p**2))),
    ("a4", "variance-root", lambda z, p: (c * z, c**2 * sp.sqrt(p) + e**2 * (z**2 + sp.sqrt(p)))),
    ("a4", "factor-half", lambda z, p: (c * z, 2 * (c**2 * p + e**2 * (z**2 + p)))),
    ("a5", "noise-not-averaged", lambda m, d: (g * m, g, g**2 * d + f**2 * m**4)),
    ("a5", "noise-forgotten", lambda m, d: (g * m, g, g**2 * d)),
    ("a5", "second-moment", lambda m, d: (g * m, g, g**2 * (d + m**2) + f**2 * (m**4 + 6 * m**2 * d + 3 * d**2))),
    ("a5", "variance-squared", lambda m, d: (g * m, g, g**2 * d**2 + f**2 * (m**4 + 6 * m**2 * d**2 + 3 * d**4))),
    ("a5", "variance-root", lambda m, d: (g * m, g, g**2 * sp.sqrt(d) + f**2 * (m**4 + 6 * m**2 * sp.sqrt(d) + 3 * d))),
    ("a5", "sign", lambda m, d: (g * m, -g, g**2 * d + f**2 * (m**4 + 6 * m**2 * d + 3 * d**2))),
    ("b2", "innovation-sign", b2(innovation=lambda y, h: h - y)),
    ("b2", "innovation-without-h", b2(innovation=lambda y, h: y)),
    ("b2", "covariance-kept", b2(cov=lambda Psi, K, G: Psi)),
    ("b2", "covariance-added", b2(cov=lambda Psi, K, G: Psi + K @ G @ Psi)),
    ("b2", "covariance-once", b2(cov=lambda Psi, K, G: Psi - K @ G)),
    ("b2", "gain-not-divided", b2(gain=lambda Psi, G, F: Psi @ T(G))),
    ("b2", "gain-by-standard-deviation", b2(gain=lambda Psi, G, F: Psi @ T(G) / np.sqrt(F))),
    ("b2", "gain-without-G", b2(gain=lambda Psi, G, F: Psi / F)),
    ("b2", "gain-without-Psi", b2(gain=lambda Psi, G, F: T(G) / F)),
    ("b2", "gain-of-noise", b2(gain=lambda Psi, G, F: Psi @ T(G) / (F - G @ Psi @ T(G)))),
    ("b3", "beats-swapped", predicts_first),
    ("b3", "predicted-from-prediction", b3(lambda lam, Psi, z, p, predict: predict(lam, Psi))),
    ("b3", "covariance-not-predicted", b3(lambda lam, Psi, z, p, predict: (predict(z, p)[0], p))),
    ("b3", "mean-not-predicted", b3(lambda lam, Psi, z, p, predict: (z, predict(z, p)[1]))),
    ("b3", "variance-mixed", b3(lambda lam, Psi, z, p, predict: predict(z, Psi))),
    ("b4", "predicted-first", b4(first=True)),
    ("b4", "predictions-returned", b4(returns="lam")),
    ("b4", "covariance-frozen", b4(frozen=True)),
    ("b4", "missing-as-zero", b4(missing=0.0)),
    ("b4", "innovation-sign", b4(sign=-1)),
    ("b4", "covariance-kept", b4(shrink=False)),
    ("c2", "means-not-subtracted", partial_regression(centred=False)),
    ("c2", "offset-forgotten", partial_regression(offset=False)),
    ("c2", "regularised", partial_regression(ridge=1e-3)),
    ("c2", "biased", partial_regression(biased=60 / 59)),
    ("c2", "residual-is-variance", partial_regression(residual="whole")),
    ("c2", "unbiased-residual", partial_regression(residual="n-1")),
    ("c3", "state-for-error", c3(target=lambda x, lam: x)),
    ("c3", "prediction-not-added", c3(base=lambda lam: 0)),
    ("c3", "alpha-from-prediction", c3(alpha=lambda a, z, lam: a(lam))),
    ("c3", "means-not-subtracted", c3(fit=partial_regression(centred=False))),
    ("c3", "offset-forgotten", c3(fit=partial_regression(offset=False))),
    ("c4", "part-of-ensemble", c4(part=5)),
    ("c4", "one-gain", c4(one_gain=True)),
    ("c4", "predictions-returned", c4(returns="lam")),
    ("c4", "offset-not-used", c4(offset=False)),
    ("c4", "sign", c4(returns="-z")),
    ("d2", "predicted-as-aof", d2(choose=lambda u, T, z, p: (z, p))),
    ("d2", "mean-from-estimate", d2(choose=lambda u, T, z, p: (z, T))),
    ("d2", "variance-from-aof", d2(choose=lambda u, T, z, p: (u, p))),
    ("d2", "regressed-the-other-way", d2(condition=lambda x, z: condition(z, x))),
    ("d2", "residual-is-variance", d2(condition=lambda x, z: (condition(x, z)[0], covariance(x, x)))),
    ("d2", "deviation-for-variance", d2(condition=lambda x, z: (condition(x, z)[0], np.sqrt(condition(x, z)[1])))),
    ("d2", "offset-forgotten", d2(condition=lambda x, z: condition(x, z, partial_regression(offset=False)))),
    ("d3", "correction-not-fitted", d3(correct=False)),
    ("d3", "prediction-not-fitted", d3(predicted=False)),
    ("d3", "state-for-error", d3(target=lambda x, lam: x)),
    ("d3", "variance-from-aof", d3(own=True)),
    ("d3", "offset-forgotten", d3(fit=partial_regression(offset=False))),
    ("d3", "means-not-subtracted", d3(fit=partial_regression(centred=False))),
    ("e2", "spread-for-error", lambda x, z: (square(x, z).mean(axis=1), square(x, z).std(axis=1, ddof=1))),
    ("e2", "not-root", lambda x, z: (square(x, z).mean(axis=1), square(x, z).var(axis=1, ddof=1) / x.shape[1])),
    ("e2", "divided-by-N", lambda x, z: (square(x, z).mean(axis=1), square(x, z).std(axis=1, ddof=1) / x.shape[1])),
    ("e2", "of-error", lambda x, z: (square(x, z).mean(axis=1), error(np.abs(x - z)[:, :, 0]))),
    ("e2", "biased-spread", lambda x, z: (square(x, z).mean(axis=1), error(square(x, z), ddof=0))),
    ("e2", "normal-theory", lambda x, z: (square(x, z).mean(axis=1), square(x, z).mean(axis=1) * (2 / x.shape[1]) ** 0.5)),
    (
        "e3",
        "unpaired",
        lambda x, z, o: (
            square(x, z).mean(axis=1) - square(x, o).mean(axis=1),
            np.sqrt(error(square(x, z)) ** 2 + error(square(x, o)) ** 2),
        ),
    ),
    (
        "e3",
        "errors-subtracted",
        lambda x, z, o: ((square(x, z) - square(x, o)).mean(axis=1), abs(error(square(x, z)) - error(square(x, o)))),
    ),
    (
        "e3",
        "errors-added",
        lambda x, z, o: ((square(x, z) - square(x, o)).mean(axis=1), error(square(x, z)) + error(square(x, o))),
    ),
    ("e3", "distance-of-estimates", lambda x, z, o: (square(z, o).mean(axis=1), error(square(z, o)))),
    ("e3", "order", lambda x, z, o: ((square(x, o) - square(x, z)).mean(axis=1), error(square(x, o) - square(x, z)))),
    ("e5", "by-deviation", lambda x, z, p: ((x - z)[..., 0] ** 2 / np.sqrt(p[..., 0, 0])).mean(axis=1)),
    ("e5", "ratio-of-means", lambda x, z, p: ((x - z)[..., 0] ** 2).mean(axis=1) / p[..., 0, 0].mean(axis=1)),
    ("e5", "inverted", lambda x, z, p: (p[..., 0, 0] / (x - z)[..., 0] ** 2).mean(axis=1)),
    ("e5", "root", lambda x, z, p: np.sqrt(((x - z)[..., 0] ** 2 / p[..., 0, 0]).mean(axis=1))),
    ("e5", "factor-half", lambda x, z, p: 2 * ((x - z)[..., 0] ** 2 / p[..., 0, 0]).mean(axis=1)),
]


@pytest.mark.parametrize(
    ("name", "diagnosis", "answer"), [pytest.param(*row, id=f"{row[0]}-{i}-{row[1]}") for i, row in enumerate(WRONG_BY_HAND)]
)
def test_wrong_answers_typed_by_hand(name, diagnosis, answer):
    result = opened(name[0], "53").check(name, answer)
    assert result.status == "wrong"
    assert diagnosis in result.diagnosis, result


def test_five_by_hand_for_every_core_question_of_the_first_sets():
    core = {question.name for letter in FIRST for question in sets()[letter].questions if question.level == "core"}
    by_hand = {name: {diagnosis for one, diagnosis, _ in WRONG_BY_HAND if one == name} for name in core}
    assert {name: sorted(found) for name, found in by_hand.items() if len(found) < 5} == {}


RIGHT_BY_HAND = [
    ("a2", lambda z, p: (0.9 * z, 0.81 * p + 0.0025 * z**2)),
    ("a3", lambda m, d: [g * m, g, g**2 * d + (f * m**2) ** 2]),
    ("a4", lambda z, p: (c * z, p * (c**2 + e**2) + e**2 * z**2)),
    ("a5", lambda m, d: (g * m, g, g**2 * d + f**2 * ((m**2 + 3 * d) ** 2 - 6 * d**2))),
    ("b2", b2()),
    ("b3", b3(lambda lam, Psi, z, p, predict: predict(z, p))),
    ("b4", b4()),
    ("c2", regression),
    ("c3", c3()),
    ("c4", c4()),
    ("d2", d2()),
    ("d3", d3()),
    ("e2", lambda x, z: (square(x, z).mean(axis=1), error(square(x, z)))),
    ("e3", lambda x, z, o: ((square(x, z) - square(x, o)).mean(axis=1), error(square(x, z) - square(x, o)))),
    ("e5", lambda x, z, p: ((x - z)[..., 0] ** 2 / p[..., 0, 0]).mean(axis=1)),
]


@pytest.mark.parametrize(("name", "answer"), [pytest.param(*row, id=row[0]) for row in RIGHT_BY_HAND])
def test_right_answers_typed_by_hand(name, answer):
    """Without them the wrong ones could be wrong for another reason than the one they are there for."""
    assert opened(name[0], "53").check(name, answer).passed


def test_messages_of_the_package_are_not_code():
    """What a student reads names the kind of mistake: no message is a Python expression."""
    for one in sets().values():
        for question in one.questions:
            for mistake in question.mistakes:
                with pytest.raises(SyntaxError):
                    ast.parse(mistake.says)
