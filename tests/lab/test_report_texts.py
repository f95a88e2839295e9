"""The report: what it says is what was computed, in both languages, and its files are whole."""

import dataclasses
import pickle
import re

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.legend import Legend

from kfcourse import Model, compare, gaussian, lab_filters, linearised, load_variants, run, simulate
from kfcourse.filters import aof
from kfcourse.lab import Variant, report_text
from kfcourse.lab.admission import admissions
from kfcourse.lab.report import FIGURES, LANGUAGES, WORDS, write_report
from kfcourse.lab.report_sections import CATALOGUE, StudentReport
from kfcourse.lab.report_text import cause, filled, inline_tex, ranges, scalar_equations
from kfcourse.lab.short_names import LAB, title
from kfcourse.laws import NegativeVariance
from kfcourse.montecarlo.comparison import Verdict
from kfcourse.montecarlo.designing import NotFinite, failed
from kfcourse.montecarlo.statistics import Estimate


@pytest.fixture(scope="module")
def result():
    model = load_variants()["53"].model
    return compare(
        lab_filters(model, [*LAB, "aof-exact"]), model, 200, 4, 1, design_runs=2000, progress=False
    )


@pytest.fixture(scope="module")
def written(result, tmp_path_factory):
    """Text of report.tex and report.html by language."""
    texts = {}
    for language in LANGUAGES:
        folder = tmp_path_factory.mktemp(language)
        paths = write_report(load_variants()["53"], result, folder, language)
        assert all(path.exists() for path in paths)
        texts[language] = {
            name: (folder / name).read_text(encoding="utf-8")
            for name in ("report.tex", "report.html")
        }
    return texts


@pytest.mark.quick
def test_both_languages_have_the_same_words_with_the_same_places():
    russian, english = WORDS["ru"], WORDS["en"]
    assert set(russian) == set(english)
    places = re.compile(r"(?<!\\mathsf)\{(\w+)(?::([^{}]*))?\}")  # {name}, or {name:word/words}
    for key, text in english.items():
        here, there = (sorted(places.findall(one)) for one in (text, russian[key]))
        assert [name for name, _ in here] == [name for name, _ in there], key
        assert all(words.count("/") == (1 if words else 0) for _, words in here), key
        assert all(words.count("/") == (2 if words else 0) for _, words in there), key


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_report_of_variant_53(written, language):
    tex = written[language]["report.tex"]
    for formula in (
        r"{x}_{k+1} &= a(x_k, v_k) = c {x}_{k} + e {x}_{k} {v}_{k}",
        r"{y}_{k} &= b(x_k, w_k) = g {x}_{k} + f {x}_{k}^{2} {w}_{k}",
        r"x_0 &\sim \mathcal{N}(0,\; 1)",
        r"\frac{\partial a}{\partial x} &= c + e v",
        r"\eta(x) &= g^{2} x^{2} + f^{2} x^{4}",
        r"q_4 &= m^{4} + 6 m^{2} d + 3 d^{2}",
        r"F(m, d) &= g^{2} d + f^{2} m^{4} + 6 f^{2} m^{2} d + 3 f^{2} d^{2}",
        r"\lambda_0 &= m_0 = 0,\qquad \Psi_0 = D_0 = 1",
        r"F_{k} &= g^{2} \Psi_{k} + f^{2} \lambda_{k}^{4} + 6 f^{2} \lambda_{k}^{2} \Psi_{k} + 3 "
        r"f^{2} \Psi_{k}^{2}",
        r"F_{k} &= g^{2} \Psi_{k} + f^{2} \lambda_{k}^{4} \\",
        r"K_{k} &= \frac{g \Psi_{k}}{F_{k}}",
        r"z_{k} &= \lambda_{k} + K_{k} \left(y_{k} - g \lambda_{k}\right)",
        r"\Psi_{k+1} &= c^{2} p_{k} + e^{2} z_{k}^{2} + e^{2} p_{k}",
        {"ru": "Отчёт по лабораторной работе", "en": "Report on the laboratory work"}[language],
        {
            "ru": "200 траекторий по 4 измерения, начальное",
            "en": "200 trajectories of 4 measurements, seed",
        }[language],
        "I_k &=",
        "J_k &=",
        r"\Theta$ --- 22",
    ):
        assert formula in tex, formula
    assert (r"\usepackage[english,russian]{babel}" in tex) == (language == "ru")
    assert tex.count(r"\begin{") == tex.count(r"\end{")
    assert not re.search(r"(?<!\\)%", tex), "an unescaped per cent sign hides the rest of its line"
    page = written[language]["report.html"]
    assert (
        f'<html lang="{language}">' in page
        and "$" not in page
        and "http://" not in page.replace("http://www.w3.org/1998/Math/MathML", "")
    )


