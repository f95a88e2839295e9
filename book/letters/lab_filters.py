"""The letters of lab-filters.md: three filters on an ensemble as plain programs with NumPy's fits,
and a run of the package's."""

import numpy as np
from gate.page import DEFINITION, NOTATION
from gate.values import Indexed, Of
from gate.worlds import BENT, K_RANGE, extended_run

from kfcourse.symbolic.structure import linearised

STEPS, RUNS = 5, 60


def a(x, v):
    return 0.9 * x + 0.2 * np.sin(x) + 0.3 * v


def b(x, w):
    return x + 0.1 * x**2 + 0.4 * w


def tau(z, p):
    return 0.9 * z + 0.2 * np.sin(z) * np.exp(-p / 2)


def Theta(z, p):
    return (0.9 + 0.2 * np.cos(z)) ** 2 * p + 0.09


def measure(lam, Psi):
    """h, G, F, to the second order."""
    G = 1 + 0.2 * lam
    return lam + 0.1 * (lam**2 + Psi), G, G**2 * Psi + 0.02 * Psi**2 + 0.16


def ensemble(rng):
    x = [rng.normal(size=RUNS)]
    for _ in range(STEPS):
        x.append(a(x[-1], rng.normal(size=RUNS)))
    return x, [b(part, rng.normal(size=RUNS)) for part in x]


def fitted(target, regressor):
    """Slope, offset and the variance left, by NumPy's polynomial fit."""
    slope, offset = np.polyfit(regressor, target, 1)
    return slope, offset, np.var(target - slope * regressor - offset)


def at_k(values):
    return Of(lambda k: values[k], "k")


def covariance(part, other=None):
    return np.cov(part, part if other is None else other, bias=True)[0, 1]


def collected(rows, **more):
    known = {name: Indexed([row[name] for row in rows]) for name in rows[0]}
    return known | {"k": range(1, STEPS - 1)} | more


def two_step(rng):
    """Pugachev's filter."""
    x, y = ensemble(rng)
    lam, rows = np.zeros(RUNS), []
    for k in range(STEPS):
        omega = y[k] - b(lam, 0)
        H, e, _ = fitted(x[k] - lam, omega)
        z = lam + np.polyval([H, e], omega)
        alpha = a(z, 0)
        F, g, _ = fitted(x[k + 1], alpha)
        row = {r"\lambda": lam, r"\omega": omega, "H": H, "e": e, "z": z, "y": y[k]}
        rows.append(row | {r"\alpha": alpha, "F": F, "g": g})
        lam = np.polyval([F, g], alpha)
    return collected(rows, a=a, b=b, m_v=0.0, m_w=0.0)


def optimal_structure(rng):
    """Rudenko's filter, modified: what does without the second fits is the other one."""
    x, y = ensemble(rng)
    lam, Psi, rows = np.zeros(RUNS), np.ones(RUNS), []
    for k in range(STEPS):
        h, G, F = measure(lam, Psi)
        sigma = Psi * G / F * (y[k] - h)
        H, e, _ = fitted(x[k] - lam, sigma)
        z = lam + np.polyval([H, e], sigma)
        Gamma, chi, T = fitted(x[k], z)
        u = np.polyval([Gamma, chi], z)
        s = tau(u, T)
        L, n, _ = fitted(x[k + 1], s)
        row = {r"\lambda": lam, r"\Psi": Psi, r"\sigma": sigma, "H": H, "e": e, "z": z}
        row |= {"h": h, "G": G, "F": F, "L": L, "n": n, r"\Gamma": Gamma, r"\chi": chi}
        before = tau(rows[-1]["u"], rows[-1]["T"]) if rows else s
        rows.append(row | {"u": u, "T": T, "x": x[k], "y": y[k], "s": before})
        lam, Psi = np.polyval([L, n], s), Theta(u, T)
    known = collected(rows)
    functions = {r"\tau": tau, r"\Theta": Theta, r"\mathrm{Cov}": covariance}
    return known | functions | {name: at_k(known[name].values) for name in "hGFLn"}


