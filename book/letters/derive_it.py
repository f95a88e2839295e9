"""The letters of derive-it.md: it types no relation of its own, the chains are checked where they stand."""

LETTERS = ()
SAID: dict[str, str] = {}
