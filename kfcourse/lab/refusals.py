"""Why a filter was left out, in a sentence of the student's report in its language.

The package's own messages speak to those who program; a report says the cause, with the term in question as a formula.
"""

from __future__ import annotations

from collections.abc import Mapping

from kfcourse.reasons import Reason
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.writing import formula_latex


def cause(reason: str, model: Model | JumpModel, words: Mapping[str, str]) -> str:
    """The sentence for a `Reason`, `left_KIND` of the report's words; a message of no kind is quoted."""
    if not (isinstance(reason, Reason) and reason.kind):
        return words["left_other"].format(reason=reason)
    parts = {name: formula_latex(part, model.x) if name == "term" else part for name, part in reason.parts.items()}
    return words[f"left_{reason.kind}"].format(**parts)
