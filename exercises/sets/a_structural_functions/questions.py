"""Questions of set a: structural functions, by linearisation and exactly for a normal law.

Answers are functions of symbols, (z, p) for the object and (m, d) for the meter; of matrices of
symbols for a vector variant.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import sympy as sp

from kfcourse.exercises.checks.derived import Derivation, posed_by
from kfcourse.exercises.checks.exercises import Exercise
from kfcourse.exercises.checks.question import Answer, ForVariant, Mistake, Question
from kfcourse.exercises.checks.registry import ExerciseSet
from kfcourse.exercises.sets import messages
from kfcourse.exercises.sets.a_structural_functions.mistakes import (
    CORRELATION_FORGOTTEN,
    FUNCTION_FOR_DERIVATIVE,
    SECOND_MOMENT,
    WRONG_LINEARISED,
    WRONG_NOISE_PARTS,
    WRONG_STATE_PARTS,
    exact_noise_part,
    scalar_of,
)
from kfcourse.symbolic.sides import Side, plain

# an expression for a scalar variant, a matrix for a vector one
Formula: TypeAlias = sp.Expr | sp.MatrixBase
Make = Callable[[Exercise], Formula | tuple[Formula, ...]]  # the results in symbols


def symbols(exercise: Exercise, side: str) -> tuple[Formula, Formula]:
    """Mean and covariance of the law, as an answer is called with them."""
    part = Side.of(exercise.model, side)
    return plain(part.mean), plain(part.cov)


def constant(make: Make) -> ForVariant:
    """An answer that ignores its arguments: the formulas are in those very symbols."""

    def answer(exercise: Exercise) -> Answer:
        result = make(exercise)
        return lambda *_: result

    return ForVariant(answer)


def key(name: str, make: Make, side: str, step: Answer | None = None) -> ForVariant:
    """The same for a key, with the student's own name and arguments, and the key on top of earlier
    answers."""

    def answer(exercise: Exercise) -> Answer:
        result = make(exercise)
        return (lambda z, p: result) if side == "object" else (lambda m, d: result)

    return ForVariant(answer, name, step)


def right(kind: str, side: str) -> Make:
    """(tau, Theta) of the object, or (h, G, F) of the meter."""
    names = ("tau", "Theta") if side == "object" else ("h", "G", "F")
    return lambda exercise: tuple(exercise.closed(kind)[name] for name in names)


def wrong_covariance(
    name: str, says: str, kind: str, side: str, covariance: Callable[[Side], sp.MatrixBase]
) -> Mistake:
    """The right functions but for the last, the covariance."""

    def make(exercise: Exercise) -> tuple:
        return (*right(kind, side)(exercise)[:-1], plain(covariance(Side.of(exercise.model, side))))

    return Mistake(name, says, constant(make))


def covariance_to_power(
    name: str, says: str, kind: str, side: str, exponent: sp.Rational
) -> Mistake:
    """The right functions with every entry of p (or d) raised to a power."""

    def make(exercise: Exercise) -> tuple:
        powers = {entry: entry**exponent for entry in Side.of(exercise.model, side).cov}
        return tuple(
            formula.subs(powers, simultaneous=True) for formula in right(kind, side)(exercise)
        )

    return Mistake(name, says, constant(make))


def wrong_slope(kind: str) -> Mistake:
    """The function itself in the place of G."""

    def make(exercise: Exercise) -> tuple:
        h, _, F = right(kind, "meter")(exercise)
        return scalar_of(sp.Matrix([h])), h, F

    return Mistake("function-for-derivative", FUNCTION_FOR_DERIVATIVE, constant(make))


def mistakes_of_variance(kind: str, side: str) -> tuple[Mistake, ...]:
    """The variance squared, or its root: as easily made by linearisation as exactly."""
    p = "p" if side == "object" else "d"
    return (
        covariance_to_power(
            "variance-squared",
            f"{p} is a variance already; it seems to enter squared.",
            kind,
            side,
            sp.Integer(2),
        ),
        covariance_to_power(
            "variance-root",
            f"{p} is a variance; its square root seems to stand in its place.",
            kind,
            side,
            sp.Rational(1, 2),
        ),
    )


def without_known(formula: sp.Expr, known: tuple[sp.Symbol, ...]) -> sp.Expr:
    """A sum without the terms that depend on the step."""
    return sp.Add(*(term for term in sp.Add.make_args(sp.expand(formula)) if not term.has(*known)))


def mistakes_of_time(kind: str, side: str) -> tuple[Mistake, ...]:
    """Time and inputs forgotten in the mean, or taken at another step; none for a model that has
    none of them."""

    def changed(change: Callable[[Exercise, sp.Expr], sp.Expr]) -> ForVariant:
        def make(exercise: Exercise) -> tuple:
            mean, *others = right(kind, side)(exercise)
            entries = sp.Matrix([mean])
            wrong = entries.applyfunc(lambda entry: change(exercise, entry))
            if wrong == entries:
                raise ValueError("only where the mean depends on the step")
            return (plain(wrong), *others)

        return constant(make)

    def forgotten(exercise: Exercise, entry: sp.Expr) -> sp.Expr:
        known = exercise.model.known.symbols
        return without_known(entry, known) if known else entry

    def later(exercise: Exercise, entry: sp.Expr) -> sp.Expr:
        known = exercise.model.known
        lengths = {"k": sp.S.One, "t": known.interval}
        shift = {s: s + lengths[s.name] for s in known.symbols if s.name not in known.inputs}
        return entry.subs(shift, simultaneous=True)

    return (
        Mistake("input-forgotten", messages.INPUT_FORGOTTEN, changed(forgotten)),
        Mistake("input-of-next-step", messages.INPUT_OF_NEXT_STEP, changed(later)),
    )


def mistakes_of_linearised(side: str) -> tuple[Mistake, ...]:
    """Mistakes in (tau, Theta) or (h, G, F) by linearisation."""
    p = "p" if side == "object" else "d"
    catalogue: tuple[tuple[str, str, Callable[[Side], sp.MatrixBase]], ...] = (
        ("noise-forgotten", messages.NOISE_PART_FORGOTTEN, lambda s: s.A * s.cov * s.A.T),
        (
            "state-forgotten",
            f"Only the noise's part is there: how does the uncertainty {p} of the state come "
            f"through the equation?",
            lambda s: s.B * s.D * s.B.T,
        ),
        (
            "noise-power",
            "The noise's factor enters with the wrong power: a variance goes with its square.",
            lambda s: s.A * s.cov * s.A.T + sp.diag(*[sum(s.B[i, :]) for i in range(s.B.rows)]),
        ),
        (
            "slope-power",
            "The derivative enters only once: a covariance goes with it on both sides.",
            lambda s: s.A * s.cov + s.B * s.D * s.B.T,
        ),
        (
            "function-for-derivative",
            FUNCTION_FOR_DERIVATIVE,
            lambda s: sp.Matrix([scalar_of(s.value) ** 2 * scalar_of(s.cov)]) + s.B * s.D * s.B.T,
        ),
        (
            "transposed",
            "A matrix is transposed: in M p M^T the transposed one stands on the right.",
            lambda s: s.A.T * s.cov * s.A + s.B * s.D * s.B.T,
        ),
    )
    rows = catalogue + WRONG_LINEARISED
    named = tuple(
        wrong_covariance(name, says, "linearised", side, covariance)
        for name, says, covariance in rows
    )
    exact = Mistake(
        "exact",
        "That is the exact function of the normal law. Here the tangent takes the place of the "
        "equation.",
        constant(right("gaussian", side)),
    )
    slopes = (wrong_slope("linearised"),) if side == "meter" else ()
    return (
        *named,
        *mistakes_of_variance("linearised", side),
        *mistakes_of_time("linearised", side),
        exact,
        *slopes,
    )


def mistakes_of_gaussian(side: str) -> tuple[Mistake, ...]:
    """Mistakes in (tau, Theta) or (h, G, F) for a normal law."""

    def second_moment(exercise: Exercise) -> tuple:
        functions = right("gaussian", side)(exercise)
        mean, cov = (sp.Matrix([f]) for f in (functions[0], functions[-1]))
        return (*functions[:-1], plain(cov + mean * mean.T))

    def changed(part: Callable[[Side], sp.MatrixBase], added: bool) -> ForVariant:
        """The right functions with something in the place of the noise's part, or added to the
        covariance."""

        def make(exercise: Exercise) -> tuple:
            functions, s = right("gaussian", side)(exercise), Side.of(exercise.model, side)
            cov = sp.Matrix([functions[-1]]) + part(s)
            return (*functions[:-1], plain(cov if added else cov - exact_noise_part(s)))

        return constant(make)

    def uncorrelated(exercise: Exercise) -> tuple:
        *functions, cov = right("gaussian", side)(exercise)
        return (*functions, plain(sp.diag(*sp.Matrix([cov]).diagonal())))

    slopes = (wrong_slope("gaussian"),) if side == "meter" else ()
    return (
        *slopes,
        *(
            Mistake(name, says, changed(part, added=False))
            for name, says, part in WRONG_NOISE_PARTS
        ),
        *(Mistake(name, says, changed(part, added=True)) for name, says, part in WRONG_STATE_PARTS),
        Mistake("correlation-forgotten", CORRELATION_FORGOTTEN, constant(uncorrelated)),
        wrong_covariance(
            "noise-not-averaged",
            "The noise's factor is taken at the mean. It depends on the state: its square has to "
            "be averaged over the law too.",
            "gaussian",
            side,
            lambda s: s.noiseless_covariance() + s.B * s.D * s.B.T,
        ),
        wrong_covariance(
            "noise-forgotten",
            messages.NOISE_PART_FORGOTTEN,
            "gaussian",
            side,
            Side.noiseless_covariance,
        ),
        Mistake(
            "linearised",
            "That is the linearised function. Here the mean over the whole normal law is asked "
            "for.",
            constant(right("linearised", side)),
        ),
        Mistake("second-moment", SECOND_MOMENT, constant(second_moment)),
        *mistakes_of_variance("gaussian", side),
        *mistakes_of_time("gaussian", side),
    )


def jacobians(
    side: str, change: Callable[[sp.Matrix, sp.Matrix], tuple] = lambda a, b: (a, b)
) -> ForVariant:
    """Derivatives by state and by noise, changed."""

    def make(exercise: Exercise) -> tuple:
        part = Side.of(exercise.model, side)
        return tuple(plain(matrix) for matrix in change(part.A, part.B))

    return constant(make)


def _unevaluated(exercise: Exercise) -> tuple:
    """Derivatives divided by the variable: the slope of a secant through 0, not of the tangent."""
    part = Side.of(exercise.model, "object")
    return plain(sp.Matrix([scalar_of(part.value) / scalar_of(part.mean)])), plain(part.B)


def unexplained_with(part: Callable[[Side], sp.MatrixBase]) -> ForVariant:
    """R with something in the place of the noise's part."""

    def make(exercise: Exercise) -> Formula:
        s = Side.of(exercise.model, "meter")
        return plain(sp.Matrix([unexplained(exercise)]) - exact_noise_part(s) + part(s))

    return constant(make)


