"""The step of the exact filter with its usual way compiled: `loops` takes most trajectories, `pointmasses` what these leave.

Posteriors stay in the arrays that the loop has filled; a grid is cut out when it is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
import sympy as sp

from kfcourse.filters.densities import formulas
from kfcourse.filters.exact.constants import NODES
from kfcourse.filters.exact.kernels import Grid, chunks
from kfcourse.laws import Array, Gaussian
from kfcourse.symbolic import compiled
from kfcourse.symbolic.model import Model

AT_ONCE = 512  # trajectories: 3 MB of nodes


class Packed(Sequence[Grid]):
    """Posteriors one after the other in one array (3, M): nodes, masses, densities; where each begins, how many nodes it has.

    `usual` tells those whose nodes are a rule and whose kernels overlap; `uniform` and `rough` are those of `Grid`.
    """

    def __init__(self, values: Array, start: Array, size: Array, usual: Array, uniform: Array, rough: Array):
        self.values, self.start, self.size, self.usual, self.uniform, self.rough = values, start, size, usual, uniform, rough

    def __len__(self) -> int:
        return len(self.start)

    def __getitem__(self, place: Any) -> Any:
        if isinstance(place, slice):
            return [self[i] for i in range(*place.indices(len(self)))]
        if not 0 <= place < len(self):
            raise IndexError(place)
        begin = self.start[place]
        x, mass, density = self.values[:, begin : begin + self.size[place]]
        return Grid(x, mass, density, bool(self.uniform[place]), bool(self.rough[place]))

    @classmethod
    def of_normal(cls, law: Gaussian, runs: int) -> Packed:
        """The same normal law for all, a single node: its mean, the mass 1, and, in place of a density, its deviation."""
        values = np.array([[law.mean[0]], [1.0], [max(np.sqrt(law.cov[0, 0]), 1e-150)]])
        yes = np.ones(runs, dtype=bool)
        return cls(values, np.zeros(runs, dtype=int), np.ones(runs, dtype=int), yes, yes, ~yes)

    @classmethod
    def together(cls, values: Array, size: Array, usual: Array, grids: Mapping[int, Grid]) -> Packed:
        """Those in the order of the sizes (T,), where these are not 0, and the grids of the others."""
        count, start = size.copy(), np.cumsum(size) - size
        uniform, rough = size > 0, np.zeros(len(size), dtype=bool)
        end = values.shape[1]
        for place, grid in grids.items():
            count[place], start[place], uniform[place], rough[place] = len(grid.x), end, grid.uniform, grid.rough
            end += len(grid.x)
        every = np.concatenate([values, *(np.array(grid[:3]) for grid in grids.values())], axis=1)
        return cls(every, start, count, usual, uniform, rough)


class Done(NamedTuple):
    """What the loops made of some trajectories, of size 0 where they made nothing.

    Nodes, masses, densities (3, M); mean, variance, error, and mean and variance predicted (5, T); how many nodes (T,), and
    whether the next prediction is usual, too.
    """

    values: Array
    numbers: Array
    size: Array
    usual: Array


UsualWay = Callable[[Packed, Array, Array, float, int], Done]


def compiled_usual_way(model: Model) -> UsualWay:
    """(posteriors, numbers of trajectories, y (T,), accuracy, fine nodes) -> one step of these, compiled.

    Raises
    ------
    ImportError
        There is no numba.
    """
    import_module("kfcourse.filters.exact.loops")  # now, while there is one process
    (x,), of_model = model.x, formulas(model)
    of_noise = not of_model.meter.has(x)
    signal = sp.sqrt(of_model.meter_variance) if of_noise else of_model.meter
    moves = {"mean": of_model.state, "variance": of_model.variance, "slope": of_model.state.diff(x)}
    meter = {"mean": of_model.meter, "variance": of_model.meter_variance, "signal": signal, "slope": signal.diff(x)}
    passes = [compiled.Pass(one, list(model.values)) for one in (moves, meter)]
    printed = compiled.choice("law", {"x": x}, list(meter), passes)
    compiled.load(printed)  # now; a step takes it by its text, which another machine can be sent
    constants = np.array([float(value) for value in model.values.values()])

    def step(before: Packed, rows: Array, y: Array, accuracy: float, fine_nodes: int) -> Done:
        from kfcourse.filters.exact.loops import BEYOND, DONE, room, steps

        numbers, (size, status) = np.empty((5, len(rows))), np.zeros((2, len(rows)), dtype=int)
        values, start, count, rooms = [np.empty((3, 0))], before.start[rows], before.size[rows], room()
        for some in chunks(len(rows), 1, AT_ONCE):
            after = np.empty((3, len(rows[some]) * NODES[-1] + BEYOND))
            given = before.values, start[some], count[some], y[some], accuracy, fine_nodes
            here = np.empty((5, len(rows[some])))
            filled = steps(compiled.load(printed).law, constants, of_noise, *given, after, here, size[some], status[some], rooms)
            numbers[:, some] = here
            values.append(after[:, :filled])
        return Done(np.concatenate(values, axis=1), numbers, size, status == DONE)

    return step
