"""The house keeps its order: imports run down, no module hides behind a function, no room grows."""

import ast
import collections
import inspect
import io
import os
import re
import subprocess
import sys
import tokenize
from graphlib import TopologicalSorter
from importlib import import_module
from pathlib import Path

import pytest

import kfcourse

# From the top floor down: imports only run down this list.
FLOORS = [
    "cli",
    "checks",
    "exercises.commands",
    "exercises.grading",
    "exercises.notebooks",
    "exercises.sets",
    "pages",
    "exercises.checks",
    "exercises.derivations",
    "exercises",
    "lab",
    "scenarios",
    "continuous",
    "records",
    "montecarlo",
    "filters",
    "linear",
    "symbolic",
    "laws",
    "angles",
    "limits",
    "errors",
    "files",
]


def modules():
    """Name below `kfcourse`, such as "filters.kalman", and file of every module; a folder by its
    own name."""
    root, sets = (
        Path(kfcourse.__file__).parent,
        Path(import_module("kfcourse.exercises").__file__).parent,
    )
    places = {path: path.relative_to(root) for path in root.rglob("*.py")}
    places |= {path: Path("exercises", path.relative_to(sets)) for path in sets.rglob("*.py")}
    names = {
        ".".join(place.with_suffix("").parts).removesuffix(".__init__"): path
        for path, place in places.items()
    }
    return {name: path for name, path in sorted(names.items()) if not name.startswith("__")}


MODULES = modules()


def imported(path):
    """Modules of this package that a file imports; not those that only a type checker reads.

    From a folder it imports the folder, unless what it takes is a module:
    `from kfcourse.filters import notation`.
    """
    tree = ast.parse(path.read_text(encoding="utf-8"))
    blocks = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"
    ]
    typing = {id(node) for block in blocks for node in ast.walk(block)}
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and id(node) not in typing:
            folder = (node.module or "").removeprefix("kfcourse").removeprefix(".")
            inside = {f"{folder}.{alias.name}".removeprefix(".") for alias in node.names}
            if (node.module or "").split(".")[0] == "kfcourse":
                names |= {name if name in MODULES else folder for name in inside} - {""}
        elif isinstance(node, ast.Import) and id(node) not in typing:
            names |= {
                alias.name.removeprefix("kfcourse.")
                for alias in node.names
                if alias.name.startswith("kfcourse.")
            }
    return names


def floor(name):
    """Folder, or module, right below `kfcourse`; of the exercises the folder below them."""
    return ".".join(name.split(".")[: 2 if name.startswith("exercises.") else 1])


def test_imports_run_down_and_only_between_known_floors():
    assert {floor(name) for name in MODULES} == set(FLOORS)
    pairs = {
        (floor(name), floor(other)) for name, path in MODULES.items() for other in imported(path)
    }
    assert [pair for pair in pairs if FLOORS.index(pair[0]) > FLOORS.index(pair[1])] == []


def test_no_circle():
    """Neither among files, those of a folder too, nor through a folder's own `__init__`."""
    graph = {
        name: {other for other in imported(path) if other in MODULES} - {name}
        for name, path in MODULES.items()
    }
    # CycleError if there is one
    assert set(TopologicalSorter(graph).static_order()) == set(MODULES)


@pytest.mark.parametrize("name", MODULES)
def test_a_module_does_not_carry_the_name_of_what_it_exports(name):
    module, last = import_module(f"kfcourse.{name}"), name.rpartition(".")[2]
    assert inspect.ismodule(module)
    assert last not in vars(module) or inspect.ismodule(vars(module)[last])
    assert last not in kfcourse.__all__


def test_a_filter_cites_its_source():
    """Name and year, in the docstring of its file or in its own; the exact filter's stands in the
    map of its folder."""
    from kfcourse import filters

    exported = [
        build for build in map(vars(filters).get, filters.__all__) if inspect.isfunction(build)
    ]
    homes = {build.__module__ for build in exported} - {"kfcourse.filters.notation"}
    assert len(homes) > 5
    for home in homes:
        module = import_module(
            "kfcourse.filters.exact" if home.startswith("kfcourse.filters.exact") else home
        )
        texts = [module.__doc__, *(build.__doc__ for build in exported if build.__module__ == home)]
        assert re.search(
            r"(?:[A-Z][a-z]+|others)(?:'s)?,?\s\(?(?:19|20)\d\d\b", " ".join(map(str, texts))
        ), home


