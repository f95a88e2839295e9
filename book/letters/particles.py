"""What the printed names of particles.md are: their values are checked beside them."""

from kfcourse.pages.relations import NOTATION

SAID = {
    r"\mathsf M_q\left[x^2\,\tfrac{p}{q}\right]": NOTATION,
    r"\frac{N_e}{N}\to\frac{(\mathsf M w)^2}{\mathsf M w^2}": NOTATION,
}