def test_numbers_and_verdicts_are_those_of_the_comparison(written, result):
    tex = written["en"]["report.tex"]
    value = result.error_variance("duof")[2]
    power = int(np.floor(np.log10(value.value)))
    assert (
        rf"$({value.value / 10.0**power:.3f} \pm {value.standard_error / 10.0**power:.3f})\cdot "
        rf"10^{{{power}}}$" in tex
    )
    for k in range(result.steps):
        best, others, worst = result.verdicts()[k]
        last = title(worst) if worst else "--"
        assert (
            rf"${k}$ & {title(best)} & {', '.join(map(title, others)) or '--'} & {last} \\" in tex
        )


class Told:
    """A comparison of which only the order of the filters is told: at each step those that lead,
    and the last."""

    has_bound, control, steps, seed, lost = True, "aof-gaussian", 51, 1, {}
    entrants = ("aof-gaussian", "duof", "fos-gaussian")

    def __init__(self):
        self.model, self.names = load_variants()["53"].model, self.entrants

    def ranking(self):
        return [(name, Estimate(np.array(0.1), np.array(0.01), 9)) for name in self.entrants]


def sentences(leaders, last, language):
    """Of verdicts: who leads at step k, and who is last if it is none of those."""
    verdicts = [
        Verdict(best, others, "" if last(k) in (best, *others) else last(k))
        for k in range(51)
        for best, *others in [leaders(k)]
    ]
    return list(StudentReport(Told(), WORDS[language]).sentences(verdicts))


@pytest.mark.quick
def test_the_conclusion_counts_in_good_language():
    """One step or several, of 51; and who is not significantly worse than the best is not called
    the last at that step."""

    def leaders(k):
        return (
            ["aof-gaussian"]
            if k == 2
            else ["aof-gaussian", "duof"]
            if k in (0, 30, 31)
            else ["aof-gaussian", "fos-gaussian"]
        )

    russian, english = (sentences(leaders, lambda k: "duof", language) for language in ("ru", "en"))
    assert russian[:3] == [
        "ГАОФ значимо точнее каждого из остальных фильтров на шаге $2$.",
        "Хотя бы один из остальных фильтров незначимо хуже самого точного на шагах $0$–$1$, "
        "$3$–$50$.",
        "ДУОФ — наименее точный фильтр на 48 шагах из 51.",
    ]
    assert english[0] == "GAOF is significantly more accurate than every other filter at step $2$."
    assert english[2] == "DUOF is the least accurate filter at 48 steps of 51."
    nobody, once = sentences(lambda k: ["duof", "fos-gaussian"], lambda k: "aof-gaussian", "ru")[:2]
    never = sentences(lambda k: ["duof", "aof-gaussian"], lambda k: "aof-gaussian", "ru")[1]
    # and that is all of it
    assert (
        nobody
        == "Ни на одном шаге нет фильтра, который был бы значимо точнее каждого из остальных."
    )
    assert once == "ГАОФ — наименее точный фильтр на 51 шаге из 51."
    assert never == "Ни на одном шаге наименее точный фильтр не хуже самого точного значимо."


@pytest.mark.parametrize("language", ["en", "ru"])
def test_a_filter_that_equals_the_control_but_for_rounding_is_not_told_a_difference(language):
    """IMM beside the logic-dynamic AOF of an object that is affine in every mode: they differ by
    1e-16."""
    told = Told()
    told.has_bound, found = False, {"fos-gaussian": -3e-16, "aof-gaussian": 0.0, "duof": 0.3}
    told.ranking = lambda: [
        (name, Estimate(np.array(value), np.array(0.01), 9)) for name, value in found.items()
    ]
    report = StudentReport(told, WORDS[language])
    *_, last = report.sentences([Verdict("aof-gaussian", [], "duof")] * 51)
    assert last == report.mean_sentence("mean_first")
    assert report.title("aof-gaussian") in last and "e-" not in last
    found["fos-gaussian"] = -3e-3
    *_, last = report.sentences([Verdict("aof-gaussian", [], "duof")] * 51)
    assert last == report.mean_sentence("mean_control") and report.title("fos-gaussian") in last


@pytest.mark.parametrize("language", ["en", "ru"])
def test_a_filter_that_diverges_is_no_last_with_a_number(language):
    told = Told()
    told.lost = {"fos-gaussian": np.ones(51, dtype=bool)}
    sentence = StudentReport(told, WORDS[language]).mean_sentence("mean_bound")
    assert (
        told.entrants[1] == "duof"
        and StudentReport(told, WORDS[language]).title("duof") in sentence
    )
    assert StudentReport(told, WORDS[language]).title("fos-gaussian") not in sentence
    told.lost |= {"duof": np.ones(51, dtype=bool)}
    assert (
        StudentReport(told, WORDS[language])
        .mean_sentence("mean_bound")
        .endswith(StudentReport(told, WORDS[language]).title("aof-gaussian") + ".")
    )


