"""What an argument must be, told in a sentence: a model, structural functions or a filter where it is another one; a size."""

from __future__ import annotations

import numpy as np

MAKE_MODEL = "give the model that it was made for, it.model"
MAKE_STRUCTURE = "give linearised(model), gaussian(model), unscented(model) or gauss_hermite(model)"
NEXT = {  # (what is expected, what came) to what to do
    ("Model", "Structure"): MAKE_MODEL,
    ("Model", "Filter"): MAKE_MODEL,
    ("Model", "Design"): MAKE_MODEL,
    ("Model", "JumpModel"): "take one of its modes, it.modes[0], or a filter of several models, such as imm or jump_particle",
    ("Model", "ContinuousModel"): "give a discrete one, kfcourse.continuous.to_discrete(it, step)",
    ("ContinuousModel", "Model"): "define it in continuous time, ContinuousModel.define(...)",
    ("JumpModel", "Model"): "take the filter of a model without modes, such as pointmass or particle",
    ("JumpModel", "Structure"): MAKE_MODEL,
    ("JumpModel", "Filter"): MAKE_MODEL,
    ("Structure", "Model"): MAKE_STRUCTURE,
    ("Structure", "Filter"): f"{MAKE_STRUCTURE}, what a filter is made of",
    ("Structure", "Design"): f"{MAKE_STRUCTURE}, what a filter is made of",
    ("Filter", "Model"): "make a filter for it, such as aof(linearised(model)) or kalman_filter(model)",
    ("Filter", "Structure"): "make a filter of it, such as aof(structure)",
    ("Filter", "Design"): "find its coefficients over an ensemble, "
    "design([it], Ensemble(model, 100_000, steps, seed=1))[0], or give it to compare([it], model, ...), which does so",
}


def expect(given: object, kind: type, what: str, *also: type) -> None:
    """TypeError unless an argument of `what` is of this kind, or one of the others: what came, what is expected, what to do."""
    if isinstance(given, (kind, *also)):
        return
    came = type(given).__name__
    if isinstance(given, type) or type(given).__name__ == "function":
        came, remedy = f"the function {given.__name__}", "call it first"  # type: ignore[attr-defined]
    else:
        known = (NEXT.get((kind.__name__, one.__name__)) for one in type(given).mro())
        remedy = next(filter(None, known), "see its documentation")
        named = getattr(given, "name", None)
        came = f"the {came} {named}" if isinstance(named, str) else f"{_article(came)} {came}"
    raise TypeError(f"{what} expects {_article(kind.__name__)} {kind.__name__}, and {came} came: {remedy}")


def expect_sizes(**sizes: object) -> None:
    """ValueError for one of these numbers, of steps, runs and so on, that is not a positive whole one."""
    for name, value in sizes.items():
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
            raise ValueError(f"{name} must be a positive whole number, got {value!r}")


def _article(name: str) -> str:
    return "an" if name[0] in "aeiouAEIOU" else "a"
