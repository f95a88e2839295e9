"""The pictures of a flight show what they are given; the table names its parts."""

import numpy as np
import pytest
from matplotlib import pyplot as plt
from numpy.testing import assert_allclose

from kfcourse.pages.flights import by_part, flight_and_errors, in_plan
from kfcourse.scenarios.errors import rms_by_part
from kfcourse.scenarios.flight import aircraft


@pytest.fixture(scope="module")
def track():
    return aircraft(0.8)


def curves(ax) -> dict:
    return {line.get_label(): line for line in ax.get_lines()}


def test_errors_over_time(track):
    fig = flight_and_errors(track, {"Kalman": track.position[:, None] + [30.0, 0, 40]}, "Kalman")
    assert_allclose(curves(fig.axes[1])["Kalman"].get_ydata(), 50.0)
    plt.close(fig)


def test_pieces_in_plan_are_of_their_parts(track):
    y = track.position[:, None]
    fig = in_plan(track, y, {"Kalman": y + np.array([1000.0, 0, 0])})
    assert [ax.get_title(loc="left") or ax.get_title() for ax in fig.axes] == [
        "part 1",
        "part 2",
        "part 3",
        "part 4",
    ]
    for ax, part in zip(fig.axes, (1, 2, 3, 4), strict=True):
        path, estimate = ax.get_lines()[1].get_xydata(), curves(ax)["Kalman"].get_xydata()
        # km
        assert_allclose(estimate - path, np.tile([1.0, 0], (len(path), 1)), atol=1e-12)
        on_part = track.position[track.part == part, :2] / 1000
        assert all(np.abs(on_part - place).sum(axis=1).min() < 1e-12 for place in path)
    plt.close(fig)


def test_table_by_part(track):
    error = np.stack([0 * track.position + [3.0, 4, 0], 0 * track.position + [3.0, 4, 0]], axis=1)
    shown = by_part(
        ["one", "two", "three", "four", "five"], {"ours": rms_by_part(error, track.part)}
    )
    rows = shown.markdown.splitlines()
    assert rows[0] == "| RMS error (m) | ours |"
    assert rows[-1] == "| five | 5.0 ± 0.0 |"
