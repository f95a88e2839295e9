"""Notebooks that mean harm: they are marked as their answers deserve, and end neither the run nor
another notebook."""

import json
import os
import socket
import time
from dataclasses import replace

import numpy as np
import pytest
from endings import ended
from inside import FIXTURES, solved
from tricks import CELLS, FUNCTIONS, PROCESSES, READS

from kfcourse.exercises.checks import Exercise, exercise, sets
from kfcourse.exercises.grading import marking, pool, running, sandbox
from kfcourse.exercises.grading.assembly import Step
from kfcourse.exercises.grading.marking import Marking, Setting
from kfcourse.exercises.grading.running import KILLED, Kernel
from kfcourse.exercises.grading.sandbox import Sandbox
from kfcourse.exercises.grading.staging import packages, stage
from kfcourse.exercises.grading.submissions import returned

TASK = exercise("b", "53")
B1 = TASK.questions["b1"]
SALT = "hidden"
OPEN = Step(
    "import numpy as np\nfrom kfcourse.checks import exercise\ntask = exercise('b', '53')",
    "opening",
)
CHECK = Step('task.check("b1", gain)', "check", names=("task",), questions=("b1",))
RIGHT = Step(
    "def gain(Psi, G, F):\n    return np.swapaxes(np.linalg.solve(F, G @ Psi), -1, -2)", "answer"
)
POSIX = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")


def filled(code, **values):
    """A trick with its values; what a student can learn by heart are the arguments of the immediate
    check, and the right answers."""
    known = [
        (arguments[0].ravel()[:3].tolist(), B1.answer(TASK)(*arguments).tolist())
        for arguments in B1.arguments(TASK)
    ]
    for name, value in ({"MEMORY": known} | values).items():
        code = code.replace(f"{{{name}!r}}", repr(value)).replace(f"{{{name}}}", repr(value))
    return code


@pytest.fixture(scope="module")
def staged(tmp_path_factory):
    return stage(tmp_path_factory.mktemp("stage"))


@pytest.fixture(scope="module")
def box(tmp_path_factory, staged):
    """Bubblewrap's sandbox, or none where it does not work."""
    box = Sandbox("bwrap", staged, tuple(map(str, packages())))
    return replace(box, kind="none") if sandbox.problem(box) else box


def kernel_in(box):
    return Kernel(box, TASK, 120.0)


@pytest.fixture(scope="module")
def kernel(box):
    """One process for all tricks that leave it alive; the others end it, and it is started anew."""
    with kernel_in(box) as started:
        marked(started, OPEN)
        yield started


def marked(kernel, *steps):
    """The result of b1 after these cells."""
    marking = Marking(TASK, SALT)
    marking.run(kernel, steps)
    return marking.results["b1"]


def test_later_steps_may_stand_on_earlier_answers(kernel):
    """What was handed in stays there to be asked."""
    kernel.cell(RIGHT.source)
    assert kernel.cell(CHECK.source, CHECK.names).answers == {"b1": ""}
    assert kernel.cell('task.check("b2", 5)', ("task",)).answers == {"b2": "int"}
    (values, *_) = B1.arguments(TASK)
    assert np.allclose(kernel.ask("b1", values, 10.0), B1.answer(TASK)(*values))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_no_function_gets_more_than_it_deserves(kernel, box, name, monkeypatch):
    if name in READS and box.kind == "none":
        pytest.skip("reads a file, and nothing hides it without a sandbox: so the command says")
    for limit, seconds in (("ANSWER", 1.0), ("GRACE", 1.0)):
        monkeypatch.setattr(running, limit, seconds)
    result = marked(kernel, Step(filled(FUNCTIONS[name]), "trick"), CHECK)
    assert result.status in ("wrong", "unusable"), result
    # and what comes after it is marked as if nothing had been
    kernel._done = [done for done in kernel._done if "gain" not in done["source"]]
    result = marked(kernel, RIGHT, CHECK)
    assert result.passed, result


def test_an_endless_answer_is_ended_as_early_as_a_cell_and_the_time_said_is_its_own(
    kernel, monkeypatch
):
    monkeypatch.setattr(kernel, "seconds", 1.0)
    endless = Step("def gain(Psi, G, F):\n    while True:\n        pass", "answer")
    message = "still running after 1 s: is there a loop that never ends?"
    result = marked(kernel, endless, CHECK)
    assert (result.status, result.message) == ("unusable", message)


@pytest.mark.parametrize("name", CELLS)
def test_no_cell_lets_a_wrong_answer_pass(kernel, name):
    """One after the other in the same process: what the earlier ones have changed stays changed."""
    wrong_gain = Step("def gain(Psi, G, F):\n    return G @ Psi", "answer")
    result = marked(kernel, wrong_gain, Step(CELLS[name], "trick"), CHECK)
    assert result.status in ("wrong", "unusable", "not run")


def test_arguments_learned_by_heart_would_pass_without_a_salt():
    """The trick is real: it fails because the grader asks with arguments of its own, which change no
    personal number."""
    namespace = {}
    exec(filled(FUNCTIONS["answers learned by heart"]), namespace)
    assert TASK.check("b1", namespace["gain"]).passed
    assert Exercise("b", TASK.variant, SALT).check("b1", namespace["gain"]).status == "wrong"
    for letter in "bfhijkl":
        own = exercise(letter, "20")
        assert Exercise(letter, own.variant, SALT).numbers == own.numbers


# -- what the notebook's process can see


