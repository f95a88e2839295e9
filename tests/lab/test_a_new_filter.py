"""CONTRIBUTING's "Add a filter in five steps", followed to the letter with a fading-memory filter.

After steps 1 and 2 all that reads the filters knows the new one: command, tables, figures, and
reports in both languages.
"""

import dataclasses

import pytest
import sympy as sp

from kfcourse import Gaussian, filters
from kfcourse.filters import Filter, State, aof
from kfcourse.filters import notation as s
from kfcourse.lab import families, plots, short_names

FACTOR = sp.Symbol("varphi", positive=True)
EQUATIONS = (*filters.EQUATIONS["aof"][:-1], sp.Eq(s.Psi_next, FACTOR * s.Theta_zp))  # step 1


def fading(structure, factor=1.05) -> Filter:
    """The AOF that forgets: Psi' = phi Theta(z, p)."""
    plain = aof(structure)

    def step(state, y):
        after = plain.step(state, y)
        return State(
            after.step,
            after.posterior,
            Gaussian(after.predicted.mean, factor * after.predicted.cov),
        )

    return dataclasses.replace(plain, name=f"fading-{structure.name}", step=step)


@pytest.fixture
def recipe(monkeypatch):
    """Step 2: a record of the family, and its lines in `FILTERS`."""
    monkeypatch.setitem(filters.EQUATIONS, "fading", EQUATIONS)
    record = families.Family(
        "Fading", "ФЗП", "Fading memory", "Фильтр с затухающей памятью", "#123456", "d"
    )
    monkeypatch.setitem(families.FAMILIES, "fading", record)
    for name, entry in short_names._twice("fading", fading).items():
        monkeypatch.setitem(short_names.FILTERS, name, entry)


def test_a_filter_added_by_the_recipe_is_known_everywhere(recipe, no_figures, command, tmp_path):
    names = "aof-gaussian,fading-gaussian,fading-linearised"
    size = "--runs 1000 --steps 4 --report ru --out ."
    done = command("lab 53 --filters", names, size)
    assert done.exit_code == 0, done.output
    assert "GFading" in done.output
    text = (tmp_path / "report.html").read_text("utf-8")
    assert "ГФЗП" in text and "Фильтр с затухающей памятью" in text


def test_its_look_is_that_of_its_family(recipe):
    assert plots.style("fading-linearised")["color"] == "#123456"
    assert plots.style("fading-linearised")["marker"] == "d"


@pytest.mark.parametrize(
    "name",
    [name for name in short_names.FILTERS if short_names.entry(name).family in filters.EQUATIONS],
)
def test_every_family_with_equations_has_its_headings(name):
    family = families.FAMILIES[short_names.entry(name).family]
    assert family.heading
    assert family.russian_heading
