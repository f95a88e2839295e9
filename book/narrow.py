"""Sphinx extension: a screen of a telephone shows the narrow picture of a figure, panels one under the other.

The pictures of cells carry theirs in the metadata of the output (`kfcourse.pages.figures.book_style`); MyST-NB calls the file
of a picture by the hash of its bytes, and the narrow one stands beside it.  Those of the exercise sets are files beside the
page's own pictures (manual.py).
"""

from __future__ import annotations

import base64
import hashlib
import struct
from pathlib import Path

import nbformat
from docutils import nodes

WIDEST = "(max-width: 600px)"
ENDING = "-narrow.png"  # what follows the name of the wide one, without its ending


def shown_size(png: bytes) -> tuple[int, int]:
    """Width and height of a picture on a page: it has twice the pixels of a screen."""
    width, height = struct.unpack(">II", png[16:24])
    return width // 2, height // 2


def collect(app, env) -> None:
    """The narrow pictures, by the names of the wide ones' files."""
    env.kf_narrow = {
        hashlib.sha256(base64.b64decode(output["data"]["image/png"])).hexdigest(): base64.b64decode(narrow)
        for path in (Path(app.outdir).parent / "jupyter_execute").rglob("*.ipynb")
        for cell in nbformat.read(path, as_version=4).cells
        for output in cell.get("outputs", [])
        if (narrow := output.get("metadata", {}).get("image/png", {}).get("narrow"))
    }


def choose(app, doctree, name: str) -> None:
    """Put both pictures where there are two."""
    for image in list(doctree.findall(nodes.image)):
        beside = Path(app.srcdir, image["uri"]).with_name(Path(image["uri"]).stem + ENDING)
        narrow = beside.read_bytes() if beside.exists() else app.env.kf_narrow.get(Path(image["uri"]).stem)
        if narrow is None or app.builder.format != "html":
            continue
        file = Path(app.outdir, "_images", Path(image["uri"]).stem + ENDING)
        file.parent.mkdir(exist_ok=True)
        file.write_bytes(narrow)
        width, height = shown_size(narrow)
        up = "../" * name.count("/")
        source = f'<source media="{WIDEST}" srcset="{up}_images/{file.name}" width="{width}" height="{height}">'
        image["classes"].append("no-scaled-link")  # inside a link, the picture would not be the child of its element
        place = image.parent.index(image)
        image.parent.insert(place, nodes.raw("", f"<picture>{source}", format="html"))
        image.parent.insert(place + 2, nodes.raw("", "</picture>", format="html"))


def setup(app) -> dict[str, bool]:
    app.connect("env-updated", collect, priority=900)  # after executed.py has put the outputs there
    app.connect("doctree-resolved", choose)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
