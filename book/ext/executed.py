"""Sphinx extension: executed notebooks in _build/jupyter_execute also when their outputs come from
the cache.

MyST-NB 1.4 writes such a notebook without its outputs there, and nbval would then have nothing to
compare.
"""

from __future__ import annotations

from pathlib import Path

import nbformat
from jupyter_cache import get_cache


def restore_outputs(app, env) -> None:
    """Merge the cached outputs into every notebook that was read; an error if there are none."""
    folder = Path(app.outdir).parent
    cache = get_cache(folder / ".jupyter_cache")
    for path in (folder / "jupyter_execute").rglob("*.ipynb"):
        _, executed = cache.merge_match_into_notebook(nbformat.read(path, as_version=4))
        nbformat.write(executed, path)


def setup(app) -> dict[str, bool]:
    app.connect("env-updated", restore_outputs)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
