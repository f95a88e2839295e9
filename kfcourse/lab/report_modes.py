"""The student's report of a model with modes: what they differ in, their chain, functions of each,
the logic-dynamic filter."""

from __future__ import annotations

from collections.abc import Iterator

from kfcourse.filters import latex as equations_latex
from kfcourse.filters.jump_equations import combination, correction, prediction
from kfcourse.filters.optimal_structure import ESTIMATES, MEASUREMENTS
from kfcourse.lab.report_sections import Block, StudentReport, formulas
from kfcourse.lab.report_text import lines_of, matrix
from kfcourse.lab.short_names import entry

# What the filters of optimal structure with modes remember.
MEMORIES = {"fos": "z_k", "fkp": MEASUREMENTS.name, "fbp": ESTIMATES.name}


class JumpReport(StudentReport):
    """The report of a model with modes: its filters are others."""

    def filters(self) -> Iterator[Block]:
        words, size = self.words, len(self.modes)
        mean, cov = self.model.prior
        yield self.section("filters")
        yield self.text("start")
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
            known = entry(name)
            averaged = known.functions == "averaged" or known.family == "duof"
            titles.setdefault("averaged" if averaged else known.family, []).append(self.title(name))
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
