"""Notebooks that mean harm: they are marked as their answers deserve, and end neither the run nor
another notebook."""

import json
import os
import socket
import time

import numpy as np
import pytest
from endings import ended
from test_grade import FIXTURES, cell, solved
from tricks import CELLS, FUNCTIONS, PROCESSES, READS

from kfcourse.checks import Exercise, exercise, sets
from kfcourse.notebooks.grading import marking, pool, running, sandbox
from kfcourse.notebooks.grading.assembly import Step
from kfcourse.notebooks.grading.marking import Marking, Setting
from kfcourse.notebooks.grading.running import KILLED, Kernel, Opening, Site
from kfcourse.notebooks.grading.sandbox import Sandbox
from kfcourse.notebooks.grading.staging import answers, personal_numbers, stage
from kfcourse.notebooks.grading.submissions import returned
from kfcourse.notebooks.master import opened

TASK = exercise("b", "53")
B1 = TASK.questions["b1"]
SALT = "hidden"
CHECK = Step('task.check("b1", gain)', "check", names=("task",), questions=("b1",))
POSIX = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")


def known():
    """What a student can learn by heart: the arguments of the immediate check, and the right
    answers."""
    return [
        (values[0].ravel()[:3].tolist(), B1.answer(TASK)(*values).tolist())
        for values in B1.arguments(TASK)
    ]


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


OPEN = Step(
    "import numpy as np\nfrom kfcourse.checks import exercise\ntask = exercise('b', '53')",
    "opening",
)


