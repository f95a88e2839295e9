"""Set a, answers as a student would type them, for a scalar variant and for the pendulum."""

import pytest
import sympy as sp
from answers import (  # noqa: F401
    BY_VALUE,
    test_no_wrong_kind_of_mistake_is_named,
    test_right_answers_pass,
    test_what_cannot_be_compared_is_explained,
)

z, p, m, d, x, v = sp.symbols("z p m d x v", real=True)
c, e, g, f = sp.symbols("c e g f", real=True)
third = sp.Rational(1, 3)


def a2(tau=c * z, Theta=c**2 * p + e**2 * z**2):
    return lambda z, p: (tau, Theta)


def a3(h=g * m, G=g, F=g**2 * d + f**2 * m**4):
    return lambda m, d: (h, G, F)


def a4(tau=c * z, noise=e**2 * (z**2 + p), state=c**2 * p):
    return lambda z, p: (tau, state + noise)


def a5(h=g * m, G=g, fourth=m**4 + 6 * m**2 * d + 3 * d**2, noise=f**2, state=g**2 * d):
    return lambda m, d: (h, G, state + noise * fourth)


def a6(R):
    return lambda m, d: R


def a7(*lines):
    """A chain of variant 53's F, after its definition."""
    return lambda: "\n = ".join(["F = M[(y - h)^2]", *lines])


# The pendulum: x1' = x1 + T x2, x2' = x2 - T (b x2 + k sin x1) + s v, y = (sin x1 + r w1, x2 + q w2).

T, b, k, s, r, q = sp.symbols("T b k s r q", real=True)
z1, z2, m1, m2 = sp.symbols("z1 z2 m1 m2", real=True)
I2 = sp.eye(2)


def slope(cosine):
    return sp.Matrix([[1, T], [-T * k * cosine, 1 - T * b]])


A = slope(sp.cos(z1))
B = sp.Matrix([0, s])
NOISE = sp.diag(0, s**2)
METER_NOISE = sp.diag(r**2, q**2)


def moved(sine):
    return sp.Matrix([z1 + T * z2, z2 - T * (b * z2 + k * sine)])


def p1(A=A, B=B):
    return lambda z: (A, B)


TAU, h, G = moved(sp.sin(z1)), sp.Matrix([sp.sin(m1), m2]), sp.diag(sp.cos(m1), 1)


def p2(tau=TAU, A=A, noise=NOISE, law=lambda A, p: A * p * A.T):
    return lambda z, p: (tau, law(A, p) + noise)


def p3(h=h, G=G, noise=METER_NOISE, law=lambda G, d: G * d * G.T):
    return lambda m, d: (h, G, law(G, d) + noise)


def sine_variance(mean, variance):
    return (1 - sp.cos(2 * mean) * sp.exp(-2 * variance)) / 2 - sp.sin(mean) ** 2 * sp.exp(-variance)


def p4(shrink=lambda p: sp.exp(-p / 2), of_sine=sine_variance, noise=NOISE, cross=True, tau_shrink=None):
    def answer(z, p):
        mean = (tau_shrink or shrink)(p[0, 0])
        A = slope(shrink(p[0, 0]) * sp.cos(z1))
        Theta = A * p * A.T
        if not cross:
            Theta = sp.diag(Theta[0, 0], Theta[1, 1])
        straight = A[1, 0] ** 2 * p[0, 0]
        return moved(mean * sp.sin(z1)), Theta + sp.diag(0, T**2 * k**2 * of_sine(z1, p[0, 0]) - straight) + noise

    return answer


def p5(shrink=lambda d: sp.exp(-d / 2), of_sine=sine_variance, noise=METER_NOISE, cross=True, slope_shrink=None):
    def answer(m, d):
        mean = shrink(d[0, 0]) * sp.sin(m1)
        G = sp.diag((slope_shrink or shrink)(d[0, 0]) * sp.cos(m1), 1)
        cov = G[0, 0] * d[0, 1] if cross else 0
        return sp.Matrix([mean, m2]), G, sp.Matrix([[of_sine(m1, d[0, 0]), cov], [cov, d[1, 1]]]) + noise

    return answer


