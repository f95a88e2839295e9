"""The lab's report, in both languages: what it says is what was computed, its formulas are those of
the model, its files are whole."""

import dataclasses
import json
import re
from html.parser import HTMLParser
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

from kfcourse import (
    Model,
    NotFinite,
    compare,
    gaussian,
    lab_filters,
    linearised,
    load_variants,
    run,
    simulate,
)
from kfcourse.filters import aof
from kfcourse.lab import LAB, Variant, report_text, title
from kfcourse.lab.admission import admissions
from kfcourse.lab.plots import FIGURES
from kfcourse.lab.report import (
    LANGUAGES,
    WORDS,
    conclusions,
    remarks_in_words,
    write_json,
    write_report,
)
from kfcourse.lab.report_sections import StudentReport
from kfcourse.lab.report_text import cause, filled, inline_tex, scalar_equations
from kfcourse.laws import NegativeVariance
from kfcourse.montecarlo.comparison import Verdict
from kfcourse.montecarlo.designing import failed
from kfcourse.montecarlo.statistics import Estimate

VARIANTS = load_variants()


def compared(model, names=LAB, runs=300, steps=4, **options):
    return compare(lab_filters(model, names), model, runs, steps, 1, **options)


def page_of(folder, name="report.html"):
    return (folder / name).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def results():
    return {
        "53": compared(VARIANTS["53"].model, [*LAB, "aof-exact"], design_runs=4000),
        "20": compared(VARIANTS["20"].model, runs=1000),
    }


@pytest.fixture(scope="module")
def written(results, tmp_path_factory):
    """Folders of the reports of variants 53 and 20, in both languages."""
    folders = {}
    for name, language in ALL:
        folders[name, language] = tmp_path_factory.mktemp("reports") / "below" / language
        known = admissions(VARIANTS[name].model)
        write_report(VARIANTS[name], results[name], folders[name, language], language, known)
    return folders


ALL = [(name, language) for name in ("53", "20") for language in LANGUAGES]

# --- sentences


def test_a_difference_is_significant_if_its_interval_excludes_zero(results):
    result53 = results["53"]
    ranked = [name for name, _ in result53.ranking()]
    sentences = conclusions(result53)
    assert len(sentences) == len(ranked) - 1
    for sentence, better, worse in zip(sentences, ranked, ranked[1:], strict=False):
        low, high = result53.mean_gap_difference(worse, better).interval()
        verdict = "is more accurate than" if low > 0 else "is not significantly different from"
        assert sentence.startswith(f"{title(better)} {verdict} {title(worse)}: ")
        printed = [
            float(number) for number in re.findall(r"confidence: (\S+) to (\S+) %", sentence)[0]
        ]
        assert_allclose(printed, [100 * low, 100 * high], rtol=0.005)  # three digits
        assert "95 % confidence" in sentence


@pytest.mark.parametrize(
    ("meter", "names", "limits"),
    [
        ("x**2 + 0.001*w", ["duof", "fos-linearised"], r"\d{4,}"),
        ("x + 3e-6*x**2 + 0.1*w", ["aof-gaussian", "aof-linearised"], r"-?0\.000\d{2,}"),
    ],
)
def test_neither_a_large_difference_nor_a_tiny_one_has_a_power_of_ten(meter, names, limits):
    """The tangent of x^2 at 0 tells the linearised FOS nothing at first: it stays hundreds of times
    less accurate."""
    (sentence,) = conclusions(compared(Model.define("0.9*x + 1e-3*v", meter), names, 500, 12))
    (low, high) = re.findall(rf"confidence: ({limits}) to ({limits}) %", sentence)[0]
    assert float(low) < float(high)


def test_rounding_is_not_a_difference():
    # On a linear model the Gaussian and the linearised form of each filter are the same: no verdict
    # may tell them apart.
    result = compared(VARIANTS["1"].model, runs=3000, steps=20)
    alike = [
        {"GAOF", "LAOF"},
        {"GFOS", "LFOS"},
        {"GMFOS", "LMFOS"},
        {"DUOF", "GMFOS"},
        {"DUOF", "LMFOS"},
    ]
    result_ = [
        set(re.findall(r"\w+", s)[:3:2])
        for s in conclusions(result)
        if s.endswith("are the same but for rounding.")
    ]
    ranked = [title(name) for name, _ in result.ranking()]
    assert result_ == [pair for pair in map(set, pairwise(ranked)) if pair in alike]


