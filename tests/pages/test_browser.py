"""What a page computes in the reader's browser is what the package computes: functions, filters, the exact filter, statistics."""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import pytest

from kfcourse import Model, gaussian, linearised, run
from kfcourse.filters import pointmass
from kfcourse.lab import lab_filters
from kfcourse.lab.short_names import LAB
from kfcourse.lab.variants import load_variants
from kfcourse.montecarlo.designing import NotFinite, design
from kfcourse.montecarlo.ensemble import Instant
from kfcourse.pages import browser as printed
from kfcourse.symbolic.equations import compile_model

SCALAR = {name: variant.model for name, variant in load_variants().items() if variant.model.n == 1 == variant.model.p}
SETTINGS = "const model = kfModels[id], settings = { values: model.parameters, prior: model.prior };"
RUNS, STEPS = 400, 30


@pytest.fixture(scope="module")
def page(browser):
    tab = browser.new_page()
    problems: list[str] = []
    tab.on("pageerror", lambda error: problems.append(str(error)))
    tab.add_script_tag(content=printed.script(SCALAR))
    yield tab
    assert problems == []
    tab.close()


def computed(page, body: str, given: dict):
    """What a function of `given`'s entries returns; as text, for Playwright is slow with long arrays, and JSON has no NaN."""
    names = ", ".join(given)
    plain = "(_, v) => v instanceof Float64Array ? [...v].map(String) : typeof v === 'number' ? String(v) : v"
    text = page.evaluate(
        f"text => {{ const f = ({{ {names} }}) => {{ {body} }}; return JSON.stringify(f(JSON.parse(text)), {plain}); }}",
        json.dumps(given),
    )
    return json.loads(text)


def array(values) -> np.ndarray:
    return np.array(values, dtype=float)


# ---------------------------------------------------------------- functions


@pytest.mark.parametrize("id", SCALAR)
def test_every_function_is_numpy_s(page, id):
    """On a grid of states, variances and noises: 1e-12 is a hundred times the rounding of the few dozen operations of each.

    Relative to the value, or where terms of other signs cancel, to the greatest value of the function on the grid over 1e4.
    """
    model = SCALAR[id]
    x, noise, p = np.linspace(-2.9, 3.1, 13), np.linspace(-2.2, 2.3, 6), np.array([0.0, 1e-8, 0.01, 0.3, 2.5])

    def same(found, expected):
        np.testing.assert_allclose(array(found), np.ravel(expected), rtol=1e-12, atol=1e-16 * np.max(np.abs(expected)))

    states, noises = (np.ravel(one) for one in np.meshgrid(x, noise))
    v = np.stack([noises * (-0.7) ** i for i in range(len(model.v))], axis=-1)
    w = np.stack([noises * (-0.7) ** i for i in range(len(model.w))], axis=-1)
    body = (
        SETTINGS
        + """const n = x.length, a = { x, v, w, y: new Float64Array(n), next: new Float64Array(n) };
        model.simulate(n, settings.values, {}, a); return [a.y, a.next];"""
    )
    y, following = computed(page, body, {"id": id, "x": states.tolist(), "v": np.ravel(v).tolist(), "w": np.ravel(w).tolist()})
    state, meter = compile_model(model)
    same(y, np.broadcast_to(meter(states[:, None], w), (len(states), 1)))
    same(following, np.broadcast_to(state(states[:, None], v), (len(states), 1)))

    means, variances = (np.ravel(one) for one in np.meshgrid(x, p))
    body = (
        SETTINGS
        + """const n = z.length, out = () => new Float64Array(n);
        const a = { z, p, m: z, d: p, tau: out(), Theta: out(), h: out(), G: out(), F: out() };
        model[structure].predict(n, settings.values, {}, a); model[structure].measure(n, settings.values, {}, a);
        return ["tau", "Theta", "h", "G", "F"].map(name => a[name]);"""
    )
    for structure in (linearised(model), gaussian(model)):
        given = {"id": id, "structure": structure.name, "z": means.tolist(), "p": variances.tolist()}
        law, shape = (means[:, None], variances[:, None, None]), (len(means), 1)
        tau, Theta = structure.predict(*law)
        h, G, F, _ = structure.measure(*law)
        for found, expected in zip(computed(page, body, given), (tau, Theta[..., 0], h, G[..., 0], F[..., 0]), strict=True):
            same(found, np.broadcast_to(expected, shape))


