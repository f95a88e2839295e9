"""The page "Derive it": worked chains as the checker sees them, and what its script needs to check
those that readers type."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping
from pathlib import Path

from jinja2 import Environment, PackageLoader

from kfcourse.exercises.derivations import Report, check_text
from kfcourse.exercises.derivations.verdicts import MARKS, Verdict
from kfcourse.exercises.derivations.wording import DEFINITIONS, RULES
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
    return "\n".join(
        f'<ol class="kf-derived">\n{"".join(map(_item, chain.verdicts))}</ol>'
        for chain in report.chains
    )


def _item(verdict: Verdict) -> str:
    words = "".join(f"<p>{_coded(part)}</p>" for part in (verdict.says, verdict.rule) if part)
    state = verdict.status.replace(" ", "-")
    status = f"<span>{MARKS[verdict.status]} {verdict.status}</span>"
    return f'<li class="kf-{state}"><code>{_marked(verdict)}</code> {status}{words}</li>\n'


def _marked(verdict: Verdict) -> str:
    """The line, its named terms marked."""
    pieces, end = [], 0
    for start, stop in sorted(verdict.spans):
        if start >= end:
            pieces += [
                html.escape(verdict.text[end:start]),
                f"<mark>{html.escape(verdict.text[start:stop])}</mark>",
            ]
            end = stop
    return "".join([*pieces, html.escape(verdict.text[end:])])


def _coded(text: str) -> str:
    return re.sub(
        r"`([^`]+)`", r"<code>\1</code>", html.escape(text, quote=False).partition("\n")[0]
    )


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
