"""The glossary: notes of Russian terms agree with it, and what a page refers to on another page goes with it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "book"))
import previews
import terms

pytestmark = pytest.mark.quick
SOURCES = terms.sources()


def test_the_notes_of_all_pages_agree_with_the_glossary():
    terms.check()
    assert sum(1 for markdown in SOURCES.values() for _ in terms.notes(markdown)) > 150  # they are found


@pytest.mark.parametrize(
    ("was", "becomes", "said"),
    [
        ("innovation (невязка)", "innovation (навязка)", "невязка"),  # a letter
        ("Kalman filter* (фильтр Калмана)", "Kalman filter* (фильтр Винера)", "фильтр Калмана"),  # another term's
        ("*likelihood* (функция правдоподобия)", "*credibility* (функция правдоподобия)", "no term"),  # the English word
        ("Wiener process (винеровский процесс)", "Wiener process (винеровский, процесс)", "винеровский процесс"),
        ("(NIS, нормированный квадрат невязки)", "(NIS, нормированный квадрат ошибки оценки)", "нормированный квадрат невязки"),
    ],
)
def test_a_note_that_differs_is_found(was, becomes, said, monkeypatch):
    page = next(page for page, markdown in SOURCES.items() if was in markdown)
    changed = SOURCES[page].replace(was, becomes)
    monkeypatch.setattr(terms, "sources", lambda: SOURCES | {page: changed})
    with pytest.raises(terms.Disagreement, match=rf"{page}: .*{said}"):
        terms.check()


def test_a_heading_of_a_set_that_differs_is_found(monkeypatch):
    page = "manual/r-loop"
    changed = SOURCES[page].replace('"дискриминатор"', '"дискриминант"')
    monkeypatch.setattr(terms, "sources", lambda: SOURCES | {page: changed})
    with pytest.raises(terms.Disagreement, match="дискриминант"):
        terms.check()


def test_a_term_that_no_page_introduces_is_found(monkeypatch):
    lost = terms.Term("martingale", ("мартингал",), "A process without drift.")
    monkeypatch.setattr(terms, "terms", lambda: (*terms_before, lost))
    with pytest.raises(terms.Disagreement, match="martingale: no page has a note"):
        terms.check()


terms_before = terms.terms()


def test_notes_in_captions_and_after_formulas_are_read():
    assert list(terms.notes("the *gain* $K_k$ {cite}`a` (коэффициент усиления), and (English only)")) == [
        ("the gain", ["коэффициент усиления"])
    ]
    options = "---\nmystnb:\n  figure:\n    caption: |\n      The reference\n      signal (опорный сигнал).\n---\n"
    cell = f"```{{code-cell}} python\n{options}f(x)\n```"
    assert [inside for _, inside in terms.notes(cell)] == [["опорный сигнал"]]


def test_the_glossary_is_in_order_and_says_each_thing_once():
    names = [term.name for term in terms.terms()]
    assert names == sorted(names, key=str.casefold)
    assert len({term.identity for term in terms.terms()}) == len(names) > 100
    for term in terms.terms():
        assert term.said.endswith(".") and "$" not in term.said and len(term.said) < 200, (
            term.name
        )  # pages without MathJax show it
    uses = [use.casefold() for term in terms.terms() for use in term.uses()]
    assert len(set(uses)) == len(uses)


def test_the_notation_has_the_terms_of_the_glossary():
    """Each Russian term of its tables is one of the glossary's, in a row that names it."""
    known = {form: term for term in terms.terms() for form in map(terms.bare, term.ru)}
    seen, column = 0, None
    for row in SOURCES["notation"].splitlines():
        cells = [cell.strip() for cell in terms.SILENT.sub(" ", row).strip("|").split("|")]
        if "Russian" in row and row.startswith("|"):
            column = next(i for i, cell in enumerate(cells) if "Russian" in cell)
        elif not row.startswith("|"):
            column = None
        elif column is not None and terms.RUSSIAN.search(cells[column]):
            english = terms.bare(" ".join(cells[:column] + cells[column + 1 :]))
            for russian in map(terms.bare, cells[column].replace(";", ",").split(",")):
                assert russian in known, f"{russian}: not in the glossary"
                assert any(form in english for form in known[russian].forms()), (
                    f"{russian}: {known[russian].name} is not in its row"
                )
                seen += 1
    assert seen > 30


PAGE = """<figure id="fig-a"><picture><source srcset="_images/a-narrow.png"/><img src="_images/a.png"/></picture><figcaption>
<p>Figure 1.<a class="headerlink" href="#fig-a">#</a> See <a href="b.html">there</a>.</p></figcaption></figure>
<div class="math" id="equation-b" tabindex="0">\\[x\\]</div><p id="c">text</p>
<dl class="kf-terms"><dt id="term-gain">gain<span class="kf-ru">усиление</span></dt>
<dd><p>A factor. <span class="kf-where"><a href="x.html">x</a></span></p></dd></dl>"""


@pytest.mark.parametrize(
    ("identity", "way", "has"),
    [
        ("fig-a", "..", ['src="../_images/a.png"', 'srcset="../_images/a-narrow.png"', "Figure 1."]),
        ("fig-a", ".", ['src="_images/a.png"']),
        ("equation-b", ".", ["\\[x\\]"]),
        ("term-gain", ".", ["<b>gain</b>", "усиление", "A factor."]),
    ],
)
def test_what_stands_at_a_place_of_another_page(identity, way, has):
    shown = previews.preview(PAGE, identity, way)
    assert all(one in shown for one in has), shown


@pytest.mark.parametrize("identity", ["c", "nowhere"])
def test_nothing_is_shown_of_other_places(identity):
    assert previews.preview(PAGE, identity, ".") == ""
