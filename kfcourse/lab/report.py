"""The report of the lab: what a student hands in, computed.

`write_report` puts into one folder: report.html (opens in any browser, without a network), report.tex
(the same for LaTeX) and the figures of both.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
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
from kfcourse.filters import EQUATIONS, Design, Filter
from kfcourse.filters import latex as equations_latex
from kfcourse.lab import plots
from kfcourse.lab.admission import Admission, admissions
from kfcourse.lab.families import FAMILIES, family
from kfcourse.lab.short_names import FILTERS, JUMP_FILTERS, WITH_MODES, JumpStructures, Structures, title
from kfcourse.lab.variants import Variant
from kfcourse.laws import CONFIDENCE, Array
from kfcourse.limits import OutOfTime, time_limit
from kfcourse.montecarlo.comparison import EXACT, HEAVY, Comparison
from kfcourse.montecarlo.modes import SLOW, Recognised, recognised
from kfcourse.montecarlo.statistics import Estimate, ratio
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.markup import mathml
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import NoClosedForm
from kfcourse.symbolic.writing import by_thousands

LEVEL = f"{100 * CONFIDENCE:g} %"
_FIGURES: dict[str, tuple[str, Callable[[Comparison, Axes], Axes]]] = {
    "accuracy": ("Error variance of each filter against the step.", plots.accuracy),
    "relative": (
        f"How far the error variance is above the exact filter's (if that was left out, the control's), with {LEVEL} bands.",
        plots.relative_accuracy,
    ),
    "ranking": (f"The mean of the same over the steps, with {LEVEL} confidence intervals.", plots.ranking),
    "consistency": ("Normalised squared error: 1 if the filter's own covariance is right.", plots.consistency),
}


FORMULAS = 60.0  # seconds that each kind of structural functions may take
RECOGNISED = 1600  # trajectories on which modes are told
LONGEST = 40_000  # characters of LaTeX: some ten pages


@dataclass(frozen=True)
class Section:
    """A heading and its displayed formulas, as the lines of a LaTeX `aligned` block ("left &= right")."""

    title: str
    lines: list[str]

    @classmethod
    def of(cls, title: str, block: str) -> Section:
        body = re.sub(r"\\(begin|end)\{aligned\}", "", block)
        return cls(title, [line.strip() for line in body.split("\\\\\n")])


def write_report(
    variant: Variant,
    result: Comparison,
    folder: Path,
    notes: Sequence[str] = (),
    known: Sequence[Admission] = (),
    modes: Recognised | None = None,
) -> list[Path]:
    """Write report.html, report.tex and the figures, all of them or none; returns the paths.

    `notes` stand before the remarks: why there are so few trajectories, how to repeat the comparison.  Filters of which it is
    `known` whether the model admits them are not looked at again; `modes` are the `recognised_modes`.
    """
    with replacing_together(folder) as place:
        for name, (_, draw) in _FIGURES.items():
            save_figure(partial(draw, result), place, name)
        if modes:
            save_figure(partial(plots.mode_probabilities, modes), place, "modes")
        save_texts(("report.html", "report.tex"), place, _content(variant, result, notes, known, modes))
        return [folder / path.name for path in place.iterdir()]


def save_figure(draw: Callable[[Axes], Axes], folder: Path, name: str) -> None:
    """A figure for the page and for LaTeX, its legend below it, where no curve runs; the same numbers give the same files."""
    figure = Figure(figsize=(7, 4.2), layout="constrained")
    ax = figure.add_subplot()
    draw(ax)
    if legend := ax.get_legend():
        legend.remove()
        figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize="small")
    with matplotlib.rc_context({"svg.hashsalt": name}):  # else its marks have random names
        for kind, metadata in _UNDATED.items():
            figure.savefig(folder / f"{name}.{kind}", format=kind, metadata=metadata)
            figure.set_layout_engine("none")  # has been laid out


def save_texts(names: Sequence[str], folder: Path, content: Mapping[str, Any], **filters: Callable[[str], str]) -> None:
    """The files made from the templates NAME.j2; the templates may use further filters."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("kfcourse.lab"), trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    own = {"mathml": _mathml, "tex": escape_tex, "html": jinja2.filters.do_forceescape, "thousands": by_thousands}
    environment.filters |= own | filters
    for name in names:
        (folder / name).write_text(environment.get_template(name + ".j2").render(content), encoding="utf-8")


