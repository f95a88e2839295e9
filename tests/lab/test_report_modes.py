"""The student's report of a model with modes, in both languages; its equations are those that
run."""

import re

import numpy as np
import oracles
import pytest
import sympy as sp
from numpy.testing import assert_allclose

from kfcourse import JumpModel, compare, gaussian, linearised, simulate
from kfcourse.filters import jump_equations, latex, logic_dynamic
from kfcourse.filters import notation as s
from kfcourse.filters.jump_equations import number, square, vector
from kfcourse.lab import Variant, find_variant
from kfcourse.lab.admission import admissions
from kfcourse.lab.report import LANGUAGES, recognised_modes, write_report
from kfcourse.laws import Measurement, log_density

MODEL = JumpModel.define(
    ["x1 + 0.3*x2 + 0.2*v1", "x2 - 0.2*sin(x1) + s*v2"],
    ["x1 + f*w1", "x1*x2 + f*w2"],
    {"s": 0.3, "f": 0.5},
    modes={"sound": {}, "thrown": {"parameters": {"f": 2.0, "s": 1.0}}},
    transition=[[0.9, 0.1], [0.4, 0.6]],
    first=[0.7, 0.3],
    prior={"mean": [1.0, -0.5], "variance": [[1.0, 0.2], [0.2, 0.5]]},
)


def carry_out(equations, values):
    """Each equation, from the values so far."""
    for equation in equations:
        symbols = sorted(equation.rhs.free_symbols - {s.n, s.p}, key=str)
        rows = [np.asarray(values[symbol])[None] for symbol in symbols]
        (values[equation.lhs],) = oracles.executed(equation.rhs, symbols, rows)


def test_the_printed_equations_are_the_logic_dynamic_filter():
    """Executed one after the other for two modes and three steps, with structural functions,
    densities and pi put in."""
    structures, y = [gaussian(mode) for mode in MODEL.modes], simulate(MODEL, 1, 3, seed=5).y
    filter_ = logic_dynamic(structures, MODEL, MODEL.first)
    state, values = filter_.init(1), {}
    for j in (1, 2):
        values[vector(r"\lambda", j)], values[square(r"\Psi", j)] = (
            MODEL.prior.mean[:, None],
            MODEL.prior.cov,
        )
        values[number("c", j)] = MODEL.first[j - 1]
        values |= {
            sp.Symbol(rf"\pi^{{{i}{j}}}"): MODEL.transition_at(0)[i - 1, j - 1] for i in (1, 2)
        }
    for k in range(3):
        values[s.y] = y[k, 0][:, None]
        for j, structure in enumerate(structures, 1):
            lam, Psi = vector(r"\lambda", j), square(r"\Psi", j)
            values_ = structure.measure(values[lam][:, 0], values[Psi])
            for name, value in (("h", values_.h[:, None]), ("G", values_.G), ("F", values_.F)):
                rows, columns = (s.p, {"h": s.ONE, "G": s.n, "F": s.p}[name])
                values[s.matrix(rf"{name}^{{{j}}}({lam.name}, {Psi.name})", rows, columns)] = value
            as_ensemble = Measurement(*(part[None] for part in values_))
            values[jump_equations.likelihood(j)] = float(np.exp(log_density(as_ensemble, y[k])[0]))
        for j in (1, 2):
            carry_out(jump_equations.correction(j, 2), values)
        carry_out(
            [*jump_equations.combination(1, 2)[:2], *jump_equations.combination(2, 2)[1:]], values
        )
        state = filter_.step(state, y[k])
        assert_allclose(values[s.z][:, 0], state.posterior.mean[0], rtol=1e-10)
        assert_allclose(values[s.P], state.posterior.cov[0], rtol=1e-9, atol=1e-12)
        for j, structure in enumerate(structures, 1):
            for i in (1, 2):
                tau, Theta = jump_equations.ahead(j, i)
                law = structure.predict(values[vector("z", i)][:, 0], values[square("p", i)])
                values[tau], values[Theta] = law.mean[:, None], law.cov
            carry_out(jump_equations.prediction(j, 2), values)
        for j in (1, 2):  # what was to come is there
            for make, name in ((vector, r"\lambda"), (square, r"\Psi"), (number, "c")):
                values[make(name, j)] = values[make(name, j, "k+1")]


@pytest.fixture(scope="module")
def compared():
    names = ["aof-jump-gaussian", "imm", "gpb2", "fos-jump-gaussian", "fkp4-jump-gaussian"]
    names += ["aof-averaged", "aof-exact"]
    model = find_variant("J1-lasting").model
    filters = [each.built for each in admissions(model, names)]
    result = compare(filters, model, 128, 3, 1, jobs=1)
    return result, recognised_modes(result, filters)


@pytest.fixture(scope="module", params=LANGUAGES)
def written(request, compared, tmp_path_factory):
    """Language, texts, and names of all files."""
    folder, (result, modes) = tmp_path_factory.mktemp(request.param), compared
    variant = find_variant("J1-lasting")
    paths = write_report(variant, result, folder, request.param, modes=modes)
    texts = [(folder / name).read_text(encoding="utf-8") for name in ("report.tex", "report.html")]
    return request.param, *texts, {path.name for path in paths}


def test_it_tells_the_modes_their_chain_and_the_filters_of_the_variant(written):
    language, tex, page, names = written
    assert {"modes.svg", "modes.pdf", "accuracy.svg"} <= names
    assert "$2$ & faulty & $10$" in tex and "<td>sound</td>" in page
    assert (
        r"\pi &= " in tex
        and "repair" in tex
        and r"q &= \begin{pmatrix}0.8 & 0.2\end{pmatrix}" in tex
    )
    for block in (
        jump_equations.correction("j", 2),
        jump_equations.combination("j", 2),
        jump_equations.prediction("j", 2),
    ):
        for line in latex(block).split("\n")[1:-1]:
            assert line.removesuffix(r" \\").strip() in tex
    expected = {
        "en": ["The modes", "LD-GAOF", "naming the likeliest mode without measuring", "exact AOF"],
        "ru": ["Режимы", "ГАОФлд", "наиболее вероятный режим без измерений", "точный АОФ"],
    }[language]
    assert all(text in of for text in expected for of in (tex, page))
    assert not re.search(r"\{(name|names|values|modes|filters|memory)[:}]", tex)
    assert all(rf"$\zeta_k = {each}$" in tex for each in ("z_k", r"(y_{k};\,\dots;\,y_{k-\ell+1})"))
    assert tex.count(r"\zeta_k + \chi^i") == 2
    assert ("<math" in page) and "<script" not in page


def test_modes_with_other_equations_are_told_one_by_one(no_figures, tmp_path):
    model = JumpModel.define(
        "0.9*x + v",
        "x + w",
        modes={"calm": {}, "curved": {"meter": "x + 0.1*x**2 + w"}},
        transition=[0.8, 0.2],
    )
    both = [
        logic_dynamic([kind(mode) for mode in model.modes], model, model.first)
        for kind in (gaussian, linearised)
    ]
    result = compare(both, model, 400, 3, 1, jobs=1)
    write_report(Variant("own", "", model), result, tmp_path, "en")
    tex = (tmp_path / "report.tex").read_text(encoding="utf-8")
    # the task, and two kinds of structural functions
    assert tex.count("In mode $j=2$ (curved):") == 3
    assert "In every mode" not in tex
