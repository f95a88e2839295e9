"""The letters of checking-exact.md: point masses as a plain program, for a noise that enters
linearly."""

import numpy as np
from gate.page import CONDITION, DEFINITION, NOTATION

masses = r"""
c = 0.9
e = 0.5
D_v = 0.8
m_v = 0
s = 0.7
x_*, y: num
X: nums 4
M: share 4
i: range 5
j: range 4
v = 0
a(x, v) = cx+exv
a_v(x) = ex
\pi(x) = \sum_jM_j\mathcal N(x;cX_j,(eX_j)^2D_v)
l(x) = \mathcal N(y;x,0.1+0.2x^2)
"t_i" of i = -1+i/2
"x_i" of i = x_*+s\sinh(-1+i/2)
W_i = \pi(x_i)l(x_i)s\cosh(-1+i/2)
w = \sum_iW_i
"\mu_i" of i = W_i/w
"x_j" of j = X_j
"\mu_j" of j = M_j
"z_k" = \sum_i\mu_ix_i
"p_k" = \sum_i\mu_ix_i^2-z_k^2
"p(y_k\mid x_i)" of i = l(x_i)
k: range 5
"x" of k = x_*+s\sinh(-1+k/2)
"p(y_k\mid x)" of k = l(x)
"p(x\mid y_{0:k})" of k = \pi(x)l(x)
forget: c, e, v, y, X, M, l, W, w
"""


def bent(rng):
    """The mean of a state whose noise grows as its square, by the trapezium rule at two small f;
    their errors fall as f^2."""
    y = rng.uniform(1, 3)
    u = np.linspace(-12, 12, 4001)  # x - y, in standard deviations of the noise at y

    def moved(f):
        x = y + f * y**2 * u
        weight = np.exp(-(x**2 - y**2) / 2 - u**2 / 2 * (y / x) ** 4) / x**2
        return y**2 * (u @ weight) / weight.sum() / f

    return {"y_0": y, r"\lim_{f\to0}\frac{z_0-y_0}{f^2}": (4 * moved(5e-4) - moved(1e-3)) / 3}


crossing = r"""
a = 2
again:
a = \sqrt{4+3/a^2}      # the greatest root of y^4 - 4 y^2 - 3: where the average line meets the curve
then:
"|y_0|" = a
keep: |y_0|
"""


LETTERS = (masses, bent, crossing)
SAID = {
    DEFINITION: [r"a_v=\frac{\partial a}{\partial v}"],
    NOTATION: [r"\frac{dx}{dt}", "I_y(x)"],
    CONDITION: ["|y_0|=2"],
}
