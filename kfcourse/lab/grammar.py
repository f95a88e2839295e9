"""New variants, proposed from a grammar of state and meter equations and kept if they are well
posed.

::

    scalar  ->  x' = drift + object_noise,   y = signal + meter_noise
    vector  ->  x1' = x1 + T*x2,  x2' = x2 + T*(force) + s*v1,   y = vector_meters

grammar.toml has the pieces, with the ranges of their parameters.  The i-th candidate of a seed
draws from a stream of its own, so the same seed proposes the same variants, whatever the number of
processes.
"""

from __future__ import annotations

import json
import tomllib
from collections import Counter
from collections.abc import Mapping
from importlib import resources
from itertools import islice
from typing import Any, NamedTuple

import joblib
import numpy as np
from tqdm import tqdm

from kfcourse.lab.quality import Ask, Quality, examine
from kfcourse.lab.variants import RUNS, Variant, read_variant
from kfcourse.montecarlo import FEWEST

PIECES = tomllib.loads(
    (resources.files("kfcourse.lab") / "grammar.toml").read_text(encoding="utf-8")
)
SCREEN = 10  # a candidate is first tried on that many times fewer trajectories: most are none
SHAPES = 50  # up to so many variants all formulas are different; each so many more repeat once more
PATIENCE = 20  # candidates for each variant wanted, before it is given up


class Generated(NamedTuple):
    """The variants of a seed, and how many candidates were rejected by which criterion."""

    variants: list[Variant]
    rejected: Counter[str]

    def toml(self) -> str:
        """The variants as the text of a file that `load_variants` reads."""
        return "\n".join(
            f"[variants.{variant.name}]\n"
            + "".join(f"{key} = {_value(value)}\n" for key, value in variant.table.items())
            for variant in self.variants
        )


def propose(seed: int, index: int) -> dict[str, Any]:
    """The table of a candidate, such as a file of variants holds; nothing is checked yet."""
    rng = np.random.default_rng([seed, index])

    def pieces(*kinds: str) -> list[list[Any]]:
        weights = [np.array([weight for *_, weight in PIECES[kind]]) for kind in kinds]
        return [
            PIECES[kind][rng.choice(len(each), p=each / each.sum())]
            for kind, each in zip(kinds, weights, strict=True)
        ]

    def uniform(low: float, high: float) -> float:
        return float(f"{rng.uniform(low, high):.2g}")  # numbers to type

    if rng.random() < 0.1:  # of ten candidates one is a vector
        force, meter = chosen = pieces("force", "vector_meters")
        ranges = {"T": (0.05, 0.2), "s": (0.05, 0.3)}
        means, variances = [uniform(0.2, 1.0), 0.0], [uniform(0.1, 0.4), uniform(0.1, 0.4)]
        body = {
            "title": f"{force[0]}, {meter[0]}",
            "state": ["x1 + T*x2", f"x2 + T*({force[1]}) + s*v1"],
            "meter": [meter[1]],
            "prior": {"mean": means, "variance": variances},
        }
    else:
        chosen = pieces("drift", "object_noise", "signal", "meter_noise")
        (drift, noise, signal, error), ranges = chosen, {}
        mean, variance = float(rng.choice([0.0, 0.0, 0.5, 1.0])), uniform(0.2, 1.0)
        body = {
            "title": f"{drift[0]}, {noise[0]}; {signal[0]}, {error[0]}",
            "state": f"{drift[1]} + {noise[1]}",
            "meter": f"{signal[1]} + {error[1]}",
            "prior": {"mean": mean, "variance": variance},
        }
    for piece in chosen:
        ranges |= piece[2]
    return body | {"parameters": {name: uniform(*limits) for name, limits in ranges.items()}}


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(part)}" for key, part in value.items()) + " }"
    return json.dumps(value)  # strings, numbers and lists of them are the same in JSON and TOML


def generate(
    wanted: int, seed: int = 1, runs: int = RUNS, jobs: int = 2, ask: Ask | None = None
) -> Generated:
    """Well-posed variants g1, g2, ...: candidates in order, without those that repeat formulas.

    Parameters
    ----------
    wanted : int
    seed : int
    runs : int
        Trajectories of each check, see `kfcourse.lab.quality.examine`; a tenth for a first one.
    jobs : int
        Processes; no result depends on it.
    ask : callable, optional
        As in `examine`.

    Returns
    -------
    Generated
        With fewer variants, if 20 candidates for each are not enough.
    """
    variants: list[Variant] = []
    rejected: Counter[str] = Counter()
    shapes: Counter[str] = Counter()
    tables = (propose(seed, index) for index in range(PATIENCE * wanted))
    bar = tqdm(desc="generating", total=wanted, unit="variant", disable=None)
    with joblib.Parallel(n_jobs=jobs) as parallel, bar:
        while len(variants) < wanted and (chunk := list(islice(tables, 4 * jobs))):
            judged = parallel(joblib.delayed(_judge)(table, runs, seed, ask) for table in chunk)
            for table, quality in zip(chunk, judged, strict=True):
                shape = json.dumps([table["state"], table["meter"]])
                if len(variants) == wanted:
                    break
                if reason := "linear" if quality.linear else next(iter(quality.faults), ""):
                    rejected[reason] += 1
                elif shapes[shape] > wanted // SHAPES:
                    rejected["formulas of another one"] += 1
                else:
                    shapes[shape] += 1
                    name = f"g{len(variants) + 1}"
                    variants.append(read_variant(name, table, "the grammar"))
                    bar.update()
    return Generated(variants, rejected)


def _judge(table: Mapping[str, Any], runs: int, seed: int, ask: Ask | None) -> Quality:
    """A candidate's quality: the last one of up to three ensembles, the first of them small."""
    variant = read_variant("candidate", table, "the grammar")
    trials = ((max(runs // SCREEN, FEWEST), seed, None), (runs, seed, ask), (runs, seed + 1, None))
    for trial in trials:  # what another ensemble shows to be none is fragile
        quality = examine(variant, *trial)
        if quality.linear or not quality.well_posed:
            break
    return quality