@pytest.fixture(scope="module")
def outside(tmp_path_factory):
    """A folder with another notebook, which no notebook has any business in."""
    folder = tmp_path_factory.mktemp("outside")
    (folder / "other.ipynb").write_text(json.dumps(solved()), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def kernel(staged, tmp_path_factory):
    """One process for all tricks that leave it alive; the others end it, and it is started anew."""
    problem = sandbox.problem(tmp_path_factory.mktemp("tried"), staged)
    with kernel_in(
        Sandbox("none") if problem else Sandbox("bwrap", tuple(map(str, answers()))), staged
    ) as started:
        Marking(TASK, SALT).run(started, [OPEN])
        yield started


def marked(kernel, *steps):
    """The result of b1 after these cells."""
    marking = Marking(TASK, SALT)
    marking.run(kernel, steps)
    return marking.results.get("b1")


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
    if name in READS and kernel._place.sandbox.kind == "none":
        pytest.skip("reads a file, and nothing hides it without a sandbox: so the command says")
    monkeypatch.setattr(running, "ANSWER", 1.0)
    monkeypatch.setattr(running, "ANSWERS", 2.0)
    monkeypatch.setattr(running, "GRACE", 1.0)
    result = marked(kernel, Step(filled(FUNCTIONS[name]), "trick"), CHECK)
    assert result.status in ("wrong", "unusable"), result
    # and what comes after it is marked as if nothing had been
    kernel._done = [done for done in kernel._done if "gain" not in done["source"]]
    result = marked(kernel, Step(RIGHT, "answer"), CHECK)
    assert result and result.passed, result


def test_an_endless_answer_is_ended_as_early_as_a_cell_and_the_time_said_is_its_own(
    kernel, monkeypatch
):
    monkeypatch.setattr(kernel, "seconds", 1.0)
    result = marked(
        kernel, Step("def gain(Psi, G, F):\n    while True:\n        pass", "answer"), CHECK
    )
    assert (result.status, result.message) == (
        "unusable",
        "still running after 1 s: is there a loop that never ends?",
    )


@pytest.mark.parametrize("name", CELLS)
def test_no_cell_lets_a_wrong_answer_pass(kernel, name):
    """One after the other in the same process: what the earlier ones have changed stays changed."""
    wrong_gain = Step("def gain(Psi, G, F):\n    return G @ Psi", "answer")
    result = marked(kernel, wrong_gain, Step(CELLS[name], "trick"), CHECK)
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
        name
        for name in names
        if name.startswith(
            ("keys", "questions", "mistakes", "hidden", "messages", "shared", "statement")
        )
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
    with kernel_in(Sandbox("none"), staged) as kernel:
        assert {line: error for line in lines if (error := kernel.cell(line).error)} == {}


def bubblewrap(staged, folder, *hidden):
    if problem := sandbox.problem(folder, staged):
        pytest.skip(problem)
    return Sandbox("bwrap", tuple(str(path) for path in (*answers(), *hidden)))


@pytest.fixture
def port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


def test_a_sandbox_holds(staged, outside, tmp_path, port):
    """Everything at once, then a right answer: it passes, and nothing has happened outside."""
    flag, written = tmp_path / "flag", outside / "written"
    box = bubblewrap(staged, tmp_path, outside)
    values = {
        "OTHER": str(outside / "other.ipynb"),
        "OUTSIDE": str(written),
        "FLAG": str(flag),
        "PORT": port,
    }
    steps = [Step(filled(code, **values), name, own=True) for name, code in PROCESSES.items()]
    listed = (
        f"import os\nassert not os.path.exists({str(answers()[0])!r}) or not "
        f"os.listdir({str(answers()[0])!r})"
    )
    marking = Marking(TASK, SALT)
    with kernel_in(box, staged) as kernel:
        marking.run(
            kernel, [OPEN, *steps, Step(listed, "keys", own=True), Step(RIGHT, "answer"), CHECK]
        )
    assert marking.notes == [] and marking.marks["b1"] == "passed"
    told = " ".join(marking.errors)
    assert not [
        word for word in ("has read", "has written", "has connected", "keys") if word in told
    ], told
    assert not written.exists() and not flag.exists()


@POSIX
def test_who_kills_its_process_is_not_graded_and_the_next_is(staged, tmp_path):
    """Without a sandbox: its own process, then the grading process; the same grader goes on with
    the next notebook."""
    for name, trick in (
        ("1", "import os\nos.kill(os.getpid(), 9)"),
        ("2", PROCESSES["kills its parent"]),
        ("3", ""),
    ):
        notebook = solved()
        cell(notebook, "def gain").source += "\n" + trick
        (tmp_path / f"{name}.ipynb").write_text(json.dumps(notebook), encoding="utf-8")
    grader = pool.Grader(Setting(Site(staged, Sandbox("none")), SALT))
    try:
        grades = [grader(work) for work in returned(tmp_path, masters=FIXTURES)]
    finally:
        grader.end()
    assert [grade.status for grade in grades] == ["graded in part", "not graded", "graded"]
    assert grades[0].marks["b1"] == "not graded" and KILLED in grades[0].looks[0]
    assert grades[1].note.startswith("the grading process was killed") and not grades[1].digest
    assert grades[2].passed == 2


# -- processes that somebody kills


STUB = "def gain(Psi, G, F):\n    import time\n    time.sleep(1)\n    raise NotImplementedError"


@POSIX
@pytest.mark.parametrize("kind", ["bwrap", "none"])
def test_an_answer_whose_process_is_killed_is_not_graded(staged, tmp_path, kind):
    """It may be a stub that nobody has touched: what came of it must not count as an answer."""
    box = bubblewrap(staged, tmp_path) if kind == "bwrap" else Sandbox("none")
    marking = Marking(TASK, SALT)
    killing = Step(
        f"def gain(Psi, G, F):\n    import os\n    "
        f"os.kill({1 if kind == 'bwrap' else 'os.getpid()'}, 9)",
        "x",
    )
    with kernel_in(box, staged) as kernel:
        if kind == "bwrap":  # nothing in it can kill its first process
            request = kernel._request

            def shot(message, *rest):
                if message["do"] == "ask":
                    sandbox.end_with_all_below(kernel._process.pid)
                return request(message, *rest)

            kernel._request, killing = shot, Step(STUB, "x")
        marking.run(kernel, [OPEN, killing, CHECK])
    assert marking.marks["b1"] == "not graded" and KILLED in " ".join(marking.looks())


def test_nothing_of_the_teachers_path_is_in_the_sandbox(staged, tmp_path, monkeypatch):
    """PYTHONPATH may be a home with everything in it."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "keys_of_the_exam.py").write_text("answer = 42", encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "mine"))
    with kernel_in(bubblewrap(staged, tmp_path), staged) as kernel:
        assert kernel.cell("import keys_of_the_exam").error.startswith("ModuleNotFoundError")
        assert kernel.cell(
            f"open({str(tmp_path / 'mine' / 'keys_of_the_exam.py')!r})"
        ).error.startswith("FileNotFoundError")
        assert (
            kernel.cell("import os\nassert not os.environ['PYTHONPATH'].count(os.pathsep)").error
            == ""
        )


# -- the grading process itself hangs or ends


def hangs(*_):
    time.sleep(60)


def ends(*_):
    os.abort()


@pytest.mark.parametrize(
    ("fate", "seconds", "problem"),
    [(hangs, 1.0, "the grading process hung"), (ends, 60.0, "the grading process was killed")],
)
def test_a_notebook_that_stops_or_ends_the_grading_process_is_a_row(
    tmp_path, monkeypatch, staged, fate, seconds, problem
):
    """As a comparison in compiled code might that no alarm interrupts, or that takes all memory."""
    (tmp_path / "x.ipynb").write_text("{}", encoding="utf-8")
    (work,) = returned(tmp_path, seconds=0.1)
    grader = pool.Grader(Setting(Site(staged, Sandbox("none")), SALT))
    try:
        assert "without cells" in grader(work).note
        pid = grader._pid
        with monkeypatch.context() as patch:
            patch.setattr(marking, "grade", fate)
            patch.setattr(pool, "START", seconds)
            patch.setattr(pool, "QUIET", 0.0)
            grade = grader(work)
        assert (grade.status, grade.digest) == ("not graded", "") and grade.note.startswith(problem)
        assert ended(pid)
        assert "without cells" in grader(work).note
    finally:
        grader.end()
