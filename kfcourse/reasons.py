"""Why something cannot be had: a sentence for those who program, which a report can say in its own words."""

from __future__ import annotations

from typing import Any


class Reason(str):
    """The message of an exception, with what it is about: its kind, and the term, step or time in question.

    kind : str
        Such as "no_mean"; reports have a sentence for each.
    parts : dict
        What is put into that sentence: "step", "seconds", "term" (a SymPy expression).
    """

    kind: str
    parts: dict[str, Any]

    def __new__(cls, text: str, kind: str = "", **parts: Any) -> Reason:
        one = super().__new__(cls, text)
        one.kind, one.parts = kind, parts
        return one

    @classmethod
    def of(cls, error: Exception) -> Reason:
        """The message of an exception; of no kind if it was raised without one."""
        said = error.args[0] if error.args else ""
        return said if isinstance(said, Reason) else cls(str(error))

    def reworded(self, text: str) -> Reason:
        """The same reason in another sentence."""
        return Reason(text, self.kind, **self.parts)
