"""The report of an object in continuous time: the equations that it prints are those that run."""

import json
import re

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_array_equal

from kfcourse import NoClosedForm, compare, gaussian, lab_filters, linearised
from kfcourse.continuous import moment_equations
from kfcourse.lab import LAB, Structures, find_variant, read_variant
from kfcourse.lab.quality import solvable
from kfcourse.lab.report import write_json, write_report
from kfcourse.lab.report_sections import score_cells
from kfcourse.lab.report_text import written_lines
from kfcourse.lab.short_names import judging

pytestmark = pytest.mark.usefixtures("no_figures")

WALK = {
    "drift": ["a*x1 - x1**3 + u", "x1 - x2 + sin(t)"],
    "diffusion": [["s*x1", "0.4"], ["0", "-1"]],
    "meter": "x2**2 + w",
    "parameters": {"a": 0.5, "s": 0.3},
    "inputs": {"u": [1, -1, 1, -1]},
    "stratonovich": True,
    "instants": [0, 0.3, 1.7, 1.9],
    "substeps": 21,
    "accuracy": 1e-5,
    "steps": 3,
}


@pytest.fixture(scope="module")
def compared():
    """CD1 with scores, and a walk in two dimensions at listed instants, in Stratonovich's sense."""
    results, options = {}, {"design_runs": 300}
    for variant, names in (
        (find_variant("CD1"), [*LAB, "aof-exact"]),
        (read_variant("walk", WALK, "here"), ["aof-gaussian", "duof", "fos-linearised"]),
    ):
        filters, model = lab_filters(variant.model, names), variant.model
        result = compare(filters, model, 128, 3, 1, scores=judging(model), **options)
        results[variant.name] = variant, result
    return results


def tex(compared, name, language, folder):
    write_report(*compared[name], folder, language)
    return (folder / "report.tex").read_text(encoding="utf-8")


def value(latex, at):
    """A formula of one letter names, as a report prints it, computed at numbers."""
    text = re.sub(r"\\frac\{([^{}]*)\}\{([^{}]*)\}", r"((\1)/(\2))", latex)
    text = re.sub(
        r"([a-z])_\{(\d)\}", r"\1\2", text.replace(r"\left(", "(").replace(r"\right)", ")")
    )
    text = re.sub(r"\^\{(\d+)\}", r"**\1", text)
    return float(sp.sympify(re.sub(r"(?<=[\w)]) (?=[\w(])", "*", text), at))


@pytest.mark.parametrize("kind", ["linearised", "gaussian"])
def test_the_printed_moment_equations_move_a_normal_law_as_the_filter_does(
    kind, compared, tmp_path
):
    """Their LaTeX, read again, over a short time: what `predict` integrates."""
    text = tex(compared, "CD1", "en", tmp_path)
    part = text.split(rf"\subsection{{{kind.title()}}}")[1].split("Hence, for this model:")[1]
    z, p, dt = 0.7, 0.4, 1e-3
    at = {"a1": -0.5, "a3": -0.01, "z": z, "p": p}
    rates = {
        name: value(re.search(rf"{re.escape(name)}\(z, p\) &= (.*?)( \\\\)?\n", part)[1], at)
        for name in (r"\dot\tau", "A", r"\dot\Theta", r"\dot p")
    }
    assert rates[r"\dot p"] == pytest.approx(2 * rates["A"] * p + rates[r"\dot\Theta"], rel=1e-12)
    model = read_variant("short", {**find_variant("CD1").table, "interval": dt}, "here").model
    structure = {"linearised": linearised, "gaussian": gaussian}[kind](model).at(0)
    tau, Theta = structure.predict(np.array([[z]]), np.array([[[p]]]))
    # the rates change by themselves in unit time: by dt/2 over the step
    assert (tau.item() - z) / dt == pytest.approx(rates[r"\dot\tau"], abs=2 * dt)
    assert (Theta.item() - p) / dt == pytest.approx(rates[r"\dot p"], abs=2 * dt)
    assert abs(rates[r"\dot p"]) > 100 * dt


