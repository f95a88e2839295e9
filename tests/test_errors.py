"""Errors: another kind of value than is expected is refused in words; what a report needs survives
a process."""

import pickle

import numpy as np
import pytest

from kfcourse import (
    JumpModel,
    Model,
    NoClosedForm,
    NotFinite,
    continuous,
    gaussian,
    likelihood,
    linearised,
    run,
)
from kfcourse.filters import aof, duof

MODEL = Model.define("0.9*x + a*v", "x + w", {"a": 1.0})
JUMPS = JumpModel.define("x + v", "x + w", modes={"a": {}}, transition=[1.0])
STRUCTURE = linearised(MODEL)
FILTER = aof(STRUCTURE)
Y = np.zeros(3)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: run(STRUCTURE, Y),
            r"^a run expects a Filter, got Structure linearised: give a filter",
        ),
        (
            lambda: likelihood(duof(MODEL), Y),
            r"^likelihood expects a Filter, got Design duof: .* design",
        ),
        (
            lambda: gaussian(FILTER),
            r"^gaussian expects a Model, got Filter aof-lin.*: give a model, .* filter",
        ),
        (lambda: linearised(JUMPS), "got JumpModel"),  # as one without modes
        (lambda: continuous.to_discrete(MODEL, 0.1), r"expects a ContinuousModel, got Model"),
    ],
)
def test_another_kind_of_value_is_refused_in_words(call, message):
    with pytest.raises(TypeError, match=message):
        call()


def test_what_a_report_says_of_an_error_survives_a_process():
    for error in (
        NoClosedForm("no mean of x", "no_mean", term="x"),
        NotFinite("step 3: it diverges", "duof", "infinite", step=3),
    ):
        copy = pickle.loads(pickle.dumps(error))
        assert (str(copy), copy.kind, copy.parts) == (str(error), error.kind, error.parts)
        assert getattr(copy, "filter_name", "") == getattr(error, "filter_name", "")
