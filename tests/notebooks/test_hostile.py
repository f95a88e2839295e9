"""Notebooks that mean harm: they are marked as their answers deserve, and end neither the run nor another notebook."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from endings import ended
from test_grade import FIXTURES, cell, solved
from tricks import CELLS, FUNCTIONS, PROCESSES

from kfcourse.checks import Exercise, exercise, sets
from kfcourse.notebooks.grading import keeper, marking, pool, running
from kfcourse.notebooks.grading.assembly import Step
from kfcourse.notebooks.grading.marking import Marking
from kfcourse.notebooks.grading.pool import Family, Worker
from kfcourse.notebooks.grading.running import Kernel, Opening, Site
from kfcourse.notebooks.grading.sandbox import Sandbox, chosen
from kfcourse.notebooks.grading.staging import answers, personal_numbers, stage
from kfcourse.notebooks.grading.submissions import returned
from kfcourse.notebooks.master import opened

TASK = exercise("b", "53")
B1 = next(question for question in TASK.questions.values() if question.name == "b1")
SALT = "hidden"
CHECK = Step('task.check("b1", gain)', "check", names=("task",), questions=("b1",))
POSIX = pytest.mark.skipif(os.name != "posix", reason="processes are kept by a keeper on POSIX only")


def known():
    """What a student can learn by heart: the arguments of the immediate check, and the right answers."""
    return [(values[0].ravel()[:3].tolist(), B1.answer(TASK)(*values).tolist()) for values in B1.arguments(TASK)]


def filled(code, **values):
    for name, value in ({"MEMORY": known()} | values).items():
        code = code.replace(f"{{{name}!r}}", repr(value)).replace(f"{{{name}}}", repr(value))
    return code


@pytest.fixture(scope="module")
def staged(tmp_path_factory):
    return stage(tmp_path_factory.mktemp("stage"))


def kernel_in(sandbox, staged, seconds=120.0, task=TASK):
    opening = Opening(task.letter, opened(task), personal_numbers(task))
    return Kernel(Site(staged, sandbox), opening, seconds)


OPEN = Step("import numpy as np\nfrom kfcourse.checks import exercise\ntask = exercise('b', '53')", "opening")


@pytest.fixture(scope="module")
def outside(tmp_path_factory):
    """A folder with another notebook, which no notebook has any business in."""
    folder = tmp_path_factory.mktemp("outside")
    (folder / "other.ipynb").write_text(json.dumps(solved()), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def kernel(staged, outside):
    """One process for all tricks that leave it alive; the others end it, and it is started anew."""
    with kernel_in(Sandbox("none", tuple(map(str, [*answers(), outside]))), staged) as started:
        assert Marking(TASK, SALT, (), print).run(started, [OPEN]) == []
        yield started


def marked(kernel, *steps):
    """The result of b1 after these cells, and where they stopped."""
    marking = Marking(TASK, SALT, (), lambda _: None)
    stopped = marking.run(kernel, steps)
    return marking.results.get("b1"), stopped


RIGHT = "def gain(Psi, G, F):\n    return np.swapaxes(np.linalg.solve(F, G @ Psi), -1, -2)"


def test_later_steps_may_stand_on_earlier_answers(kernel):
    """What was handed in stays there to be asked."""
    kernel.cell(RIGHT)
    assert kernel.cell(CHECK.source, CHECK.names).answers == {"b1": ""}
    assert kernel.cell('task.check("b2", 5)', ("task",)).answers == {"b2": "int"}
    (values, *_) = B1.arguments(TASK)
    assert np.allclose(kernel.ask("b1", values, 10.0), B1.answer(TASK)(*values))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_no_function_gets_more_than_it_deserves(kernel, name, monkeypatch):
    monkeypatch.setattr(running, "ANSWER", 1.0)
    monkeypatch.setattr(running, "ANSWERS", 2.0)
    monkeypatch.setattr(running, "GRACE", 1.0)
    result, _ = marked(kernel, Step(filled(FUNCTIONS[name]), "trick"), CHECK)
    assert result.status in ("wrong", "unusable"), result
    # and what comes after it is marked as if nothing had been
    kernel._done = [done for done in kernel._done if "gain" not in done[0]]
    result, stopped = marked(kernel, Step(RIGHT, "answer"), CHECK)
    assert result and result.passed, (result, stopped)


def test_an_endless_answer_is_ended_as_early_as_a_cell_and_the_time_said_is_its_own(kernel, monkeypatch):
    monkeypatch.setattr(kernel, "seconds", 1.0)
    result, _ = marked(kernel, Step("def gain(Psi, G, F):\n    while True:\n        pass", "answer"), CHECK)
    assert (result.status, result.message) == ("unusable", "still running after 1 s: is there a loop that never ends?")


@pytest.mark.parametrize("name", CELLS)
def test_no_cell_lets_a_wrong_answer_pass(kernel, name):
    """One after the other in the same process: what the earlier ones have changed stays changed."""
    wrong_gain = Step("def gain(Psi, G, F):\n    return G @ Psi", "answer")
    result, _ = marked(kernel, wrong_gain, Step(CELLS[name], "trick"), CHECK)
    assert result is None or result.status in ("wrong", "unusable", "not run")


def test_arguments_learned_by_heart_would_pass_without_a_salt():
    """The trick is real: it fails because the grader asks with arguments of its own."""
    namespace = {}
    exec(filled(FUNCTIONS["answers learned by heart"]), namespace)
    assert TASK.check("b1", namespace["gain"]).passed
    assert Exercise("b", TASK.variant, SALT).check("b1", namespace["gain"]).status == "wrong"


def test_the_salt_changes_no_personal_number():
    for letter in "bfhijkl":
        salted = Exercise(letter, exercise("b", "20").variant, SALT)
        assert salted.numbers == exercise(letter, "20").numbers


# -- what the notebook's process can see


def test_no_key_is_on_the_stage(staged):
    names = {path.name for path in staged.rglob("*") if path.suffix != ".pyc"}
    assert {"companion.py", "exercises.py", "session.py"} <= names
    assert not {
        name for name in names if name.startswith(("keys", "questions", "mistakes", "hidden", "messages", "shared", "statement"))
    }
    of_answers = {B1.answer(TASK).__module__.rpartition(".")[2]}
    assert not {name for name in names if name.removesuffix(".py") in of_answers}
    texts = [path.read_text(encoding="utf-8") for path in staged.rglob("*.py")]
    assert not [text for text in texts if "from kfcourse.exercises.b_aof" in text]


def test_what_the_masters_import_is_on_the_stage(staged):
    lines = {
        line
        for one in sets().values()
        for line in (one.folder / "statement.md").read_text(encoding="utf-8").splitlines()
        if line.startswith(("import ", "from "))
    }
    assert len(lines) > 10
    project = Path(sys.prefix).parent  # somebody may keep the returned notebooks and .venv in one folder
    with kernel_in(Sandbox("none", tuple(map(str, [*answers(), project]))), staged) as kernel:
        assert kernel.cell(f"open({str(project / 'notes.txt')!r})").error[0] == "PermissionError"
        assert {line: error for line in lines if (error := kernel.cell(line).error)} == {}


def bubblewrap(staged, folder, hidden):
    try:
        return chosen("bwrap", hidden, folder, staged)
    except ValueError as reason:
        pytest.skip(str(reason))


@pytest.fixture
def port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


def test_a_sandbox_holds(staged, outside, tmp_path, port):
    """Everything at once, then a right answer: it passes, and nothing has happened outside."""
    flag, written = tmp_path / "flag", outside / "written"
    sandbox = bubblewrap(staged, tmp_path, [*answers(), outside])
    values = {"OTHER": str(outside / "other.ipynb"), "OUTSIDE": str(written), "FLAG": str(flag), "PORT": port}
    steps = [Step(filled(code, **values), name, own=True) for name, code in PROCESSES.items()]
    listed = f"import os\nassert not os.path.exists({str(answers()[0])!r}) or not os.listdir({str(answers()[0])!r})"
    marking = Marking(TASK, SALT, (), lambda _: None)
    with kernel_in(sandbox, staged) as kernel:
        assert marking.run(kernel, [OPEN, *steps, Step(listed, "keys", own=True), Step(RIGHT, "answer"), CHECK]) == []
    assert marking.marks["b1"] == "passed"
    told = " ".join(marking.errors)
    assert not [word for word in ("has read", "has written", "has connected", "keys") if word in told], told
    assert not written.exists() and not flag.exists()
    assert {"sends signals to processes", "starts processes", "uses the network"} <= set(kernel.notes)


@POSIX
def test_without_a_sandbox_it_is_noted(kernel, outside, tmp_path, port):
    values = {"OTHER": str(outside / "other.ipynb"), "OUTSIDE": str(tmp_path / "x"), "FLAG": str(tmp_path / "flag"), "PORT": port}
    names = ("leaves a daemon", "reads another notebook", "writes outside", "uses the network")
    marked(kernel, *(Step(filled(PROCESSES[name], **values), name) for name in names))
    assert f"reads {outside / 'other.ipynb'}" in kernel.notes
    assert f"writes {tmp_path / 'x'}" in kernel.notes
    assert {"starts processes", "uses the network"} <= set(kernel.notes)
    left = int((tmp_path / "flag").read_text())
    assert os.path.exists(f"/proc/{left}") or sys.platform != "linux"
    kernel.close()  # the daemon, in a session of its own, is gone with it
    if sys.platform == "linux":
        assert ended(left)


@POSIX
def test_who_kills_its_process_is_named_and_the_next_is_graded(staged, tmp_path):
    """Without a sandbox: the keeper, then the grading process itself; the same worker goes on with the next notebook."""
    for name, trick in (("1", "kills its parent"), ("2", "kills all above it"), ("3", None)):
        notebook = solved()
        if trick:
            daemon = filled(PROCESSES["leaves a daemon"], FLAG=str(tmp_path / f"flag{name}"))
            cell(notebook, "import matplotlib").source += "\n" + daemon + PROCESSES[trick]
        (tmp_path / f"{name}.ipynb").write_text(json.dumps(notebook), encoding="utf-8")
    worker = Worker(marking.Setting(Site(staged, Sandbox("none")), SALT), Family())
    try:
        grades = [worker(work) for work in returned(tmp_path, masters=FIXTURES)]
    finally:
        worker.end()
    assert [grade.status for grade in grades[:2]] == ["not graded"] * 2
    assert all("was killed, twice: by the notebook, or by somebody else" in grade.note for grade in grades[:2])
    assert grades[2].passed == 2
    if sys.platform == "linux":
        assert all(ended(int((tmp_path / f"flag{name}").read_text())) for name in "12")


ENDS_FIRST = """
import ctypes, subprocess, threading, time

