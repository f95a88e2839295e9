"""Relations are read as TeX prints them, and computed; a changed letter, sign, index or
transposition is found."""

import numpy as np
import pytest
import sympy as sp
from gate import shared
from gate.relation import holds
from gate.tex import is_relation, normal, pieces
from gate.values import Indexed, Of, Unread
from gate.worlds import world
from numpy.testing import assert_allclose

from kfcourse import Gaussian, Model, linearised
from kfcourse.filters import aof
from kfcourse.filters.kalman import correct, predict
from kfcourse.linear import LinearSystem
from kfcourse.pages import Unverified

RUN = world(
    shared.KALMAN + "\nk: range 1 4\nz = z_2\nK = K_2\n\\lambda = \\lambda_2\n\\nu = \\nu_2"
)(np.random.default_rng(1))
MASSES = np.array([0.2, 0.3, 0.5])
CHAIN = {
    "i": range(3),
    "j": range(3),
    r"\mu": Indexed(MASSES),
    "x": Indexed([1.0, 2.0, 4.0]),
    "z": 2.8,
    "p": 1.56,
    "n": 2,
    "P": Indexed(np.arange(9.0).reshape(3, 3)),
    "m": Indexed(np.arange(9.0).reshape(3, 3).T @ MASSES),
}


def test_what_tex_prints_alike_is_alike():
    assert normal(r"\bigl( K_{k}\,\dfrac 12\mid x \bigr)") == normal(r"(K_k\tfrac{1}{2}|x)")
    assert normal(r"D_{n}") != normal(r"D_m")


def test_a_display_is_taken_apart():
    display = (
        r"\begin{aligned} a&=f(b,c), & d&=\begin{pmatrix}1&2\\3&4\end{pmatrix},\\ e&\le "
        r"g\text{ and so on}.\end{aligned}"
    )
    parts = pieces(display)
    assert parts[0] == normal("a=f(b,c)")
    assert len(parts) == 3 and all(map(is_relation, parts))
    assert not is_relation(normal(r"\sum_{i=1}^n x_i")) and is_relation(
        normal(r"x\sim\mathcal N(0,1)")
    )


@pytest.mark.parametrize(
    "right",
    [
        r"K_k=\Psi_kH^T(H\Psi_kH^T+R)^{-1}",
        r"p_k=(I-K_kH)\Psi_k(I-K_kH)^T+K_kRK_k^T",
        r"\Psi_{k+1}=Ap_kA^T+Q",
        r"p_k^{-1}=\Psi_k^{-1}+H^TR^{-1}H",
        r"z=\lambda+K\nu",
        r"\begin{pmatrix}R&0\\0&Q\end{pmatrix}\begin{pmatrix}\nu\\z\end{pmatrix}=\begin{pmatrix}R\nu\\Qz\end{pmatrix}",
    ],
)
def test_relations_of_matrices_hold_and_changed_ones_do_not(right: str):
    holds(right, RUN)
    wrong = [
        right.replace(*text, 1)
        for text in (("^T", ""), ("+", "-"), ("-K", "+K"), ("K_k", "K_{k+1}"), ("=", "=2"))
    ]
    for text in wrong:
        if text != right:
            with pytest.raises((Unverified, Unread)):
                holds(text, RUN)


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        (r"z=\sum_jx_j\mu_j", r"z=\sum_jx_jP_{ij}"),
        (r"p=\sum_i(x_i-z)^2\mu_i", r"p=\sum_i(x_i+z)^2\mu_i"),
        (r"z=\sum \mu_jx_j", r"z=\sum \mu_j"),
        (r"m_j=\sum_iP_{ij}\mu_i", r"m_j=\sum_iP_{ji}\mu_i"),
        (r"z=\sum_{i=0}^nx_i\mu_i", r"z=\sum_{i=1}^nx_i\mu_i"),
        (r"\prod_{i=0}^n\mu_i=0.03", r"\prod_{i=1}^n\mu_i=0.03"),
        (r"P_{ij}\propto2P_{ij}+P_{ij}", r"P_{ij}\propto P_{ij}+z"),
        (r"\int_0^{\pi}\sin t\,dt=2", r"\int_0^{\pi}\cos t\,dt=2"),
        (r"\int\mathcal N(t;z,p)t\,dt=z", r"\int\mathcal N(t;z,p)t\,dt=p"),
        (r"\frac12z+\tfrac12|-z|=\sqrt{z^2}", r"\frac12z+\tfrac12|-z|=\sqrt{2z^2}"),
        (r"\frac pz/2=\frac{p}{2z}", r"\frac pz/2=\frac{2p}{z}"),
        (r"z\ge p>0", r"z\le p"),
    ],
)
def test_numbers_sums_and_integrals(right: str, wrong: str):
    holds(right, CHAIN)
    with pytest.raises((Unverified, Unread)):
        holds(wrong, CHAIN)


