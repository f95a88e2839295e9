"""Sphinx extension: MathJax sets the formulas, from the book's own files.

A page loads the parts that it needs, two thirds of MathJax's usual bundle, and the book carries these and no others.  The fonts
that most formulas need come with a script (lighter.py says why).
"""

from __future__ import annotations

import re
import shutil
from importlib import resources
from pathlib import Path

from lighter import carried

PARTS = {  # MathJax's name of a part -> its file, and the part that must be there before
    "core": ("core.js", None),
    "input/tex-base": ("input/tex-base.js", "core"),
    "[tex]/ams": ("input/tex/extensions/ams.js", "input/tex-base"),
    "output/chtml": ("output/chtml.js", "core"),
    "a11y/assistive-mml": ("a11y/assistive-mml.js", "core"),
}
ASKED_FOR = "output/chtml/fonts/tex.js"  # by the output, of itself
FONTS = "output/chtml/fonts/woff-v2"
CARRIED = {
    "MJXZERO": "Zero",
    "MJXTEX": "Main-Regular",
    "MJXTEX-I": "Math-Italic",
    "MJXTEX-S1": "Size1-Regular",
    "MJXTEX-C": "Calligraphic-Regular",
    "MJXTEX-SS": "SansSerif-Regular",
}
LEAVE_OUT = """MathJax.startup = { ready() {  // the style sheet that MathJax writes would load them once more
  MathJax.startup.defaultReady();
  const faces = MathJax.startup.output.font.constructor.defaultFonts, here = %s;
  for (const [key, face] of Object.entries(faces)) if (here.includes(face["font-family"])) delete faces[key];
  MathJax.startup.promise.then(() => { document.documentElement.dataset.set = ""; });  // book.css keeps room for them till then
} };
"""


# What takes no room of its own in a line; what stands between two others, with room around it; indices; brackets and points.
NONE = re.compile(
    r"\\(?:[()!{},;: ]|"
    r"(?:math\w+|operatorname|text|left|right|hat|tilde|bar|dot|ddot|over\w+|wide\w+|displaystyle|[td]?frac|sqrt)\b)"
)
BETWEEN = re.compile(r"\\(?:le|ge|in|sim|to|approx|mid|equiv|ne|gg|ll|mapsto|propto|cdot|times)\b|[=<>+-]")
INDEX = re.compile(r"[_^](?:\{((?:[^{}]|\{[^{}]*\})*)\}|(\\[A-Za-z]+|.))")
THIN = re.compile(r"[(),.|'ijl]")


def width(tex: str) -> float:
    """About how wide a formula in a line will be, in em: half of 874 are nearer than 11 %, and lines hold several."""
    tex = NONE.sub("", tex.replace("\\ ", "."))  # a space that is asked for is as wide as a point
    small = sum(_letters(one or other) for one, other in INDEX.findall(tex))
    tex = INDEX.sub("", tex)
    between, thin = len(BETWEEN.findall(tex)), len(THIN.findall(BETWEEN.sub("", tex)))
    return 0.1 + 0.57 * (_letters(BETWEEN.sub("", tex)) - thin) + 0.5 * small + 1.34 * between + 0.46 * thin


def _letters(tex: str) -> int:
    return len(re.sub(r"[{}\s^_&\\]", "", re.sub(r"\\[A-Za-z]+", "x", tex)))


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
    faces = [(family, "normal", "normal", mine / FONTS / f"MathJax_{name}.woff") for family, name in CARRIED.items()]
    (mine / "fonts.js").write_text(carried(faces) + LEAVE_OUT % list(CARRIED), encoding="utf-8")


def setup(app) -> dict[str, bool]:
    app.add_js_file("mathjax/fonts.js", priority=600)  # behind MathJax's settings
    app.connect("config-inited", configure)
    app.connect("build-finished", copy)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
