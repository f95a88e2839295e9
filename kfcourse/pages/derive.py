"""The page "Derive it": worked chains as the checker sees them, and what its script needs to check
those that readers type."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from jinja2 import Environment, PackageLoader
from markupsafe import Markup

from kfcourse.exercises.derivations import Report, check_text
from kfcourse.exercises.derivations.verdicts import MARKS, Verdict
from kfcourse.exercises.derivations.wording import DEFINITIONS, RULES, coded
from kfcourse.lab.variants import Variant, find_variant

SCRIPT = Path(__file__).parent / "data" / "derive.js"
_TEMPLATES = Environment(
    loader=PackageLoader("kfcourse.pages"), trim_blocks=True, lstrip_blocks=True, autoescape=True
)


def checked(text: str) -> Report:
    """The report on a text that names its variant."""
    return check_text(text, lambda name: find_variant(name).plain("derivations"))


def shown(report: Report) -> str:
    """A report as a list in HTML: each line with its mark, the named terms underlined, and what is
    said of it."""
    return _TEMPLATES.get_template("derived.html.j2").render(report=report, marks=MARKS)


def _marked(verdict: Verdict) -> Markup:
    """The line, its named terms marked."""
    text, end = Markup(), 0
    for start, stop in sorted(verdict.spans):
        if start >= end:
            text += verdict.text[end:start] + Markup("<mark>%s</mark>") % verdict.text[start:stop]
            end = stop
    return text + verdict.text[end:]


_TEMPLATES.filters |= {"coded": coded, "marked": _marked}


def described(variants: Mapping[str, Variant]) -> str:
    """What the script needs of the variants and of the rules, as JSON: formulas and names, no
    result."""
    plain = {name: variant.plain("derivations") for name, variant in variants.items()}
    models = {
        name: {
            "title": variants[name].title,
            "states": [s.name for s in model.x],
            "v": [s.name for s in model.v],
            "w": [s.name for s in model.w],
            "parameters": list(model.parameters),
            "state": [str(formula) for formula in model.state_equation],
            "meter": [str(formula) for formula in model.meter_equation],
        }
        for name, model in plain.items()
    }
    return json.dumps(
        {"models": models, "texts": {"rules": RULES, "definitions": DEFINITIONS}},
        ensure_ascii=False,
    )


def field(variants: Mapping[str, Variant], example: str) -> str:
    """The field in which a reader types a chain, in HTML; without scripts it stays hidden."""
    data = described(variants).replace("</", "<\\/")
    script = SCRIPT.read_text(encoding="utf-8")
    return _TEMPLATES.get_template("derive.html.j2").render(
        data=data, script=script, example=example, variants=variants
    )
