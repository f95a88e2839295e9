"""Which filter may I use?  Refusals and warnings against what is known of the models, and the lab
without the refused."""

import re
import warnings

import numpy as np
import pytest
from click.testing import CliRunner

from kfcourse import cli
from kfcourse.filters import aof, duof
from kfcourse.lab import admission
from kfcourse.lab.admission import admissions, table
from kfcourse.lab.short_names import FILTERS, JUMP_FILTERS, LAB, lab_filters
from kfcourse.montecarlo.designing import NotFinite
from kfcourse.montecarlo.experiment import compare, without_failing
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.structure import gaussian

pytestmark = pytest.mark.quick


def verdicts(model, names=tuple(FILTERS)):
    return {one.name: one for one in admissions(model, names)}


def kinds(found, verdict):
    return {name for name, one in found.items() if one.verdict == verdict}


def test_a_linear_model_admits_all():
    found = verdicts(Model.define("0.9*x + v", "x + w"))
    assert kinds(found, "yes") == set(FILTERS) and all(one.says == "" for one in found.values())


def test_variant_53_warns_of_points_on_the_axes(variant53):
    """UKF: x^2 w is 0 on both axes, so nothing of f^2 3 d^2 is seen."""
    found = verdicts(variant53)
    assert kinds(found, "no") == set() and kinds(found, "poor") == {"aof-unscented"}
    assert (
        "see 0 % of the variance of the measurement that the state does not explain"
        in found["aof-unscented"].says
    )
    assert found["particle"].says == found["aof-exact"].says == ""


def test_what_has_no_closed_form_no_derivative_or_several_components_is_refused_with_the_reason():
    found = verdicts(Model.define("0.9*x + v", "tan(x)/10 + w", prior={"variance": 0.01}))
    gaussians = {name for name in FILTERS if name.endswith("gaussian")}
    assert (
        kinds(found, "no") == gaussians
        and "no closed-form Gaussian mean of the term tan(x)" in found["aof-gaussian"].says
    )

    found = verdicts(Model.define("0.9*x + v", "sign(x) + w"))
    assert kinds(found, "no") == gaussians | {
        name for name in FILTERS if name.endswith("linearised")
    }
    assert "not differentiable" in found["aof-linearised"].says
    assert found["aof-exact"].verdict == "yes"
    assert found["duof"].verdict == "yes"

    with_noise = verdicts(Model.define(["x1 + 0.1*x2", "x2 + v1"], "x1 + w1"))
    without = verdicts(
        Model.define(["x1 + 0.1*x2", "x2 + v1"], "x1", symbols={"x": ["x1", "x2"], "v": ["v1"]})
    )
    assert kinds(with_noise, "no") == set() and kinds(without, "no") == {"aof-exact", "particle"}
    assert "no noise enters the meter" in without["aof-exact"].says

    found = verdicts(Model.define("0.9*x + v", "x + w + w**2"))
    assert (
        kinds(found, "no") == {"aof-exact", "particle"}
        and "enters nonlinearly" in found["particle"].says
    )


def test_what_can_be_built_and_will_not_do_is_warned_of():
    found = verdicts(Model.define("0.9*x + v", "x**2 + w"))
    level = {name for name in FILTERS if name.endswith("linearised")}
    assert (
        level <= kinds(found, "poor")
        and "tangent of y at the prior's mean is level" in found["fos3-linearised"].says
    )
    growth = Model.define(
        "x/2 + 25*x/(1 + x**2) + 8*cos(1.2*k) + v", "x**2/20 + w", prior={"variance": 5}
    )
    assert "with 5 points an axis" in verdicts(growth)["aof-gauss-hermite"].says


@pytest.mark.parametrize(
    ("variant", "filters", "all_of_them"),
    [("53", "aof-gaussian,duof", FILTERS), ("J1", "imm,aof-jump-gaussian,duof", JUMP_FILTERS)],
)
def test_the_lab_looks_at_each_filter_once(variant, filters, all_of_them, tmp_path, monkeypatch):
    """For the comparison and for the report's table."""
    looked, look = [], admission._admitted
    monkeypatch.setattr(
        admission, "_admitted", lambda name, *more: looked.append(name) or look(name, *more)
    )
    few = ["--runs", "40", "--steps", "2", "--report", "en", "--out", str(tmp_path)]
    result = CliRunner().invoke(cli.main, ["lab", variant, "--filters", filters, *few])
    assert result.exit_code == 0, result.output
    assert looked == [*all_of_them]
    assert (tmp_path / "modes.svg").exists() == (variant == "J1")


