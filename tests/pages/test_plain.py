"""Equations of docstrings: every one of the package is read, and set as it is meant."""

from __future__ import annotations

import importlib
import inspect
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from docutils import nodes

from kfcourse.pages.reader import holds
from kfcourse.pages.verification import Unverified

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "book"))
import docstrings
import package
import plain

pytestmark = pytest.mark.quick


@cache
def documented():
    """The docstrings that the pages of the package show, by name."""
    shown = {}
    for folder, files in package.folders().items():
        for name in files:
            module = importlib.import_module(name)
            found = {name: module}
            for key, value in vars(module).items() if name != folder else ():
                if not key.startswith("_") and callable(value) and getattr(value, "__module__", None) == name:
                    found[f"{name}.{key}"] = value
                    if inspect.isclass(value):
                        found |= {f"{name}.{key}.{k}": v for k, v in vars(value).items() if not k.startswith("_")}
            for key, value in found.items():
                own = getattr(value, "__doc__", None)
                if isinstance(own, str) and own != type(value).__doc__:  # else that of `tuple`, say
                    shown[key] = inspect.cleandoc(own).split("\n")
    return shown


def test_every_equation_of_the_package_is_read():
    equations, unread = 0, []
    for name, lines in documented().items():
        for kind, rows in docstrings.paragraphs(lines):
            if kind == "equations":
                equations += 1
                try:
                    plain.block(plain.dedented(rows))
                except plain.NotPlain as error:
                    unread.append(f"{name}: {error}")
    assert not unread, plain.REMEDY + "\n" + "\n".join(unread)
    assert equations > 100


def test_no_equation_is_taken_for_prose_or_for_a_table():
    """Each line has columns, begins with a formula and its =, and is read to the end: an equation that a full stop hides, say."""
    for name, lines in documented().items():
        for kind, rows in docstrings.paragraphs(lines)[1:]:
            if kind in ("prose", "names") and all(" = " in row.split("  ")[0] and "   " in row for row in rows):
                with pytest.raises(plain.NotPlain):
                    print(name, [plain.runs(row) for row in rows])


def latex(text: str) -> list[str]:
    return [piece.text for piece in plain.runs(text, breaks=False) if piece.kind == "math"]


@pytest.mark.parametrize(
    ("typed", "set_as"),
    [
        ("K = Psi G^T F^+", r"K=\Psi G^{T}F^{+}"),
        ("P = (I - K H) P^-", "P=(I-KH)P^{-}"),
        ("x_{k+1} = A x_k", "x_{k+1}=Ax_{k}"),
        ("z'^s - lambda'", r"z'^{s}-\lambda '"),
        ("mu_i|j tau_j", r"\mu _{i|j}\tau _{j}"),
        ("p(x | y_0..k-1)", r"p(x\mid y_{0:k-1})"),
        ("|z - z*|^2", r"\lvert z-z^{*}\rvert ^{2}"),
        ("T^2/2 v", r"\frac{T^{2}}{2}v"),
        ("gamma/(2 T)", r"\frac{\gamma }{2T}"),
        ("a / (2b)", "a/(2b)"),
        ("F^(-1/2)", "F^{-1/2}"),
        ("sqrt(1 - alpha)", r"\sqrt{1-\alpha }"),
        ("Integral p(x) dx", r"\int p(x)\,dx"),
        ("int_0^dt exp(A s) ds B", r"\int _{0}^{dt}\exp (As)\,ds\,B"),
        ("sum_k s^k / k!", r"\sum _{k}s^{k}/k!"),
        ("x ~ N(m, D11)", r"x\sim \mathcal{N}(m,\ D_{11})"),
        ("M[v v^T] + M N", r"\mathsf{M}[vv^{T}]+MN"),
        ("M_N[pi_ij(x)]", r"\mathsf{M}_{N}[\pi _{ij}(x)]"),
        ("psi(., u)", r"\psi (\cdot ,\ u)"),
        ("`noise_sd`^2 I", r"\mathtt{noise\_sd}^{2}\,I"),
        ("p(x~ | x^j)", r"p(\tilde{x}\mid x^{j})"),
        ("D H^T 2 N^-1", r"DH^{T}\,2N^{-1}"),
        ("Q <- 1/N sum_k q_k", r"Q\leftarrow \frac{1}{N}\sum _{k}q_{k}"),
    ],
)
def test_an_equation_is_set_as_it_is_meant(typed, set_as):
    assert latex(typed) == [set_as]


def test_words_and_names_stand_between_formulas():
    found = plain.runs("H, e: regression of x - lambda on a line, see `fos`   (the pilot's)")
    assert [tuple(piece[:2]) for piece in found] == [
        ("math", r"H,\ e{:}"),
        ("words", " regression of "),
        ("math", r"x-\lambda "),
        ("words", " on a line, see "),
        ("code", "`fos`"),
        ("gap", " "),
        ("words", "(the pilot's)"),
    ]


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("lamda = 3", "lambda is one"),
        ("K = gain H", "'gain' is no letter"),
        ("gain = K", "the word before '='"),
        ("Q Qc", "two letters"),
        ("K (y - h", "no ) for ("),
        ("K y - h)", "not opened"),
        ("a + + b", "nothing before"),
        ("a = b +", "nothing behind"),
        ("= * b", "nothing before"),
        ("x_ = 3", "nothing behind _"),
        ("gain(x)", "grave accents"),
        ('run("x")', "no mark of a formula"),
        ("__all__", "no part of a formula"),
    ],
)
def test_what_is_no_equation_is_refused_at_its_place(typed, said):
    with pytest.raises(plain.NotPlain) as found:
        plain.runs(typed)
    assert said in str(found.value)


def test_columns_of_the_source_are_columns_of_the_page():
    rows = ["x_{k+1} = a(x_k, v_k)      the object", "y_k     = b(x_k, w_k)      the meter", "all independent"]
    table = plain.block(rows)
    cells = [[cell.astext() for cell in row.findall(nodes.entry)] for row in table.findall(nodes.row)]
    assert [len(row) for row in cells] == [3, 3, 1]
    assert [row[2] for row in cells[:2]] == ["the object", "the meter"]
    (wide,) = [cell for cell in table.findall(nodes.entry) if cell.get("morecols")]
    assert (wide.astext(), wide["morecols"]) == ("all independent", 2)


def test_single_spaces_and_one_row_make_no_columns():
    assert plain.columns(["K = P,   z = m"]) == [{0: "K = P,   z = m"}]
    assert [list(row) for row in plain.columns(["K = P,  z = m", "lambda' = A z,  p = q"])] == [[0], [0]]


def test_what_is_set_is_what_the_filter_computes():
    """The LaTeX of a docstring, computed by the reader of the book's relations: the gain, the estimate and its variance."""
    rng = np.random.default_rng(1)
    Psi, noise, G, lam, y = rng.uniform(0.5, 2, 5)
    F = noise + G**2 * Psi
    K = Psi * G / F
    course = {"K": K, r"\Psi": Psi, "G": G, "F": F, r"\lambda": lam, "y": y, "h": G * lam, "I": 1.0}
    course |= {"z": lam + K * (y - G * lam), "p": Psi - K * G * Psi}
    lines = documented()["kfcourse.filters.approximations.aof"]
    (rows,) = [rows for kind, rows in docstrings.paragraphs(lines) if kind == "equations"]
    first = rows[0].replace("F^+", "F^-1")  # of a number
    assert len(latex(first)) == 3
    for relation in latex(first):
        holds(relation.rstrip(","), course)
    with pytest.raises(Unverified):
        holds(latex(first.replace("+ K", "- K"))[1].rstrip(","), course)
