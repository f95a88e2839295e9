r"""Worlds that several pages share (gate.worlds has the rules): the tests hold them against the
package.

The gain is that of the information form, which neither the package nor a page computes with.
"""

KALMAN = r"""
A: any 3 3
H: any 2 3
Q, L: cov 3
R: cov 2
l: any 3
y: list 5 any 2
I: eye 3
k: range 5
\lambda_0 = l
\Psi_0 = L
p_k = (\Psi_k^{-1}+H^TR^{-1}H)^{-1}
K_k = p_kH^TR^{-1}
\nu_k = y_k-H\lambda_k
F_k = H\Psi_kH^T+R
z_k = p_k(\Psi_k^{-1}\lambda_k+H^TR^{-1}y_k)
\lambda_{k+1} = Az_k
\Psi_{k+1} = Ap_kA^T+Q
forget: l, L
"""

EXTENDED = r"""
M: any 3 3
E: any 2 3
a, l: any 3
b: any 2
g: any 3 2
D_\xi, D_n: cov 2
P: cov 3
y: list 5 any 2
I: eye 3
k: range 5
f(x) = Mx+ax^Tx/9
S(x) = b+Ex+bx^Tx/9
\lambda_0 = l/3
\Psi_0 = P/9
H_k = \operatorname{slope}(S,\lambda_k)
p_k = (\Psi_k^{-1}+H_k^TD_n^{-1}H_k)^{-1}
K_k = p_kH_k^TD_n^{-1}
\nu_k = y_k-S(\lambda_k)
z_k = p_k(\Psi_k^{-1}\lambda_k+H_k^TD_n^{-1}(\nu_k+H_k\lambda_k))
\Phi_k = \operatorname{slope}(f,z_k)
\lambda_{k+1} = f(z_k)
\Psi_{k+1} = \Phi_kp_k\Phi_k^T+gD_\xi g^T
"""

# The nodes x_0, x_1, x_2, P_{ij}, the likelihood l(y, x) and the first masses m (1, 3) stand above.
CHAIN = r"""
y: list 5 num
P = \begin{pmatrix}P_{00}&P_{01}&P_{02}\\P_{10}&P_{11}&P_{12}\\P_{20}&P_{21}&P_{22}\end{pmatrix}
k: range 5
\mu^-_0 = m
D_k = \begin{pmatrix}l(y_k,x_0)&0&0\\0&l(y_k,x_1)&0\\0&0&l(y_k,x_2)\end{pmatrix}
C_k = 1/(\mu^-_kD_k\begin{pmatrix}1\\1\\1\end{pmatrix})
\mu_k = C_k\mu^-_kD_k
z_k = \mu_k\begin{pmatrix}x_0\\x_1\\x_2\end{pmatrix}
p_k = \mu_k\begin{pmatrix}x_0^2\\x_1^2\\x_2^2\end{pmatrix}-z_k^2
\mu^-_{k+1} = \mu_kP
k: range 1 4
"\mu_k(j)" of k, j = (\mu_k)_{j+1}
"\mu^-_k(j)" of k, j = (\mu^-_k)_{j+1}
"\mu^-_0(j)" of j = (m)_{j+1}
forget: D, m
"""

# After a time t: the transition, the covariance of the noise, and what a constant c has moved.
LINEAR = r"""
A, B: any 2 2
c: any 2
I: eye 2
O = 0I
o = 0c
G = \begin{pmatrix}A&BB^T&c\\O&-A^T&o\\o^T&o^T&0\end{pmatrix}
u = \begin{pmatrix}I&O&o\end{pmatrix}
v = \begin{pmatrix}O&I&o\end{pmatrix}
w = \begin{pmatrix}o^T&o^T&1\end{pmatrix}
\Phi(t) = u\operatorname{expm}(Gt)u^T
Q(t) = u\operatorname{expm}(Gt)v^T\Phi(t)^T
b(t) = u\operatorname{expm}(Gt)w^T
"""

# The correction of the MFOS for y = x + 0.1 x^2 + 0.4 w, over a sample.
CORRECTION = r"""
h_k = \lambda_k+0.1(\lambda_k^2+\Psi_k)
G_k = 1+0.2\lambda_k
F_k = G_k^2\Psi_k+0.02\Psi_k^2+0.16
\sigma_k = \Psi_kG_k/F_k(y_k-h_k)
H_k = C(x_k-\lambda_k,\sigma_k)/C(\sigma_k,\sigma_k)
e_k = \mathsf M(x_k-\lambda_k-H_k\sigma_k)
"""