def test_formulas_that_were_not_derived_in_time_are_not_derived_again(monkeypatch):
    model, looked = Model.define("0.9*x + v", "(1 + x)**14 + w"), []
    admit = admission._admitted
    monkeypatch.setattr(
        admission, "_admitted", lambda name, *more: looked.append(name) or admit(name, *more)
    )
    names = ["aof-gaussian", "fos-gaussian", "duof"]
    answers = admissions(model, names, seconds=0.01)
    assert [answer.name for answer in answers] == names and looked == ["aof-gaussian", "duof"]
    assert all("within 0.01 s" in str(answer.reason) for answer in answers[:2])
    assert answers[2].verdict == "yes"


def test_an_unknown_filter_is_refused():
    with pytest.raises(ValueError, match="unknown filter 'ekf'; known: aof-gaussian, "):
        admissions(Model.define("x + v", "x + w"), ["ekf"])


def test_a_line_for_each_filter():
    found = admissions(Model.define("0.9*x + v", "sign(x) + w"), ["duof", "aof-exact"])
    lines = table(found).splitlines()
    assert lines[0].split() == ["duof", "DUOF", "yes"]
    assert lines[1] == "aof-exact  exact AOF  yes"


def test_a_comparison_goes_on_without_the_filters_that_fail():
    """A filter that becomes infinite is named, and the comparison is that of the others."""
    model = Model.define("0.9*x + 0.3*v", "x + w")

    def broken(name):
        good = aof(gaussian(model))

        def step(state, y):
            after = good.step(state, y)
            mean = after.posterior.mean * (np.inf if state.step == 2 else 1.0)
            return after._replace(posterior=after.posterior._replace(mean=mean))

        return type(good)(name, model, good.init, step)

    size, options = (model, 300, 4, 1), {"jobs": 1, "progress": False}
    good = [duof(model), aof(gaussian(model))]
    found = without_failing(
        [broken("one"), good[0], broken("two"), good[1]],
        *size,
        left_out={"aof-exact": "reason"},
        **options,
    )
    assert found.names == ("duof", "aof-gaussian") and list(found.left_out) == [
        "aof-exact",
        "one",
        "two",
    ]
    assert (
        "one became infinite or NaN" in str(found.left_out["one"])
        and found.left_out["one"].kind == "infinite"
    )
    np.testing.assert_array_equal(
        found.error_variance("duof").value,
        compare(good, *size, **options).error_variance("duof").value,
    )
    with pytest.raises(NotFinite, match="every filter fails"):
        without_failing([broken("two")], *size, **options)
    endless = Model.define("x**3 + v", "x + w")
    with pytest.raises(NotFinite, match="trajectories become infinite"):
        without_failing([duof(endless)], endless, 300, 20, 1, **options)
    assert set(LAB) <= set(FILTERS)


def test_a_negative_variance_is_the_affair_of_its_filter():
    """The Gaussian formulas of this meter cancel in doubles; the other filters are compared as if
    it were not there."""
    model = Model.define("0.9*x + 0.1*v", "(1 + x)**16*(1 + x)**8 + w")

    size, options = (model, 500, 40, 1), {"jobs": 1, "progress": False}
    names = ("mfos-gaussian", "aof-gaussian", "aof-unscented")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        filters = lab_filters(model, names)
    found = without_failing(filters, *size, **options)
    assert found.names == names[1:]
    failed = r"step \d+: mfos-gaussian (failed: a covariance has the variance -|became infinite)"
    assert re.match(failed, str(found.left_out["mfos-gaussian"]))
    expected = compare(filters[1:], *size, **options).error_variance("aof-gaussian").value
    np.testing.assert_array_equal(found.error_variance("aof-gaussian").value, expected)


@pytest.mark.parametrize(
    "meter", [["x + w", "x + w"], ["x + w", "2*x + w"], ["x + w1", "x + w1 + w2", "w2 + x**2"]]
)
def test_measurements_whose_noises_depend_on_one_another_have_no_density(meter):
    """Two equal rows, and sums of rows: particles would meet a singular matrix; the Gaussian
    filters take the pseudo-inverse."""
    model = Model.define("0.9*x + v", meter)
    particles, normal = admissions(model, ["particle", "aof-gaussian"])
    assert particles.built is None and "depend on one another" in str(particles.reason)
    assert normal.verdict == "yes"
    result = compare([normal.built], model, 100, 4, 1, jobs=1, progress=False)
    assert np.isfinite(result.error_variance("aof-gaussian").value).all()
