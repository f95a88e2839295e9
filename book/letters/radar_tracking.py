r"""The letters of radar-tracking.md: a limit by iteration, lines by least squares, and a filter with
an acceleration made of measurements."""

from gate.page import CONDITION, DEFINITION, NOTATION

model = r"""
T: in .5 1
A = \begin{pmatrix}1&T\\0&1\end{pmatrix}
B = \begin{pmatrix}T^2/2\\T\end{pmatrix}
H = \begin{pmatrix}1&0\end{pmatrix}
k: range 5
v, w: list 6 num
b: any 2
x_0 = b
x_{k+1} = Ax_k+Bv_k
y_k = Hx_k+w_k
k: range 4
keep: T, A, B, H, x, v, w, y, k
"""


limit = r"""
T: in .5 1
\sigma = 3
\sigma_a: in 1 3
\zeta = 1.7
a_0 = 1.7
y: num
I: eye 2
A = \begin{pmatrix}1&T\\0&1\end{pmatrix}
B = \begin{pmatrix}T^2/2\\T\end{pmatrix}
H = \begin{pmatrix}1&0\end{pmatrix}
q = \sigma_a^2
\Psi = I
again:
p = (\Psi^{-1}+H^TH/\sigma^2)^{-1}
\Psi = ApA^T+BqB^T
then:
K = pH^T/\sigma^2
F = H\Psi H^T+\sigma^2
\alpha = HK
\beta = T\begin{pmatrix}0&1\end{pmatrix}K
\rho = \sqrt{1-\alpha}
\Lambda = \sigma_aT^2/\sigma
C = (I-KH)A
\chi(x) = \det(xI-C)
s = 2\sqrt{(2-\alpha)^2-\alpha^2}
"\chi(-1)\big|_{\beta=\beta_-}" = \chi(-1)+\beta-(2(2-\alpha)-s)      # linear in beta
"\chi(-1)\big|_{\beta=\beta_+}" = \chi(-1)+\beta-(2(2-\alpha)+s)
\hat x = (I-C/\zeta)^{-1}Ky
\hat r = H\hat x
E(x) = 1-H(I-C/x)^{-1}K
E_u(x) = 1-H(I-C/x)^{-1}(K+(I-KH)B(1-1/x)^2/(T^2x))
e = a_0B
again:
e = Ce+(I-KH)Ba_0
then:
\nu = H(Ae+Ba_0)
\ell = He
O = \begin{pmatrix}0&1\end{pmatrix}
\Psi_{11} = H\Psi H^T
\Psi_{12} = H\Psi O^T
\Psi_{22} = O\Psi O^T
p_{11} = HpH^T
p_{12} = HpO^T
p_{22} = OpO^T
forget: e, s, C, I, O
"""


growing = r"""
k: range 2 7
M_k = \sum_{i=0}^{k-1}\begin{pmatrix}1&-i\\-i&i^2\end{pmatrix}
"\alpha_k" of k = \begin{pmatrix}1&0\end{pmatrix}M_k^{-1}\begin{pmatrix}1\\0\end{pmatrix}
"\beta_k" of k = \begin{pmatrix}0&1\end{pmatrix}M_k^{-1}\begin{pmatrix}1\\0\end{pmatrix}
forget: M
"""


start = r"""
T: in .5 1
y: list 2 num
x = \begin{pmatrix}1&-T\\1&0\end{pmatrix}^{-1}\begin{pmatrix}y_0\\y_1\end{pmatrix}
r = \begin{pmatrix}1&0\end{pmatrix}x
s = \begin{pmatrix}0&1\end{pmatrix}x
forget: x
"""


step = r"""
T: in .5 1
b: any 3
y: num
X = \begin{pmatrix}1&-2T\\1&-T\\1&0\end{pmatrix}     # the memory still grows: lines through all points
W = (X^TX)^{-1}X^T
r = \begin{pmatrix}1&0\end{pmatrix}Wb
s = \begin{pmatrix}0&1\end{pmatrix}Wb
r^- = \begin{pmatrix}1&T\end{pmatrix}Wb
\nu = y-r^-
Y = \begin{pmatrix}1&-3T\\1&-2T\\1&-T\\1&0\end{pmatrix}
V = (Y^TY)^{-1}Y^T
c = \begin{pmatrix}b\\y\end{pmatrix}
n = \begin{pmatrix}0\\0\\0\\1\end{pmatrix}
r\leftarrow = \begin{pmatrix}1&0\end{pmatrix}Vc
s\leftarrow = \begin{pmatrix}0&1\end{pmatrix}Vc
"\alpha_k" = \begin{pmatrix}1&0\end{pmatrix}Vn
"\beta_k" = \begin{pmatrix}0&T\end{pmatrix}Vn
\alpha = 0.4
\beta = 2(1-\sqrt{1-\alpha})^2
forget: X, W, Y, V, b, c, n
"""


controlled = r"""
T: in .5 1
\sigma: in 2 3
\sigma_a: in 1 2
A = \begin{pmatrix}1&T\\0&1\end{pmatrix}
B = \begin{pmatrix}T^2/2\\T\end{pmatrix}
H = \begin{pmatrix}1&0\end{pmatrix}
P: cov 2
l: any 2
y: list 7 num
k: range 1 7
d_k = (y_k-y_{k-1})/T
k: range 2 6
u_k = (d_k-d_{k-1})/T
\lambda_2 = l
\Psi_2 = P
p_k = (\Psi_k^{-1}+H^TH/\sigma^2)^{-1}
z_k = p_k(\Psi_k^{-1}\lambda_k+H^Ty_k/\sigma^2)
\lambda_{k+1} = Az_k+Bu_k
\Psi_{k+1} = Ap_kA^T+\sigma_a^2BB^T
k: range 2 5
keep: T, A, B, H, \sigma, \sigma_a, \lambda, z, u, y, k
"""


polar = r"""
d: in .5 2
\varphi: in .2 1
b = \begin{pmatrix}1&0\end{pmatrix}
c = \begin{pmatrix}0&1\end{pmatrix}
g(q) = bq\begin{pmatrix}\cos(cq)\\\sin(cq)\end{pmatrix}
q = \begin{pmatrix}d\\\varphi\end{pmatrix}
"h(x)" = q
H = \operatorname{slope}(g, q)^{-1}
r_x = bg(q)
r_y = cg(q)
"\operatorname{atan2}(r_y,r_x)" = \varphi
"\frac{\partial h}{\partial(r_x,r_y)}" = H
forget: b, c, g, q
"""


LETTERS = (
    model,
    limit,
    growing,
    start,
    step,
    controlled,
    polar,
)
DECLARED = {
    DEFINITION: [r"v_k\sim\mathcal N(0,\sigma_a^2)", r"w_k\sim\mathcal N(0,\sigma^2)"],
    "quoted from the radar paper": [r"K=[\alpha,\beta/T]^T"],
    NOTATION: [r"E(\zeta)"],
    CONDITION: [r"|\zeta|=1"],
}
EQUALS = {
    r"\chi(\zeta)": r"\zeta^2-(2-\alpha-\beta)\zeta+1-\alpha",
    r"\chi(1)": r"\beta",
    r"\chi(-1)": r"4-2\alpha-\beta",
    r"\chi(-1)\big|_{\beta=\beta_-}": r"4\rho",
    r"\chi(-1)\big|_{\beta=\beta_+}": r"-4\rho",
    r"\frac{E_u(\zeta)}{E(\zeta)}": r"\frac{(\zeta-1)(2\zeta+1)}{2\zeta^2}",
}
