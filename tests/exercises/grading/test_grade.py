"""Grading returned notebooks: only what the student wrote counts, and no notebook disturbs
another."""

import csv
import io
import json
import re
import shlex
import shutil
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import nbformat
import pytest
from click.testing import CliRunner
from endings import ended
from inside import (
    FIXTURES,
    TINY,
    InsideKernel,
    cell,
    code,
    handed_out,
    solved,
    tiny,
)

from kfcourse import cli
from kfcourse.exercises.checks import Result, exercise
from kfcourse.exercises.checks.question import MIME, NOT_CHECKED
from kfcourse.exercises.grading import course, marking, pool, sandbox, submissions
from kfcourse.exercises.grading.assembly import assembled
from kfcourse.exercises.grading.marking import code_of
from kfcourse.exercises.grading.results import Grade, read_lines
from kfcourse.exercises.grading.sandbox import Sandbox
from kfcourse.exercises.grading.submissions import Cell, Unreadable, cells_of, claimed
from kfcourse.exercises.notebooks.course_list import Student
from kfcourse.exercises.notebooks.master import read, render, solution, student

SECONDS = 15  # of a cell; the endless loop below takes so long
SETTING = marking.Setting(Sandbox("none", Path("stage")), "salt")
RESULTS = {
    f"b{i}": Result(f"b{i}", "", mark, "")
    for i, mark in enumerate(("passed", "wrong", "unusable", "not implemented", "not run"), 1)
}
BOTH, NEW, WRONG = (("passed",) * 2, ("not implemented",) * 2, ("wrong",) * 2)

# -- notebooks that students return

NOT_DIVIDED = ("def gain", "np.linalg.solve(F, cross)", "cross")
OWN_GAIN = "K = -np.swapaxes(np.linalg.solve(F, G @ Psi), -1, -2)"
BOTH_WRONG = (NOT_DIVIDED, ("def correct", "K = gain(Psi, G, F)", OWN_GAIN))


def fakes_checks():
    """Check cells that print a tick, with outputs that say passed."""
    notebook = solved(*BOTH_WRONG)
    for name in ("b1", "b2"):
        check = cell(notebook, f'task.check("{name}"')
        passed = {"question": name, "status": "passed", "diagnosis": [], "message": "right"}
        data = {MIME: passed, "text/plain": "✓"}
        check.source = "print('✓ right')"
        check.outputs = [nbformat.v4.new_output("execute_result", data, execution_count=1)]
    return notebook


def deletes():
    """No ids, no metadata, no checks, no opening cell; the answer in two cells."""
    notebook = solved(
        ("def gain", "    cross = G @ Psi\n", ""),
        ("def gain", "solve(F, cross)", "solve(F, product(G, Psi))"),
        ("def gain", "def product(A, B):\n    return A @ B"),
    )
    own = [each for each in code(notebook) if not each.source.startswith(("task.check", "import"))]
    for each in own:
        each.metadata.clear()
    return notebook | {"cells": own}


def merges():
    """Both answers and both checks in the first answer's cell."""
    notebook = solved()
    first, *others = (
        cell(notebook, start)
        for start in ("def gain", "def correct", 'task.check("b1"', 'task.check("b2"')
    )
    first.source = "\n".join(each.source for each in (first, *others))
    return notebook | {"cells": [each for each in notebook.cells if each not in others]}


def imports():
    """The opening cell is and what it adds is needed."""
    more = "import numpy as np\nfrom numpy.linalg import solve"
    return solved(
        ("import matplotlib", "import numpy as np", more), ("def gain", "np.linalg.solve", "solve")
    )


def without_gain(kind):
    """The cell of b1 is gone, or has become text; what stands on it is changed."""
    notebook = solved(("def correct", "K = gain(Psi, G, F)", "K = gain(Psi, G, F)\n    K = K + 0"))
    gain = cell(notebook, "def gain")
    gain.cell_type = kind
    return notebook | {"cells": [each for each in notebook.cells if kind or each is not gain]}


