"""The object or the meter of a model in symbols: its equation and Jacobians at the mean of a normal
law."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sympy as sp

from kfcourse.laws import Gaussian
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import GaussianMoments
from kfcourse.symbolic.reading import exact_matrix
from kfcourse.symbolic.structure import gaussian_symbols


@dataclass(frozen=True)
class Side:
    """The object or the meter of a model, at a normal law of the state N(mean, cov), in symbols.

    value, A, B: the equation and its Jacobians by state and noise, at the mean;  D: the noise's
    covariance.
    """

    equation: sp.MatrixBase
    x: tuple[sp.Symbol, ...]
    noise: tuple[sp.Symbol, ...]
    law: Gaussian
    mean: sp.MatrixBase
    cov: sp.MatrixBase

    @classmethod
    def of(cls, model: Model, side: str) -> Side:
        if side == "object":
            return cls(
                model.state_equation,
                model.x,
                model.v,
                model.state_noise,
                *gaussian_symbols(model, "z", "p"),
            )
        return cls(
            model.meter_equation,
            model.x,
            model.w,
            model.meter_noise,
            *gaussian_symbols(model, "m", "d"),
        )

    def at_mean(self, matrix: sp.MatrixBase) -> sp.Matrix:
        point = dict(zip(self.x, self.mean, strict=True)) | dict(
            zip(self.noise, exact_matrix(self.law.mean), strict=True)
        )
        return sp.Matrix(matrix.subs(point, simultaneous=True))

    @property
    def value(self) -> sp.Matrix:
        return self.at_mean(self.equation)

    @property
    def A(self) -> sp.Matrix:
        return self.at_mean(self.equation.jacobian(sp.Matrix(self.x)))

    @property
    def B(self) -> sp.Matrix:
        return self.at_mean(self.equation.jacobian(sp.Matrix(self.noise)))

    @property
    def D(self) -> sp.Matrix:
        return sp.Matrix(exact_matrix(self.law.cov))

    def noiseless_covariance(self) -> sp.Matrix:
        """Exact covariance of the equation over the law with the noise at its mean."""
        quiet = self.equation.subs(dict(zip(self.noise, exact_matrix(self.law.mean), strict=True)))
        moments = GaussianMoments(list(self.x), list(self.mean), sp.Matrix(self.cov))
        return sp.Matrix(
            len(quiet), len(quiet), lambda i, j: moments.covariance(quiet[i], quiet[j])
        )


def plain(matrix: sp.MatrixBase) -> Any:
    """An expression if it is one by one."""
    return matrix[0] if matrix.shape == (1, 1) else sp.ImmutableMatrix(matrix)
