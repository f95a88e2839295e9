"""The glossary: each term once, introduced by a page that there is, and what a page refers to on
another page goes with it."""

import re
from pathlib import Path

import pytest
from ext import previews, terms

BOOK = Path(terms.__file__).parents[1]


def test_the_glossary_is_in_order_and_says_each_thing_once():
    names = [term.name for term in terms.terms()]
    assert names == sorted(names, key=str.casefold)
    assert len({term.identity for term in terms.terms()}) == len(names) > 100
    for term in terms.terms():
        assert term.meaning.endswith(".") and "$" not in term.meaning and len(term.meaning) < 200, (
            term.name
        )  # pages without MathJax show it
    contents = (BOOK / "_toc.yml").read_text(encoding="utf-8")
    manual = {
        f"manual/{path.name.replace('_', '-')}"
        for path in (BOOK.parent / "exercises" / "sets").iterdir()
    }
    for term in terms.terms():
        assert term.page in manual or f"- file: {term.page}\n" in contents, term
        page = term.page.removeprefix("manual/").replace("-", "_")
        path = (
            BOOK.parent / "exercises" / "sets" / page / "statement.md"
            if term.page in manual
            else BOOK / f"{term.page}.md"
        )
        assert any(form in terms.bare(path.read_text(encoding="utf-8")) for form in term.forms()), (
            term
        )
    uses = [use.casefold() for term in terms.terms() for use in term.uses()]
    assert len(set(uses)) == len(uses)


def test_the_notation_has_the_terms_of_the_glossary():
    """Each Russian term of its tables is one of the glossary's, in a row that names it."""
    known = {form: term for term in terms.terms() for form in map(terms.bare, term.ru)}
    seen, column = 0, None
    for row in (BOOK / "course/notation.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in re.sub(r"\$[^$]*\$|[*`]", " ", row).strip("|").split("|")]
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


PAGE = """<figure id="fig-a"><img src="_images/a.png"/><figcaption>
<p>Figure 1.<a class="headerlink" href="#fig-a">#</a> See <a href="b.html">there</a>.</p></figcaption></figure>
<div class="math" id="equation-b" tabindex="0">\\[x\\]</div><p id="c">text</p>
<dl class="kf-terms"><dt id="term-gain">gain<span class="kf-ru">усиление</span></dt>
<dd><p>A factor. <span class="kf-where"><a href="x.html">x</a></span></p></dd></dl>"""


@pytest.mark.parametrize(
    ("identity", "way", "has"),
    [
        ("fig-a", "..", ['src="../_images/a.png"', "Figure 1."]),
        ("fig-a", ".", ['src="_images/a.png"']),
        ("equation-b", ".", ["\\[x\\]"]),
        ("term-gain", ".", ["<b>gain</b>", "усиление", "A factor."]),
    ],
)
def test_what_stands_at_a_place_of_another_page(identity, way, has):
    shown = previews.preview(PAGE, identity, way)
    assert all(part in shown for part in has), shown


@pytest.mark.parametrize("identity", ["c", "nowhere"])
def test_nothing_is_shown_of_other_places(identity):
    assert previews.preview(PAGE, identity, ".") == ""