class Told:
    """A comparison of which only the order of the filters is told: at each step those that lead,
    and the last."""

    has_bound, control, steps, seed, lost = True, "aof-gaussian", 51, 1, {}
    entrants = ("aof-gaussian", "duof", "fos-gaussian")

    def __init__(self):
        self.model, self.names = VARIANTS["53"].model, self.entrants

    def ranking(self):
        return [(name, Estimate(np.array(0.1), np.array(0.01), 9)) for name in self.entrants]


def report(language, **changes):
    student = Told()
    vars(student).update(changes)
    return StudentReport(student, WORDS[language])


def sentences(leaders, last, language):
    """Of verdicts: who leads at step k, and who is last if it is none of those."""
    verdicts = [
        Verdict(best, others, "" if last(k) in (best, *others) else last(k))
        for k in range(51)
        for best, *others in [leaders(k)]
    ]
    return list(report(language).sentences(verdicts))


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


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(("apart", "key"), [(-3e-16, "mean_first"), (-3e-3, "mean_control")])
def test_a_filter_that_equals_the_control_but_for_rounding_is_not_told_a_difference(
    language, apart, key
):
    """IMM beside the logic-dynamic AOF of an object that is affine in every mode: they differ by
    1e-16."""
    gaps = {"fos-gaussian": apart, "aof-gaussian": 0.0, "duof": 0.3}
    ranked = [(name, Estimate(np.array(value), np.array(0.01), 9)) for name, value in gaps.items()]
    student = report(language, has_bound=False, ranking=lambda: ranked)
    *_, last = student.sentences([Verdict("aof-gaussian", [], "duof")] * 51)
    assert last == student.mean_sentence(key) and "e-" not in last
    assert student.title("aof-gaussian" if key == "mean_first" else "fos-gaussian") in last


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_filter_that_diverges_is_no_last_with_a_number(language):
    lost = {"fos-gaussian": np.ones(51, dtype=bool)}
    student = report(language, lost=lost)
    sentence = student.mean_sentence("mean_bound")
    assert student.title("duof") in sentence and student.title("fos-gaussian") not in sentence
    alone = report(language, lost=lost | {"duof": lost["fos-gaussian"]})
    assert alone.mean_sentence("mean_bound").endswith(alone.title("aof-gaussian") + ".")


@pytest.mark.parametrize(
    ("number", "russian", "english"),
    [
        (2, "2 шага", "2 steps"),
        (5, "5 шагов", "5 steps"),
        (11, "11 шагов", "11 steps"),
        (21, "21 шаг", "21 steps"),
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


def test_both_languages_have_the_same_words_with_the_same_places():
    russian, english = WORDS["ru"], WORDS["en"]
    assert set(russian) == set(english)
    places = re.compile(r"(?<!\\mathsf)\{(\w+)(?::([^{}]*))?\}")  # {name}, or {name:word/words}
    for key, text in english.items():
        here, there = (sorted(places.findall(each)) for each in (text, russian[key]))
        assert [name for name, _ in here] == [name for name, _ in there], key
        assert all(words.count("/") == (1 if words else 0) for _, words in here), key
        assert all(words.count("/") == (2 if words else 0) for _, words in there), key


# --- what the report says


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_report_of_variant_53(written, language):
    tex = page_of(written["53", language], "report.tex")
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
            "ru": "300 траекторий по 4 измерения, начальное",
            "en": "300 trajectories of 4 measurements, seed",
        }[language],
        "I_k &=",
        "J_k &=",
        r"\Theta$ --- 22",
    ):
        assert formula in tex, formula
    assert (r"\usepackage[english,russian]{babel}" in tex) == (language == "ru")
    assert tex.count(r"\begin{tabular}{lllll}") == 2  # the steps, and four of the eight filters
    assert tex.count(r"\begin{") == tex.count(r"\end{")
    assert not re.search(r"(?<!\\)%", tex), "an unescaped per cent sign hides the rest of its line"
    page = page_of(written["53", language])
    assert (
        f'<html lang="{language}">' in page
        and "$" not in page
        and "http://" not in page.replace("http://www.w3.org/1998/Math/MathML", "")
    )


def test_numbers_and_verdicts_are_those_of_the_comparison(written, results):
    tex = page_of(written["53", "en"], "report.tex")
    result = results["53"]
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


