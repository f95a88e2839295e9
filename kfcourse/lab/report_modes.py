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
        names: dict[str, list[str]] = {}
        for name in self.result.entrants:
            known = entry(name)
            averaged = known.functions == "averaged" or known.family == "duof"
            names.setdefault("averaged" if averaged else known.family, []).append(name)
        lines = [
            self.phrase(
                "about_memory" if kind in MEMORIES else f"about_{kind}",
                names=self.titles(names[kind]),
                memory=f"$\\zeta_k = {MEMORIES.get(kind)}$",
            )
            for kind in ("imm", "gpb2", *MEMORIES, "averaged")
            if kind in names
        ]
        if lines:
            yield Block("subsection", words["others"])
            yield Block("items", lines=lines)
