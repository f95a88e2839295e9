r"""The letters of live-track.md: the filter of an axis, settled on a constant acceleration."""

from gate.page import NOTATION

settled = r"""
a: in 1 3
\sigma, \sigma_a, \Delta: in .5 2
I: eye 2
A = \begin{pmatrix}1&\Delta\\0&1\end{pmatrix}
B = \begin{pmatrix}\Delta^2/2\\\Delta\end{pmatrix}
H = \begin{pmatrix}1&0\end{pmatrix}
P = I
again:
p = (P^{-1}+H^TH/\sigma^2)^{-1}
P = ApA^T+\sigma_a^2BB^T
then:
K = pH^T/\sigma^2
e = Ba
again:
e = (I-KH)(Ae+Ba)
then:
\nu = H(Ae+Ba)
F = HPH^T+\sigma^2
\alpha = HK
\beta = \Delta\begin{pmatrix}0&1\end{pmatrix}K
keep: a, \sigma, \sigma_a, \Delta, \nu, F, \alpha, \beta
"""


LETTERS = (settled,)
DECLARED = {
    NOTATION: [
        r"\int_0^\infty e^{-st}\,w\,dt",
        r"\int_0^\infty w\,dt",
        r"\int_0^\infty t\,w\,dt",
        r"\dot w\left(\tfrac{3\pi}{4a}\right)",
        r"w\left(\tfrac{3\pi}{4a}\right)/w(0)",
    ],
}
