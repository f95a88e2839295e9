"""The filters of the course, one file per family."""

from kfcourse.filters.alphabeta import alpha_beta, alpha_beta_gamma
from kfcourse.filters.aof import EQUATIONS as _AOF
from kfcourse.filters.aof import aof
from kfcourse.filters.base import Design, Filter, State
from kfcourse.filters.duof import EQUATIONS as _DUOF
from kfcourse.filters.duof import duof
from kfcourse.filters.fos import EQUATIONS as _FOS
from kfcourse.filters.fos import fos
from kfcourse.filters.imm import imm
from kfcourse.filters.iterated import iterated
from kfcourse.filters.kalman import kalman
from kfcourse.filters.mfos import EQUATIONS as _MFOS
from kfcourse.filters.mfos import mfos
from kfcourse.filters.notation import latex
from kfcourse.filters.particle import particle
from kfcourse.filters.pointmass import pointmass

# The printed equations of each family, as SymPy matrix equations.
EQUATIONS = {"aof": _AOF, "duof": _DUOF, "fos": _FOS, "mfos": _MFOS}

__all__ = [
    "EQUATIONS",
    "Design",
    "Filter",
    "State",
    "alpha_beta",
    "alpha_beta_gamma",
    "aof",
    "duof",
    "fos",
    "imm",
    "iterated",
    "kalman",
    "latex",
    "mfos",
    "particle",
    "pointmass",
]
