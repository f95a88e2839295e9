"""New variants, proposed from a grammar of state and meter equations and kept if they are well posed.

::

    scalar  ->  x' = DRIFT + OBJECT_NOISE,   y = SIGNAL + METER_NOISE
    vector  ->  x1' = x1 + T*x2,  x2' = x2 + T*(FORCE) + s*v1,   y = VECTOR_METERS

A `Piece` is a formula with the ranges of its parameters.  The i-th candidate of a seed draws from a stream of its own, so the
same seed proposes the same variants, whatever the number of processes.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress, islice
from typing import Any, NamedTuple

import joblib
import numpy as np
from tqdm import tqdm

from kfcourse.lab.quality import Ask, Quality, examine
from kfcourse.lab.variant_tables import RUNS
from kfcourse.lab.variants import Variant, read_variant
from kfcourse.montecarlo.batches import FEWEST

VECTORS = 0.1  # probability of a vector model
SCREEN = 10  # a candidate is first tried on that many times fewer trajectories
SHAPES = 50  # up to so many variants all formulas are different; each so many more allow one more repetition
PATIENCE = 20  # candidates for each variant wanted, before it is given up
REASONS = {
    "bounded": "not bounded",
    "observable": "not observable",
    "filters differ": "filters hardly differ",
    "solvable": "not solvable",
}


class Piece(NamedTuple):
    """A part of an equation: in words, as a formula, the range of each of its parameters, and how often it is chosen."""

    words: str
    formula: str
    ranges: Mapping[str, tuple[float, float]]
    weight: float = 1


DRIFT = (
    Piece("linear object", "c*x", {"c": (0.7, 0.98)}, 3),
    Piece("linear object with a mean", "c*x + r", {"c": (0.7, 0.95), "r": (0.2, 1.0)}),
    Piece("sine in the object", "x + c*sin(x)", {"c": (-0.8, -0.2)}),
    Piece("linear object with a sine", "c*x + h*sin(x)", {"c": (0.5, 0.8), "h": (0.1, 0.4)}),
    Piece("linear object with a cosine", "c*x + h*cos(x)", {"c": (0.6, 0.9), "h": (0.2, 0.6)}),
    Piece("cubic damping of the object", "c*x - h*x**3", {"c": (0.9, 1.05), "h": (0.02, 0.06)}),
    Piece("object with two wells", "x + h*(x - x**3)", {"h": (0.05, 0.15)}),
    Piece("quadratic object", "c*x + h*x**2", {"c": (0.6, 0.9), "h": (0.01, 0.05)}),
)
OBJECT_NOISE = (
    Piece("additive noise", "e*v", {"e": (0.1, 0.4)}, 4),
    Piece("multiplicative noise", "e*x*v", {"e": (0.03, 0.3)}, 2),
    Piece("noise that grows with the state", "e*(1 + k*x)*v", {"e": (0.1, 0.3), "k": (0.2, 0.6)}),
    Piece("noise that depends on the state's phase", "e*cos(x)*v", {"e": (0.2, 0.5)}),
    Piece("multiplicative and additive noise", "e*x*v1 + s*v2", {"e": (0.05, 0.3), "s": (0.1, 0.3)}),
)
SIGNAL = (
    Piece("linear meter", "g*x", {"g": (0.7, 1.5)}, 3),
    Piece("square meter with a linear part", "g*x + q*x**2", {"g": (0.7, 1.2), "q": (0.1, 0.4)}),
    Piece("cubic meter", "g*x + q*x**3", {"g": (0.7, 1.2), "q": (0.05, 0.2)}),
    Piece("sine meter (a phase)", "g*sin(x)", {"g": (0.7, 1.5)}),
    Piece("exponential meter", "g*exp(q*x)", {"g": (0.7, 1.2), "q": (0.3, 0.6)}),
    Piece("square meter", "g*x**2", {"g": (0.5, 1.2)}),
)
METER_NOISE = (
    Piece("additive noise", "f*w", {"f": (0.2, 0.8)}, 5),
    Piece("multiplicative noise", "f*x*w", {"f": (0.05, 0.5)}),
    Piece("quadratic noise", "f*x**2*w", {"f": (0.02, 0.3)}),
    Piece("noise that grows with the square", "f*(1 + x**2)*w", {"f": (0.1, 0.4)}),
    Piece("noise whose level is the state", "f*exp(b*x)*w", {"f": (0.2, 0.6), "b": (0.2, 0.6)}),
)
FORCE = (
    Piece("linear oscillator", "-k*x1 - b*x2", {"k": (0.5, 2.0), "b": (0.1, 0.5)}),
    Piece("pendulum", "-k*sin(x1) - b*x2", {"k": (0.5, 2.0), "b": (0.1, 0.5)}),
    Piece("Duffing oscillator", "-k*x1 - h*x1**3 - b*x2", {"k": (0.5, 1.5), "h": (0.2, 1.0), "b": (0.1, 0.5)}),
    Piece("van der Pol oscillator", "m*(1 - x1**2)*x2 - x1", {"m": (0.2, 0.8)}),
)
VECTOR_METERS = (
    Piece("position measured", "x1 + r*w1", {"r": (0.1, 0.4)}),
    Piece("sine of the position measured", "sin(x1) + r*w1", {"r": (0.1, 0.3)}),
    Piece("position measured by a cubic meter", "x1 + g*x1**3 + r*w1", {"g": (0.1, 0.3), "r": (0.1, 0.4)}),
    Piece("velocity measured", "x2 + r*w1", {"r": (0.1, 0.4)}),
    Piece("position measured, the better the nearer", "x1 + r*(1 + x1**2)*w1", {"r": (0.05, 0.2)}),
)


@dataclass(frozen=True)
class Generated:
    """What a seed gave.

    Attributes
    ----------
    variants : tuple of Variant
    qualities : tuple of Quality
        Of each variant.
    rejected : Counter
        Reason to number of candidates.
    """

    variants: tuple[Variant, ...]
    qualities: tuple[Quality, ...]
    rejected: Counter[str]

    def toml(self) -> str:
        """The variants as the text of a file that `load_variants` reads."""
        return "\n".join(map(_table, self.variants, self.qualities))


def propose(seed: int, index: int) -> dict[str, Any]:
    """The table of a candidate, such as a file of variants holds; nothing is checked yet."""
    rng = np.random.default_rng([seed, index])
    return _vector(rng) if rng.random() < VECTORS else _scalar(rng)


def _scalar(rng: np.random.Generator) -> dict[str, Any]:
    drift, noise, signal, error = (_one(rng, pieces) for pieces in (DRIFT, OBJECT_NOISE, SIGNAL, METER_NOISE))
    return {
        "title": f"{drift.words}, {noise.words}; {signal.words}, {error.words}",
        "state": f"{drift.formula} + {noise.formula}",
        "meter": f"{signal.formula} + {error.formula}",
        "parameters": _parameters(rng, drift, noise, signal, error),
        "prior": {"mean": float(rng.choice([0.0, 0.0, 0.5, 1.0])), "variance": _rounded(rng.uniform(0.2, 1.0))},
    }


def _vector(rng: np.random.Generator) -> dict[str, Any]:
    force, meter = _one(rng, FORCE), _one(rng, VECTOR_METERS)
    step = Piece("", "", {"T": (0.05, 0.2), "s": (0.05, 0.3)})
    variances = [_rounded(rng.uniform(0.1, 0.4)) for _ in range(2)]
    return {
        "title": f"{force.words}, {meter.words}",
        "state": ["x1 + T*x2", f"x2 + T*({force.formula}) + s*v1"],
        "meter": [meter.formula],
        "parameters": _parameters(rng, step, force, meter),
        "prior": {"mean": [_rounded(rng.uniform(0.2, 1.0)), 0.0], "variance": variances},
    }


def _one(rng: np.random.Generator, pieces: Sequence[Piece]) -> Piece:
    weights = np.array([piece.weight for piece in pieces])
    return pieces[int(rng.choice(len(pieces), p=weights / weights.sum()))]


def _parameters(rng: np.random.Generator, *pieces: Piece) -> dict[str, float]:
    return {name: _rounded(rng.uniform(*limits)) for piece in pieces for name, limits in piece.ranges.items()}


def _rounded(value: float) -> float:
    """Two significant digits: numbers to type."""
    return float(f"{value:.2g}")


def _table(variant: Variant, quality: Quality) -> str:
    """A variant's table in TOML, how hard it is as a comment."""
    hard = f"# {quality.hardness.level}, hardness {quality.hardness.score:.1f}\n" if quality.hardness else ""
    lines = "".join(f"{key} = {_value(value)}\n" for key, value in variant.table.items())
    return f"{hard}[variants.{variant.name}]\n{lines}"


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(one)}" for key, one in value.items()) + " }"
    return json.dumps(value)  # strings, numbers and lists of them are written alike in JSON and TOML