_UNDATED: dict[str, dict[str, Any]] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}


def write_json(variant: Variant, result: Comparison, path: Path) -> Path:
    """Write the numbers, for programs: lists over the steps, keyed by the filters' short names."""
    estimates = {name: result.error_variance(name) for name in result.available}
    data: dict[str, Any] = {
        "variant": variant.name,
        "model": _model_in_numbers(result.model),
        "runs": result.runs,
        "steps": result.steps,
        "seed": result.seed,
        "slow_runs": result.slow_runs,
        "left_out": {name: str(reason) for name, reason in result.left_out.items()},
        "by_particles": {name: str(reason) for name, reason in result.replaced.items()},
        "error_variance": {name: e.value.tolist() for name, e in estimates.items()},
        "standard_error": {name: e.standard_error.tolist() for name, e in estimates.items()},
        "error_mean": {name: result.error_mean(name).value.tolist() for name in result.available},
        "own_variance": {name: result.own_variance(name).value.tolist() for name in result.available},
        "score": {name: _number(result.score(name)) for name, _ in result.ranking()},
        "designs": result.designs,
    }
    if result.has_bound:
        above = {name: result.gap(name) for name in result.entrants}
        data["above_bound"] = {name: e.value.tolist() for name, e in above.items()}
        data["above_bound_standard_error"] = {name: e.standard_error.tolist() for name, e in above.items()}
        data["mean_above_bound"] = {name: _number(gap) for name, gap in result.ranking()}
    if result.replicas:
        data["design_deviation"] = {name: result.design_error(name).value.tolist() for name in result.replicas.names}
    text = json.dumps(_finite(data), indent=1, allow_nan=False)
    if str(path) in ("-", "/dev/stdout"):
        print(text, flush=True)
    else:
        save(text, path)
    return path


def _model_in_numbers(model: Model | JumpModel) -> dict[str, Any]:
    if isinstance(model, JumpModel):
        modes = {name: _model_in_numbers(mode) for name, mode in zip(model.names, model.modes, strict=True)}
        return {
            "modes": modes,
            "transition": [[str(one) for one in row] for row in model.chain.tolist()],
            "first": model.first.tolist(),
        }
    return {
        "state": [str(f) for f in model.state_equation],
        "meter": [str(f) for f in model.meter_equation],
        "parameters": {name: float(value) for name, value in model.parameters.items()},
        "inputs": {name: list(values) for name, values in model.known.inputs.items()},
        "interval": float(model.known.interval),
    }


ROUNDING = 1e-6  # per cent: equal filters may have lost half of their digits on the way


def conclusions(result: Comparison, confidence: float = CONFIDENCE) -> list[str]:
    """The ranking in sentences: each filter against the next, significant or not at the confidence.

    In per cent of the bound, the exact AOF's error variance; without it, of the control's.  Filters that diverge are left out.
    """
    ranked = [name for name, _ in result.ranking() if name not in result.lost]
    sentences = []
    for better, worse in pairwise(ranked):
        difference = result.mean_gap_difference(worse, better)
        low, high = (100 * float(limit) for limit in difference.interval(confidence))
        if max(-low, high) < ROUNDING:  # filters that coincide, as on a linear model
            sentences.append(f"{title(better)} and {title(worse)} are the same but for rounding.")
            continue
        verdict = "is more accurate than" if low > ROUNDING else "is not significantly different from"
        sentences.append(
            f"{title(better)} {verdict} {title(worse)}: {_three_digits(100 * float(difference.value))} % "
            f"({100 * confidence:g} % confidence: {_three_digits(low)} to {_three_digits(high)} %)."
        )
    return sentences


