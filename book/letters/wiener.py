"""The letters of wiener.md: spectra as sums over correlations, least squares for the
amplitude."""

from gate.page import DEFINITION, NOTATION

signal = r"""
a: in .5 .8
Q, R: in 1 2
\zeta = 1.1               # where the sum of the correlations converges, too
"S_x(\zeta)" = Q/(1-a^2)(1+\sum_{i=1}^{400}a^i(\zeta^i+\zeta^{-i}))
"S_y(\zeta)" = S_x(\zeta)+R
\Psi = Q
again:
\Psi = Q+a^2/(1/\Psi+1/R)
then:
K = \Psi/(\Psi+R)
\gamma = a(1-K)
\rho = \Psi+R
z, y_k: num
z\leftarrow = az+K(y_k-az)
keep: a, Q, R, \zeta, S_x(\zeta), S_y(\zeta), K, \gamma, \rho, \Psi, z, y_k, z\leftarrow
"""


amplitude = r"""
s, y: list 4 num
R = 0.7
d = 1.9
b = 0.6
C = \sum_{i=0}^3s_iy_i
E = \sum_{i=0}^3s_i^2
p = 1/(1/d+E/R)
z = pC/R
\mathcal L(b) = \prod_{i=0}^3\mathcal N(y_i;bs_i,R)
i: range 4
keep: C, E, R, d, z, p, b, \mathcal L, i, s, y
"""


correlator = r"""
n = 3
s: list 4 num
y: list 9 num
i: range 4
k: range 3 9
C_k = \sum_is_iy_{k-3+i}
\hat b_k = C_k/\sum_is_i^2
"""


weights = r"""
g, s: list 4 num
k: range 4
c = \sum_{k=0}^3g_ks_k/\sum_{k=0}^3s_k^2
k: range 4
"""


one_sample = r"""
p, R: in .5 2
z, s, y: num
K = ps/(s^2p+R)
z' = z+K(y-sz)
p' = p-Kps
"""


LETTERS = (signal, amplitude, correlator, weights, one_sample)
DECLARED = {
    DEFINITION: [r"\zeta=e^{i\theta}", "x_{k+1}=ax_k+v_k", "y_k=x_k+w_k", r"y_k=b\,s_k+w_k"],
    "quoted from Van Trees": [
        r"W(\zeta)=\frac{1-a\zeta^{-1}}{\rho\,(1-\gamma\zeta^{-1})}\left[\frac{Q}{(1-a\zeta^{-1})(1-\gamma\zeta)}\right]_+"
    ],
    "proved below": [
        r"\frac{b^2\left(\sum g_ks_k\right)^2}{R\sum g_k^2}\;\le\;\frac{b^2}{R}\sum s_k^2"
    ],
    "a condition": [r"|\gamma|<1"],
    NOTATION: [r"W(\zeta)", "|D|^2", "|C|^2"],
    "a setting": [r"\delta^2=13"],
}
EQUALS = {
    r"C_k/\sum s_i^2": r"\hat b_k",
}
