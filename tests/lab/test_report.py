"""The lab's report: its sentences agree with its numbers, its files are whole, its formulas are
those of the model."""

import dataclasses
import json
import re
from html.parser import HTMLParser
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.figure import Figure

from kfcourse import Model, compare, lab_filters, load_variants
from kfcourse.lab.admission import admissions
from kfcourse.lab.report import conclusions, remarks_in_words, save_figure, write_json, write_report
from kfcourse.lab.short_names import LAB, title
from kfcourse.lab.variants import Variant, find_variant

FIGURES = ("accuracy", "relative", "ranking", "consistency")


@pytest.fixture(scope="module")
def variants():
    return load_variants()


@pytest.fixture(scope="module")
def result53(variants):
    model = variants["53"].model
    return compare(
        lab_filters(model, [*LAB, "aof-exact"]), model, 300, 6, 1, design_runs=4000, progress=False
    )


@pytest.fixture(scope="module")
def result20(variants):
    model = variants["20"].model
    return compare(lab_filters(model), model, 1000, 4, 1, progress=False)


@pytest.fixture(scope="module")
def written(variants, result53, result20, tmp_path_factory):
    """Folders of the reports of variants 53 and 20, written once."""
    folders = {name: tmp_path_factory.mktemp("reports") / "below" / name for name in ("53", "20")}
    for name, result in (("53", result53), ("20", result20)):
        write_report(variants[name], result, folders[name], known=admissions(variants[name].model))
    return folders


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


# --- sentences


def test_a_difference_is_significant_if_its_interval_excludes_zero(result53):
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
        np.testing.assert_allclose(printed, [100 * low, 100 * high], rtol=0.005)  # three digits
        assert "95 % confidence" in sentence


def test_a_large_difference_has_no_power_of_ten():
    """The tangent of x^2 at 0 tells the linearised FOS nothing at first: it stays hundreds of times
    less accurate."""
    model = Model.define("0.9*x + 1e-4*v", "x**2 + 0.001*w")
    result = compare(
        lab_filters(model, ["duof", "fos-linearised"]), model, 2000, 12, 1, progress=False
    )
    (sentence,) = conclusions(result)
    (low, high) = re.findall(r"confidence: (\d{4,}) to (\d{4,}) %", sentence)[0]
    assert (
        float(low)
        < 100 * float(result.mean_gap_difference("fos-linearised", "duof").value)
        < float(high)
    )


def test_nor_has_a_tiny_one():
    model = Model.define("0.9*x + 0.1*v", "x + 3e-6*x**2 + 0.1*w")
    result = compare(
        lab_filters(model, ["aof-gaussian", "aof-linearised"]), model, 2000, 4, 1, progress=False
    )
    (sentence,) = conclusions(result)
    (low, high) = re.findall(r"confidence: (-?0\.000\d{3,}) to (-?0\.000\d{3,}) %", sentence)[0]
    assert float(low) < float(high)


def test_a_filter_that_diverges_is_no_measure_for_others_and_has_no_place_among_them():
    """D3: the linearised AOF loses some trajectories, and errs ten thousand times as much there as
    the FOS does."""
    model = find_variant("D3").model
    result = compare(
        lab_filters(model, ["aof-linearised", "fos-linearised"]), model, 1000, 6, 1, progress=False
    )
    assert set(result.lost) == {"aof-linearised"} and result.control == "fos-linearised"
    assert conclusions(result) == []
    assert any("LAOF" in said and "diverges" in said for said in remarks_in_words(result))


def test_rounding_is_not_a_difference(variants):
    # On a linear model the Gaussian and the linearised form of each filter are the same: no verdict
    # may tell them apart.
    model = variants["1"].model
    result = compare(lab_filters(model), model, 3000, 20, 1, progress=False)
    alike = [
        {"GAOF", "LAOF"},
        {"GFOS", "LFOS"},
        {"GMFOS", "LMFOS"},
        {"DUOF", "GMFOS"},
        {"DUOF", "LMFOS"},
    ]
    found = [
        set(re.findall(r"\w+", s)[:3:2])
        for s in conclusions(result)
        if s.endswith("are the same but for rounding.")
    ]
    ranked = [title(name) for name, _ in result.ranking()]
    assert found == [pair for pair in map(set, pairwise(ranked)) if pair in alike]


# --- the files


def test_every_file_of_the_report_is_written(variants, result20, written, tmp_path):
    again = write_report(
        variants["20"], result20, tmp_path / "again", known=admissions(variants["20"].model)
    )
    expected = {f"{name}.{kind}" for name in FIGURES for kind in ("svg", "pdf")} | {
        "report.html",
        "report.tex",
    }
    assert {path.name for path in again} == expected
    assert {path.name for path in (tmp_path / "again").iterdir()} == expected  # no leftovers
    assert all(path.stat().st_size > 500 for path in again)
    for name in expected:  # the same numbers give the same report
        assert (tmp_path / "again" / name).read_bytes() == (written["20"] / name).read_bytes()


