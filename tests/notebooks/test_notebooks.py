"""Exercise notebooks: what masters become, what is written, and what happens if something fails on
the way."""

import ast
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
import sympy as sp
from click.testing import CliRunner
from inside import execute_inside, statuses

from kfcourse import cli
from kfcourse.checks import exercise, sets
from kfcourse.lab.variants import load_variants
from kfcourse.notebooks import execution, handing_out, jobs
from kfcourse.notebooks.course_list import assign
from kfcourse.notebooks.execution import NotebookFailed, html, mathml, pictures, results
from kfcourse.notebooks.jobs import Job, Outcome, make, run_all
from kfcourse.notebooks.master import (
    STUB,
    MasterError,
    read,
    render,
    solution,
    statement,
    student,
)
from kfcourse.notebooks.texts import safe
from kfcourse.notebooks.written_code import python

FIXTURES = Path(__file__).parent / "fixtures"
TINY = (FIXTURES / "b_aof" / "statement.md").read_text(encoding="utf-8")
REQUEST = re.compile(
    r"""<(?:script|img|link|iframe|source|object|embed|video|audio)[^>]*?(?:src|href|data)\s*=\s*["']?+(?!data:|#)"""
)


def tiny(variant="53", text=TINY):
    return render(text, exercise("b", variant))


@pytest.fixture(scope="module")
def executed():
    """The tiny set's solution, really executed."""
    return execution.execute(solution(tiny()), "tiny")


@pytest.fixture
def masters(tmp_path):
    folder = tmp_path / "masters"
    shutil.copytree(FIXTURES, folder)
    return folder


@pytest.fixture
def no_kernel(monkeypatch, executed):
    """Notebooks of the tiny set come executed; the number of executions is counted."""
    calls = []

    def instead(notebook, name, *_, **__):
        calls.append(name)
        result = nbformat.from_dict(notebook)
        for cell, done in zip(result.cells, executed.cells, strict=True):
            if cell.cell_type == "code":
                cell.outputs, cell.execution_count = done.outputs, done.execution_count
        return result

    monkeypatch.setattr(jobs, "execute", instead)
    return calls


def job(tmp_path, masters, kind="solutions", **options):
    return Job("b", "53", tmp_path / "out", kind, masters=masters, **options)


def code(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def contents(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


# -- masters


@pytest.mark.quick
def test_solution_and_stub():
    notebook = tiny()
    answer = code(student(notebook, {}))[1]
    assert (
        answer.source == f'def gain(Psi, G, F):\n    """K, (N, n, p)."""\n    {STUB}\n    raise '
        f"NotImplementedError"
    )
    assert answer.metadata["kfcourse"] == {"answer": "gain"}
    assert code(solution(notebook))[1].source.splitlines()[2:] == [
        "    cross = G @ Psi",
        "    return np.swapaxes(np.linalg.solve(F, cross), -1, -2)",
    ]
    texts = [
        "\n".join(cell.source for cell in n.cells)
        for n in (student(notebook, {}), solution(notebook))
    ]
    assert ["solution's" in text for text in texts] == [False, True]
    assert not any("SOLUTION" in text for text in texts)
    assert "correct_name = correct.__name__" in texts[0]  # what stands behind the end marker stays


@pytest.mark.quick
def test_notebook_knows_its_set_and_variant():
    notebook = student(tiny("7"), {})
    assert notebook.metadata["kfcourse"] == {"set": "b", "variant": "7"}
    assert 'exercise("b", "7")' in code(notebook)[0].source
    assert "Variant 7:" in notebook.cells[0].source
    nbformat.validate(notebook)


AFTER, WITHOUT = (
    "END SOLUTION without BEGIN SOLUTION before it",
    "BEGIN SOLUTION without END SOLUTION",
)


@pytest.mark.quick
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "    # BEGIN SOLUTION\n    cross",
            "    cross",
            rf"master b-aof, cell \d+, line 5: {AFTER}",
        ),
        (
            "    cross = G @ Psi\n",
            "    # BEGIN SOLUTION\n",
            rf"master b-aof, cell \d+, line 4: {WITHOUT} before it",
        ),
        (
            "swapaxes(np.linalg.solve(F, cross), -1, -2)\n    # END SOLUTION",
            "a",
            rf"master b-aof, cell \d+: {WITHOUT}$",
        ),
        ("[= variant =]", "[= variant", r"master b-aof, line \d+: "),
        ("[= variant =]", "[= nothing =]", "master b-aof: 'nothing' is undefined"),
        ("[= variant =]", "[% if %]", r"master b-aof, line 13: "),
    ],
)
def test_errors_of_a_master_name_the_place(old, new, message):
    assert old in TINY
    with pytest.raises(MasterError, match=message):
        tiny(text=TINY.replace(old, new, 1))