def copies():
    """The copy of an answer, for trials, does not replace it; its metadata are copied too."""
    notebook = solved()
    trial = nbformat.from_dict(cell(notebook, "def gain"))
    trial.source, trial.id = trial.source.replace("cross = G @ Psi", "cross = 0"), "copy"
    return notebook | {"cells": [*notebook.cells, trial]}


OWN_TASK = "class Own: ...\nOwn.check = print\nexercise2 = task\nif 0: "
TAKEN = "    return task.questions['b1'].answer(task)(Psi, G, F)"
LACKS = "import sympy as sp\nsp.Matrix(np.zeros((2, 2, 2)))\ndef correct"
DEFINED = "NameError: name 'gain' is not defined"
GONE = "cell of b1 "

# Marks and note of notebooks that do nothing to their process.
IN_PROCESS = {
    "new": (handed_out, NEW, "^$"),
    "wrong": (
        lambda: solved(*BOTH_WRONG),
        WRONG,
        r"^b1: The gain is not divided by the covariance F of the measurement; b2: (?!.*-added)",
    ),
    "fakes checks": (fakes_checks, WRONG, r"look: cell.*print\('✓ right'\).*print\('✓ right'\)"),
    "deletes": (deletes, BOTH, "^$"),
    "merges": (merges, BOTH, "^$"),
    "imports": (imports, BOTH, "^$"),
    "copies": (copies, BOTH, "^$"),
    "opens another variant": (
        lambda: solved(("def gain", 'task = exercise("b", variant="1")')),
        BOTH,
        r'^look: cell 4: task = exercise\("b", variant="1"\)$',
    ),
    "takes the answer": (
        lambda: solved(("def gain", "    cross = G @ Psi", TAKEN)),
        ("unusable", "unusable"),
        re.escape(f"look: cell 4 (gain): {TAKEN.strip()}"),
    ),
    "is no Python": (
        lambda: solved(("def gain", "cross = G @ Psi", "cross = G @@ Psi")),
        ("not run", "unusable"),
        rf"^cell 4 \(gain\): SyntaxError.*b1: {DEFINED}",
    ),
    "misspelt": (
        lambda: solved(("def correct", "def correct(", "def corect(")),
        ("passed", "not run"),
        "b2: NameError: name 'correct' is not defined",
    ),
    "what a library has not implemented": (
        lambda: solved(("def correct", "def correct", LACKS)),
        ("passed", "not run"),
        r"cell 7 \(correct\): NotImplementedError: ",
    ),
    "patches": (
        lambda: handed_out(("def gain", "from kfcourse.exercises.checks.engine import Result")),
        NEW,
        "^look: cell 4: from kfcourse",
    ),
    "a cell is gone": (lambda: without_gain(""), NEW, f"^the {GONE}is gone from the notebook$"),
    "a cell is text": (
        lambda: without_gain("markdown"),
        NEW,
        f"^the {GONE}has become text: make it a code cell again$",
    ),
} | {
    line: (
        lambda line=line: solved(("def gain", OWN_TASK + line)),
        BOTH,
        f"^look: cell 4: if 0: {re.escape(line)}$",
    )
    for line in ("task = Own()", "task.check = print", "task = exercise2")
}

# idle: the processors are for others
LOOP = "import time\nwhile True:\n    time.sleep(1)"
LEAVES = (  # ends its process, and leaves another behind
    "import os, subprocess\nopen('PIDFILE', 'w').write(str(subprocess.Popen(['sleep', "
    "'600']).pid))\nos._exit(1)"
)
FLOOD = "for _ in range(2_000):\n    print('x' * 10_000)"
# lines that only concern the display, of another system, above the imports
DISPLAY = "%matplotlib widget\n%config InlineBackend.figure_format = 'retina'\n%load_ext nothing\n"
LITTER = """import os, pathlib
assert list(pathlib.Path.home().glob('litter')) == list(pathlib.Path().glob('litter')) == []
pathlib.Path('litter').write_text('x')
assert 'KFCOURSE_SECRET' not in os.environ
answer = input()"""


def claims(**claim):
    notebook = solved()
    notebook.metadata["kfcourse"].update(claim)
    return notebook


