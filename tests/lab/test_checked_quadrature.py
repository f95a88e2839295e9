"""Normal moments without a closed form: against fine sums, on the laws that occur; what
is refused, what is said."""

import json
import re

import numpy as np
import pytest

from kfcourse import JumpModel, Model, NoClosedForm, lab_filters, simulate
from kfcourse.filters import aof, logic_dynamic
from kfcourse.lab import Structures, title
from kfcourse.lab import checked_quadrature as cq
from kfcourse.lab.admission import admissions
from kfcourse.montecarlo.experiment import states
from kfcourse.scenarios import benchmarks

CUBIC = Model.define("x/(1 + x**2) + v", "x**3 + x + w", prior={"mean": 0.1, "variance": 1})


JUMPING = JumpModel.define(
    "x/(1 + x**2) + v",
    "x**3 + x + C*w",
    modes={"sound": {"parameters": {"C": 1}}, "faulty": {"parameters": {"C": 5}}},
    transition=[[0.9, 0.1], [0.3, 0.7]],
    first=[0.9, 0.1],
    prior={"mean": 0.1, "variance": 1},
)


def checked(model):
    return Structures.of(model).quadrature


def laws_of(outcome, model):
    """Posteriors of fresh trajectories: of the AOF, or of each mode's law of the logic-dynamic
    one's as it is merged."""
    filter_ = (
        logic_dynamic(outcome.structures, model, model.first)
        if isinstance(model, JumpModel)
        else aof(outcome.structures[0])
    )
    return [state.posterior for state in states(filter_, simulate(model, 12, 6, seed=9).y)[1:]]


@pytest.mark.parametrize("model", [CUBIC, JUMPING], ids=["plain", "modes"])
def test_the_moments_are_those_of_a_fine_sum_at_laws_of_fresh_trajectories(model):
    """The pilot's own laws are others; on these its promise holds too, a root mean square, so four
    times as much for one.  The sum's points are a hundredth of the distance of the poles, 1, apart,
    or closer: the sum is exact to rounding."""
    outcome, u = checked(model), np.linspace(-12, 12, 4001)
    assert checked(model) is outcome  # sought once, as a report asks again
    assert {each.name for each in outcome.structures} == {"gaussian"} and outcome.apart <= cq.CLOSE
    weights = np.exp(-(u**2) / 2) / np.exp(-(u**2) / 2).sum()
    for law in laws_of(outcome, model):
        x = law.mean + np.sqrt(law.cov[:, 0]) * u
        first, second = ((x / (1 + x**2)) ** n @ weights for n in (1, 2))
        variance = second - first**2 + 1
        for tau, theta in (each.predict(*law) for each in outcome.structures):
            assert (np.abs(tau[:, 0] - first) < 4 * cq.CLOSE * np.sqrt(variance)).all()
            assert (np.abs(theta[:, 0, 0] - variance) < 4 * cq.CLOSE * variance).all()


def test_modes_for_which_no_order_does_leave_the_others_linearised_and_say_so():
    modes = {"sound": {}, "faulty": {"meter": "tan(x) + w"}}
    model = JumpModel.define("0.9*x + v", "x + w", modes=modes, transition=[0.9, 0.1])
    phrases = {
        each.name: each
        for each in admissions(
            model, ["aof-jump-gaussian", "imm", "aof-averaged", "aof-jump-linearised"]
        )
    }
    assert (
        phrases["aof-jump-gaussian"].verdict == "no"
        and "without bound" in phrases["aof-jump-gaussian"].says
    )
    for name in ("imm", "aof-averaged"):
        assert (
            phrases[name].verdict == "yes"
            and "linearised structural functions, as Gaussian ones cannot" in phrases[name].says
        )
    assert not phrases["aof-jump-linearised"].says


def test_a_narrower_law_takes_fewer_points():
    narrow = Model.define("x/(1 + x**2) + 0.1*v", "x**3 + x + w", prior={"variance": 0.01})
    assert checked(narrow).order < checked(CUBIC).order


@pytest.mark.parametrize(
    ("model", "says"),
    [
        (
            benchmarks.growth_model(),
            r"160 points an axis still errs by [\d.]+ %",
        ),  # its laws are wider than the hump of the slope
        (Model.define("0.9*x + v", "tan(x) + w"), "without bound"),  # there is no mean
        (Model.define("0.9*x + v", "sign(x) + w"), r"160 points an axis still errs by"),
    ],
)
def test_what_no_order_does_is_refused_and_the_term_still_named(model, says):
    with pytest.raises(NoClosedForm, match=r"^fos-gaussian: .*no closed-form .* term .*" + says):
        lab_filters(model, ["fos-gaussian"])


@pytest.mark.parametrize(
    ("most", "says"),
    [(40, "with 3 points an axis still errs .* finer ones take too long"), (10, "on 2 axes takes")],
)
def test_too_many_points_are_refused_before_they_take_hours(monkeypatch, most, says):
    monkeypatch.setattr(cq, "MOST", most)
    model = Model.define(["x1/(1 + x2**2) + 0.3*v1", "0.9*x2 + v2"], "x1 + w")
    with pytest.raises(NoClosedForm, match=f"no closed-form Gaussian mean.*{says}"):
        _ = Structures(model).normal


MODES = """modes.sound.parameters = { C = 1.0 }
modes.faulty.parameters = { C = 5.0 }
transition = [0.8, 0.2]
"""


@pytest.mark.parametrize(
    ("meter", "more", "names"),
    [
        ("x**3 + x + w", "", ["aof-gaussian", "fos-gaussian", "mfos-gaussian"]),
        (
            "x**3 + x + C*w",
            MODES,
            ["aof-jump-gaussian", "fos-jump-gaussian", "imm", "gpb2", "fos-averaged"],
        ),
    ],
    ids=["plain", "modes"],
)
def test_the_lab_says_so_in_its_reports(no_figures, command, tmp_path, meter, more, names):
    text = f'[variants.c]\nstate = "x/(1 + x**2) + v"\nmeter = "{meter}"\n{more}'
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    call = "lab c --variants mine.toml --runs 300 --steps 4 --report ru --out r --json r.json"
    result = command(call)
    assert result.exit_code == 0, result.output
    sentence = next(
        line
        for line in result.output.splitlines()
        if "no closed form: means over normal laws by Gauss-Hermite" in line
    )
    assert all(title(name) in sentence.partition(":")[0] for name in names)
    numbers = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert not numbers["left_out"] and {*names} <= set(numbers["error_variance"])
    page = (tmp_path / "r" / "report.html").read_text(encoding="utf-8")
    assert (
        len(re.findall(r"узл\w+ по каждой оси", page)) == 1
        and "экспонент" not in page
        and "громоздки" not in page
    )
