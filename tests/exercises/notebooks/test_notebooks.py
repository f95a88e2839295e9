"""Exercise notebooks: what masters become, what is written, and what happens if something fails on
the way."""

import ast
import os
import re
import shlex
import shutil
import subprocess
import sys

import nbformat
import pytest
import sympy as sp
from click.testing import CliRunner
from inside import FIXTURES, TINY, code, execute_inside, handed_out, solved, tiny

from kfcourse import cli
from kfcourse.exercises.checks import exercise
from kfcourse.exercises.notebooks import execution, handing_out, jobs
from kfcourse.exercises.notebooks.course_list import assign
from kfcourse.exercises.notebooks.execution import NotebookFailed, html, mathml, pictures, results
from kfcourse.exercises.notebooks.jobs import Job, Outcome, make, run_all
from kfcourse.exercises.notebooks.master import STUB, MasterError, statement
from kfcourse.exercises.notebooks.texts import safe
from kfcourse.exercises.notebooks.written_code import python
from kfcourse.lab.variants import load_variants

REQUEST = re.compile(
    r"""<(?:script|img|link|iframe|source|object|embed|video|audio)[^>]*?(?:src|href|data)\s*=\s*["']?+(?!data:|#)"""
    r"""|@import|url\(\s*["']?+(?!data:|#)"""
)


@pytest.fixture(scope="module")
def executed():
    """The tiny set's solution, really executed."""
    return execution.execute(solved(), "tiny")


@pytest.fixture
def masters(tmp_path):
    return shutil.copytree(FIXTURES, tmp_path / "masters")


@pytest.fixture
def no_kernel(monkeypatch, executed):
    """Notebooks of the tiny set come executed; the number of executions is counted."""
    calls = []

    def instead(notebook, name, *_, **__):
        calls.append(name)
        result = nbformat.from_dict(notebook)
        for cell, done in zip(code(result), code(executed), strict=True):
            cell.outputs, cell.execution_count = done.outputs, done.execution_count
        return result

    monkeypatch.setattr(jobs, "execute", instead)
    return calls


def contents(folder):
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


# -- masters


def test_solution_and_stub():
    student, solution = handed_out(), solved()
    answer = code(student)[1]
    assert answer.source == (
        f'def gain(Psi, G, F):\n    """K, (N, n, p)."""\n    {STUB}\n    raise NotImplementedError'
    )
    assert answer.metadata["kfcourse"] == {"answer": "gain"}
    assert code(solution)[1].source.splitlines()[2:] == [
        "    cross = G @ Psi",
        "    return np.swapaxes(np.linalg.solve(F, cross), -1, -2)",
    ]
    texts = ["\n".join(cell.source for cell in n.cells) for n in (student, solution)]
    assert ["solution's" in text for text in texts] == [False, True]
    assert not any("SOLUTION" in text for text in texts)
    assert "correct_name = correct.__name__" in texts[0]  # what stands behind the end marker stays


def test_notebook_knows_its_set_and_variant():
    notebook = tiny("7")
    assert notebook.metadata["kfcourse"] == {"set": "b", "variant": "7"}
    assert 'exercise("b", "7")' in code(notebook)[0].source
    assert "Variant 7:" in notebook.cells[0].source
    nbformat.validate(notebook)


AFTER = "END SOLUTION without BEGIN SOLUTION before it"
WITHOUT = "BEGIN SOLUTION without END SOLUTION"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("    # BEGIN SOLUTION\n    cross", "    cross", rf"cell \d+, line 5: {AFTER}"),
        ("    cross = G @ Psi\n", "    # BEGIN SOLUTION\n", rf"cell \d+, line 4: {WITHOUT} before"),
        (
            "swapaxes(np.linalg.solve(F, cross), -1, -2)\n    # END SOLUTION",
            "a",
            rf"cell \d+: {WITHOUT}$",
        ),
        ("[= variant =]", "[= variant", r"line \d+: "),
        ("[= variant =]", "[= nothing =]", "'nothing' is undefined"),
        ("[= variant =]", "[% if %]", r"line 13: "),
    ],
)
def test_errors_of_a_master_name_the_place(old, new, message):
    assert old in TINY
    with pytest.raises(MasterError, match=f"master b-aof[,:] {message}"):
        tiny(text=TINY.replace(old, new, 1))


