"""The letters of discriminator.md: a loop with several components in the gain form, and the
characteristic of a carrier."""

import numpy as np
from gate.page import DEFINITION, NOTATION
from gate.values import Indexed, Of
from gate.worlds import K_RANGE, column, covariance, given, slope

C = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


def S(phi):
    return np.array([[phi[0, 0] + 0.2 * phi[1, 0] ** 2], [phi[0, 0] * phi[1, 0] + phi[1, 0]]])


def f(x):
    return np.array(
        [[x[0, 0] + 0.3 * x[1, 0]], [0.9 * x[1, 0] + 0.1 * x[2, 0] ** 2], [x[2, 0] - 0.2 * x[0, 0]]]
    )


def run(rng):
    """Rows of the gain form; u from the correction that it makes."""
    law, Psi, D_n, D_xi, g = (
        column(rng.normal(size=3)) / 2,
        covariance(rng, 3) / 4,
        covariance(rng, 2),
        covariance(rng, 2),
        rng.normal(size=(3, 2)),
    )
    names = (r"\lambda", r"\Psi", "y", "z", "p", "u", "S", "slope", r"\Phi")
    rows = {name: [] for name in names}
    for _ in range(5):
        y, at = column(rng.normal(size=2)), slope(S, C @ law)
        H = at @ C
        K = Psi @ H.T @ np.linalg.inv(H @ Psi @ H.T + D_n)
        z, p = law + K @ (y - S(C @ law)), (np.eye(3) - K @ H) @ Psi
        u = np.linalg.lstsq(p @ C.T, z - law, rcond=None)[0]
        for name, value in zip(
            names, (law, Psi, y, z, p, u, S(C @ law), at, slope(f, z)), strict=True
        ):
            rows[name].append(value)
        law, Psi = f(z), slope(f, z) @ p @ slope(f, z).T + g @ D_xi @ g.T
    letters = {name: Indexed(values) for name, values in rows.items() if name != "slope"}
    slopes = Of(lambda k: rows["slope"][k], "k")
    extra = {
        "c": C,
        "D_n": D_n,
        r"D_\xi": D_xi,
        "g": g,
        "f": f,
        "k": K_RANGE,
        r"\Phi": Of(lambda k: rows[r"\Phi"][k], "k"),
    }
    return (
        letters
        | extra
        | {"S_k'": slopes, r"\frac{\partial S_k(c\lambda_k)}{\partial\varphi}": slopes}
    )


def display(rng):
    return run(rng) | {"S": Indexed([S] * 5)}


def western(rng):
    own = run(rng)
    return {
        r"\hat x": given(own[r"\lambda"], own["z"]),
        "P": given(own[r"\Psi"], own["p"]),
        "c": C,
        "u": own["u"],
        "k": own["k"],
    }


carrier = r"""
A, D_n, T, \lambda, \Delta, p_{\varphi\varphi}: pos
U(x) = \int_0^{2\pi}A\sin(t)A(\cos(t)-\cos(t+x))dt/(2\pi D_n)
U_{\max} = U(\pi/2)
\Delta f_{\max} = U_{\max}p_{\varphi\varphi}/T/(2\pi)
"u" of \theta = A\sin(\theta+\lambda)A(\cos(\theta+\lambda)-\cos(\theta+\lambda+\Delta))/D_n
\mathsf M(x) = x
forget: \lambda
"""


drifting = r"""
p_{\varphi\varphi}, p_{\nu\varphi}: in .1 .3
a: in .02 .06
T = 0.7
U(x) = 0.8\sin x
\Delta = 0
\delta = 0
again:
u = U(\Delta)
\Delta = \Delta-p_{\varphi\varphi}u+T(\delta-p_{\nu\varphi}u)
\delta = \delta-p_{\nu\varphi}u+aT
then:
keep: p_{\varphi\varphi}, p_{\nu\varphi}, U, \Delta, \delta, a, T
"""


def log_likelihood(rng):
    """Its slopes by complex steps, by the state and by what enters the signal."""
    x, y, D_n = rng.normal(size=(3, 1)), rng.normal(size=(2, 1)), covariance(rng, 2)

    def L(phi):
        return -(y - S(phi)).T @ np.linalg.solve(D_n, y - S(phi)) / 2

    slopes = {
        r"\frac{\partial L}{\partial\varphi}": slope(L, C @ x),
        r"\frac{\partial L}{\partial x}": slope(lambda x: L(C @ x), x),
        r"\frac{\partial S}{\partial\varphi}": slope(S, C @ x),
    }
    known = {"L": L, r"\varphi": C @ x, "c": C, "x": x}
    return slopes | known | {"D_n": D_n, "y": y, "S": S(C @ x)}


products = r"""
a, \Delta: num
"""


LETTERS = (run, display, western, carrier, drifting, log_likelihood, products)
SAID = {
    DEFINITION: [
        r"\varphi_{k+1}=\varphi_k+T\nu_k+s_\varphi v_{1,k}",
        r"\nu_{k+1}=\nu_k+s_\nu v_{2,k}",
        r"y_k=A\cos\Bigl(\frac{2\pi k}N+\varphi_k\Bigr)+\sigma w_k",
    ],
    NOTATION: [
        r"\mathsf D[u]_\text{carrier}",
        r"\frac{d\,\mathsf M[u]}{d\Delta}\Big|_0",
        r"\mathsf D[u]",
        r"-\mathsf M\frac{\partial u}{\partial\varphi}",
        r"\mathsf M[u]",
        "p_kc^T",
    ],
}
