"""Grading returned notebooks: only what the student wrote counts, and no notebook disturbs
another."""

import csv
import io
import json
import shlex
import shutil
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import nbformat
import pytest
from click.testing import CliRunner
from endings import ended
from inside import InsideKernel

from kfcourse import cli
from kfcourse.checks import Exercise, exercise, sets
from kfcourse.checks.question import MIME
from kfcourse.notebooks.course_list import Student
from kfcourse.notebooks.grading import course, marking, pool, sandbox, submissions
from kfcourse.notebooks.grading.asking import salted
from kfcourse.notebooks.grading.assembly import assembled
from kfcourse.notebooks.grading.marking import code_of
from kfcourse.notebooks.grading.results import Grade, read_lines
from kfcourse.notebooks.grading.running import Site
from kfcourse.notebooks.grading.sandbox import Sandbox
from kfcourse.notebooks.grading.submissions import Cell, Unreadable, cells_of, claimed
from kfcourse.notebooks.master import read, render, solution, student

FIXTURES = Path(__file__).parent / "fixtures"
TINY = (FIXTURES / "b_aof" / "statement.md").read_text(encoding="utf-8")
SECONDS = 15  # of a cell; the endless loop below takes so long
SETTING = marking.Setting(Site(Path("stage"), Sandbox("none")), "salt")
MARKS = {
    f"b{i}": mark
    for i, mark in enumerate(("passed", "wrong", "unusable", "not implemented", "not run"), 1)
}
NEW = ("not implemented", "not implemented")


def handed_out(variant="53"):
    """The tiny set as a student gets it."""
    return student(render(TINY, exercise("b", variant)), {})


def solved(variant="53"):
    return solution(render(TINY, exercise("b", variant)))


def cell(notebook, start):
    return next(cell for cell in notebook.cells if cell.source.startswith(start))


def place(notebook, start):
    """Number of a cell as a reader counts."""
    return 1 + notebook.cells.index(cell(notebook, start))


def change(notebook, start, old, new):
    changed = cell(notebook, start)
    assert old in changed.source
    changed.source = changed.source.replace(old, new)
    return notebook


def add(notebook, source, before=None):
    index = len(notebook.cells) if before is None else notebook.cells.index(cell(notebook, before))
    notebook.cells.insert(index, nbformat.v4.new_code_cell(source))
    return notebook


# -- notebooks that students return


def wrong():
    notebook = change(solved(), "def gain", "np.linalg.solve(F, cross)", "cross")
    return change(
        notebook,
        "def correct",
        "K = gain(Psi, G, F)",
        "K = -np.swapaxes(np.linalg.solve(F, G @ Psi), -1, -2)",
    )


def fakes_checks():
    """Check cells that print a tick, with outputs that say passed."""
    notebook = wrong()
    for name in ("b1", "b2"):
        one = cell(notebook, f'task.check("{name}"')
        data = {
            MIME: {"question": name, "status": "passed", "diagnosis": [], "message": "right"},
            "text/plain": "✓",
        }
        one.source, one.outputs = (
            "print('✓ right')",
            [nbformat.v4.new_output("execute_result", data, execution_count=1)],
        )
    return notebook


def shows_results():
    """The answer itself shows a result that says passed."""
    passed = {"question": "b1", "status": "passed", "diagnosis": [], "message": "right"}
    lie = (
        f"from IPython.display import display\n    display({{{MIME!r}: {passed}}}, raw=True)\n  "
        f"  cross = G @ Psi"
    )
    return change(wrong(), "def gain", "cross = G @ Psi", lie)


def patches():
    source = (
        "from kfcourse.checks.engine import Result\n"
        "type(task).check = lambda self, name, answer: Result(name, '', 'passed', 'right')"
    )
    return add(handed_out(), source, "def gain")


def deletes():
    """No ids, no metadata, no checks, no opening cell; the answer in two cells; another name of the
    file."""
    notebook = change(solved(), "def gain", "    cross = G @ Psi\n", "")
    change(notebook, "def gain", "solve(F, cross)", "solve(F, product(G, Psi))")
    add(notebook, "def product(A, B):\n    return A @ B", "def gain")
    notebook.cells = [
        cell
        for cell in notebook.cells
        if cell.cell_type == "code" and not cell.source.startswith(("task.check", "import"))
    ]
    for one in notebook.cells:
        one.metadata.clear()
    return notebook


def rewrites():
    """The stub stays; the answer is at the end, behind a cell of trials."""
    notebook = handed_out()
    add(notebook, "trial = [1, 2]\n%matplotlib inline")
    return add(notebook, cell(solved(), "def gain").source)