@pytest.mark.parametrize("kind", [gaussian, linearised])
@pytest.mark.parametrize("name", ["53", "5", "10"])
def test_what_is_written_out_is_the_filter_that_runs(name, kind):
    """The printed formulas, evaluated one after the other, against the compiled filter:
    polynomials, a sine, exponentials."""
    model = VARIANTS[name].model
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
        for each, formula in scalar_equations(structure):
            numbers = {
                s: now[s.name] if s.name in now else model.values[s] for s in formula.free_symbols
            }
            now[each.name] = values[each.name] = float(formula.subs(numbers))
        # rounding of some dozens of operations, in another order
        assert now["z_{k}"] == pytest.approx(expected.mean[k].item(), rel=1e-9, abs=1e-12)
        assert now["p_{k}"] == pytest.approx(expected.cov[k].item(), rel=1e-9)


def test_short_functions_have_no_lines_of_their_own():
    """Of variant 3 h and G have 10 to 20 symbols, and are put into K and z."""
    names = [symbol.name for symbol, _ in scalar_equations(gaussian(VARIANTS["3"].model))]
    assert names == ["F_{k}", "K_{k}", "z_{k}", "p_{k}", r"\lambda_{k+1}", r"\Psi_{k+1}"]


def test_a_vector_variant_has_no_scalar_derivation(written):
    with pytest.raises(ValueError, match="only scalar models"):
        scalar_equations(gaussian(VARIANTS["20"].model))
    tex = page_of(written["20", "ru"], "report.tex")
    assert "В среднем по шагам" in tex
    assert r"После знака $\pm$ указана стандартная ошибка." in tex
    assert r"\Psi_0 = D_0 = \begin{pmatrix}0.1 & 0 \\ 0 & 0.1\end{pmatrix}" in tex
    assert "pmatrix" in tex and "q_2" not in tex and r"&\quad" in tex
    cells = re.findall(r"<mtr>(.*?)</mtr>", page_of(written["20", "ru"]))
    assert any("</mtd><mtd>" in row for row in cells)  # columns of a matrix stay apart


@pytest.mark.parametrize("language", LANGUAGES)
def test_figures_speak_the_language_of_the_report(results, language):
    """Every label and legend; Cyrillic letters in the Russian report only, and no English words
    there."""
    texts = []
    for draw in FIGURES.values():
        ax = draw(results["53"], Figure().add_subplot(), WORDS[language])
        rows = [text.get_text() for text in ax.get_yticklabels()]
        texts += [ax.get_xlabel(), ax.get_ylabel(), *ax.get_legend_handles_labels()[1], *rows]
    plain = " ".join(re.sub(r"\$[^$]*\$", "", text) for text in texts)
    assert ("точный АОФ" in texts and "ЛМФОС" in texts) == (language == "ru")
    assert ("exact AOF" in texts and "LMFOS" in texts) == (language == "en")
    assert bool(re.search("[а-яА-Я]", plain)) == (language == "ru")
    assert bool(re.search("[a-zA-Z]", plain)) == (language == "en")


@pytest.mark.parametrize(
    ("state", "meter", "name", "english", "russian"),
    [
        (
            "x/2 + 25*x/(1 + x**2) + 8*cos(1.2*k) + v",
            "x**2/20 + w",
            "aof-gaussian",
            r"$\frac{1}{x^{2} + 1}$",
            "слагаемого",
        ),
        ("0.9*x + v", "sign(x) + w", "aof-linearised", "differentiable", "не дифференцируемы"),
        ("0.9*x + v", "x + w + w**2", "aof-exact", "no simple density", "нет простой плотности"),
        ("0.9*x + v", "(1 + x)**14 + w", "aof-gaussian", "within 0.01 s", "за 0.01 с"),
    ],
)
def test_the_cause_of_a_refusal_is_said_in_the_report_s_words(state, meter, name, english, russian):
    """The package's real messages; one without its kind would be quoted."""
    model = Model.define(state, meter)
    (refused,) = admissions(model, [name], seconds=0.01 if "14" in meter else None)
    assert refused.built is None
    assert english in cause(refused.reason, model, WORDS["en"])
    assert russian in cause(refused.reason, model, WORDS["ru"])


def test_a_filter_that_diverges_and_other_reasons():
    model = VARIANTS["53"].model
    negative = failed(
        "mfos-gaussian", 28, NegativeVariance("a covariance has the variance -165479")
    )
    assert "на шаге 28" in cause(negative, model, WORDS["ru"])
    assert "at step 28" in cause(negative, model, WORDS["en"])
    cubic = Model.define("2*x + x**3 + v", "x + w")
    with pytest.raises(NotFinite, match="trajectories"):  # not the filter's fault
        compare(lab_filters(cubic, ["aof-linearised"]), cubic, 50, 40, 1)
    assert cause("50 % of $ & _", model, WORDS["en"]) == "50 % of $ & _"


