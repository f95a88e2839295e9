"""Style sheets without the rules that fit nothing, fonts without letters that nobody shows: what is left out, what must stay."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import pytest
from fontTools.ttLib import TTFont

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "book"))
import lighter

pytestmark = pytest.mark.quick

HERE = lighter.used(
    ['<p class="here too" id="place">never</p><script>e.className = `made-${kind}`; e.classList.add("added")</script>'],
    ['box.classList.toggle("opened")'],
)


@pytest.mark.parametrize(
    ("rule", "kept"),
    [
        (".here{color:red}", ".here{color:red}"),
        (".gone{color:red}", ""),
        (".never{color:red}", ""),  # a word of the text is no class
        ("#place .too{color:red}", "#place .too{color:red}"),
        ("#gone .too{color:red}", ""),
        (".gone, .here > b{color:red}", ".here > b{color:red}"),
        (".here .gone, p{color:red}", "p{color:red}"),
        (".added,.opened,.made-of-parts{color:red}", ".added,.opened,.made-of-parts{color:red}"),  # by scripts
        ("p:not(.gone){color:red}", "p:not(.gone){color:red}"),
        (":is(.gone,.here) a{color:red}", ":is(.gone,.here) a{color:red}"),
        ('a[href=".gone"]{color:red}', 'a[href=".gone"]{color:red}'),
        ("@media print{.gone{color:red}.here{color:red}}", "@media print{.here{color:red}}"),
        ("@media print{.gone{color:red}}", ""),
        ('@import "other.css";', '@import "other.css";'),
        ("@keyframes turn{to{opacity:0}}", "@keyframes turn{to{opacity:0}}"),
        ("@font-face{font-family:X}", "@font-face{font-family:X}"),
        ("/*! licence */", "/*! licence */"),
        ("/* remark */", ""),
        ("p{ color:\n   red; /* why */ }", "p{ color: red;  }"),
    ],
)
def test_rules_that_fit_no_element_are_left_out(rule, kept):
    assert lighter.pruned(rule, HERE) == kept


def test_letters_that_pages_sheets_and_scripts_may_show():
    page = '<p class="\u0416">\u03c3&nbsp;&#8594; <b>\u2013</b></p><script>show("\u00d7")</script>'
    shown = lighter.letters([page], ['i::before{content:"\\3b1"}b::before{content:"\u2022"}'], ["`${x} \u00b7`"])
    assert {*shown} == {*map(chr, range(0x20, 0x7F))} | {*"\u03c3\u00a0\u2192\u2013\u00d7\u03b1\u2022\u00b7"}


def test_a_font_with_some_of_its_letters_draws_them_as_before():
    path = Path(lighter.__file__).parent / "_static" / "fonts" / "source-serif-4-latin-wght-normal.woff2"
    whole, part = TTFont(path), TTFont(io.BytesIO(lighter.cut(path, "af1\u2013\u0416")))
    assert {*part.getBestCmap()} == {*map(ord, "af1\u2013")}  # Cyrillic has a font of its own
    for letter in "af1\u2013":
        name, before = part.getBestCmap()[ord(letter)], whole.getBestCmap()[ord(letter)]
        assert part["hmtx"][name] == whole["hmtx"][before]
        assert part["glyf"][name].getCoordinates(part["glyf"])[0] == whole["glyf"][before].getCoordinates(whole["glyf"])[0]
    assert [axis.axisTag for axis in part["fvar"].axes] == ["wght"]
    assert {record.FeatureTag for record in part["GPOS"].table.FeatureList.FeatureRecord} >= {"kern"}


def test_a_font_with_none_of_the_letters_is_whole():
    path = next((Path(lighter.__file__).parent / "_static" / "fonts").glob("*-greek-*"))
    assert lighter.cut(path, "abc") == path.read_bytes()
