"""Sphinx extension: MathJax sets the formulas, from the book's own files.

A page loads the parts that it needs, two thirds of MathJax's usual bundle, and the book carries these and no others.
"""

from __future__ import annotations

import shutil
from importlib import resources
from pathlib import Path

PARTS = {  # MathJax's name of a part -> its file, and the part that must be there before
    "core": ("core.js", None),
    "input/tex-base": ("input/tex-base.js", "core"),
    "[tex]/ams": ("input/tex/extensions/ams.js", "input/tex-base"),
    "output/chtml": ("output/chtml.js", "core"),
    "a11y/assistive-mml": ("a11y/assistive-mml.js", "core"),
}
ASKED_FOR = "output/chtml/fonts/tex.js"  # by the output, of itself
FONTS = "output/chtml/fonts/woff-v2"


def configure(app, config) -> None:
    config.mathjax_path = "mathjax/startup.js"
    before = {part: [other] for part, (_, other) in PARTS.items() if other}
    config.mathjax3_config = {"loader": {"load": list(PARTS), "dependencies": before}, "tex": {"packages": ["base", "ams"]}}


def copy(app, error) -> None:
    if error is not None or app.builder.format != "html":
        return
    whole = Path(str(resources.files("sphinx-mathjax-offline"))) / "static" / "mathjax"
    mine = Path(app.outdir, "_static", "mathjax")
    for name in ("startup.js", ASKED_FOR, *(file for file, _ in PARTS.values())):
        (mine / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(whole / name, mine / name)
    shutil.copytree(whole / FONTS, mine / FONTS, dirs_exist_ok=True)


def setup(app) -> dict[str, bool]:
    app.connect("config-inited", configure)
    app.connect("build-finished", copy)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
