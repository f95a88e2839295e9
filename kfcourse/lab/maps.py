"""Which filter is the most accurate, and how far from the bound, over two parameters of a model.

::

    cells = parameter_map(model, {"e": (0.02, 0.05, 0.2), "f": (0.01, 0.02, 0.05)})
    cells[0.05, 0.02].leaders(1)
        the most accurate at step 1, and those that are not significantly worse
    draw(cells, 1, ax)                all of them as a map
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from kfcourse.lab.plots import style
from kfcourse.lab.report_text import percent
from kfcourse.lab.short_names import LAB, lab_filters, title
from kfcourse.montecarlo.comparison import EXACT, Comparison
from kfcourse.montecarlo.experiment import compare
from kfcourse.symbolic.model import Model


@dataclass(frozen=True)
class ParameterMap:
    """Comparisons over two parameters: `cells[first, second]` is the one at these values.

    Attributes
    ----------
    parameters : tuple of str
        The first is drawn upwards, the second to the right.
    cells : dict from (float, float) to Comparison
    """

    parameters: tuple[str, str]
    cells: Mapping[tuple[float, float], Comparison]

    def __getitem__(self, values: tuple[float, float]) -> Comparison:
        return self.cells[values]


def parameter_map(
    model: Model,
    values: Mapping[str, Sequence[float]],
    *,
    runs: int = 10_000,
    steps: int = 3,
    design_runs: int = 20_000,
) -> ParameterMap:
    """Compare the lab's filters with the exact AOF at every pair of values of two parameters.

    Parameters
    ----------
    model : Model
    values : mapping
        Two parameters, and the values of each.
    runs, steps, design_runs
        As of `kfcourse.compare`.

    Raises
    ------
    ValueError
        Not two parameters, or one that the model lacks.
    """
    if len(values) != 2 or not set(values) <= set(model.parameters):
        raise ValueError(
            f"a map needs values of two of the parameters {', '.join(model.parameters)}, got "
            f"{', '.join(values)}"
        )
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
    return ParameterMap((first, second), cells)


def draw(cells: ParameterMap, step: int, ax: Axes) -> Axes:
    """The map at a step: in each cell the most accurate filter and its distance from the bound, the
    least accurate and its.

    "GAOF, 2 more": two others are not significantly worse than the most accurate.
    """
    firsts, seconds = (list(dict.fromkeys(key[i] for key in cells.cells)) for i in (0, 1))
    for (a, b), result in cells.cells.items():
        x, y = seconds.index(b), firsts.index(a)
        gaps = {name: result.gap(name)[step] for name in result.entrants}
        best, *others = result.leaders(step)
        worst = max(gaps, key=lambda name: float(gaps[name].value))
        more = f", {len(others)} more" if others else ""
        ax.add_patch(
            Rectangle(
                (x - 0.5, y - 0.5),
                1,
                1,
                color=style(best)["color"],
                alpha=0.25 if others else 0.5,
                linewidth=0,
            )
        )
        ax.text(
            x,
            y,
            f"{title(best)}{more}\n{percent(gaps[best])} %\n\nlast "
            f"{title(worst)}\n{percent(gaps[worst])} %",
            ha="center",
            va="center",
            fontsize="small",
        )
    ax.set(xlim=(-0.5, len(seconds) - 0.5), ylim=(-0.5, len(firsts) - 0.5))
    ax.set_xticks(range(len(seconds)), [f"{b:g}" for b in seconds])
    ax.set_yticks(range(len(firsts)), [f"{a:g}" for a in firsts])
    ax.set_xlabel(f"${cells.parameters[1]}$")
    ax.set_ylabel(f"${cells.parameters[0]}$")
    return ax
