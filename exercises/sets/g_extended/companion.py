"""What the notebook of set g is given: the lecture's functions of a model with their Jacobians."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import sympy as sp

from kfcourse.exercises.checks.steps import of_steps
from kfcourse.laws import Array
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.reading import exact_matrix

Map = Callable[[Array], Array]


class Functions(NamedTuple):
    """The lecture's x_{k+1} = f(x) + g(x) xi, y = S(x) + n with their Jacobians, as functions of
    arrays x (..., n).

    f (..., n), Phi = df/dx (..., n, n), g (..., n, r), covariance D_xi (r, r) of xi;
    S (..., p), H = dS/dx (..., p, n), covariance D_n (..., p, p) of n, which may depend on the
    state.
    """

    f: Map
    Phi: Map
    g: Map
    D_xi: Array
    S: Map
    H: Map
    D_n: Map


def of_all_steps(function: Callable[[Array, int], Array], first: int = 0) -> Map:
    """A function of x and k as one of arrays with all steps before the other axes, (steps, N, n),
    from step `first` on."""
    return lambda x: np.array([function(x_k, first + k) for k, x_k in enumerate(x)])


def linearisation(model: Model) -> Functions:
    """f, Phi, g, D_xi, S, H, D_n of a model: its equations with the noises at their means,
    differentiated by state and noises.

    Where the model depends on the step, the functions take it: f(x, k).
    """
    x, a, b = sp.Matrix(model.x), model.state_equation, model.meter_equation
    quiet = {
        noise: mean
        for names, law in ((model.v, model.state_noise), (model.w, model.meter_noise))
        for noise, mean in zip(names, exact_matrix(law.mean), strict=True)
    }
    by_noise = b.jacobian(sp.Matrix(model.w)).subs(quiet)
    matrices = {
        "f": list(a.subs(quiet)),
        "Phi": a.subs(quiet).jacobian(x),
        "g": a.jacobian(sp.Matrix(model.v)).subs(quiet),
        "S": list(b.subs(quiet)),
        "H": b.subs(quiet).jacobian(x),
        "D_n": by_noise * exact_matrix(model.meter_noise.cov) * by_noise.T,
    }

    def compiled(name: str) -> Map:
        formula = matrices[name]
        function = model.compiled([model.x], [formula])
        shape = np.shape(formula)

        def of_arrays(at: Array, k: int | None = None) -> Array:
            return np.array(np.broadcast_to(function(at, k=k)[0], (*np.shape(at)[:-1], *shape)))

        return of_steps(lambda at, k: of_arrays(at, k)) if model.timed else lambda at: of_arrays(at)

    f, Phi, g, S, H, D_n = map(compiled, matrices)
    return Functions(f, Phi, g, model.state_noise.cov, S, H, D_n)
