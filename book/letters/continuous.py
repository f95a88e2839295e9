r"""The letters of continuous.md: the discrete filter in information form, its step, and its rates
where the step is 0, with noises that are mixed."""

from gate.page import CONDITION, DEFINITION, NOTATION

OBJECT = r"""
M, E, L, J: any 2 2
a, b, q, l: any 2
D, N, S_\xi: cov 2
z, y: any 2
I: eye 2
f(x, t) = Mx+ax^Tx/9
e(x) = b+Ex+qx^Tx/9
g(x, t) = J+L(l^Tx)/9
A = \operatorname{slope}(f, z)
H = \operatorname{slope}(e, z)
f = f(z)
g = g(z)
W(T) = (D^{-1}+TH^T(N/2)^{-1}H)^{-1}
P(T) = (I+TA)W(T)(I+TA)^T+TgS_\xi g^T/2
m(T) = z+W(T)TH^T(N/2)^{-1}(y-e(z))
p(T) = m(T)+Tf(z)
\dot z = \operatorname{slope}(p, 0)
\dot D = \operatorname{slope}(P, 0)
"""

first = (
    OBJECT
    + r"""
c = \begin{pmatrix}0&1\\1&0\end{pmatrix}     # picks the components in the other order
T = 0.07
t = 0
u, \xi: any 2
d = D
"D(0)" = D
"z(0)" = z
D_\xi = S_\xi/(2T)
D_n = N/(2T)
B = W(T)
z\leftarrow = p(T)
D\leftarrow = P(T)
\Psi = (I+TA)D(I+TA)^T+TgS_\xi g^T/2
x = u
k: range 1
"x_k" of k = u
"x_{k+1}" of k = u+T(f(u)+g(u)\xi)
"\xi_k" of k = \xi
"y_k" of k = y
S(x, t) = e(cx)
S = e(z)
o = y
y(t) = o
y = o
F(x, t) = y^TN^{-1}y-(y-e(x))^TN^{-1}(y-e(x))
F = F(z, 0)
m = z
forget: M, E, L, J, a, b, q, l, e, P, p, o, u, W
"""
)

in_short = (
    OBJECT
    + r"""
u, w: any 2
k: range 1
"x_k" of k = u
"n_k" of k = w
"y_k" of k = e(u)+w
S(x) = e(x)
S = e(z)
K = D((N/2)^{-1}H)^T
"\partial S/\partial x" = H
keep: x_k, n_k, y_k, k, S, K, D, H, N, S_\xi, A, f, g, y, z, \dot z, \dot D, \partial S/\partial x
"""
)

western = (
    OBJECT
    + r"""
\hat x = z
\dot{\hat x} = \dot z
\dot P = \dot D
F = A
G = g
P = D
h(x) = e(x)
K = D((N/2)^{-1}H)^T
Q = S_\xi/2
R = N/2
keep: \hat x, \dot{\hat x}, P, \dot P, F, G, h, f, H, K, Q, R, S_\xi, N, y
"""
)

stationary = r"""
A, H, G: any 2 2
N, S_\xi: cov 2
I: eye 2
O = 0I
Q = GS_\xi G^T/2
R = H^T(N/2)^{-1}H
Z = \begin{pmatrix}A^T&-R\\-Q&-A\end{pmatrix}
again:                      # the matrix sign of the Hamiltonian: (I, D) spans what decays
Z = (Z+Z^{-1})/2
then:
U = \begin{pmatrix}I&O\end{pmatrix}
V = \begin{pmatrix}O&I\end{pmatrix}
D = -(UZV^T)^{-1}(UZU^T+I)
keep: A, H, G, N, S_\xi, D
"""

