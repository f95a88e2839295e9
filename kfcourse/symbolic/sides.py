"""The object or the meter of a model in symbols, at a normal law of the state: where the formulas
of `linearised` and `gaussian` come from, and derivations by hand start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any

import sympy as sp

from kfcourse.laws import Gaussian
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import GaussianMoments, NoClosedForm
from kfcourse.symbolic.reading import exact_matrix, normal_symbols


@dataclass(frozen=True)
class Side:
    """The object or the meter of a model, at a normal law of the state N(mean, cov), in symbols.

    value, A, B: the equation and its Jacobians by state and noise, at the mean;  law: of the noise,
    in exact numbers, with the covariance D.
    """

    equation: sp.ImmutableMatrix
    x: tuple[sp.Symbol, ...]
    noise: tuple[sp.Symbol, ...]
    law: Gaussian
    mean: sp.ImmutableMatrix
    cov: sp.ImmutableMatrix

    @classmethod
    def of(cls, model: Model, side: str) -> Side:
        half = model.halves[side == "meter"]
        mean, cov = ("z", "p") if side == "object" else ("m", "d")
        symbols = normal_symbols(model.n, mean, cov, model.taken)
        law = Gaussian(*map(exact_matrix, half.law))
        return cls(half.equation, model.x, half.noises, law, *symbols)

    def _at_mean(self, matrix: sp.MatrixBase) -> sp.ImmutableMatrix:
        pairs = zip((*self.x, *self.noise), (*self.mean, *self.law.mean), strict=True)
        return matrix.subs(dict(pairs), simultaneous=True)

    @cached_property
    def value(self) -> sp.ImmutableMatrix:
        return self._at_mean(self.equation)

    @cached_property
    def A(self) -> sp.ImmutableMatrix:
        return self._at_mean(self.equation.jacobian(self.x))

    @cached_property
    def B(self) -> sp.ImmutableMatrix:
        return self._at_mean(self.equation.jacobian(self.noise))

    @property
    def D(self) -> sp.ImmutableMatrix:
        return self.law.cov

    def noiseless_covariance(self) -> sp.ImmutableMatrix:
        """Exact covariance of the equation over the law with the noise at its mean."""
        return moments(replace(self, law=Gaussian(self.law.mean, 0 * self.D)))[2]


@lru_cache(maxsize=64)  # the same for all values of the parameters
def taylor(side: Side) -> tuple[sp.ImmutableMatrix, ...]:
    """Value at the mean, slope A, A cov A^T + B D B^T, and its second part alone."""
    if side.A.row_join(side.B).has(sp.Derivative, sp.DiracDelta) or any(
        jumps(choice, [*side.x, *side.noise]) for choice in side.equation.atoms(sp.Piecewise)
    ):
        raise NoClosedForm(
            f"{list(side.equation)} is not differentiable and cannot be linearised; use "
            f"unscented(model) or gauss_hermite(model)",
            "no_slope",
        )
    of_noise = side.B * side.D * side.B.T
    cov = side.A * side.cov * side.A.T + of_noise
    # its upper half, twice: SymPy multiplies out at once what it has seen
    cov = sp.ImmutableMatrix(*cov.shape, lambda i, j: cov[min(i, j), max(i, j)])
    return side.value, side.A, cov, of_noise


@lru_cache(maxsize=64)
def moments(side: Side) -> tuple[sp.ImmutableMatrix, ...]:
    """Mean, its slope by the state's mean, covariance, and what of it the state does not explain,
    over independent state and noise."""
    law = GaussianMoments(
        [*side.x, *side.noise], [*side.mean, *side.law.mean], sp.diag(side.cov, side.D)
    )
    parts = side.equation
    mean, size = parts.applyfunc(law.mean_of), len(parts)
    upper = {
        (i, j): law.covariance(parts[i], parts[j]) for i in range(size) for j in range(i, size)
    }
    cov = sp.ImmutableMatrix(size, size, lambda i, j: upper[min(i, j), max(i, j)])
    slope = mean.jacobian(side.mean)
    return mean, slope, cov, cov - slope * side.cov * slope.T


def plain(matrix: sp.MatrixBase) -> Any:
    """An expression if it is one by one."""
    return matrix[0] if matrix.shape == (1, 1) else sp.ImmutableMatrix(matrix)


def decides(formula: sp.Basic, variables: Sequence[sp.Symbol]) -> bool:
    """Whether a choice between formulas depends on one of the variables: derivatives by it do not
    tell."""
    return any(
        condition.has(*variables)
        for choice in formula.atoms(sp.Piecewise)
        for _, condition in choice.args
    )


def jumps(choice: sp.Piecewise, x: Sequence[sp.Symbol]) -> bool:
    """Whether a choice that depends on these variables may jump where one formula takes over from
    the next."""
    for (formula, condition), (following, _) in pairwise(choice.args):
        border = next((s for s in x if condition.has(s)), None)
        if border is None:
            continue
        try:
            places = sp.solve(condition.lhs - condition.rhs, border)
        except (AttributeError, NotImplementedError):  # several thresholds, or SymPy cannot tell
            return True
        steps = ((formula - following).subs(border, place) for place in places)
        if not places or any(sp.simplify(step) != 0 for step in steps):
            return True
    return False
