"""The letters of numerics.md: corrections of the package, and the array."""

import numpy as np
from gate.page import DEFINITION, NOTATION
from gate.worlds import column, covariance

from kfcourse.filters.kalman import correct
from kfcourse.laws import Gaussian
from kfcourse.linear.system import LinearSystem


def _corrected(rng, seen):
    """The letters of one correction by the package's textbook step; K = p H^T R^{-1}, which it does
    not compute with."""
    Psi, H, R, A = (
        covariance(rng, 3),
        rng.normal(size=(seen, 3)),
        covariance(rng, seen),
        rng.normal(size=(3, 3)),
    )
    y, lam = rng.normal(size=seen), rng.normal(size=3)
    z, p = correct(LinearSystem(A, H, np.eye(3), R), Gaussian(lam, Psi), y)
    return {
        r"\Psi": Psi,
        "H": H,
        "R": R,
        "A": A,
        "I": np.eye(3),
        "p": p,
        "K": p @ H.T @ np.linalg.inv(R),
        r"\lambda": column(lam),
        "z": column(z),
        "y": column(y),
    }


def wrong_gain(rng):
    known = _corrected(rng, 1)
    return known | {
        r"\epsilon": 0.3,
        r"\gamma": rng.normal(size=(3, 1)),
        "F": known["H"] @ known[r"\Psi"] @ known["H"].T + known["R"],
    }


def array(rng):
    """The orthogonal matrix by NumPy's QR decomposition, for the correction and for the
    prediction."""
    known = _corrected(rng, 2)
    S, Q = np.linalg.cholesky(known[r"\Psi"]), covariance(rng, 3)
    wide = np.block([[np.linalg.cholesky(known["R"]), known["H"] @ S], [np.zeros((3, 2)), S]])
    T, right = np.linalg.qr(wide.T)
    ahead = np.hstack([known["A"] @ S, np.linalg.cholesky(Q)])
    turned, root = np.linalg.qr(ahead.T)
    return known | {
        "S": S,
        "Q": Q,
        "T": T,
        "X": right.T[:2, :2],
        "Y": right.T[2:, :2],
        "Z": right.T[2:, 2:],
        "S'": root.T,
        "T'": turned,
        "F": np.linalg.solve(np.eye(2) - known["H"] @ known["K"], known["R"]),
    }


def in_words(rng):
    """The prediction's root in the words of the text."""
    own = array(rng)
    wide = np.hstack([own["A"] @ own["S"], np.linalg.cholesky(own["Q"])])
    return {
        r"(AS\;\;Q^{1/2})": wide,
        "T": np.linalg.qr(wide.T, mode="complete")[0],
        r"(S'\;\;0)": np.hstack([own["S'"], np.zeros((3, 3))]),
    }


LETTERS = (wrong_gain, array, in_words)
_BEFORE = r"\begin{pmatrix}R^{1/2}&HS\\0&S\end{pmatrix}"
_AFTER = r"\begin{pmatrix}X&0\\Y&Z\end{pmatrix}"
_BLOCKS = r"\begin{pmatrix}F&H\Psi\\\Psi H^T&\Psi\end{pmatrix}"
_WRONG = r"(K+\epsilon\gamma)"
SAID = {
    DEFINITION: [
        r"x_{k+1}=\begin{pmatrix}1&\Delta&\Delta^2/2\\0&1&\Delta\\0&0&1\end{pmatrix}x_k"
        r"+\begin{pmatrix}0\\0\\1\end{pmatrix}v_k",
        r"y_k=\begin{pmatrix}1&0&0\end{pmatrix}x_k+w_k",
    ],
    "a condition": ["R>0"],
    NOTATION: [r"p_{\rm Joseph}", r"p_{\rm textbook}", r"\det p/\det\Psi"],
}
EQUALS = {
    _BEFORE: f"{_AFTER}T^T",
    r"\begin{pmatrix}AS&Q^{1/2}\end{pmatrix}": "S'T'^T",
    r"p-\epsilon\,\gamma H\Psi": rf"(I-{_WRONG}H)\Psi",
    r"p+\epsilon^2F\,\gamma\gamma^T": rf"(I-{_WRONG}H)\Psi(I-{_WRONG}H)^T+{_WRONG}R{_WRONG}^T",
    f"{_BEFORE}{_BEFORE}^T": _BLOCKS,
    _BLOCKS: f"{_AFTER}{_AFTER}^T",
    "YX^{-1}": "K",
    "ZZ^T": r"(I-KH)\Psi",
    r"(I-KH)\Psi": "p",
}
