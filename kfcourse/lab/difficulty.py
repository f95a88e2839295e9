"""How hard is a variant?  Points for the length of its formulas, what appears in them, and how nonlinear it is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp

from kfcourse.lab.short_names import Structures
from kfcourse.laws import Array, Gaussian
from kfcourse.symbolic.structure import Structure

EASY, MEDIUM = 4.0, 7.0  # scores below are easy, medium; from MEDIUM on hard


@dataclass(frozen=True)
class Hardness:
    """How hard a variant is: the sum of the points in `parts` (see `hardness`)."""

    parts: Mapping[str, float]

    @property
    def score(self) -> float:
        return sum(self.parts.values())

    @property
    def level(self) -> str:
        return "easy" if self.score < EASY else "medium" if self.score < MEDIUM else "hard"


def hardness(structures: Structures) -> Hardness:
    """Points for what makes a variant hard; below EASY in sum it is easy, below MEDIUM medium.

    * length: log2(1 + operations of the Gaussian structural functions / 10);
    * degree: 1 for each degree in x above the first, at most 2;
    * functions: 1 if x is in a sine, an exponential or the like;
    * noise: 1 if the object's depends on the state, 1 if the meter's does;
    * dimension: 1 for each component of the state after the first;
    * nonlinearity: twice `nonlinearity`, at most 2.

    Raises
    ------
    NoClosedForm
        There are no Gaussian structural functions.
    """
    model = structures.model
    equations = [*model.state_equation, *model.meter_equation]
    sides = (model.state_equation, model.v), (model.meter_equation, model.w)
    noisy = [equation.jacobian(sp.Matrix(noise)).has(*model.x) for equation, noise in sides]
    return Hardness(
        {
            "length": float(np.log2(1 + length(structures.gaussian) / 10)),
            "degree": float(min(max(_degree(one, model.x) for one in equations) - 1, 2)),
            "functions": float(any(f.has(*model.x) for one in equations for f in one.atoms(sp.Function))),
            "noise": float(sum(noisy)),
            "dimension": model.n - 1.0,
            "nonlinearity": 2 * min(nonlinearity(structures), 1.0),
        }
    )


def _degree(equation: sp.Expr, x: Sequence[sp.Symbol]) -> int:
    """Largest degree in x of the polynomial factors of the terms, at least 1."""
    factors = [[f for f in sp.Mul.make_args(term) if f.is_polynomial(*x)] for term in sp.Add.make_args(sp.expand(equation))]
    return max(1, *(sp.Poly(sp.Mul(*term), *x).total_degree() for term in factors))


def nonlinearity(structures: Structures) -> float:
    """Largest difference of the Gaussian structural functions and the linearised ones at the prior law.

    Means in units of their standard deviation, covariances in units of their diagonal.
    """
    mean, cov = structures.model.prior
    exact, approximate = (
        [*_laws(structure, mean[None], cov[None])] for structure in (structures.gaussian, structures.linearised)
    )
    return max(_distance(one, other) for one, other in zip(exact, approximate, strict=True))


def _laws(structure: Structure, mean: Array, cov: Array) -> Iterator[Gaussian]:
    """Laws of the next state and of the measurement."""
    first = structure.at(0)
    yield first.predict(mean, cov)
    measurement = first.measure(mean, cov)
    yield Gaussian(measurement.h, measurement.F)


def _distance(exact: Gaussian, approximate: Gaussian) -> float:
    deviation = np.sqrt(np.maximum(np.diagonal(exact.cov, axis1=-2, axis2=-1), 0.0))
    unit = np.where(deviation > 0, deviation, 1.0)
    shift, spread = np.abs(exact.mean - approximate.mean) / unit, np.abs(exact.cov - approximate.cov)
    return float(max(shift.max(), (spread / (unit[..., :, None] * unit[..., None, :])).max()))


def length(structure: Structure) -> int:
    """Operations in the formulas of the structural functions."""
    return sum(int(entry.count_ops()) for name in ("tau", "Theta", "h", "G", "F") for entry in sp.flatten([structure[name]]))