@pytest.mark.quick
@pytest.mark.parametrize(
    ("number", "russian", "english"),
    [
        (1, "1 шаг", "1 step"),
        (2, "2 шага", "2 steps"),
        (5, "5 шагов", "5 steps"),
        (11, "11 шагов", "11 steps"),
        (21, "21 шаг", "21 steps"),
        (112, "112 шагов", "112 steps"),
        (9999, "9999 шагов", "9999 steps"),
        (100_003, "100\u202f003 шага", "100,003 steps"),
    ],
)
def test_a_number_and_its_word(number, russian, english):
    assert filled("{n:шаг/шага/шагов}", "\u202f", n=number) == russian
    assert filled("{n:step/steps}", ",", n=number) == english
    assert inline_tex(russian) == russian.replace("\u202f", r"\,")
    assert (
        filled(r"\mathsf{M} {n} {name}", "\u202f", n=number, name="a")
        == rf"\mathsf{{M}} {russian.split(' ')[0]} a"
    )


@pytest.mark.parametrize("kind", [gaussian, linearised])
@pytest.mark.parametrize("name", ["53", "2", "5", "9", "10"])
def test_what_is_written_out_is_the_filter_that_runs(name, kind):
    """The printed formulas, evaluated one after the other, against the compiled filter:
    polynomials, a sine, exponentials."""
    model = load_variants()[name].model
    structure = kind(model)
    _, y = simulate(model, 1, 6, seed=3)
    expected = run(aof(structure), y)
    values = {"\\lambda_{k+1}": model.prior.mean.item(), "\\Psi_{k+1}": model.prior.cov.item()}
    for k, measured in enumerate(y[:, 0, 0]):
        now = {
            r"\lambda_{k}": values["\\lambda_{k+1}"],
            r"\Psi_{k}": values["\\Psi_{k+1}"],
            "y_{k}": float(measured),
        }
        for one, formula in scalar_equations(structure):
            numbers = {
                s: now[s.name] if s.name in now else model.values[s] for s in formula.free_symbols
            }
            now[one.name] = values[one.name] = float(formula.subs(numbers))
        # rounding of some dozens of operations, in another order
        assert now["z_{k}"] == pytest.approx(expected.mean[k].item(), rel=1e-9, abs=1e-12)
        assert now["p_{k}"] == pytest.approx(expected.cov[k].item(), rel=1e-9)


@pytest.mark.quick
def test_only_scalar_models_are_written_out():
    with pytest.raises(ValueError, match="only scalar models"):
        scalar_equations(gaussian(load_variants()["20"].model))


def test_a_vector_variant_has_no_scalar_derivation(tmp_path):
    model = load_variants()["20"].model
    found = compare(lab_filters(model, ["aof-gaussian", "duof"]), model, 500, 3, 1, progress=False)
    write_report(load_variants()["20"], found, tmp_path, "ru")
    tex = (tmp_path / "report.tex").read_text(encoding="utf-8")
    assert "В среднем по шагам" in tex
    assert r"После знака $\pm$ указана стандартная ошибка." in tex
    assert r"\Psi_0 = D_0 = \begin{pmatrix}0.1 & 0 \\ 0 & 0.1\end{pmatrix}" in tex
    assert "pmatrix" in tex and "q_2" not in tex and r"&\quad" in tex


@pytest.mark.parametrize("language", LANGUAGES)
def test_figures_speak_the_language_of_the_report(result, language, monkeypatch, tmp_path):
    """Every label, title and legend that is drawn; Cyrillic letters in the Russian report only, and
    no English words there."""
    said, draw = [], Figure.savefig

    def listen(figure, *arguments, **options):
        for ax in figure.axes:
            rows = (
                [text.get_text() for text in ax.get_yticklabels()]
                if "ranking" in str(arguments[0])
                else []
            )
            said.extend([ax.get_xlabel(), ax.get_ylabel(), *rows])
        said.extend(
            text.get_text() for legend in figure.findobj(Legend) for text in legend.get_texts()
        )
        draw(figure, *arguments, **options)

    monkeypatch.setattr(Figure, "savefig", listen)
    paths = write_report(load_variants()["53"], result, tmp_path, language)
    plain = " ".join(re.sub(r"\$[^$]*\$", "", text) for text in said)
    assert {path.stem for path in paths} == {"report", *FIGURES}
    assert ("точный АОФ" in said and "ЛМФОС" in said) == (language == "ru")
    assert ("exact AOF" in said and "LMFOS" in said) == (language == "en")
    assert bool(re.search("[а-яА-Я]", plain)) == (language == "ru")
    assert bool(re.search("[a-zA-Z]", plain)) == (language == "en")


