"""Fixtures that several test files share."""

import shlex
from itertools import chain

import pytest
from click.testing import CliRunner

from kfcourse import Model, cli
from kfcourse.lab import report


@pytest.fixture(scope="session")
def variant53() -> Model:
    """Variant 53 of the lab, both noises multiplicative."""
    return Model.define("c*x + e*x*v", "g*x + f*x**2*w", {"c": 0.9, "e": 0.05, "g": 1, "f": 0.02})


@pytest.fixture
def command(tmp_path, monkeypatch):
    """Run a command in an empty folder, as typed there; its result."""
    monkeypatch.chdir(tmp_path)

    def invoke(*words):
        split = (shlex.split(word) if isinstance(word, str) else [str(word)] for word in words)
        return CliRunner().invoke(cli.main, [*chain(*split)])

    return invoke


@pytest.fixture
def no_figures(monkeypatch):
    """Drawing takes most of the time of a report; for tests of its text, and of what becomes of
    files."""
    nothing = dict.fromkeys(report.plots.FIGURES, lambda *_, **__: None)
    monkeypatch.setattr(report.plots, "FIGURES", nothing)
    monkeypatch.setattr(report.Figure, "savefig", lambda _, path, **__: path.touch())
