"""The student's report of a model with modes: what they differ in, their chain, functions of each,
the logic-dynamic filter."""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

from kfcourse.errors import NoClosedForm
from kfcourse.filters import latex as equations_latex
from kfcourse.filters.jump_equations import combination, correction, prediction
from kfcourse.filters.optimal_structure import ESTIMATES, MEASUREMENTS
from kfcourse.lab.checked_quadrature import Checked
from kfcourse.lab.report_sections import Block, StudentReport, formulas
from kfcourse.lab.report_text import in_percent, law, lines_of, matrix, printed
from kfcourse.lab.short_names import JUMP_FILTERS, JumpStructures, Structures
from kfcourse.montecarlo.comparison import Comparison
from kfcourse.montecarlo.modes import Recognised
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.writing import number_latex

# What the filters of optimal structure with modes remember.
MEMORIES = {"fos": "z_k", "fkp": MEASUREMENTS.name, "fbp": ESTIMATES.name}


class JumpReport(StudentReport):
    """The report of a model with modes."""

    entries = JUMP_FILTERS

    def __init__(self, result: Comparison, words: dict[str, str], modes: Recognised | None) -> None:
        super().__init__(result, words)
        self.modes = modes
        self.structures: JumpStructures = JumpStructures(self.model)
        best = self.structures.best[0].name  # of the filters whose names do not tell
        self.kinds = [kind for kind in ("linearised", "gaussian") if kind in (*self.kinds, best)]

    @property
    def numbered(self) -> list[tuple[int, str, Model]]:
        """Number from 1, name and model of each mode."""
        return [
            (j, *each)
            for j, each in enumerate(zip(self.model.names, self.model.modes, strict=True), 1)
        ]

    def task(self) -> Iterator[Block]:
        model, words = self.model, self.words
        yield self.section("task")
        yield self.text("task_modes_text", modes=len(model.modes))
        equations = [lines_of(mode.latex(values=False, indexed=True)) for mode in model.modes]
        if all(lines == equations[0] for lines in equations):
            yield formulas(equations[0])
        else:
            for (j, name, _), lines in zip(self.numbered, equations, strict=True):
                yield self.text("in_mode", j=f"$j={j}$", name=name)
                yield formulas(lines)
        names = dict.fromkeys(name for mode in model.modes for name in mode.values)
        values = {name: [mode.values.get(name) for mode in model.modes] for name in names}
        common = [name for name, each in values.items() if len(set(each)) == 1]
        if common:
            listed = ", ".join(
                f"${sp.latex(name)} = {number_latex(float(model.modes[0].values[name]))}$"
                for name in common
            )
            yield self.text("common_parameters", values=listed)
        own = [name for name in names if name not in common]
        heading = ["$j$", words["mode"], *(f"${sp.latex(name)}$" for name in own)]
        rows = [
            [f"${j}$", name, *(_number(mode, key) for key in own)]
            for j, name, mode in self.numbered
        ]
        yield Block("table", words["modes_table"], heading, rows)
        yield self.text("laws")
        lines = [rf"x_0 &\sim {law(model.prior)}"]
        for symbol, noise in (("v_k", "state_noise"), ("w_k", "meter_noise")):
            each = [law(getattr(mode, noise)) for mode in model.modes]
            same = all(text == each[0] for text in each)
            lines += (
                [rf"{symbol} &\sim {each[0]}"]
                if same
                else [rf"{symbol}^{{{j}}} &\sim {text}" for j, text in enumerate(each, 1)]
            )
        yield formulas(lines)
        yield self.text("chain")
        chain = (
            rf"\pi &= \left(\mathsf{{P}}(i_{{k+1}} = j \mid i_k = i)\right)_{{ij}} = "
            rf"{sp.latex(model.chain)}"
        )
        yield formulas([chain, rf"q &= {matrix(model.first[None])}"])
        yield self.text("independent")
        yield self.text("find_modes", filters=", ".join(map(self.title, self.result.entrants)))

    def functions(self) -> Iterator[Block]:
        words = self.words
        yield self.section("functions")
        yield self.text("functions_modes")
        for kind in self.kinds:
            yield from self.defined(kind)
            names = [
                self.phrase("in_mode", j=f"$j={j}$", name=name) for j, name, _ in self.numbered
            ]
            each = [self.functions_in(mode, kind) for _, _, mode in self.numbered]
            if all(block == each[0] for block in each):
                names, each = [words["in_every_mode"]], each[:1]
            for text, block in zip(names, each, strict=True):
                yield Block("text", text)
                yield block

    def functions_in(self, mode: Model, kind: str) -> Block:
        """The structural functions of a mode, or why they are not printed."""
        try:
            lines = printed(Structures(mode), kind)
        except NoClosedForm:
            checked = self.structures.quadrature
            assert isinstance(checked, Checked)  # else no filter with these functions takes part
            return self.text("by_quadrature", order=checked.order)
        return self.text("not_printed") if lines is None else formulas(lines)

    def filters(self) -> Iterator[Block]:
        words, size = self.words, len(self.model.modes)
        mean, cov = self.model.prior
        yield self.section("filters")
        yield self.text("start_modes")
        start = [
            rf"\lambda_0^j &= m_0 = {matrix(mean[:, None])},\qquad \Psi_0^j = D_0 = "
            rf"{matrix(cov)},\qquad c_0^j = q_j"
        ]
        yield formulas(start)
        yield Block("subsection", words["logic_dynamic"])
        for key, equations in (
            ("in_each_mode", correction("j", size)),
            ("merged", combination("j", size)),
            ("ahead", prediction("j", size)),
        ):
            yield self.text(key)
            yield formulas(lines_of(equations_latex(equations)))
        of_memory = dict.fromkeys(MEMORIES, "about_memory")
        about = {
            "imm": "about_imm",
            "gpb2": "about_gpb2",
            **of_memory,
            "averaged": "about_averaged",
        }
        titles: dict[str, list[str]] = {}
        for name in self.result.entrants:
            entry = self.entries[name]
            averaged = entry.functions == "averaged" or entry.family == "duof"
            titles.setdefault("averaged" if averaged else entry.family, []).append(self.title(name))
        lines = [
            self.phrase(
                text, names=", ".join(titles[key]), memory=f"$\\zeta_k = {MEMORIES.get(key)}$"
            )
            for key, text in about.items()
            if key in titles
        ]
        if lines:
            yield Block("subsection", words["others"])
            yield Block("items", lines=lines)

    def experiment(self) -> Iterator[Block]:
        yield from super().experiment()
        if self.modes is None:
            return
        rows = [[self.title(name), in_percent(share)] for name, share in self.modes.share.items()]
        guess = [self.words["guess"], f"${100 * self.modes.guess:.1f}$"]
        yield Block(
            "table",
            self.words["share_table"],
            [self.words["filter"], self.words["share"]],
            [*rows, guess],
        )
        yield Block("figure", self.words["figure_modes"], ["modes"])


def _number(mode: Model, name: sp.Symbol) -> str:
    """A parameter's value in a mode, if it is one there."""
    return f"${number_latex(float(mode.values[name]))}$" if name in mode.values else "–"
