"""The letters of derive-it.md: it types no relation of its own, the chains are checked where they
stand."""

from gate.page import NOTATION

LETTERS = ()
SAID = {
    NOTATION: [
        r"\mathsf Mx^4",
        r"\mathsf Mx^6",
        r"\text{two nodes lack of }\mathsf M x^4",
        r"\text{three nodes lack of }\mathsf M x^6",
    ],
}
