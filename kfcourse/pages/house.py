"""The structure of this package, read from its imports: which folder uses which, and what each file is for."""

from __future__ import annotations

import ast
import html
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from importlib import resources
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

# From the top floor down: imports only run down this list.
LAYERS = (
    "cli",
    "listing",
    "commands",
    "notebooks",
    "exercises",
    "pages",
    "checks",
    "derivations",
    "lab",
    "scenarios",
    "continuous",
    "records",
    "montecarlo",
    "filters",
    "linear",
    "symbolic",
    "laws",
    "angles",
    "limits",
    "errors",
    "files",
)


def modules() -> Iterator[tuple[str, Path]]:
    """Name below `kfcourse`, such as "filters.kalman", and file of every module; a folder by its own name."""
    root, sets = (Path(str(resources.files(package))) for package in ("kfcourse", "kfcourse.exercises"))
    found = {path: path.relative_to(root.parent) for path in root.rglob("*.py")}
    found |= {path: Path("kfcourse", "exercises", path.relative_to(sets)) for path in sets.rglob("*.py")}
    for path, place in sorted(found.items(), key=lambda row: row[1]):
        name = ".".join(place.with_suffix("").parts[1:])
        if not name.startswith("__"):
            yield name.removesuffix(".__init__"), path


def imported(path: Path) -> set[str]:
    """Modules of this package that a file imports, below `kfcourse`; not those that only a type checker reads.

    From a folder it imports the folder, unless what it takes is a module: `from kfcourse.filters import notation`.
    """
    tree, known = ast.parse(path.read_text(encoding="utf-8")), _names()
    typing = {id(node) for block in ast.walk(tree) if _for_types(block) for node in ast.walk(block)}
    found: set[str] = set()
    for node in ast.walk(tree):
        if id(node) in typing:
            continue
        if isinstance(node, ast.ImportFrom) and node.module == "kfcourse":
            found |= {f"kfcourse.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            taken = {f"{node.module}.{alias.name}": node.module or "" for alias in node.names}
            found |= {name if name in known else folder for name, folder in taken.items()}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {name.removeprefix("kfcourse.") for name in found if name.startswith("kfcourse.")}


@cache
def _names() -> set[str]:
    return {f"kfcourse.{name}" for name, _ in modules()}


def _for_types(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def layer(module: str) -> str:
    """The floor a module is on."""
    return module.split(".")[0]


def imports() -> Counter[tuple[str, str]]:
    """Number of imports from one layer into another: (from, to) -> files that have one."""
    found: Counter[tuple[str, str]] = Counter()
    for name, path in modules():
        found.update({(layer(name), layer(other)) for other in imported(path)} - {(layer(name), layer(name))})
    return found


def sentence(path: Path) -> str:
    """What a module says of itself first."""
    return (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").partition("\n\n")[0].replace("\n", " ")


def floors() -> str:
    """The floors with a sentence each, from the top down: a table in HTML."""
    said = {name: sentence(path) for name, path in modules() if name in LAYERS}
    body = "".join(f"<tr><td><code>{name}</code></td><td>{_coded(said[name])}</td></tr>" for name in LAYERS)
    return f'<table class="table"><thead><tr><th>floor</th><th>what lives there</th></tr></thead><tbody>{body}</tbody></table>'


def _coded(text: str) -> str:
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(text, quote=False))


def drawing(ax: Axes) -> Axes:
    """Who uses whom: a row and a column for each floor, and in each square how many files of the row import from the column.

    Imports run down the house if nothing stands below the diagonal.
    """
    used, size = imports(), len(LAYERS)
    counts = np.array([[used[above, below] for below in LAYERS] for above in LAYERS])
    ax.pcolormesh(np.where(counts > 0, np.sqrt(counts), np.nan), cmap="Blues", vmin=0, vmax=1.6 * np.sqrt(counts.max()))
    for i, j in zip(*np.nonzero(counts), strict=True):
        ax.text(j + 0.5, i + 0.5, counts[i, j], ha="center", va="center")
    for i in range(size):
        ax.add_patch(Rectangle((i, i), 1, 1, color="0.85", lw=0))
    ticks = np.arange(size) + 0.5
    ax.set(xticks=ticks, yticks=ticks, aspect="equal", xlim=(0, size), ylim=(size, 0))
    ax.set_xticklabels(LAYERS, rotation=60, ha="left", rotation_mode="anchor")
    ax.set_yticklabels(LAYERS)
    ax.xaxis.tick_top()
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    return ax
