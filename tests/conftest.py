"""Fixtures that several test files share."""

import pytest

from kfcourse.lab import report
from kfcourse.symbolic.model import Model


@pytest.fixture(scope="session")
def variant53() -> Model:
    """Variant 53 of the lab, both noises multiplicative."""
    return Model.define("c*x + e*x*v", "g*x + f*x**2*w", {"c": 0.9, "e": 0.05, "g": 1, "f": 0.02})


@pytest.fixture
def no_figures(monkeypatch):
    """Drawing takes most of the time of a report; for tests of its text, and of what becomes of
    files."""
    nothing = dict.fromkeys(report.plots.FIGURES, lambda *_, **__: None)
    monkeypatch.setattr(report.plots, "FIGURES", nothing)
    monkeypatch.setattr(report.Figure, "savefig", lambda _, path, **__: path.touch())
