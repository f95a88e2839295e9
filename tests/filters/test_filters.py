"""The filters: the printed equations executed; what holds for all is in test_every_filter."""

from functools import partial

import numpy as np
import oracles
import pytest
import sympy as sp
from numpy.testing import assert_allclose
from test_every_filter import OF_MEASUREMENTS, STRUCTURES

from kfcourse import Ensemble, Model, NotFinite, design, linearised, run, simulate
from kfcourse.filters import EQUATIONS, Design, aof, dfmp, duof, fbp, fos, mdfmp, mfos
from kfcourse.filters import notation as s
from kfcourse.filters.optimal_structure import ESTIMATES, MEASUREMENTS
from kfcourse.montecarlo.ensemble import Instant

# ---------------------------------------------------------------- the printed equations, executed


class Interpreter:
    """Executes printed equations for every trajectory of an ensemble, one at a time.

    `values` maps each matrix symbol to an array (N, rows, columns).  Structural functions are
    looked up when an equation asks for them; moments are taken over the trajectories.
    """

    def __init__(self, values, functions):
        self.values, self.functions = dict(values), functions
        self.runs = len(next(iter(values.values())))

    def execute(self, equations):
        for equation in equations:
            symbols = sorted(equation.rhs.atoms(sp.MatrixSymbol), key=str)
            for symbol in symbols:
                if symbol not in self.values:
                    self.values[symbol] = self.look_up(symbol)
            values = [self.values[symbol] for symbol in symbols]
            self.values[equation.lhs] = oracles.executed(equation.rhs, symbols, values)
        return self.values

    def look_up(self, symbol):
        if symbol in self.functions:
            return self.functions[symbol](self.values)
        return np.broadcast_to(self.moment(symbol), (self.runs, *self.moment(symbol).shape))

    def moment(self, symbol):
        columns = {
            known: array[..., 0] for known, array in self.values.items() if array.shape[-1] == 1
        }
        for left, a in columns.items():
            if symbol == s.mean(left):
                return a.mean(axis=0)[:, None]
            if symbol == s.cov(left):
                return self.covariance(a, a)
            if symbol == s.cov_pinv(left):
                return np.linalg.pinv(self.covariance(a, a), rcond=1e-10, hermitian=True)
            for right, b in columns.items():
                if symbol == s.cov(left, right):
                    return self.covariance(a, b)
        raise AssertionError(f"the equations use {symbol}, which nothing defines")

    @staticmethod
    def covariance(a, b):
        return (a - a.mean(axis=0)).T @ (b - b.mean(axis=0)) / len(a)


PRINTED = {
    "p=1": lambda: Model.define(
        ["0.9*x1 + 0.3*x2 + 0.1*x1*v", "0.8*x2 - 0.1*x1**2 + 0.3*v"],
        ["x1 + 0.2*x2**2 + 0.3*w + 0.1*x1*w"],
        prior={"mean": [0.5, -0.3], "variance": [[0.6, 0.2], [0.2, 0.5]]},
        state_noise={"mean": 0.2, "variance": 0.7},
        meter_noise={"mean": -0.1, "variance": 1.3},
    ),
    "p=2": lambda: Model.define(
        ["0.9*x1 + 0.3*x2*x1 + 0.4*v1", "0.8*x2 - 0.1*x1**2 + 0.3*v2*x1"],
        ["x1*x2 + 0.3*w1", "x2 + 0.1*x1*w1 + 0.4*w2"],
        prior={"mean": [0.5, -0.3], "variance": [[0.6, 0.2], [0.2, 0.5]]},
        meter_noise={"variance": [[1, 0.3], [0.3, 0.5]]},
    ),
}


