"""The filters of the course, one file a family.  Read `kalman` first.

kalman                  the textbook step
base, designed          what a filter is: ready to run, or with coefficients to be found over an ensemble
approximations          approximations of the absolutely optimal filter (AOF): EKF, normal, unscented, quadrature
conditionally_optimal   Pugachev's two-step conditionally optimal filter (DUOF)
optimal_structure       Rudenko's filter of optimal structure (FOS), modified (MFOS), in two steps (DFMP, MDFMP)
finite_memory           the same with the last measurements (FKP) or the last estimates (FBP) in the place of the last one
exact                   the AOF itself, of scalar models with modes or without, compiled: a folder
looking_back            what the whole record tells of each state (exact, particle_smoothing)
particles               the same by sampling;  proposals: where to look;  densities: what all need
iterated_ekf            the meter linearised again at the estimate
gate, heavy_tails       measurements that are not believed: refused, by any filter; weighted
learnt_noise            a noise of unknown size, learnt on the way
alphabeta               gains from a table, constant in the end
multiple_models         several ways of moving, one normal law each (IMM, logic-dynamic AOF, GPB2)
                        (jump_equations: as printed;  state_transitions: by the state;  jump_optimal: FOS, FKP, FBP with
                        modes;  jump_particles: state and mode by sampling)
notation                symbols in which the equations are printed
programs, fused, loops  the printed equations as rules and regressions; compiled steps made of them (numba)
"""

from kfcourse.filters.alphabeta import alpha_beta, alpha_beta_gamma
from kfcourse.filters.approximations import EQUATIONS as _AOF
from kfcourse.filters.approximations import aof
from kfcourse.filters.base import Filter, State
from kfcourse.filters.conditionally_optimal import EQUATIONS as _DUOF
from kfcourse.filters.conditionally_optimal import duof
from kfcourse.filters.designed import Design
from kfcourse.filters.exact.pointmasses import pointmass
from kfcourse.filters.finite_memory import EQUATIONS as _FINITE
from kfcourse.filters.finite_memory import dfkp, fbp, fkp, mdfkp, mfkp
from kfcourse.filters.gate import gated
from kfcourse.filters.heavy_tails import robust
from kfcourse.filters.iterated_ekf import iterated
from kfcourse.filters.jump_optimal import logic_dynamic_fbp, logic_dynamic_fkp, logic_dynamic_fos
from kfcourse.filters.jump_particles import jump_particle
from kfcourse.filters.kalman import kalman_filter
from kfcourse.filters.learnt_noise import adaptive
from kfcourse.filters.multiple_models import gpb2, imm, logic_dynamic
from kfcourse.filters.notation import latex
from kfcourse.filters.optimal_structure import EQUATIONS as _OPTIMAL
from kfcourse.filters.optimal_structure import dfmp, fos, mdfmp, mfos
from kfcourse.filters.particles import particle

# The printed equations of each family, as SymPy matrix equations.
EQUATIONS = {"aof": _AOF, "duof": _DUOF, **_OPTIMAL, **_FINITE}

__all__ = [
    "EQUATIONS",
    "Design",
    "Filter",
    "State",
    "adaptive",
    "alpha_beta",
    "alpha_beta_gamma",
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
    "jump_particle",
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
