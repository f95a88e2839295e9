"""The letters of looking-back.md: a run of the package's linear filter, and its smoother by one
regression on all of it."""

import numpy as np
from gate.page import NOTATION
from gate.values import Indexed, Of
from gate.worlds import K_RANGE, column, covariance

from kfcourse.laws import Gaussian
from kfcourse.linear import LinearSystem, run, smooth

STEPS, STATES, SEEN = 6, 3, 2


def _record(rng):
    A, H = rng.normal(size=(STATES, STATES)), rng.normal(size=(SEEN, STATES))
    system = LinearSystem(A, H, covariance(rng, STATES), covariance(rng, SEEN))
    prior, y = (
        Gaussian(rng.normal(size=STATES), covariance(rng, STATES)),
        rng.normal(size=(STEPS, 1, SEEN)),
    )
    laws = run(system, prior, y)
    back = smooth(system, laws)
    letters = {
        "z": _columns(laws.posterior.mean),
        "p": Indexed(laws.posterior.cov[:, 0]),
        r"\bar z": _columns(back.mean),
        r"\bar p": Indexed(back.cov[:, 0]),
        "I": np.eye(STATES),
        "k": K_RANGE,
    }
    return system, y, laws, letters


def _columns(means):
    return Indexed([column(mean) for mean in means[:, 0]])


def course(rng):
    system, _, laws, letters = _record(rng)
    p, Psi = laws.posterior.cov[:, 0], laws.predicted.cov[:, 0]
    return letters | {
        r"\lambda": _columns(laws.predicted.mean),
        r"\Psi": Indexed(Psi),
        "S": Indexed([np.linalg.solve(Psi[k + 1], system.A @ p[k]).T for k in range(STEPS - 1)]),
        "A": Indexed([system.A] * STEPS, system.A),
        r"\mathrm{Cov}(x_k,x_{k+1})": Of(lambda k: (system.A @ p[k]).T, "k"),
        "Q": Indexed([system.Q] * STEPS),
    }


def meeting(rng):
    """The information about x_k by one regression: of all that is measured from the first step on,
    with its whole covariance."""
    system, y, _, letters = _record(rng)
    A, H, Q, R = system.A, system.H, system.Q, system.R

    def of_later(first, k):
        reach = np.arange(first - k, STEPS - k)
        powers = [np.linalg.matrix_power(A, j) for j in range(STEPS)]

        def rows(since):  # what the stacked measurements see of the state `since` steps after x_k
            return np.vstack(
                [
                    np.empty((0, STATES)),
                    *(H @ powers[j - since] if j >= since else 0 * H for j in reach),
                ]
            )

        noise = np.kron(np.eye(len(reach)), R) + sum(
            rows(i) @ Q @ rows(i).T for i in range(1, STEPS)
        )
        weighed = rows(0).T @ np.linalg.inv(noise)
        return weighed @ rows(0), weighed @ column(y[first:])

    later, own = ([of_later(k + shift, k) for k in range(STEPS)] for shift in (1, 0))
    information = {
        "J": Indexed([J for J, _ in later]),
        r"\eta": Indexed([eta for _, eta in later]),
        r"\tilde J": Indexed([J for J, _ in own]),
        r"\tilde\eta": Indexed([eta for _, eta in own]),
    }
    return letters | information | {"A": A, "H": H, "Q": Q, "R": R, "y": _columns(y)}


walk = r"""
Q, R: pos
\Psi = Q
again:
\Psi = Q+1/(1/\Psi+1/R)
then:
p = \Psi-Q
S = p/\Psi
\bar p = p
again:
\bar p = p+S^2(\bar p-\Psi)
then:
"""


slow_walk = r"""
Q: in .0005 .002
R: in 1 2
\Psi = Q
again:
\Psi = Q+1/(1/\Psi+1/R)
then:
p = \Psi-Q
"""


one_component = r"""
A, Q, s: pos
k: range 1
p_k = s
\Psi_k = s
\Psi_{k+1} = (A\sqrt s)^2+Q
keep: A, Q, p, \Psi, k
"""


LETTERS = (course, meeting, walk, slow_walk, one_component)
SAID = {
    NOTATION: [
        r"\bar z=z",
        r"\bar p=p",
        r"\frac{\partial\mathcal N(x;z,p)}{\partial z}",
        r"\mathcal N(x;z,p)",
        r"\Delta t",
        "J_k",
        r"\tilde J_{k+1}",
        r"\tilde\eta_{k+1}",
        r"\eta_k",
    ],
}
