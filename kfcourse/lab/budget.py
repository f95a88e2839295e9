"""How many trajectories the lab takes by default: a hundred thousand, or as many as a student waits for.

The work is counted, not timed, so that the same command takes the same trajectories on every machine::

    work = trajectories * steps * sum over the filters of passes * laws * (n^2 + n * points)

A designed filter passes over its ensemble and over the common one, with each of its designs.  In a pass it predicts and corrects
so many normal laws a step: one, or one for each mode, or (GPB2) for each pair of modes.  A law is matrices of n^2 numbers, and
where means are sums over points, n numbers at each.  On one core of 2026 a unit takes some tenth of a microsecond, half or twice
as much: sizes are coarse, so that this does not matter.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from kfcourse.filters import Design, Filter
from kfcourse.filters.multiple_models import points_of
from kfcourse.lab.checked_quadrature import Checked
from kfcourse.lab.short_names import JUMP_FILTERS, JumpStructures, Structures
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.quadrature import axes
from kfcourse.symbolic.writing import by_thousands

SIZES = (100_000, 20_000, 5_000)  # trajectories
USUAL = 2e9  # units of work for the fast filters, some three minutes


class Budget(NamedTuple):
    """So many trajectories; and why not the most, in words, or nothing."""

    runs: int
    says: str = ""


def usual_runs(filters: Sequence[Filter | Design], model: Model | JumpModel, steps: int, designs: int) -> Budget:
    """The most of `SIZES` with which the fast filters' work is the `USUAL` one, or the least."""
    each = steps * sum(_work(one, model, designs) for one in filters if isinstance(one, Design) or not one.slow)
    most, *fewer = SIZES
    if most * each <= USUAL:
        return Budget(most)
    runs = next((size for size in fewer if size * each <= USUAL), fewer[-1])
    return Budget(
        runs,
        f"{by_thousands(f'{runs} trajectories: with {most}')} these filters have {most * each / USUAL:.2g} times the work to do "
        "that is usual.  The work is counted, so that this number is the same on every machine.  More trajectories, by --runs, "
        "make the intervals narrower, as the root of their number.",
    )


def _work(one: Filter | Design, model: Model | JumpModel, designs: int) -> int:
    """Units of one trajectory and step."""
    passes, n, modes, points = 2 * designs if isinstance(one, Design) else 1, model.n, 1, 0
    if isinstance(model, JumpModel) and one.name != "duof":
        modes, points = len(model.modes) ** (2 if one.name == "gpb2" else 1), points_of(model)
    if one.name == "aof-gauss-hermite":
        points = 5 ** axes(one.model)
    elif one.name == "aof-unscented":
        points = 2 * (n + max(len(one.model.v), len(one.model.w))) + 1  # fewer, where a noise is only added
    elif one.name.endswith("-gaussian") or (one.name in JUMP_FILTERS and JUMP_FILTERS[one.name].functions == "best"):
        found = (JumpStructures(model) if isinstance(model, JumpModel) else Structures(model)).quadrature
        points += found.points if isinstance(found, Checked) else 0
    return passes * modes * (n**2 + n * points)
