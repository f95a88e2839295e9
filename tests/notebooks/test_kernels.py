"""Kernels that are forked: they are kernels like others, only sooner."""

import itertools
import subprocess
import sys
from multiprocessing import forkserver
from pathlib import Path

import nbformat
import pytest
from endings import ended
from jupyter_client.connect import LocalPortCache
from jupyter_client.manager import start_new_kernel
from jupyter_client.provisioning import KernelProvisionerFactory
from nbclient import NotebookClient
from nbclient.exceptions import CellTimeoutError, DeadKernelError

from kfcourse.notebooks.kernels import FORKED, IMPORTED

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forked on Linux only")


@pytest.fixture(autouse=True)
def forked(monkeypatch):
    monkeypatch.setenv("JUPYTER_DEFAULT_PROVISIONER_NAME", FORKED)
    KernelProvisionerFactory.clear_instance()  # it reads the variable once
    yield
    KernelProvisionerFactory.clear_instance()


def run(*cells: str, folder: Path, seconds: float = 60):
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    client = NotebookClient(
        notebook,
        timeout=seconds,
        kernel_name="python3",
        resources={"metadata": {"path": str(folder)}},
    )
    try:
        client.execute()
    finally:
        assert client.km is None or not client.km.has_kernel
    return [
        [output.get("text", output.get("data")) for output in cell.outputs]
        for cell in notebook.cells
    ]


def test_the_libraries_are_there_before_they_are_imported(tmp_path):
    # one that grading has started in this process has other libraries
    forkserver._forkserver._stop()
    ((loaded,), (names,)) = run(
        f"import sys; print(all(name in sys.modules for name in {IMPORTED}))",
        "print(sorted(dir()))",
        folder=tmp_path,
    )
    assert loaded == "True\n"
    assert "sympy" not in names and "np" not in names, "the names of a notebook are its own"


def test_it_has_the_folder_and_the_environment_of_its_notebook(tmp_path, monkeypatch):
    for value in ("first", "second"):  # the fork server knows the first only
        monkeypatch.setenv("KFCOURSE_TOLD", value)
        (tmp_path / value).mkdir()
        ((told,),) = run(
            "import os; print(os.environ['KFCOURSE_TOLD'], os.getcwd())", folder=tmp_path / value
        )
        assert told == f"{value} {tmp_path / value}\n"


def test_it_shows_figures(tmp_path):
    (outputs,) = run(
        "import matplotlib.pyplot as plt\nplt.plot([1, 2])\nplt.show()", folder=tmp_path
    )
    assert "image/png" in outputs[-1]


def test_one_notebook_does_not_see_another(tmp_path):
    run("import sympy\nsympy.mine = 1\nsecret = 2", folder=tmp_path)
    ((seen,),) = run(
        "import sympy\nprint(hasattr(sympy, 'mine'), 'secret' in globals())", folder=tmp_path
    )
    assert seen == "False False\n"


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


def test_its_time_ends(tmp_path):
    with pytest.raises(CellTimeoutError):
        run("while True: pass", folder=tmp_path, seconds=1)


def test_its_death_is_noticed(tmp_path):
    with pytest.raises(DeadKernelError):
        run("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", folder=tmp_path)


def test_it_ends_with_the_process_that_wanted_it_however_that_ends():
    """The fork server lives as long as one of its forks does, and they as long as it: both were
    left."""
    starts = (
        "import os; from jupyter_client.manager import start_new_kernel; from kfcourse.notebooks "
        "import kernels\n"
        "kernels.IMPORTED[:] = ['ipykernel.kernelapp']\n"
        "manager, client = start_new_kernel(); print(manager.provisioner.pid, flush=True); "
        "os.kill(os.getpid(), 9)"
    )
    started = subprocess.run(
        [sys.executable, "-c", starts], stdout=subprocess.PIPE, text=True, timeout=60
    )
    assert ended(int(started.stdout))
