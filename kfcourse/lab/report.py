"""The report of the lab (отчёт по лабораторной работе), in English or Russian: from the task to the
conclusion.

`write_report` writes report.html (opens in any browser, without a network), report.tex and their
figures; `write_json` the
numbers.  The words of both languages are in report.toml; formulas, numbers and verdicts come from
the model and the comparison (`report_sections`; with modes `report_modes`).
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import jinja2
import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from kfcourse.files import replacing_together, save
from kfcourse.filters import Design, Filter
from kfcourse.lab import plots
from kfcourse.lab.admission import Admission
from kfcourse.lab.families import WORDS
from kfcourse.lab.report_modes import JumpReport
from kfcourse.lab.report_sections import LEVEL, StudentReport
from kfcourse.lab.report_text import escape_tex, inline_html, inline_tex
from kfcourse.lab.short_names import title
from kfcourse.lab.variants import Variant
from kfcourse.montecarlo.comparison import ALIKE, Comparison
from kfcourse.montecarlo.modes import Recognised, recognised
from kfcourse.montecarlo.statistics import Estimate
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.markup import mathml

LANGUAGES = tuple(WORDS)
RECOGNISED = 400  # trajectories on which modes are told: shares are good to some thousandths
# the line's own &
ALIGNMENT = re.compile(r"(?P<inner>\\begin\{(?P<kind>\w+)\}.*?\\end\{(?P=kind)\})|&", re.DOTALL)
_UNDATED: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}


def write_report(
    variant: Variant,
    result: Comparison,
    folder: Path,
    language: str = "en",
    known: Sequence[Admission] = (),
    modes: Recognised | None = None,
) -> list[Path]:
    """Write report.tex, report.html and their figures, all of them or none; returns the paths.

    `known` are the filters that the model may admit, of which the report has a table; `modes` are
    the `recognised_modes`.
    """
    report = _report(result, language, known, modes)
    content = {
        "blocks": list(report.blocks()),
        "words": report.words,
        "variant": variant,
        "language": language,
    }
    drawn = {name: partial(plots.FIGURES[name], result) for name in report.figures}
    if modes:
        drawn["modes"] = partial(plots.mode_probabilities, modes)
    with replacing_together(folder) as place:
        for name, draw in drawn.items():
            save_figure(partial(draw, words=report.words), place, name)
        save_texts(("report.html", "report.tex"), place, content)
        return [folder / path.name for path in place.iterdir()]


def _report(
    result: Comparison,
    language: str = "en",
    known: Sequence[Admission] = (),
    modes: Recognised | None = None,
) -> StudentReport:
    jumps = isinstance(result.model, JumpModel)
    return (JumpReport if jumps else StudentReport)(result, WORDS[language], known, modes)


def remarks_in_words(result: Comparison) -> list[str]:
    """What a reader must know before he relies on distances from the bound, for a terminal."""
    return [block.text.replace("$", "") for block in _report(result).remarks()]


def save_figure(draw: Callable[[Axes], object], folder: Path, name: str) -> None:
    """A figure for the page and for LaTeX, its legend below it, where no curve runs; the same
    numbers give the same files."""
    figure = Figure(figsize=(7, 4.2), layout="constrained")
    ax = figure.add_subplot()
    draw(ax)
    if legend := ax.get_legend():
        legend.remove()
        figure.legend(
            *ax.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize="small"
        )
    with matplotlib.rc_context({"svg.hashsalt": name}):  # else its marks have random names
        for kind, metadata in _UNDATED.items():
            figure.savefig(folder / f"{name}.{kind}", format=kind, metadata=metadata)
            figure.set_layout_engine(None)  # has been laid out


def save_texts(names: Sequence[str], folder: Path, content: Mapping[str, Any]) -> None:
    """The files made from the templates NAME.j2."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("kfcourse.lab"),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    escape = jinja2.filters.do_forceescape
    own = {"mathml": _mathml, "tex": escape_tex, "html": escape, "inline": inline_html}
    environment.filters |= own | {"inline_tex": inline_tex}
    for name in names:
        text = environment.get_template(name + ".j2").render(content)
        (folder / name).write_text(text, encoding="utf-8")


