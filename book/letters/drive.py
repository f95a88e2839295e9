"""The letters of drive.md: its displayed relations are a definition and what SymPy verifies."""

from kfcourse.pages.relations import DEFINITION, NOTATION

LETTERS = ()
SAID = {
    r"e=\rho\cos\varphi_0\,(\ell-\ell_0)": DEFINITION,
    r"n=\rho\,(\varphi-\varphi_0)": DEFINITION,
    r"V=e^{s}": NOTATION,
}
