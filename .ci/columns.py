"""Code that readers see fits the column of a page: at most 78 columns in the cells of chapters and
exercises.

python .ci/columns.py [FILE ...]      all of them, or these
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
COLUMNS = 78


def long_lines(path: Path) -> list[str]:
    """The lines of a page's code that are too long, with their places."""
    long, inside = [], False
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        if line.lstrip().startswith("```"):
            inside = (not inside and "{code-cell}" in line) or line.lstrip().startswith(
                ("```python", "```bash")
            )
        elif inside and not line.startswith(":") and len(line) > COLUMNS:
            long.append(f"{path}:{number}: {len(line)} columns, {COLUMNS} fit the page")
    return long


def main(names: list[str]) -> int:
    paths = [Path(name) for name in names] or [
        *ROOT.glob("book/*.md"),
        *ROOT.glob("book/[!mp]*/*.md"),  # not manual/ and package/, which the build makes
        *ROOT.glob("exercises/sets/*/statement.md"),
    ]
    long = [line for path in sorted(paths) for line in long_lines(path)]
    print("\n".join(long) or f"{len(paths)} pages: all code fits {COLUMNS} columns")
    return bool(long)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
