"""A book of which nothing has changed is not built again, any other is."""

import build
import pytest


class Begun(Exception):
    """The build has begun."""


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """Sources of a small book that has been built."""
    for name in (
        "_config.yml",
        "requirements.txt",
        "book/a.md",
        "exercises/b/keys.py",
        "kfcourse/c.py",
        "_build/html/index.html",
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name, encoding="utf-8")
    monkeypatch.setattr(build, "ROOT", tmp_path)
    monkeypatch.setattr(build, "PAGE", tmp_path / "_build/html/index.html")
    monkeypatch.setattr(build, "BUILT", tmp_path / "_build/.built-from")

    def begins():
        raise Begun

    monkeypatch.setattr(build, "prepare", begins)
    build.BUILT.write_text(build.sources())
    return tmp_path


def test_a_book_of_which_nothing_has_changed_stays(tree, capsys):
    for made in (
        "book/manual/a-set.md",
        "book/package/folder.md",
        "book/reference/equations.md",
        "kfcourse/__pycache__/c.pyc",
        "tests/d.py",
    ):
        (tree / made).parent.mkdir(parents=True, exist_ok=True)
        (tree / made).write_text("made", encoding="utf-8")
    assert build.main() == 0
    assert "Nothing has changed" in capsys.readouterr().out


@pytest.mark.parametrize(
    "name",
    [
        "_config.yml",
        "requirements.txt",
        "book/a.md",
        "book/new.md",
        "exercises/b/keys.py",
        "kfcourse/c.py",
    ],
)
def test_another_one_is_built_anew_and_counts_as_built_at_its_end_only(tree, name):
    (tree / name).write_text("changed", encoding="utf-8")
    for _ in range(2):  # the first time it is interrupted
        with pytest.raises(Begun):
            build.main()


@pytest.mark.parametrize("gone", ["_build/html/index.html", "_build/.built-from", "book/a.md"])
def test_so_is_one_of_which_something_is_gone(tree, gone):
    (tree / gone).unlink()
    with pytest.raises(Begun):
        build.main()
