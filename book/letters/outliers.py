"""The letters of outliers.md: one correction of a plain program, with a weight that has settled."""

from gate.page import CONDITION, NOTATION

doubting = r"""
G: any 2 3
\Psi: cov 3
R: cov 2
h, y: any 2
\lambda: any 3
s = 3.7
m = 2
\nu = y-h
w = 1
again:
K = ((G\Psi G^T+R/w)^{-1}G\Psi)^T
z = \lambda+K\nu
p = \Psi-KG\Psi
r = \nu-G(z-\lambda)
w = (s+m)/(s+r^TR^{-1}r+\operatorname{tr}(R^{-1}GpG^T))
then:
F = G\Psi G^T+R
"""


doubtful = r"""
w = 0.3
\Psi, R: in .5 2
\nu: num
F = \Psi+R/w
p = 1/(1/\Psi+w/R)
K = pw/R
s = \nu/\sqrt F
"""


LETTERS = (doubting, doubtful)
DECLARED = {
    NOTATION: [
        "w=1",
        r"\mathsf P(\nu^TF^{-1}\nu<\gamma)",
        r"\mathsf P\big|_{\gamma=-2\ln(1-\beta)}",
        r"z\,(\text{from } y_1)",
        r"\lim_{R_{22}\to\infty}z\,(\text{from } y_1,y_2)",
        r"\Delta t_k",
        "p(e)",
        r"\mathsf M[u\mid e]",
        r"w\big|_{t>c}",
        r"\frac{d\rho}{dt}",
    ],
    CONDITION: [r"\nu^TF^{-1}\nu>\gamma"],
}
