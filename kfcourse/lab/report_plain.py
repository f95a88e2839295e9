"""The student's report of a model without modes: task, both derivations of the structural
functions, equations of the filters."""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

from kfcourse.filters import EQUATIONS
from kfcourse.filters import latex as equations_latex
from kfcourse.lab.checked_quadrature import Checked
from kfcourse.lab.families import FAMILIES
from kfcourse.lab.report_sections import Block, StudentReport, formulas
from kfcourse.lab.report_text import law, lines_of, matrix, printed
from kfcourse.lab.short_names import Structures, entry
from kfcourse.lab.written_out import written_lines
from kfcourse.montecarlo.comparison import Comparison
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import GaussianMoments, NoClosedForm
from kfcourse.symbolic.reading import exact_matrix
from kfcourse.symbolic.structure import FUNCTION_LATEX
from kfcourse.symbolic.writing import formula_latex, number_latex

HIGHEST = 8  # moment that is printed

# Numbers in the school's catalogue of structural functions, for the forms whose numbers the course
# gives.
CATALOGUE = {
    ("tau", "c*z"): 2,
    ("Theta", "c**2*p + e**2*z**2"): 15,
    ("Theta", "c**2*p + e**2*p + e**2*z**2"): 22,
    ("h", "g*m"): 5,
    ("G", "g"): 8,
    ("F", "d*g**2 + f**2*m**4"): 16,
    ("F", "3*d**2*f**2 + 6*d*f**2*m**2 + d*g**2 + f**2*m**4"): 20,
}


