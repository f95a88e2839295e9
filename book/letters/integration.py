"""The letters of integration.md: the filter of an axis and of three, its Western form with matrices,
the accelerometer."""

from gate.page import CONDITION, DEFINITION, NOTATION

sensors = r"""
k: range 1 4
\lambda: list 5 num
l: num
\lambda = l
\varepsilon, n: list 5 num
y: num
"y_{\mathrm{NR},k}" of k = \lambda_k+\varepsilon_k
"S_k(\lambda_k)" of k = \sin((k+1)\lambda_k)
"S_k(y_{\mathrm{NR},k}-\varepsilon_k)" of k = \sin((k+1)\lambda_k)
"y_{\mathrm R,k}" of k = n_k+\sin((k+1)\lambda_k)
S'(x) = \cos x
e(x) = \sin(y-x)
"\frac{d}{d\varepsilon}S(y_{\mathrm{NR}}-\varepsilon)" = \operatorname{slope}(e, y-\lambda)
forget: y, e, l
"""


axis = r"""
\sigma_\xi = 0.3
\sigma_n = 0.7
V, n, \varepsilon: list 6 num
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


western = r"""
\delta\hat x^-, z_\text{GNSS}, z_\text{INS}: any 3
R, P^-: cov 3
I: eye 3
H = -I
v_\text{INS} = z_\text{INS}
\delta z = z_\text{GNSS}-z_\text{INS}
(\cdot) = \delta z+\delta\hat x^-
P = ((P^-)^{-1}+R^{-1})^{-1}
K = -PR^{-1}
\delta\hat x = P((P^-)^{-1}\delta\hat x^--R^{-1}\delta z)
\delta\hat v = \delta\hat x
\hat v = z_\text{INS}-\delta\hat x
G = H
"""


any_meter = r"""
\Psi: cov 3
D: cov 2
G: any 2 3
I: eye 3
F = G\Psi G^T+D
p = (\Psi^{-1}+G^TD^{-1}G)^{-1}
K = pG^TD^{-1}
"""


western_before = r"""
P, Q: cov 3
P^- = Q+P
"""


together = r"""
\sigma_n = 0.7
\sigma_\xi = 0.3
P: cov 3
I: eye 3
k: range 5
\Psi_0 = P
p_k = (\Psi_k^{-1}+I/\sigma_n^2)^{-1}
K_k = -p_k/\sigma_n^2
\Psi_{k+1} = p_k+\sigma_\xi^2I
k: range 1 4
"""


settled = r"""
\sigma_\xi, \sigma_n: in .5 2
\Psi = 1
again:
\Psi = 1/(1/\Psi+1/\sigma_n^2)+\sigma_\xi^2
then:
"""


stepping = r"""
T_a, s, V, \varepsilon, y_{\mathrm{NR}}: in .5 2
v(t) = V+t(y_{\mathrm{NR}}-\varepsilon)
"s_k" = s+\int_0^{T_a}v(t)dt
"V_k" = v(T_a)
"\varepsilon_k" = \varepsilon
"""


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
V, n, \xi: list 6 num
k: range 5
\varepsilon_0 = \xi_5
s_0 = 0
\varepsilon_{k+1} = \varepsilon_k+\xi_k
s_{k+1} = (1-\kappa)s_k+\kappa(n_{k+1}-\varepsilon_{k+1})
e_k = \varepsilon_k+s_k
k: range 1 4
keep: n, \xi, \kappa, e, k
"""


two_filters = r"""
V, n, \varepsilon, \mathcal F, \mathcal G: num
\hat V = \mathcal F(V+\varepsilon)+\mathcal G(V+n)
y_{\mathrm{INS}} = V+\varepsilon
y_{\mathrm{SR}} = V+n
"""


LETTERS = (
    slow_drift,
    sensors,
    axis,
    errors,
    western,
    any_meter,
    western_before,
    accelerometer,
    best_border,
    low_pass,
    two_filters,
    together,
    settled,
    stepping,
)
DECLARED = {
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