def _three_digits(value: float) -> str:
    """Three digits, or all before the point; a power of ten only for what is beyond all measure."""
    if abs(value) >= 1e12:
        return f"{value:.3g}"
    return f"{value:.0f}" if abs(value) >= 1000 else np.format_float_positional(value, 3, fractional=False, trim="-")


def recognised_modes(result: Comparison, filters: Sequence[Filter | Design]) -> Recognised | None:
    """What those of the filters compared that carry probabilities of modes know of them; None of a model without modes.

    The exact filter tells only if it came through as many trajectories in its time.
    """
    model = result.model
    if not isinstance(model, JumpModel):
        return None
    runs = min(result.runs, RECOGNISED)
    short = {EXACT} if result.slow_runs < runs // SLOW else set()
    names = {name for name in result.available if name in WITH_MODES and name not in {*result.replaced, *short}}
    of_modes = [one for one in filters if isinstance(one, Filter) and one.name in names]
    return recognised(of_modes, model, runs, result.steps, result.seed) if of_modes else None


def _content(
    variant: Variant, result: Comparison, notes: Sequence[str], known: Sequence[Admission], modes: Recognised | None
) -> dict[str, Any]:
    # the bound before those that it bounds
    names = tuple(sorted(result.available, key=lambda name: name != EXACT))
    entries = JUMP_FILTERS if isinstance(result.model, JumpModel) else FILTERS
    compared = [name for name in result.entrants if result.has_bound or name != result.control]
    return {
        "variant": variant,
        "result": result,
        "left_out": [(title(name), reason) for name, reason in result.left_out.items()],
        "replaced": [(title(name), reason) for name, reason in result.replaced.items()],
        "admissions": [(title(one.name), one.verdict, one.says) for one in admissions(result.model, None, FORMULAS, known)],
        "model": Section.of("Model", result.model.latex()),
        "structures": _structure_sections(result.model, names),
        "equations": _equation_sections(names),
        "names": [
            (name, title(name) + (", the bound" if name == EXACT else ""), entries[name].russian if name in entries else "")
            for name in names
        ],
        "table": _table(result, [_cells(result, name) for name in names]),
        "remarks": [*notes, *remarks_in_words(result)],
        "compared": [title(name) for name in compared],
        "gaps": _table(result, [[percent(one) for one in result.gap(name)] for name in compared]) if compared else [],
        "ranking": [
            (
                title(name),
                percent(mean) if name not in result.lost else "diverges",
                _between_designs(result, name),
            )
            for name, mean in result.ranking()
        ],
        "reference": title(EXACT if result.has_bound else result.control),
        "conclusions": conclusions(result),
        "modes": [] if modes is None else [(title(name), percent(share)) for name, share in modes.share.items()],
        "guess": "" if modes is None else f"{100 * modes.guess:.1f}",
        "figures": [(name, caption) for name, (caption, _) in _FIGURES.items()]
        + ([] if modes is None else [("modes", plots.OF_MODES)]),
        "control": title(result.control),
    }


def _structure_sections(model: Model | JumpModel, names: tuple[str, ...]) -> list[Section]:
    if isinstance(model, JumpModel):
        used = {*names, JumpStructures(model).best[0].name}  # of the filters whose names do not tell
        each = [(f"Mode {name}, ", Structures(mode)) for name, mode in zip(model.names, model.modes, strict=True)]
        return [Section.of(text + kind, printed(one, kind)) for kind in _kinds(used) for text, one in each]
    structures, kinds = Structures(model), _kinds(names)
    return [Section.of(kind.capitalize(), printed(structures, kind)) for kind in kinds]


def _kinds(names: Collection[str]) -> list[str]:
    return [kind for kind in ("gaussian", "linearised") if any(name.endswith(kind) for name in names)]


NO_FORMULAS = "No closed form: by quadrature, of the order told under Which filters this model admits."


