"""The student's report (отчёт по лабораторной работе), in English or Russian: from the task to the conclusion.

`write_handin` writes handin.tex, handin.html and their figures.  The words of both languages are in handin.toml; formulas,
numbers and verdicts come from the model and the comparison.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from importlib import resources
from pathlib import Path

import numpy as np
import sympy as sp
from matplotlib.axes import Axes

from kfcourse.files import replacing_together
from kfcourse.filters import EQUATIONS
from kfcourse.filters import latex as equations_latex
from kfcourse.lab import plots
from kfcourse.lab.checked_quadrature import Checked
from kfcourse.lab.families import FAMILIES, family
from kfcourse.lab.handin_text import filled, in_percent, inline_html, inline_tex, law, lines_of, matrix, power_of_ten
from kfcourse.lab.refusals import cause
from kfcourse.lab.report import LEVEL, printed, ranges, remarks, save_figure, save_texts, table_steps
from kfcourse.lab.short_names import FILTERS, Structures
from kfcourse.lab.variants import Variant
from kfcourse.lab.written_out import written_lines
from kfcourse.montecarlo.comparison import EXACT, Comparison, Verdict
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import GaussianMoments, NoClosedForm
from kfcourse.symbolic.reading import exact_matrix
from kfcourse.symbolic.structure import FUNCTION_LATEX
from kfcourse.symbolic.writing import formula_latex, number_latex

LANGUAGES = ("en", "ru")
HIGHEST = 8  # moment that is printed
COLUMNS = 4  # filters side by side in a table, so that it fits a page

# Numbers in the school's catalogue of structural functions, for the forms whose numbers the course gives.
CATALOGUE = {
    ("tau", "c*z"): 2,
    ("Theta", "c**2*p + e**2*z**2"): 15,
    ("Theta", "c**2*p + e**2*p + e**2*z**2"): 22,
    ("h", "g*m"): 5,
    ("G", "g"): 8,
    ("F", "d*g**2 + f**2*m**4"): 16,
    ("F", "3*d**2*f**2 + 6*d*f**2*m**2 + d*g**2 + f**2*m**4"): 20,
}


def _known_errors(result: Comparison, ax: Axes, words: plots.Words) -> Axes:
    """The normalised errors, between a half and two: rare far trajectories reach beyond."""
    plots.consistency(result, ax, names=result.entrants, words=words).set_ylim(0.5, 2)
    ax.set_yticks([0.5, 1, 2], ["0.5", "1", "2"])
    ax.set_yticks([], minor=True)
    return ax


FIGURES: dict[str, Callable[..., Axes]] = {
    "accuracy": plots.accuracy,
    "relative": plots.relative_accuracy,
    "ranking": plots.ranking,
    "consistency": _known_errors,
}


@dataclass(frozen=True)
class Block:
    """A piece of the report, of a kind: section, subsection, text, items, formulas, table or figure."""

    kind: str
    text: str = ""
    lines: list[str] = field(default_factory=list)
    rows: list[list[str]] = field(default_factory=list)


def write_handin(variant: Variant, result: Comparison, folder: Path, language: str) -> list[Path]:
    """Write handin.tex, handin.html and their figures, all of them or none; returns the paths.

    Raises
    ------
    ValueError
        An unknown language, or a variant with modes, which the report's text does not know.
    """
    if language not in LANGUAGES:
        raise ValueError(f"the report is written in {' or '.join(LANGUAGES)}, not {language!r}")
    words = tomllib.loads((resources.files("kfcourse.lab") / "handin.toml").read_text(encoding="utf-8"))[language]
    variant.plain("student's reports")
    report = _Report(result, words)
    content = {"blocks": list(report.blocks()), "words": words, "variant": variant, "language": language}
    labels = plots.Words(report.title, **{part: words[f"axis_{part}"] for part in plots.Words._fields[1:]})
    with replacing_together(folder) as place:
        for name in report.figures:
            save_figure(partial(FIGURES[name], result, words=labels), place, f"handin-{name}")
        save_texts(("handin.html", "handin.tex"), place, content, inline=inline_html, inline_tex=inline_tex)
        return [folder / path.name for path in place.iterdir()]


class _Report:
    """The blocks of the report, section by section."""

    def __init__(self, result: Comparison, words: dict[str, str]) -> None:
        self.result, self.words = result, words
        assert isinstance(result.model, Model)  # `write_handin` has said so
        self.model = result.model
        self.structures = Structures(self.model)
        self.kinds = [kind for kind in ("linearised", "gaussian") if any(name.endswith(kind) for name in result.available)]

        self.derivable: list[str] = []  # kinds whose formulas are found in time, and are not too long
        compared = result.has_bound or len(result.entrants) > 1
        self.figures = [name for name in FIGURES if compared or name not in ("relative", "ranking")]

    def blocks(self) -> Iterator[Block]:
        """The whole report; the words that SymPy puts into formulas in its language, too."""
        for block in self.sections():
            lines = [self.translated(line) for line in block.lines]
            yield dataclasses.replace(block, text=self.translated(block.text), lines=lines)

    def translated(self, text: str) -> str:
        for english, key in ((r"\text{for}", "if"), (r"\text{otherwise}", "else")):
            text = text.replace(english, rf"\text{{{self.words[key]}}}")
        return text

    def sections(self) -> Iterator[Block]:
        yield from self.task()
        if self.kinds:
            yield Block("section", self.words["functions"])
        for kind in self.kinds:
            yield from getattr(self, kind)()
            yield from self.derived(kind)
        yield from self.filters()
        yield from self.experiment()
        yield from self.conclusion()

    def task(self) -> Iterator[Block]:
        model, words = self.model, self.words
        yield Block("section", words["task"])
        yield Block("text", words["task_text"])
        state, *others = lines_of(model.latex(values=False, indexed=True))
        if model.n == model.p == 1:  # what a and b are called below
            meter, *others = others
            k = ", k" if model.timed else ""
            state = state.replace("&=", f"&= a(x_k, v_k{k}) =", 1)
            others = [meter.replace("&=", f"&= b(x_k, w_k{k}) =", 1), *others]
        yield Block("formulas", lines=[state, *others])
        values = ", ".join(f"${sp.latex(name)} = {number_latex(float(value))}$" for name, value in model.values.items())
        if values:
            yield Block("text", filled(words["parameters"], values=values))
        laws = (("x_0", model.prior), ("v_k", model.state_noise), ("w_k", model.meter_noise))
        yield Block("formulas", lines=[rf"{name} &\sim {law(one)}" for name, one in laws])
        yield Block("text", words["independent"])
        yield Block("text", filled(words["find"], filters=", ".join(self.title(name) for name in self.result.entrants)))

    def linearised(self) -> Iterator[Block]:
        model, words = self.model, self.words
        yield Block("subsection", words["linearised"])
        yield Block("text", words["linearised_text"])
        yield Block("formulas", lines=words["linearised_formulas"].split("\n"))
        if model.n == model.p == 1:
            sides = ((model.state_equation[0], model.v, "a", "v"), (model.meter_equation[0], model.w, "b", "w"))
            derivatives = [
                rf"\frac{{\partial {letter}}}{{\partial {by}}} &= {formula_latex(formula.diff(symbol), model.x, noises)}"
                for formula, noises, letter, noise in sides
                for by, symbol in [("x", model.x[0]), *([(noise, noises[0])] if len(noises) == 1 else [])]
            ]
            yield Block("text", words["derivatives"])
            yield Block("formulas", lines=derivatives)

    def gaussian(self) -> Iterator[Block]:
        model, words = self.model, self.words
        yield Block("subsection", words["gaussian"])
        yield Block("text", words["gaussian_text"])
        yield Block("formulas", lines=words["gaussian_formulas"].split("\n"))
        if model.n == model.p == 1:
            if conditional := self.conditional():
                yield Block("text", words["conditional"])
                yield Block("formulas", lines=conditional)
            if moments := self.moments():
                yield Block("text", words["recursion"])
                yield Block("formulas", lines=[r"q_0 &= 1,\quad q_1 = m,\quad q_{n+1} = m\,q_n + n\,d\,q_{n-1}", *moments])
            elif not self.structures.quadrature:
                yield Block("text", words["exponentials"])

    def conditional(self) -> list[str]:
        """Means of a, a^2, b, b^2 over their noise, at a fixed state."""
        model, lines = self.model, []
        for formula, noises, noise, first, second in (
            (model.state_equation[0], model.v, model.state_noise, r"\alpha", r"\gamma"),
            (model.meter_equation[0], model.w, model.meter_noise, r"\beta", r"\eta"),
        ):
            over = GaussianMoments(list(noises), list(exact_matrix(noise.mean)), sp.Matrix(exact_matrix(noise.cov)))
            for letter, power in ((first, 1), (second, 2)):
                try:
                    mean = sp.expand(over.mean_of(formula**power))
                except NoClosedForm:
                    continue  # the mean over noise and state together has a closed form, this one has none
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
        return [f"q_{n} &= {formula_latex(sp.expand(law.mean_of(x**n)), (m, d))}" for n in range(2, highest + 1)]

    def derived(self, kind: str) -> Iterator[Block]:
        """The five functions, with their numbers in the catalogue where it has them."""
        if kind == "gaussian" and isinstance(found := self.structures.quadrature, Checked):
            yield Block("text", filled(self.words["by_quadrature"], order=found.order))
            return
        block = printed(self.structures, kind)
        yield Block("text", self.words["result"])
        if FUNCTION_LATEX["tau"] not in block:
            yield Block("text", self.words["not_printed"])
            return
        self.derivable.append(kind)
        yield Block("formulas", lines=lines_of(block))
        if self.model.n == self.model.p == 1:
            structure = getattr(self.structures, kind)
            forms = {name: (name, str(sp.expand(structure[name]))) for name in FUNCTION_LATEX}
            numbers = [f"${FUNCTION_LATEX[name]}$ — {CATALOGUE[form]}" for name, form in forms.items() if form in CATALOGUE]
            if numbers:
                yield Block("text", filled(self.words["catalogue"], numbers=", ".join(numbers)))

    def filters(self) -> Iterator[Block]:
        words = self.words
        yield Block("section", words["filters"])
        yield Block("text", words["start"])
        mean, cov = self.model.prior
        yield Block("formulas", lines=[rf"\lambda_0 &= m_0 = {matrix(mean[:, None])},\qquad \Psi_0 = D_0 = {matrix(cov)}"])
        families = dict.fromkeys(map(family, self.result.entrants))
        designed = next((one for one in families if one != "aof"), "")
        for one in (one for one in families if one in EQUATIONS):
            heading = FAMILIES[one].russian_heading if words["language"] == "ru" else FAMILIES[one].heading
            yield Block("subsection", heading)
            if one == "duof":
                yield Block("text", words["criteria"])
                yield Block("formulas", lines=words["criteria_formulas"].split("\n"))
            yield Block("formulas", lines=lines_of(equations_latex(EQUATIONS[one])))
            if one == "aof" and self.model.n == self.model.p == 1:
                for name in (f"aof-{kind}" for kind in self.derivable if f"aof-{kind}" in self.result.entrants):
                    yield Block("text", filled(words["written_out"], name=self.title(name)))
                    yield Block("formulas", lines=written_lines(getattr(self.structures, name.removeprefix("aof-"))))
            if one == designed:
                yield Block("text", words["over_ensemble"])

    def experiment(self) -> Iterator[Block]:
        result, words = self.result, self.words
        yield Block("section", words["experiment"])
        sentences = [filled(words["experiment_text"], runs=result.runs, steps=result.steps, seed=result.seed)]
        if result.replicas:
            designed = ", ".join(map(self.title, result.replicas.names))
            sentences.append(filled(words["designs"], filters=designed, designs=result.designs))
        if result.has_bound:
            sentences.append(filled(words["exact"], runs=result.subset_runs))
        yield Block("text", " ".join(sentences))
        if result.left_out:
            yield Block("text", words["left_out"])
            yield Block("items", lines=list(self.left_out()))
        for start in range(0, len(result.available), COLUMNS):
            names = result.available[start : start + COLUMNS]
            estimates = [result.error_variance(name) for name in names]
            rows = [[f"${k}$", *(power_of_ten(one[k]) for one in estimates)] for k in table_steps(result)]
            yield Block("table", words["table_goes_on" if start else "table"], ["$k$", *map(self.title, names)], rows)
        for kind, values in remarks(result):
            whose = ", ".join(map(self.title, values.get("names", ())))
            told = values | {"names": whose, "at": self.at(np.flatnonzero(values["steps"]).tolist())}
            yield Block("text", filled(words[f"remark_{kind}"], **told))
        reference = words["of_exact"] if result.has_bound else self.title(result.control)
        for name in self.figures:
            yield Block("figure", filled(words[f"figure_{name}"], reference=reference, level=LEVEL), [f"handin-{name}"])

    def left_out(self) -> Iterator[str]:
        """The filters that do not take part, and why, those with the same reason together."""
        names: dict[str, list[str]] = {}
        for name, reason in self.result.left_out.items():
            names.setdefault(cause(reason, self.model, self.words), []).append(self.title(name))
        yield from (f"{', '.join(titles)}: {reason}" for reason, titles in names.items())

    def conclusion(self) -> Iterator[Block]:
        result, words = self.result, self.words
        if len(result.entrants) == 1:
            yield Block("section", words["conclusion"])
            yield Block("text", self.mean_sentence("alone_bound" if result.has_bound else "alone_control"))
            return
        verdicts = result.verdicts()
        yield Block("section", words["conclusion"])
        yield Block("text", filled(words["verdict_text"], level=LEVEL))
        heading = [words[key] for key in ("step", "best", "not_worse", "worst")]
        rows = [
            [f"${k}$", self.title(best), ", ".join(map(self.title, others)) or "–", self.title(worst) if worst else "–"]
            for k, (best, others, worst) in ((k, verdicts[k]) for k in table_steps(result))
        ]
        yield Block("table", words["verdict_table"], heading, rows)
        yield Block("items", lines=list(self.sentences(verdicts)))

    def sentences(self, verdicts: list[Verdict]) -> Iterator[str]:
        """The conclusion: who leads and who is last, on how many steps, and how far from the bound."""
        result, words = self.result, self.words
        alone = [best for best, others, _ in verdicts if not others]
        for name in sorted(set(alone), key=lambda one: -alone.count(one)):
            steps = [k for k, (best, others, _) in enumerate(verdicts) if best == name and not others]
            yield filled(words["leads"], name=self.title(name), at=self.at(steps))
        if not alone:
            yield words["nobody_leads"]
        unsure = [k for k, (_, others, _) in enumerate(verdicts) if others]
        if unsure:
            yield filled(words["together"], at=self.at(unsure))
        last = [worst for _, _, worst in verdicts if worst]
        if last:
            name = max(set(last), key=lambda one: (last.count(one), one))
            yield filled(words["last"], name=self.title(name), steps=last.count(name), all=result.steps)
        else:
            yield words["nobody_last"]
        leads = not result.has_bound and result.ranking()[0][0] == result.control
        yield self.mean_sentence("mean_first" if leads else "mean_bound" if result.has_bound else "mean_control")

    def at(self, steps: list[int]) -> str:
        """At step 2; at steps 0–1, 3–50."""
        return filled(self.words["at_step" if len(steps) == 1 else "at_steps"], where=ranges(steps, "${}$"))

    def mean_sentence(self, key: str) -> str:
        """How far the first filter and the last are from the bound, or from the control."""
        result = self.result
        ranked = result.ranking()
        (first, gap), (final, largest) = ranked[0], ranked[-1]
        return filled(
            self.words[key],
            first=self.title(first),
            gap=in_percent(gap),
            last=self.title(final),
            largest=in_percent(largest),
            control=self.title(result.control),
        )

    def title(self, name: str) -> str:
        entry = FILTERS[name]
        exact = self.words["exact_title"] if name == EXACT else ""
        return exact or (entry.russian if self.words["language"] == "ru" else entry.title)