def test_what_notebooks_import_is_there():
    for name in kfcourse.__all__:
        assert hasattr(kfcourse, name)
    from kfcourse.checks import exercise

    assert exercise("a").check("a2", None).status == "unusable"


@pytest.mark.parametrize(
    ("code", "slow"),
    [
        ("from kfcourse import *", ["IPython", "matplotlib", "nbformat"]),
        (
            "import kfcourse.cli",
            ["jupyter_client", "jupytext", "nbclient", "nbconvert", "nbformat"],
        ),
        ("import kfcourse.exercises.grading.pool", ["IPython", "matplotlib"]),
    ],
)
def test_what_is_slow_to_import_waits_until_it_is_used(code, slow):
    """Every command and every graded notebook imports the package."""
    code = (
        f"import atexit, sys; atexit.register(lambda: print([name for name in {slow} if name "
        f"in sys.modules])); {code}"
    )
    assert subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.endswith("[]\n")


def test_two_copies_of_the_project_are_not_mixed(tmp_path):
    """PYTHONPATH names another checkout than the one that is installed: its exercises would be the
    installed one's, silently."""
    copy, package = tmp_path / "kfcourse", Path(kfcourse.__file__).parent
    copy.mkdir()
    for path in package.iterdir():
        (copy / path.name).symlink_to(path)
    (copy / "__init__.py").unlink()
    (copy / "__init__.py").write_bytes((package / "__init__.py").read_bytes())
    command = [sys.executable, "-c", "import kfcourse.exercises"]
    other = os.environ | {"PYTHONPATH": str(tmp_path)}
    mixed = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=other)
    assert f"kfcourse is that of {copy}" in mixed.stderr.splitlines()[-1]
    assert subprocess.run(command).returncode == 0


# Code tokens of each room, without comments, docstrings and line ends.  A number may only fall: who
# writes less lowers it.
ROOMS = {
    "benchmarks": 4_050,
    "book": 29_260,
    "exercises/*.py": 820,
    "exercises/checks": 16_510,
    "exercises/derivations": 13_500,
    "exercises/grading": 14_900,
    "exercises/notebooks": 7_420,
    "exercises/sets": 42_040,
    "kfcourse/*.py": 6_160,
    "kfcourse/continuous": 9_840,
    "kfcourse/filters": 30_340,
    "kfcourse/lab": 18_720,
    "kfcourse/linear": 5_550,
    "kfcourse/montecarlo": 10_600,
    "kfcourse/pages": 7_970,
    "kfcourse/records": 5_460,
    "kfcourse/scenarios": 9_960,
    "kfcourse/symbolic": 18_520,
    "tests": 169_820,
}
OF_LAYOUT = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}
DOCUMENTED = (ast.Module, ast.FunctionDef, ast.ClassDef, ast.AsyncFunctionDef)


NAMELESS = {"one", "found", "told", "said", "some"}  # say nothing of what they name


def tokens(path):
    """Code tokens of a file."""
    source = path.read_text(encoding="utf-8")
    first = {
        node.body[0]
        for node in ast.walk(ast.parse(source))
        if isinstance(node, DOCUMENTED) and node.body
    }
    texts = {
        node.lineno
        for node in first
        if isinstance(node, ast.Expr) and isinstance(getattr(node.value, "value", None), str)
    }
    made = tokenize.generate_tokens(io.StringIO(source).readline)
    return [
        t
        for t in made
        if t.type not in OF_LAYOUT and not (t.type == tokenize.STRING and t.start[0] in texts)
    ]


def test_no_room_grows_and_every_name_says_something():
    root, counts = Path(__file__).parent.parent, collections.Counter()
    for path in root.rglob("*.py"):
        parts = path.relative_to(root).parts
        if parts[0] in ("kfcourse", "exercises", "book", "tests", "benchmarks"):
            folder = parts[1] if len(parts) > 2 else "*.py"
            room = (
                "/".join((parts[0], folder)) if parts[0] in ("kfcourse", "exercises") else parts[0]
            )
            code = tokens(path)
            counts[room] += len(code)
            assert NAMELESS.isdisjoint(t.string for t in code if t.type == tokenize.NAME), path
    assert counts.keys() == ROOMS.keys()
    assert {room: count for room, count in counts.items() if count > ROOMS[room]} == {}
    # a number far above what is there would hold nothing
    assert {room: count for room, count in counts.items() if count < 0.97 * ROOMS[room]} == {}
