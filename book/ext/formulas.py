"""Sphinx extension: formulas are set when the book is built.

MathJax, run by the Node that playwright brings, writes each formula as the elements and the MathML
that it would write in a browser; all pages share one style sheet and its fonts.  So a page needs no
script to show a formula, no line of it moves, and TeX that cannot be read stops the build.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from functools import cache
from importlib import resources
from pathlib import Path

from docutils import nodes
from playwright._impl._driver import compute_driver_executable
from sphinx.util import logging
from sphinx.util.math import get_node_equation_number
from sphinx.writers.html5 import HTML5Translator

MATHJAX = Path(str(resources.files("sphinx-mathjax-offline"))) / "static" / "mathjax"
FONTS = MATHJAX / "output" / "chtml" / "fonts" / "woff-v2"
SHEET = "formulas.css"
log = logging.getLogger(__name__)


class Unreadable(ValueError):
    """TeX that MathJax cannot read; the message says why."""


class Setter:
    """MathJax in a process of its own, begun with the first formula."""

    def __init__(self) -> None:
        self.process: subprocess.Popen[str] | None = None
        self.html = cache(self._html)

    def _html(self, tex: str, display: bool) -> str:
        """A formula as HTML, in a line or displayed."""
        answer = self._ask([tex, display])
        if "error" in answer:
            raise Unreadable(f"MathJax cannot read {tex!r}: {answer['error']}")
        return answer["html"]

    def sheet(self) -> str:
        """The style sheet of all formulas set so far."""
        return self._ask(None)["css"]

    def _ask(self, what) -> dict[str, str]:
        if self.process is None:
            command = [compute_driver_executable()[0], Path(__file__).with_suffix(".js"), MATHJAX]
            self.process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8"
            )
        self.process.stdin.write(f"{json.dumps(what)}\n")
        self.process.stdin.flush()
        if line := self.process.stdout.readline():
            return json.loads(line)
        raise RuntimeError(
            f"Node ended while it set {what!r}, and said why above; `make install` installs what "
            f"it needs"
        )

    def close(self) -> None:
        if self.process is not None:
            self.process.communicate()
            self.process = None


SETTER = Setter()


def _set(node: nodes.Element, tex: str, display: bool) -> str:
    try:
        return SETTER.html(tex, display)
    except Unreadable as reason:
        log.warning("%s", reason, location=node)
        return ""


def in_a_line(writer: HTML5Translator, node: nodes.math) -> None:
    writer.body += [
        writer.starttag(node, "span", "", CLASS="math"),
        _set(node, node.astext(), False),
        "</span>",
    ]
    raise nodes.SkipNode


def displayed(writer: HTML5Translator, node: nodes.math_block) -> None:
    """With its number; the keyboard reaches it and can scroll it where it is wider than the
    screen."""
    number = get_node_equation_number(writer, node) if node["number"] else ""
    writer.body.append(writer.starttag(node, "div", CLASS="math"))
    if number:
        writer.body.append(f'<span class="eqno">({number})')
        writer.add_permalink_ref(node, "Link to this equation")
        writer.body.append("</span>")
    tex = node.astext() if node["nowrap"] else _lines(node.astext())
    name = f"Formula {number}".strip()
    reached = f'<mjx-container tabindex="0" role="group" aria-label="{name}"'
    writer.body += [_set(node, tex, True).replace("<mjx-container", reached, 1), "</div>\n"]
    raise nodes.SkipNode


def _lines(tex: str) -> str:
    """Lines that end with a double backslash, and equations with an empty line between them, stand
    one below the other."""
    parts = [
        rf"\begin{{split}}{part}\end{{split}}" if r"\\" in part else part
        for part in tex.split("\n\n")
        if part.strip()
    ]
    together = r" \\ ".join(parts)
    return (
        together
        if len(parts) == 1
        else rf"\begin{{align}}\begin{{aligned}}{together}\end{{aligned}}\end{{align}}"
    )


def write(app, exception: Exception | None) -> None:
    """The style sheet, and the fonts that it names."""
    try:
        if exception is None and app.builder.format == "html":
            static = Path(app.outdir, "_static")
            sheet = SETTER.sheet()
            (static / SHEET).write_text(sheet, encoding="utf-8")
            for name in re.findall(r"MathJax_[\w-]+\.woff", sheet):
                shutil.copyfile(FONTS / name, static / "fonts" / name)
    finally:
        SETTER.close()


def setup(app) -> dict[str, bool]:
    app.add_html_math_renderer("set", (in_a_line, None), (displayed, None))
    app.add_css_file(SHEET, priority=400)  # below the book's own
    app.connect("build-finished", write)
    return {"parallel_read_safe": True, "parallel_write_safe": False}