def plain_prediction(rng):
    """The prediction of the filter of optimal structure, without the second fit."""
    own = optimal_structure(rng)
    u, T = own["u"].values, own["T"].values
    ahead = [tau(*part) for part in zip(u, T, strict=True)]
    return {
        "u": own["u"],
        "T": own["T"],
        r"\tau": tau,
        r"\lambda": Indexed([ahead[0], *ahead]),
        "k": own["k"],
    }


def second_fit(rng):
    """What a line takes off the mean square that is left without one."""
    sigma, noise = rng.normal(size=(2, RUNS))
    error = 0.7 * sigma + 0.3 + noise
    H, _, left = fitted(error, sigma)
    gain = {
        r"J(1,0)-J_{\min}": np.mean((error - sigma) ** 2) - left,
        r"\mathsf D\sigma": covariance(sigma),
        "H": H,
    }
    return gain | {r"\bar\varepsilon": error.mean(), r"\bar\sigma": sigma.mean()}


def optimal(rng):
    """The package's filter with several components."""
    own = extended_run(rng, BENT)
    H, lam, S, structure = own["H"].values, own[r"\lambda"].values, own["S"].plain, linearised(BENT)
    F = [part @ Psi @ part.T + own["D_n"] for part, Psi in zip(H, own[r"\Psi"].values, strict=True)]

    def moved(z, p):
        law = structure.predict(z.T, p[None])
        return law[0].T, law[1].reshape(p.shape)

    functions = {r"\tau": lambda z, p: moved(z, p)[0], r"\Theta": lambda z, p: moved(z, p)[1]}
    h = [S(place) for place in lam]
    return (
        {name: own[name] for name in (r"\lambda", r"\Psi", "K", "z", "p", "y")}
        | functions
        | {"G": at_k(H), "F": at_k(F), "h": at_k(h), "k": K_RANGE}
    )


western = r"""
H: any 2 3
P^-: cov 3
R: cov 2
m^-: any 3
y, \mu: any 2
P = ((P^-)^{-1}+H^TR^{-1}H)^{-1}
K = PH^TR^{-1}
m = P((P^-)^{-1}m^-+H^TR^{-1}(y-\mu+Hm^-))
C = P^-H^T
S = HC+R
F = S
"""


regression = r"""
\lambda, y: num
\Psi: in .5 1
x: nodes \lambda \Psi
b = x+0.1x^2
h = \mathsf Mb
G = \mathsf M(1+0.2x)
C = \mathsf M(x-\lambda)b
F = \mathsf M(b-h)^2+0.16
K = C/F
z = \lambda+K(y-h)
\varepsilon = x-\lambda
keep: C, F, G, h, K, \lambda, \Psi, y, z, \varepsilon, x
"""


linear_meter = r"""
\lambda, g, f, \omega: num
y = \omega+g\lambda
b(x, w) = gx+fw
"""


LETTERS = (
    two_step,
    second_fit,
    optimal_structure,
    plain_prediction,
    optimal,
    western,
    regression,
    linear_meter,
)
SAID = {
    DEFINITION: [
        "x_{k+1}=cx_k+ex_kv_k",
        "y_k=gx_k+fx_k^2w_k",
        r"x_0\sim\mathcal N(m,d)",
        r"\lambda_0=m",
        r"\Psi_0=d",
        r"e_k=\operatorname{line}(x_k-\lambda_k\mid\omega_k)",
        r"g_k=\operatorname{line}(x_{k+1}\mid\alpha_k)",
        r"T_k=\operatorname{line}(x_k\mid z_k)",
        r"e_k=\operatorname{line}(x_k-\lambda_k\mid\sigma_k)",
        r"n=\operatorname{line}(x_{k+1}\mid s_{k+1})",
    ],
    NOTATION: [
        r"\mathsf{M}(x-z)^2",
        r"m^-=\mathrm E f",
        r"P^-=\mathrm{Cov}f+Q",
        r"\mathsf{D}\sigma",
        r"\bar{\sigma}",
        r"\Psi G^T",
        r"\tfrac{1}{2}\,\partial J/\partial{H}_k",
        r"\tfrac{1}{2}\,\partial J/\partial{e}_k",
        r"J(1,0)-J_{\min}",
    ],
}