def test_the_model_s_own_numbers_are_not_the_page_s():
    """Parameters stay names: one function serves all positions of the sliders."""
    text = printed.model_source(SCALAR["53"])
    assert "v.c" in text and "v.f" in text
    assert "0.02" not in text.split("...{")[0] and "0.05" not in text.split("...{")[0]


# ---------------------------------------------------------------- filters


@cache
def ensembles(id: str) -> list[dict[str, np.ndarray]]:
    """Standard normal draws of two ensembles, the one for designing and the one for running; and their trajectories."""
    model, rng = SCALAR[id], np.random.default_rng(24)
    state, meter = compile_model(model)
    found = []
    for _ in range(2):
        start = rng.standard_normal(RUNS)
        v, w = rng.standard_normal((STEPS, RUNS, len(model.v))), rng.standard_normal((STEPS, RUNS, len(model.w)))
        x = [(model.prior.mean[0] + np.sqrt(model.prior.cov[0, 0]) * start)[:, None]]
        for k in range(STEPS):
            x.append(state(x[-1], v[k]))
        y = [meter(x[k], w[k]) for k in range(STEPS)]
        found.append({"start": start, "v": v, "w": w, "x": np.stack(x), "y": np.stack(y)})
    return found


def shipped(one: dict[str, np.ndarray]) -> dict:
    flat = {name: one[name].reshape(STEPS, -1).tolist() for name in ("v", "w")}
    return {"n": RUNS, "steps": STEPS, "start": one["start"].tolist(), **flat}


def of_package(model: Model, name: str, designing, running) -> np.ndarray:
    """D_k of a filter of the package, on the trajectories given; NaN from where its design meets infinite numbers."""
    (one,) = lab_filters(model, [name])
    instants = [[Instant(designing["x"][k], designing["y"][k], designing["x"][k + 1])] for k in range(STEPS)]
    if hasattr(one, "with_coefficients"):
        (one,) = design([one], instants)
    z = run(one, running["y"]).mean
    return ((running["x"][:-1] - z) ** 2).mean(axis=(1, 2))


@pytest.mark.parametrize("id", SCALAR)
def test_the_same_draws_give_the_same_error_variances(page, id):
    """The package's D_k to 1e-9, from the draws alone: rounding, which thirty steps of a filter and the division by small variances
    may carry from 1e-16 to 1e-12 and more.  Error variances of 1e-20 and less are rounding themselves (relative to M x^2)."""
    designing, running = ensembles(id)
    body = (
        SETTINGS
        + """const first = kfLab.simulate(model, settings, designing), tracks = kfLab.simulate(model, settings, running);
        const found = kfLab.runAll(model, settings, kfLab.design(model, settings, first), tracks);
        return Object.fromEntries(Object.keys(found).map(name => [name,
            tracks.y.map((_, k) => kfLab.errorVariance(tracks.n, tracks.x[k], found[name].z[k]))]));"""
    )
    found = computed(page, body, {"id": id, "designing": shipped(designing), "running": shipped(running)})
    assert tuple(found) == LAB
    for name in LAB:
        try:
            expected = of_package(SCALAR[id], name, designing, running)
        except NotFinite as stopped:  # both say that it diverges, and where
            step = int(str(stopped).split("step ")[1].split(":")[0])
            assert np.argmin(np.isfinite(array(found[name])[:, 0])) == step
            continue
        value, error = array(found[name]).T
        np.testing.assert_allclose(value, expected, rtol=1e-9, err_msg=name)
        assert (error > 0).all()
