"""The student's report: what it says is what was computed, in both languages, and its files are whole."""

import re
import tomllib
from importlib import resources

import numpy as np
import pytest

from kfcourse import compare, lab_filters, load_variants
from kfcourse.lab import handin
from kfcourse.lab.handin import CATALOGUE, LANGUAGES, _ranges, write_handin
from kfcourse.lab.short_names import LAB, title

WORDS = tomllib.loads((resources.files("kfcourse.lab") / "handin.toml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def result():
    model = load_variants()["53"].model
    return compare(lab_filters(model, [*LAB, "aof-exact"]), model, 2000, 4, 1, subset_runs=200, designs=2, progress=False)


@pytest.fixture(scope="module")
def written(result, tmp_path_factory):
    """Text of handin.tex and handin.html by language."""
    texts = {}
    for language in LANGUAGES:
        folder = tmp_path_factory.mktemp(language)
        paths = write_handin(load_variants()["53"], result, folder, language)
        assert all(path.exists() for path in paths)
        texts[language] = {name: (folder / name).read_text(encoding="utf-8") for name in ("handin.tex", "handin.html")}
    return texts


@pytest.mark.quick
def test_both_languages_have_the_same_words_with_the_same_places():
    russian, english = WORDS["ru"], WORDS["en"]
    assert set(russian) == set(english)
    for key, text in english.items():
        assert sorted(re.findall(r"(?<!\\mathsf)\{\w+\}", text)) == sorted(re.findall(r"(?<!\\mathsf)\{\w+\}", russian[key])), key


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_report_of_variant_53(written, language):
    tex = written[language]["handin.tex"]
    for formula in (
        r"{x}_{k+1} &= c x + e x v",
        r"y_k &= g x + f x^{2} w",
        r"x_0 &\sim \mathcal{N}(0,\; 1)",
        r"\frac{\partial a}{\partial x} &= c + e v",
        r"\eta(x) &= g^{2} x^{2} + f^{2} x^{4}",
        r"q_4 &= m^{4} + 6 m^{2} d + 3 d^{2}",
        r"F(m, d) &= g^{2} d + f^{2} m^{4} + 6 f^{2} m^{2} d + 3 f^{2} d^{2}",
        r"\lambda_0 &= m_0",
        "I_k &=",
        "J_k &=",
        r"\Theta$: 22",
    ):
        assert formula in tex, formula
    assert (r"\usepackage[english,russian]{babel}" in tex) == (language == "ru")
    assert tex.count(r"\begin{") == tex.count(r"\end{")
    assert not re.search(r"(?<!\\)%", tex), "an unescaped per cent sign hides the rest of its line"
    page = written[language]["handin.html"]
    assert (
        f'<html lang="{language}">' in page
        and "$" not in page
        and "http://" not in page.replace("http://www.w3.org/1998/Math/MathML", "")
    )


def test_numbers_and_verdicts_are_those_of_the_comparison(written, result):
    tex = written["en"]["handin.tex"]
    value = result.error_variance("duof")[2]
    power = int(np.floor(np.log10(value.value)))
    assert rf"$({value.value / 10.0**power:.3f} \pm {value.standard_error / 10.0**power:.3f})\cdot 10^{{{power}}}$" in tex
    for k in range(result.steps):
        best, *others = result.leaders(k)
        row = rf"${k}$ & {title(best)} & {', '.join(map(title, others)) or '--'} & "
        assert row in tex


def test_a_vector_variant_has_no_scalar_derivation(tmp_path):
    model = load_variants()["20"].model
    found = compare(lab_filters(model, ["aof-gaussian", "duof"]), model, 500, 3, 1, progress=False)
    write_handin(load_variants()["20"], found, tmp_path, "ru")
    tex = (tmp_path / "handin.tex").read_text(encoding="utf-8")
    assert "pmatrix" in tex and "q_2" not in tex and r"&\quad" in tex


@pytest.mark.quick
def test_catalogue_numbers_are_the_courses():
    assert sorted(CATALOGUE.values()) == [2, 5, 8, 15, 16, 20, 22]


@pytest.mark.quick
def test_runs_of_steps_are_joined():
    assert _ranges([1, 3, 4, 5, 8]) == "$1$, $3$–$5$, $8$"


@pytest.mark.quick
def test_an_unknown_language_is_refused(tmp_path):
    with pytest.raises(ValueError, match="en or ru"):
        write_handin(load_variants()["53"], None, tmp_path, "de")
    assert list(tmp_path.iterdir()) == [] and handin.LANGUAGES == ("en", "ru")
