"""The picture of the front page and of README.md: the lab's filters of variant 53 above the best
possible one (`make figure`).

Its text stays text, in the fonts of the page that shows it.  On the screen the front page has a map
of other noises too (`front.py`), whose numbers are computed here.
"""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np

from kfcourse import compare, lab_filters
from kfcourse.lab import LAB
from kfcourse.lab.plots import style
from kfcourse.lab.variants import find_variant
from kfcourse.pages.figures import label_ends
from kfcourse.pages.scenes import leading

PICTURE = Path(__file__).with_name("front-figure.svg")
SHOWN = {
    "duof": "DUOF",
    "fos-gaussian": "GFOS",
    "mfos-linearised": "LMFOS",
    "aof-linearised": "LAOF",
    "aof-gaussian": "GAOF",
}
STEPS = slice(0, 11)
MAP = Path(__file__).with_name("front-map.json")
RATIOS = (0.1, 0.2, 0.4, 0.7, 1, 2, 4)  # f/e
NAMESPACES = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'

plt.rcParams.update(
    {
        "svg.fonttype": "none",
        "svg.hashsalt": "53",
        "font.family": ["Source Sans 3", "DejaVu Sans"],
        "font.size": 11,
        "figure.constrained_layout.use": True,
        "savefig.facecolor": "none",
        "axes.facecolor": "none",
        "axes.spines.top": False,
        "axes.spines.right": False,
    }
)
matplotlib.set_loglevel("error")  # the page has the font, this machine need not
model = find_variant("53").model
filters = lab_filters(model, [*SHOWN, "aof-exact"])
result = compare(filters, model, runs=100_000, steps=STEPS.stop, seed=1)
figure, ax = plt.subplots(figsize=(7.2, 3.1))
steps = np.arange(STEPS.stop)
for name, label in SHOWN.items():
    gap, line = result.gap(name)[STEPS], style(name) | {"label": label}
    middle, (low, high) = 100 * gap.value, (100 * limit for limit in gap.interval())
    ax.plot(steps, middle, markersize=4, **line)
    ax.fill_between(steps, low, high, color=line["color"], alpha=0.16, linewidth=0)
ax.axhline(0, color="0.35", linewidth=1)
label_ends(ax, least=0.09, lowest=0, weight="semibold")
ax.set(xticks=steps, xlabel="step $k$", ylabel="error variance above\nthe exact filter (%)")
written = io.StringIO()
figure.savefig(written, metadata={"Date": None, "Creator": None})
text = re.sub(
    r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>|<style.*?</style>",
    "",
    written.getvalue(),
    flags=re.DOTALL,
).strip()
text = re.sub(
    r'<svg[^>]*?(viewBox="[^"]*")[^>]*>', rf'<svg {NAMESPACES} \1 stroke-linejoin="round">', text
)
PICTURE.write_text(text + "\n", encoding="utf-8")

cells = {}
for ratio in RATIOS:
    other = model.replace(f=float(model.parameters["e"]) * ratio)
    filters = lab_filters(other, [*LAB, "aof-exact"])
    cells[1, ratio] = compare(filters, other, 20_000, STEPS.stop, 1)
MAP.write_text(json.dumps(leading(cells), separators=(",", ":")) + "\n", encoding="utf-8")