def begin():
    print(subprocess.Popen(["sleep", "600"]).pid, flush=True)
    time.sleep(600)

threading.Thread(target=begin).start()
ctypes.CDLL(None).pthread_exit(None)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a process that has ended is no parent")
def test_what_a_thread_has_started_is_found_when_the_main_one_has_ended():
    """Then the process is a zombie, and the parent of what lives: so it is for a moment whenever one with threads is killed."""
    with subprocess.Popen([sys.executable, "-c", ENDS_FIRST], stdout=subprocess.PIPE) as process:
        started = int(process.stdout.readline())
        try:
            assert ended(process.pid)
            assert started in keeper.below(os.getpid())
        finally:
            os.kill(started, signal.SIGKILL)
            process.kill()
    assert ended(started)


# -- processes that somebody kills


class Shot(Kernel):
    """A notebook's process that is killed, as by an administrator, while it does something, so many times."""

    at, times = "ask", 1

    def _request(self, message, until, functions):
        if message["do"] == self.at and "SLOW" in str(message.get("source", "SLOW")) and self.times:
            self.times -= 1
            threading.Timer(0.5, self.shoot).start()
        return super()._request(message, until, functions)

    def shoot(self):
        os.kill(keeper.below(self._process.popen.pid)[-1], signal.SIGKILL)


