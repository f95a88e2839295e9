"""The letters of landing.md: a state on the way down, its rates by the program of the task."""

from gate.page import DEFINITION

DECLARED = {
    DEFINITION: [
        r"\dot x_1=-E-g_0\sin x_2",
        r"E=c_0x_1^2e^{-\beta_0x_3}",
        r"\dot x_3=x_1\sin x_2",
        r"\dot x_2=\kappa\frac{E}{x_1}+\cos x_2\Bigl(\frac{x_1}{R_0+x_3}-\frac{g_0}{x_1}\Bigr)",
        r"y=E\,\bigl((1+w_1)\rho_1,\ (1+w_2)\rho_2\bigr)+(w_3,w_4)",
        r"\rho_1=\cos x_2-\kappa\sin x_2",
        r"\rho_2=\sin x_2+\kappa\cos x_2",
    ],
}
