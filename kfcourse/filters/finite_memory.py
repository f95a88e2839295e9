"""Filters that remember: the last measurements (FKP, ФКП, finite memory) or the last estimates (FBP, ФБП, high order).

The construction is that of `optimal_structure`; only zeta is longer.  FKP and DFKP are the school's; the others come of it:

    FKP, MFKP, DFKP, MDFKP   zeta_k = (y_k, y_{k-1}, ..., y_{k-l+1})     the recipes of FOS, MFOS, DFMP, MDFMP
    FBP                      zeta_k = (z_k, z_{k-1}, ..., z_{k-l+1})     the recipe of the FOS

With measurements z is not fed back: what older ones knew is lost, and so are their errors.  Until the memory is full it
holds what there is.  Rudenko (2010).
"""

from __future__ import annotations

import numpy as np

from kfcourse.filters import notation as s
from kfcourse.filters.designed import Design
from kfcourse.filters.optimal_structure import DFMP, FOS, MDFMP, MFOS, Memory, Recipe, of_structure, printed
from kfcourse.symbolic.structure import Structure

STEPS = 4  # the school's length of memory


def fkp(structure: Structure, memory: int = STEPS) -> Design:
    """The filter with finite memory.

    u = Gamma zeta + chi,  T = `residual`                        regression of x on zeta, the last `memory` measurements
    lambda' = tau(u, T),  Psi' = Theta(u, T),   z = lambda + K (y - h)

    Raises
    ------
    ValueError
        `memory` is not a positive whole number.
    ModelError
        The model has angles.
    """
    return _of_measurements("fkp", structure, FOS, memory)


def mfkp(structure: Structure, memory: int = STEPS) -> Design:
    """The modified filter with finite memory (МФКП): the steps of `mfos` with the regressor of `fkp`."""
    return _of_measurements("mfkp", structure, MFOS, memory)


def dfkp(structure: Structure, memory: int = STEPS) -> Design:
    """The two-step filter with finite memory (ДФКП): the steps of `dfmp` with the regressor of `fkp`.

    lambda' = L tau(u, T) + n.  Where tau is affine that is the regression of x' on zeta itself.
    """
    return _of_measurements("dfkp", structure, DFMP, memory)


def mdfkp(structure: Structure, memory: int = STEPS) -> Design:
    """The modified two-step filter with finite memory (МДФКП): the steps of `mdfmp` with the regressor of `fkp`."""
    return _of_measurements("mdfkp", structure, MDFMP, memory)


def fbp(structure: Structure, memory: int = STEPS) -> Design:
    """The filter of high order (ФБП): the steps of `fos`, with the last `memory` estimates in the place of z."""
    return of_structure(f"fbp{checked_memory(memory)}", structure, FOS, Memory(estimates=memory))


def _of_measurements(family: str, structure: Structure, recipe: Recipe, memory: int) -> Design:
    return of_structure(f"{family}{checked_memory(memory)}", structure, recipe, Memory(estimates=0, measurements=memory))


def checked_memory(memory: int) -> int:
    """The length of a memory; ValueError if it is not a positive whole number."""
    if isinstance(memory, bool) or not isinstance(memory, int | np.integer) or memory < 1:
        raise ValueError(f"a memory holds so many steps, a positive whole number such as 4, got {memory!r}")
    return memory


_zeta = s.matrix(r"\zeta_{k}", s.r, s.ONE)
MEASUREMENTS = s.matrix(r"(y_{k};\,\dots;\,y_{k-\ell+1})", s.r, s.ONE)
ESTIMATES = s.matrix(r"(z_{k};\,\dots;\,z_{k-\ell+1})", s.r, s.ONE)
EQUATIONS = {
    name: printed(recipe, _zeta, consists_of=MEASUREMENTS)
    for name, recipe in (("fkp", FOS), ("mfkp", MFOS), ("dfkp", DFMP), ("mdfkp", MDFMP))
} | {"fbp": printed(FOS, _zeta, consists_of=ESTIMATES)}
