"""The letters of four-sensors.md: the package's covariance analysis, and its filter along a constant
bias."""

from gate.page import DEFINITION, NOTATION

analysis = r"""
\sigma_\xi, \sigma_n, \beta: in .3 1
k: range 5
P_0 = 1.5            # the filter believes in twice the drift
S_0 = 1.5
u_0 = 0
K_k = -P_k/(P_k+\sigma_n^2)
P_{k+1} = 1/(1/P_k+1/\sigma_n^2)+4\sigma_\xi^2
\bar p_k = (1+K_k)^2S_k+K_k^2\sigma_n^2
S_{k+1} = \bar p_k+\sigma_\xi^2
m_k = -u_k-K_k(\beta+u_k)
u_{k+1} = -m_k
k: range 1 4
keep: \bar p, K, m, k, \sigma_\xi, \sigma_n, \beta
"""


slow_drift = r"""
x = 0.000000001
n: in 1 2
c: in 2 3
a = cx/n
K = -(a\sqrt{a^2+4}-a^2)/2
\bar p = (K^2n^2+(1+K)^2x^2)/(-K(2+K))
p = x(\sqrt{x^2+4n^2}-x)/2
"\lim_{\sigma_\xi\to0}" = 1
keep: \lim_{\sigma_\xi\to0}, \bar p, p, c
"""


fixed = r"""
\sigma_\xi, \sigma_n: in .5 2
K = -0.3
\bar p = 1
again:
\bar p = (1+K)^2(\bar p+\sigma_\xi^2)+K^2\sigma_n^2
then:
"""


LETTERS = (analysis, slow_drift, fixed)
DECLARED = {
    DEFINITION: [r"\dot s=V", r"\dot h=U", r"\dot V=\xi_1", r"\dot U=\xi_2"],
    "a setting": ["K_k=0"],
    NOTATION: [r"\text{mean innovation}"],
}
EQUALS = {r"{\lim_{\sigma_\xi\to0}\bar p/p}": r"\frac12(c+1/c)"}
