"""Kernels that are forked: they are kernels like others, only sooner."""

import itertools
import subprocess
import sys
from multiprocessing import forkserver

import nbformat
import pytest
from endings import ended
from jupyter_client.connect import LocalPortCache
from jupyter_client.manager import start_new_kernel
from jupyter_client.provisioning import KernelProvisionerFactory
from nbclient import NotebookClient
from nbclient.exceptions import CellTimeoutError, DeadKernelError

from kfcourse.exercises.notebooks.kernels import FORKED, IMPORTED

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forked on Linux only")


@pytest.fixture(autouse=True)
def forked(monkeypatch):
    monkeypatch.setenv("JUPYTER_DEFAULT_PROVISIONER_NAME", FORKED)
    KernelProvisionerFactory.clear_instance()  # it reads the variable once
    yield
    KernelProvisionerFactory.clear_instance()


def run(*cells, folder, seconds=60):
    """What a notebook of these cells shows."""
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    place = {"metadata": {"path": str(folder)}}
    client = NotebookClient(notebook, timeout=seconds, kernel_name="python3", resources=place)
    try:
        client.execute()
    finally:
        assert client.km is None or not client.km.has_kernel
    return [output for cell in notebook.cells for output in cell.outputs]


def test_it_is_a_kernel_of_its_own_notebook(tmp_path, monkeypatch):
    """The libraries are there before they are imported, but not their names; nothing of another
    notebook is, nor its folder or environment."""
    # one that grading has started in this process has other libraries
    forkserver._forkserver._stop()
    cells = (
        f"import sys; print(all(name in sys.modules for name in {IMPORTED}))",
        "print(sorted({'np', 'sympy', 'secret'} & set(dir())), 'mine' in dir(sys.modules['sympy']))",
        "import os; print(os.environ['KFCOURSE_TOLD'], os.getcwd())",
        "import sympy; sympy.mine = 1; secret = 2",
        "import matplotlib.pyplot as plt\nplt.plot([1, 2])\nplt.show()",
    )
    for value in ("first", "second"):  # the fork server knows the first only
        monkeypatch.setenv("KFCOURSE_TOLD", value)
        folder = tmp_path / value
        folder.mkdir()
        *texts, figure = run(*cells, folder=folder)
        assert [each.text for each in texts] == ["True\n", "[] False\n", f"{value} {folder}\n"]
        assert "image/png" in figure.data


def test_two_processes_that_choose_the_same_ports_have_their_kernels_both(monkeypatch):
    """Ports are chosen before the kernel takes them: another process may have chosen them, too."""
    cache = LocalPortCache()
    chosen = itertools.cycle([cache.find_available_port("127.0.0.1") for _ in range(5)])
    monkeypatch.setattr(LocalPortCache, "find_available_port", lambda *_: next(chosen))
    kernels = []
    try:
        for _ in range(2):
            kernels.append(start_new_kernel())
        for _, client in kernels:
            assert client.kernel_info(reply=True, timeout=30)["content"]["status"] == "ok"
    finally:
        for manager, client in kernels:
            client.stop_channels()
            manager.shutdown_kernel(now=True)


@pytest.mark.parametrize(
    ("cell", "seconds", "error"),
    [
        ("while True: pass", 1, CellTimeoutError),
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", 60, DeadKernelError),
    ],
)
def test_its_time_ends_and_its_death_is_noticed(tmp_path, cell, seconds, error):
    with pytest.raises(error):
        run(cell, folder=tmp_path, seconds=seconds)


def test_it_ends_with_the_process_that_wanted_it_however_that_ends():
    """The fork server lives as long as one of its forks does, and they as long as it: both were
    left."""
    starts = (
        "import os; from jupyter_client.manager import start_new_kernel; from kfcourse.exercises.notebooks "
        "import kernels\n"
        "kernels.IMPORTED[:] = ['ipykernel.kernelapp']\n"
        "manager, client = start_new_kernel(); print(manager.provisioner.pid, flush=True); "
        "os.kill(os.getpid(), 9)"
    )
    command = [sys.executable, "-c", starts]
    started = subprocess.run(command, stdout=subprocess.PIPE, text=True, timeout=300)
    assert ended(int(started.stdout))
