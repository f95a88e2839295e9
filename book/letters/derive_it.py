"""The letters of derive-it.md: it types no relation of its own, the chains are checked where they stand."""

from kfcourse.pages.relations import NOTATION

LETTERS = ()
SAID = {
    r"\mathsf Mx^4": NOTATION,
    r"\mathsf Mx^6": NOTATION,
    r"\text{two nodes lack of }\mathsf M x^4": NOTATION,
    r"\text{three nodes lack of }\mathsf M x^6": NOTATION,
}