def p6(F_minus=lambda F, G, d: F - G * d * G.T, **options):
    def answer(m, d):
        _, G, F = p5(**options)(m, d)
        return F_minus(F, G, d)

    return answer


RIGHT = [
    ("a1", lambda z: (c, e * z)),
    ("a2", a2()),
    ("a3", a3()),
    ("a4", a4()),
    ("a5", a5()),
    ("a2", lambda z, p: [z * c, p * c**2 + (e * z) ** 2]),
    ("a3", a3(F=g**2 * d + (f * m**2) ** 2)),
    ("a4", lambda z, p: (c * z, p * (c**2 + e**2) + e**2 * z**2)),
    ("a5", a5(fourth=(m**2 + 3 * d) ** 2 - 6 * d**2)),
    ("a6", a6(f**2 * ((m**2 + 3 * d) ** 2 - 6 * d**2))),
    ("a7", a7("M[(g*(x - m) + f*x^2*w)^2]", "g^2*d + f^2*M[x^4]", "g^2*d + f^2*(m^4 + 6*m^2*d + 3*d^2)")),
    ("a7", a7("M[y^2] - h^2", "g^2*(m^2 + d) + f^2*M[x**4] - (g*m)^2", "d*g^2 + f^2*((m^2 + 3*d)^2 - 6*d^2)  # done")),
]
RIGHT_OF_PENDULUM = [("a1", p1()), ("a2", p2()), ("a3", p3()), ("a4", p4()), ("a5", p5()), ("a6", p6())]

