"""Normal moments without a closed form: against adaptive quadrature, on the laws that occur; what
is refused, what is said."""

import json
import re

import numpy as np
import pytest
import scipy.integrate
import scipy.stats
from click.testing import CliRunner

from kfcourse.cli import main
from kfcourse.filters import aof, logic_dynamic
from kfcourse.lab import checked_quadrature as cq
from kfcourse.lab.admission import admissions
from kfcourse.lab.short_names import (
    FILTERS,
    JUMP_FILTERS,
    LAB,
    JumpStructures,
    Structures,
    lab_filters,
    title,
)
from kfcourse.lab.variants import find_variant
from kfcourse.montecarlo.ensemble import simulate
from kfcourse.montecarlo.experiment import states
from kfcourse.scenarios import benchmarks
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import NoClosedForm
from kfcourse.symbolic.quadrature import gauss_hermite

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
    return (JumpStructures if isinstance(model, JumpModel) else Structures)(model).quadrature


def laws_of(found, model):
    """Posteriors of fresh trajectories: of the AOF, or of each mode's law of the logic-dynamic
    one's as it is merged."""
    one = (
        logic_dynamic(found.structures, model, model.first)
        if isinstance(model, JumpModel)
        else aof(found.structures[0])
    )
    return [state.posterior for state in states(one, simulate(model, 12, 6, seed=9).y)[1:]]


@pytest.mark.parametrize("model", [CUBIC, JUMPING], ids=["plain", "modes"])
def test_the_moments_are_those_of_adaptive_quadrature_at_laws_of_fresh_trajectories(model):
    """The pilot's own laws are others; on these its promise holds too, a root mean square, so four
    times as much for one."""
    found = checked(model)
    assert {one.name for one in found.structures} == {"gaussian"} and found.apart <= cq.CLOSE
    for law in laws_of(found, model):
        z, p = law.mean[:, 0], law.cov[:, 0, 0]
        for tau, theta in (one.predict(*law) for one in found.structures):
            for i in range(12):
                normal = scipy.stats.norm(z[i], np.sqrt(p[i]))
                first, second = (
                    scipy.integrate.quad(
                        lambda x, n=n, normal=normal: (x / (1 + x**2)) ** n * normal.pdf(x),
                        -np.inf,
                        np.inf,
                    )[0]
                    for n in (1, 2)
                )
                sd = np.sqrt(second - first**2 + 1)
                assert abs(tau[i, 0] - first) < 4 * cq.CLOSE * sd
                assert abs(theta[i, 0, 0] - sd**2) < 4 * cq.CLOSE * sd**2


def test_on_the_landing_a_fine_rule_finds_the_same():
    """Three states and noises that the state multiplies: 3 points an axis against 12, at laws of
    fresh trajectories."""
    model = find_variant("J3").model
    found = checked(model)
    fine = [gauss_hermite(mode, 12) for mode in model.modes]
    assert (found.order, checked(model)) == (2, found)  # sought once, as a report asks again
    for k, law in enumerate(laws_of(found, model), 1):
        for one, other in zip(
            (s.at(k) for s in found.structures), (s.at(k) for s in fine), strict=True
        ):
            (tau, theta), (mean, cov) = one.predict(*law), other.predict(*law)
            sd = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
            assert (np.abs(tau - mean) < 4 * cq.CLOSE * sd).all()
            assert (np.abs(theta - cov) < 4 * cq.CLOSE * sd[:, :, None] * sd[:, None, :]).all()
            less, more = one.measure(*law), other.measure(*law)
            sd = np.sqrt(np.diagonal(more.F, axis1=1, axis2=2))
            assert (np.abs(less.h - more.h) < 4 * cq.CLOSE * sd).all()
            assert (np.abs(less.F - more.F) < 4 * cq.CLOSE * sd[:, :, None] * sd[:, None, :]).all()


def test_a_mode_with_formulas_keeps_them_beside_one_without():
    model = JumpModel.define(
        "0.9*x + v",
        "x + w",
        modes={"sound": {}, "bent": {"state": "x/(1 + x**2) + v"}},
        transition=[0.7, 0.3],
    )
    plain, by_points = checked(model).structures
    assert plain.formulas is not None and by_points.formulas is None
    tau, theta = plain.predict(np.full((3, 1), 2.0), np.full((3, 1, 1), 0.5))
    np.testing.assert_allclose(
        (tau[:, 0], theta[:, 0, 0]), (np.full(3, 1.8), np.full(3, 1.405)), rtol=1e-15
    )