def test_the_task_is_a_differential_equation_with_its_instants(compared, tmp_path):
    text = tex(compared, "CD1", "en", tmp_path / "en")
    assert r"dx &= \left(a_{1} x + a_{3} x^{3}\right)\,dt + \frac{3}{2}\,dV \\" in text
    assert r"t_{k} &= k" in text and r"v_k &\sim" not in text and "in discrete time" not in text
    assert "Stratonovich" not in text
    text = tex(compared, "walk", "en", tmp_path / "walk")
    # 1/2 sum_j (dB_j/dx) B_j of B = ((s x1, .4), (0, -1)) is s^2 x1 / 2 in the first component
    assert r"\Delta a_1 &= \frac{s^{2} x_{1}}{2}" in text and r"\Delta a_2 &= 0" in text
    assert r"\,dt + s x_{1}\,dV_{1} + \frac{2}{5}\,dV_{2} \\" in text
    assert r"dx_{2} &= \left(\sin {t} + x_{1} - x_{2}\right)\,dt -\,dV_{2}" in text
    assert r"t_0, t_1, \ldots &= 0, 0.3, 1.7, 1.9" in text and "t_{k} &=" not in text
    assert "simulated in 21 steps" in text and r"at most $10^{-5}$ of a standard" in text
    assert r"\dot\tau_{2}(z, p, t) &=" in text and r"\dot\Theta_{11}(z, p) &=" in text


def test_it_is_written_in_russian(compared, tmp_path):
    text = tex(compared, "walk", "ru", tmp_path)
    for words in ("уравнениям моментов", "винеровские процессы", "за 21 шаг.", "Стратоновича"):
        assert words in text
    assert r"\text{for}" not in text and "Between measurements" not in text


def test_what_is_written_out_of_the_filter_is_its_correction(compared):
    lines = written_lines(gaussian(compared["CD1"][0].model))
    assert lines[1] == r"K_{k} &= \frac{\left(\lambda_{k} + 1\right) \Psi_{k}}{F_{k}}"
    assert lines[-2:] == [
        r"\lambda_{k+1} &= \tau(z_{k}, p_{k})",
        r"\Psi_{k+1} &= \Theta(z_{k}, p_{k})",
    ]


def test_formulas_of_a_structure_in_continuous_time():
    model = find_variant("CD2").model
    structure, equations = gaussian(model), moment_equations(model)
    assert structure["tau_dot"] == equations.drift and structure["A"] == equations.A
    assert structure["p_dot"] == equations.rates[1]
    with pytest.raises(NoClosedForm, match="no formula of 'tau'; derived are tau_dot, A"):
        structure["tau"]
    assert solvable(Structures(model)).ok


@pytest.mark.parametrize("language", ["en", "ru"])
def test_scores_stand_in_the_report_with_their_intervals(compared, tmp_path, language):
    result = compared["CD1"][1]
    text = tex(compared, "CD1", language, tmp_path)
    heading = "Predictions of the measurement" if language == "en" else "Оценки прогноза"
    rows = text.split(heading)[1].split(r"\midrule")[1].split(r"\bottomrule")[0].strip().split("\n")
    for name, row in zip(result.names, rows, strict=True):
        cells = row.removesuffix(r" \\").split(" & ")[1:]
        dashed = [
            cell.replace("±", r"$\pm$").replace("–", "--") for cell in score_cells(result, name)
        ]
        assert cells == dashed
    first = result.log_score("aof-gaussian", steps=slice(None))
    expected = f"{first.value:.4f} ± {first.half_width():.4f}"
    assert score_cells(result, "aof-gaussian")[0] == expected


def test_scores_stand_in_the_numbers(compared, tmp_path):
    variant, result = compared["CD1"]
    write_json(variant, result, tmp_path / "n.json")
    numbers = json.loads((tmp_path / "n.json").read_text(encoding="utf-8"))
    assert numbers["model"] == variant.table
    for kind in ("log_score", "crps"):
        for name in result.names:
            estimate = getattr(result, kind)(name)
            printed = np.array(numbers[kind][name], dtype=float)  # null is NaN
            assert_array_equal(printed, estimate.value)
            errors = np.array(numbers[f"{kind}_standard_error"][name], dtype=float)
            assert_array_equal(errors, estimate.standard_error)
    assert None not in numbers["crps"]["aof-exact"]
