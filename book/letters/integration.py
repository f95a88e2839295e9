"""The letters of integration.md: runs of the package's filter of an axis, its Western form with
matrices, the accelerometer."""

import numpy as np
from gate.page import CONDITION, DEFINITION, NOTATION
from gate.values import Indexed, Of
from gate.worlds import K_RANGE, column, covariance

from kfcourse.filters.kalman import correct, predict
from kfcourse.laws import Gaussian
from kfcourse.linear import LinearSystem

SENSOR, RADIO = r"y_{\mathrm{NR},k}", r"y_{\mathrm R,k}"


def sensors(rng):
    """What the two sensors read, and the error that the slow one has."""
    lam, eps, n = rng.normal(size=(3, 5))
    S = [np.sin, np.cos, np.exp, np.tanh, np.cosh]
    slow, radio = (
        lam + eps,
        [one(value) + noise for one, value, noise in zip(S, lam, n, strict=True)],
    )
    y, at = rng.normal(size=2)
    step = 1e-20
    return {
        r"\lambda": Indexed(lam, at),
        r"\varepsilon": Indexed(eps),
        "n": Indexed(n),
        "S": Indexed(S),
        "k": K_RANGE,
        SENSOR: Of(lambda k: slow[k], "k"),
        RADIO: Of(lambda k: radio[k], "k"),
        "S'": np.cos,
        r"\frac{d}{d\varepsilon}S(y_{\mathrm{NR}}-\varepsilon)": np.sin(
            y - (y - at + 1j * step)
        ).imag
        / step,
    }


axis = r"""
\sigma_\xi = 0.3
\sigma_n = 0.7
V, n, \varepsilon: nums 6
"y_{\mathrm{SR},k}" of k = V_k+n_k
"y_{\mathrm{INS},k}" of k = V_k+\varepsilon_k
k: range 5
\Psi_0 = 1.4
e_0 = 0
\nu_k = n_k-\varepsilon_k+e_k
K_k = -\Psi_k/(\Psi_k+\sigma_n^2)
p_k = 1/(1/\Psi_k+1/\sigma_n^2)
\hat\varepsilon_k = e_k+K_k\nu_k
\hat V_k = V_k+\varepsilon_k-\hat\varepsilon_k
\Psi_{k+1} = p_k+\sigma_\xi^2
e_{k+1} = \hat\varepsilon_k
k: range 1 4
forget: e
"""


errors = r"""
V, n, \varepsilon, \hat\varepsilon: num
\hat V = V+\varepsilon-\hat\varepsilon
y_{\mathrm{SR}} = V+n
y_{\mathrm{INS}} = V+\varepsilon
"""


def western(rng, after=True):
    """Three axes together, as Western books write it."""
    system = LinearSystem(np.eye(3), -np.eye(3), covariance(rng, 3), covariance(rng, 3))
    P, before = covariance(rng, 3), rng.normal(size=3)
    ahead = predict(system, Gaussian(before, P))
    gnss, ins = rng.normal(size=(2, 3))
    found = correct(system, ahead, gnss - ins)
    K = -found.cov @ np.linalg.inv(system.R)
    return {
        "P^-": ahead.cov,
        "P": found.cov if after else P,
        "Q": system.Q,
        "R": system.R,
        "H": system.H,
        "I": np.eye(3),
        "K": K,
        r"\delta z": column(gnss - ins),
        r"\delta\hat x^-": column(ahead.mean),
        r"\delta\hat x": column(found.mean),
        r"(\cdot)": column(gnss - ins + ahead.mean),
        r"z_\text{GNSS}": column(gnss),
        r"z_\text{INS}": column(ins),
        r"\hat v": column(ins - found.mean),
        r"v_\text{INS}": column(ins),
        r"\delta\hat v": column(found.mean),
    }


def western_before(rng):
    return western(rng, after=False)


def together(rng):
    """Three axes with one matrix."""
    noise, drift, p = 0.7, 0.3, covariance(rng, 3)
    found = {r"\Psi": [], "K": [], "p": []}
    for _ in range(5):
        before = p + drift**2 * np.eye(3) if found["p"] else p
        p = np.linalg.inv(np.linalg.inv(before) + np.eye(3) / noise**2)
        for name, value in zip(found, (before, -p / noise**2, p), strict=True):
            found[name].append(value)
    letters = {name: Indexed(values) for name, values in found.items()}
    return letters | {r"\sigma_n": noise, r"\sigma_\xi": drift, "I": np.eye(3), "k": K_RANGE}


settled = r"""
\sigma_\xi, \sigma_n: pos
\Psi = 1
again:
\Psi = 1/(1/\Psi+1/\sigma_n^2)+\sigma_\xi^2
then:
p = \Psi-\sigma_\xi^2
"""


