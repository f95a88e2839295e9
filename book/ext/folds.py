"""Sphinx extension: code that is folded away stands after what it shows, and neighbouring cells
share one fold.

A reader sees the figure, the equation or the sentence first, and under it a small mark that opens
the code.  What computes the answer to a question is folded with the answer.

    ```{more} The derivation, the filter, and a flight past a beacon
    ```

folds the rest of its section under these words: what a first reader may pass over, where a page is
long.  The boxes that close a chapter stay open.
"""

from __future__ import annotations

import html
from itertools import groupby, takewhile

from docutils import nodes
from myst_nb.sphinx_ import HideCodeCellNode, HideInputCells
from sphinx.transforms.post_transforms import SphinxPostTransform
from sphinx.util.docutils import SphinxDirective


class FoldsBelow(SphinxPostTransform):
    """One fold after each run of cells whose input is hidden."""

    # which would put a fold above every cell
    default_priority = HideInputCells.default_priority - 1
    formats = ("html",)

    def run(self, **kwargs) -> None:
        for parent in {
            id(cell.parent): cell.parent for cell in self.document.findall(_folded)
        }.values():
            for together, cells in groupby(list(parent.children), _folded):
                if together:
                    _fold(list(cells))


class AnswersWhole(SphinxPostTransform):
    """The cells that compute an answer stand in its box, not as folds of their own under each
    question."""

    default_priority = HideInputCells.default_priority - 1
    formats = ("html",)

    def run(self, **kwargs) -> None:
        for answer in [
            box for box in self.document.findall(nodes.Admonition) if "answer" in box["classes"]
        ]:
            for cell in list(takewhile(_hidden, answer.parent[answer.parent.index(answer) + 1 :])):
                cell.parent.remove(cell)
                answer += cell


class more_below(nodes.General, nodes.Element):
    """Stands before what is folded until all of the section is there."""


class More(SphinxDirective):
    required_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        return [more_below("", words=self.arguments[0])]


class MoreBelow(SphinxPostTransform):
    """The rest of a section, up to its subsections or the box of its algorithm or key points,
    behind a line to click."""

    default_priority = 500
    formats = ("html",)

    def run(self, **kwargs) -> None:
        for mark in list(self.document.findall(more_below)):
            section = mark.parent
            begin = section.index(mark)
            end = next(
                (place for place in range(begin, len(section)) if _closing(section[place])),
                len(section),
            )
            section.insert(end, nodes.raw("", "</details>", format="html"))
            opening = f'<details class="kf-more"><summary>{html.escape(mark["words"])}</summary>'
            section[begin] = nodes.raw("", opening, format="html")


def _closing(node: nodes.Node) -> bool:
    return isinstance(node, nodes.section) or (
        isinstance(node, nodes.Element)
        and not {"algorithm", "keypoints"}.isdisjoint(node.get("classes", []))
    )


def _folded(node: nodes.Node) -> bool:
    return (
        isinstance(node, nodes.container)
        and node.get("nb_element") == "cell_code"
        and node.get("hide_mode") == "input"
    )


def _hidden(node: nodes.Node) -> bool:
    return isinstance(node, nodes.container) and node.get("hide_mode") == "all"


def _fold(cells: list[nodes.container]) -> None:
    last = cells[-1]
    fold = HideCodeCellNode(
        prompt_show=last["prompt_show"], prompt_hide=last["prompt_hide"], classes=["below-output"]
    )
    for cell in cells:
        cell["hide_mode"] = None
        if cell.children and cell.children[0].get("nb_element") == "cell_code_source":
            source = cell.children[0]
            cell.remove(source)
            fold.append(source)
        if not cell.children and cell is not last:
            cell.parent.remove(cell)
    last.append(fold)


def setup(app) -> dict[str, bool]:
    app.add_directive("more", More)
    app.add_post_transform(FoldsBelow)
    app.add_post_transform(AnswersWhole)
    app.add_post_transform(MoreBelow)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