def generate(wanted: int, seed: int = 1, runs: int = RUNS, jobs: int = 2, ask: Ask | None = None) -> Generated:
    """Well-posed variants g1, g2, ...: candidates in order, without those that fail a criterion or repeat formulas.

    Parameters
    ----------
    wanted : int
    seed : int
    runs : int
        Trajectories of each check, see `kfcourse.lab.quality.examine`; a tenth of them for a first one.
    jobs : int
        Processes; no result depends on it.
    ask : callable, optional
        As in `examine`.

    Returns
    -------
    Generated
        With fewer variants, if 20 candidates for each are not enough.

    Raises
    ------
    ValueError
        Numbers that are not positive, a negative seed, too few trajectories.
    """
    if wanted < 1 or jobs < 1 or runs < FEWEST:
        raise ValueError(f"expected at least 1 variant, 1 job and {FEWEST} trajectories, got {wanted}, {jobs} and {runs}")
    found: list[tuple[Variant, Quality]] = []
    rejected: Counter[str] = Counter()
    shapes: Counter[str] = Counter()
    most = 1 + wanted // SHAPES
    chunk = jobs if jobs == 1 else 3 * jobs  # what is judged at once; of the last ones some may be in vain
    candidates = (propose(seed, index) for index in range(PATIENCE * wanted))
    with joblib.Parallel(n_jobs=jobs) as parallel, tqdm(desc="generating", total=wanted, unit="variant", disable=None) as bar:
        while len(found) < wanted and (tables := list(islice(candidates, chunk))):
            new = [shapes[_shape(table)] < most for table in tables]
            judged = iter(parallel(joblib.delayed(_judge)(table, runs, seed, ask) for table in compress(tables, new)))
            qualities = [next(judged) if examined else None for examined in new]
            for table, quality in zip(tables, qualities, strict=True):
                if len(found) == wanted:
                    break
                if quality is None or shapes[_shape(table)] >= most:
                    rejected["formulas of another one"] += 1
                elif reason := _reason(quality):
                    rejected[reason] += 1
                else:
                    shapes[_shape(table)] += 1
                    name = f"g{len(found) + 1}"
                    found.append((read_variant(name, table, "the grammar"), replace(quality, name=name)))
                    bar.update()
    return Generated(tuple(one for one, _ in found), tuple(quality for _, quality in found), rejected)


def _shape(table: Mapping[str, Any]) -> str:
    """The formulas, without the parameters' values."""
    return json.dumps([table["state"], table["meter"]])


def _judge(table: Mapping[str, Any], runs: int, seed: int, ask: Ask | None) -> Quality:
    """A candidate's quality: from few trajectories if these show that it is none, else from all, with the exercises."""
    variant = read_variant("candidate", table, "the grammar")
    first = examine(variant, max(runs // SCREEN, FEWEST), seed)
    return first if _reason(first) else examine(variant, runs, seed, ask)


def _reason(quality: Quality) -> str:
    """Why a candidate is rejected; empty if it is not.  Stricter than `well_posed`: linear and fragile ones are too."""
    if quality.linear:
        return "linear"
    if quality.faults:
        return REASONS[next(iter(quality.faults))]
    return "fragile" if quality.fragile else ""
