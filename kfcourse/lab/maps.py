"""Which filter is the most accurate, and how far from the bound, over two parameters of a model.

::

    cells = parameter_map(model, {"e": (0.02, 0.05, 0.2), "f": (0.01, 0.02, 0.05)})
    cells[0.05, 0.02].leaders(1)      the most accurate at step 1, and those that are not
                                      significantly worse
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from kfcourse.lab.short_names import LAB, lab_filters
from kfcourse.montecarlo.comparison import EXACT, Comparison
from kfcourse.montecarlo.experiment import compare
from kfcourse.symbolic.model import Model


def parameter_map(
    model: Model,
    values: Mapping[str, Sequence[float]],
    *,
    runs: int = 10_000,
    steps: int = 3,
    design_runs: int = 20_000,
) -> dict[tuple[float, float], Comparison]:
    """The comparison of the lab's filters with the exact AOF at every pair of values of two
    parameters, `cells[first, second]`.

    Parameters
    ----------
    model : Model
    values : mapping
        Two parameters, and the values of each.
    runs, steps, design_runs
        As of `kfcourse.compare`.
    """
    first, second = values
    cells = {}
    for a in values[first]:
        for b in values[second]:
            changed = model.replace(**{first: a, second: b})
            filters = lab_filters(changed, [*LAB, EXACT])
            cells[a, b] = compare(
                filters,
                changed,
                runs,
                steps,
                seed=1,
                design_runs=design_runs,
                progress=False,
            )
    return cells