def test_statement_is_a_page_without_solutions_and_what_draws_is_folded_under_its_picture():
    drawn = next(cell.id for cell in tiny().cells if "picture" in cell.metadata.get("tags", []))
    page = statement(tiny(), {drawn: ("drawn.png", 720)})
    assert "solution's" not in page and "solve" not in page and "SOLUTION" not in page
    assert f'```python\ndef gain(Psi, G, F):\n    """K, (N, n, p)."""\n    {STUB}' in page
    figure, fold = page.index("```{figure} drawn.png\n"), page.index('<details class="kf-code">')
    assert figure < page.index(":width: 720px") < fold < page.index("plt.show()")
    assert page.count('<details class="kf-code">') == 1


MINE = '[variants.mine]\nstate = "q*x + v"\nmeter = "x + w"\nparameters = { q = 0.5 }\n'


def test_a_variant_that_is_not_shipped_is_written_into_the_notebook(tmp_path):
    (tmp_path / "mine.toml").write_text(MINE, encoding="utf-8")
    variant = load_variants(tmp_path / "mine.toml")["mine"]
    opening = code(tiny({"name": "mine", **variant.table}))[0].source
    call = next(line for line in ast.parse(opening).body if isinstance(line, ast.Assign)).value
    assert exercise(*map(ast.literal_eval, call.args)).model == variant.model


# -- formulas as Python


x, y, c = sp.symbols("x y c", real=True)


@pytest.mark.parametrize(
    "formula",
    [
        x ** sp.Rational(1, 3),
        sp.E**2,
        c / sp.sqrt(x * y),
        1 / (1 + 1 / sp.sqrt(x)),
        2 ** (1 / sp.sqrt(x)),
        sp.exp(x) ** y,
        sp.atan2(y, x),
        sp.Abs(x),
        (x + sp.Rational(2, 3)) ** -2,
        x * (y + c) ** 2 - (x - y) / (c + 1),
    ],
    ids=str,
)
def test_printed_formula_is_the_formula(formula):
    assert sp.sympify(eval(python(formula), {"sp": sp, "x": x, "y": y, "c": c})) == formula


# -- executing


def test_a_page_needs_no_network(executed):
    assert [result["status"] for result in results(executed)] == ["passed", "passed"]
    (png,) = pictures(executed).values()
    assert png.startswith(b"\x89PNG")
    page = html(executed, "A <title>")
    assert not REQUEST.search(page)
    addresses = set(re.findall(r"https?://[^\s\"'<>)]+", page))
    # names, not loaded
    assert addresses <= {"http://www.w3.org/1998/Math/MathML", "http://www.w3.org/2000/svg"}
    assert "$" not in re.sub(r"<(script|style|pre)\b.*?</\1>", "", page, flags=re.DOTALL)
    for words in (
        'display="block"',
        'display="inline"',
        "data:image/png;base64,",
        "A &lt;title&gt;",
        "This text is the solution",
        '<span class="k">def</span>',
        ".highlight .k {",
        "overflow: auto hidden",
    ):
        assert words in page


def test_mathml_leaves_code_alone():
    assert mathml("`$x$` costs \\$5") == "`$x$` costs \\$5"
    assert mathml("```\n$x$\n```") == "```\n$x$\n```"
    spaced = re.sub(r"</mspace>| /(?=>)", "", mathml(r"so $y = h \sin x$."))
    assert (
        '<mi>h</mi><mspace width="0.167em"><mi>sin</mi><mspace width="0.167em"><mi>x</mi>' in spaced
    )


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("nothing", "NameError: name 'nothing' is not defined"),
        ("import time\ntime.sleep(60)", "still running after 5 s"),
    ],
)
def test_a_failing_cell_is_named(monkeypatch, source, message):
    monkeypatch.setattr(execution, "SECONDS", 5)
    cells = [nbformat.v4.new_code_cell(text) for text in ("1", source, "2")]
    with pytest.raises(NotebookFailed, match=f"here, cell {cells[1].id}: {message}"):
        execution.execute(nbformat.v4.new_notebook(cells=cells), "here")


