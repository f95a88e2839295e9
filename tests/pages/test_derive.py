"""The page "Derive it" in a real browser: its verdicts are the checker's, and it works by keyboard,
without a network."""

import json
import random
from pathlib import Path

import pytest
from browsers import offline
from derivation_corpus import chains, planted

from kfcourse import load_variants
from kfcourse.pages.derive import checked, described, field, shown

ROOT = Path(__file__).resolve().parents[2]
STYLE = (ROOT / "book" / "_static" / "book.css").read_text(encoding="utf-8")
COUNT = 6
BY_HAND = [
    "variant 53\nh = g*m\n = g*q\n = m*g\n = g*m/(m-m)\n = M[1/x]\n = (g*m",
    "S = sqrt(c^2*d)\n = c*sqrt(d)\n = d^(1/2)*c",
    "variant 53\nlinearised\nF = g^2*d + f^2*m^4\n = G^2*d + f^2*m^2*m^2\n = (g^2 - f^2*m^3*m/d)*d",
    "variant 53\nF = M[(g*x + f*x^2*w - g*m)^2]\n = g^2*M[(x-m)^2]\n = g^2*d",
    "variant 53\nF = M[(g*x + f*x^2*w - h)^2]\n = g^2*d + f^2*m^4 + 2*f^2*m^2*d + f^2*d^2",
    "variant 5\nS = M[sin(x)^2]\n = sin(m)^2*exp(-d)\nG = -g*cos(m)*exp(d/2)\nG = g*cos(m)\nG = "
    "g*cos(m)*exp(d/2)",
    "variant 53\nS = g^2*d + f^2*M[x^4]\n = g^2*d + f^2*M[x]*M[x^3]\nS = M[x*sin(x)]\n = m*M[sin(x)]",
    "variant 21\nlinearised\nF11 = cos(m1)^2*d11 + r^2\n = (1 - sin(m1)^2)*d11 + r",
]


def texts() -> list[str]:
    rng, right = random.Random(6), chains(8, COUNT)
    made = [*right, *(slip.chain for slip in planted(right, 9))]
    return [chain.text(rng) for chain in made] + BY_HAND


@pytest.fixture
def tab(browser, tmp_path):
    """The field and its script in a page from a file, without a network."""
    path = tmp_path / "derive.html"
    example = "F = M[(g*x + f*x^2*w - h)^2]\n = g^2*d + 3*f^2*d^2"
    body = field(load_variants(), example)
    head = '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>x</title>'
    with offline(browser) as new_tab:
        text = f"{head}<style>{STYLE}</style></head><body>{body}</body></html>"
        page = new_tab(path, text, viewport={"width": 390, "height": 800})
        page.goto(path.as_uri())
        yield page


def test_verdicts_are_those_of_the_checker(tab):
    """Status, kinds, places and words, on chains made by code and by hand; of what cannot be
    read, the status."""
    every = texts()
    run = """([texts, data]) => { const { models, texts: words } = JSON.parse(data);
        return texts.map((text) => kfcourseDerive.checkText(text, models, words)); }"""
    in_browser, statuses = tab.evaluate(run, [every, described(load_variants())]), []
    for text, theirs in zip(every, in_browser, strict=True):
        ours = checked(text).verdicts
        statuses += [verdict.status for verdict in ours]
        assert [(verdict["line"], verdict["status"]) for verdict in theirs] == [
            (verdict.line, verdict.status) for verdict in ours
        ], text
        for verdict, other in zip(theirs, ours, strict=True):
            if other.status != "unreadable":
                spans = [list(span) for span in other.spans]
                wanted = [other.says, other.rule, list(other.kinds), spans]
                names = ("says", "rule", "kinds", "spans")
                assert [verdict[name] for name in names] == wanted, text
    assert statuses.count("differs") > COUNT


def test_by_keyboard(tab):
    assert "1 to look at" in tab.get_by_role("status").inner_text()
    assert tab.locator(".kf-differs mark").count() == 1
    tab.get_by_label("Your derivation, a step a line").fill("h = M[g*x + f*x^2*w]\n = g*m")
    tab.get_by_label("Your derivation, a step a line").press("Control+Enter")
    assert tab.get_by_role("status").inner_text() == "2 lines, each equal to the one above"
    tab.reload()
    assert (
        tab.get_by_label("Your derivation, a step a line").input_value()
        == "h = M[g*x + f*x^2*w]\n = g*m"
    )
    tab.get_by_label("Your derivation, a step a line").fill("")
    tab.get_by_label("Model").select_option("5")
    assert (
        tab.get_by_label("Your derivation, a step a line").input_value() == "h = M[f*w + g*sin(x)]"
    )
    assert tab.get_by_role("status").inner_text() == "1 line, each equal to the one above"
    tab.get_by_label("Model").select_option("a model of my own")
    tab.get_by_label("y =").fill("q*x + w")
    tab.get_by_label("Your derivation, a step a line").fill(
        "F = M[(q*x + w - h)^2]\n = q^2*d + 1\n = <b>"
    )
    tab.get_by_role("button", name="Check each line").press("Enter")
    assert [item.get_attribute("class") for item in tab.locator(".kf-derived li").all()] == [
        "kf-right",
        "kf-right",
        "kf-unreadable",
    ]
    tab.get_by_label("y =").fill("q**x")
    tab.get_by_role("button", name="Check each line").press("Enter")
    assert (
        tab.get_by_role("status")
        .inner_text()
        .startswith("y = q**x: an exponent must be a plain number")
    )
    assert tab.evaluate("document.documentElement.scrollWidth") <= 390


def test_without_scripts_the_field_is_hidden_and_a_report_is_plain_html():
    assert '<div class="kf-derive" hidden>' in field(load_variants(), "</textarea><script>")
    assert "</textarea><script>" not in field(load_variants(), "</textarea><script>")
    text = shown(checked("variant 53\nlinearised\nF = g^2*d - f^2*m^4\n = 1 < 2"))
    assert "<mark>" in text
    assert "1 &lt; 2" in text
    assert json.loads(described(load_variants()))["models"]["53"]["meter"] == ["f*w*x**2 + g*x"]