def test_one_filter_left(no_figures, tmp_path):
    """The others are refused: named with their causes, together where they share it; nothing is
    compared, nothing fails."""
    model = Model.define("0.9*x + v", "x + (1 if x > 0 else 0) + sin(w)")
    result_ = admissions(model, LAB)
    reasons = {each.name: each.reason for each in result_ if each.built is None}
    result = compare([each.built for each in result_ if each.built], model, 200, 3, 1)
    result = dataclasses.replace(result, left_out=reasons)
    paths = write_report(Variant("one_left", "", model), result, tmp_path, "ru")
    tex = page_of(tmp_path, "report.tex")
    assert (
        r"\item ЛАОФ, ЛФОС, ЛМФОС: уравнения не дифференцируемы" in tex
        and r"\text{при}" in tex
        and r"\text{for}" not in tex
    )
    assert r"one\_left" in tex and "участвует один фильтр, ДУОФ" in tex
    assert {path.stem for path in paths} == {"report", "accuracy", "consistency"}


def test_formulas_that_are_too_long_are_not_printed(results, monkeypatch, no_figures, tmp_path):
    monkeypatch.setattr(report_text, "LONGEST", 10)
    write_report(VARIANTS["53"], results["53"], tmp_path, "ru")
    tex = page_of(tmp_path, "report.tex")
    assert (
        tex.count("Формулы слишком громоздки") == 2
        and "уравнения для данной модели" not in tex
        and "too long" not in tex
        and "каталоге" not in tex
    )


@pytest.mark.parametrize(("language", "words"), [("en", "rounding"), ("ru", "округления")])
def test_a_reader_is_told_where_all_errors_are_rounding(no_figures, tmp_path, language, words):
    known = Model.define("0.9*x + 0.05*x*v", "x + 0.02*x**2*w", prior={"variance": 0})
    for model in (known, VARIANTS["53"].model):
        result = compared(model, ["aof-gaussian", "aof-linearised"], 400, 3)
        assert ("rounding" in " ".join(remarks_in_words(result))) == (model is known)
        write_report(VARIANTS["53"], result, tmp_path, language)
        assert (words in page_of(tmp_path)) == (model is known)


def test_a_filter_that_a_few_trajectories_take_far_beyond_the_others_is_said_to_diverge(
    no_figures, tmp_path
):
    """One filter's variance is a thousand times the other's by one trajectory; if all make it, that
    is no divergence."""
    model = VARIANTS["53"].model
    for everywhere in (False, True):
        result = compared(model, ["aof-gaussian", "duof"], 400, 3)
        result.sums["square"][1, 2] *= 1000
        result.sums["largest"][:] = 0
        if not everywhere:
            result.sums["largest"][1, 2] = 0.5 * result.sums["square"][1, 2].sum()
        result_ = " ".join(remarks_in_words(result))
        assert ("DUOF: at step 2 the error variance is more than a hundred times" in result_) == (
            not everywhere
        ), result_
        # and it has no place among the others
        assert len(conclusions(result)) == everywhere
        write_report(VARIANTS["53"], result, tmp_path, "ru")
        assert ("на них фильтрация расходится" in page_of(tmp_path)) == (not everywhere)


# --- the files


