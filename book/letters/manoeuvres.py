"""The letters of manoeuvres.md: three modes with a joint table of probabilities; a place as a radar
measures it."""

from gate.page import CONDITION, DEFINITION, NOTATION

from kfcourse.scenarios.radar import spherical

M, N = 3, 2


modes = r"""
i: range 3
j: range 3
z, h: list 3 any 2
p, F: list 3 cov 2
y_k: any 2
c: share 3
"z^j" of j = z_j
"p^j" of j = p_j
"h^j" of j = h_j
"F^j" of j = F_j
L_j = \mathcal N(y_k;h_j,F_j)
w = \sum_jc_jL_j
\mu_j = c_jL_j/w
m = \sum_j\mu_jz_j
p = \sum_j\mu_j(p_j+z_jz_j^T)-mm^T
z = m
keep: i, j, L, c, \mu, y_k, h^j, F^j, z^j, p^j, z, p
"""


mixing = r"""
i: range 3
j: range 3
\pi: share 3 3
\mu: share 3
c_j = \sum_i\mu_i\pi_{ij}
"\mu_{i\mid j}" of i, j = \mu_i\pi_{ij}/c_j
"""


def place(rng):
    x = rng.normal(size=3)
    r, phi, epsilon = spherical(x)
    return dict(
        zip(
            (r"r_x", r"r_y", r"r_z", "r", r"\varphi", r"\epsilon"),
            (*x, r, phi, epsilon),
            strict=True,
        )
    )


two_modes = r"""
a, b, m: in .1 .9
"\mu_1" = m
"\mu_2" = 1-m
"\pi_{11}" = a
"\pi_{22}" = b
"c_1" = ma+(1-m)(1-b)
"c_2" = m(1-a)+(1-m)b
"\mu_{1\mid1}" = ma/c_1
"\mu_{1\mid2}" = m(1-a)/c_2
forget: a, b, m
"""


turned = r"""
v: any 2
J = \begin{pmatrix}0&-1\\1&0\end{pmatrix}
\omega: in .5 1
T: in .2 .3
v' = v+\omega TJv
"|v|" = \sqrt{v^Tv}
"|v'|" = \sqrt{v'^Tv'}
"(v'-v)\cdot(v'+v)" = (v'-v)^T(v'+v)
"""


turned_in_the_middle = r"""
v: any 2
J = \begin{pmatrix}0&-1\\1&0\end{pmatrix}
I: eye 2
\omega: in .5 1
T: in .2 .3
h = I-\omega TJ/2
v' = h^{-1}h^Tv
"|v|" = \sqrt{v^Tv}
"|v'|" = \sqrt{v'^Tv'}
"(v'-v)\cdot(v'+v)" = (v'-v)^T(v'+v)
keep: v, v', J, \omega, T, |v|, |v'|, (v'-v)\cdot(v'+v)
"""


LETTERS = (modes, mixing, two_modes, place, turned, turned_in_the_middle)
SAID = {
    "a setting": ["L_j=1"],
    NOTATION: [r"\mu_{i|j}(k-1|k-1)", "r_x", "r_y", "r_z", r"\mu_{1\mid1}-\mu_{1\mid2}"],
    "a series": [r"\frac{\sin\eta}{\eta}-\frac{\eta^4}{120}+\dots"],
    CONDITION: [r"\pi_{11}+\pi_{22}=1"],
    DEFINITION: [r"\Theta=JpJ^T+Q"],
}
EQUALS = {
    r"\pi_{ij}\mu_i/c_j": r"\mu_{i\mid j}",
    r"r\cos(\epsilon)\cos(\varphi)": "r_x",
    r"r\cos(\epsilon)\sin(\varphi)": "r_y",
    r"r\sin(\epsilon)": "r_z",
}
