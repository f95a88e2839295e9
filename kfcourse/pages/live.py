"""The live page: a reader moves the pointer, and the filter of `kfcourse.scenarios.pointer` cleans
the track in the browser.

::

    recording = record(hand_track(seed=10), seed=6)      a track and its noise, every 10 ms
    HTML(page(recording))   the page, one piece of HTML that loads nothing

The page runs the filter itself, in JavaScript (templates/live-filter.js.j2).  The matrices A, B, H
and those of the start-up are printed from the SymPy expressions of `kfcourse.scenarios.pointer`;
predict and correct are written there, in Joseph's form, and a test compares them in a browser with
`kfcourse.linear`.  The page samples the recording, or the reader's own track, at the interval that
a slider says, with noise of the standard deviation sigma that another says.
"""

from __future__ import annotations

import json
from typing import NamedTuple

import jinja2
import sympy as sp

from kfcourse.laws import Array
from kfcourse.pages import explore
from kfcourse.scenarios import pointer
from kfcourse.scenarios.pointer import HandTrack, sample

GRID = 0.01  # s between the points of a recording; sampling intervals are multiples of it
SCREEN = (640, 400)  # px, the field of the page
RUNS = (100, 10)  # ms, the sampling intervals of the paper's two runs
SWITCHES = {
    "dropouts": "lose 30 %",
    "outliers": "5 % outliers",
    "gate": "gate, 99.9 %",
    "smooth": "smoothed at last",
    "second": "second: S − 15 dB",
    "blind": "hide the truth",
    "input": "input by 3 samples",
    "whole": "whole track",
}
_DECIMALS = 3


class Slider(NamedTuple):
    """Range of a setting: integers, so that a value is the same number in the page and in
    Python."""

    low: int
    high: int
    step: int


# ms; px; tenths of a decade: the intensity is 10^(value / 10) px^2/s^3.
SLIDERS = {
    "interval": Slider(10, 200, 10),
    "sigma": Slider(1, 40, 1),
    "decibels": Slider(30, 80, 1),
}


class Recording(NamedTuple):
    """A track every `GRID` seconds, and noise for it.

    Attributes
    ----------
    position : ndarray (steps, 2)
        px.
    noise : ndarray (steps, 2)
        Standard normal numbers; the page multiplies them by its sigma.
    """

    position: Array
    noise: Array

    def sampled(self, interval: float, measurement_sd: float) -> tuple[Array, Array]:
        """What the page takes from the recording: true positions (steps, 2), and noisy ones (steps,
        1, 2) for `pointer.follow`.

        Parameters
        ----------
        interval : float
            Seconds between samples, a multiple of `GRID`.
        measurement_sd : float
            px.
        """
        every = round(interval / GRID)
        if every < 1 or abs(every * GRID - interval) > 1e-9:
            raise ValueError(f"interval: expected a multiple of {GRID} s, got {interval}")
        truth = self.position[::every]
        return truth, (truth + measurement_sd * self.noise[::every])[:, None]


def record(track: HandTrack, seed: int) -> Recording:
    """The track and one realisation of the noise, rounded to what the page holds: 0.001 px, 0.001
    sigma."""
    samples = sample(track, GRID, 1.0, runs=1, seed=seed)
    position = samples.state[:, 0, :2]
    return Recording(position.round(_DECIMALS), (samples.y[:, 0] - position).round(_DECIMALS))


def page(
    recording: Recording, interval: int = 20, sigma: int = 8, decibels: int = 57, name: str = "live"
) -> str:
    """The live page as a piece of HTML: markup, style, script and the recording; it loads nothing.

    Parameters
    ----------
    recording : Recording
        Played on request, for those who cannot or do not want to move a pointer.
    interval : int
        Where the slider of the sampling interval begins, ms: 10, 20, ..., 200.
    sigma : int
        Of the noise of each coordinate, px: 1, 2, ..., 40.
    decibels : int
        Of the intensity S of the acceleration's white noise, 10^(decibels / 10) px^2/s^3: 30, 31,
        ..., 80.  The filter's Q is that of `pointer.uniform_acceleration` with acceleration_sd =
        sqrt(S / interval).
    name : str
        With which its state begins in the address; of the figure whose place it takes on the
        screen, if there is one.

    Returns
    -------
    str
        For `IPython.display.HTML`, or the body of a file of its own.
    """
    parts = {key: array.tolist() for key, array in recording._asdict().items()}
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("kfcourse.pages"),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    content = {
        "name": name,
        "helper": explore.HELPER.read_text(encoding="utf-8"),
        "sliders": SLIDERS,
        "switches": SWITCHES,
        "runs": list(RUNS),
        "settings": {"interval": interval, "sigma": sigma, "decibels": decibels},
        "screen": SCREEN,
        "grid": GRID,
        "recording": json.dumps(parts, separators=(",", ":")),
        "matrices": {
            name: _javascript(matrix)
            for name, matrix in {
                "A": pointer.TRANSITION,
                "B": pointer.INPUT,
                "H": pointer.SENSITIVITY,
                "START": pointer.START,
            }.items()
        },
    }
    return environment.get_template("live.html.j2").render(content)


def _javascript(matrix: sp.MatrixBase) -> str:
    """The matrix as an array of rows, a function of the number Delta."""
    rows = (", ".join(sp.jscode(entry) for entry in row) for row in matrix.tolist())
    return "[" + ", ".join(f"[{row}]" for row in rows) + "]"
