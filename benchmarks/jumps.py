"""What filters that know modes cost, as ratios measured side by side in one run.

    .venv/bin/python benchmarks/jumps.py [--runs 5000] [--steps 10] [--repeats 5]

For each shipped variant with modes the processor time of each filter, over that of the plain AOF of
its first mode, and over that of the AOF of the average of the modes.  Of J modes a filter cannot do
with less than J corrections, and J^2 is what one would expect that predicts from each mode to each.
The plain AOF of a linear scalar mode is no fair measure: its gain is the same for all trajectories,
so that it multiplies and adds, while each likelihood of a mode takes an exponential.
"""

from __future__ import annotations

import argparse
import time

from engine import best

from kfcourse import JumpModel, NoClosedForm, simulate
from kfcourse.filters import Filter, aof
from kfcourse.lab.short_names import JUMP_FILTERS, Structures
from kfcourse.lab.variants import read_variants
from kfcourse.laws import Array

FILTERS = ("aof-jump-gaussian", "aof-jump-linearised", "imm", "gpb2")


def run_all(filter_: Filter, y: Array) -> None:
    state = filter_.init(y.shape[1])
    for measured in y:
        state = filter_.step(state, measured)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=5000)
    parser.add_argument("--steps", type=int, default=10)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    for name, variant in read_variants()[0].items():
        model = variant.model
        if not isinstance(model, JumpModel):
            continue
        structures, y = (
            Structures(model),
            simulate(model, options.runs, options.steps, seed=1).y,
        )

        def cost(filter_: Filter, y: Array = y) -> float:
            return best(lambda: run_all(filter_, y), options.repeats, time.process_time)

        plain = cost(aof(structures.best[0]))
        averaged = None if model.by_state else cost(JUMP_FILTERS["aof-averaged"].build(structures))
        head = (
            f"{name}: {len(model.modes)} modes, n = {model.n}; plain AOF "
            f"{1e6 * plain / options.steps:.0f} us a step"
        )
        print(f"{head} of {options.runs} trajectories")
        for short in FILTERS:
            try:
                spent = cost(JUMP_FILTERS[short].build(structures))
            except NoClosedForm:
                continue
            beside = f", {spent / averaged:4.1f} AOFs of the average" if averaged else ""
            print(f"  {short:<20} {spent / plain:5.1f} plain AOFs{beside}")


if __name__ == "__main__":
    main()
