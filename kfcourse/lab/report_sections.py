"""The student's report: task, derivations of the structural functions, equations of the filters,
comparison and conclusion; of models with modes see `report_modes`."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
import sympy as sp

from kfcourse.errors import Reason
from kfcourse.filters import EQUATIONS
from kfcourse.filters import latex as equations_latex
from kfcourse.filters.exact.laws import modes_of
from kfcourse.lab import plots
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
from kfcourse.lab.short_names import Structures, entry, title
from kfcourse.laws import CONFIDENCE
from kfcourse.montecarlo.comparison import ALIKE, Comparison, Verdict
from kfcourse.montecarlo.modes import Recognised
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import GaussianMoments, NoClosedForm
from kfcourse.symbolic.reading import exact_matrix
from kfcourse.symbolic.structure import FUNCTION_LATEX, Structure
from kfcourse.symbolic.writing import formula_latex, number_latex

LEVEL = f"{100 * CONFIDENCE:g} %"
COLUMNS = 4  # filters side by side in a table, so that it fits a page
SHOWN = (0, 1, 2, 3, 4, 5, 7, 10, 15, 20, 30, 50, 100, 200, 500, 1000)  # steps in tables

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

    def __init__(
        self,
        result: Comparison,
        words: dict[str, str],
        known: Sequence[Admission] = (),
        recognised: Recognised | None = None,
    ) -> None:
        self.result, self.words, self.known, self.recognised = result, words, known, recognised
        self.model: Any = result.model
        self.structures = Structures.of(self.model)
        self.modes, self.jumps = modes_of(self.model), self.structures.jumps
        # of an object that moves in continuous time, and of one with modes, some words are others
        self.moves, self.numbers = self.modes[0].between, {}
        self.kind = "_modes" if self.jumps else "_between" if self.moves is not None else ""
        if self.moves is not None:
            accuracy = number_latex(self.moves.accuracy)
            self.numbers = {"substeps": self.moves.substeps, "accuracy": accuracy}
        self.scalar = self.model.n == self.model.p == 1
        used = {entry(name).functions for name in result.names}
        if self.jumps:  # of the filters whose names do not tell
            used.add(self.structures.best[0].name)
        self.kinds = [kind for kind in ("linearised", "gaussian") if kind in used]
        # kinds whose formulas are not too long
        self.derivable: list[str] = []
        self.zero = "bound" if result.has_bound else "control"
        compared = result.has_bound or len(result.entrants) > 1
        self.figures = [
            name for name in plots.FIGURES if compared or name not in ("relative", "ranking")
        ]

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

    def table(
        self, key: str, heading: Iterable[str], rows: list[list[str]], **values: object
    ) -> Block:
        """A table below these words; what its columns are called, in words where there are some."""
        columns = [self.words.get(cell, cell) for cell in heading]
        return Block("table", self.phrase(key, **values), columns, rows)

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
            rows = [
                [
                    self.title(answer.name),
                    self.words[f"admitted_{answer.verdict}"],
                    self.cause(answer.reason) if answer.reason else answer.says,
                ]
                for answer in self.known
            ]
            yield self.table("admitted_text", ["filter", "admitted_verdict", "admitted_why"], rows)

    def task(self) -> Iterator[Block]:
        model, moves = self.model, self.moves
        yield self.section("task")
        yield self.text("task_text", modes=len(self.modes))
        yield from self.in_modes(self.equations)
        if moves is not None and any(moves.correction):
            yield self.text("stratonovich")
            added = enumerate(moves.correction, 1)
            yield formulas([rf"\Delta a_{i} &= {formula_latex(of, model.x)}" for i, of in added])
        names = dict.fromkeys(name for mode in self.modes for name in mode.values)
        # of each mode; "-" where it has no such parameter
        values = {
            sp.latex(name): [
                number_latex(float(mode.values[name])) if name in mode.values else "-"
                for mode in self.modes
            ]
            for name in names
        }
        common = {name: texts[0] for name, texts in values.items() if len({*texts}) == 1}
        own = {name: texts for name, texts in values.items() if name not in common}
        if common:
            listed = ", ".join(f"${name} = {text}$" for name, text in common.items())
            yield self.text("parameters", values=listed)
        if self.jumps:
            heading = ["$j$", "mode", *(f"${name}$" for name in own)]
            rows = [
                [f"${j + 1}$", name, *(f"${texts[j]}$" for texts in own.values())]
                for j, name in enumerate(model.names)
            ]
            yield self.table("modes_table", heading, rows)
        yield self.text("laws")
        laws = [rf"x_0 &\sim {law(model.prior)}"]
        for symbol, noise in (("v_k", "state_noise"), ("w_k", "meter_noise"))[moves is not None :]:
            each = [law(getattr(mode, noise)) for mode in self.modes]
            if len({*each}) == 1:
                laws.append(rf"{symbol} &\sim {each[0]}")
            else:
                laws += [rf"{symbol}^{{{j}}} &\sim {of}" for j, of in enumerate(each, 1)]
        yield formulas(laws)
        if self.jumps:
            yield self.text("chain")
            chain = (
                rf"\pi &= \left(\mathsf{{P}}(i_{{k+1}} = j \mid i_k = i)\right)_{{ij}} = "
                rf"{sp.latex(model.chain)}"
            )
            yield formulas([chain, rf"q &= {matrix(model.first[None])}"])
        yield self.text("independent")
        yield self.text("find", filters=self.titles(self.result.entrants))

    def in_modes(
        self, make: Callable[[Model], Iterable[Block]], every: str = ""
    ) -> Iterator[Block]:
        """What `make` says of each mode; once if it says the same of all, after the words
        `every`."""
        each = [list(make(mode)) for mode in self.modes]
        if all(blocks == each[0] for blocks in each):
            if every and self.jumps:
                yield self.text(every)
            yield from each[0]
            return
        for j, (name, blocks) in enumerate(zip(self.model.names, each, strict=True), 1):
            yield self.text("in_mode", j=f"$j={j}$", name=name)
            yield from blocks

    def equations(self, mode: Model) -> list[Block]:
        lines = lines_of(mode.latex(values=False, indexed=True))
        if self.moves is None and self.scalar and not self.jumps:  # what a and b are called below
            k = ", k" if mode.timed else ""
            for i, call in enumerate((f"a(x_k, v_k{k})", f"b(x_k, w_k{k})")):
                lines[i] = lines[i].replace("&=", f"&= {call} =", 1)
        return [formulas([*lines, *mode.known.latex("t" if self.moves is None else "t_{k}")])]

    def functions(self) -> Iterator[Block]:
        if self.kinds:
            yield self.section("functions")
            if self.jumps:
                yield self.text("functions_modes")
        for kind in self.kinds:
            yield Block("subsection", self.words[kind])
            yield self.text(f"{kind}_text")
            yield formulas(self.phrase(f"{kind}_formulas").split("\n"))
            yield from self.in_modes(partial(self.derived, kind), "in_every_mode")

    def derived(self, kind: str, mode: Model) -> Iterator[Block]:
        """The five functions of a mode, of a scalar model step by step, with their numbers in the
        catalogue where it has them."""
        if self.scalar:
            yield from getattr(self, kind)(mode)
        try:
            structure: Structure = getattr(Structures.of(mode), kind)
        except NoClosedForm:
            checked = self.structures.quadrature
            assert isinstance(checked, Checked)  # else no filter with these functions takes part
            yield self.text("by_quadrature", order=checked.order)
            return
        yield self.text("result")
        if (lines := printed(structure)) is None:
            yield self.text("not_printed")
            return
        self.derivable.append(kind)
        yield formulas(lines)
        if self.scalar and structure.formulas:
            known = structure.formulas.functions
            numbers = ", ".join(
                f"${FUNCTION_LATEX[name]}$ — {number}"
                for (name, form), number in CATALOGUE.items()
                if name in known and form == str(sp.expand(structure[name]))
            )
            if numbers:
                yield self.text("catalogue", numbers=numbers)

    def linearised(self, model: Model) -> Iterator[Block]:
        """The derivatives of a scalar model."""
        moves = self.moves
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

    def gaussian(self, model: Model) -> Iterator[Block]:
        """The means of a scalar model, step by step."""
        if conditional := self.conditional(model):
            yield self.text("conditional")
            yield formulas(conditional)
        if moments := self.moments(model):
            yield self.text("recursion")
            yield formulas(
                [r"q_0 &= 1,\quad q_1 = m,\quad q_{n+1} = m\,q_n + n\,d\,q_{n-1}", *moments]
            )
        elif not self.structures.quadrature:
            yield self.text("exponentials")

    def conditional(self, model: Model) -> list[str]:
        """Means of a, a^2, b, b^2 over their noise, at a fixed state; a drift has none."""
        lines = []
        for formula, noises, noise, first, second in (
            (model.state_equation[0], model.v, model.state_noise, r"\alpha", r"\gamma"),
            (model.meter_equation[0], model.w, model.meter_noise, r"\beta", r"\eta"),
        )[self.moves is not None :]:
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

    def moments(self, model: Model) -> list[str]:
        """The moments q_2 ... that the meter and the object need, if they are polynomials."""
        (x,), moves = model.x, self.moves
        sides = [model.state_equation[0] ** 2, model.meter_equation[0] ** 2]
        if moves is not None:
            sides[:1] = moves.drift[0], (moves.diffusion * moves.diffusion.T)[0]
        if not all(side.is_polynomial(x) for side in sides):
            return []
        m, d = sp.symbols("m d", real=True)
        law = GaussianMoments([x], [m], sp.Matrix([[d]]))
        highest = max(int(sp.degree(sp.expand(side), x)) for side in sides)
        return [
            f"q_{n} &= {formula_latex(sp.expand(law.mean_of(x**n)), (m, d))}"
            for n in range(2, highest + 1)
        ]

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
            yield Block("subsection", getattr(FAMILIES[family], words["field_of_heading"]))
            if family == "duof":
                yield self.text("criteria")
                yield formulas(self.phrase("criteria_formulas").split("\n"))
            yield formulas(lines_of(equations_latex(EQUATIONS[family])))
            for kind in self.derivable if family == "aof" and self.scalar else ():
                if f"aof-{kind}" in self.result.entrants:
                    yield self.text("written_out", name=self.title(f"aof-{kind}"))
                    yield formulas(written_lines(getattr(self.structures, kind)))
            if family == designed:
                yield self.text("over_ensemble")

    def experiment(self) -> Iterator[Block]:
        result, words = self.result, self.words
        yield self.section("experiment")
        yield self.text(
            "experiment_text", runs=result.runs, steps=result.steps, seed=str(result.seed)
        )
        if result.designed:
            yield self.text("designs", filters=self.titles(result.designed))
        if result.has_bound:
            yield self.text("exact")
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
            key = "table_goes_on" if start else "table"
            yield self.table(key, ["step", *map(self.title, names)], rows)
        yield from self.remarks()
        reference = words["of_exact"] if result.has_bound else self.title(result.control)
        for name in self.figures:
            yield Block(
                "figure", self.phrase(f"figure_{name}", reference=reference, level=LEVEL), [name]
            )
        if "ranking" in self.figures:
            rows = [
                [self.title(name), words["diverges"] if name in result.lost else in_percent(gap)]
                for name, gap in result.ranking()
            ]
            yield self.table("ranking_table", ["filter", "%"], rows, reference=reference)
        if result.scored:
            below = self.phrase("score_below", name=self.title(result.reference))
            rows = [[self.title(name), *score_cells(result, name)] for name in result.names]
            heading = ["filter", "log_score", below, "CRPS"]
            yield self.table("scores_table", heading, rows, level=LEVEL)
        if modes := self.recognised:
            rows = [[self.title(name), in_percent(share)] for name, share in modes.share.items()]
            guess = [words["guess"], f"${100 * modes.guess:.1f}$"]
            yield self.table("share_table", ["filter", "share"], [*rows, guess])
            yield Block("figure", words["figure_modes"], ["modes"])

    def remarks(self) -> Iterator[Block]:
        """What a reader must know before he relies on distances from the bound."""
        result = self.result
        steps = {"rounding": result.without_error, "doubtful": result.doubtful}
        steps["diverged"] = np.any([*result.lost.values()], axis=0)
        for kind, mask in steps.items():
            if mask.any():
                at = self.at(np.flatnonzero(mask).tolist())
                yield self.text(f"remark_{kind}", names=self.titles(result.lost), at=at)

    def left_out(self) -> Iterator[str]:
        """The filters that do not take part, and why, those with the same reason together."""
        names: dict[str, list[str]] = {}
        for name, reason in self.result.left_out.items():
            names.setdefault(self.cause(reason), []).append(name)
        yield from (f"{self.titles(those)}: {reason}" for reason, those in names.items())

    def conclusion(self) -> Iterator[Block]:
        result = self.result
        yield self.section("conclusion")
        if len(result.entrants) == 1:
            yield Block("text", self.mean_sentence(f"alone_{self.zero}"))
            return
        verdicts = result.verdicts()
        yield self.text("verdict_text", level=LEVEL)
        rows = [
            [
                f"${k}$",
                self.title(best),
                self.titles(others) or "–",
                self.title(worst) if worst else "–",
            ]
            for k, (best, others, worst) in ((k, verdicts[k]) for k in table_steps(result))
        ]
        yield self.table("verdict_table", ["step", "best", "not_worse", "worst"], rows)
        yield Block("items", lines=list(self.sentences(verdicts)))

    def sentences(self, verdicts: list[Verdict]) -> Iterator[str]:
        """The conclusion: who leads and who is last, on how many steps, and how far from the
        bound."""
        result, words = self.result, self.words
        alone: dict[str, list[int]] = {}
        for k, (best, others, _) in enumerate(verdicts):
            if not others:
                alone.setdefault(best, []).append(k)
        for name, steps in sorted(alone.items(), key=lambda item: -len(item[1])):
            yield self.phrase("leads", name=self.title(name), at=self.at(steps))
        if not alone:
            yield words["nobody_leads"]
        unsure = [k for k, (_, others, _) in enumerate(verdicts) if others]
        if alone and unsure:  # without a leader it is every step, as has been said
            yield self.phrase("together", at=self.at(unsure))
        last = Counter(worst for _, _, worst in verdicts if worst).most_common(1)
        for name, count in last:
            yield self.phrase("last", name=self.title(name), steps=count, all=result.steps)
        if not last:
            yield words["nobody_last"]
        # the control, or its equal
        leads = not result.has_bound and abs(float(result.ranking()[0][1].value)) < ALIKE
        yield self.mean_sentence("mean_first" if leads else f"mean_{self.zero}")

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

    def cause(self, reason: Reason) -> str:
        return cause(reason, self.model, self.words)

    def title(self, name: str) -> str:
        return title(name, self.words)

    def titles(self, names: Iterable[str]) -> str:
        return ", ".join(map(self.title, names))


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
    return [k for k in SHOWN if k < result.steps - 1] + [result.steps - 1]
