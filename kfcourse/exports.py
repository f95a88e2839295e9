"""What a package exports is imported when it is first used: help, and what needs only a part, come at once.

::

    if TYPE_CHECKING:
        from kfcourse.symbolic.model import Model
    __getattr__, __dir__ = lazily(__name__, __file__)

The imports stand there once, for the type checker; from these the names are found (PEP 562).
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def lazily(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of a package whose source is this file."""
    block = next(node for node in ast.parse(Path(file).read_text(encoding="utf-8")).body if isinstance(node, ast.If))
    places = {alias.name: node.module for node in block.body if isinstance(node, ast.ImportFrom) for alias in node.names}

    def get(name: str) -> Any:
        if (place := places.get(name)) is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(place), name)
        setattr(sys.modules[package], name, value)
        return value

    return get, lambda: sorted({*vars(sys.modules[package]), *places})
