"""Every relation that a page types says what it is; numbers in claims and captions come from their
cells."""

from pathlib import Path

import numpy as np
import pytest
from gate.page import (
    COMPUTED,
    CONDITION,
    DEFINITION,
    Formula,
    Letters,
    formulas,
    judged,
    letters_of,
    typed_numbers,
)
from gate.plant import written

from kfcourse.pages import Unverified

PAGES = written()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_each_typed_relation_says_what_it_is(page: Path):
    for formula, pieces in judged(page):
        assert pieces or formula.kind in ("box", "display", "point", "sentence")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_a_page_says_of_its_relations_is_about_relations_that_it_has(page: Path):
    if letters_of(page).listed == []:
        return
    labels = {formula.label for formula in formulas(page.read_text())}
    typed = {piece.piece for _, pieces in judged(page) for piece in pieces} | labels
    assert [text for text in letters_of(page).listed if text not in typed] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_numbers_of_claims_and_of_captions_of_tables_come_from_their_cells(page: Path):
    assert list(typed_numbers(page.read_text(encoding="utf-8"))) == []


def test_a_changed_number_of_a_claim_or_of_a_caption_is_noticed():
    code = (
        'claim(f"To 12 digits, 7 of {n} at $k=2$.", abs(x[7]) < 1e-12)\ntable(c, caption=f"95 '
        '% of {n}, in 6,000 boats")'
    )
    page = f"```{{code-cell}} python\n{code}\nlevel, runs = 0.95, 6000\n```\n"
    assert list(typed_numbers(page)) == []
    for right, wrong in (
        ("12 digits", "10 digits"),
        ("7 of", "8 of"),
        ("95 %", "99 %"),
        ("6,000 boats", "600 boats"),
    ):
        (number,) = typed_numbers(page.replace(right, wrong))
        assert wrong.startswith(number)


def letters(rng: np.random.Generator) -> dict[str, float]:
    a = rng.normal()
    return {"a": a, "b": 2 * a}


def test_what_is_displayed_is_computed_or_listed():
    page = Letters((letters,), {DEFINITION: [r"x\sim\mathcal N(0,1)", "eq-b"]}, {r"\det b": "2a"})
    assert page.judge(Formula("display", r"b=2a,\qquad x\sim\mathcal N(0,1)"))[1].what == DEFINITION
    assert page.judge(Formula("display", "b=2a"))[0].what == COMPUTED
    assert page.judge(Formula("display", "b=2a", "eq-b"))[0] == ("b = 2 a", DEFINITION, True)
    wrong = {
        "display": ["b=3a", "c=a", r"x\sim\mathcal N(0,2)"],
        "box": ["b=-2a", "b+a"],
        "side": [r"\det a"],
        "name": ["b^2"],
    }
    for kind, text in ((kind, text) for kind, ones in wrong.items() for text in ones):
        with pytest.raises(Unverified):
            page.judge(Formula(kind, text))


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
    assert [tuple(formula) for formula in formulas(page)] == [
        ("display", "a=b", "eq-a"),
        ("display", "e=f", ""),
        ("box", "c=d", ""),
        ("sentence", "a=b", ""),
        ("side", r"\det A", ""),
        ("name", "G^2", ""),
    ]


def test_a_relation_in_a_sentence_holds_if_it_can_be_read():
    page = Letters((letters,), {CONDITION: ["a<b"]})
    assert [page.judge(Formula("sentence", text))[0].what for text in ("b=2a,", "a<b")] == [
        COMPUTED,
        CONDITION,
    ]
    for unread_one in ("b=2c", "a=1", "b=-a", "x", r"a=\frac12", r"\hat b=c'"):
        assert page.judge(Formula("sentence", unread_one)) == []
    with pytest.raises(Unverified, match="does not hold"):
        page.judge(Formula("sentence", "b=3a"))


def test_a_formula_of_the_key_points_is_computed_or_stands_elsewhere(tmp_path):
    page = (
        "The sum $q=r+s$ and $uv^2$.\n\n```{admonition} Key points\n:class: keypoints\n\n- So "
        "$q=r+s$, $uv^2$.\n```\n"
    )
    assert [pieces for _, pieces in judged(tmp_path / "page.md", page)] == [[]] * 4
    for wrong in ("$q=r-s$", "$uv$", "$uv^3$"):
        with pytest.raises(Unverified, match="nothing says what this is"):
            list(judged(tmp_path / "page.md", page.replace("- So $q=r+s$", f"- So {wrong}")))
