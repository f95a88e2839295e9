r"""The letters of what-the-data-say.md: a level that wanders, its record's density at once, and one
round of EM by a dense law."""

from gate.page import NOTATION, STATED

wandering = r"""
c, r, d: in .5 2
N = 4
I: eye 5
u: any 5
A = \begin{pmatrix}0&0&0&0&0\\0&1&1&1&1\\0&1&2&2&2\\0&1&2&3&3\\0&1&2&3&4\end{pmatrix}
o = \begin{pmatrix}1\\1\\1\\1\\1\end{pmatrix}
P = doo^T+cA                    # of the five states
V = P+rI
\ln L = \ln\mathcal N(u;0u,V)
Z = u^TV^{-1}P
C = P-PV^{-1}P
k: range 5
y_k = (u^T)_{k+1}
\lambda_0 = 0
\Psi_0 = d
F_k = \Psi_k+r
\nu_k = y_k-\lambda_k
p_k = 1/(1/\Psi_k+1/r)
\lambda_{k+1} = \lambda_k+\nu_k\Psi_k/F_k
\Psi_{k+1} = p_k+c
S_k = p_k/(p_k+c)
\bar z_k = (Z)_{k+1}
\bar p_k = ((C)_{k+1}^T)_{k+1}
q = \sum_{k=0}^3((\bar z_{k+1}-\bar z_k)^2+\bar p_{k+1}+\bar p_k-2((C)_{k+1}^T)_{k+2})/N
keep: \ln L, \nu, F, q, N, \bar z, \bar p, S, k
"""


whittle = r"""
q, r: in .5 2
N = 7
\omega: in 1 2
w(x) = 2(1-\cos(x))
S(x) = q+rw(x)          # of the differences, whose covariances are -r, q + 2r, -r
I_{qq} = N\int_0^{2\pi}1/S(x)^2dx/(4\pi)
I_{qr} = N\int_0^{2\pi}w(x)/S(x)^2dx/(4\pi)
I_{rr} = N\int_0^{2\pi}w(x)^2/S(x)^2dx/(4\pi)
\bar s_r = \int_0^{2\pi}w(x)/S(x)dx/(2\pi)
"\partial\ln S/\partial q" = 1/S(\omega)
"\partial\ln S/\partial r" = w(\omega)/S(\omega)
a = q^2+4qr
forget: w
"""


rounds = r"""
y: sample 5
m = \mathsf My^2
r = sm
n = 300
k: range 300
q_0 = m
K_k = q_k/(q_k+r)
q_{k+1} = \mathsf M(K_ky)^2+(1-K_k)q_k
q = q_n
K = q/(q+r)
q' = \mathsf M(Ky)^2+(1-K)q
j: range 300 301
keep: m, r, K, q, q', j
"""


seen_states = r"""
q, r: in .5 2
N = 9
x: nodes 0 q
I_\text{states} = N\mathsf M(x^2/q^2-1/q)^2/4
s = q+r
x: nodes 0 s
I_\text{record} = N\mathsf M(x^2/s^2-1/s)^2/4
keep: q, r, N, I_\text{states}, I_\text{record}
"""


LETTERS = (
    wandering,
    whittle,
    "s = 0.5\n" + rounds,
    "s = 2\n" + rounds,
    "s = 1\n" + rounds,
    seen_states,
)
DECLARED = {
    STATED: [r"p(y_0,\dots,y_N)=\prod_kp(y_k\mid y_0,\dots,y_{k-1})"],
    NOTATION: [r"\ln p(y_0)+\ln p(y_1\mid y_0)", r"\ln p(y_0,y_1)", r"\mathsf M r_k^2"],
}
EQUALS = {
    "N/(2q^2)": r"I_\text{states}",
    r"N/\bigl(2(q+r)^2\bigr)": r"I_\text{record}",
    r"(1-q/\sqrt a)/r": r"\bar s_r",
}
