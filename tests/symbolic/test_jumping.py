"""Models that jump: what they are made of, and what is refused."""

import numpy as np
import oracles
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from kfcourse import FormulaError, JumpModel, Model, ModelError, simulate
from kfcourse.symbolic.averaging import averaged_equations

MODES = {"sound": {"parameters": {"C": 1}}, "faulty": {"parameters": {"C": 10}}}


def define(**changes):
    given = {"modes": MODES, "transition": [[0.9, 0.1], [0.3, 0.7]], "first": [0.8, 0.2]} | changes
    return JumpModel.define(
        given.pop("state", "0.9*x + v"), "x + C*w", given.pop("parameters", None), **given
    )


def with_odd(mode):
    return {"modes": {"sound": MODES["sound"], "odd": mode}}


def test_a_mode_is_a_model_of_what_holds_for_all_and_of_what_differs():
    model = JumpModel.define(
        "c*x + v",
        "x + C*w",
        {"c": 0.5, "C": 1},
        prior={"mean": 2},
        modes={
            "a": {},
            "b": {"state": "c*x + 3 + v", "parameters": {"C": 7}, "state_noise": {"variance": 4}},
        },
        transition=[0.5, 0.5],
    )
    assert model.modes[0] == Model.define(
        "c*x + v", "x + C*w", {"c": 0.5, "C": 1}, prior={"mean": 2}
    )
    assert model.modes[1] == Model.define("c*x + 3 + v", "x + C*w", {"c": 0.5, "C": 7})
    assert model.modes[1].state_noise.cov == 4 and model.prior.mean == 2
    assert (model.n, model.p, model.names) == (1, 1, ("a", "b"))


def test_a_single_row_is_a_mode_drawn_anew_at_each_step():
    model = define(transition=[0.75, 0.25], first=None)
    assert_array_equal(model.transition_at(3), [[0.75, 0.25], [0.75, 0.25]])
    assert_array_equal(model.first, [0.75, 0.25])


@pytest.mark.parametrize(
    ("changes", "chain"),
    [
        ({}, lambda k: [[0.9, 0.1], [0.3, 0.7]]),
        (
            {"transition": [["1 - e/(k + 1)", "e/(k + 1)"], ["1", 0]], "parameters": {"e": 0.5}},
            lambda k: [[1 - 0.5 / (k + 1), 0.5 / (k + 1)], [1, 0]],
        ),
    ],
)
def test_the_chain_may_depend_on_time_and_parameters(changes, chain):
    model, law = define(**changes), [0.8, 0.2]
    for k in range(6):
        assert_allclose(model.transition_at(k), chain(k), rtol=1e-14)
        assert_allclose(model.law_at(k), law, rtol=1e-12)
        law = law @ np.array(chain(k))


def test_trajectories_follow_the_chain_and_the_mode_in_force():
    """x_{k+1} by the mode of step k + 1, y_k by that of step k."""
    model = JumpModel.define(
        "0.5*x + r + v",
        "x + b + 0.1*w",
        {"r": 0.0, "b": 0.0},
        modes={
            "a": {},
            "b": {
                "parameters": {"r": 100, "b": -1000},
                "state_noise": {"variance": 9},
                "meter_noise": {"mean": 5, "variance": 4},
            },
        },
        transition=[[0.9, 0.1], [0.3, 0.7]],
        first=[0.8, 0.2],
    )
    x, y, mode = simulate(model, 20_000, 6, seed=1)
    mode = mode.astype(int)
    v = x[1:, :, 0] - 0.5 * x[:-1, :, 0] - 100 * mode[1:]
    w = y[:, :, 0] - x[:, :, 0] + 1000 * mode
    for j, mean, deviation in ((0, 0.0, 0.1), (1, 0.5, 0.2)):
        oracles.is_mean(mean, w[mode == j])
        oracles.is_mean(deviation**2, (w[mode == j] - mean) ** 2)
    for j, deviation in ((0, 1.0), (1, 3.0)):
        oracles.is_mean(0, v[mode[1:] == j])
        oracles.is_mean(deviation**2, v[mode[1:] == j] ** 2)
    for k in range(6):
        oracles.is_mean(model.law_at(k)[1], mode[k])
    for i in (0, 1):
        oracles.is_mean(model.transition_at(0)[i, 1], mode[1:][mode[:-1] == i])


