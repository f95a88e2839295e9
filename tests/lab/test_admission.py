"""Which filter may I use?  Refusals and warnings against what is known of the models."""

import pytest

from kfcourse import Model
from kfcourse.lab import FILTERS
from kfcourse.lab.admission import admissions


def verdicts(model, names=tuple(FILTERS)):
    return {each.name: each for each in admissions(model, names)}


def kinds(result, verdict):
    return {name for name, each in result.items() if each.verdict == verdict}


GAUSSIAN, LINEARISED = (
    {name for name in FILTERS if name.endswith(kind)} for kind in ("gaussian", "linearised")
)
DENSITY = {"aof-exact", "particle"}
TWO = ["x1 + 0.1*x2", "x2 + v1"]


@pytest.mark.parametrize(
    ("model", "refused", "says"),
    [
        (Model.define("0.9*x + v", "x + w"), set(), {}),
        (
            Model.define("0.9*x + v", "tan(x)/10 + w", prior={"variance": 0.01}),
            GAUSSIAN,
            {"aof-gaussian": "no closed-form Gaussian mean of the term tan(x)"},
        ),
        (
            Model.define("0.9*x + v", "sign(x) + w"),
            GAUSSIAN | LINEARISED,
            {"aof-linearised": "not differentiable"},
        ),
        (Model.define(TWO, "x1 + w1"), set(), {"aof-exact": "by particles"}),
        (
            Model.define(TWO, "x1", symbols={"x": ["x1", "x2"], "v": ["v1"]}),
            DENSITY,
            {"aof-exact": "no noise enters the meter"},
        ),
        (Model.define("0.9*x + v", "x + w + w**2"), DENSITY, {"particle": "enters nonlinearly"}),
        # two equal rows, and sums of rows: particles would meet a singular matrix
        (Model.define("0.9*x + v", ["x + w", "2*x + w"]), DENSITY, {"particle": "on one another"}),
        (
            Model.define("0.9*x + v", ["x + w1", "x + w1 + w2", "w2 + x**2"]),
            DENSITY,
            {"particle": "on one another"},
        ),
    ],
)
def test_what_cannot_be_built_is_refused_with_the_reason(model, refused, says):
    result = verdicts(model)
    assert kinds(result, "no") == refused
    assert all(words in result[name].says for name, words in says.items())


def test_what_can_be_built_and_will_not_do_is_warned_of(variant53):
    """UKF: x^2 w is 0 on both axes, so nothing of f^2 3 d^2 is seen."""
    result = verdicts(variant53)
    assert kinds(result, "no") == set() and kinds(result, "poor") == {"aof-unscented"}
    unseen = "see 0 % of the variance of the measurement that the state does not explain"
    assert unseen in result["aof-unscented"].says
    assert result["particle"].says == result["aof-exact"].says == ""
    # of the variance c^2 + 1 of (c + x) w the points see c^2: less than half of it, or more
    for part, verdict in ((0.8, "poor"), (1.2, "yes")):
        seen = verdicts(Model.define("0.9*x + v", f"x + ({part} + x)*w"), ["aof-unscented"])
        assert seen["aof-unscented"].verdict == verdict
    result = verdicts(Model.define("0.9*x + v", "x**2 + w"))
    assert kinds(result, "poor") >= LINEARISED
    assert "tangent of y at the prior's mean is level" in result["fos3-linearised"].says
    growth = Model.define(
        "x/2 + 25*x/(1 + x**2) + 8*cos(1.2*k) + v", "x**2/20 + w", prior={"variance": 5}
    )
    result = verdicts(growth, ["aof-gauss-hermite"])
    assert "points an axis in place of 5" in result["aof-gauss-hermite"].says