@pytest.mark.quick
def test_statement_is_a_page_without_solutions():
    page = statement(tiny(), {})
    assert "secret" not in page and "solve" not in page and "SOLUTION" not in page
    assert f'```python\ndef gain(Psi, G, F):\n    """K, (N, n, p)."""\n    {STUB}' in page


@pytest.mark.quick
def test_what_draws_a_picture_is_folded_under_it():
    drawn = next(cell.id for cell in tiny().cells if "picture" in cell.metadata.get("tags", []))
    page = statement(tiny(), {drawn: ("drawn.png", 720)})
    figure, code = page.index("```{figure} drawn.png\n"), page.index('<details class="kf-code">')
    assert (
        figure < code < page.index("plt.show()") < page.index("</details>", code)
        and ":width: 720px" in page
    )
    assert page.count('<details class="kf-code">') == 1


def test_a_variant_that_is_not_shipped_is_written_into_the_notebook(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(
        '[variants.mine]\nstate = "q*x + v"\nmeter = "x + w"\nparameters = { q = 0.5 }\n',
        encoding="utf-8",
    )
    variant = load_variants(file)["mine"]
    notebook = render(TINY, exercise("b", {"name": "mine", **variant.table}))
    line = next(line for line in code(notebook)[0].source.splitlines() if line.startswith("task ="))
    letter, table = (ast.literal_eval(argument) for argument in ast.parse(line).body[0].value.args)
    assert exercise(letter, table).model == variant.model


# -- formulas as Python


x, y, c = sp.symbols("x y c", real=True)
FORMULAS = [
    x - sp.Rational(1, 3),
    x ** sp.Rational(1, 3),
    sp.E**2,
    c / sp.sqrt(x * y),
    1 / (1 + 1 / sp.sqrt(x)),
    2 ** (1 / sp.sqrt(x)),
    sp.exp(-(x**2) / 2),
    sp.exp(x) ** y,
    sp.atan2(y, x),
    sp.Abs(x),
    (x + sp.Rational(2, 3)) ** -2,
    x * (y + c) ** 2 - (x - y) / (c + 1),
]


@pytest.mark.quick
@pytest.mark.parametrize("formula", FORMULAS, ids=str)
def test_printed_formula_is_the_formula(formula):
    assert sp.sympify(evaluated(python(formula))) == formula


def evaluated(text):
    return eval(text, {"sp": sp, "x": x, "y": y, "c": c})


# -- every set


@pytest.mark.quick
@pytest.mark.parametrize("variant", ["53", "21"])
@pytest.mark.parametrize("letter", sets())
def test_every_line_of_a_stub_is_in_the_solution(letter, variant):
    notebook = render(read(letter), exercise(letter, variant))
    solved = {cell.id: cell.source for cell in solution(notebook).cells}
    answers = 0
    for cell in student(notebook, {}).cells:
        own = [
            line
            for line in cell.source.splitlines()
            if STUB not in line and line.strip() != "raise NotImplementedError"
        ]
        lines = iter(solved[cell.id].splitlines())
        assert all(line in lines for line in own)  # in this order
        answers += STUB in cell.source
    asked = re.findall(r"\.check\(\s*\"(\w+)\"", "\n".join(cell.source for cell in code(notebook)))
    assert asked == [question.name for question in sets()[letter].questions]
    assert answers >= len(asked)
    tags = [tag for cell in notebook.cells for tag in cell.metadata.get("tags", [])]
    assert tags.count("check") == len(asked)
    assert "picture" in tags
    text = "\n".join(cell.source for cell in notebook.cells)
    assert "To hand in" in text and "Hint</summary>" in text


@pytest.mark.parametrize("variant", ["53", "21"])
@pytest.mark.parametrize("letter", sets())
def test_a_new_notebook_fails_only_with_not_implemented(letter, variant):
    """The cells up to the last check, in this process."""
    notebook = student(render(read(letter), exercise(letter, variant)), {})
    assert statuses(code(notebook)) == dict.fromkeys(
        [question.name for question in sets()[letter].questions], "not implemented"
    )


# -- executing


def test_executed_solution_passes_and_draws(executed):
    assert [(r["question"], r["status"]) for r in results(executed)] == [
        ("b1", "passed"),
        ("b2", "passed"),
    ]
    (png,) = pictures(executed).values()
    assert png.startswith(b"\x89PNG")


def test_page_needs_no_network(executed):
    page = html(executed, "A <title>")
    assert not REQUEST.search(page)
    assert not re.search(r"@import|url\(\s*[\"']?+(?!data:|#)", page)
    addresses = set(re.findall(r"https?://[^\s\"'<>)]+", page))
    # names, not loaded
    assert addresses <= {"http://www.w3.org/1998/Math/MathML", "http://www.w3.org/2000/svg"}
    assert page.count("<math") >= 2
    assert 'display="block"' in page and 'display="inline"' in page
    assert "$" not in re.sub(r"<(script|style|pre)\b.*?</\1>", "", page, flags=re.DOTALL)
    assert "data:image/png;base64," in page
    assert "A &lt;title&gt;" in page
    assert "This text is the solution" in page


def test_mathml_leaves_code_alone():
    assert mathml("`$x$` costs \\$5") == "`$x$` costs \\$5"
    assert mathml("```\n$x$\n```") == "```\n$x$\n```"
    assert "<mi>x</mi>" in mathml("so $x$.")


def test_a_failing_cell_is_named():
    broken = nbformat.v4.new_notebook(
        cells=[nbformat.v4.new_code_cell(source) for source in ("1", "nothing", "2")]
    )
    with pytest.raises(
        NotebookFailed,
        match=rf"here, cell {broken.cells[1].id}: NameError: name 'nothing' is not defined",
    ):
        execution.execute(broken, "here")


def test_a_cell_that_takes_too_long_is_named(monkeypatch):
    monkeypatch.setattr(execution, "SECONDS", 5)
    sources = ("1", "import time\ntime.sleep(60)", "2")
    slow = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in sources])
    with pytest.raises(
        NotebookFailed, match=f"here, cell {slow.cells[1].id}: still running after 5 s"
    ):
        execution.execute(slow, "here")


