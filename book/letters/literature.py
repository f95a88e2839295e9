"""What the printed names of literature.md are: their values are checked beside them."""

from gate.page import NOTATION

DECLARED = {
    NOTATION: [
        r"\rho_1^2",
        "x_3'",
        r"\partial x_3'/\partial x_5",
        r"\sin^2\gamma",
        r"\operatorname{tr}I^{-1}/\sigma^2",
        r"\min_h\,\operatorname{tr}I^{-1}/\sigma^2",
    ],
}
