"""Sphinx extension: MathJax sets the formulas, from the book's own files.

A page loads the parts that it needs, two thirds of MathJax's usual bundle, and the book carries these and no others.
"""

from __future__ import annotations

import shutil
from importlib import resources
from pathlib import Path

PARTS = {  # MathJax's name of a part -> its file
    "core": "core.js",
    "input/tex-base": "input/tex-base.js",
    "[tex]/ams": "input/tex/extensions/ams.js",
    "output/chtml": "output/chtml.js",
    "output/chtml/fonts/tex": "output/chtml/fonts/tex.js",
    "a11y/assistive-mml": "a11y/assistive-mml.js",
}
FONTS = "output/chtml/fonts/woff-v2"


def configure(app, config) -> None:
    config.mathjax_path = "mathjax/startup.js"
    config.mathjax3_config = {"loader": {"load": list(PARTS)}, "tex": {"packages": ["base", "ams"]}}


def copy(app, error) -> None:
    if error is not None or app.builder.format != "html":
        return
    whole = Path(str(resources.files("sphinx-mathjax-offline"))) / "static" / "mathjax"
    mine = Path(app.outdir, "_static", "mathjax")
    for name in ("startup.js", *PARTS.values()):
        (mine / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(whole / name, mine / name)
    shutil.copytree(whole / FONTS, mine / FONTS, dirs_exist_ok=True)


def setup(app) -> dict[str, bool]:
    app.connect("config-inited", configure)
    app.connect("build-finished", copy)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
