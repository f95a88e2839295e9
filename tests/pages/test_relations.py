"""Every relation that a page types says what it is; numbers in its sentences come from values."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from kfcourse.pages.relations import COMPUTED, CONDITION, DEFINITION, Formula, Letters, formulas, judged, letters_of, unread
from kfcourse.pages.sentences import COMPARING, spoken, told
from kfcourse.pages.verification import Unverified

pytestmark = pytest.mark.quick
BOOK = Path(__file__).resolve().parents[2] / "book"
PAGES = sorted(set(BOOK.glob("*.md")) - {BOOK / "equations.md"})  # which the build makes


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_each_typed_relation_says_what_it_is(page: Path):
    for formula, said in judged(page):
        assert said or formula.kind in ("box", "display", "point", "sentence")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_a_page_says_of_its_relations_is_about_relations_that_it_has(page: Path):
    if letters_of(page).listed == []:
        return
    said = {one.piece for formula, pieces in judged(page) for one in pieces} | {
        formula.label for formula in formulas(page.read_text())
    }
    assert [text for text in letters_of(page).listed if text not in said] == []


# Of a page's sentences: models, laws, limits, conditions, and what its letters do not reach.  A relation that could be read, and
# cannot any more, has been changed; one that is new gets letters, or is counted here.
UNREAD = {
    "before-measuring": 10, "better-than-a-tangent": 22, "checking-exact": 16, "comparison": 5, "consistency": 24,
    "continuous": 16, "cycle-slips": 11, "derive-it": 10, "discriminator": 21, "drive": 3, "extended-kalman": 8,
    "filters-that-remember": 16, "four-sensors": 3, "grid": 10, "integration-limits": 13, "integration": 12, "lab-filters": 16,
    "lab-manual": 2, "lecture-continuous": 7, "linearisation": 15, "literature": 14, "live-lab": 12, "live-track": 3,
    "looking-back": 8, "manoeuvres": 2, "models-that-jump": 3, "notation": 12, "numerics": 15, "outliers": 9, "particles": 7,
    "radar-extended": 11, "radar-tracking": 11, "sigma-points": 14, "stratonovich": 16, "structural-functions": 19,
    "time-tags": 7, "track-2d": 14, "what-the-data-say": 11, "when-linearisation-fails": 13, "wiener": 28,
}  # fmt: skip


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_no_relation_in_a_sentence_is_read_no_longer(page: Path):
    found = unread(page)
    assert len(found) == UNREAD.get(page.stem, 0), found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_numbers_in_sentences_come_from_values_and_words_stand_beside_conditions(page: Path):
    for sentence in spoken(page.read_text(encoding="utf-8")):
        unknown = [number for number in sentence.unknown if number not in letters_of(page).literals]
        assert unknown == [], f"no expression stands behind {unknown}: {sentence.text}"
        assert sentence.compares or not COMPARING.search(sentence.text), f"no condition compares: {sentence.text}"


# Of what no cell of the page computes: a paper's or a command's settings, parts of a mark, a licence, sizes of a field.
TYPED = {
    "instructor": ["21"],
    "intro": ["20,000", "4.0", "2026"],
    "lab-manual": ["30", "20", "20", "30", "51"],
    "literature": ["0.01", "160", "40"],
    "live-track": ["17", "640"],
    "models-that-jump": ["99"],
    "numerics": ["14"],
}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_numbers_in_prose_and_in_words_of_figures_stand_in_the_code_of_their_page(page: Path):
    assert told(page.read_text(encoding="utf-8")) == TYPED.get(page.stem, [])


def test_a_changed_digit_of_prose_or_of_a_figure_is_noticed():
    page = """---
version: 3.11
---
Falls to $0.27$, from 2.5 on; 95.5 % of `0.9` and [1](a0.5.md). Variant 53 has 95 % of 20,000 at the 40 steps.

```{code-cell} python
---
mystnb:
  image:
    alt: near 4.7 px
---
claim("so it is", 0.27 < x < 2.5, y < 0.955, z > 4.7, runs == 20_000, steps == 40)
```