def printed(structures: Structures, kind: str) -> str:
    """The formulas in LaTeX, if they can be found and read."""
    try:
        with time_limit(FORMULAS):
            block = getattr(structures, kind).latex()
    except OutOfTime:
        return rf"\text{{They are not written within {FORMULAS:g} s.}}"
    except NoClosedForm:
        return rf"\text{{{NO_FORMULAS}}}"
    return block if len(block) <= LONGEST else rf"\text{{They are too long to print: {len(block)} characters of LaTeX.}}"


def _equation_sections(names: tuple[str, ...]) -> list[Section]:
    families = dict.fromkeys(map(family, names))
    return [Section.of(FAMILIES[one].heading, equations_latex(EQUATIONS[one])) for one in families if one in EQUATIONS]


ALIGNMENT = re.compile(r"(?P<inner>\\begin\{(?P<kind>\w+)\}.*?\\end\{(?P=kind)\})|&", re.DOTALL)  # the line's own &

# What a reader must know before he relies on distances from the bound, by kind.
REMARKS = {
    "rounding": "At {steps} the errors are zero but for the rounding of numbers as large as the states: nothing is told of them, "
    "and means leave these steps out.",
    "doubtful": "At {steps} there is no bound: what ran in the place of the exact AOF errs by more than a tenth of its variance "
    "itself, or another filter is more accurate. Means leave these steps out.",
    "diverged": "{names}: at {steps} D_k is more than a hundred times that of the most accurate filter, and a few trajectories "
    "make it: on these the filtering diverges. How much worse it is no number here tells; rank the other filters.",
    "heavy": "{names}: at {steps} the accuracy rests on a few rare trajectories: a single one makes up to {part} % of the sum. "
    "The interval there cannot be trusted; about {runs} trajectories, {exact} of them with the exact AOF, would do.",
    "skewed": "{names}: at {steps} the accuracy rests on a few rare trajectories. "
    "The interval there cannot be trusted; about {runs} trajectories, {exact} of them with the exact AOF, would do.",
    "heavy_alone": "{names}: at {steps} the accuracy rests on a few rare trajectories: a single one makes up to {part} % of the "
    "sum. The interval there cannot be trusted; about {runs} trajectories would do.",
    "skewed_alone": "{names}: at {steps} the accuracy rests on a few rare trajectories. "
    "The interval there cannot be trusted; about {runs} trajectories would do.",
}


def remarks(result: Comparison) -> Iterator[tuple[str, dict[str, Any]]]:
    """Kinds of `REMARKS` that this comparison needs, with what is put into the words: steps as a mask, names of filters."""
    if result.without_error.any():
        yield "rounding", {"steps": result.without_error}
    if result.doubtful.any():
        yield "doubtful", {"steps": result.doubtful}
    gaps = {name: result.gap(name) for name in result.entrants}
    bad = {name: result.usable & ~result.trusted(gap, name) for name, gap in gaps.items()}
    if result.lost:
        yield "diverged", {"names": [*result.lost], "steps": np.any([*result.lost.values()], axis=0)}
        bad = {name: steps for name, steps in bad.items() if name not in result.lost}
    if names := [name for name, steps in bad.items() if steps.any()]:
        part = max(float(result.heavy(name)[bad[name]].max()) for name in names)
        more = max(result.missing(gaps[name], name) for name in names)
        runs, exact = (int(float(f"{more * one:.1g}")) for one in (result.runs, result.slow_runs))
        told = {"part": f"{100 * part:.0f}", "runs": runs, "exact": exact}
        kind = ("heavy" if part > HEAVY else "skewed") + ("" if result.has_bound else "_alone")
        yield kind, {"names": names, "steps": np.any([bad[name] for name in names], axis=0), **told}


def remarks_in_words(result: Comparison) -> list[str]:
    """The remarks as sentences."""
    return [
        by_thousands(REMARKS[kind].format(**values | {"names": names, "steps": _at(values["steps"])}))
        for kind, values in remarks(result)
        for names in [", ".join(map(title, values.get("names", ())))]
    ]


