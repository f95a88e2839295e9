"""The filters of the course, one file a family.  Read `kalman` first.

kalman                  the textbook step
base, designed          what a filter is: ready to run, or with coefficients to be found over an
                        ensemble
approximations          approximations of the absolutely optimal filter (AOF): EKF, normal,
                        unscented, quadrature
conditionally_optimal   Pugachev's two-step conditionally optimal filter (DUOF)
optimal_structure       Rudenko's filter of optimal structure (FOS), modified (MFOS), in two steps
                        (DFMP, MDFMP), and those with the last measurements (FKP) or the last
                        estimates (FBP) in the place of the last one
exact                   the AOF itself, of scalar models with modes or without, compiled: a folder
looking_back            what the whole record tells of each state (exact, particles have ways of
                        their own)
particles               the same by sampling, with modes or without;  densities: what all need
iterated_ekf            the meter linearised again at the estimate
gate, robustness        measurements that are not believed: refused, by any filter; weighted; a
                        noise of unknown size, learnt
alphabeta               gains of a formula, constant in the end
multiple_models         several ways of moving, one normal law each (IMM, logic-dynamic AOF, GPB2)
                        (jump_equations: as printed;  jump_optimal: FOS, FKP, FBP with modes)
notation                symbols in which the equations are printed
programs                the printed equations as rules: letter and value
"""

from kfcourse.filters.alphabeta import alpha_beta
from kfcourse.filters.approximations import EQUATIONS as _AOF
from kfcourse.filters.approximations import aof
from kfcourse.filters.base import Filter, State
from kfcourse.filters.conditionally_optimal import EQUATIONS as _DUOF
from kfcourse.filters.conditionally_optimal import duof
from kfcourse.filters.designed import Design
from kfcourse.filters.exact.pointmasses import pointmass
from kfcourse.filters.gate import gated
from kfcourse.filters.iterated_ekf import iterated
from kfcourse.filters.jump_optimal import logic_dynamic_fbp, logic_dynamic_fkp, logic_dynamic_fos
from kfcourse.filters.kalman import kalman_filter
from kfcourse.filters.multiple_models import gpb2, imm, logic_dynamic
from kfcourse.filters.notation import latex
from kfcourse.filters.optimal_structure import EQUATIONS as _OPTIMAL
from kfcourse.filters.optimal_structure import dfkp, dfmp, fbp, fkp, fos, mdfkp, mdfmp, mfkp, mfos
from kfcourse.filters.particles import particle
from kfcourse.filters.robustness import adaptive, robust

# The printed equations of each family, as SymPy matrix equations.
EQUATIONS = {"aof": _AOF, "duof": _DUOF, **_OPTIMAL}

__all__ = [
    "EQUATIONS",
    "Design",
    "Filter",
    "State",
    "adaptive",
    "alpha_beta",
    "aof",
    "dfkp",
    "dfmp",
    "duof",
    "fbp",
    "fkp",
    "fos",
    "gated",
    "gpb2",
    "imm",
    "iterated",
    "kalman_filter",
    "latex",
    "logic_dynamic",
    "logic_dynamic_fbp",
    "logic_dynamic_fkp",
    "logic_dynamic_fos",
    "mdfkp",
    "mdfmp",
    "mfkp",
    "mfos",
    "particle",
    "pointmass",
    "robust",
]
