"""Parameters of the largest likelihood: closed forms, the Nile, directions that nothing tells, and
refusals."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from kfcourse import Model, ModelError, linearised, simulate
from kfcourse.filters import aof, gated
from kfcourse.records import estimate, profile
from kfcourse.records.estimation import _derivatives
from kfcourse.scenarios.benchmarks import local_level, nile


def test_the_nile_s_variances():
    estimated = estimate(
        local_level(3000, 3000),
        nile(),
        ["q", "r"],
        ["q", "r"],
        build=lambda each: aof(linearised(each)),
    )
    # five digits are published
    assert_allclose(estimated.value, [1468.5, 15099.7], rtol=5e-5)
    assert estimated.log_likelihood == pytest.approx(-641.5856, abs=5e-5)
    assert estimated.flat == ()
    assert float(estimated.model.parameters["q"]) == estimated.value[0]


def test_a_variance_alone_has_its_closed_form():
    """A state known exactly: r is the mean square of the measurements, its standard error r sqrt(2
    / N)."""
    model = Model.define(
        "x", "x + w", {"r": 1.0}, prior={"mean": 0.5, "variance": 0}, meter_noise={"variance": "r"}
    )
    y = 0.5 + 3 * np.random.default_rng(1).standard_normal((40, 5, 1))
    y[3, 2] = y[7, 1] = np.nan
    estimated = estimate(model, y, ["r"], ["r"])
    expected = np.nanmean((y - 0.5) ** 2)
    assert estimated.value[0] == pytest.approx(expected, rel=1e-6)
    assert estimated.standard_error[0] == pytest.approx(expected * np.sqrt(2 / 198), rel=1e-5)


def test_what_the_record_does_not_tell_is_named():
    """Only the product of g and s reaches the measurements: one doubled and the other halved,
    nothing changes."""
    model = Model.define(
        "0.9*x + s*v", "g*x + r*w", {"g": 1.5, "s": 0.4, "r": 0.3}, prior={"mean": 0, "variance": 0}
    )
    y = simulate(model, 2, 30, seed=4).y
    estimated = estimate(model, y, ["g", "s", "r"], ["g", "s", "r"])
    (sentence,) = estimated.flat
    assert sentence in {
        "the record does not tell g (+1), s (-1) apart: changed together in these proportions "
        "they leave its likelihood as it is",
        "the record does not tell g (-1), s (+1) apart: changed together in these proportions "
        "they leave its likelihood as it is",
    }
    assert_array_equal(np.isinf(estimated.standard_error), [True, True, False])
    # with one of them known, the other and r are what they are with both free
    alone = estimate(model, y, ["s", "r"], ["s", "r"])
    assert alone.flat == ()
    assert estimated.value[0] * estimated.value[1] == pytest.approx(1.5 * alone.value[0], rel=1e-4)
    assert estimated.standard_error[2] == pytest.approx(alone.standard_error[1], rel=1e-3)


def test_a_profile_is_the_best_over_the_others():
    values = [900.0, 1468.5, 2500.0]
    estimated = profile(local_level(), nile(), ["q", "r"], "q", values, ["q", "r"])
    assert estimated[1] == pytest.approx(-641.5856, abs=5e-5)
    assert (estimated[[0, 2]] < estimated[1]).all()
    elsewhere = estimate(local_level(q=2500, r=10000), nile(), ["r"], ["r"])
    assert elsewhere.log_likelihood == pytest.approx(estimated[2], abs=1e-6)
    alone = profile(local_level(), nile(), ["q"], "q", [1468.5])
    assert alone[0] == pytest.approx(-641.5856, abs=5e-5)


@pytest.mark.parametrize(
    ("unknown", "positive", "message"),
    [
        (
            ["q", "z"],
            [],
            "unknown must name parameters of the model, each once: it has q, r; got q, z",
        ),
        (["q", "q"], [], "each once"),
        ([], [], "got none"),
        (["q"], ["r"], "positive names r, which is not among the unknown"),
        (["q"], ["q"], "what is positive must begin positive: q is not"),
    ],
)
def test_names_that_do_not_fit_are_refused(unknown, positive, message):
    with pytest.raises(ModelError, match=message):
        estimate(local_level(q=0), nile(), unknown, positive)


def test_a_start_without_a_likelihood_says_why():
    model = Model.define("x", "g*x", {"g": 1.0}, prior={"mean": 1, "variance": 0})
    with pytest.raises(ValueError, match="no density for the measurement of step 0"):
        estimate(model, np.ones((3, 1, 1)), ["g"])
    with pytest.raises(ValueError, match="many powers of ten away"):
        estimate(Model.define("x", "g*x + w", {"g": 1}), np.array([1.0, 1e120]), ["g"])


def test_a_search_that_leaves_the_model_names_the_parameter():
    """White measurements of a walk: its variance q goes to zero, and beyond there is no model."""
    walk = Model.define(
        "x + v", "x + w", {"q": 1.0}, state_noise={"variance": "q"}, prior={"variance": 10}
    )
    y = np.random.default_rng(0).standard_normal((50, 1, 1))
    with pytest.raises(ValueError, match=r"a small change of q leaves no.*: declare q positive"):
        estimate(walk, y, ["q"])
    assert 0 < estimate(walk, y, ["q"], ["q"]).value < 0.1


def test_a_likelihood_that_jumps_has_no_maximum_to_be_found():
    """A gate of 90 % before measurements three times as large: some begin to pass on the way."""
    model = Model.define("0.9*x + v", "x + sqrt(r)*w", {"r": 1.0})
    y = 3 * simulate(model, 1, 60, seed=0).y
    with pytest.raises(
        ValueError, match=r"was found; the search ended at r = 0\.\d+: begin nearer"
    ):
        estimate(model, y, ["r"], ["r"], build=lambda each: gated(aof(linearised(each)), 0.9))


def test_second_differences_of_a_likelihood_of_a_thousand_are_good_to_six_digits():
    """A step twice as large errs by more, and half of it lets more rounding through."""
    errors = [
        _derivatives(lambda c: 1000 + np.exp(c[0]), np.array([c]))[1].item() - np.exp(c)
        for c in np.linspace(-0.1, 0.1, 200)
    ]
    assert np.abs(errors).max() < 3e-7
