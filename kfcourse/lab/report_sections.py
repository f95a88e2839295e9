"""What all reports have: pieces, the comparison, the conclusion (`report_plain`, `report_modes`:
what comes before)."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from kfcourse.lab.admission import Admission
from kfcourse.lab.report_text import cause, filled, in_percent, power_of_ten, ranges
from kfcourse.lab.short_names import FILTERS, Entry
from kfcourse.laws import CONFIDENCE
from kfcourse.montecarlo.comparison import EXACT, Comparison, Verdict

ROUNDING = 1e-6  # per cent: equal filters may have lost half of their digits on the way
LEVEL = f"{100 * CONFIDENCE:g} %"
COLUMNS = 4  # filters side by side in a table, so that it fits a page
FIGURES = ("accuracy", "relative", "ranking", "consistency")


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
    """The blocks of the report, section by section; a subclass has the task, the functions and the
    filters."""

    entries: Mapping[str, Entry] = FILTERS  # where filters have their names from

    def __init__(self, result: Comparison, words: dict[str, str]) -> None:
        self.result, self.words = result, words
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
        return (
            filled(self.words[key], self.words["thousands"], **values)
            if values
            else self.words[key]
        )

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
        """The equations, the laws, and what is asked for."""
        raise NotImplementedError

    def functions(self) -> Iterator[Block]:
        """The structural functions."""
        raise NotImplementedError

    def defined(self, kind: str) -> Iterator[Block]:
        """The heading of a kind of structural functions, and what they are."""
        yield Block("subsection", self.words[kind])
        yield self.text(f"{kind}_text")
        yield formulas(self.words[f"{kind}_formulas"].split("\n"))

    def filters(self) -> Iterator[Block]:
        """The equations of the filters."""
        raise NotImplementedError

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
            gaps = [
                words["diverges"] if name in result.lost else in_percent(gap)
                for name, gap in result.ranking()
            ]
            rows = [
                [self.title(name), gap]
                for (name, _), gap in zip(result.ranking(), gaps, strict=True)
            ]
            yield Block(
                "table",
                self.phrase("ranking_table", reference=reference),
                [words["filter"], "%"],
                rows,
            )

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
        if len(result.entrants) == 1:
            yield self.section("conclusion")
            yield Block(
                "text", self.mean_sentence("alone_bound" if result.has_bound else "alone_control")
            )
            return
        verdicts = result.verdicts()
        yield self.section("conclusion")
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


def table_steps(result: Comparison) -> list[int]:
    """The first steps and then some, to the last."""
    steps = [
        k
        for k in (0, 1, 2, 3, 4, 5, 7, 10, 15, 20, 30, 50, 100, 200, 500, 1000)
        if k < result.steps
    ]
    return steps if steps[-1] == result.steps - 1 else [*steps, result.steps - 1]