def write_json(variant: Variant, result: Comparison, path: Path) -> Path:
    """Write the numbers, for programs: lists over the steps, keyed by the filters' short names."""

    def lists(
        estimate: Callable[[str], Estimate],
        part: str = "value",
        names: Sequence[str] = result.names,
    ) -> dict[str, Any]:
        return {name: getattr(estimate(name), part).tolist() for name in names}

    ranking = [name for name, _ in result.ranking()]
    data: dict[str, Any] = {
        "variant": variant.name,
        "model": variant.table,
        "runs": result.runs,
        "steps": result.steps,
        "seed": result.seed,
        "left_out": {name: str(reason) for name, reason in result.left_out.items()},
        "error_variance": lists(result.error_variance),
        "standard_error": lists(result.error_variance, "standard_error"),
        "error_mean": lists(result.error_mean),
        "own_variance": lists(result.own_variance),
        "score": {name: _number(result.score(name)) for name in ranking},
    }
    for kind in ("log_score", "crps") if result.scored else ():
        data[kind] = lists(getattr(result, kind))
        data[f"{kind}_standard_error"] = lists(getattr(result, kind), "standard_error")
    if result.has_bound:
        data["above_bound"] = lists(result.gap, names=result.entrants)
        data["above_bound_standard_error"] = lists(result.gap, "standard_error", result.entrants)
        data["mean_above_bound"] = {name: _number(result.mean_gap(name)) for name in ranking}
    # infinite and undefined numbers as null: JSON has none
    text = json.dumps(json.loads(json.dumps(data), parse_constant=lambda _: None), indent=1)
    save(text, path)
    return path


def _number(estimate: Estimate) -> dict[str, float]:
    return {"value": float(estimate.value), "standard_error": float(estimate.standard_error)}


def conclusions(result: Comparison) -> list[str]:
    """The ranking in sentences: each filter against the next, significant or not.

    In per cent of the bound, the exact AOF's error variance; without it, of the control's.  Filters
    that diverge are left out.
    """
    ranked = [name for name, _ in result.ranking() if name not in result.lost]
    sentences = []
    for better, worse in pairwise(ranked):
        difference = result.mean_gap_difference(worse, better)
        low, high = (100 * float(limit) for limit in difference.interval())
        if max(-low, high) < 100 * ALIKE:  # filters that coincide, as on a linear model
            sentences.append(f"{title(better)} and {title(worse)} are the same but for rounding.")
            continue
        verdict = (
            "is more accurate than" if low > 100 * ALIKE else "is not significantly different from"
        )
        sentences.append(
            f"{title(better)} {verdict} {title(worse)}: "
            f"{_three_digits(100 * float(difference.value))} % "
            f"({LEVEL} confidence: {_three_digits(low)} to {_three_digits(high)} %)."
        )
    return sentences


def _three_digits(value: float) -> str:
    """Three digits, and no power of ten."""
    return np.format_float_positional(value, 3, fractional=False, trim="-")


def recognised_modes(result: Comparison, filters: Sequence[Filter | Design]) -> Recognised | None:
    """What those of the filters compared that carry probabilities of modes know of them; None of a
    model without modes.

    A filter that cannot go on tells nothing.
    """
    model = result.model
    if not isinstance(model, JumpModel):
        return None
    known = [filter_ for filter_ in filters if filter_.name in result.names]
    runs = min(result.runs, RECOGNISED)
    modes = recognised(known, model, runs, result.steps, result.seed)
    return modes if modes.share else None


def _mathml(line: str) -> str:
    """One line of an aligned block as MathML, which browsers show without any script; columns of
    its matrices stay apart."""
    return mathml(ALIGNMENT.sub(lambda match: match["inner"] or "", line))