def unexplained(exercise: Exercise) -> Formula:
    """R = F - G d G^T of the Gaussian functions."""
    return exercise.closed("gaussian")["R"]


def unexplained_by(m: Formula, d: Formula) -> Formula:
    """The same from the student's own F and G."""
    _, G, F = (sp.Matrix([part]) for part in meter_gaussian(m, d))  # type: ignore[name-defined]  # noqa: F821
    return F - G * sp.Matrix([d]) * G.T


def _question(
    number: int, title: str, kind: str, side: str, mistakes: tuple[Mistake, ...], advice: str
) -> Question:
    """A question for the functions of one kind and one side."""
    parts = ("tau", "Theta") if side == "object" else ("h", "G", "F")
    right_one = key(f"{side}_{kind}", right(kind, side), side)
    return Question(
        f"a{number}",
        title,
        "core",
        right_one,
        lambda e: [symbols(e, side)],
        mistakes,
        parts,
        advice=advice,
    )


QUESTIONS = (
    Question(
        "a1",
        "derivatives of the state equation",
        "warm-up",
        ForVariant(lambda e: lambda z: jacobians("object").make(e)(z), "derivatives"),
        lambda e: [symbols(e, "object")[:1]],
        (
            Mistake(
                "swapped",
                "The two derivatives seem to be swapped: the first is by the state, the second by "
                "the noise.",
                jacobians("object", lambda a, b: (b, a)),
            ),
            Mistake(
                "transposed",
                "It looks transposed: row i holds the derivatives of equation i.",
                jacobians("object", lambda a, b: (a.T, b.T)),
            ),
            Mistake(
                "identity-forgotten",
                "The state itself is part of its equation: its own derivative is missing.",
                jacobians("object", lambda a, b: (a - sp.eye(a.rows), b)),
            ),
            Mistake(
                "wrong-row",
                "A derivative by the noise stands in the row of another equation.",
                jacobians("object", lambda a, b: (a, sp.Matrix(b.tolist()[::-1]))),
            ),
            Mistake(
                "secant",
                "The value was divided by the state; the derivative is asked for.",
                constant(_unevaluated),
            ),
        ),
        ("a_x", "a_v"),
        advice=(
            "Write the equation down once more, keep all letters but one constant, and "
            "differentiate by "
            "that one; put the mean in last."
        ),
    ),
    _question(
        2,
        "linearised functions of the object",
        "linearised",
        "object",
        mistakes_of_linearised("object"),
        advice=(
            "Write x as mean plus deviation: what multiplies the deviation, what multiplies the "
            "noise, and "
            "what is the variance of each?"
        ),
    ),
    _question(
        3,
        "linearised functions of the meter",
        "linearised",
        "meter",
        mistakes_of_linearised("meter"),
        advice=(
            "Do for the meter what you did for the object: first the value at the mean, then its "
            "slope, "
            "then what slope and noise do to a variance."
        ),
    ),
    _question(
        4,
        "Gaussian functions of the object",
        "gaussian",
        "object",
        mistakes_of_gaussian("object"),
        advice=(
            "Average over the noise first, with the state fixed; then over the state. Check with "
            "a variance "
            "of zero: what must come out?"
        ),
    ),
    _question(
        5,
        "Gaussian functions of the meter",
        "gaussian",
        "meter",
        mistakes_of_gaussian("meter"),
        advice=(
            "Check three cases by hand: no uncertainty of the state, no noise, and a meter that "
            "is a straight line."
        ),
    ),
    Question(
        "a6",
        "what the state does not explain of the measurement",
        "stretch",
        key("unexplained", unexplained, "meter", unexplained_by),
        lambda e: [symbols(e, "meter")],
        (
            Mistake(
                "whole-variance",
                "That is the whole variance of the measurement; subtract what the best linear "
                "function of the state explains.",
                constant(lambda e: right("gaussian", "meter")(e)[2]),
            ),
            Mistake(
                "slope-once",
                "The explained part has the slope on both sides: G d G^T.",
                constant(
                    lambda e: plain(
                        sp.Matrix([right("gaussian", "meter")(e)[2]])
                        - sp.Matrix(
                            [
                                scalar_of(sp.Matrix([right("gaussian", "meter")(e)[1]]))
                                * Side.of(e.model, "meter").cov[0]
                            ]
                        )
                    )
                ),
            ),
            *(
                Mistake(name, says, unexplained_with(part))
                for name, says, part in WRONG_NOISE_PARTS
            ),
        ),
        advice=(
            "Write all three functions of question 5 below each other before you subtract; what "
            "is left if "
            "the meter is a straight line?"
        ),
    ),
    Derivation(
        "a7",
        "the derivation, line by line",
        "core",
        ForVariant(lambda e: lambda: e.derivation.text, "derivation"),
        lambda e: [()],
        advice=(
            "Write the line above and this line below each other, multiplied out, and cross out "
            "what both have: what is left?"
        ),
        posed=lambda e: posed_by(e.derivation.model, e.derivation.name),
    ),
)

SET = ExerciseSet(
    "a",
    "Structural functions",
    Path(__file__).parent,
    QUESTIONS,
    chapters=(
        "course/structural-functions",
        "course/linearisation",
    ),
    angles=("x", "y"),
)