second = (
    OBJECT
    + r"""
\delta: cov 2
v(x) = 2(E+2qx^T/9)^TN^{-1}(y-e(x))
r(x) = e(x)^TN^{-1}(2y-e(x))
u = v(z)
U = \operatorname{slope}(v, z)
"\frac{\partial F}{\partial x}" = \operatorname{slope}(r, z)
"\frac{\partial}{\partial x}\Bigl(\frac{\partial F}{\partial x}\Bigr)^T" = U
"\partial f/\partial x" = A
W(T) = (D^{-1}-TU)^{-1}
m(T) = z+TW(T)v(z)
P(T) = (I+TA)W(T)(I+TA)^T+TgS_\xi g^T/2
p(T) = m(T)+Tf(z)
\dot z = \operatorname{slope}(p, 0)
\dot D = \operatorname{slope}(P, 0)
\bar D = D+\delta
Q(T) = (I+TA)\bar D(I+TA)^T+TgS_\xi g^T/2
\dot{\bar D} = \operatorname{slope}(Q, 0)
E = \delta
\dot E = \dot{\bar D}-\dot D
forget: M, L, J, a, b, q, l, e, r, P, p, m, v, W
"""
)

sizes = r"""
D, N, S'', s: in .5 2
S' = -s
\varepsilon = \sqrt{(2DS''/N)^2N/2/(2DS'^2/N)}
keep: D, S', S'', N, \varepsilon
"""

short_gain = r"""
T = 0.07
H: any 2 2
\Psi, N, U: cov 2
I: eye 2
K = (\Psi^{-1}+H^T(N/(2T))^{-1}H)^{-1}H^T(N/(2T))^{-1}
D_+ = (\Psi^{-1}-TU)^{-1}
"""

linear_signal = r"""
b, y, z: any 2
H: any 2 2
N: cov 2
v(x) = 2H^TN^{-1}(y-b-Hx)
U = \operatorname{slope}(v, z)
"""

scalar = r"""
a, q, r: in .5 1
D_0: in 2 3
t: in .1 .2
R = \begin{pmatrix}-a&q\\r&a\end{pmatrix}
u(s) = \operatorname{expm}(Rs)\begin{pmatrix}D_0\\1\end{pmatrix}
P(s) = \begin{pmatrix}1&0\end{pmatrix}u(s)/(\begin{pmatrix}0&1\end{pmatrix}u(s))
D = P(t)
\dot D = \operatorname{slope}(P, t)
D_\infty = P(60)
\rho = \sqrt{a^2+qr}
\delta_0 = D_0-D_\infty
\delta(t) = P(t)-D_\infty
\delta = D-D_\infty
\dot\delta = \dot D
w(s) = 1/(P(s)-D_\infty)
\dot w = \operatorname{slope}(w, t)
w = w(t)
forget: R, u, P
"""

ranks = r"""
n = 3
I: eye 3
C: cov 3
A = C-2I
\mu: in 1 2
H: any 2 3
G: any 3 2
"""

LETTERS = (
    first,
    in_short,
    western,
    stationary,
    second,
    short_gain,
    scalar,
    ranks,
    sizes,
    linear_signal,
)
DECLARED = {
    DEFINITION: [
        r"\mathsf D\Bigl[\textstyle\frac1T\int_0^Tn\,dt\Bigr]"
        r"=\frac1{T^2}\int_0^T\!\!\int_0^T\frac N2\delta(t-t')\,dt'dt",
        r"q=s^2S_\xi/2",
        "r=2h^2/N",
        r"\frac{dx}{dt}=f(x,t)+g(x,t)\,\xi(t)",
        "y(t)=S(cx,t)+n(t)",
        r"x(0)\sim\mathcal N(m,d)",
        r"\dot x=-\tfrac12x+\xi",
        "y=x+n",
        r"\dot x=-x+\xi",
        r"y=x+\tfrac12\kappa x^2+n",
        r"\text{intensity}=\text{two-sided density}=\tfrac12\,\text{one-sided density}=\tfrac N2 .",
    ],
    NOTATION: [
        r"\mathsf M[\text{middle}]-\mathsf M[\text{beginning}]",
        r"{\textstyle\frac12}",
        r"{\textstyle\sum_i\bigl[2N^{-1}(y-S)\bigr]_i\frac{\partial^2S_i}{\partial x^2}}",
        "{(y-S)}",
    ],
    CONDITION: [r"|\mu|\ge1"],
}