def test_letters_of_any_length_functions_and_what_depends_on_variables():
    letters = {
        **{
            r"p(x\mid y)": Of(lambda x, y: x * y, "x", "y"),
            "x": 2.0,
            "y": 3.0,
            r"\frac{\partial S}{\partial x}": 5.0,
        },
        **{
            "a": lambda x, v: x + v,
            "z": 1.0,
            r"z\leftarrow": 7.0,
            r"\mathsf M": lambda values: np.mean(values),
        },
        **{
            r"\hat x": Indexed(lambda at, until: [1.0, 2.0, 3.0, 4.0][at + 2 * (at == until)]),
            "k": range(1, 2),
        },
    }
    right = (
        r"p(x\mid y)=6; \frac{\partial S}{\partial x}x=10; a^2(x,y)=25; z\leftarrow z+2y; "
        r"\mathsf M(x-y)^2=1"
    )
    for text in (*right.split("; "), r"\hat x_{k\mid k-1}=2", r"\hat x_{k\mid k}=4"):
        holds(text, letters)
    for wrong in (r"p(y\mid x)=6", "S'=1", r"z\leftarrow z+y", r"x\leftarrow 2"):
        with pytest.raises((Unverified, Unread)):
            holds(wrong, letters)


def test_the_linear_run_is_that_of_the_package():
    system = LinearSystem(*(RUN[name] for name in "AHQR"))
    law = Gaussian(RUN[r"\lambda"][0,].ravel(), RUN[r"\Psi"][0,])
    for k in range(4):
        law = correct(system, law, RUN["y"][k,].ravel())
        assert_allclose(RUN["z"][k,].ravel(), law.mean)
        assert_allclose(RUN["p"][k,], law.cov)
        law = predict(system, law)


def test_the_extended_run_is_that_of_the_package():
    run = world(shared.EXTENDED)(np.random.default_rng(2))
    x, v, w = (np.array(sp.symbols(names))[:, None] for names in ("x1:4", "v1:3", "w1:3"))
    motion = run["M"] @ x + run["a"] * (x.T @ x) / 9
    meter = run["b"] + run["E"] @ x + run["b"] * (x.T @ x) / 9
    noisy = motion + run["g"] @ np.linalg.cholesky(run[r"D_\xi"]) @ v
    seen = meter + np.linalg.cholesky(run["D_n"]) @ w
    model = Model.define(
        *([str(row) for row in side.ravel()] for side in (noisy, seen)),
        symbols={"x": ["x1", "x2", "x3"]},
        prior={"mean": run[r"\lambda"][0,].ravel(), "variance": run[r"\Psi"][0,]},
    )
    ekf = aof(linearised(model))
    state = ekf.init(1)
    for k in range(4):
        state = ekf.step(state, run["y"][k,].T)
        assert_allclose(run["z"][k,].T, state.posterior.mean)
        assert_allclose(run["p"][k,], state.posterior.cov.reshape(3, 3))


def test_a_world_is_made_of_definitions():
    letters = world(r"""
        A, Q: cov 2
        k: range 4
        \Psi_0 = Q                          # a letter of its own
        P = Q
        again:
        P = (P^{-1} + Q)^{-1}/2 + Q
        then:
        R = P - Q
        f(x) = x^2 + 1
        m: range 3
        \mu: share 3
        c_{mk} = f(k)\mu_m
        x: nodes 0.5 2
        s = \mathsf M(x - 0.5)^2
        keep: P, Q, R, c, f, s, k, m
    """)(np.random.default_rng(1))
    assert set(letters) == {"P", "Q", "R", "c", "f", "s", "k", "m"}
    holds(r"R=\tfrac12(P^{-1}+Q)^{-1}", letters)  # it has come to rest
    holds(r"\sum_mc_{mk}=k^2+1", letters)
    holds("s=2", letters)
