"""Style sheets without the rules that fit nothing: what is left out, and what must stay."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

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
