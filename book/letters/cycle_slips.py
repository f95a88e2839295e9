r"""The letters of cycle-slips.md: the mean time to a slip by Pontryagin's two integrals, the loop by
iteration."""

from gate.page import CONDITION, DEFINITION, NOTATION

slips = r"""
v: in .06 .12
q: in .01 .1
\sigma_\varphi = \sqrt v
"V" of \Delta = (1-\cos\Delta)/v
b(x) = \int_0^x\exp(-(1-\cos s)/v)ds
\tau = \int_0^{2\pi}\exp((1-\cos x)/v)b(x)dx/q      # 0 at +-2 pi
I_0(x) = \int_0^\pi\exp(x\cos t)dt/\pi
forget: v, b
"""


loop = r"""
A, D_n: in .5 2
q: in .01 .1
r = 2\pi D_n/\int_0^{2\pi}(A\sin t)^2dt
\Psi = 1
again:
p = 1/(1/\Psi+1/r)
\Psi = p+q
then:
\sigma_\varphi = \sqrt{(p+\Psi)/2}
U'(x) = \cos(x)/r
keep: q, r, p, \Psi, \sigma_\varphi, U'
"""


saw = r"""
v: in .05 .1
q: in .01 .1
\sigma_\varphi = \sqrt v
b(x) = \int_0^x\exp(-s^2/(2v))ds
c(x) = b(\pi)+\int_\pi^x\exp(-(s-2\pi)^2/(2v))ds         # its edge is at half a cycle
\tau = (\int_0^\pi\exp(x^2/(2v))b(x)dx+\int_\pi^{2\pi}\exp((x-2\pi)^2/(2v))c(x)dx)/q
forget: v, b, c
"""


pushed = r"""
q, a: in .5 1
b: in .1 .3
"W" of \Delta = a(1-\cos\Delta)+0.1(1-\cos(2\Delta))-b\Delta/q
R(x) = \exp(\int_0^x(a\sin s+0.2\sin(2s)-b/q)ds)             # q Pi'' + (b - q V') Pi' = 0
\Pi = \int_{-2\pi}^0R(x)dx/\int_{-2\pi}^{2\pi}R(x)dx
keep: W, \Pi
"""


carrier = r"""
q, r: in .5 2
p = 1
again:
p = (p+qr/p)/2
then:
V(x) = (1-\cos(x))/p
\sigma_\varphi = \sqrt p
"""


LETTERS = (slips, loop, saw, pushed, carrier)
DECLARED = {
    DEFINITION: [r"\Delta_{k+1}=\Delta_k-p\,U(\Delta_k)-p\,\tilde n_k+s_\varphi v_k"],
    NOTATION: ["2D_n/A^2", r"1/\sigma_\varphi^2"],
    CONDITION: [r"\tau(2\pi)=0"],
}
