"""Why a filter was left out, in a sentence of the student's report in its language.

The package's own messages speak to those who program; a report says the cause, with the term in question as a formula.
"""

from __future__ import annotations

from collections.abc import Mapping

from kfcourse.errors import NotFinite, Reason, Refused
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.writing import formula_latex


def cause(reason: Reason, model: Model | JumpModel, words: Mapping[str, str]) -> str:
    """The sentence for an error of a kind, `left_KIND` of the report's words; other messages are quoted."""
    if not (isinstance(reason, Refused | NotFinite) and reason.kind):
        return words["left_other"].format(reason=reason)
    parts = {name: formula_latex(part, model.x) if name == "term" else part for name, part in reason.parts.items()}
    return words[f"left_{reason.kind}"].format(**parts)
