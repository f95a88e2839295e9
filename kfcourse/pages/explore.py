"""Figures that answer when they are touched: pieces of HTML that load nothing, beside the still
pictures of the same cells.

::

    display(HTML(live_lab("fig-live-lab", models)))
        the figure; a picture with this name is its first frame, and its paper

The helper, data/figure.js, has axes, curves, handles, sliders and the state in the address.
Formulas come from SymPy through `kfcourse.symbolic.javascript`; the scripts in data/ have none of
their own.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import sympy as sp

from kfcourse.lab.plots import style
from kfcourse.lab.short_names import LAB, title
from kfcourse.lab.variants import Variant
from kfcourse.pages.browser import script
from kfcourse.pages.exponents import log_normal
from kfcourse.records.examination import normal_bound
from kfcourse.symbolic import javascript
from kfcourse.symbolic.structure import Structure

DATA = Path(__file__).parent / "data"
HELPER = DATA / "figure.js"
RUNS, STEPS = 10_000, 30  # of the live lab
_DASHES = {"--": "7 4", ":": "2 3", "-.": "7 3 2 3", "-": ""}


def figure(name: str, says: str, code: str, call: str) -> str:
    """A figure as HTML: `code` defines what `call`, a function of (root, name), draws with the
    helper.

    Parameters
    ----------
    name : str
        Of the figure whose picture is the first frame; its state in the address begins with it.
    says : str
        What it is, for those who cannot see it.
    code, call : str
        JavaScript.
    """
    helper = HELPER.read_text(encoding="utf-8")
    mount = f"""(() => {{
const root = document.currentScript.parentElement.querySelector(".kf-explore");
({call})(root, {json.dumps(name)});
}})();"""
    return (
        f'<div class="kf-explored"><div class="kf-explore" data-name="{name}" role="group" '
        f'aria-label="{says}"></div>'
        f"<script>{helper}</script><script "
        f'class="kf-code">{code}</script><script>{mount}</script></div>'
    )


# the space before it, which must not break
_UNIT = re.compile(r"(?<=[\d}]) (?=(?:%|km|rad)(?![\w-]))")


def drawn(name: str, says: str, script: str, parts: Iterable[str], settings: Any) -> str:
    """A figure of data/<script>.js, which defines kf<Script>(root, name, settings) and leaves
    nothing else behind.

    Parameters
    ----------
    name, says : str
        As of `figure`.
    script : str
        Name of the file, words with hyphens between them.
    parts : iterable of str
        What it calls: printed functions.
    settings : object
        Anything that JSON has.
    """
    maker = "kf" + "".join(word.capitalize() for word in script.split("-"))
    code = javascript.RUNTIME + "".join(parts) + _UNIT.sub("\u00a0", _read(f"{script}.js"))
    call = f"(root, name) => {maker}(root, name, {json.dumps(settings)})"
    return figure(name, says, f"const {maker} = (() => {{\n{code}\nreturn {maker};\n}})();", call)


def printed(
    name: str,
    given: Mapping[str, sp.Symbol],
    made: sp.Expr | Mapping[str, sp.Expr],
    letters: Mapping[sp.Symbol, str] | None = None,
) -> str:
    """A printed function of arrays and coefficients that writes arrays; one array, `value`, as
    `kfFigure.values` calls it."""
    results = made if isinstance(made, Mapping) else {"value": made}
    before, after = (
        {key: sp.Matrix([formula]) for key, formula in of.items()} for of in (given, results)
    )
    return javascript.loop(name, before, after, coefficients=letters)


def rounded(rows: Iterable[Iterable[float]]) -> list[list[float]]:
    """Numbers as a page holds them: with four digits."""
    return [[float(f"{number:.4g}") for number in row] for row in rows]


def live_lab(name: str, variants: Mapping[str, Variant]) -> str:
    """The lab under the reader's hand: all filters of a scalar variant, designed and compared while
    its parameters move.

    Parameters
    ----------
    name : str
        Of the figure.
    variants : dict
        Scalar variants by name; 53 is shown first, at step 4.
    """
    source = script({key: variant.plain("live figures") for key, variant in variants.items()}) + (
        DATA / "live-lab.js"
    ).read_text(encoding="utf-8")
    given: dict[str, Any] = {
        "looks": {name: look(name) for name in LAB},
        "variants": {key: f"{key}: {variant.title}" for key, variant in variants.items()},
        "first": "53",
        "step": 4,
        "runs": RUNS,
        "steps": STEPS,
        "reach": normal_bound(),
    }
    return figure(
        name, "The lab, live", source, f"(root, name) => kfLiveLab(root, name, {json.dumps(given)})"
    )


def look(name: str) -> dict[str, str]:
    """A filter's label, colour and dash, as in every figure of the book."""
    line = style(name)
    return {
        "label": title(name),
        "colour": line["color"],
        "dash": _DASHES[line["linestyle"]],
    }


