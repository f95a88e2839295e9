"""What the printed names of live-track.md are: their values are checked beside them."""

from kfcourse.pages.relations import NOTATION

SAID = {"sigma_u^2": NOTATION}