WRONG = [
    ("a1", "unused", lambda z: (c, e)),
    ("a1", "unused", lambda z: (c, z)),
    ("a1", "superfluous", lambda z: (c * z, e * z)),
    ("a1", "superfluous", lambda z: (c + e, e * z)),
    ("a1", "superfluous", lambda z: (c + e * v, e * z)),
    ("a1", "vanishing", lambda z: (c, 0)),
    ("a1", "unused", lambda z: (c, e * x)),
    ("a1", "unused", lambda z: (1, e * z)),
    ("a1", "swapped", lambda z: (e * z, c)),
    ("a2", "noise-not-squared", a2(Theta=c**2 * p + e * z**2)),
    ("a2", "noise-sign", a2(Theta=c**2 * p - e**2 * z**2)),
    ("a2", "swapped", lambda z, p: (c**2 * p + e**2 * z**2, c * z)),
    ("a2", "unused", a2(Theta=c**2 * p + e**2)),
    ("a2", "noise-not-squared", a2(Theta=c**2 * p + e**2 * z)),
    ("a2", "superfluous", a2(tau=c * z + e * z)),
    ("a2", "unused", a2(tau=z)),
    ("a2", "sum-squared", a2(Theta=(c + e * z) ** 2 * p)),
    ("a2", "cross-term", a2(Theta=c**2 * p + 2 * c * e * z + e**2 * z**2)),
    ("a2", "root", a2(Theta=sp.sqrt(c**2 * p + e**2 * z**2))),
    ("a2", "noise-times-variance", a2(Theta=c**2 * p + e**2 * z**2 * p)),
    ("a2", "second-moment", a2(Theta=c**2 * (p + z**2) + e**2 * z**2)),
    ("a2", "exact", a2(Theta=c**2 * p + e**2 * (z**2 + p))),
    ("a2", "unused", a2(Theta=c**2 * p + e**2 * x**2)),
    ("a2", "unused", a2(Theta=p + e**2 * z**2)),
    ("a2", "deviations-added", a2(Theta=c * sp.sqrt(p) + e * z)),
    ("a2", "numbers", lambda z, p: (0.9 * z, 0.81 * p + 0.0025 * z**2)),
    ("a2", "noise-forgotten", a2(Theta=c**2 * p)),
    ("a2", "noise-forgotten", lambda z, p: (0.9 * z, 0.81 * p)),
    ("a2", "noise-power", lambda z, p: (0.9 * z, 0.81 * p + 0.05 * z)),
    ("a2", "noise-power", a2(Theta=c**2 * p + e * z)),
    ("a2", "slope-power", lambda z, p: (0.9 * z, 0.9 * p + 0.0025 * z**2)),
    ("a2", "state-forgotten", a2(Theta=(e * z) ** 2)),
    ("a2", "function-for-derivative", a2(Theta=(c * z) ** 2 * p + (e * z) ** 2)),
    ("a2", "variance-squared", a2(Theta=c**2 * p**2 + e**2 * z**2)),
    ("a2", "variance-root", a2(Theta=c**2 * sp.sqrt(p) + e**2 * z**2)),
    ("a2", "sign", a2(tau=-c * z)),
    ("a3", "noise-forgotten", a3(F=g**2 * d)),
    ("a3", "noise-power powers", lambda m, d: (m, 1, d + 0.02 * m**2)),
    ("a3", "slope-power", a3(F=g * d + f**2 * m**4)),
    ("a3", "state-forgotten", a3(F=f**2 * m**4)),
    ("a3", "variance-squared", a3(F=g**2 * d**2 + f**2 * m**4)),
    ("a3", "variance-root", a3(F=g**2 * sp.sqrt(d) + f**2 * m**4)),
    ("a3", "function-for-derivative", a3(G=g * m)),
    ("a3", "noise-not-squared", a3(F=g**2 * d + f**2 * m**2)),
    ("a3", "noise-sign", a3(F=g**2 * d - f**2 * m**4)),
    ("a3", "noise-not-squared", a3(F=g**2 * d + f * m**4)),
    ("a3", "unused", a3(F=g**2 * d + f**2)),
    ("a3", "superfluous", a3(h=g * m + f * m**2)),
    ("a3", "superfluous", a3(G=g + 2 * f * m)),
    ("a3", "noise-in-slope", a3(F=g**2 * d + 4 * f**2 * m**2 * d)),
    ("a3", "swapped", lambda m, d: (g * m, g**2 * d + f**2 * m**4, g)),
    ("a3", "unused", a3(F=g**2 * d + f**2 * d**2)),
    ("a3", "noise-in-slope", a3(F=(g + 2 * f * m) ** 2 * d + f**2 * m**4)),
    ("a3", "noise-times-variance", a3(F=g**2 * d + f**2 * m**4 * d)),
    ("a3", "root", a3(F=sp.sqrt(g**2 * d + f**2 * m**4))),
    ("a3", "function-for-derivative", a3(F=g * d * g * m**2 + f**2 * m**4)),
    ("a4", "noise-not-averaged linearised", a4(noise=e**2 * z**2)),
    ("a4", "linearised noise-not-averaged", lambda z, p: (0.9 * z, 0.81 * p + 0.0025 * z**2)),
    ("a4", "noise-forgotten", a4(noise=0)),
    ("a4", "second-moment", lambda z, p: (c * z, (c**2 + e**2) * (z**2 + p))),
    ("a4", "variance-squared", a4(state=c**2 * p**2, noise=e**2 * (z**2 + p**2))),
    ("a4", "variance-root", a4(state=c**2 * sp.sqrt(p), noise=e**2 * (z**2 + sp.sqrt(p)))),
    ("a4", "factor-half", a4(state=2 * c**2 * p, noise=2 * e**2 * (z**2 + p))),
    ("a4", "variance-for-moment", a4(noise=e**2 * p)),
    ("a4", "noise-not-squared", a4(noise=e * (z**2 + p))),
    ("a4", "noise-sign", a4(noise=-(e**2) * (z**2 + p))),
    ("a4", "swapped", lambda z, p: (c**2 * p + e**2 * (z**2 + p), c * z)),
    ("a4", "mean-square", a4(noise=e**2 * (z + p) ** 2)),
    ("a4", "mean-square", a4(noise=e**2 * (z**2 + 2 * p))),
    ("a4", "mean-square", a4(noise=e**2 * (z**2 - p))),
    ("a4", "unused", a4(noise=e**2)),
    ("a4", "superfluous", a4(tau=c * z + e * z)),
    ("a4", "", a4(state=(c + e) ** 2 * p)),
    ("a4", "second-moment", a4(state=c**2 * (p + z**2), noise=e**2 * z**2)),
    ("a4", "slope-power", a4(state=c * p)),
    ("a4", "noise-times-variance", a4(noise=e**2 * z**2 * p)),
    ("a4", "power-of-moment", a4(noise=3 * e**2 * (z**2 + p))),
    ("a4", "unused", a4(state=p)),
    ("a5", "noise-not-averaged linearised", a5(fourth=m**4)),
    ("a5", "noise-forgotten", a5(noise=0)),
    ("a5", "second-moment", a5(state=g**2 * (d + m**2))),
    ("a5", "variance-squared", a5(state=g**2 * d**2, fourth=m**4 + 6 * m**2 * d**2 + 3 * d**4)),
    ("a5", "variance-root", a5(state=g**2 * sp.sqrt(d), fourth=m**4 + 6 * m**2 * sp.sqrt(d) + 3 * d)),
    ("a5", "sign", a5(G=-g)),
    ("a5", "power-of-moment", a5(fourth=(m**2 + d) ** 2)),
    ("a5", "power-of-moment", a5(fourth=3 * (m**2 + d) ** 2)),
    ("a5", "coefficient", a5(fourth=m**4 + 3 * m**2 * d + 3 * d**2)),
    ("a5", "variance-for-moment", a5(fourth=4 * m**2 * d + 2 * d**2)),
    ("a5", "central-moment", a5(fourth=m**4 + 6 * m**2 * d + d**2)),
    ("a5", "central-moment", a5(fourth=m**4 + 6 * m**2 * d)),
    ("a5", "coefficient", a5(fourth=m**4 + 3 * d**2)),
    ("a5", "unused", a5(fourth=3 * d**2)),
    ("a5", "coefficient", a5(fourth=m**4 + 4 * m**2 * d + 3 * d**2)),
    ("a5", "noise-not-squared", a5(fourth=m**2 + d)),
    ("a5", "noise-not-squared", a5(noise=f)),
    ("a5", "noise-sign", a5(noise=-(f**2))),
    ("a5", "function-for-derivative", a5(G=g * m)),
    ("a5", "superfluous", a5(h=g * m + f * (m**2 + d))),
    ("a5", "swapped", lambda m, d: (g * m, g**2 * d + f**2 * (m**4 + 6 * m**2 * d + 3 * d**2), g)),
    ("a5", "slope-power", a5(state=g * d)),
    ("a5", "unused", a5(fourth=1)),
    ("a6", "whole-variance", a6(g**2 * d + f**2 * (m**4 + 6 * m**2 * d + 3 * d**2))),
    ("a6", "unused", a6(f**2 * m**4)),
    ("a6", "slope-once", a6(g**2 * d - g * d + f**2 * (m**4 + 6 * m**2 * d + 3 * d**2))),
    ("a6", "power-of-moment", a6(f**2 * (m**2 + d) ** 2)),
    ("a6", "coefficient", a6(f**2 * (m**4 + 3 * m**2 * d + 3 * d**2))),
    ("a6", "noise-sign", a6(-(f**2) * (m**4 + 6 * m**2 * d + 3 * d**2))),
    ("a6", "superfluous", a6(2 * g**2 * d + f**2 * (m**4 + 6 * m**2 * d + 3 * d**2))),
    ("a6", "noise-not-squared", a6(f * (m**4 + 6 * m**2 * d + 3 * d**2))),
    ("a6", "unused", a6(f**2)),
    ("a7", "moment", a7("g^2*d + f^2*M[x^4]", "g^2*d + 3*f^2*d^2")),
    ("a7", "factor", a7("g^2*d + f^2*M[x^4]", "g^2*d + f^2*(m^4 + 4*m^2*d + 3*d^2)")),
    ("a7", "power", a7("g^2*d + f*M[x^4]", "g^2*d + f*(m^4 + 6*m^2*d + 3*d^2)")),
    ("a7", "power", a7("g^2*d + f^2*M[x^4]", "g*d + f^2*(m^4 + 6*m^2*d + 3*d^2)")),
    ("a7", "noise-forgotten", a7("M[(g*(x - m) + f*x^2*w)^2]", "g^2*M[(x - m)^2]", "g^2*d")),
    ("a7", "open-end", a7("g^2*d + f^2*M[x^4]")),
    ("a7", "steps-missing", lambda: "F = g^2*d + f^2*(m^4 + 6*m^2*d + 3*d^2)"),
]
WRONG_OF_PENDULUM = [
    ("a1", "entry", p1(A=slope(sp.sin(z1)))),
    ("a1", "entry", p1(A=slope(-sp.cos(z1)))),
    ("a1", "identity-forgotten", p1(A=A - I2)),
    ("a1", "transposed", p1(A=A.T)),
    ("a1", "unused", p1(A=A.subs(b, 0))),
    ("a1", "unused", p1(A=slope(1))),
    ("a1", "wrong-row", p1(B=sp.Matrix([s, 0]))),
    ("a1", "unused", p1(B=sp.Matrix([0, 1]))),
    ("a1", "superfluous", p1(B=sp.Matrix([0, T * s]))),
    ("a2", "transposed", p2(law=lambda A, p: A.T * p * A)),
    ("a2", "slope-power", p2(law=lambda A, p: A * p)),
    ("a2", "not-symmetric", p2(law=lambda A, p: A * A.T * p)),
    ("a2", "unused", p2(law=lambda A, p: p)),
    ("a2", "noise-power", p2(noise=sp.diag(0, s))),
    ("a2", "noise-sign", p2(noise=-NOISE)),
    ("a2", "not-symmetric", p2(noise=sp.diag(0, s**2 * T))),
    ("a2", "not-symmetric", p2(noise=sp.diag(s**2, s**2))),
    ("a2", "noise-forgotten", p2(noise=sp.zeros(2))),
    ("a2", "not-symmetric", p2(noise=sp.diag(s**2, 0))),
    ("a2", "entry", p2(tau=A * sp.Matrix([z1, z2]))),
    ("a2", "not-symmetric", p2(A=slope(sp.sin(z1)))),
    ("a2", "unused", p2(A=slope(1))),
    ("a2", "state-forgotten", p2(law=lambda A, p: 0 * p)),
    ("a3", "noise-power", p3(noise=sp.diag(r, q))),
    ("a3", "noise-sign", p3(noise=-METER_NOISE)),
    ("a3", "noises-in-another-order", p3(noise=sp.diag(q**2, r**2))),
    ("a3", "noise-forgotten", p3(noise=sp.zeros(2))),
    ("a3", "entry", p3(h=sp.Matrix([sp.cos(m1) * m1, m2]))),
    ("a3", "entry", p3(h=sp.Matrix([m1, m2]))),
    ("a3", "entry", p3(G=sp.diag(-sp.cos(m1), 1))),
    ("a3", "entry", p3(G=sp.diag(sp.sin(m1), 1))),
    ("a3", "unused", p3(G=I2)),
    ("a3", "slope-power", p3(law=lambda G, d: G * d)),
    ("a3", "unused", p3(law=lambda G, d: G * G.T)),
    ("a3", "correlation-forgotten", p3(law=lambda G, d: sp.diag(*(G * d * G.T).diagonal()))),
    ("a3", "swapped", lambda m, d: (p3()(m, d)[0], p3()(m, d)[2], p3()(m, d)[1])),
    ("a4", "linearised not-symmetric", p4(shrink=lambda p: 1)),
    ("a4", "entry not-symmetric", p4(shrink=lambda p: sp.exp(p / 2))),
    ("a4", "entry not-symmetric", p4(shrink=lambda p: sp.exp(-p))),
    ("a4", "linearised", p4(tau_shrink=lambda p: 1)),
    ("a4", "not-symmetric", p4(of_sine=lambda m, d: sp.exp(-d) * sp.cos(m) ** 2 * d)),
    ("a4", "not-symmetric", p4(of_sine=lambda m, d: (1 - sp.cos(2 * m) * sp.exp(-2 * d)) / 2)),
    ("a4", "not-symmetric", p4(of_sine=lambda m, d: (1 - sp.cos(2 * m) * sp.exp(-d)) / 2 - sp.sin(m) ** 2 * sp.exp(-d))),
    ("a4", "not-symmetric", p4(of_sine=lambda m, d: sp.cos(m) ** 2 * d)),
    ("a4", "not-symmetric", p4(noise=sp.diag(0, s))),
    ("a4", "noise-sign", p4(noise=-NOISE)),
    ("a4", "noise-forgotten", p4(noise=sp.zeros(2))),
    ("a4", "correlation-forgotten", p4(cross=False)),
    ("a5", "linearised", p5(shrink=lambda d: 1)),
    ("a5", "entry", p5(shrink=lambda d: sp.exp(d / 2))),
    ("a5", "entry", p5(shrink=lambda d: sp.exp(-d))),
    ("a5", "linearised", p5(slope_shrink=lambda d: 1)),
    ("a5", "entry", p5(of_sine=lambda m, d: sp.exp(-d) * sp.cos(m) ** 2 * d)),
    ("a5", "entry", p5(of_sine=lambda m, d: (1 - sp.cos(2 * m) * sp.exp(-2 * d)) / 2)),
    ("a5", "entry", p5(of_sine=lambda m, d: (1 + sp.cos(2 * m) * sp.exp(-2 * d)) / 2 - sp.sin(m) ** 2 * sp.exp(-d))),
    ("a5", "entry", p5(of_sine=lambda m, d: sp.cos(m) ** 2 * d)),
    ("a5", "noise-not-squared", p5(noise=sp.diag(r, q))),
    ("a5", "noise-sign", p5(noise=-METER_NOISE)),
    ("a5", "noise-forgotten", p5(noise=sp.zeros(2))),
    ("a5", "correlation-forgotten", p5(cross=False)),
    ("a6", "whole-variance", p6(F_minus=lambda F, G, d: F)),
    ("a6", "superfluous", p6(F_minus=lambda F, G, d: F - G * d)),
    ("a6", "superfluous", p6(F_minus=lambda F, G, d: F - G * G.T)),
    ("a6", "superfluous", p6(F_minus=lambda F, G, d: F + G * d * G.T)),
    ("a6", "unused", p6(F_minus=lambda F, G, d: METER_NOISE)),
    ("a6", "entry", p6(F_minus=lambda F, G, d: F - G.T * d * G, slope_shrink=lambda d: 1)),
]
UNUSABLE = [
    ("a1", "expected 2 results", lambda z: c),
    ("a2", "expected 2 results", lambda z, p: c**2 * p + e**2 * z**2),
    ("a3", "expected 3 results", lambda m, d: (g * m, g**2 * d + f**2 * m**4)),
    ("a6", "is `return` missing", lambda m, d: None),
    ("a7", "expected a text", lambda: 3),
    ("a7", "the derivation is empty", lambda: "\n"),
    ("a7", "has no `=`", lambda: "variant 7\nF = M[(y - h)^2]"),
    ("a7", "no chains with `F`", lambda: "G = g"),
    ("a7", "cannot be read at column", lambda: "F = M[(y-h)^2"),
    ("a7", "`x =`, which has a meaning already", lambda: "x = 5\n" + a7("625*f^2")()),
]


@pytest.mark.parametrize(("name", "answer"), RIGHT_OF_PENDULUM)
def test_right_answers_pass_for_a_vector(told, name, answer):
    assert told(name, answer, "21").passed


@pytest.mark.parametrize(("name", "kinds", "answer"), WRONG_OF_PENDULUM)
def test_no_wrong_kind_is_named_for_a_vector(told, name, kinds, answer):
    result = told(name, answer, "21")
    assert result.status == "wrong"
    assert result.diagnosis
    assert set(result.diagnosis) - BY_VALUE <= set(kinds.split()), result