# -- jobs


def job(tmp_path, masters, kind="solutions"):
    return Job("b", "53", tmp_path / "out", kind, masters=masters)


def test_what_is_up_to_date_is_not_made_again(tmp_path, masters, no_kernel, monkeypatch):
    made = job(tmp_path, masters)
    assert make(made).status == "written"
    before = contents(made.folder)
    assert sorted(before) == ["b-aof-solution.html", "b-aof-solution.ipynb"]
    assert make(made).status == "up to date"
    assert contents(made.folder) == before and len(no_kernel) == 1

    text = TINY.replace("Divide.", "Divide by F.")
    (masters / "b_aof" / "statement.md").write_text(text, encoding="utf-8")
    assert make(made).status == "written"
    assert "Divide by F." in made.target.read_text(encoding="utf-8")
    assert make(made).status == "up to date"
    made.target.with_suffix(".html").unlink()
    assert make(made).status == "written"
    monkeypatch.setattr(jobs, "package_digest", lambda: "another version")
    assert make(made).status == "written"
    assert len(no_kernel) == 4


def test_exercises_have_pictures_and_no_solutions(tmp_path, masters, no_kernel):
    made = job(tmp_path, masters, "exercises")
    assert make(made) == Outcome(made, "written")
    assert list(contents(made.folder)) == ["b-aof.ipynb"]
    notebook = nbformat.read(made.target, as_version=4)
    assert "linalg.solve" not in made.target.read_text(encoding="utf-8")
    assert sum(bool(cell.get("attachments")) for cell in notebook.cells) == 1
    assert not any(cell.outputs or cell.execution_count for cell in code(notebook))


def test_without_a_browser_it_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda _: None)
    with pytest.raises(NotebookFailed, match="no browser to print PDF with; install one of chrom"):
        execution.pdf(tmp_path / "page.html", tmp_path / "page.pdf")


def test_a_solution_that_does_not_pass_is_not_handed_out(tmp_path, masters, monkeypatch):
    monkeypatch.setattr(jobs, "execute", execute_inside)
    text = TINY.replace("cross = G @ Psi", "cross = 2 * G @ Psi")
    (masters / "b_aof" / "statement.md").write_text(text, encoding="utf-8")
    outcome = make(job(tmp_path, masters))
    assert outcome.status == "failed"
    assert outcome.message.startswith("the solution does not pass b1: not right. It is twice")
    assert not (tmp_path / "out").exists()


# -- commands