SLOW = "import time\ntime.sleep(1)  # SLOW"
STUB = "def gain(Psi, G, F):\n    import time\n    time.sleep(1)\n    raise NotImplementedError"


@POSIX
@pytest.mark.parametrize(("kind", "at", "source"), [("bwrap", "ask", STUB), ("none", "cell", SLOW + "\n" + STUB)])
def test_a_killed_notebook_is_run_again_then_not_graded(staged, tmp_path, kind, at, source):
    """It may be a stub that nobody has touched: what came of it must not count as an answer."""
    sandbox = bubblewrap(staged, tmp_path, answers()) if kind == "bwrap" else Sandbox("none")
    marks = []
    for times in (1, 2):
        marking, shot = Marking(TASK, SALT, (), lambda _: None), type("", (Shot,), {"at": at, "times": times})
        with shot(Site(staged, sandbox), Opening(TASK.letter, opened(TASK), personal_numbers(TASK))) as kernel:
            stopped = marking.run(kernel, [OPEN, Step(source, "answer", own=True), CHECK])
        assert kernel.times == 0
        marks.append(marking.marks["b1"])
    assert marks == ["not implemented", "not graded"]
    assert "was killed, twice" in " ".join([*stopped, *marking.failed()])


@POSIX
@pytest.mark.parametrize("times", [1, 2])
def test_a_killed_grading_process_asks_again(staged, tmp_path, monkeypatch, times):
    """With `kill -9`, while it compares the stub of b1; what it says of b2 holds."""
    notebook = solved()
    cell(notebook, "def gain").source = STUB
    cell(notebook, "def correct").source = cell(notebook, "def correct").source.replace("gain(Psi, G, F)", "other(Psi, G, F)")
    cell(notebook, "import matplotlib").source += "\n" + RIGHT.replace("gain", "other")
    (tmp_path / "x.ipynb").write_text(json.dumps(notebook), encoding="utf-8")
    worker, asked = Worker(marking.Setting(Site(staged, Sandbox("none")), SALT), Family()), []

    def wait(channel, *arguments):
        message = waited(channel, *arguments)
        if message.get("at") == "b1":
            asked.append(message)
            if len(asked) <= times:
                os.kill(worker._process.pid, signal.SIGKILL)
        return message

    waited = pool.Patient.wait
    monkeypatch.setattr(pool.Patient, "wait", wait)
    try:
        grade = worker(returned(tmp_path, masters=FIXTURES)[0])
    finally:
        worker.end()
    status, mark, digest = ("graded", "not implemented", True) if times == 1 else ("graded in part", "not graded", False)
    assert (grade.status, grade.marks["b1"], grade.marks["b2"]) == (status, mark, "passed")
    assert bool(grade.digest) is digest and ("look: b1 not graded" in grade.note) is not digest