def merges():
    """Both answers and both checks in the first answer's cell."""
    notebook = solved()
    sources = [
        cell(notebook, start).source
        for start in ("def gain", "def correct", 'task.check("b1"', 'task.check("b2"')
    ]
    cell(notebook, "def gain").source = "\n".join(sources)
    notebook.cells = [
        one
        for one in notebook.cells
        if not one.source.startswith(("def correct", "task.check")) or one.cell_type != "code"
    ]
    return notebook


def opens_another():
    return add(solved(), 'task = exercise("b", variant="1")', "def gain")


def imports():
    """The opening cell is changed, and what it adds is needed."""
    notebook = change(
        solved(),
        "import matplotlib",
        "import numpy as np",
        "import numpy as np\nfrom numpy.linalg import solve",
    )
    return change(notebook, "def gain", "np.linalg.solve", "solve")


def takes_the_answer():
    return change(
        solved(),
        "def gain",
        "    cross = G @ Psi",
        "    return task.questions['b1'].answer(task)(Psi, G, F)",
    )


def syntax():
    return change(solved(), "def gain", "cross = G @ Psi", "cross = G @@ Psi")


def loops():
    # idle: the processors are for others
    return add(solved(), "import time\nwhile True:\n    time.sleep(1)", "def correct")


def leaves(flag):
    """Ends its kernel, and leaves a process behind."""
    source = (
        f"import os, subprocess\nopen({str(flag)!r}, "
        f"'w').write(str(subprocess.Popen(['sleep', '600']).pid))\nos._exit(1)"
    )
    return add(solved(), source, "def correct")


def shows():
    """Lines that only concern the display, of another system, above the imports; a changed cell
    that stops below them."""
    lines = (
        "%matplotlib widget\n%config InlineBackend.figure_format = 'retina'\n%load_ext nothing\n"
    )
    notebook = change(
        solved(), "import matplotlib", "import matplotlib", lines + "import matplotlib"
    )
    return change(
        notebook, lines[:10], "import numpy", "plt.style.use('no such style')\nimport numpy"
    )


def floods():
    return add(solved(), "for _ in range(2_000):\n    print('x' * 10_000)", "def correct")


def careless():
    """Asks for too much memory, and leaves where a kernel goes on."""
    return add(
        add(solved(), "import sys\nsys.exit(1)", "def gain"),
        "block = np.ones(10**9)",
        "def correct",
    )


def litters():
    source = (
        "import os, pathlib\n"
        "assert list(pathlib.Path.home().glob('litter')) == list(pathlib.Path().glob('litter')) "
        "== []\n"
        "pathlib.Path('litter').write_text('x')\n"
        "assert 'KFCOURSE_SECRET' not in os.environ\n"
        "answer = input()"
    )
    return add(solved(), source, "def gain")


MINE = {"name": "mine", "state": "q*x + v", "meter": "x + w", "parameters": {"q": 0.5}}
MY_TOML = '[variants.mine]\nstate = "q*x + v"\nmeter = "x + w"\nparameters = { q = 0.5 }\n'


def claims(**claim):
    notebook = solved()
    notebook.metadata["kfcourse"].update(claim)
    return notebook


def fill(folder):
    """Write the returned notebooks."""
    foreign = solved()
    del foreign.metadata["kfcourse"]
    foreign.cells = [nbformat.v4.new_code_cell("x = 1")]
    notebooks = {
        "М-1/Иванов Иван/b-aof": handed_out(),
        "М-1/Петров/b-aof": solved("12"),
        "shows-results": shows_results(),
        "patches": patches(),
        "rewrites": rewrites(),
        "loops": loops(),
        "leaves": leaves(folder.parent / "pid"),
        "careless": careless(),
        "floods": floods(),
        "shows": shows(),
        "litters": litters(),
        "litters-too": litters(),
        "foreign": foreign,
        "unknown-set": claims(set="zz"),
        "unknown-variant": claims(variant="no \x1b[31m such"),
        ".ipynb_checkpoints/loops-checkpoint": wrong(),
    }
    for name, notebook in notebooks.items():
        path = folder / f"{name}.ipynb"
        path.parent.mkdir(parents=True, exist_ok=True)
        # as it is: nbformat would mend some of them
        path.write_text(json.dumps(notebook), encoding="utf-8")
    (folder / "cut.ipynb").write_text(json.dumps(solved())[:500], encoding="utf-8")
    (folder / "list.ipynb").write_text("[1, 2]", encoding="utf-8")


FREE = "--sandbox none"


