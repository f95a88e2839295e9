"""Executing notebooks and exporting them: each in a kernel of its own, with a time limit."""

from __future__ import annotations

import asyncio
import base64
import re
import shutil
import subprocess
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError, CellTimeoutError, DeadKernelError
from nbconvert import HTMLExporter
from nbformat import NotebookNode

from kfcourse.exercises.checks.question import MIME
from kfcourse.exercises.notebooks.texts import page as written
from kfcourse.symbolic.markup import mathml as formula

# a cell may take: what needs a student's minute alone shares a busy machine here
SECONDS = 300.0
PRINTING = 120  # seconds until a page is printed
BROWSERS = ("chromium", "google-chrome", "chromium-browser", "msedge", "chrome")


class _Client(NotebookClient):
    """Leaves signals to the command.

    The client's own handlers end the kernel and nothing else: the next notebook would go on after
    Ctrl-C.
    """

    @asynccontextmanager
    async def async_setup_kernel(self, **kwargs: Any) -> AsyncIterator[None]:
        loop = asyncio.get_running_loop()
        # as outside of the main thread
        with mock.patch.object(loop, "add_signal_handler", side_effect=RuntimeError):
            async with super().async_setup_kernel(**kwargs):
                yield


class NotebookFailed(RuntimeError):
    """A notebook stopped; the message names the cell."""


def execute(notebook: NotebookNode) -> NotebookNode:
    """Run a notebook in a new kernel and an empty folder.

    Parameters
    ----------
    notebook : NotebookNode
        Not changed.

    Raises
    ------
    NotebookFailed
        A cell raises an error or takes too long, or the kernel dies.
    """
    result = nbformat.from_dict(notebook)
    started: list[str] = []  # ids of cells: a running one has a number of execution already
    client = _Client(
        result,
        timeout=SECONDS,
        kernel_name="python3",
        record_timing=False,
        on_cell_execute=lambda cell, cell_index: started.append(cell.id),
        extra_arguments=["--log-level=ERROR"],
    )
    with tempfile.TemporaryDirectory() as folder:
        client.resources = {"metadata": {"path": folder}}
        try:
            client.execute()
        except (CellExecutionError, CellTimeoutError, DeadKernelError) as error:
            why = "the kernel died (out of memory?)"
            if isinstance(error, CellExecutionError):
                why = f"{error.ename}: {error.evalue}"
            elif isinstance(error, CellTimeoutError):
                why = f"still running after {SECONDS:g} s"
            raise NotebookFailed(f"cell {started[-1]}: {why}") from None
    if failure := first_error(result):
        cell, shown = failure
        raise NotebookFailed(f"cell {cell.id}: {shown.ename}: {shown.evalue}")
    return result


def first_error(notebook: NotebookNode) -> tuple[NotebookNode, NotebookNode] | None:
    """The first cell that shows an error it is not tagged to raise, and that output.

    A cell whose picture cannot be drawn shows one, too, though for its kernel it ended well.
    """
    for cell in notebook.cells:
        if "raises-exception" in cell.metadata.get("tags", []):
            continue
        for output in cell.get("outputs", []):
            if output.output_type == "error":
                return cell, output
    return None


def pictures(executed: NotebookNode) -> dict[str, bytes]:
    """PNG of every cell tagged `picture`, by cell id."""
    images = {}
    for cell in executed.cells:
        if "picture" in cell.metadata.get("tags", []):
            for output in cell.outputs:
                if png := output.get("data", {}).get("image/png"):
                    images[cell.id] = base64.b64decode(png)
    return images


def results(executed: NotebookNode) -> list[dict[str, Any]]:
    """What the checks of an executed notebook found: dicts with question, status, diagnosis and
    message."""
    return [
        output.data[MIME]
        for cell in executed.cells
        for output in cell.get("outputs", [])
        if MIME in output.get("data", {})
    ]


def html(executed: NotebookNode, title: str) -> str:
    """The executed notebook as one page that needs no network: formulas as MathML, pictures
    inside."""
    copy = nbformat.from_dict(executed)
    for cell in copy.cells:
        if cell.cell_type == "markdown":
            cell.source = mathml(cell.source)
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "text/latex" in data:
                data["text/html"] = mathml(data["text/latex"])
            if "text/markdown" in data:
                data["text/markdown"] = mathml(data["text/markdown"])
    body, resources = HTMLExporter(template_name="basic").from_notebook_node(copy)
    return written("notebook", title=title, body=body, colours=resources["inlining"]["css"][-1])


def mathml(text: str) -> str:
    """TeX between dollars as MathML; code in backquotes stays."""

    def written_out(match: re.Match) -> str:
        code, block, inline = match.groups()
        tex = (block or inline or "").replace(r"\displaystyle", "").strip()
        return code or formula(tex, "block" if block else "inline")

    return re.sub(
        r"(```.*?```|`[^`\n]*`)|\$\$(.+?)\$\$|(?<![\\$])\$([^$]+?)\$",
        written_out,
        text,
        flags=re.DOTALL,
    )


def pdf(page: Path, target: Path) -> None:
    """Print an HTML file to PDF by a Chromium browser.

    Raises
    ------
    NotebookFailed
        No browser on this machine, or it fails.
    """
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise NotebookFailed(
            f"no browser to print PDF with; install one of {', '.join(BROWSERS[:3])}, or print "
            f"{page} yourself"
        )
    with tempfile.TemporaryDirectory() as profile:
        command = [browser, "--headless", "--no-sandbox", "--disable-gpu"]
        command += [f"--user-data-dir={profile}", "--no-pdf-header-footer"]
        command += [f"--print-to-pdf={target}", page.resolve().as_uri()]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PRINTING)
    if done.returncode or not target.exists() or not target.stat().st_size:
        raise NotebookFailed(f"{browser} could not print {page}: {done.stderr.strip()[-200:]}")
