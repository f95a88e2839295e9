"""The matrices of a linear model, checked; given, or taken from a `Model`.

x_{k+1} = A x_k + B u_k + v_k,  v ~ N(0, Q)        u_k: known input
y_k     = H x_k + w_k,          w ~ N(0, R)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.laws import Array, Matrices, Measurement, Vectors, apply, symmetric
from kfcourse.symbolic.codegen import Compiled
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.sides import decides


@dataclass(frozen=True)
class LinearSystem:
    """Matrices of a linear model.

    Attributes
    ----------
    A : ndarray (n, n)
        Transition of the state.
    H : ndarray (p, n)
        Sensitivity of the meter.
    Q, R : ndarray (n, n), (p, p)
        Covariances of the noises of object and meter.
    B : ndarray (n, m), optional
        Effect of the known input.

    Raises
    ------
    ValueError
        Shapes that do not fit, numbers that are not finite, covariances that are none.
    """

    A: Matrices
    H: Matrices
    Q: Matrices
    R: Matrices
    B: Matrices | None = None

    def __post_init__(self) -> None:
        for name in "AHQRB":
            if (value := getattr(self, name)) is not None:
                array = np.asarray(value)
                array = array if array.dtype == np.float32 else array.astype(float)
                object.__setattr__(self, name, array)
        n, p = len(self.A), len(self.H)
        shapes = {"A": (n, n), "H": (p, n), "Q": (n, n), "R": (p, p)}
        if self.B is not None:
            shapes["B"] = (n, *self.B.shape[1:2])
        for name, shape in shapes.items():
            array = getattr(self, name)
            if array.shape != shape or array.ndim != 2 or not np.isfinite(array).all():
                raise ValueError(
                    f"{name} must be a finite matrix, with {n} states and {p} measurements of the "
                    f"shape {shape}; got {array.tolist()}"
                )
        for name in "QR":
            cov = getattr(self, name)
            values = np.linalg.eigvalsh(cov)
            # rounding of eigvalsh, in float32 too
            if not np.array_equal(cov, cov.T) or values.min() < -1e-6 * max(values.max(), 0.0):
                raise ValueError(
                    f"{name} is a covariance: symmetric and not negative; got {cov.tolist()}"
                )

    def astype(self, dtype: Any) -> LinearSystem:
        """The same matrices in another arithmetic, such as numpy.float32."""
        matrices = (self.A, self.H, self.Q, self.R, self.B)
        converted = (None if matrix is None else matrix.astype(dtype) for matrix in matrices)
        return LinearSystem(*converted)  # type: ignore[arg-type]

    def input(self, u: Vectors | None) -> Vectors | float:
        """B u, (..., n); 0 without an input."""
        if u is None:
            return 0.0
        if self.B is None:
            raise ValueError(
                "an input u was given, but the system has no matrix B; pass LinearSystem(A, H, Q, "
                "R, B)"
            )
        return apply(self.B, u)

    def measure(self, m: Vectors, d: Matrices) -> Measurement:
        """Structural functions of the meter: h = H m, G = H, F = H d H^T + R."""
        return Measurement(
            apply(self.H, m), self.H, symmetric(self.H @ d @ self.H.T) + self.R, self.R
        )


def linear_system(model: Model) -> tuple[LinearSystem, Vectors, Vectors]:
    """The matrices of a linear model, and the constants of its object (n,) and meter (p,).

    Raises
    ------
    ModelError
        The model is not linear, or depends on the step: see `linear_systems`.
    """
    return linear_systems(model)(None)


def linear_systems(model: Model) -> Callable[[int | None], tuple[LinearSystem, Vectors, Vectors]]:
    """Step to the matrices and constants, as of `linear_system`, of a linear model that may depend
    on the step.

    Raises
    ------
    ModelError
        The model is not linear.
    """
    state = _affine(model.difference_equation("a linear system"), model.x, model.v, model)
    meter = _affine(model.meter_equation, model.x, model.w, model)
    if not model.timed:
        system = _system(model, state(), meter())
        return lambda k: system
    return lambda k: _system(model, state(k=k), meter(k=k))


def _system(
    model: Model, state: Sequence[Array], meter: Sequence[Array]
) -> tuple[LinearSystem, Vectors, Vectors]:
    (A, B, a0), (H, C, b0) = state, meter
    Q, R = (M @ law.cov @ M.T for M, law in ((B, model.state_noise), (C, model.meter_noise)))
    system = LinearSystem(A, H, symmetric(Q), symmetric(R))
    return system, a0 + B @ model.state_noise.mean, b0 + C @ model.meter_noise.mean


def is_linear(model: Model) -> bool:
    """Whether both equations are linear in state and noise, so that the Kalman filter is exact."""
    try:
        linear_systems(model)
    except ModelError:
        return False
    return True


def _affine(
    equation: sp.MatrixBase, x: Sequence[sp.Symbol], noise: Sequence[sp.Symbol], model: Model
) -> Compiled:
    """Matrices of equation = A x + B noise + constant, as a function of the step."""
    numeric, variables = equation.subs(model.values), [*x, *noise]
    slopes = numeric.jacobian(sp.Matrix(variables)).applyfunc(sp.expand)
    if slopes.has(*variables, sp.DiracDelta) or decides(equation, variables):
        raise ModelError(
            f"{list(equation)} is not linear, so the Kalman filter does not apply; use "
            f"aof(linearised(model))"
        )
    constant = numeric.subs(dict.fromkeys(variables, 0))
    return model.compiled([], [slopes[:, : len(x)], slopes[:, len(x) :], list(constant)])
