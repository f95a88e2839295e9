"""The student's report: task, derivations of the structural functions, equations of the filters,
comparison and conclusion; of models with modes see `report_modes`."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.filters import EQUATIONS
from kfcourse.filters import latex as equations_latex
from kfcourse.lab.admission import Admission
from kfcourse.lab.checked_quadrature import Checked
from kfcourse.lab.families import FAMILIES
from kfcourse.lab.report_text import (
    cause,
    filled,
    in_percent,
    law,
    lines_of,
    matrix,
    power_of_ten,
    printed,
    ranges,
    written_lines,
)
from kfcourse.lab.short_names import FILTERS, Entry, Structures
from kfcourse.laws import CONFIDENCE
from kfcourse.montecarlo.comparison import EXACT, Comparison, Verdict
from kfcourse.symbolic.moments import GaussianMoments, NoClosedForm
from kfcourse.symbolic.reading import exact_matrix
from kfcourse.symbolic.structure import FUNCTION_LATEX
from kfcourse.symbolic.writing import formula_latex, number_latex

ROUNDING = 1e-6  # per cent: equal filters may have lost half of their digits on the way
LEVEL = f"{100 * CONFIDENCE:g} %"
COLUMNS = 4  # filters side by side in a table, so that it fits a page
FIGURES = ("accuracy", "relative", "ranking", "consistency")
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


@dataclass(frozen=True)
class Block:
    """A piece of the report, of a kind: section, subsection, text, items, formulas, table or
    figure."""

    kind: str
    text: str = ""
    lines: list[str] = field(default_factory=list)
    rows: list[list[str]] = field(default_factory=list)


def formulas(lines: list[str]) -> Block:
    return Block("formulas", lines=lines)


class StudentReport:
    """The blocks of the report, section by section."""

    entries: Mapping[str, Entry] = FILTERS  # where filters have their names from

    def __init__(self, result: Comparison, words: dict[str, str]) -> None:
        self.result, self.words = result, words
        # of an object that moves in continuous time: some words are others
        moves = getattr(result.model, "between", None)
        self.kind, self.numbers = "", {}
        if moves is not None:
            accuracy = number_latex(moves.accuracy)
            self.kind, self.numbers = "_between", {"substeps": moves.substeps, "accuracy": accuracy}
        self.model: Any = result.model
        self.structures = Structures(self.model)
        # kinds whose formulas are found in time, and are not too long
        self.derivable: list[str] = []
        self.known: Sequence[Admission] = ()
        self.kinds = [
            kind
            for kind in ("linearised", "gaussian")
            if any(name.endswith(kind) for name in result.names)
        ]
        compared = result.has_bound or len(result.entrants) > 1
        self.figures = [name for name in FIGURES if compared or name not in ("relative", "ranking")]

    def blocks(self) -> Iterator[Block]:
        """The whole report; the words that SymPy puts into formulas in its language, too."""
        for block in self.sections():
            lines = [self.translated(line) for line in block.lines]
            yield dataclasses.replace(block, text=self.translated(block.text), lines=lines)

    def phrase(self, key: str, **values: object) -> str:
        """The words of that name, filled with what they speak of."""
        text, values = self.words.get(key + self.kind, self.words[key]), self.numbers | values
        return filled(text, self.words["thousands"], **values) if values else text

    def section(self, key: str) -> Block:
        return Block("section", self.words[key])

    def text(self, key: str, **values: object) -> Block:
        return Block("text", self.phrase(key, **values))

    def translated(self, text: str) -> str:
        for english, key in ((r"\text{for}", "if"), (r"\text{otherwise}", "else")):
            text = text.replace(english, rf"\text{{{self.words[key]}}}")
        return text

    def sections(self) -> Iterator[Block]:
        yield from self.task()
        yield from self.functions()
        yield from self.filters()
        yield from self.experiment()
        yield from self.conclusion()
        if self.known:
            yield self.section("admitted")
            heading = [
                self.words["filter"],
                self.words["admitted_verdict"],
                self.words["admitted_why"],
            ]
            rows = [
                [
                    self.title(answer.name),
                    self.words[f"admitted_{answer.verdict}"],
                    self.why(answer),
                ]
                for answer in self.known
            ]
            yield Block("table", self.words["admitted_text"], heading, rows)

    def why(self, answer: Admission) -> str:
        """Why a filter is not admitted, or what to know of it."""
        return cause(answer.reason, self.result.model, self.words) if answer.reason else answer.says

    def task(self) -> Iterator[Block]:
        model, moves = self.model, self.model.between
        yield self.section("task")
        yield self.text("task_text")
        lines = lines_of(model.latex(values=False, indexed=True))
        if moves is None and model.n == model.p == 1:  # what a and b are called below
            k = ", k" if model.timed else ""
            for i, call in enumerate((f"a(x_k, v_k{k})", f"b(x_k, w_k{k})")):
                lines[i] = lines[i].replace("&=", f"&= {call} =", 1)
        yield formulas([*lines, *model.known.latex("t" if moves is None else "t_{k}")])
        if moves is not None and any(moves.correction):
            yield self.text("stratonovich")
            added = enumerate(moves.correction, 1)
            yield formulas([rf"\Delta a_{i} &= {formula_latex(of, model.x)}" for i, of in added])
        values = ", ".join(
            f"${sp.latex(name)} = {number_latex(float(value))}$"
            for name, value in model.values.items()
        )
        if values:
            yield self.text("parameters", values=values)
        laws = {"x_0": model.prior, "v_k": model.state_noise, "w_k": model.meter_noise}
        if moves is not None:
            del laws["v_k"]
        yield formulas([rf"{name} &\sim {law(of)}" for name, of in laws.items()])
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
        model, moves = self.model, self.model.between
        object_ = (model.state_equation, model.v) if moves is None else (moves.drift, ())
        sides = ((*object_, "a", "v"), (model.meter_equation, model.w, "b", "w"))
        derivatives = [
            rf"\frac{{\partial {letter}}}{{\partial {by}}} &= "
            rf"{formula_latex(equation[0].diff(symbol), model.x, noises)}"
            for equation, noises, letter, noise in sides
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
        """Means of a, a^2, b, b^2 over their noise, at a fixed state; a drift has none."""
        model, lines = self.model, []
        for formula, noises, noise, first, second in (
            (model.state_equation[0], model.v, model.state_noise, r"\alpha", r"\gamma"),
            (model.meter_equation[0], model.w, model.meter_noise, r"\beta", r"\eta"),
        )[model.between is not None :]:
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
        (x,), moves = self.model.x, self.model.between
        sides = [self.model.state_equation[0] ** 2, self.model.meter_equation[0] ** 2]
        if moves is not None:
            sides[:1] = moves.drift[0], (moves.diffusion * moves.diffusion.T)[0]
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
            functions = structure.formulas.functions
            forms = {name: (name, str(sp.expand(structure[name]))) for name in functions}
            numbers = [
                f"${FUNCTION_LATEX[name]}$ — {CATALOGUE[form]}"
                for name, form in forms.items()
                if form in CATALOGUE
            ]
            if numbers:
                yield self.text("catalogue", numbers=", ".join(numbers))

    def defined(self, kind: str) -> Iterator[Block]:
        """The heading of a kind of structural functions, and what they are."""
        yield Block("subsection", self.words[kind])
        yield self.text(f"{kind}_text")
        yield formulas(self.phrase(f"{kind}_formulas").split("\n"))

    def filters(self) -> Iterator[Block]:
        words = self.words
        yield self.section("filters")
        yield self.text("start")
        mean, cov = self.model.prior
        yield formulas(
            [rf"\lambda_0 &= m_0 = {matrix(mean[:, None])},\qquad \Psi_0 = D_0 = {matrix(cov)}"]
        )
        families = dict.fromkeys(self.entries[name].family for name in self.result.entrants)
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
                yield formulas(self.phrase("criteria_formulas").split("\n"))
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

    def experiment(self) -> Iterator[Block]:
        result, words = self.result, self.words
        yield self.section("experiment")
        sentences = [
            self.phrase(
                "experiment_text", runs=result.runs, steps=result.steps, seed=str(result.seed)
            )
        ]
        if result.designed:
            sentences.append(
                self.phrase("designs", filters=", ".join(map(self.title, result.designed)))
            )
        if result.has_bound:
            sentences.append(words["exact"])
        yield Block("text", " ".join(sentences))
        if result.left_out:
            yield self.text("left_out")
            yield Block("items", lines=list(self.left_out()))
        for start in range(0, len(result.names), COLUMNS):
            names = result.names[start : start + COLUMNS]
            estimates = [result.error_variance(name) for name in names]
            rows = [
                [f"${k}$", *(power_of_ten(estimate[k]) for estimate in estimates)]
                for k in table_steps(result)
            ]
            yield Block(
                "table",
                words["table_goes_on" if start else "table"],
                ["$k$", *map(self.title, names)],
                rows,
            )
        for text in self.remarks():
            yield Block("text", text)
        reference = words["of_exact"] if result.has_bound else self.title(result.control)
        for name in self.figures:
            yield Block(
                "figure", self.phrase(f"figure_{name}", reference=reference, level=LEVEL), [name]
            )
        if "ranking" in self.figures:
            rows = [
                [
                    self.title(name),
                    words["diverges"] if name in result.lost else in_percent(gap),
                ]
                for name, gap in result.ranking()
            ]
            yield Block(
                "table",
                self.phrase("ranking_table", reference=reference),
                [words["filter"], "%"],
                rows,
            )
        if result.scored:
            below = self.phrase("score_below", name=self.title(result.reference))
            heading = [words["filter"], words["log_score"], below, "CRPS"]
            rows = [[self.title(name), *score_cells(result, name)] for name in result.names]
            yield Block("table", self.phrase("scores_table", level=LEVEL), heading, rows)

    def remarks(self) -> Iterator[str]:
        """What a reader must know before he relies on distances from the bound."""
        result = self.result
        steps = {"rounding": result.without_error, "doubtful": result.doubtful}
        if result.lost:
            steps["diverged"] = np.any([*result.lost.values()], axis=0)
        for kind, mask in steps.items():
            if mask.any():
                whose, at = (
                    ", ".join(map(self.title, result.lost)),
                    self.at(np.flatnonzero(mask).tolist()),
                )
                yield self.phrase(f"remark_{kind}", names=whose, at=at)

    def left_out(self) -> Iterator[str]:
        """The filters that do not take part, and why, those with the same reason together."""
        names: dict[str, list[str]] = {}
        for name, reason in self.result.left_out.items():
            names.setdefault(cause(reason, self.result.model, self.words), []).append(
                self.title(name)
            )
        yield from (f"{', '.join(titles)}: {reason}" for reason, titles in names.items())

    def conclusion(self) -> Iterator[Block]:
        result, words = self.result, self.words
        yield self.section("conclusion")
        if len(result.entrants) == 1:
            yield Block(
                "text", self.mean_sentence("alone_bound" if result.has_bound else "alone_control")
            )
            return
        verdicts = result.verdicts()
        yield self.text("verdict_text", level=LEVEL)
        heading = [words[key] for key in ("step", "best", "not_worse", "worst")]
        rows = [
            [
                f"${k}$",
                self.title(best),
                ", ".join(map(self.title, others)) or "–",
                self.title(worst) if worst else "–",
            ]
            for k, (best, others, worst) in ((k, verdicts[k]) for k in table_steps(result))
        ]
        yield Block("table", words["verdict_table"], heading, rows)
        yield Block("items", lines=list(self.sentences(verdicts)))

    def sentences(self, verdicts: list[Verdict]) -> Iterator[str]:
        """The conclusion: who leads and who is last, on how many steps, and how far from the
        bound."""
        result, words = self.result, self.words
        alone = [best for best, others, _ in verdicts if not others]
        for name in sorted(set(alone), key=lambda name: -alone.count(name)):
            steps = [
                k for k, (best, others, _) in enumerate(verdicts) if best == name and not others
            ]
            yield self.phrase("leads", name=self.title(name), at=self.at(steps))
        if not alone:
            yield words["nobody_leads"]
        unsure = [k for k, (_, others, _) in enumerate(verdicts) if others]
        if alone and unsure:  # without a leader it is every step, as has been said
            yield self.phrase("together", at=self.at(unsure))
        last = [worst for _, _, worst in verdicts if worst]
        if last:
            name = max(set(last), key=lambda name: (last.count(name), name))
            yield self.phrase(
                "last", name=self.title(name), steps=last.count(name), all=result.steps
            )
        else:
            yield words["nobody_last"]
        # the control, or its equal
        leads = not result.has_bound and abs(100 * float(result.ranking()[0][1].value)) < ROUNDING
        yield self.mean_sentence(
            "mean_first" if leads else "mean_bound" if result.has_bound else "mean_control"
        )

    def at(self, steps: list[int]) -> str:
        """At step 2; at steps 0–1, 3–50."""
        return self.phrase(
            "at_step" if len(steps) == 1 else "at_steps", where=ranges(steps, "${}$")
        )

    def mean_sentence(self, key: str) -> str:
        """How far the first filter and the last are from the bound, or from the control."""
        result = self.result
        ranked = [
            place for place in result.ranking() if place[0] not in result.lost
        ] or result.ranking()
        (first, gap), (final, largest) = ranked[0], ranked[-1]
        if len(ranked) == 1 and len(result.entrants) > 1:
            return self.phrase("mean_alone", first=self.title(first))
        return self.phrase(
            key,
            first=self.title(result.control if key == "mean_first" else first),
            gap=in_percent(gap),
            last=self.title(final),
            largest=in_percent(largest),
            control=self.title(result.control),
        )

    def title(self, name: str) -> str:
        entry = self.entries[name]
        exact = self.words["exact_title"] if name == EXACT else ""
        return exact or (entry.russian if self.words["language"] == "ru" else entry.title)


def score_cells(result: Comparison, name: str) -> list[str]:
    """Log score of a filter's predictions, how far it is below the reference's, and CRPS: means
    over the steps and half of their intervals."""
    every = slice(None)
    estimates = (
        result.log_score(name, steps=every),
        result.log_score(result.reference, minus=name, steps=every),
        result.crps(name, steps=every),
    )
    texts = (f"{each.value:.4f} ± {each.half_width():.4f}" for each in estimates)
    return [text.replace("nan ± nan", "–") for text in texts]


def table_steps(result: Comparison) -> list[int]:
    """The first steps and then some, to the last."""
    steps = [
        k
        for k in (0, 1, 2, 3, 4, 5, 7, 10, 15, 20, 30, 50, 100, 200, 500, 1000)
        if k < result.steps
    ]
    return steps if steps[-1] == result.steps - 1 else [*steps, result.steps - 1]