class PlainReport(StudentReport):
    """The report of a model without modes."""

    def __init__(self, result: Comparison, words: dict[str, str]) -> None:
        super().__init__(result, words)
        # `write_report` takes the other report for those with modes
        assert isinstance(result.model, Model)
        self.model = result.model
        self.structures = Structures(self.model)
        # kinds whose formulas are found in time, and are not too long
        self.derivable: list[str] = []

    def task(self) -> Iterator[Block]:
        model = self.model
        model.difference_equation("the derivation in a report")
        yield self.section("task")
        yield self.text("task_text")
        state, *others = lines_of(model.latex(values=False, indexed=True))
        if model.n == model.p == 1:  # what a and b are called below
            meter, *others = others
            k = ", k" if model.timed else ""
            state = state.replace("&=", f"&= a(x_k, v_k{k}) =", 1)
            others = [meter.replace("&=", f"&= b(x_k, w_k{k}) =", 1), *others]
        yield formulas([state, *others])
        values = ", ".join(
            f"${sp.latex(name)} = {number_latex(float(value))}$"
            for name, value in model.values.items()
        )
        if values:
            yield self.text("parameters", values=values)
        laws = (("x_0", model.prior), ("v_k", model.state_noise), ("w_k", model.meter_noise))
        yield formulas([rf"{name} &\sim {law(of)}" for name, of in laws])
        yield self.text("independent")
        yield self.text(
            "find", filters=", ".join(self.title(name) for name in self.result.entrants)
        )

    def functions(self) -> Iterator[Block]:
        if self.kinds:
            yield self.section("functions")
        for kind in self.kinds:
            yield from self.defined(kind)
            if self.model.n == self.model.p == 1:
                yield from getattr(self, kind)()
            yield from self.derived(kind)

    def linearised(self) -> Iterator[Block]:
        """The derivatives of a scalar model."""
        model = self.model
        sides = (
            (model.state_equation[0], model.v, "a", "v"),
            (model.meter_equation[0], model.w, "b", "w"),
        )
        derivatives = [
            rf"\frac{{\partial {letter}}}{{\partial {by}}} &= "
            rf"{formula_latex(formula.diff(symbol), model.x, noises)}"
            for formula, noises, letter, noise in sides
            for by, symbol in [
                ("x", model.x[0]),
                *([(noise, noises[0])] if len(noises) == 1 else []),
            ]
        ]
        yield self.text("derivatives")
        yield formulas(derivatives)

    def gaussian(self) -> Iterator[Block]:
        """The means of a scalar model, step by step."""
        if conditional := self.conditional():
            yield self.text("conditional")
            yield formulas(conditional)
        if moments := self.moments():
            yield self.text("recursion")
            yield formulas(
                [r"q_0 &= 1,\quad q_1 = m,\quad q_{n+1} = m\,q_n + n\,d\,q_{n-1}", *moments]
            )
        elif not self.structures.quadrature:
            yield self.text("exponentials")

    def conditional(self) -> list[str]:
        """Means of a, a^2, b, b^2 over their noise, at a fixed state."""
        model, lines = self.model, []
        for formula, noises, noise, first, second in (
            (model.state_equation[0], model.v, model.state_noise, r"\alpha", r"\gamma"),
            (model.meter_equation[0], model.w, model.meter_noise, r"\beta", r"\eta"),
        ):
            over = GaussianMoments(
                list(noises), list(exact_matrix(noise.mean)), sp.Matrix(exact_matrix(noise.cov))
            )
            for letter, power in ((first, 1), (second, 2)):
                try:
                    mean = sp.expand(over.mean_of(formula**power))
                except NoClosedForm:
                    # the mean over noise and state together has a closed form, this one has none
                    continue
                lines.append(f"{letter}(x) &= {formula_latex(mean, model.x)}")
        return lines

    def moments(self) -> list[str]:
        """The moments q_2 ... that the meter and the object need, if they are polynomials."""
        (x,) = self.model.x
        sides = (self.model.state_equation[0] ** 2, self.model.meter_equation[0] ** 2)
        if not all(side.is_polynomial(x) for side in sides):
            return []
        m, d = sp.symbols("m d", real=True)
        law = GaussianMoments([x], [m], sp.Matrix([[d]]))
        highest = min(max(int(sp.degree(sp.expand(side), x)) for side in sides), HIGHEST)
        return [
            f"q_{n} &= {formula_latex(sp.expand(law.mean_of(x**n)), (m, d))}"
            for n in range(2, highest + 1)
        ]

    def derived(self, kind: str) -> Iterator[Block]:
        """The five functions, with their numbers in the catalogue where it has them."""
        if kind == "gaussian" and isinstance(checked := self.structures.quadrature, Checked):
            yield self.text("by_quadrature", order=checked.order)
            return
        yield self.text("result")
        if (lines := printed(self.structures, kind)) is None:
            yield self.text("not_printed")
            return
        self.derivable.append(kind)
        yield formulas(lines)
        if self.model.n == self.model.p == 1:
            structure = getattr(self.structures, kind)
            forms = {name: (name, str(sp.expand(structure[name]))) for name in FUNCTION_LATEX}
            numbers = [
                f"${FUNCTION_LATEX[name]}$ — {CATALOGUE[form]}"
                for name, form in forms.items()
                if form in CATALOGUE
            ]
            if numbers:
                yield self.text("catalogue", numbers=", ".join(numbers))

    def filters(self) -> Iterator[Block]:
        words = self.words
        yield self.section("filters")
        yield self.text("start")
        mean, cov = self.model.prior
        yield formulas(
            [rf"\lambda_0 &= m_0 = {matrix(mean[:, None])},\qquad \Psi_0 = D_0 = {matrix(cov)}"]
        )
        families = dict.fromkeys(entry(name).family for name in self.result.entrants)
        designed = next((family for family in families if family != "aof"), "")
        for family in filter(EQUATIONS.get, families):
            heading = (
                FAMILIES[family].russian_heading
                if words["language"] == "ru"
                else FAMILIES[family].heading
            )
            yield Block("subsection", heading)
            if family == "duof":
                yield self.text("criteria")
                yield formulas(words["criteria_formulas"].split("\n"))
            yield formulas(lines_of(equations_latex(EQUATIONS[family])))
            if family == "aof" and self.model.n == self.model.p == 1:
                for name in (
                    f"aof-{kind}"
                    for kind in self.derivable
                    if f"aof-{kind}" in self.result.entrants
                ):
                    yield self.text("written_out", name=self.title(name))
                    yield formulas(
                        written_lines(getattr(self.structures, name.removeprefix("aof-")))
                    )
            if family == designed:
                yield self.text("over_ensemble")
