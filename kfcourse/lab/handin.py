"""The student's report (отчёт по лабораторной работе), in English or Russian: from the task to the conclusion.

`write_handin` writes handin.tex, handin.html and their figures.  The words of both languages are in handin.toml; formulas,
numbers and verdicts come from the model and the comparison (`handin_sections`, `handin_plain`; with modes `handin_modes`).
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from functools import partial
from importlib import resources
from pathlib import Path

from matplotlib.axes import Axes

from kfcourse.files import replacing_together
from kfcourse.lab import plots
from kfcourse.lab.handin_modes import JumpReport
from kfcourse.lab.handin_plain import PlainReport
from kfcourse.lab.handin_text import inline_html, inline_tex
from kfcourse.lab.report import save_figure, save_texts
from kfcourse.lab.variants import Variant
from kfcourse.montecarlo.comparison import Comparison
from kfcourse.montecarlo.modes import Recognised
from kfcourse.symbolic.jumping import JumpModel

LANGUAGES = ("en", "ru")


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


def write_handin(
    variant: Variant, result: Comparison, folder: Path, language: str, modes: Recognised | None = None
) -> list[Path]:
    """Write handin.tex, handin.html and their figures, all of them or none; returns the paths.

    `modes` are the `recognised_modes`.

    Raises
    ------
    ValueError
        An unknown language.
    """
    if language not in LANGUAGES:
        raise ValueError(f"the report is written in {' or '.join(LANGUAGES)}, not {language!r}")
    words = tomllib.loads((resources.files("kfcourse.lab") / "handin.toml").read_text(encoding="utf-8"))[language]
    with_modes = isinstance(result.model, JumpModel)
    report = JumpReport(result, words, modes) if with_modes else PlainReport(result, words)
    content = {"blocks": list(report.blocks()), "words": words, "variant": variant, "language": language}
    labels = plots.Words(report.title, **{part: words[f"axis_{part}"] for part in plots.Words._fields[1:]})
    with replacing_together(folder) as place:
        for name in report.figures:
            save_figure(partial(FIGURES[name], result, words=labels), place, f"handin-{name}")
        if modes:
            save_figure(partial(plots.mode_probabilities, modes, words=labels), place, "handin-modes")
        save_texts(("handin.html", "handin.tex"), place, content, inline=inline_html, inline_tex=inline_tex)
        return [folder / path.name for path in place.iterdir()]