class Page(HTMLParser):
    """What a page would load, and its tags."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.loads = [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.loads += [
            value
            for name, value in attrs
            if name in ("src", "href", "srcset", "data", "poster", "action")
        ]


def test_every_file_of_the_report_is_written(results, written, tmp_path):
    variant = VARIANTS["20"]
    again = write_report(variant, results["20"], tmp_path, known=admissions(variant.model))
    expected = {f"{name}.{kind}" for name in FIGURES for kind in ("svg", "pdf")} | {
        "report.html",
        "report.tex",
    }
    assert {path.name for path in again} == expected
    assert {path.name for path in tmp_path.iterdir()} == expected  # no leftovers
    assert all(path.stat().st_size > 500 for path in again)
    for name in expected:  # the same numbers give the same report
        assert (tmp_path / name).read_bytes() == (written["20", "en"] / name).read_bytes()


@pytest.mark.parametrize("case", ALL)
def test_the_page_needs_no_network_and_no_script(written, case):
    folder = written[case]
    text = page_of(folder)
    page = Page(text)
    assert "script" not in page.tags
    assert "url(" not in text
    assert "@import" not in text
    for load in page.loads:
        assert load == "data:," or (folder / load).is_file()
    assert page.tags.count("img") == len(FIGURES)
    for figure in FIGURES:
        links = re.findall(r'href="([^"]*)"', page_of(folder, f"{figure}.svg"))
        assert all(link.startswith("#") for link in links)


@pytest.mark.parametrize("case", ALL)
def test_every_formula_is_well_formed_mathml(written, case):
    formulas = re.findall(r"<math.*?</math>", page_of(written[case]), re.DOTALL)
    assert len(formulas) > 30
    for formula in formulas:
        text = "".join(ElementTree.fromstring(formula).itertext())
        assert text.strip()
        assert "\\" not in text, f"a LaTeX command that was not understood: {text}"


def balanced(tex):
    """Braces, environments and dollars of a LaTeX text match."""
    bare = re.sub(r"\\[{}$%]", "", tex.replace("\\\\", ""))
    depth, stack = 0, []
    for sign in re.findall(r"[{}]", bare):
        depth += 1 if sign == "{" else -1
        assert depth >= 0
    for kind, environment in re.findall(r"\\(begin|end)\{([^}]*)\}", bare):
        assert kind == "begin" or stack[-1] == environment
        stack = [*stack, environment] if kind == "begin" else stack[:-1]
    arrows = bare.count(r"\leftarrow") - bare.count(r"\rightarrow")
    assert bare.count(r"\left") - bare.count(r"\right") == arrows
    return depth == 0 == len(stack) == bare.count("$") % 2


@pytest.mark.parametrize("case", ALL)
def test_the_latex_is_balanced_and_names_its_figures(written, case):
    tex = page_of(written[case], "report.tex")
    assert balanced(tex)
    assert {f"{figure}.pdf" for figure in FIGURES} == set(
        re.findall(r"\\includegraphics\[[^]]*\]\{([^}]*)\}", tex)
    )


def test_hostile_names_stay_text(results, no_figures, tmp_path):
    hostile = Variant(
        r"5<3 50 % & x^2_1 ~ #1 $ \input{secret} <script>alert(1)</script> вариант",
        "",
        VARIANTS["53"].model,
    )
    write_report(hostile, results["53"], tmp_path)
    html = page_of(tmp_path)
    assert "<script" not in html
    assert "5&lt;3" in html
    assert "вариант" in html
    tex = page_of(tmp_path, "report.tex")
    assert r"\input" not in tex
    assert balanced(tex)
    assert (
        r"50 \% \& x\textasciicircum{}2\_1 \textasciitilde{} \#1 \$ \textbackslash{}input\{secret\}"
        in tex
    )


def test_the_numbers_are_those_of_the_comparison(results, tmp_path):
    data, without = (
        json.loads(page_of(write_json(VARIANTS[name], results[name], tmp_path / name).parent, name))
        for name in ("53", "20")
    )
    result = results["53"]
    assert (data["variant"], data["runs"], data["steps"], data["seed"]) == ("53", 300, 4, 1)
    assert data["model"]["parameters"] == {"c": 0.9, "e": 0.05, "g": 1.0, "f": 0.02}
    for key, errors, estimate, names in (
        ("error_variance", "standard_error", result.error_variance, result.names),
        ("above_bound", "above_bound_standard_error", result.gap, LAB),
    ):
        for name, value in zip(names, map(estimate, names), strict=True):
            assert data[key][name] == value.value.tolist()  # every digit
            assert data[errors][name] == value.standard_error.tolist()
        assert {*data[key]} == {*names}
    means = {name: entry["value"] for name, entry in data["mean_above_bound"].items()}
    assert means == {name: float(result.mean_gap(name).value) for name in LAB}
    assert {*data["score"]} == {*LAB} and "above_bound" not in without


def test_without_the_exact_filter_the_control_is_the_zero_line(written):
    results, admitted = (
        page_of(written["20", "en"])
        .partition("<h2>Comparison")[2]
        .split("Which filters this model admits")
    )
    assert "exact AOF" not in results and "above that of GAOF" in results
    assert "<td>exact AOF</td><td>yes</td>" in admitted  # it would be by particles
    for name in ("report.html", "report.tex"):
        text = page_of(written["20", "en"], name)
        assert "The coefficients of DUOF, GFOS, LFOS, GMFOS, LMFOS were found over another" in text