LEFT_OUT = {
    "growth": (
        "x/2 + 25*x/(1 + x**2) + 8*cos(1.2*k) + v",
        "x**2/20 + w",
        "aof-gaussian",
        r"$\frac{1}{x^{2} + 1}$",
        "слагаемого",
    ),
    "kink": (
        "0.9*x + v",
        "sign(x) + w",
        "aof-linearised",
        "differentiable",
        "линеаризовать их нельзя",
    ),
    "nonlinear": (
        "0.9*x + v",
        "sin(x + w) + w**2",
        "aof-exact",
        "no simple density",
        "нет простой плотности",
    ),
    "no noise": ("0.9*x + v", "x + x**3", "particle", "no simple density", "нет простой плотности"),
    "choice": ("(1 if x < 0 else 2) + v", "x + w", "aof-gaussian", r"\text{for}", r"\text{при}"),
}


@pytest.mark.parametrize("case", LEFT_OUT)
def test_the_cause_of_a_refusal_is_said_in_the_report_s_words(case):
    """The package's real messages; one without its kind would be quoted."""
    state, meter, name, english, russian = LEFT_OUT[case]
    model = Model.define(state, meter)
    (refused,) = admissions(model, [name])
    assert refused.built is None
    if case != "choice":  # its words are those of SymPy, translated in the whole report
        assert english in cause(refused.reason, model, WORDS["en"]) and russian in cause(
            refused.reason, model, WORDS["ru"]
        )
    assert cause(refused.reason, model, WORDS["ru"]) != WORDS["ru"]["left_other"].format(
        reason=refused.reason
    )


def test_a_filter_that_diverges_and_other_reasons():
    model = load_variants()["53"].model
    with pytest.raises(NotFinite) as caught:
        cubic = Model.define("2*x + x**3 + v", "x + w")
        compare(lab_filters(cubic, ["aof-linearised"]), cubic, 50, 40, 1, progress=False)
    # not the filter's fault: quoted
    assert "trajectories" in cause(str(caught.value), model, WORDS["ru"])
    negative = failed(
        "mfos-gaussian", 28, NegativeVariance("a covariance has the variance -165479")
    )
    assert "на шаге 28" in cause(negative, model, WORDS["ru"]) and "at step 28" in cause(
        negative, model, WORDS["en"]
    )
    # of a worker
    assert cause(pickle.loads(pickle.dumps(negative)), model, WORDS["ru"]) == cause(
        negative, model, WORDS["ru"]
    )
    (long,) = admissions(
        Model.define("0.9*x + v", "(1 + x)**14 + w"), ["aof-gaussian"], seconds=0.01
    )
    assert "0.01 с" in cause(long.reason, model, WORDS["ru"])
    assert cause("50 % of $ & _", model, WORDS["en"]) == "50 % of $ & _"


def test_one_filter_left(tmp_path):
    """The others are refused: named with their causes, together where they share it; nothing is
    compared, nothing fails."""
    model = Model.define("0.9*x + v", "x + (1 if x > 0 else 0) + sin(w)")
    found = admissions(model, LAB)
    reasons = {one.name: one.reason for one in found if one.built is None}
    result = compare([one.built for one in found if one.built], model, 200, 3, 1, progress=False)
    result = dataclasses.replace(result, left_out=reasons)
    paths = write_report(Variant("one_left", "", model), result, tmp_path, "ru")
    tex = (tmp_path / "report.tex").read_text(encoding="utf-8")
    assert (
        r"\item ЛАОФ, ЛФОС, ЛМФОС: уравнения не дифференцируемы" in tex
        and r"\text{при}" in tex
        and r"\text{for}" not in tex
    )
    assert r"one\_left" in tex and "участвует один фильтр, ДУОФ" in tex
    assert {path.stem for path in paths} == {"report", "accuracy", "consistency"}


def test_formulas_that_are_too_long_are_not_printed(result, monkeypatch, tmp_path):
    monkeypatch.setattr(report_text, "LONGEST", 10)
    write_report(load_variants()["53"], result, tmp_path, "ru")
    tex = (tmp_path / "report.tex").read_text(encoding="utf-8")
    assert (
        tex.count("Формулы слишком громоздки") == 2
        and "уравнения для данной модели" not in tex
        and "too long" not in tex
        and "каталоге" not in tex
    )


@pytest.mark.quick
def test_special_characters_are_escaped_outside_of_formulas():
    assert inline_tex("a_b & 5 % – $x_k^2$ #") == r"a\_b \& 5 \% -- $x_k^2$ \#"


@pytest.mark.quick
def test_catalogue_numbers_are_the_courses():
    assert sorted(CATALOGUE.values()) == [2, 5, 8, 15, 16, 20, 22]


@pytest.mark.quick
def test_runs_of_steps_are_joined():
    assert ranges([1, 3, 4, 5, 8], "${}$") == "$1$, $3$–$5$, $8$"
    assert ranges([2]) == "2"
