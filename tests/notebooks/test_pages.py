"""Worked solutions as pages, and a student's notebook that is run before anything is written."""

import re

import nbformat
from nbclient import NotebookClient

from kfcourse.notebooks.execution import html
from kfcourse.notebooks.master import STUB, student

FORMULA = r"Let $x \sim \mathcal{N}(0, 1)$ and $y = h \sin x$."


def notebook(*cells):
    made = [nbformat.v4.new_code_cell(source) for source in cells]
    for number, cell in enumerate(made):
        cell.id = f"cell-{number}"
    return nbformat.v4.new_notebook(cells=made)


def test_a_page_has_colours_spaces_and_no_stray_scroll_bars():
    pages = notebook("def f(x):\n    return x")
    pages.cells.append(nbformat.v4.new_markdown_cell(FORMULA))
    page = html(pages, "a page")
    assert '<span class="k">def</span>' in page and ".highlight .k {" in page
    # as the converter and the one behind it write it
    plain = re.sub(r"</mspace>| /(?=>)", "", page)
    assert (
        "<mo>∼</mo>" in plain
        and '<mi>h</mi><mspace width="0.167em"><mi>sin</mi><mspace width="0.167em"><mi>x</mi>'
        in plain
    )
    assert "overflow: auto hidden" in page


def test_run_all_of_an_untouched_notebook_reaches_its_end():
    """A helper that calls what is not written yet shows an error, and the next question is still
    met."""
    stub = "def answer():\n    # BEGIN SOLUTION\n    return 1\n    # END SOLUTION"
    untouched = student(notebook("start = 1", stub, "value = answer()", "print('the end')"), {})
    assert STUB in untouched.cells[1].source
    assert [cell.metadata.get("tags", []) for cell in untouched.cells] == [
        [],
        [],
        ["raises-exception"],
        ["raises-exception"],
    ]
    untouched.metadata["kernelspec"] = {
        "name": "python3",
        "display_name": "Python 3",
        "language": "python",
    }
    done = NotebookClient(untouched, timeout=60).execute()
    assert done.cells[2].outputs[0].ename == "NotImplementedError"
    assert done.cells[3].outputs[0].text == "the end\n"
