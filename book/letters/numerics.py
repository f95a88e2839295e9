r"""The letters of numerics.md: corrections in information form, and arrays by Cholesky factors."""

from gate.page import DEFINITION, NOTATION

GIVEN = r"""
A: any 3 3
\Psi: cov 3
\lambda: any 3
I: eye 3
p = (\Psi^{-1}+H^TR^{-1}H)^{-1}
K = pH^TR^{-1}
z = p(\Psi^{-1}\lambda+H^TR^{-1}y)
F = H\Psi H^T+R
"""

wrong_gain = r"""
H: any 1 3
R: cov 1
y: any 1
\epsilon = 0.3
\gamma: any 3
"""
wrong_gain += GIVEN

array = r"""
H: any 2 3
R: cov 2
y: any 2
Q: cov 3
"""
array += (
    GIVEN
    + r"""
S = \Psi^{1/2}
W = \begin{pmatrix}R^{1/2}&HS\\0H^T&S\end{pmatrix}
L = (WW^T)^{1/2}
T = W^{-1}L
u = \begin{pmatrix}1&0&0&0&0\\0&1&0&0&0\end{pmatrix}
v = \begin{pmatrix}0&0&1&0&0\\0&0&0&1&0\\0&0&0&0&1\end{pmatrix}
X = uLu^T
Y = vLu^T
Z = vLv^T
S' = (A\Psi A^T+Q)^{1/2}
T' = \begin{pmatrix}AS&Q^{1/2}\end{pmatrix}^TS'^{-T}
forget: W, L, u, v
"""
)

in_words = (
    array
    + r"""
C: any 6 3
E: eye 6
V = (E-T'T'^T)C
T = \begin{pmatrix}T'&V((V^TV)^{1/2})^{-T}\end{pmatrix}
"(AS\;\;Q^{1/2})" = \begin{pmatrix}AS&Q^{1/2}\end{pmatrix}
"(S'\;\;0)" = \begin{pmatrix}S'&0I\end{pmatrix}
keep: (AS\;\;Q^{1/2}), T, (S'\;\;0)
"""
)

LETTERS = (wrong_gain, array, in_words)
_BEFORE = r"\begin{pmatrix}R^{1/2}&HS\\0&S\end{pmatrix}"
_AFTER = r"\begin{pmatrix}X&0\\Y&Z\end{pmatrix}"
_BLOCKS = r"\begin{pmatrix}F&H\Psi\\\Psi H^T&\Psi\end{pmatrix}"
_WRONG = r"(K+\epsilon\gamma)"
DECLARED = {
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
