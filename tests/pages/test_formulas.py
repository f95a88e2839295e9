"""Formulas are set by the build: what is written of each, and what is said of one that cannot be
set."""

import pytest
from bs4 import BeautifulSoup
from ext import formulas


@pytest.fixture(scope="module")
def setter():
    running = formulas.Setter()
    yield running
    process = running.process
    running.close()
    assert process.returncode == 0


def test_a_formula_is_set_for_the_eye_and_said_to_a_screen_reader(setter):
    tree = BeautifulSoup(setter.html(r"\frac{a}{b}<x_{k}", display=False), "html.parser")
    seen, spoken = (
        tree.select_one("mjx-math[aria-hidden=true]"),
        tree.select_one("mjx-assistive-mml > math"),
    )
    assert [letter["class"][0] for letter in seen.select("mjx-c")] == [
        "mjx-c1D44E",
        "mjx-c1D44F",
        "mjx-c3C",
        "mjx-c1D465",
        "mjx-c1D458",
    ]
    assert spoken.get_text() == "ab<xk" and spoken.select_one("mfrac") and spoken.select_one("msub")
    assert not tree.select("[xmlns], [data-mjx-texclass]")


def test_what_is_displayed_is_larger_and_has_a_line_of_its_own(setter):
    shown, small = (
        BeautifulSoup(setter.html(r"\frac{a}{b}", display), "html.parser")
        for display in (True, False)
    )
    assert shown.select_one("mjx-container[display=true]") and not small.select_one(
        "mjx-container[display=true]"
    )
    assert shown.select_one("mjx-nstrut[type=d]") and small.select_one("mjx-num > [size=s]")


def test_tex_that_cannot_be_read_is_named_and_the_next_formula_is_set(setter):
    for tex, reason in (
        (r"\nonsense x", r"Undefined control sequence \\nonsense"),
        ("{x", "missing close brace"),
        ("x_a_b", "Double subscripts: use braces"),
    ):
        with pytest.raises(formulas.Unreadable, match=reason):
            setter.html(tex, display=False)
    assert "mjx-c1D465" in setter.html("x", display=False)


def test_the_style_sheet_has_the_letters_that_were_set(setter):
    setter.html(r"\aleph", display=False)
    sheet = setter.sheet()
    assert "mjx-c.mjx-c2135::before" in sheet and "mjx-c.mjx-c2136::before" not in sheet
    assert 'url("fonts/MathJax_Main-Regular.woff")' in sheet


@pytest.mark.parametrize(
    ("tex", "set_as"),
    [
        ("x=1", "x=1"),
        (r"x&=1\\y&=2", r"\begin{split}x&=1\\y&=2\end{split}"),
        ("x=1\n\ny=2", r"\begin{align}\begin{aligned}x=1 \\ y=2\end{aligned}\end{align}"),
    ],
)
def test_lines_stand_one_below_the_other(tex, set_as):
    assert formulas._lines(tex) == set_as
