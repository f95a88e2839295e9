"""The letters of ten-minutes.md: the state and the measurement that its own cells make."""

import re
from pathlib import Path

from gate.page import DEFINITION, cells
from gate.values import Indexed

from kfcourse import Model

CODE = "\n".join(
    cells(Path(__file__).parents[1].joinpath("course/ten-minutes.md").read_text(encoding="utf-8"))
)


def first(rng):
    """One step of the first cell's simulation, with noises that are known."""
    x, v, w = rng.normal(size=3)

    class Noise:
        normal = staticmethod(lambda: v)

    after = {"x": x, "rng": Noise}
    exec(re.search(r"x = 0\.9.*normal\(\)", CODE)[0], after)
    noisy = {"x": x, "rng": type("Noise", (), {"normal": staticmethod(lambda: w)})}
    exec(re.search(r"y = x \+ rng\.normal\(\)", CODE)[0], noisy)
    return _letters(x, after["x"], noisy["y"], v, w)


def variant(rng):
    """The model of the second."""
    space = {"Model": Model}
    exec(re.search(r"model = Model.*?\n\)", CODE, re.DOTALL)[0], space)
    model, numbers = space["model"], rng.normal(size=3)
    here = dict(zip((*model.x, *model.v, *model.w), numbers, strict=True)) | model.values
    x_next, y = (
        float(formula[0].subs(here)) for formula in (model.state_equation, model.meter_equation)
    )
    return _letters(numbers[0], x_next, y, *numbers[1:]) | {
        str(name): float(value) for name, value in model.values.items()
    }


def _letters(x, x_next, y, v, w):
    return {
        "k": range(1),
        "x": Indexed([x, x_next]),
        "y": Indexed([y]),
        "v": Indexed([v]),
        "w": Indexed([w]),
    }


LETTERS = (first, variant)
DECLARED = {
    DEFINITION: [r"x_0\sim\mathcal N(0,1)"],
}
