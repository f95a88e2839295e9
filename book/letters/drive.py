r"""The letters of drive.md: an arc at a constant yaw rate, integrated numerically, and one step of
the model, on a map that is turned and shifted."""

from gate.page import DEFINITION, NOTATION

arc = r"""
V, \psi, \omega: num
\Delta: in .5 1.5
u = \omega\Delta/2
"""


tunnel = r"""
V, t, p_V, p_\psi, q_V, q_\psi: in .5 2
i = \int_0^t(t-s)^2ds
D_\parallel = tp_Vt+q_Vi
D_\perp = V(tp_\psi t+q_\psi i)V
keep: V, t, p_V, p_\psi, q_V, q_\psi, D_\parallel, D_\perp
"""


moved = r"""
\alpha, w, T, r: in .5 1.5
\beta: any 2
I: eye 2
R = \begin{pmatrix}\cos\alpha&-\sin\alpha\\\sin\alpha&\cos\alpha\end{pmatrix}
M = \begin{pmatrix}R&0\\0&I\end{pmatrix}
b = \begin{pmatrix}\beta\\\alpha\\0\end{pmatrix}
c = \begin{pmatrix}0&0&1&0\end{pmatrix}
d = \begin{pmatrix}0&0&0&1\end{pmatrix}
f(x) = x+\begin{pmatrix}Tdx\cos(cx+w)\\Tdx\sin(cx+w)\\w\\0\end{pmatrix}
x: any 4
p, \Psi: cov 4
A = \operatorname{slope}(f, x)
A' = \operatorname{slope}(f, Mx+b)
H = \begin{pmatrix}1&0&0&0\\0&1&0&0\end{pmatrix}
F = rI+H\Psi H^T
forget: \alpha, w, T, \beta, c, d
"""


long_tunnel = r"""
q_V, q_\psi, t: in .5 2
V = \sqrt{q_V\int_0^t(t-s)^2ds/(q_\psi\int_0^t(t-s)^2ds)}
keep: q_V, q_\psi, V
"""


LETTERS = (arc, tunnel, moved, long_tunnel)
DECLARED = {
    DEFINITION: [r"e=\rho\cos\varphi_0\,(\ell-\ell_0)", r"n=\rho\,(\varphi-\varphi_0)"],
    NOTATION: ["e_{k+1}", "n_{k+1}", r"\psi_{k+1}", "V_{k+1}", r"\Delta"],
}
EQUALS = {
    r"\int_0^\Delta V\cos(\psi+\omega s)\,ds": r"V\Delta\cos(\psi+u)\frac{\sin u}{u}",
    r"\int_0^\Delta V\sin(\psi+\omega s)\,ds": r"V\Delta\sin(\psi+u)\frac{\sin u}{u}",
}