```toml
c = 0.125
```
"""
    assert told(page) == []
    decimals = ("0.27$", "0.28$"), ("2.5 on", "2.6 on"), ("95.5 %", "94.5 %"), ("4.7 px", "3.7 px")
    for right, wrong in (*decimals, ("95 %", "90 %"), ("20,000", "30,000"), ("the 40", "the 41")):
        assert len(told(page.replace(right, wrong))) == 1
    assert told(page.replace("20,000", "20 000")), "thousands are parted by commas, and by nothing else"


def letters(rng: np.random.Generator) -> dict[str, float]:
    a = rng.normal()
    return {"a": a, "b": 2 * a}


def test_what_is_displayed_is_computed_or_listed():
    page = Letters((letters,), {r"x\sim\mathcal N(0,1)": DEFINITION, "eq-b": DEFINITION}, {r"\det b": "2a"})
    assert page.judge(Formula("display", r"b=2a,\qquad x\sim\mathcal N(0,1)"))[1].what == DEFINITION
    assert page.judge(Formula("display", "b=2a"))[0].what == COMPUTED
    assert page.judge(Formula("display", "b=2a", "eq-b"))[0] == ("b = 2 a", DEFINITION, True)
    wrong = {
        "display": ["b=3a", "c=a", r"x\sim\mathcal N(0,2)"],
        "box": ["b=-2a", "b+a"],
        "side": [r"\det a"],
        "name": ["b^2"],
    }
    for kind, one in ((kind, one) for kind, ones in wrong.items() for one in ones):
        with pytest.raises(Unverified):
            page.judge(Formula(kind, one))


@pytest.mark.parametrize("page", ["So $$p = q$$ holds.", "- so\n\n  $$\n  p = q\n  $$\n"])
def test_a_display_that_would_not_be_read_stops_the_build(page):
    with pytest.raises(Unverified, match="a display stands on lines of its own"):
        list(formulas(page))


def test_displays_boxes_and_strings_are_found():
    page = """
Text with $a=b$.

$$
a=b
$$ (eq-a)

```{admonition} Steps
:class: algorithm

1. $c=d$ and

$$
e=f
$$
```

```{code-cell} python
:tags: [hide-input]
verified((r"\\det A", x, y), names={x: "G^2"}, label="eq-b")
```
"""
    assert [tuple(one) for one in formulas(page)] == [
        ("display", "a=b", "eq-a"), ("display", "e=f", ""), ("box", "c=d", ""), ("sentence", "a=b", ""),
        ("side", r"\det A", ""), ("name", "G^2", ""),
    ]  # fmt: skip


def test_a_relation_in_a_sentence_holds_or_is_counted_as_unread(tmp_path):
    page = Letters((letters,), {"a<b": CONDITION})
    assert [page.judge(Formula("sentence", one))[0].what for one in ("b=2a,", "a<b")] == [COMPUTED, CONDITION]
    for unread_one in ("b=2c", "a=1", "b=-a", "x", r"a=\frac12", r"\hat b=c'"):
        assert page.judge(Formula("sentence", unread_one)) == []
    with pytest.raises(Unverified, match="does not hold"):
        page.judge(Formula("sentence", "b=3a"))
    told = "So $a=1$ and $b=2c$, $c'$.\n\n```{admonition} Key points\n:class: keypoints\n\n- So $b=2c$.\n```\n"
    assert unread(tmp_path / "page.md", told) == ["b = 2 c"]


def test_a_number_without_an_expression_is_found():
    cell = '```{code-cell} python\nclaim(f"To 12 digits 7 of {n:.3f} are larger at $k=2$.", abs(x[2] - y) < 1e-12)\n```\n'
    (sentence,) = spoken(cell)
    assert sentence.unknown == ["7"] and sentence.compares
    (typed,) = spoken(cell.replace("7 of", "20,000 of 30 000, 7 of").replace("x[2]", "x[2] + 20_000"))
    assert typed.unknown == ["30", "000", "7"]
    for word, known in (("three", "3"), ("a third", "1 / 3"), ("four digits", "1e-4"), ("two thousand", "2_000"), ("ten", "10")):
        told_so = f'```{{code-cell}} python\nclaim("So it is with {word}.", x < {known})\n```\n'
        assert [one.unknown for one in spoken(told_so)] == [[]]
        assert [one.unknown for one in spoken(told_so.replace(known, "7"))] != [[]], word
    (empty,) = spoken('```{code-cell} python\nclaim("It is larger.", True)\n```\n')
    assert not empty.compares


def test_a_formula_of_the_key_points_is_computed_or_stands_elsewhere(tmp_path):
    page = "The sum $q=r+s$ and $uv^2$.\n\n```{admonition} Key points\n:class: keypoints\n\n- So $q=r+s$, $uv^2$.\n```\n"
    assert [said for _, said in judged(tmp_path / "page.md", page)] == [[]] * 4
    for wrong in ("$q=r-s$", "$uv$", "$uv^3$"):
        with pytest.raises(Unverified, match="nothing says what this is"):
            list(judged(tmp_path / "page.md", page.replace("- So $q=r+s$", f"- So {wrong}")))
