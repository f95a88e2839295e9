"""The letters of particles.md: the share of particles that counts after one measurement; names are
checked beside them."""

from gate.page import NOTATION

weighted = r"""
r: in .2 1
y: num
w(x) = e^{-(y-x)^2/(2r)}
"\lim_{N\to\infty}\frac{N_e}N" = (\int\mathcal N(x;0,1)w(x)dx)^2/\int\mathcal N(x;0,1)w(x)^2dx
keep: \lim_{N\to\infty}\frac{N_e}N, r, y
"""


LETTERS = (weighted,)
SAID = {
    NOTATION: [
        r"\mathsf M_q\left[x^2\,\tfrac{p}{q}\right]",
        r"\frac{N_e}{N}\to\frac{(\mathsf M w)^2}{\mathsf M w^2}",
    ],
}