@pytest.fixture
def call(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return lambda line: CliRunner().invoke(cli.main, shlex.split(line))


def failures(result):
    assert result.exit_code == 1
    return [line for line in result.output.splitlines() if line.startswith("FAILED")]


def test_jobs_do_not_change_what_is_written_and_failures_do_not_stop_the_rest(
    call, tmp_path, masters, no_kernel, monkeypatch
):
    """Two processes with kernels write what this process writes without."""
    (masters / "c_duof").mkdir()
    fails = TINY.replace("import matplotlib", "1 / 0\nimport matplotlib", 1)
    (masters / "c_duof" / "statement.md").write_text(fails, encoding="utf-8")
    without = jobs.execute

    def instead(notebook, name, *_, **__):
        if "1 / 0" in code(notebook)[0].source:
            raise NotebookFailed(f"{name}, cell c-01: ZeroDivisionError: division by zero")
        return without(notebook, name)

    monkeypatch.setattr(jobs, "execute", instead)  # in this process
    command = f"exercises --variant 53 --masters {masters}"
    for workers in (1, 2):
        result = call(f"{command} --variant 12 --sets b,c,d --out out{workers} --jobs {workers}")
        failed = failures(result)
        assert len(failed) == 4
        assert failed[0].startswith("FAILED variant 12, c-duof: cell c-01: ZeroDivisionError")
        assert failed[1].startswith("FAILED variant 12, d-fos: no master")
        rows = [line.split() for line in result.output.splitlines() if line.startswith("out")]
        assert rows == [[f"out{workers}/{name}", "1", "0", "2"] for name in ("53", "12")]
    first, second = contents(tmp_path / "out1"), contents(tmp_path / "out2")
    assert first == second
    assert sorted(first) == ["12/b-aof.ipynb", "53/b-aof.ipynb"]

    result = call(f"{command} --sets b --out out2 --jobs 1")
    assert result.exit_code == 0
    assert ["out2/53", "0", "1", "0"] in [line.split() for line in result.output.splitlines()]


def test_a_variant_that_is_no_model_is_told_at_the_end_and_the_others_are_made(
    call, masters, no_kernel, tmp_path
):
    bad = MINE.replace("mine", "bad").replace("q*x", "q*z")
    (tmp_path / "my.toml").write_text(MINE + bad, encoding="utf-8")
    options = f"--all --variants my.toml --sets b --masters {masters} --out out --jobs 1"
    (line,) = failures(call(f"exercises {options}"))
    assert line.startswith("FAILED variant bad in my.toml: unknown symbol 'z'")
    assert sorted(contents(tmp_path / "out")) == ["mine/b-aof.ipynb"]


STOPPED = """
import os, signal, nbformat
from kfcourse.exercises.notebooks.execution import execute
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in a shell's background is born deaf to it
stop = f"import os, signal, time; os.kill({os.getpid()}, signal.SIGINT); time.sleep(60)"
try:
    execute(nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(stop)]), "stopped")
except KeyboardInterrupt:
    print("interrupted")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no signal to another process")
def test_ctrl_c_ends_the_command_and_not_a_kernel_alone():
    """Otherwise the notebook fails, and the next ones are made."""
    command = [sys.executable, "-c", STOPPED]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.stdout == "interrupted\n", done.stderr


def test_a_killed_worker_is_told():
    with pytest.raises(ValueError, match="a working process was killed"):
        list(run_all([1, 2], os._exit, 2, "test"))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("exercises", "name the variants: --variant 53, or --all"),
        ("exercises --variant 99", "no variant '99'; there are 53, 1,"),
        ("solutions --variant 53 --sets b,zz", "no exercise set zz; there are a, b"),
        ("exercises --variant 53 --variants no.toml", "no.toml cannot be read"),
        ("exercises --students no.csv", "the course list no.csv, a CSV file"),
        ("exercises --students no.csv --nbgrader", "the same notebooks to all students"),
        # two notebooks never share a file
        ("exercises --students same.csv --sets b", "line 3: the folder of Иванов И, 1"),
        ("exercises --all --variants same.toml --sets b", "two notebooks would be"),
    ],
)
def test_what_cannot_be_made_is_refused(call, tmp_path, options, words):
    (tmp_path / "same.csv").write_text("name,group\nИванов И.,1\nИванов И,1\n", encoding="utf-8")
    same = MINE.replace("mine", '"A/b"') + MINE.replace("mine", '"a-B"')
    (tmp_path / "same.toml").write_text(same, encoding="utf-8")
    result = call(f"{options} --out o")
    assert result.exit_code in (1, 2) and isinstance(result.exception, SystemExit)
    line = next(line for line in result.output.splitlines() if line.startswith("Error: "))
    assert words in line and not (tmp_path / "o").exists()


def test_a_course_list_makes_a_folder_for_each_student(call, tmp_path, masters, monkeypatch):
    written = lambda work, *_: [Outcome(job, "written") for job in work]  # noqa: E731
    monkeypatch.setattr(handing_out, "run_all", written)
    text = "name;group\nИванов Иван;М-1\n../../evil;M\n"
    (tmp_path / "list.csv").write_text(text, encoding="utf-8-sig")
    result = call(f"exercises --students list.csv --out o --sets b,c --masters {masters}")
    assert result.exit_code == 0
    folders = [line.split()[0] for line in result.output.splitlines() if line.startswith("o/")]
    assert folders == ["o/М-1/Иванов-Иван", "o/M/evil"]


# -- course lists


VARIANTS = ["53", "1", "2", "3"]


def assigned(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "list.csv"
    path.write_bytes(text.encode(encoding))
    return assign(path, VARIANTS)


def students(tmp_path, count):
    rows = "".join(f"Student {i},G{i % 2}\n" for i in range(count))
    return assigned(tmp_path, "name,group\n" + rows)


def test_assignment_does_not_move_and_gives_a_group_all_variants(tmp_path):
    whole = students(tmp_path, 40)
    for count in (1, 7, 29, 40):
        assert students(tmp_path, count) == whole[:count]
    for group in ("G0", "G1"):
        given = [student.variant for student in whole if student.group == group]
        for start in range(0, 20, len(VARIANTS)):
            assert sorted(given[start : start + len(VARIANTS)]) == sorted(VARIANTS)
    # else the first in every group would have the same
    rows = "".join(f"A,{i}\n" for i in range(30))
    assert {student.variant for student in assigned(tmp_path, "name,group\n" + rows)} == set(
        VARIANTS
    )


@pytest.mark.parametrize("separator", [",", ";"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_lists_of_spreadsheets_are_read(tmp_path, separator, encoding):
    rows = (" Group ", "No", "NAME"), ("М-1", "1", '"Иванов, Иван"'), ()
    text = "".join(separator.join(row) + "\r\n" for row in rows)
    (student,) = assigned(tmp_path, text, encoding)
    assert (student.name, student.group) == ("Иванов, Иван", "М-1")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the first line must name the columns name and group, got nothing"),
        ("student,group\nA,1\n", "got student, group"),
        ("name,group\n", "names no student"),
        ("name,group\nA,1\n,1\n", "line 3: a student without a name"),
        ("name,group\nA,1\nB,1\nA,1\n", "line 4: the folder of A, 1 would be 1/A, as that of A"),
        (
            "name,group\nA,1\na,1\n",
            "line 3: the folder of a, 1 would be 1/a, as that of A, 1 in line 2",
        ),
        (
            "name,group\nИванов,1\nИванов\u0438\u0306,1\nИвановй,1\n",
            "line 4: the folder of Ивановй, 1",
        ),
        (
            'name,group\n"A,1\nB,1\n',
            "line 2: unexpected end of data; is a quote opened and not closed?",
        ),
        ("name,group\nA\nB,1\n", "line 2: A without a group"),
        ("name,group\nA,...\n", "line 2: A without a group (got '...')"),
        ("name,group\nIvanov, Ivan,1\n", "line 2: more values than columns"),
        ("name,group\nA" + "a" * 200_000 + ",1\n", "line 2: field larger than field limit"),
    ],
)
def test_bad_lists_are_explained(tmp_path, text, message):
    with pytest.raises(ValueError, match=re.escape(message)) as error:
        assigned(tmp_path, text)
    assert str(error.value).isprintable()


def test_other_encodings_are_explained(tmp_path):
    with pytest.raises(ValueError, match="is not UTF-8; save it as CSV UTF-8"):
        assigned(tmp_path, "name,group\nИванов,1\n", "cp1251")


@pytest.mark.parametrize("name", ["..", "../a", "a/b", ".hidden", "a\\b", " ", "con:", "a\nb"])
def test_safe_names_stay_in_their_folder(name):
    assert re.fullmatch(r"\w[\w.-]*", safe(name))