def grade(folder, options=""):
    """The command on a folder, with the tiny masters."""
    line = f"grade {folder} --masters {FIXTURES} {options}"
    return CliRunner().invoke(cli.main, shlex.split(line))


class Graded(NamedTuple):
    """What the command did: exit status, screen, table by the notebooks' names, and the folder."""

    exit_code: int
    output: str
    table: dict
    folder: Path


@pytest.fixture(scope="module")
def graded(tmp_path_factory):
    """The returned notebooks, graded by the command."""
    folder = tmp_path_factory.mktemp("grade") / "returned"
    fill(folder)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("KFCOURSE_SECRET", "x")
        listed = folder.parent / "list.csv"
        listed.write_text(
            "name,group,variant\nИванов Иван,М-1,53\nПетров,М-1,53\nСидоров,М-1,7\n",
            encoding="utf-8",
        )
        result = grade(folder, f"{FREE} --seconds {SECONDS} --students {listed}")
    assert before == {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    rows = {
        name.removesuffix(".ipynb"): row
        for name, row in table(folder.parent / "returned-grades.csv").items()
    }
    return Graded(result.exit_code, result.output, rows, folder)


def table(path):
    return {
        row["notebook"]: row
        for row in csv.DictReader(io.StringIO(path.read_text(encoding="utf-8-sig")))
    }


def row(graded, name):
    found = graded.table[name]
    return (found["q1"], found["q2"]), found["note"]


@pytest.fixture
def graded_here(tmp_path):
    """Grades a notebook that does nothing to its process in this one: its grade, two marks and
    note."""

    def graded(notebook, given="", variants_file=None, whole=True, masters=FIXTURES):
        path = tmp_path / "x.ipynb"
        # as it is: nbformat would mend some of them
        path.write_text(json.dumps(notebook), encoding="utf-8")
        if variants_file:
            (tmp_path / "my.toml").write_text(variants_file, encoding="utf-8")
        options = {
            "variants_file": tmp_path / "my.toml" if variants_file else None,
            "given": lambda *_: given,
        }
        (work,) = submissions.returned(tmp_path, masters=masters, **options)
        found = marking.grade(work, SETTING, start=InsideKernel)
        assert found.status == "graded" or not whole, found.note
        return found, (found.marks.get("b1"), found.marks.get("b2")), found.note

    return graded


def test_every_notebook_has_a_row(graded):
    assert graded.exit_code == 1  # some could not be graded
    names = {
        path.relative_to(graded.folder).with_suffix("").as_posix()
        for path in graded.folder.rglob("*.ipynb")
    }
    assert set(graded.table) == names - {".ipynb_checkpoints/loops-checkpoint"}
    assert "17 run, 0 unchanged since the last table" in graded.output


def test_a_new_notebook_is_not_implemented(graded):
    assert row(graded, "М-1/Иванов Иван/b-aof") == (NEW, "")
    assert graded.table["М-1/Иванов Иван/b-aof"]["passed"] == "0"


def test_a_solution_passes(graded):
    assert row(graded, "М-1/Петров/b-aof")[0] == ("passed", "passed")
    found = graded.table["М-1/Петров/b-aof"]
    assert (found["set"], found["variant"], found["passed"], found["of"]) == ("b", "53", "2", "5")
    assert found["q3"] == found["q4"] == "not run"  # the tiny master asks two of the set's five
    line = next(line for line in graded.output.splitlines() if line.startswith("М-1/Петров"))
    assert line.split()[1:7] == ["b", "53", "2", "of", "5", "✓✓–––"]


def test_lines_for_the_display_stop_nothing(graded):
    marks, note = row(graded, "shows")
    assert marks == ("passed", "passed")
    # the master's own cell has run before it
    assert note.startswith("cell 2: OSError: 'no such style'")


@pytest.mark.quick
def test_wrong_answers_are_diagnosed(graded_here):
    _, marks, note = graded_here(wrong())
    assert marks == ("wrong", "wrong")
    assert note.startswith(
        "b1: The gain is not divided by the covariance F of the measurement; b2: "
    )
    assert "-added" not in note, "words, no codes"


@contextmanager
def changed(name, **fields):
    """A question of set b with other fields."""
    question = next(one for one in sets()["b"].questions if one.name == name)
    before = {field: getattr(question, field) for field in fields}
    # its exercises keep what was posed, and a dict finds the same object again at one of eight
    # places
    salted.cache_clear()
    try:
        for field, value in fields.items():
            object.__setattr__(question, field, value)
        yield
    finally:
        for field, value in before.items():
            object.__setattr__(question, field, value)
        salted.cache_clear()


def test_a_check_that_fails_in_itself_costs_its_question_only(graded_here):
    """The teacher reads how; the student, that it is not his fault."""

    def broken(exercise):
        raise AttributeError("'Mul' object has no attribute 'shape'")

    with changed("b1", arguments=broken):
        found, marks, note = graded_here(solved(), whole=False)
    assert marks == ("not graded", "passed")
    assert (found.status, found.digest, found.comments["b1"].says) == (
        "graded in part",
        "",
        marking.LOOKED_AT,
    )
    assert note.startswith(
        "look: b1 not graded: the check itself fails, please tell us: AttributeError: 'Mul' object"
    )


def test_a_step_on_a_wrong_one_and_right_parts_are_said(graded_here):
    """The second stands on the student's own wrong gain; in the other notebook one of its two
    results is right."""
    found, marks, note = graded_here(
        change(solved(), "def gain", "np.linalg.solve(F, cross)", "cross")
    )
    assert marks == ("wrong", "wrong")
    assert (found.comments["b2"].follows, found.comments["b2"].share) == (("b1",), 0.0)
    assert (
        "b2: right on top of an earlier wrong answer" in note
        and "right on top of your b1" in found.comments["b2"].says
    )
    found, marks, _ = graded_here(
        change(solved(), "def correct", "Psi - K @ G @ Psi", "Psi + K @ G @ Psi")
    )
    assert (marks, found.comments["b2"].share) == (("passed", "wrong"), 0.5)


def test_faked_results_do_not_count(graded, graded_here):
    assert row(graded, "shows-results")[0] == ("wrong", "wrong")
    _, marks, note = graded_here(fakes_checks())
    assert marks == ("wrong", "wrong")
    assert note.count("print('✓ right')") == 2 and "look: cell" in note


def test_a_patched_package_changes_nothing_and_is_noticed(graded):
    marks, note = row(graded, "patches")
    assert marks == NEW
    assert "look: cell" in note


def test_answers_are_found_wherever_they_stand(graded, graded_here):
    assert row(graded, "rewrites") == (("passed", "not implemented"), "")
    for notebook in (deletes(), merges(), imports()):
        assert graded_here(notebook)[1:] == (("passed", "passed"), "")


def test_another_variant_is_noticed_and_does_not_count(graded_here):
    found, marks, note = graded_here(opens_another())
    assert marks == ("passed", "passed")
    assert note == "look: opens set b, variant 1"
    assert found.variant == "53"


@pytest.mark.parametrize("line", ["task = Own()", "task.check = print", "task = exercise2"])
def test_a_task_of_the_students_own_is_noticed(graded_here, line):
    stands_in = "class Own: ...\nOwn.check = print\nexercise2 = task\nif 0: "
    assert (
        graded_here(add(solved(), stands_in + line, "def gain"))[2] == f"look: cell 4: if 0: {line}"
    )


def test_taking_the_answer_is_noticed(graded_here):
    assert (
        "(gain): return task.questions['b1'].answer(task)(Psi, G, F)"
        in graded_here(takes_the_answer())[2]
    )


def test_an_error_is_reported_by_cell(graded_here):
    found, marks, note = graded_here(syntax())
    assert marks == ("not run", "unusable")
    assert found.comments["b1"].says == "not run. NameError: name 'gain' is not defined"
    number = place(syntax(), "def gain")
    assert f"cell {number} (gain): SyntaxError" in note
    assert "b1: NameError: name 'gain' is not defined" in note


def test_an_endless_loop_is_ended(graded):
    marks, note = row(graded, "loops")
    assert marks == ("passed", "not run")
    number = place(loops(), "import time")
    assert note == f"cell {number}: still running after {SECONDS} s"
    grades = read_lines(graded.folder.parent / "returned-grades.jsonl").values()
    (grade,) = [grade for grade in grades if grade.name == "loops.ipynb"]
    assert grade.comments["b2"].says == f"not run. {note}"


def test_a_dead_kernel_is_reported_and_its_children_are_ended(graded):
    marks, note = row(graded, "leaves")
    assert marks == ("passed", "not run")
    assert "its process ended" in note
    assert ended(int((graded.folder.parent / "pid").read_text()))


def test_memory_is_limited_and_exit_is_an_error_like_others(graded):
    marks, note = row(graded, "careless")
    assert marks == ("passed", "passed")
    assert "MemoryError: Unable to allocate 7.45 GiB" in note
    assert "SystemExit: 1" in note


def test_output_goes_nowhere(graded):
    assert row(graded, "floods") == (("passed", "passed"), "")


def test_notebooks_do_not_see_each_other(graded):
    for name in ("litters", "litters-too"):
        marks, note = row(graded, name)
        assert marks == ("passed", "passed")
        assert "AssertionError" not in note
        assert "StdinNotImplementedError" in note  # nobody answers


def test_a_variant_of_the_courses_own(graded_here):
    """Its table is in the teacher's file; the same in a notebook counts for nothing."""
    own = Exercise("b", exercise("b", MINE).variant)
    found, marks, note = graded_here(solution(render(TINY, own)), variants_file=MY_TOML)
    assert marks == ("passed", "passed")
    assert (found.variant, note) == ("mine", "")
    found, *_ = graded_here(solution(render(TINY, own)), whole=False)
    assert (found.status, found.marks) == ("not graded", {})
    assert found.note.startswith(
        "if variant mine is of a file of yours, name that with --variants; no variant 'mine'; "
        "there are"
    )


def test_what_cannot_be_graded_is_named(graded):
    status = {name: (row["status"], row["note"]) for name, row in graded.table.items()}
    assert status["foreign"] == ("not an exercise notebook", "")
    for name, words in {
        "cut": "the file is not JSON",
        "list": "JSON of something else",
        "unknown-set": "claims set 'zz', variant '53'; the sets are a, b",
        "unknown-variant": "no variant",
    }.items():
        assert status[name][0] == "not graded" and words in status[name][1]
    # ours are red
    assert "\x1b" not in graded.output.replace("\x1b[31m\x1b[1m", "").replace("\x1b[0m", "")


def test_a_course_list_tells_what_to_look_at(graded):
    assert [line for line in graded.output.splitlines() if line.startswith("look at")] == [
        "look at Иванов Иван: set b: came back empty",
        "look at Петров: set b: for variant 12, and marked as variant 53, which was given",
        "look at Сидоров: missing: b",
    ]
    assert (graded.folder.parent / "returned-report" / "feedback" / "М-1" / "Петров.html").exists()
    assert "Sandbox: NONE: each notebook could read the right answers" in graded.output


@pytest.fixture
def without_running(monkeypatch):
    """Notebooks come graded; their names are collected, in place of processes."""
    ran = []

    def instead(works, *_):
        ran.extend(work.name for work in works)
        return [
            Grade(work.name, "graded", "b", "53", MARKS, ("anew",), (), work.digest)
            for work in works
        ]

    monkeypatch.setattr(pool, "graded", instead)
    return ran


def test_a_second_run_does_only_what_is_new(graded, tmp_path, without_running):
    shutil.copytree(graded.folder, tmp_path / "copy")
    for kind in ("csv", "jsonl"):
        shutil.copy(
            graded.folder.parent / f"returned-grades.{kind}", tmp_path / f"copy-grades.{kind}"
        )
    folder, options = tmp_path / "copy", f"{FREE} --students {graded.folder.parent / 'list.csv'}"
    again = grade(folder, f"{options} --seconds {SECONDS}")
    assert again.exit_code == 0
    assert sorted(without_running) == [
        "cut.ipynb",
        "list.ipynb",
        "unknown-set.ipynb",
        "unknown-variant.ipynb",
    ]
    assert "4 run, 13 unchanged" in again.output
    # of shows-results
    assert "b1: The gain is not divided" in (tmp_path / "copy-grades.csv").read_text(
        encoding="utf-8"
    )

    without_running.clear()
    (tmp_path / "copy" / "shows-results.ipynb").rename(tmp_path / "copy" / "renamed.ipynb")
    change_file(tmp_path / "copy" / "rewrites.ipynb")
    grade(folder, f"{options} --seconds {SECONDS}")
    assert without_running == ["rewrites.ipynb"]
    assert {"renamed.ipynb", "rewrites.ipynb"} < set(table(tmp_path / "copy-grades.csv"))

    # what was ended too early may come to its end
    for more in (f"--seconds {SECONDS} --again", "--seconds 99"):
        without_running.clear()
        grade(folder, f"{options} {more}")
        assert len(without_running) == 17


def test_a_returned_table_of_grades_counts_for_nothing(three, without_running):
    """Even one of ours: what was returned is not where results are kept, or written."""
    folder = three / "returned"
    folder.mkdir()
    (three / "a.ipynb").rename(folder / "a.ipynb")
    assert grade(folder, FREE).exit_code == 0
    for kind in ("csv", "jsonl"):
        (three / f"returned-grades.{kind}").rename(folder / f"grades.{kind}")
    grade(folder, FREE)
    assert without_running == ["a.ipynb"] * 2
    for option in ("--out", "--report"):
        result = grade(folder, f"{FREE} {option} {folder / 'new'}")
        assert result.exit_code == 1 and "is inside of what was returned" in result.output


def test_without_a_sandbox_nothing_runs_unless_somebody_says_so(
    three, without_running, monkeypatch
):
    monkeypatch.setattr(sandbox.shutil, "which", lambda _: None)
    result = grade(three, f"--out {three.parent / three.name}.csv")
    assert result.exit_code == 1 and without_running == []
    assert (
        "bubblewrap is not installed" in result.output
        and "could read the right answers" in result.output
    )
    assert "--sandbox none runs them without protection" in result.output
    monkeypatch.setattr(course.sys, "stdin", type("Terminal", (), {"isatty": lambda _: True})())
    monkeypatch.setattr(course.click, "confirm", lambda *_, **__: True)
    course._warn("there is none")
    monkeypatch.setattr(course.click, "confirm", lambda *_, **__: False)
    with pytest.raises(ValueError, match="no notebook was run"):
        course._warn("there is none")


def test_what_is_not_read_is_named(tmp_path):
    """Links, hidden notebooks, archives and other names get nothing, and each has a row; copies by
    programs have none."""
    folder, own = tmp_path / "returned", tmp_path / "solution.ipynb"
    own.write_text(json.dumps(solved()), encoding="utf-8")
    for name in ("A", "B/__MACOSX", "B/.ipynb_checkpoints", ".C", "pipe.ipynb"):
        (folder / name).mkdir(parents=True)
    (folder / "A" / "b.ipynb").symlink_to(own)
    (folder / "linked").symlink_to(tmp_path)
    copies = (
        "B/__MACOSX/._b",
        "B/._b",
        "B/.ipynb_checkpoints/b-checkpoint",
        "B/.ipynb_checkpoints/lost-checkpoint",
    )
    for name in ("B/b", *copies):
        (folder / f"{name}.ipynb").write_bytes(own.read_bytes())
    for name in (
        ".C/b.IPYNB",
        "A/c.ipynb.txt",
        "A/d.ipynb.json",
        "A/e.py",
        "A/f.HTML",
        "A/g.json",
        "B/b.html",
        "B/b.py",
    ):
        (folder / name).write_bytes(own.read_bytes())
    (folder / "Петров.ZIP").write_bytes(b"PK")
    works = {work.name: work for work in submissions.returned(folder, masters=FIXTURES)}
    problems = {
        "A/b.ipynb": "a link, which is not followed",
        "A/c.ipynb.txt": "a notebook by another name",
        "A/d.ipynb.json": "a notebook by another name",
        "A/e.py": "no notebook, but perhaps made from one",
        "A/f.HTML": "no notebook, but perhaps made from one",
        "A/g.json": "no notebook, but perhaps made from one",
        "linked": "a link, which is not followed",
        ".C/b.IPYNB": "hidden by the dot",
        "B/.ipynb_checkpoints/lost-checkpoint.ipynb": "hidden by the dot",
        "Петров.ZIP": "an archive: unpack it",
        "B/b.ipynb": "",
    }
    assert {
        name: work.problem[: len(problems.get(name, ""))] for name, work in works.items()
    } == problems
    grades = {
        name: marking.grade(work, SETTING, start=InsideKernel) for name, work in works.items()
    }
    assert {name for name, grade in grades.items() if grade.marks} == {"B/b.ipynb"}
    assert all(
        grade.note and not grade.digest for name, grade in grades.items() if name != "B/b.ipynb"
    )


EASY = {"name": "53", "state": "v", "meter": "x + w", "parameters": {}}


def brings_its_own_variant():
    """Set a solved for an easy table that the opening cell brings along under the name of the
    variant given."""
    return solution(render(read("a"), exercise("a", EASY)))


@pytest.mark.parametrize("given", ["", "53"])
def test_a_table_of_its_own_gets_nothing(graded_here, given):
    found, *_ = graded_here(brings_its_own_variant(), given, masters=None)
    assert "passed" not in found.marks.values()
    assert (
        f"marked as variant 53{', which was given' * bool(given)}, and opens one of its own"
        in found.note
    )


def test_a_list_with_unknown_variants_is_refused(three):
    (three / "list.csv").write_text("name,group,variant\nA,1,mine\n", encoding="utf-8")
    result = grade(three, f"--students {three / 'list.csv'}")
    assert result.exit_code == 1
    assert (
        "gives A the variant mine, which is not known; name the file that you handed out with "
        "--variants" in result.output
    )


def test_whose_variant_it_is_tells_the_path_or_the_notebook(three):
    for name, whom in (("a", "Иванов Иван, 1"), ("b", "Nobody, 1")):
        notebook = claims(student=whom)
        (three / f"{name}.ipynb").write_text(json.dumps(notebook), encoding="utf-8")
    (three / "1" / "Петрова Анна").mkdir(parents=True)
    (three / "1" / "Петрова Анна" / "x.ipynb").write_text(
        json.dumps(claims(student="Иванов Иван, 1")), encoding="utf-8"
    )
    listed = [Student("Иванов Иван", "1", "7"), Student("Петрова Анна", "1", "20")]
    found = submissions.returned(three, masters=FIXTURES, given=course._given(listed))
    assert {one.name: one.variant for one in found} == {
        "a.ipynb": "7", "b.ipynb": "", "c.ipynb": "", "1/Петрова Анна/x.ipynb": "20"
    }  # fmt: skip
    other = submissions.returned(three, masters=FIXTURES, given=course._given(None))
    digests = [{one.name: one.digest for one in some} for some in (found, other)]
    assert {name for name in digests[0] if digests[0][name] != digests[1][name]} == {
        "a.ipynb",
        "1/Петрова Анна/x.ipynb",
    }


def change_file(path):
    path.write_text(path.read_text(encoding="utf-8") + "\n", encoding="utf-8")


# -- without kernels


@pytest.fixture
def three(tmp_path):
    for name in "abc":
        (tmp_path / f"{name}.ipynb").write_text(
            json.dumps(handed_out()) + " " * ord(name), encoding="utf-8"
        )
    return tmp_path


def test_a_kernel_that_does_not_start_is_a_row(three):
    def fails(*_, **__):
        raise RuntimeError("Kernel didn't respond in 60 seconds")

    found = marking.grade(submissions.returned(three, masters=FIXTURES)[0], SETTING, start=fails)
    assert found == Grade("a.ipynb", "not graded", notes=("Kernel didn't respond in 60 seconds",))


def test_no_notebooks_is_an_error(tmp_path):
    result = CliRunner().invoke(cli.main, ["grade", str(tmp_path)])
    assert (result.exit_code, result.output) == (
        1,
        f"Error: no notebooks (*.ipynb) in {tmp_path}\n",
    )


def test_the_same_answers_in_another_order_are_the_same_work():
    """A copied notebook is known though its cells were moved, and its comments changed; another
    answer makes another one."""
    first, second = (
        Cell(i, f"c{i}", "", text)
        for i, text in enumerate(("def one(a):\n    return a", "def two(b):\n    return b"))
    )
    other = Cell(1, "c1", "", "def two(b):  # mine\n    return b")
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
        claimed(claim, [], None)


@pytest.mark.quick
def test_the_variant_is_the_one_that_was_given(tmp_path):
    """Never the notebook's: not its name, and no table that it brings along."""
    claim, easy = {"set": "b", "variant": "mine"}, {"name": "53", "state": "v", "meter": "x + w"}
    file = tmp_path / "mine.toml"
    file.write_text(
        '[variants.mine]\nstate = "q*x + v"\nmeter = "x + w"\nparameters = { q = 0.9 }\n',
        encoding="utf-8",
    )
    found, notes = claimed(claim, [Cell(1, "", "", f'task = exercise("b", {MINE!r})')], file)
    assert float(found.model.parameters["q"]) == 0.9
    assert notes == ["marked as variant mine, and opens one of its own that has this name"]
    found, notes = claimed(
        {"set": "b", "variant": "7"},
        [Cell(1, "", "", f'task = exercise("b", {easy!r})')],
        None,
        "53",
    )
    assert found.variant == exercise("b", "53").variant
    assert notes == [
        "for variant 7, and marked as variant 53, which was given",
        "marked as variant 53, which was given, and opens one of its own that has this name",
    ]
    found, notes = claimed(
        {"set": "b", "variant": "53"}, [Cell(1, "", "", f'task = exercise("b", {easy!r})')], None
    )
    assert found.variant == exercise("b", "53").variant and len(notes) == 1
    with pytest.raises(ValueError, match="no variant 'mine'"):
        claimed(claim, [], None)
    _, notes = claimed(
        {"set": "b", "variant": "53"}, [Cell(1, "", "", 'x = exercise("a", variant="7")')], None
    )
    assert notes == ["opens set a, variant 7"]
    for opening in ("exercise(letter, 1)\n!ls", 'task = exercise("b", "53")'):
        assert (
            claimed({"set": "b", "variant": "53"}, [Cell(1, "", "", opening)], None, "53")[1] == []
        )


def sources(cells, notebook=None):
    """Sources of the assembled notebook's cells, shortened to their first lines."""
    steps, own = assembled(notebook or handed_out(), cells)
    return [step.source.splitlines()[0] for step in steps], own


PLAIN = [
    "import matplotlib.pyplot as plt",
    "def gain(Psi, G, F):",
    'task.check("b1", gain)',
    "def correct(lam, Psi, h, G, F, y):",
    'task.check("b2", correct)',
    "one = np.ones((1, 1, 1))",
]


@pytest.mark.quick
def test_cells_of_the_student_keep_their_places():
    notebook = solved()
    add(notebook, "first = 1", "import matplotlib")
    notebook.cells.insert(0, notebook.cells.pop(notebook.cells.index(cell(notebook, "first"))))
    add(notebook, "before = 1", "def gain")
    add(notebook, "between = 1", 'task.check("b1"')
    add(notebook, "after = 1", "def correct")
    add(notebook, "last = 1")
    found, own = sources(cells_of(notebook))
    expected = list(PLAIN)
    expected.insert(0, "first = 1")
    expected.insert(2, "before = 1")
    expected.insert(4, "between = 1")
    expected.insert(6, "after = 1")
    assert found == [*expected, "last = 1"]
    assert len(own) == 7  # five, and two answers


def test_checks_of_the_student_are_not_run():
    cells = [
        Cell(1, "", "", 'task.check("b1", gain)  # again'),
        Cell(2, "", "", 'task.check("b2", correct)\ntask.check("b9", 1)'),
    ]
    assert sources(cells) == (PLAIN, [])


@pytest.mark.quick
def test_a_cell_that_is_gone_or_text_is_named(graded_here):
    """In place of "not implemented" for what stands on it."""
    notebook = solved()
    gain = cell(notebook, "def gain")
    change(notebook, "def correct", "K = gain(Psi, G, F)", "K = gain(Psi, G, F)\n    K = K + 0")
    notebook.cells.remove(gain)
    found, marks, note = graded_here(notebook)
    assert marks == NEW and note == "the cell of b1 is gone from the notebook"
    assert found.comments["b1"].says == "its cell is gone from the notebook"
    assert found.comments["b2"].says.endswith("or stands on what is not there: the cell of b1")
    gain.cell_type = "markdown"
    notebook.cells.insert(1, gain)
    assert graded_here(notebook)[2] == "the cell of b1 has become text: make it a code cell again"
    assert "cell of" not in graded_here(handed_out())[2]


def test_what_a_library_has_not_implemented_is_no_stub(graded_here):
    lacks = "import sympy as sp\nx = sp.Symbol('x')\nsp.solve(sp.cos(x) - x, x)\ndef correct"
    note = graded_here(change(solved(), "def correct", "def correct", lacks))[2]
    assert "cell 7 (correct): NotImplementedError: multiple generators" in note


def test_a_copy_of_an_answer_for_trials_does_not_replace_it():
    notebook = solved()
    trial = nbformat.from_dict(cell(notebook, "def gain"))
    # its metadata are copied too
    trial.source, trial.id = trial.source.replace("cross = G @ Psi", "cross = 0"), "copy"
    notebook.cells.append(trial)
    steps, _ = assembled(handed_out(), cells_of(notebook))
    assert ["cross = 0" in step.source for step in steps] == [False] * 6 + [True]


def test_answers_are_known_by_name_when_the_master_has_moved_on():
    """A cell was added to the master since: all ids behind it have shifted."""
    added = TINY.replace(
        "### Question 1", "```{code-cell} python\nextra = 1\n```\n\n### Question 1"
    )
    master = student(render(added, exercise("b", "53")), {})
    found, _ = sources(cells_of(solved()), master)
    assert [line for line in found if line.startswith("def")] == [
        "def gain(Psi, G, F):",
        "def correct(lam, Psi, h, G, F, y):",
    ]
    assert found.index('task.check("b1", gain)') > found.index("def gain(Psi, G, F):")


def test_an_answer_with_an_error_is_known_by_its_cell():
    notebook = change(solved(), "def correct", "def correct(", "def corect(")
    change(notebook, "def gain", "def gain(Psi, G, F):", "def gain(Psi, G, F)")
    found, _ = sources(cells_of(notebook))
    assert found[1] == "def gain(Psi, G, F)"
    assert found[3] == "def corect(lam, Psi, h, G, F, y):"
    assert len(found) == len(PLAIN)
