"""The letters of discriminator.md: a loop with several components in the gain form, and the
characteristic of a carrier."""

from gate.page import DEFINITION, NOTATION

run = r"""
c: any 2 3
E: any 2 2
b, d: any 2
M: any 3 3
D_n, D_\xi: cov 2
g: any 3 2
P: cov 3
y: list 5 any 2
l, a: any 3
k: range 5
s(x) = b+Ex+dx^Tx/9
f(x) = Mx+ax^Tx/9
\lambda_0 = l/9
\Psi_0 = P/4
Q_k = E+2d(c\lambda_k)^T/9        # the slope of s
H_k = Q_kc
K_k = \Psi_kH_k^T(H_k\Psi_kH_k^T+D_n)^{-1}
p_k = \Psi_k-K_kH_k\Psi_k
v_k = s(c\lambda_k)
z_k = \lambda_k+K_k(y_k-v_k)
u_k = (cp_kp_kc^T)^{-1}cp_k(z_k-\lambda_k)
T_k = M+2az_k^T/9                  # of f
\lambda_{k+1} = f(z_k)
\Psi_{k+1} = T_kp_kT_k^T+gD_\xi g^T
k: range 1 4
"S_k" of k = v_k
"S_k(c\lambda_k)" of k = v_k
"S_k'" of k = Q_k
"\frac{\partial S_k(c\lambda_k)}{\partial\varphi}" of k = Q_k
"\Phi" of k = T_k
"\hat x_{k\mid k}" of k = z_k
"\hat x_{k\mid k-1}" of k = \lambda_k
"P_{k\mid k}" of k = p_k
forget: E, b, d, M, a, l, P, s, Q, H, K, v, T
"""


carrier = r"""
A, D_n, T, \lambda, \Delta, p_{\varphi\varphi}: in .5 2
U(x) = \int_0^{2\pi}A\sin(t)A(\cos(t)-\cos(t+x))dt/(2\pi D_n)
U_{\max} = U(\pi/2)
\Delta f_{\max} = U_{\max}p_{\varphi\varphi}/T/(2\pi)
"u" of \theta = A\sin(\theta+\lambda)A(\cos(\theta+\lambda)-\cos(\theta+\lambda+\Delta))/D_n
\mathsf M(x) = x
forget: \lambda
"""


drifting = r"""
p_{\varphi\varphi}, p_{\nu\varphi}: in .1 .3
a: in .02 .06
T = 0.7
U(x) = 0.8\sin x
\Delta = 0
\delta = 0
again:
u = U(\Delta)
\Delta = \Delta-p_{\varphi\varphi}u+T(\delta-p_{\nu\varphi}u)
\delta = \delta-p_{\nu\varphi}u+aT
then:
keep: p_{\varphi\varphi}, p_{\nu\varphi}, U, \Delta, \delta, a, T
"""


log_likelihood = r"""
c: any 2 3
x: any 3
E: any 2 2
b, d, y: any 2
D_n: cov 2
S(f) = b+Ef+df^Tf/9
L(f) = -(y-S(f))^TD_n^{-1}(y-S(f))/2
e(x) = L(cx)
\varphi = cx
"\frac{\partial L}{\partial\varphi}" = \operatorname{slope}(L, \varphi)
"\frac{\partial L}{\partial x}" = \operatorname{slope}(e, x)
"\frac{\partial S}{\partial\varphi}" = E+2d\varphi^T/9
S = S(\varphi)
forget: E, b, d, e
"""


LETTERS = (run, carrier, drifting, log_likelihood)
DECLARED = {
    DEFINITION: [
        r"\varphi_{k+1}=\varphi_k+T\nu_k+s_\varphi v_{1,k}",
        r"\nu_{k+1}=\nu_k+s_\nu v_{2,k}",
        r"y_k=A\cos\Bigl(\frac{2\pi k}N+\varphi_k\Bigr)+\sigma w_k",
    ],
    NOTATION: [
        r"\mathsf D[u]_\text{carrier}",
        r"\frac{d\,\mathsf M[u]}{d\Delta}\Big|_0",
        r"\mathsf D[u]",
        r"-\mathsf M\frac{\partial u}{\partial\varphi}",
        r"\mathsf M[u]",
        "p_kc^T",
    ],
}