def structural_values(model, structure):
    """What the printed functional symbols stand for: arrays (N, r, c) from the arrays of their
    arguments."""
    n, p = model.n, model.p
    taylor = linearised(model)  # whose tau and h are a(z, m_v) and b(lambda, m_w)

    def value(function, mean, cov, which, columns=None):
        def of(values):
            size = len(values[mean])
            part = function(values[mean][..., 0], values[cov] if cov else np.eye(n))[which]
            part = part[..., None] if columns is None else part
            return np.broadcast_to(part, (size, part.shape[-2], columns or 1))

        return of

    return {
        s.h_value: value(structure.measure, s.lam, s.Psi, 0),
        s.G_value: value(structure.measure, s.lam, s.Psi, 1, n),
        s.F_value: value(structure.measure, s.lam, s.Psi, 2, p),
        s.tau_zp: value(structure.predict, s.z, s.P, 0),
        s.Theta_zp: value(structure.predict, s.z, s.P, 1, n),
        s.tau_uT: value(structure.predict, s.u, s.T, 0),
        s.Theta_uT: value(structure.predict, s.u, s.T, 1, n),
        s.matrix(r"a(z_{k}, m_{v})", s.n, s.ONE): value(taylor.predict, s.z, None, 0),
        s.matrix(r"b(\lambda_{k}, m_{w})", s.p, s.ONE): value(taylor.measure, s.lam, None, 0),
    }


FAMILIES = {
    "aof": aof,
    "duof": lambda structure: duof(structure.model),
    **{family.__name__: family for family in (fos, mfos, dfmp, mdfmp)},
    **{family.__name__: partial(family, memory=2) for family in (*OF_MEASUREMENTS, fbp)},
}


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(("size", "kind"), [("p=1", "gaussian"), ("p=2", "linearised")])
def test_the_printed_equations_are_what_runs(family, size, kind):
    model = PRINTED[size]()
    structure = STRUCTURES[kind](model)
    equations, build = EQUATIONS[family], FAMILIES[family]
    runs, steps = 15, 3
    x, y = simulate(model, runs, steps + 1, seed=31)
    filter_ = build(structure)
    if isinstance(filter_, Design):
        (filter_,) = design([filter_], [Instant(x[k], y[k], x[k + 1]) for k in range(steps)])

    functions = structural_values(model, structure)
    state = filter_.init(runs)
    lam, Psi = state.predicted.mean[..., None], np.broadcast_to(state.predicted.cov, (runs, 2, 2))
    estimates = []
    for k in range(steps):
        # what fills zeta: of two steps, or of what there is
        functions[MEASUREMENTS] = lambda values, k=k: np.concatenate(y[k::-1][:2], axis=1)[
            ..., None
        ]
        functions[ESTIMATES] = lambda values, old=tuple(estimates): np.concatenate(
            [values[s.z], *old], axis=1
        )
        given = {
            s.lam: lam,
            s.Psi: Psi,
            s.x: x[k][..., None],
            s.y: y[k][..., None],
            s.x_next: x[k + 1][..., None],
        }
        printed = Interpreter(given, functions).execute(equations)
        state = filter_.step(state, y[k])
        # Printed: plain inverses and differences; run: solutions and Joseph's form. 15
        # trajectories, conditions up to 1e4.
        tolerance = {"rtol": 1e-8, "atol": 1e-9}
        assert_allclose(state.posterior.mean, printed[s.z][..., 0], **tolerance)
        assert_allclose(state.predicted.mean, printed[s.lam_next][..., 0], **tolerance)
        if s.P in printed:
            assert_allclose(state.posterior.cov, printed[s.P], **tolerance)
        if s.Psi_next in printed:
            assert_allclose(
                np.broadcast_to(state.predicted.cov, (runs, 2, 2)), printed[s.Psi_next], **tolerance
            )
            Psi = printed[s.Psi_next]
        lam, estimates = printed[s.lam_next], [printed[s.z]]


def test_a_designed_filter_stops_where_its_design_does(variant53):
    (filter_,) = design([duof(variant53)], Ensemble(variant53, 40, 8, seed=21))
    with pytest.raises(ValueError, match=r"designed for 8 steps.*to run step 9"):
        run(filter_, np.zeros((9, 1, 1)))


def test_a_design_on_trajectories_that_diverge_says_so(variant53):
    broken = [Instant(np.ones((3, 1)), np.ones((3, 1)), np.full((3, 1), np.inf))]
    with pytest.raises(NotFinite, match=r"step 0.*trajectories become infinite"):
        design([duof(variant53)], broken)