def test_no_key_is_on_the_stage(staged):
    files = {path.name for path in staged.rglob("*") if path.suffix != ".pyc"}
    assert {"companion.py", "exercises.py", "session.py"} <= files
    secret = ("keys", "questions", "mistakes", "hidden", "messages", "shared", "statement")
    own = B1.answer(TASK).__module__.rpartition(".")[2]
    assert not [name for name in files if name.startswith((*secret, f"{own}."))]
    texts = [path.read_text(encoding="utf-8") for path in staged.rglob("*.py")]
    assert not [text for text in texts if "from kfcourse.exercises.sets.b_aof" in text]


def test_what_the_masters_import_is_on_the_stage(staged):
    masters = [set_.folder / "statement.md" for set_ in sets().values()]
    lines = {
        line
        for master in masters
        for line in master.read_text(encoding="utf-8").splitlines()
        if line.startswith(("import ", "from "))
    }
    assert len(lines) > 10
    with kernel_in(Sandbox("none", staged)) as kernel:
        assert {line: error for line in lines if (error := kernel.cell(line).error)} == {}


def test_a_sandbox_holds(box, tmp_path, monkeypatch):
    """Everything at once, then a right answer: it passes, and nothing has happened outside."""
    if box.kind == "none":
        pytest.skip("no bubblewrap")
    outside, flag = tmp_path / "outside", tmp_path / "flag"
    outside.mkdir()
    (outside / "other.ipynb").write_text(json.dumps(solved()), encoding="utf-8")
    # the teacher's path may be a home with everything in it
    (outside / "keys_of_the_exam.py").write_text("answer = 42", encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(outside))
    hidden = str(packages()[1])
    own = {
        "keys": f"import os\nassert not os.path.exists({hidden!r}) or not os.listdir({hidden!r})",
        "path": "import os\nassert not os.environ['PYTHONPATH'].count(os.pathsep)",
        "imported": "import keys_of_the_exam\nassert False, 'has read it'",
    }
    marking = Marking(TASK, SALT)
    with socket.create_server(("127.0.0.1", 0)) as server:
        values = {
            "OTHER": str(outside / "other.ipynb"),
            "OUTSIDE": str(outside / "written"),
            "FLAG": str(flag),
            "PORT": server.getsockname()[1],
        }
        tricks = {name: filled(code, **values) for name, code in PROCESSES.items()} | own
        steps = [Step(code, name, own=True) for name, code in tricks.items()]
        with kernel_in(replace(box, hidden=(*box.hidden, str(outside)))) as kernel:
            marking.run(kernel, [OPEN, *steps, RIGHT, CHECK])
    assert marking.notes == [] and marking.results["b1"].passed
    errors = " ".join(marking.errors)
    assert "AssertionError" not in errors, errors
    assert "imported: ModuleNotFoundError" in errors
    assert not (outside / "written").exists() and not flag.exists()


# -- processes that somebody kills, or that hang


@pytest.fixture
def grader(staged):
    grader = pool.Grader(Setting(Sandbox("none", staged), SALT))
    yield grader
    grader.end()


@POSIX
def test_who_kills_its_process_is_not_graded_and_the_next_is(grader, tmp_path):
    """Without a sandbox: its own process, then the grading process; the same grader goes on with
    the next notebook."""
    flag = tmp_path / "flag"
    tricks = (
        "import os\nos.kill(os.getpid(), 9)",
        PROCESSES["kills its parent"],
        filled(PROCESSES["leaves a daemon"], FLAG=str(flag)),
    )
    for name, trick in enumerate(tricks):
        notebook = solved(("def correct", trick))
        (tmp_path / f"{name}.ipynb").write_text(json.dumps(notebook), encoding="utf-8")
    grades = [grader(work) for work in returned(tmp_path, masters=FIXTURES)]
    assert [grade.status for grade in grades] == ["graded in part", "not graded", "graded"]
    daemon = int(flag.read_text())
    assert not ended(daemon, seconds=0)  # it was not waited for
    os.kill(daemon, 9)
    assert grades[0].marks["b2"] == "not graded" and KILLED in grades[0].looks[0]
    assert grades[1].note.startswith("the grading process was killed") and not grades[1].digest
    assert grades[2].passed == 2


STUB = "def gain(Psi, G, F):\n    import time\n    time.sleep(1)\n    raise NotImplementedError"


@POSIX
def test_an_answer_whose_process_is_killed_is_not_graded(box):
    """It may be a stub that nobody has touched: what came of it must not count as an answer."""
    marking = Marking(TASK, SALT)
    with kernel_in(box) as kernel:
        request = kernel._request

        def shot(message, *rest):
            if message["do"] == "ask":
                sandbox.end_with_all_below(kernel._process.pid)
            return request(message, *rest)

        kernel._request = shot
        marking.run(kernel, [OPEN, Step(STUB, "x"), CHECK])
    assert marking.results["b1"].status == "not graded" and KILLED in " ".join(marking.looks())


def hangs(*_):
    time.sleep(60)


def test_a_notebook_that_stops_the_grading_process_is_a_row(grader, tmp_path, monkeypatch):
    """As a comparison in compiled code might that no alarm interrupts."""
    (tmp_path / "x.ipynb").write_text("{}", encoding="utf-8")
    (work,) = returned(tmp_path, seconds=0.1)
    assert "without cells" in grader(work).note
    pid = grader._pid
    with monkeypatch.context() as patch:
        patch.setattr(marking, "grade", hangs)
        patch.setattr(pool, "START", 1.0)
        patch.setattr(pool, "QUIET", 0.0)
        grade = grader(work)
    assert (grade.status, grade.note, grade.digest) == (
        "not graded",
        "the grading process hung",
        "",
    )
    assert ended(pid)
    assert "without cells" in grader(work).note
