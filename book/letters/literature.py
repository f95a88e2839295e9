"""What the printed names of literature.md are: their values are checked beside them."""

from kfcourse.pages.relations import NOTATION

SAID = {r"\rho_1^2": NOTATION, "x_3'": NOTATION, r"\partial x_3'/\partial x_5": NOTATION}