def stepping(rng):
    """The motion between two readings, by a fine sum."""
    T, s, V, eps, r = rng.uniform(0.5, 1, 5)
    t = T / 2**12 * (np.arange(2**12) + 0.5)
    return {
        "T_a": T,
        "s": s,
        "V": V,
        r"\varepsilon": eps,
        r"y_{\mathrm{NR}}": r,
        "s_k": s + np.mean(V + t * (r - eps)) * T,
        "V_k": V + T * r - T * eps,
        r"\varepsilon_k": eps,
    }


accelerometer = r"""
T_a: in .5 1
N = \begin{pmatrix}0&1&0\\0&0&-1\\0&0&0\end{pmatrix}
I: eye 3
A = I+T_aN+T_a^2N^2/2
H = \begin{pmatrix}1&0&0\end{pmatrix}
keep: A, H, T_a
"""


slow_drift = r"""
\sigma_\xi: in 1e-10 2e-10
\sigma_n: in 1 2
p = \sigma_\xi(\sqrt{\sigma_\xi^2+4\sigma_n^2}-\sigma_\xi)/2
"\lim_{\sigma_\xi\to0}" = 1
"""


complementary = r"""
\kappa = 0.4
\sigma_\xi = 0.7
\sigma_n = 1.3
\mathsf De = 1
again:
\mathsf De = (1-\kappa)^2(\mathsf De+\sigma_\xi^2)+\kappa^2\sigma_n^2
then:
"""


best_border = r"""
\sigma_n: in 1 2
s: in .05 .1
\sigma_\xi = s\sigma_n
\kappa = s(\sqrt{s^2+4}-s)/2      # of the steady Kalman filter, for a drift that is slow
\mathsf De = 1
again:
\mathsf De = (1-\kappa)^2(\mathsf De+\sigma_\xi^2)+\kappa^2\sigma_n^2
then:
keep: \kappa, \sigma_\xi, \sigma_n, \mathsf De
"""


low_pass = r"""
\kappa: in .3 .6
V, n, \xi: nums 6
k: range 5
\varepsilon_0 = \xi_5
s_0 = 0
\varepsilon_{k+1} = \varepsilon_k+\xi_k
s_{k+1} = (1-\kappa)s_k+\kappa(n_{k+1}-\varepsilon_{k+1})
e_k = \varepsilon_k+s_k
k: range 1 4
keep: V, n, \varepsilon, \xi, \kappa, e, k
"""


two_filters = r"""
V, n, \varepsilon, \mathcal F, \mathcal G: num
\hat V = \mathcal F(V+\varepsilon)+\mathcal G(V+n)
y_{\mathrm{INS}} = V+\varepsilon
y_{\mathrm{SR}} = V+n
"""


def lecture(rng):
    """The general gain, and the lecture's."""
    own = western(rng)
    law = {
        "G": own["H"],
        r"\Psi": own["P^-"],
        "p": own["P"],
        "F": own["P^-"] + own["R"],
        "K": own["P^-"] @ own["H"].T,
    }
    K = np.linalg.solve(law["F"], law["K"].T).T
    return law | {"K": K, r"\tilde D": own["P^-"], "D": own["P"], "D_n": own["R"], "I": np.eye(3)}


LETTERS = (
    complementary,
    slow_drift,
    sensors,
    axis,
    errors,
    western,
    western_before,
    accelerometer,
    best_border,
    low_pass,
    two_filters,
    together,
    settled,
    stepping,
    lecture,
)
SAID = {
    DEFINITION: [
        r"x_k=f(x_{k-1},\,y_{\mathrm{NR},k-1}-\varepsilon_{k-1})+g\,\xi_{k-1}",
        r"\varepsilon_k=\varepsilon_{k-1}+\zeta_{k-1}",
        r"\varepsilon_k=\varepsilon_{k-1}+\xi_{k-1}",
    ],
    NOTATION: ["p", r"\frac{d}{d\kappa}\mathsf De", r"\mathsf De"],
    CONDITION: [r"\mathcal F+\mathcal G=1", r"\mathcal F=1-\mathcal G"],
}
EQUALS = {
    r"\sqrt{\sigma_n/\sigma_\xi}": r"\sigma_n/\sqrt p",
    r"{\lim_{\sigma_\xi\to0}p/\sigma_\xi}": r"\sigma_n",
    r"\delta z-H\,\delta\hat x^-": r"(\cdot)",
    r"\det\begin{pmatrix}H\\HA\\HA^2\end{pmatrix}": "-T_a^3",
}