def test_nothing_of_the_teachers_path_is_in_the_sandbox(staged, tmp_path, monkeypatch):
    """PYTHONPATH may be a home with everything in it."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "keys_of_the_exam.py").write_text("answer = 42", encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "mine"))
    with kernel_in(bubblewrap(staged, tmp_path, answers()), staged) as kernel:
        assert kernel.cell("import keys_of_the_exam").error[0] == "ModuleNotFoundError"
        assert kernel.cell(f"open({str(tmp_path / 'mine' / 'keys_of_the_exam.py')!r})").error[0] == "FileNotFoundError"
        assert kernel.cell("import os\nassert not os.environ['PYTHONPATH'].count(os.pathsep)").error is None


# -- the grading process itself hangs or ends


SCRIPT = """
import json, os, struct, time

def receive():
    return json.loads(os.read(0, struct.unpack('>Q', os.read(0, 8))[0]))

def send(message):
    data = json.dumps(message).encode()
    os.write(1, struct.pack('>Q', len(data)) + data)

receive()
while True:
    skip = receive()['skip']
    for question in ('b1', 'b2'):
        send({'at': question})
        if question not in skip:
            {fate}
    fields = dict(name='x', status='graded', letter='b', variant='53', marks={'b1': ','.join(skip)}, note='', digest='')
    send({'grade': fields | dict(told={}, student='', work='')})
"""


@pytest.mark.parametrize("fate", ["time.sleep(60)", "os.abort()", "os.write(1, b'x' * 99)"])
def test_an_answer_that_stops_or_ends_the_grading_process_is_left_out(tmp_path, monkeypatch, staged, fate):
    """As a comparison in compiled code might that no alarm interrupts, or that takes all memory."""

    class Fake(Family):
        def start(self, command):
            return super().start([sys.executable, "-S", "-c", SCRIPT.replace("{fate}", fate)])

    monkeypatch.setattr(pool, "START", 3.0)
    monkeypatch.setattr(pool, "QUIET", 0.0)
    (tmp_path / "x.ipynb").write_text("{}", encoding="utf-8")
    worker = Worker(marking.Setting(Site(staged, Sandbox("none")), SALT), Fake())
    (work,) = returned(tmp_path, seconds=0.0)
    try:
        assert worker(work).marks == {"b1": "b1,b2"}
        monkeypatch.setattr(pool, "AGAIN", 1)
        grade = worker(work)
    finally:
        worker.end()
    told = "the grading process hung; at b2" if "sleep" in fate else "the grading process was killed, twice"
    assert grade.status == "not graded" and grade.note.startswith(told) and grade.note.endswith("at b2")
