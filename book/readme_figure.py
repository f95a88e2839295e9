"""The figure of README.md: the lab's filters of variant 53 against each other (`make figure`)."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt

from kfcourse import compare, lab_filters
from kfcourse.lab.plots import accuracy, relative_accuracy
from kfcourse.lab.variants import LAB, find_variant

model = find_variant("53").model
result = compare(lab_filters(model, [*LAB, "aof-exact"]), model, runs=400_000, steps=31, seed=1, subset_runs=64)
figure, axes = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
accuracy(result, axes[0], names=[*LAB, "aof-exact"])
relative_accuracy(result, axes[1], names=[name for name in LAB if name != "aof-gaussian"], steps=slice(0, 13))
figure.savefig(Path(__file__).with_name("readme-figure.png"), dpi=90)
