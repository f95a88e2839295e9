r"""The letters of lab-filters.md: three filters on a sample, their fits by second moments, and the
extended filter of a model with several components."""

from gate.page import DEFINITION, NOTATION
from gate.shared import CORRECTION, EXTENDED

SAMPLE = r"""
x_1, y_1: sample 60         # the means below are those of a sample
v, w: list 6 sample 60
a(x, v) = 0.9x+0.2\sin x+0.3v
b(x, w) = x+0.1x^2+0.4w
C(x, y) = \mathsf M(x-\mathsf Mx)(y-\mathsf My)
\tau(z, p) = 0.9z+0.2\sin(z)e^{-p/2}
\Theta(z, p) = (0.9+0.2\cos z)^2p+0.09
k: range 5
x_0 = x_1
x_{k+1} = a(x_k,v_k)
y_k = b(x_k,w_k)
"""

two_step = (
    SAMPLE
    + r"""
m_v = 0
m_w = 0
\lambda_0 = 0x_1
\omega_k = y_k-b(\lambda_k,0)
H_k = C(x_k-\lambda_k,\omega_k)/C(\omega_k,\omega_k)
e_k = \mathsf M(x_k-\lambda_k-H_k\omega_k)
z_k = x_k-(x_k-\lambda_k-H_k\omega_k-e_k)
\alpha_k = a(z_k,0)
F_k = C(x_{k+1},\alpha_k)/C(\alpha_k,\alpha_k)
g_k = \mathsf M(x_{k+1}-F_k\alpha_k)
\lambda_{k+1} = \mathsf Mx_{k+1}+F_k(\alpha_k-\mathsf M\alpha_k)
k: range 1 4
keep: a, b, m_v, m_w, \lambda, \omega, H, e, z, y, \alpha, F, g, k
"""
)

optimal_structure = (
    SAMPLE
    + r"""
\lambda_0 = 0x_1
\Psi_0 = 1+0x_1
"""
    + CORRECTION
    + r"""
z_k = x_k-(x_k-\lambda_k-H_k\sigma_k-e_k)
\Gamma_k = C(x_k,z_k)/C(z_k,z_k)
\chi_k = \mathsf M(x_k-\Gamma_kz_k)
u_k = \mathsf Mx_k+\Gamma_k(z_k-\mathsf Mz_k)
T_k = C(x_k-u_k,x_k-u_k)
s_{k+1} = \tau(u_k,T_k)
L_k = C(x_{k+1},s_{k+1})/C(s_{k+1},s_{k+1})
n_k = \mathsf M(x_{k+1}-L_ks_{k+1})
\lambda_{k+1} = \mathsf Mx_{k+1}+L_k(s_{k+1}-\mathsf Ms_{k+1})
\Psi_{k+1} = \Theta(u_k,T_k)
k: range 1 4
"\mathrm{Cov}(x_k)" of k = C(x_k,x_k)
"\mathrm{Cov}(x_k,z_k)" of k = C(z_k,x_k)
"h" of k = h_k
"G" of k = G_k
"F" of k = F_k
"L" of k = L_k
"n" of k = n_k
forget: a, b, C, v, w, x_1, y_1, x, \mathsf M, \mathsf D
"""
)

plain_prediction = (
    optimal_structure
    + r"""
"\lambda_{k+1}" of k = \tau(u_k,T_k)
keep: u, T, \tau, \lambda_{k+1}, k
"""
)

second_fit = r"""
\sigma, \eta: sample 60
\varepsilon = 0.7\sigma+0.3+\eta
H = \mathsf M(\varepsilon-\mathsf M\varepsilon)(\sigma-\mathsf M\sigma)/\mathsf D\sigma
"J(1,0)-J_{\min}" = \mathsf M(\varepsilon-\sigma)^2-\mathsf D(\varepsilon-H\sigma)
\bar\varepsilon = \mathsf M\varepsilon
\bar\sigma = \mathsf M\sigma
"\mathsf D\sigma" = \mathsf D\sigma
keep: \mathsf D\sigma, H, J(1,0)-J_{\min}, \bar\varepsilon, \bar\sigma
"""

optimal = (
    EXTENDED
    + r"""
F_k = H_k\Psi_kH_k^T+D_n
\tau(z, p) = f(z)
A(z) = M+2az^T/9
\Theta(z, p) = A(z)pA(z)^T+gD_\xi g^T
"G" of k = H_k
"F" of k = F_k
"h" of k = S(\lambda_k)
k: range 1 4
keep: \lambda, \Psi, K, z, p, y, \tau, \Theta, G, F, h, k
"""
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
DECLARED = {
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