def _at(chosen: Array) -> str:
    """step 2; steps 0–1, 3–50."""
    numbers = np.flatnonzero(chosen).tolist()
    return f"step{'s' if len(numbers) > 1 else ''} {ranges(numbers)}"


def ranges(steps: Sequence[int], one: str = "{}") -> str:
    """1, 3–5, 8: runs of steps joined, each number written as `one`."""
    parts: list[list[int]] = []
    for k in steps:
        if parts and k == parts[-1][1] + 1:
            parts[-1][1] = k
        else:
            parts.append([k, k])
    return ", ".join(one.format(a) if a == b else f"{one.format(a)}–{one.format(b)}" for a, b in parts)


def percent(part: Estimate) -> str:
    """A part and its standard error in per cent, the latter with two digits: "1.19 ± 0.40"; "–" where there is none."""
    if np.isnan(part.value):
        return "–"
    value, error = 100 * float(part.value), 100 * float(part.standard_error)
    places = int(np.clip(1 - np.floor(np.log10(error)), 0, 6)) if np.isfinite(error) and error > 0 else 2
    return f"{value:.{places}f} ± {error:.{places}f}"


def _between_designs(result: Comparison, name: str) -> str:
    """How much D_k varies from one design to another: mean over the steps of its deviation, in per cent of D_k."""
    if not result.replicas or name not in result.replicas.names:
        return ""
    variance = result.error_variance(name).value
    return f"{100 * float(np.mean(ratio(result.design_error(name).value, variance, 0.0))):.2g}"


def _number(estimate: Estimate) -> dict[str, float]:
    return {"value": float(estimate.value), "standard_error": float(estimate.standard_error)}


def table_steps(result: Comparison) -> list[int]:
    """The first steps and then some, to the last."""
    steps = [k for k in (0, 1, 2, 3, 4, 5, 7, 10, 15, 20, 30, 50, 100, 200, 500, 1000) if k < result.steps]
    return steps if steps[-1] == result.steps - 1 else [*steps, result.steps - 1]


def _table(result: Comparison, columns: list[list[str]]) -> list[tuple[int, list[str]]]:
    """Rows (step, cells) of columns (steps,)."""
    return [(k, [column[k] for column in columns]) for k in table_steps(result)]


def _cells(result: Comparison, name: str) -> list[str]:
    """D_k of a filter by step, 0 where it is rounding."""
    estimates = result.error_variance(name)
    return ["0" if abs(one.value) <= least else _cell(one) for one, least in zip(estimates, result.rounding, strict=True)]


def _cell(estimate: Estimate) -> str:
    """A value and its standard error on one power of ten: "6.510 ± 0.040 · 1e-4"."""
    value, error, power = on_one_power(estimate)
    return f"{value:g}" if power is None else f"{value:.3f} ± {error:.3f} · 1e{power:d}"


def on_one_power(estimate: Estimate) -> tuple[float, float, int | None]:
    """Value and standard error over the power of ten of the value, and that power; None for zero and what is not finite."""
    value, error = float(estimate.value), float(estimate.standard_error)
    if not (np.isfinite(value) and value):
        return value, error, None
    power = int(np.floor(np.log10(abs(value))))
    return value / 10.0**power, error / 10.0**power, power


def _mathml(line: str) -> str:
    """One line of an aligned block as MathML, which browsers show without any script; columns of its matrices stay apart."""
    return mathml(ALIGNMENT.sub(lambda found: found["inner"] or "", line))


def escape_tex(text: str) -> str:
    """Plain text for LaTeX."""
    special = {"\\": r"\textbackslash{}", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", "±": r"$\pm$", "·": r"$\cdot$"}
    return re.sub(r"[#$%&_{}\\^~±·]", lambda found: special.get(found[0], "\\" + found[0]), text)


def _finite(data: Any) -> Any:
    """Infinite and undefined numbers as null: JSON has none."""
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list):
        return [_finite(value) for value in data]
    return data if not isinstance(data, float) or np.isfinite(data) else None