def two_lines(name: str, tangent: Structure, best: Structure, first: Mapping[str, float]) -> str:
    """The signal of a meter, its tangent and the line that is best on average, with the law of the
    state under the reader's hand.

    Parameters
    ----------
    name : str
        Of the figure.
    tangent, best : Structure
        `linearised` and `gaussian` of a scalar model: their h and G make the lines h + G (x - m).
    first : dict
        The "mean" and the "variance" shown first.
    """
    assert best.formulas is not None
    (x,), (m,), (d,) = best.model.x, best.formulas.m, best.formulas.d
    curves = {"signal": tangent["h"].subs(m, x), "density": sp.exp(log_normal(x, m, d))}
    # what the best line does not explain, less the noise of the meter
    left, noise = (each["F"] - each["G"] ** 2 * d for each in (best, tangent))
    numbers = {"left": sp.simplify(left - noise)}
    for line, of in (("tangent", tangent), ("best", best)):
        curves[line] = of["h"] + of["G"] * (x - m)
        numbers |= {f"{line}Mean": of["h"], f"{line}Slope": of["G"]}
    moments = {m: "mean", d: "variance"}
    loops = [
        *(printed(curve, {"x": x}, formula, moments) for curve, formula in curves.items()),
        printed("numbers", {}, numbers, moments),
    ]
    return drawn(name, "The tangent and the best line", "two-lines", loops, dict(first))


def gains(
    name: str,
    prediction: sp.Symbol,
    measurement: sp.Symbol,
    variance: sp.Symbol,
    estimates: Mapping[str, sp.Expr],
    dots: Sequence[Iterable[float]],
    variances: tuple[float, float],
    first: Mapping[str, float],
) -> str:
    """Gains over the prediction, and the estimates made of a measurement; both can be moved.

    Parameters
    ----------
    name : str
        Of the figure.
    prediction, measurement, variance : Symbol
        Of the measurement that is corrected with; the last is the variance of the estimate before,
        of a filter that has one.
    estimates : dict
        Of filters by their names of the lab, affine in the measurement: the slope is the gain.
        Handles are on the first.
    dots : (predictions, gains)
        Of trajectories, under the curves.
    variances : (float, float)
        What the variance is moved between.
    first : dict
        "lambda", "y" and "p" shown first.
    """
    letters, each = {prediction: "lambda", variance: "p"}, []
    for short, estimate in estimates.items():
        gain = printed(
            "gain", {"lambda": prediction}, sp.diff(estimate, measurement), {variance: "p"}
        )
        made = printed("estimate", {"y": measurement}, estimate, letters)
        each.append(f"{json.dumps(short)}: {{ gain: {gain.strip()}, estimate: {made.strip()} }}")
    looks = {name: look(name) for name in estimates}
    settings = {"first": dict(first), "variances": variances, "dots": rounded(dots), "looks": looks}
    return drawn(
        name,
        "Gains of filters",
        "gains",
        ["const filters = {\n" + ",\n".join(each) + "\n};\n"],
        settings,
    )


def _read(name: str) -> str:
    return (DATA / name).read_text(encoding="utf-8")