def test_modes_for_which_no_order_does_leave_the_others_linearised_and_say_so():
    modes = {"sound": {}, "faulty": {"meter": "tan(x) + w"}}
    model = JumpModel.define("0.9*x + v", "x + w", modes=modes, transition=[0.9, 0.1])
    said = {
        one.name: one
        for one in admissions(
            model, ["aof-jump-gaussian", "imm", "aof-averaged", "aof-jump-linearised"]
        )
    }
    assert (
        said["aof-jump-gaussian"].verdict == "no"
        and "without bound" in said["aof-jump-gaussian"].says
    )
    for name in ("imm", "aof-averaged"):
        assert (
            said[name].verdict == "yes"
            and "linearised structural functions, as Gaussian ones cannot" in said[name].says
        )
    assert not said["aof-jump-linearised"].says


def test_the_order_is_the_first_that_does():
    found = checked(CUBIC)
    orders = cq.ORDERS[cq.ORDERS.index(found.order) - 1], found.order
    less, same = (
        cq._apart(*(gauss_hermite(CUBIC, n) for n in (order, 2 * order))) for order in orders
    )
    assert less > cq.CLOSE >= same == found.apart
    narrow = checked(
        Model.define("x/(1 + x**2) + 0.1*v", "x**3 + x + w", prior={"mean": 0.1, "variance": 0.01})
    )
    assert narrow.order < found.order  # smoother over narrower laws


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
    structures = Structures(model)
    with pytest.raises(NoClosedForm, match=r"no closed-form Gaussian mean of the term .*" + says):
        _ = structures.normal
    assert structures.quadrature is structures.quadrature  # not sought again for every filter
    with pytest.raises(NoClosedForm, match=r"^fos-gaussian: .*" + says):
        lab_filters(model, ["fos-gaussian"])


def test_too_many_axes_are_refused_before_they_take_hours(monkeypatch):
    monkeypatch.setattr(cq, "MOST", 10)
    model = Model.define(["x1/(1 + x2**2) + 0.3*v1", "0.9*x2 + v2"], "x1 + w")
    with pytest.raises(
        NoClosedForm,
        match=r"no closed-form Gaussian mean.*5 points on each of 2 axes are 25, more than the 10",
    ):
        _ = Structures(model).normal


def test_a_model_with_formulas_keeps_them(variant53):
    structures = Structures(variant53)
    assert structures.quadrature is None and structures.normal is structures.gaussian


def test_who_chooses_a_filter_is_told():
    for model, names in ((CUBIC, FILTERS), (JUMPING, JUMP_FILTERS)):
        for one in admissions(
            model,
            [name for name, entry in names.items() if entry.functions in ("gaussian", "best")],
        ):
            assert (
                one.verdict == "yes"
                and f"Gauss-Hermite quadrature, {checked(model).order} points an axis" in one.says
            )
    assert [one.name for one in lab_filters(CUBIC)] == list(LAB)


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
@pytest.mark.parametrize(
    ("language", "said"), [("ru", "узл. по каждой оси"), ("en", "points an axis; twice as many")]
)
def test_the_lab_says_so_in_its_reports(tmp_path, monkeypatch, meter, more, names, language, said):
    monkeypatch.chdir(tmp_path)
    text = f'[variants.c]\nstate = "x/(1 + x**2) + v"\nmeter = "{meter}"\n{more}'
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    call = ["lab", "c", "--variants", "mine.toml", "--runs", "300", "--steps", "4"]
    result = CliRunner().invoke(
        main, [*call, "--report", language, "--out", "r", "--json", "r.json"]
    )
    assert result.exit_code == 0, result.output
    told = next(
        line
        for line in result.output.splitlines()
        if "no closed form: means over normal laws by Gauss-Hermite" in line
    )
    assert all(title(name) in told.partition(":")[0] for name in names)
    numbers = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert not numbers["left_out"] and {*names} <= set(numbers["error_variance"])
    page = (tmp_path / "r" / "report.html").read_text(encoding="utf-8")
    assert (
        re.sub(r"узл\w+", "узл.", page).count(said) == 1
        and "экспонент" not in page
        and "громоздки" not in page
    )


def test_trajectories_that_become_infinite_are_no_pilot():
    model = Model.define(["x1**2", "abs(x1) + 0.3*v"], ["x1"])
    (one,) = admissions(model, ["aof-gaussian"], seconds=5)
    assert one.built is None and "no closed-form" in str(one.reason)