# -- jobs


def test_written_then_up_to_date_then_written_again(tmp_path, masters, no_kernel):
    one = job(tmp_path, masters)
    assert make(one).status == "written"
    names = sorted(contents(one.folder))
    assert names == ["b-aof-solution.html", "b-aof-solution.ipynb"]
    before = contents(one.folder)
    assert make(one).status == "up to date"
    assert contents(one.folder) == before
    assert len(no_kernel) == 1

    master = masters / "b_aof" / "statement.md"
    master.write_text(TINY.replace("Divide.", "Divide by F."), encoding="utf-8")
    assert make(one).status == "written"
    assert "Divide by F." in one.target.read_text(encoding="utf-8")
    assert make(one).status == "up to date"


def test_a_changed_package_or_a_lost_page_means_work(tmp_path, masters, no_kernel, monkeypatch):
    one = job(tmp_path, masters)
    make(one)
    one.target.with_suffix(".html").unlink()
    assert make(one).status == "written"
    monkeypatch.setattr(jobs, "package_digest", lambda: "another version")
    assert make(one).status == "written"
    assert len(no_kernel) == 3


def test_exercises_have_pictures_and_no_solutions(tmp_path, masters, no_kernel):
    one = job(tmp_path, masters, "exercises")
    assert make(one) == Outcome(one, "written")
    assert list(contents(one.folder)) == ["b-aof.ipynb"]
    notebook = nbformat.read(one.target, as_version=4)
    assert "linalg.solve" not in one.target.read_text(encoding="utf-8")
    assert sum(bool(cell.get("attachments")) for cell in notebook.cells) == 1
    assert not any(cell.outputs or cell.execution_count for cell in code(notebook))


def test_without_a_browser_it_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda _: None)
    with pytest.raises(
        NotebookFailed, match="no browser to print PDF with; install one of chromium"
    ):
        execution.pdf(tmp_path / "page.html", tmp_path / "page.pdf")


@pytest.mark.quick
def test_a_solution_that_does_not_pass_is_not_handed_out(tmp_path, masters, monkeypatch):
    monkeypatch.setattr(jobs, "execute", execute_inside)
    (masters / "b_aof" / "statement.md").write_text(
        TINY.replace("cross = G @ Psi", "cross = 2 * G @ Psi"), encoding="utf-8"
    )
    outcome = make(job(tmp_path, masters))
    assert outcome.status == "failed"
    assert re.match(r"the solution does not pass b1: not right\. It is twice", outcome.message)
    assert not (tmp_path / "out").exists()


