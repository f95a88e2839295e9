"""The checks of the chapters stop the build: with one sign changed, a chapter fails where it prints
the equation.

Changes in typed relations are planted by book/gate/plant.py; here a few of them, and one in a cell
of each chapter.
"""

import random
from pathlib import Path

import pytest
from gate import plant as gate
from matplotlib import pyplot as plt
from weekly import weekly

from kfcourse.pages import Unverified

BOOK = Path(__file__).resolve().parents[2] / "book"

# Where the changed cell needs nothing but imports, and the cells before are long.
ALONE = {
    "beyond/before-measuring",
    "course/comparison",
    "beyond/cycle-slips",
    "beyond/grid",
    "course/wiener",
}
# One change in each chapter that derives something.
CHANGES = {
    "course/stratonovich": ("(e - K * nu) ** 2 / p_", "(e + K * nu) ** 2 / p_"),
    "beyond/grid": ("2 * sp.integrate(density * wave", "-2 * sp.integrate(density * wave"),
    "course/linearisation": (
        "log_normal(y, S + S1 * (x - lam), D_n)",
        "log_normal(y, S - S1 * (x - lam), D_n)",
    ),
    "beyond/when-linearisation-fails": ("(M_e, -K_k * S2 * Psi / 2)", "(M_e, K_k * S2 * Psi / 2)"),
    "course/consistency": ("sp.sqrt(-2 * sp.log(1 - beta))", "sp.sqrt(2 * sp.log(1 - beta))"),
    "beyond/sigma-points": ("off.T * W * off + miss.T", "off.T * W * off - miss.T"),
    "course/discriminator": (
        "u = S.diff(phi) * (Y - S) / noise",
        "u = -S.diff(phi) * (Y - S) / noise",
    ),
    "beyond/cycle-slips": ("inner = sp.Integral(sp.exp(-V(a))", "inner = sp.Integral(sp.exp(V(a))"),
    "course/continuous": ("inner = N / 2 * sp.integrate", "inner = -N / 2 * sp.integrate"),
    "course/structural-functions": (
        "a.diff(x) ** 2 * p + a.diff(v) ** 2",
        "a.diff(x) ** 2 * p - a.diff(v) ** 2",
    ),
    "course/lab-filters": ("Psi - 2 * K * C + K**2 * F", "Psi + 2 * K * C + K**2 * F"),
    "course/comparison": (
        "where={epsilon: x - exact, delta: exact - z}",
        "where={epsilon: x - exact, delta: exact + z}",
    ),
    "course/track-2d": ("velocity = v0 + sp.integrate", "velocity = v0 - sp.integrate"),
    "beyond/before-measuring": (
        "(Lambda, 2 * (1 - rho) ** 2 / rho)",
        "(Lambda, 2 * (1 + rho) ** 2 / rho)",
    ),
    "course/numerics": ("return (sp.eye(2) - K * H) * Psi", "return (sp.eye(2) + K * H) * Psi"),
    "course/radar-tracking": ("2 * b - (a + b / 2) ** 2", "2 * b + (a + b / 2) ** 2"),
    "beyond/models-that-jump": ("(dx, (vx * sin - vy", "(dx, (vx * sin + vy"),
    "course/wiener": (
        "subs(zeta, a) / (1 - a / zeta)",
        "subs(zeta, a) / (1 + a / zeta)",
    ),
    "course/time-tags": ("s_hat = s.subs(t, t - tau)", "s_hat = s.subs(t, t + tau)"),
    "beyond/literature": ("sp.Matrix([[sp.cos(angle), 0]])", "sp.Matrix([[-sp.cos(angle), 0]])"),
    "beyond/four-sensors": ("(s - d) / r, h / r, 0, 0", "(s - d) / r, -h / r, 0, 0"),
    "course/integration": (
        "(Psi_, (s_xi**2 + sp.sqrt(s_xi**4",
        "(Psi_, (s_xi**2 - sp.sqrt(s_xi**4",
    ),
}


# of these the cells before take many seconds, of two most of a minute
LONG = {f"beyond/{name}" for name in ("models-that-jump", "literature", "four-sensors")}
LONG |= {"course/time-tags", "course/consistency"}


@pytest.mark.parametrize(
    ("chapter", "right", "wrong"), weekly([(k, *v) for k, v in CHANGES.items()], dear=LONG)
)
def test_a_changed_sign_stops_the_chapter(chapter, right, wrong, monkeypatch):
    text = (BOOK / f"{chapter}.md").read_text(encoding="utf-8")
    assert text.count(right) == 1, (
        "the line to be changed has gone, or is there twice: choose another"
    )
    monkeypatch.setattr(plt, "show", lambda: plt.close("all"))
    with pytest.raises(Unverified):
        gate.run(text.replace(right, wrong), wrong, chapter in ALONE)


def test_at_most_one_in_twenty_changes_of_typed_relations_is_not_noticed():
    chance = random.Random(53)
    planted = [each for page in gate.written() for each in gate.planted(page, chance, most=5)]
    missed = [each for each in planted if not each.noticed]
    assert {each.where for each in planted} == {
        "display",
        "box",
        "point",
        "sentence",
        "side",
        "name",
    } and len(planted) > 200
    assert len(missed) <= gate.MOST * len(planted), gate.report(missed)