# Marks and note of notebooks that run as the command has it; None for those without marks.
RETURNED = {
    "М-1/Иванов Иван/b-aof": (handed_out(), NEW, "^$"),
    "М-1/Петров/b-aof": (
        solved(("def correct", FLOOD), variant="12"),
        BOTH,
        "^look: for variant 12, and marked as variant 53, which was given; look: cell 2: task = ",
    ),
    # the stub stays; the answer is at the end, behind a cell of trials
    "rewrites": (
        handed_out(("", "trial = [1, 2]\n%matplotlib inline"), ("", solved().cells[3].source)),
        ("passed", "not implemented"),
        "^$",
    ),
    "loops": (
        solved(("def correct", LOOP)),
        ("passed", "not run"),
        f"^cell 7: still running after {SECONDS} s$",
    ),
    "leaves": (solved(("def correct", LEAVES)), ("passed", "not run"), "its process ended"),
    # leaves where a kernel goes on, and asks for too much memory
    "careless": (
        solved(("def gain", "import sys\nsys.exit(1)"), ("def correct", "block = np.ones(10**9)")),
        BOTH,
        "SystemExit: 1.*MemoryError: Unable to allocate 7.45 GiB",
    ),
    # a changed cell that stops: the master's own has run before it
    "shows": (
        solved(
            ("import matplotlib", "import matplotlib", DISPLAY + "import matplotlib"),
            (DISPLAY, "import numpy", "plt.style.use('no such style')\nimport numpy"),
        ),
        BOTH,
        "^cell 2: OSError: 'no such style'",
    ),
    # each in an empty folder; nobody answers
    "litters": (solved(("def gain", LITTER)), BOTH, "^cell 4: StdinNotImplementedError"),
    "litters-too": (solved(("def gain", LITTER)), BOTH, "^cell 4: StdinNotImplementedError"),
    "foreign": (nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("x = 1")]), None, "^$"),
    "unknown-set": (claims(set="zz"), None, "claims set 'zz', variant '53'; the sets are a, b"),
    "unknown-variant": (claims(variant="no \x1b[31m such"), None, "no variant"),
    "list": ([1, 2], None, "JSON of something else"),
    "cut": ("", None, "the file is not JSON"),
}
PROCESSES = sum(marks is not None for _, marks, _ in RETURNED.values())


def write(path, notebook):
    path.parent.mkdir(parents=True, exist_ok=True)
    # as it is: nbformat would mend some of them
    path.write_text(json.dumps(notebook), encoding="utf-8")


FREE = "--sandbox none"


def grade(folder, options=""):
    """The command on a folder, with the tiny masters."""
    line = f"grade {folder} --masters {FIXTURES} {options}"
    return CliRunner().invoke(cli.main, shlex.split(line))