@pytest.mark.parametrize("name", ["53", "20"])
def test_the_page_needs_no_network_and_no_script(written, name):
    folder = written[name]
    text = (folder / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert "script" not in page.tags
    assert "url(" not in text
    assert "@import" not in text
    for load in page.loads:
        assert load == "data:," or (folder / load).is_file()
    assert page.tags.count("img") == len(FIGURES)
    for figure in FIGURES:
        links = re.findall(
            r'href="([^"]*)"', (folder / f"{figure}.svg").read_text(encoding="utf-8")
        )
        assert all(link.startswith("#") for link in links)


@pytest.mark.parametrize("name", ["53", "20"])
def test_every_formula_is_well_formed_mathml(written, name):
    formulas = re.findall(
        r"<math.*?</math>", (written[name] / "report.html").read_text(encoding="utf-8"), re.DOTALL
    )
    assert len(formulas) > 30
    for formula in formulas:
        text = "".join(ElementTree.fromstring(formula).itertext())
        assert text.strip()
        assert "\\" not in text, f"a LaTeX command that was not understood: {text}"


def balanced(tex):
    """Braces, environments and dollars of a LaTeX text match."""
    bare = re.sub(r"\\\\", "", tex)
    bare = re.sub(r"\\[{}$%]", "", bare)
    depth = 0
    for sign in re.findall(r"[{}]", bare):
        depth += 1 if sign == "{" else -1
        assert depth >= 0
    assert depth == 0
    assert bare.count("$") % 2 == 0
    stack = []
    for kind, environment in re.findall(r"\\(begin|end)\{([^}]*)\}", bare):
        if kind == "begin":
            stack.append(environment)
        else:
            assert stack.pop() == environment
    assert not stack
    assert bare.count(r"\left") - bare.count(r"\leftarrow") == bare.count(r"\right") - bare.count(
        r"\rightarrow"
    )
    return True


@pytest.mark.parametrize("name", ["53", "20"])
def test_the_latex_is_balanced_and_names_its_figures(written, name):
    tex = (written[name] / "report.tex").read_text(encoding="utf-8")
    assert balanced(tex)
    assert {f"{figure}.pdf" for figure in FIGURES} == set(
        re.findall(r"\\includegraphics\[[^]]*\]\{([^}]*)\}", tex)
    )


def test_no_curve_runs_through_the_words_of_a_legend(tmp_path, monkeypatch):
    """Wherever in the axes a legend of eight filters stood, one would."""
    below, save = [], Figure.savefig

    def look(figure, *arguments, **options):
        save(figure, *arguments, **options)
        box, (ax,) = figure.legends[0].get_window_extent(), figure.axes
        below.append(box.y1 <= ax.get_window_extent().y0)

    def everywhere(ax):
        for filter_ in range(8):
            ax.plot(np.sin(np.arange(100) + filter_), label=f"filter {filter_}")
        ax.legend(fontsize="small", ncols=2)

    monkeypatch.setattr(Figure, "savefig", look)
    save_figure(everywhere, tmp_path, "everywhere")
    assert below == [True, True]
    assert all(
        f"filter {filter_}" in (tmp_path / "everywhere.svg").read_text(encoding="utf-8")
        for filter_ in range(8)
    )


def test_hostile_names_stay_text(variants, result53, no_figures, tmp_path):
    hostile = Variant(
        r"5<3 50 % & x^2_1 ~ #1 $ \input{secret} <script>alert(1)</script> вариант",
        "",
        variants["53"].model,
    )
    write_report(hostile, result53, tmp_path)
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<script" not in html
    assert "5&lt;3" in html
    assert "вариант" in html
    tex = (tmp_path / "report.tex").read_text(encoding="utf-8")
    assert r"\input" not in tex
    assert balanced(tex)
    assert (
        r"50 \% \& x\textasciicircum{}2\_1 \textasciitilde{} \#1 \$ \textbackslash{}input\{secret\}"
        in tex
    )


def test_only_what_was_compared_is_explained(variants, no_figures, tmp_path):
    model = variants["53"].model
    result = compare(lab_filters(model, ["aof-linearised"]), model, 200, 3, 1, progress=False)
    write_report(variants["53"], result, tmp_path)
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Linearised" in html
    assert "<h3>Gaussian</h3>" not in html
    assert "DUOF, the two-step" not in html


def test_the_numbers_are_those_of_the_comparison(variants, result53, tmp_path):
    data = json.loads(
        write_json(variants["53"], result53, tmp_path / "n.json").read_text(encoding="utf-8")
    )
    assert list(data["error_variance"]) == list(result53.names)
    for name in result53.names:
        estimate = result53.error_variance(name)
        assert data["error_variance"][name] == estimate.value.tolist()  # every digit
        assert data["standard_error"][name] == estimate.standard_error.tolist()
    assert (data["variant"], data["runs"], data["steps"], data["seed"]) == ("53", 300, 6, 1)
    assert data["model"]["parameters"] == {"c": 0.9, "e": 0.05, "g": 1.0, "f": 0.02}


# --- the bound


def test_the_exact_filter_is_reported_as_the_bound(variants, result53, tmp_path):
    data = json.loads(
        write_json(variants["53"], result53, tmp_path / "n.json").read_text(encoding="utf-8")
    )
    for key in ("above_bound", "above_bound_standard_error", "mean_above_bound", "score"):
        assert set(data[key]) == set(LAB), key
    for name in LAB:
        gap, mean = result53.gap(name), result53.mean_gap(name)
        assert data["above_bound"][name] == gap.value.tolist()
        assert data["above_bound_standard_error"][name] == gap.standard_error.tolist()
        assert data["mean_above_bound"][name] == {
            "value": float(mean.value),
            "standard_error": float(mean.standard_error),
        }


def test_without_it_the_control_is_the_zero_line(variants, result20, written, tmp_path):
    data = json.loads(
        write_json(variants["20"], result20, tmp_path / "n.json").read_text(encoding="utf-8")
    )
    assert "above_bound" not in data
    html = (
        (written["20"] / "report.html").read_text(encoding="utf-8").partition("<h2>Comparison")[2]
    )
    results, admitted = html.split("Which filters this model admits")
    assert "exact AOF" not in results and "above that of GAOF" in results
    assert "<td>exact AOF</td><td>yes</td>" in admitted  # it would be by particles


def test_the_report_says_whose_coefficients_the_intervals_hold_for(variants, no_figures, tmp_path):
    model = variants["53"].model
    result = compare(
        lab_filters(model, ["aof-gaussian", "duof"]),
        model,
        2000,
        4,
        1,
        design_runs=100,
        progress=False,
    )
    write_report(variants["53"], result, tmp_path)
    for name in ("report.html", "report.tex"):
        text = (tmp_path / name).read_text(encoding="utf-8")
        assert "The coefficients of DUOF were found over another ensemble" in text


@pytest.mark.parametrize(("language", "words"), [("en", "rounding"), ("ru", "округления")])
def test_a_reader_is_told_where_all_errors_are_rounding(variants, tmp_path, language, words):
    known = Model.define("0.9*x + 0.05*x*v", "x + 0.02*x**2*w", prior={"variance": 0})
    for model in (known, variants["53"].model):
        result = compare(
            lab_filters(model, ["aof-gaussian", "aof-linearised"]), model, 400, 3, 1, progress=False
        )
        assert ("rounding" in " ".join(remarks_in_words(result))) == (model is known)
        write_report(variants["53"], result, tmp_path, language)
        assert (words in (tmp_path / "report.html").read_text(encoding="utf-8")) == (model is known)


def test_a_filter_that_a_few_trajectories_take_far_beyond_the_others_is_said_to_diverge(
    variants, tmp_path
):
    """One filter's variance is a thousand times the other's by one trajectory; if all make it, that
    is no divergence."""
    model = variants["53"].model
    for everywhere in (False, True):
        result = compare(
            lab_filters(model, ["aof-gaussian", "duof"]), model, 400, 3, 1, progress=False
        )
        result.sums.square[1, 2] *= 1000
        result.sums.largest[:] = 0
        if not everywhere:
            result.sums.largest[1, 2] = 0.5 * result.sums.square[1, 2].sum()
        found = " ".join(remarks_in_words(result))
        assert ("DUOF: at step 2 the error variance is more than a hundred times" in found) == (
            not everywhere
        ), found
        write_report(variants["53"], result, tmp_path, "ru")
        assert (
            "на них фильтрация расходится" in (tmp_path / "report.html").read_text(encoding="utf-8")
        ) == (not everywhere)


def test_columns_of_a_matrix_stay_apart_in_a_page(variants, tmp_path):
    model = Model.define(
        ["x1 + 0.1*x2", "x2 + v"], "x1 + w", prior={"mean": [1, 2], "variance": [3, 5]}
    )
    result = compare(
        lab_filters(model, ["aof-linearised", "duof"]), model, 300, 2, 1, progress=False
    )
    write_report(dataclasses.replace(variants["53"], model=model), result, tmp_path, "en")
    cells = re.findall(r"<mtr>(.*?)</mtr>", (tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "<mtd><mn>3</mn></mtd><mtd><mn>0</mn></mtd>" in cells
