"""How far apart colours are: on paper of one colour, in both themes of the book, and for those who
see fewer."""

import re
from pathlib import Path

import numpy as np
from matplotlib.colors import to_rgb

# What the colour-blind see: Machado, Oliveira and Fernandes (2009), full severity, for linear RGB.
EYES = {
    "all cones": np.eye(3),
    "no long ones": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "no middle ones": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.01182, 0.04294, 0.968881],
        ]
    ),
    "no short ones": np.array(
        [
            [1.255528, -0.076749, -0.178779],
            [-0.078411, 0.930809, 0.147602],
            [0.004733, 0.691367, 0.3039],
        ]
    ),
}
_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)  # sRGB's
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def _linear(colour) -> np.ndarray:
    c = np.array(to_rgb(colour))
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def contrast(ink, paper) -> float:
    """Contrast ratio of two colours (WCAG 2)."""
    low, high = sorted(_linear(colour) @ _LUMINANCE for colour in (ink, paper))
    return (high + 0.05) / (low + 0.05)


def apart(first, second) -> float:
    """The distance in CIELAB for the eyes to which it is the least; 2.3 is just noticed."""

    def place(colour, seen):
        # no colour here is nearly black
        f = np.cbrt(_XYZ @ np.clip(seen @ _linear(colour), 0, 1) / [0.95047, 1, 1.08883])
        return np.array([116 * f[1], 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])

    return min(
        float(np.linalg.norm(place(first, seen) - place(second, seen))) for seen in EYES.values()
    )


def shown(colour, theme: str) -> tuple[np.ndarray, str]:
    """A colour of a picture as a page of the book shows it, and what is around it."""
    sheet = (Path(__file__).parents[1] / "book" / "_static" / "book.css").read_text(
        encoding="utf-8"
    )
    rules = re.search(rf'html\[data-theme="{theme}"\] \{{(.*?)\}}', sheet, re.DOTALL)[1]
    paper, changed = (
        re.search(r"--paper: (#\w+)", rules)[1],
        re.search(r"--picture: ([^;]+)", rules)[1],
    )
    if changed == "none":
        return np.array(to_rgb(colour)), paper
    assert changed == "invert(1) hue-rotate(180deg)"
    inverted = 1 - np.array(to_rgb(colour))  # and turned: 2 luminance - colour
    return np.maximum(
        np.clip(2 * inverted @ [0.213, 0.715, 0.072] - inverted, 0, 1), to_rgb(paper)
    ), paper