@pytest.fixture(scope="module")
def graded(tmp_path_factory):
    """The returned notebooks, graded by the command."""
    folder = tmp_path_factory.mktemp("grade") / "returned"
    for name, (notebook, *_) in RETURNED.items():
        write(folder / f"{name}.ipynb", notebook)
    leaves = (folder / "leaves.ipynb").read_text(encoding="utf-8")
    pid = folder.parent / "pid"
    (folder / "leaves.ipynb").write_text(leaves.replace("PIDFILE", str(pid)), encoding="utf-8")
    (folder / "cut.ipynb").write_text(json.dumps(solved())[:500], encoding="utf-8")
    write(folder / ".ipynb_checkpoints" / "loops-checkpoint.ipynb", solved())
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    listed = folder.parent / "list.csv"
    students = "name,group,variant\nИванов Иван,М-1,53\nПетров,М-1,53\nСидоров,М-1,7\n"
    listed.write_text(students, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("KFCOURSE_SECRET", "x")
        done = grade(folder, f"{FREE} --seconds {SECONDS} --students {listed}")
    assert before == {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    rows = table(folder.parent / "returned-grades.csv")
    return SimpleNamespace(folder=folder, code=done.exit_code, output=done.output, rows=rows)


def table(path):
    rows = csv.DictReader(io.StringIO(path.read_text(encoding="utf-8-sig")))
    return {row["notebook"].removesuffix(".ipynb"): row for row in rows}


@pytest.mark.parametrize("name", RETURNED)
def test_a_returned_notebook_gets_what_it_deserves(graded, name):
    _, marks, note = RETURNED[name]
    row = graded.rows[name]
    assert (row["q1"], row["q2"]) == (marks or ("", "")) and re.search(note, row["note"]), row
    unmarked = "not an exercise notebook" if name == "foreign" else "not graded"
    assert row["status"] == ("graded" if marks else unmarked)


def test_what_the_command_says(graded):
    """Every notebook has a row, and no copy of a program's; the course list tells what to look at."""
    assert graded.code == 1  # some could not be graded
    assert set(graded.rows) == set(RETURNED)
    row = graded.rows["М-1/Петров/b-aof"]
    assert (row["set"], row["variant"], row["passed"], row["of"]) == ("b", "53", "2", "5")
    assert row["q3"] == row["q4"] == "not run"  # the tiny master asks two of the set's five
    lines = graded.output.splitlines()
    line = next(line for line in lines if line.startswith("М-1/Петров"))
    assert line.split()[1:7] == ["b", "53", "2", "of", "5", "✓✓–––"]
    assert f"{len(RETURNED)} run, 0 unchanged since the last table" in graded.output
    assert "Sandbox: NONE: each notebook could read the right answers" in graded.output
    # ours are red
    assert "\x1b" not in graded.output.replace("\x1b[31m\x1b[1m", "").replace("\x1b[0m", "")
    assert [line for line in lines if line.startswith("look at")] == [
        "look at Иванов Иван: set b: came back empty",
        "look at Петров: set b: for variant 12, and marked as variant 53, which was given; set b: "
        'cell 2: task = exercise("b", "12")',
        "look at Сидоров: missing: b",
    ]
    assert (graded.folder.parent / "returned-report" / "feedback" / "М-1" / "Петров.html").exists()


def test_what_was_stopped_is_told_the_student_and_leaves_nothing(graded):
    grades = read_lines(graded.folder.parent / "returned-grades.jsonl").values()
    (looped,) = [grade for grade in grades if grade.name == "loops.ipynb"]
    assert looped.results["b2"].message == f"not run. {looped.note}"
    assert ended(int((graded.folder.parent / "pid").read_text()))


@pytest.fixture
def graded_here(tmp_path):
    """Grades a notebook that does nothing to its process in this one."""

    def graded(notebook, given="", variants_file=None, masters=FIXTURES):
        write(tmp_path / "x.ipynb", notebook)
        if variants_file:
            (tmp_path / "my.toml").write_text(variants_file, encoding="utf-8")
        (work,) = submissions.returned(
            tmp_path,
            masters=masters,
            variants_file=tmp_path / "my.toml" if variants_file else None,
            given=lambda *_: given,
        )
        return marking.grade(work, SETTING, start=InsideKernel)

    return graded


@pytest.mark.parametrize("name", IN_PROCESS)
def test_only_what_a_student_wrote_counts(graded_here, name):
    notebook, marks, note = IN_PROCESS[name]
    grade = graded_here(notebook())
    assert (grade.status, grade.variant) == ("graded", "53")
    assert (grade.marks["b1"], grade.marks["b2"]) == marks
    assert re.search(note, grade.note), grade.note


def test_what_the_student_reads(graded_here):
    """A step on the student's own wrong one, right parts, an error in a cell before it, a cell that is
    gone."""

    def results(name):
        return graded_here(IN_PROCESS[name][0]()).results

    follows = graded_here(solved(NOT_DIVIDED))
    assert "b2: right on top of an earlier wrong answer" in follows.note
    result = follows.results["b2"]
    assert (result.follows, result.share) == (("b1",), 0.0)
    assert "right on top of your b1" in result.message
    half = graded_here(solved(("def correct", "Psi - K @ G @ Psi", "Psi + K @ G @ Psi")))
    assert (half.marks["b2"], half.results["b2"].share) == ("wrong", 0.5)
    assert results("is no Python")["b1"].message == f"not run. {DEFINED}"
    gone = results("a cell is gone")
    assert gone["b1"].message == "its cell is gone from the notebook"
    assert gone["b2"].message.endswith("or stands on what is not there: the cell of b1")


def test_a_check_that_fails_in_itself_costs_its_question_only(graded_here, monkeypatch):
    """The teacher reads how; the student, that it is not his fault."""

    def fails(question, *rest):
        broken = Result(question.name, "", NOT_CHECKED, "", trouble="AttributeError: of ours")
        return broken if question.name == "b1" else check(question, *rest)

    check = marking.check
    monkeypatch.setattr(marking, "check", fails)
    grade = graded_here(solved())
    assert (grade.marks["b1"], grade.marks["b2"]) == ("not graded", "passed")
    assert (grade.status, grade.digest) == ("graded in part", "")
    assert grade.results["b1"].message == marking.LOOKED_AT
    note = "look: b1 not graded: the check itself fails, please tell us: AttributeError: of ours"
    assert grade.note == note


MINE = {"name": "mine", "state": "q*x + v", "meter": "x + w", "parameters": {"q": 0.5}}
MY_TOML = '[variants.mine]\nstate = "q*x + v"\nmeter = "x + w"\nparameters = { q = 0.5 }\n'
EASY = {"name": "53", "state": "v", "meter": "x + w", "parameters": {}}


def test_a_variant_of_the_courses_own(graded_here):
    """Its table is in the teacher's file; the same in a notebook counts for nothing."""
    notebook = solution(render(TINY, exercise("b", MINE)))
    grade = graded_here(notebook, variants_file=MY_TOML)
    assert (grade.marks["b1"], grade.variant, grade.note) == ("passed", "mine", "")
    grade = graded_here(notebook)
    assert (grade.status, grade.marks) == ("not graded", {})
    assert grade.note.startswith(
        "if variant mine is of a file of yours, name that with --variants; no variant 'mine'; "
    )


def test_a_table_of_its_own_gets_nothing(graded_here):
    """Set a solved for an easy table that the opening cell brings along under the name of the
    variant given."""
    grade = graded_here(solution(render(read("a"), exercise("a", EASY))), "53", masters=None)
    assert "passed" not in grade.marks.values()
    assert """look: cell 2: task = exercise("a", {'name': '53', 'state': 'v'""" in grade.note


# -- without running


@pytest.fixture
def without_running(monkeypatch):
    """Notebooks come graded; their names are collected, in place of processes."""
    ran = []

    def instead(works, *_):
        ran.extend(work.name.removesuffix(".ipynb") for work in works)
        fields = ("graded", "b", "53", RESULTS, ("anew",), ())
        return [Grade(work.name, *fields, work.digest) for work in works]

    monkeypatch.setattr(pool, "graded", instead)
    monkeypatch.setattr(pool, "place", lambda *_: nullcontext(SETTING.place))
    return ran


@pytest.fixture
def three(tmp_path):
    """A folder with three notebooks that nobody has begun."""
    for name in "abc":
        write(tmp_path / "returned" / f"{name}.ipynb", handed_out(("", f"{name} = 1")))
    return tmp_path / "returned"


def test_a_second_run_does_only_what_is_new(graded, tmp_path, without_running):
    folder, written = tmp_path / "copy", tmp_path / "copy-grades.csv"
    shutil.copytree(graded.folder, folder)
    for kind in ("csv", "jsonl"):
        shutil.copy(
            graded.folder.parent / f"returned-grades.{kind}", written.with_suffix(f".{kind}")
        )

    def again(options=f"--seconds {SECONDS}"):
        without_running.clear()
        listed = graded.folder.parent / "list.csv"
        return grade(folder, f"{FREE} --students {listed} {options}")

    done = again()
    assert done.exit_code == 0
    assert sorted(without_running) == ["cut", "list", "unknown-set", "unknown-variant"]
    assert f"4 run, {len(RETURNED) - 4} unchanged" in done.output
    assert table(written)["loops"]["note"] == graded.rows["loops"]["note"]
    (folder / "shows.ipynb").rename(folder / "renamed.ipynb")
    write(folder / "rewrites.ipynb", solved())
    again()
    assert without_running == ["rewrites"]
    assert {"renamed", "rewrites"} < set(table(written))
    # what was ended too early may come to its end
    for more in (f"--seconds {SECONDS} --again", "--seconds 99"):
        again(more)
        assert len(without_running) == len(RETURNED)


def test_a_returned_table_of_grades_counts_for_nothing(three, without_running):
    """Even one of ours: what was returned is not where results are kept, or written."""
    assert grade(three, FREE).exit_code == 0
    for kind in ("csv", "jsonl"):
        (three.parent / f"returned-grades.{kind}").rename(three / f"grades.{kind}")
    grade(three, FREE)
    assert without_running == ["a", "b", "c"] * 2
    for option in ("--out", "--report"):
        result = grade(three, f"{FREE} {option} {three / 'new'}")
        assert result.exit_code == 1 and "is inside of what was returned" in result.output


def test_without_a_sandbox_nothing_runs_unless_somebody_says_so(
    three, without_running, monkeypatch
):
    monkeypatch.setattr(sandbox.shutil, "which", lambda _: None)
    result = grade(three)
    assert result.exit_code == 1 and without_running == []
    for words in (
        "bubblewrap is not installed",
        "could read the right answers",
        "--sandbox none runs them without protection",
    ):
        assert words in result.output
    monkeypatch.setattr(course.sys, "stdin", SimpleNamespace(isatty=lambda: True))
    monkeypatch.setattr(course.click, "confirm", lambda *_, **__: True)
    course._warn("there is none")
    monkeypatch.setattr(course.click, "confirm", lambda *_, **__: False)
    with pytest.raises(ValueError, match="no notebook was run"):
        course._warn("there is none")


UNREAD = {
    "A/b.ipynb": "a link, which is not followed",
    "A/c.ipynb.txt": "a notebook by another name",
    "A/d.ipynb.json": "a notebook by another name",
    "A/e.py": "no notebook, but perhaps made from one",
    "A/f.HTML": "no notebook, but perhaps made from one",
    "A/g.json": "no notebook, but perhaps made from one",
    "linked": "a link, which is not followed",
    ".C/b.IPYNB": "hidden by the dot",
    "Петров.ZIP": "an archive: unpack it",
}
COPIES = (
    *("B/__MACOSX/._b.ipynb", "B/._b.ipynb", "B/.ipynb_checkpoints/b-checkpoint.ipynb"),
    *("B/b.html", "B/b.py"),
)


def test_what_is_not_read_is_named(tmp_path):
    """Links, hidden notebooks, archives and other names get nothing, and each has a row; copies by
    programs have none."""
    folder, own = tmp_path / "returned", tmp_path / "solution.ipynb"
    write(own, solved())
    (folder / "pipe.ipynb").mkdir(parents=True)
    for name in (*UNREAD, *COPIES, "B/b.ipynb"):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if "link" not in UNREAD.get(name, ""):
            path.write_bytes(own.read_bytes())
        else:
            path.symlink_to(own if path.suffix else tmp_path)
    works = {work.name: work for work in submissions.returned(folder, masters=FIXTURES)}
    assert set(works) == {*UNREAD, "B/b.ipynb"}
    for name, work in works.items():
        grade = marking.grade(work, SETTING, start=InsideKernel)
        assert work.problem.startswith(UNREAD.get(name, ""))
        assert bool(grade.marks) == bool(grade.digest) == (name not in UNREAD) != bool(grade.note)


def test_what_cannot_be_graded_at_all_is_an_error(three):
    listed = three.parent / "list.csv"
    listed.write_text("name,group,variant\nA,1,mine\n", encoding="utf-8")
    (three.parent / "empty").mkdir()
    for folder, options, words in (
        (
            three,
            f"--students {listed}",
            "gives A the variant mine, which is not known; name the file that you handed out "
            "with --variants",
        ),
        (three.parent / "empty", "", "Error: no notebooks (*.ipynb) in "),
    ):
        result = grade(folder, options)
        assert result.exit_code == 1 and words in result.output


def test_whose_variant_it_is_tells_the_path_or_the_notebook(three):
    for name, whom in (
        ("a", "Иванов Иван, 1"),
        ("b", "Nobody, 1"),
        ("1/Петрова Анна/x", "Иванов Иван, 1"),
    ):
        write(three / f"{name}.ipynb", claims(student=whom))
    listed = [Student("Иванов Иван", "1", "7"), Student("Петрова Анна", "1", "20")]
    returned_, other = (
        {work.name: work for work in submissions.returned(three, given=course._given(students))}
        for students in (listed, None)
    )
    given = {name: work.variant for name, work in returned_.items() if work.variant}
    assert given == {"a.ipynb": "7", "1/Петрова Анна/x.ipynb": "20"}
    # with another variant it is graded anew
    assert {name for name in returned_ if returned_[name].digest != other[name].digest} == set(
        given
    )


def test_a_kernel_that_does_not_start_is_a_row(three):
    def fails(*_, **__):
        raise RuntimeError("Kernel didn't respond in 60 seconds")

    grade = marking.grade(submissions.returned(three, masters=FIXTURES)[0], SETTING, start=fails)
    assert grade == Grade("a.ipynb", "not graded", notes=("Kernel didn't respond in 60 seconds",))


def test_the_same_answers_in_another_order_are_the_same_work():
    """A copied notebook is known though its cells were moved, and its comments changed; another
    answer makes another one."""
    first, second, other = (
        Cell(0, "", "", f"def {text}")
        for text in (
            "one(a):\n    return a",
            "two(b):\n    return b",
            "two(b):  # mine\n    return b",
        )
    )
    names = {"one", "two"}
    assert code_of([first, second], names) == code_of([other, first], names) != ""
    assert code_of([first], names) != code_of([first, second], names)
    assert code_of([first], {"three"}) == ""
    longest = Cell(1, "", "", f"def one(x):\n    return {' + '.join(['x'] * 2000)}")
    # deeper than Python's stack, if its parts were called one in the other
    assert code_of([longest], names)


@pytest.mark.parametrize("document", [{}, {"cells": {}}, {"worksheets": []}])
def test_notebooks_without_cells_are_explained(document):
    with pytest.raises(Unreadable, match="without cells"):
        cells_of(document)


@pytest.mark.parametrize(
    "claim",
    [7, "b", [], {}, {"set": "b"}, {"set": ["b"], "variant": "53"}, {"set": "b", "variant": None}],
)
def test_strange_claims_are_explained(claim):
    with pytest.raises(Unreadable, match=r"claims set|no variant 'None'"):
        claimed(claim, None)


# -- what is run, in which order


def first_lines(cells, notebook=None):
    """First lines of the assembled notebook's cells, and how many are the student's."""
    steps, own = assembled(notebook or handed_out(), cells)
    return [step.source.splitlines()[0] for step in steps], len(own)


PLAIN = [
    "import matplotlib.pyplot as plt",
    "def gain(Psi, G, F):",
    'task.check("b1", gain)',
    "def correct(lam, Psi, h, G, F, y):",
    'task.check("b2", correct)',
    "one = np.ones((1, 1, 1))",
]


def test_cells_of_the_student_keep_their_places():
    own = {0: "first = 1", 2: "before = 1", 4: "between = 1", 6: "after = 1", 10: "last = 1"}
    notebook = solved(
        *zip(("# A", "def gain", 'task.check("b1"', "def correct", ""), own.values(), strict=True)
    )
    expected = list(PLAIN)
    for place, line in own.items():
        expected.insert(place, line)
    assert first_lines(cells_of(notebook)) == (expected, 7)  # five, and two answers


def test_checks_of_the_student_are_not_run():
    cells = [
        Cell(1, "", "", 'task.check("b1", gain)  # again'),
        Cell(2, "", "", 'task.check("b2", correct)\ntask.check("b9", 1)'),
    ]
    assert first_lines(cells) == (PLAIN, 0)


def test_answers_are_known_by_name_when_the_master_has_moved_on():
    """A cell was added to the master since: all ids behind it have shifted."""
    extra = "```{code-cell} python\nextra = 1\n```\n\n### Question 1"
    master = student(tiny(text=TINY.replace("### Question 1", extra)), {})
    expected = [PLAIN[0], "extra = 1", *PLAIN[1:]]
    assert first_lines(cells_of(solved()), master) == (expected, 2)
