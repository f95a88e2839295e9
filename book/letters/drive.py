"""The letters of drive.md: an arc at a constant yaw rate, integrated numerically, and one step of the model by hand."""

import numpy as np
import scipy

from kfcourse.pages.relations import DEFINITION, NOTATION

EAST, NORTH = (rf"\int_0^\Delta V\{function}(\psi+\omega s)\,ds" for function in ("cos", "sin"))


def arc(rng):
    V, psi, omega, Delta = *rng.normal(size=3), rng.uniform(0.5, 1.5)

    def integral(function):
        return scipy.integrate.quad(lambda s: V * function(psi + omega * s), 0, Delta)[0]

    return {
        "V": V, r"\psi": psi, r"\omega": omega, r"\Delta": Delta, "u": omega * Delta / 2,
        EAST: integral(np.cos), NORTH: integral(np.sin),
    }  # fmt: skip


def tunnel(rng):
    """Variances of the place after a straight tunnel: pushes of speed and heading, each carried to the end."""
    V, t, p_V, p_psi, q_V, q_psi = rng.uniform(0.5, 2, 6)
    pushes = scipy.integrate.quad(lambda s: (t - s) ** 2, 0, t)[0]
    return {
        "V": V, "t": t, "p_V": p_V, r"p_\psi": p_psi, "q_V": q_V, r"q_\psi": q_psi,
        r"D_\parallel": t * p_V * t + q_V * pushes, r"D_\perp": V * (t * p_psi * t + q_psi * pushes) * V,
    }  # fmt: skip


LETTERS = (arc, tunnel)
EQUALS = {
    EAST: r"V\Delta\cos(\psi+u)\frac{\sin u}{u}",
    NORTH: r"V\Delta\sin(\psi+u)\frac{\sin u}{u}",
}
SAID = {
    r"e=\rho\cos\varphi_0\,(\ell-\ell_0)": DEFINITION,
    r"n=\rho\,(\varphi-\varphi_0)": DEFINITION,
    "e_{k+1}": NOTATION,
    "n_{k+1}": NOTATION,
    r"\psi_{k+1}": NOTATION,
    "V_{k+1}": NOTATION,
    r"\Delta": NOTATION,
}
