"""A model, structural functions, a filter: one where another is expected is told, before anything is computed."""

import numpy as np
import pytest

from kfcourse import (
    Ensemble,
    JumpModel,
    Model,
    compare,
    continuous,
    design,
    gauss_hermite,
    gaussian,
    likelihood,
    linearised,
    predictions,
    read_measurements,
    run,
    simulate,
    smooth,
    unscented,
)
from kfcourse.continuous import ContinuousModel, to_discrete
from kfcourse.filters import (
    adaptive,
    adaptive_pointmass,
    aof,
    duof,
    fkp,
    fos,
    gated,
    iterated,
    jump_particle,
    jump_pointmass,
    kalman_filter,
    mdfmp,
    particle,
    pointmass,
    robust,
    undisturbed,
)
from kfcourse.records import estimate, examine, profile, smooth_iterated, smoothing_error, weights

MODEL = Model.define("0.9*x + a*v", "x + w", {"a": 1.0})
STRUCTURE = linearised(MODEL)
FILTER = aof(STRUCTURE)
Y = np.zeros(3)

OF_STRUCTURES = {
    "aof": aof, "robust": robust, "adaptive": adaptive, "iterated": iterated, "fos": fos, "mdfmp": mdfmp, "fkp4": fkp,
    "smooth_iterated": lambda one: smooth_iterated(one, Y), "structure=": lambda one: gated(FILTER, structure=one),
}  # fmt: skip
OF_FILTERS = {
    "gated": gated, "a run": lambda one: run(one, Y), "smooth": lambda one: smooth(one, Y),
    "likelihood": lambda one: likelihood(one, Y), "examine": lambda one: examine(one, Y), "weights": lambda one: weights(one, Y),
    "smoothing_error": lambda one: smoothing_error(one, Y),
    "smoothers=": lambda one: compare([FILTER], MODEL, 10, 2, 1, smoothers=[one]),
}  # fmt: skip
OF_MODELS = {
    "linearised": linearised, "gaussian": gaussian, "unscented": unscented, "gauss_hermite": gauss_hermite, "duof": duof,
    "kalman_filter": kalman_filter, "pointmass": pointmass, "particle": particle, "estimate": lambda one: estimate(one, Y, ["a"]),
    "an exact filter": adaptive_pointmass, "undisturbed": undisturbed, "an ensemble": lambda one: simulate(one, 2, 2, 1),
    "profile": lambda one: profile(one, Y, ["a"], "a", [1.0]), "compare": lambda one: compare([FILTER], one, 10, 2, 1),
    "read_measurements": lambda one: read_measurements("", one),
}  # fmt: skip


@pytest.mark.parametrize("what", OF_STRUCTURES)
def test_a_model_or_a_filter_in_the_place_of_structural_functions(what):
    with pytest.raises(TypeError, match=rf"^{what} expects a Structure, and a Model came: give linearised\(model\)"):
        OF_STRUCTURES[what](MODEL)
    with pytest.raises(TypeError, match=rf"^{what} expects a Structure, and the Filter aof-linearised came: give linearised"):
        OF_STRUCTURES[what](FILTER)


@pytest.mark.parametrize("what", OF_FILTERS)
def test_a_model_structural_functions_or_a_design_in_the_place_of_a_filter(what):
    with pytest.raises(TypeError, match=rf"^{what} expects a Filter, and a Model came: make a filter .*aof\(linearised\(model"):
        OF_FILTERS[what](MODEL)
    with pytest.raises(TypeError, match=rf"^{what} expects a Filter, and the Structure linearised came: make .*aof\(structure"):
        OF_FILTERS[what](STRUCTURE)
    with pytest.raises(TypeError, match=rf"^{what} expects a Filter, and the Design duof came: find its coefficients"):
        OF_FILTERS[what](duof(MODEL))


@pytest.mark.parametrize("what", OF_MODELS)
def test_a_filter_or_structural_functions_in_the_place_of_a_model(what):
    for one in (FILTER, STRUCTURE):
        with pytest.raises(TypeError, match=rf"^{what} expects a Model, and the .*{one.name} came: give the model .*, it.model$"):
            OF_MODELS[what](one)


@pytest.mark.parametrize("build", [jump_particle, jump_pointmass])
def test_a_model_without_modes_in_the_place_of_one_with_them_and_the_other_way_round(build):
    for one, remedy in ((MODEL, "take the filter of a model without"), (FILTER, "give the model"), (STRUCTURE, "give the model")):
        with pytest.raises(TypeError, match=rf"^{build.__name__} expects a JumpModel, and .* came: {remedy}"):
            build(one)
    with pytest.raises(TypeError, match=r"^particle expects a Model, and a JumpModel came: take one of its modes, .* imm"):
        particle(JumpModel.define("x + v", "x + w", modes={"a": {}}, transition=[1.0]))


def test_a_continuous_model_in_the_place_of_a_discrete_one_and_the_other_way_round():
    with pytest.raises(TypeError, match=r"^linearised expects a Model, and a ContinuousModel came: give .*to_discrete\(it, step"):
        linearised(ContinuousModel.define("-x", "1", "x"))
    for use in (lambda one: to_discrete(one, 0.1), lambda one: continuous.simulate(one, 0.1, 2, 3, 1)):
        with pytest.raises(TypeError, match=r"expects a ContinuousModel, and a Model came: .* ContinuousModel.define"):
            use(MODEL)


def test_a_filter_or_a_design_of_another_model_in_the_place_of_a_design():
    blocks = Ensemble(Model.define(["x1 + v1"], ["x1 + w1", "x1 + w2"], symbols={"x": ["x1"]}), 10, 2, 1)
    with pytest.raises(TypeError, match=r"^design expects a Design, and the Filter aof-linearised came"):
        design([FILTER], blocks.by_step())
    with pytest.raises(ValueError, match=r"duof was built for .* 1 states and 1 measurements; the ensemble has 1 and 2"):
        design([duof(MODEL)], blocks.by_step())


def test_other_things_in_the_place_of_a_filter():
    for one, message in ((aof, "the function aof came: call it first"), (Y, "a ndarray came: see its documentation")):
        with pytest.raises(TypeError, match=rf"^a run expects a Filter, and {message}"):
            predictions(one, Y)
    with pytest.raises(TypeError, match=r"a list of filters, and one came: compare\(\[aof-linearised\], model"):
        compare(FILTER, MODEL, 10, 2, 1)
    with pytest.raises(TypeError, match=r"^compare expects a Filter, and a Model came"):
        compare([FILTER, MODEL], MODEL, 10, 2, 1)
