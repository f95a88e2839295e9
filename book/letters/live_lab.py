"""The letters of live-lab.md: the arguments of a gain."""

from kfcourse.pages.relations import NOTATION

SAID = {
    r"\lambda": NOTATION,
    r"\Psi": NOTATION,
}