def test_averaged_equations():
    model = define(
        state="0.9*x + v",
        modes={"a": {"parameters": {"C": 1}}, "b": {"state": "x**2 + v", "parameters": {"C": 2}}},
    )
    state, meter = averaged_equations(model)
    x = np.array([[2.0], [3.0]])
    law = model.law_at(3)
    assert_allclose(state(x, 2), law[0] * 0.9 * x + law[1] * x**2, rtol=1e-12)
    assert_allclose(meter(x, 2), x, rtol=1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"transition": [[0.9, 0.2], [0.3, 0.7]]},
            r"`transition` at step 0: \[0.9, 0.2\] are no probabilities",
        ),
        ({"transition": [[0.9, 0.1], [1.3, -0.3]]}, r"\[1.3, -0.3\] are no probabilities"),
        (
            {"transition": [[0.9, "0.1*k"], [0.3, 0.7]]},
            r"step 0: \[0.9, 0.0\] are no probabilities",
        ),
        (
            {"transition": [["1 - sqrt(k - 3)", "sqrt(k - 3)"], [0.3, 0.7]]},
            r"at step 0: \[nan, nan\] are no probabilities",
        ),
        ({"transition": [[1.0]]}, "must be 2 rows of 2 probabilities for 2 mode"),
        ({"transition": [[0.9, 0.1], 0.3]}, "must be 2 rows of 2 probabilities"),
        (
            {"transition": [[0.9, True], [0.3, 0.7]]},
            "^an entry of `transition` = True: expected a finite number",
        ),
        ({"first": [0.8, 0.3]}, r"`first`: \[0.8, 0.3\] are no probabilities"),
        ({"first": None}, r"`first` must be probabilities of the shape .* mode\(s\); got None"),
        ({"modes": {}}, "`modes` holds a mode at least"),
        (
            with_odd({"prior": {"mean": 1}}),
            "mode odd: `modes.odd` has the keys state, meter, .* not prior",
        ),
        (with_odd(3), "`modes.odd` must be a table"),
        (with_odd({"state": ["x1 + v", "x2"], "parameters": {"C": 1}}), "mode odd"),
        (with_odd({"meter": ["x + w", "x"], "parameters": {"C": 1}}), "measurement component"),
        (with_odd({"meter": "x + w1 + w2"}), r"components and noises, named by `symbols`"),
        (with_odd({"meter": "x + w", "parameters": {"C": "much"}}), "mode odd: parameter C"),
        # the chain does not know the noises, nor what differs between the modes
        ({"transition": [["1 - v", "v"], [0.3, 0.7]]}, "unknown symbol 'v'"),
        ({"transition": [["1 - C/9", "C/9"], [0.3, 0.7]]}, "unknown symbol 'C'"),
    ],
)
def test_what_does_not_fit_is_refused_in_words(changes, message):
    with pytest.raises((ModelError, FormulaError), match=message):
        define(**changes)


def test_a_lost_trajectory_spoils_no_other():
    model = define(transition=[["1/(1 + x**2)", "x**2/(1 + x**2)"], [0.3, 0.7]])
    rows = model.transition_of(np.array([[1.0], [np.nan]]), 0)
    assert_allclose(rows[0], [[0.5, 0.5], [0.3, 0.7]])


def test_a_chain_that_fails_late_says_so_when_it_comes_there():
    model = define(transition=[["1 - k/90", "k/90"], [0.3, 0.7]])
    assert model.transition_at(90).shape == (2, 2)
    with pytest.raises(ModelError, match=r"at step 91: \[-0.01.*\] are no probabilities"):
        model.transition_at(91)