# -- commands


@pytest.fixture
def call(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return lambda line: CliRunner().invoke(cli.main, shlex.split(line))


def refused(result, *words):
    assert result.exit_code in (1, 2)
    assert isinstance(result.exception, SystemExit)
    line = next(line for line in result.output.splitlines() if line.startswith("Error: "))
    for word in words:
        assert word in line


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
    for workers in (1, 2):
        result = call(
            f"exercises --variant 53 --variant 12 --sets b,c,d --masters {masters} "
            f"--out out{workers} --jobs {workers}"
        )
        assert result.exit_code == 1
        failed = [line for line in result.output.splitlines() if line.startswith("FAILED")]
        assert len(failed) == 4
        assert failed[0].startswith("FAILED variant 12, c-duof: cell c-01: ZeroDivisionError")
        assert failed[1].startswith("FAILED variant 12, d-fos: no master")
        rows = [
            line.split() for line in result.output.splitlines() if line.startswith(f"out{workers}/")
        ]
        assert rows == [[f"out{workers}/{name}", "1", "0", "2"] for name in ("53", "12")]
    first, second = contents(tmp_path / "out1"), contents(tmp_path / "out2")
    assert first == second
    assert sorted(first) == ["12/b-aof.ipynb", "53/b-aof.ipynb"]

    result = call(f"exercises --variant 53 --sets b --masters {masters} --out out2 --jobs 1")
    assert result.exit_code == 0
    assert ["out2/53", "0", "1", "0"] in [line.split() for line in result.output.splitlines()]


def test_a_variant_that_is_no_model_is_told_at_the_end_and_the_others_are_made(
    call, masters, no_kernel, tmp_path
):
    (tmp_path / "my.toml").write_text(
        "".join(
            f'[variants.{name}]\nstate = "{state}"\nmeter = "x + w"\n'
            for name, state in (("good", "x + v"), ("bad", "x + z"))
        ),
        encoding="utf-8",
    )
    options = f"--all --variants my.toml --sets b --masters {masters} --out out --jobs 1"
    result = call(f"exercises {options}")
    assert result.exit_code == 1
    (line,) = [line for line in result.output.splitlines() if line.startswith("FAILED")]
    assert line.startswith("FAILED variant bad in my.toml: unknown symbol 'z'")
    assert sorted(contents(tmp_path / "out")) == ["good/b-aof.ipynb"]


STOPPED = """
import os, signal, nbformat
from kfcourse.notebooks.execution import execute
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
    done = subprocess.run(
        [sys.executable, "-c", STOPPED], capture_output=True, text=True, timeout=120
    )
    assert done.stdout == "interrupted\n", done.stderr


def killed(_):
    import os

    os._exit(1)


def test_a_killed_worker_is_told():
    with pytest.raises(ValueError, match="a working process was killed"):
        list(run_all([1, 2], killed, 2, "test"))


def test_unknown_names_are_refused(call, tmp_path):
    for options, words in (
        ("exercises", "name the variants: --variant 53, or --all"),
        ("exercises --variant 99", "no variant '99'; there are 53, 1,"),
        ("solutions --variant 53 --sets b,zz", "no exercise set zz; there are a, b"),
        ("solutions --variant 53 --sets ,", "no exercise set"),
        ("exercises --variant 53 --variants no.toml", "no file of variants at no.toml"),
        ("exercises --students no.csv", "no course list no.csv"),
        ("exercises --students no.csv --nbgrader", "the same notebooks to all students"),
    ):
        refused(call(f"{options} --out o"), words)
    assert not (tmp_path / "o").exists()


def test_two_notebooks_never_share_a_file(call, tmp_path):
    (tmp_path / "list.csv").write_text("name,group\nИванов И.,1\nИванов И,1\n", encoding="utf-8")
    refused(
        call("exercises --out o --students list.csv --sets b"),
        "line 3",
        "Иванов-И",
        "in line 2",
    )
    (tmp_path / "my.toml").write_text(
        "".join(
            f'[variants."{name}"]\nstate = "x + v"\nmeter = "x + w"\n' for name in ("A/b", "a-B")
        ),
        encoding="utf-8",
    )
    refused(
        call("exercises --out o --all --variants my.toml --sets b"),
        "two notebooks would be",
    )
    assert not (tmp_path / "o").exists()


def test_a_course_list_makes_a_folder_for_each_student(call, tmp_path, masters, monkeypatch):
    monkeypatch.setattr(
        handing_out, "run_all", lambda work, *_: [Outcome(job, "written") for job in work]
    )
    (tmp_path / "list.csv").write_text(
        "name;group\nИванов Иван;М-1\n../../evil;M\n", encoding="utf-8-sig"
    )
    result = call(f"exercises --students list.csv --out o --sets b,c --masters {masters}")
    assert result.exit_code == 0
    folders = [line.split()[0] for line in result.output.splitlines() if line.startswith("o/")]
    assert folders == ["o/М-1/Иванов-Иван", "o/M/evil"]


# -- course lists


VARIANTS = ["53", "1", "2", "3"]


def course_list(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "list.csv"
    path.write_bytes(text.encode(encoding))
    return path


def students(tmp_path, count, groups=2):
    rows = "".join(f"Student {i},G{i % groups}\n" for i in range(count))
    return assign(course_list(tmp_path, "name,group\n" + rows), VARIANTS)


def test_assignment_is_deterministic_and_does_not_move(tmp_path):
    whole = students(tmp_path, 30)
    assert whole == students(tmp_path, 30)
    for count in (1, 7, 29):
        assert students(tmp_path, count) == whole[:count]
    assert {one.variant for one in whole} == set(VARIANTS)


def test_variants_differ_within_a_group_until_all_are_taken(tmp_path):
    whole = students(tmp_path, 40)
    for group in ("G0", "G1"):
        given = [one.variant for one in whole if one.group == group]
        for start in range(0, 20, len(VARIANTS)):
            assert sorted(given[start : start + len(VARIANTS)]) == sorted(VARIANTS)


def test_assignment_does_not_follow_the_order_of_the_variants(tmp_path):
    """Otherwise the first in every group would have the same."""
    firsts = {
        assign(course_list(tmp_path, f"name,group\nA,{i}\n"), VARIANTS)[0].variant
        for i in range(30)
    }
    assert firsts == set(VARIANTS)


@pytest.mark.parametrize("separator", [",", ";"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_lists_of_spreadsheets_are_read(tmp_path, separator, encoding):
    text = (
        separator.join((" Group ", "No", "NAME"))
        + "\r\n"
        + separator.join(("М-1", "1", '"Иванов, Иван"'))
        + "\r\n\r\n"
    )
    (one,) = assign(course_list(tmp_path, text, encoding), VARIANTS)
    assert (one.name, one.group) == ("Иванов, Иван", "М-1")


@pytest.mark.quick
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the first line must name the columns name and group, got nothing"),
        ("student,group\nA,1\n", "got student, group"),
        ("A,1\nB,1\n", "got a, 1"),
        ("name,group\n", "names no student"),
        ("name,group\nA,1\n,1\n", "line 3: a student without a name"),
        ("name,group\nA,1\nB,1\nA,1\n", "line 4: A, 1 stands there twice"),
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
        ('name,group\n"A,1\nB",1\nC,1\n', "line 2: a quote is opened and not closed on the line"),
        ('name,group\nA,1\n"B" b,1\n', "line 3: ',' expected after '\"'; is a quote"),
        ("name,group\nA\nB,1\n", "line 2: A without a group"),
        ("name,group\nA,...\n", "line 2: A without a group (got '...')"),
        ("name,group\nA,1\n?!,1\n", "line 3: a student without a name (got '?!')"),
        ("name,group\nIvanov, Ivan,1\n", "line 2: more values than columns"),
        ("name,group\n" + "a" * 101 + ",1\n", "line 2: a name of more than 100 characters"),
        ("name,group\nA" + "a" * 200_000 + ",1\n", "line 2: field larger than field limit"),
    ],
)
def test_bad_lists_are_explained(tmp_path, text, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        assign(course_list(tmp_path, text), VARIANTS)


def test_other_encodings_are_explained(tmp_path):
    with pytest.raises(ValueError, match="is not UTF-8; save it as CSV UTF-8"):
        assign(course_list(tmp_path, "name,group\nИванов,1\n", "cp1251"), VARIANTS)


@pytest.mark.parametrize("name", ["..", "../a", "a/b", ".hidden", "a\\b", " ", "con:", "a\nb"])
def test_safe_names_stay_in_their_folder(name):
    assert re.fullmatch(r"\w[\w.-]*", safe(name))
