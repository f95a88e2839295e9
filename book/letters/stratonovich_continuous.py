"""The letters of stratonovich-continuous.md: numbers of its warm-ups; its equations are SymPy's."""

from gate.page import DEFINITION, NOTATION, STATED

at_rest = r"""
D = 1
\dot D = 1-D^2
"""


LETTERS = (at_rest,)
DECLARED = {
    DEFINITION: [r"dx=a(x)\,dt+B(x)\,dw", r"dY=c(x)\,dt+\sqrt R\,d\beta"],
    STATED: [
        r"dq=L^*q\,dt+\frac{c\,q}{R}\,dY",
        r"dp=L^*p\,dt+\frac{(c-\hat c)\,p}{R}\,(dY-\hat c\,dt)",
        r"dz=\mathsf Ma\,dt+\frac{\mathsf M[(x-z)c]}{R}\,(dY-\hat c\,dt)",
    ],
    NOTATION: [r"dq/q", r"(L^*q\,dt+xq\,dY/R)/q", "(ap)'", "(B^2p)'", "(B^2p)''"],
}
