"""What a page computes in the reader's browser is what the package computes: filters, the exact
filter, statistics."""

import json
from dataclasses import replace

import answering
import numpy as np
import pytest
from numpy.testing import assert_allclose
from weekly import weekly

from kfcourse import Model, compare, design, lab_filters, run, simulate
from kfcourse.filters import pointmass
from kfcourse.lab import LAB
from kfcourse.montecarlo.ensemble import Instant
from kfcourse.pages import browser as printed
from kfcourse.symbolic.equations import compile_model

SCALAR = {name: variant.model for name, variant in answering.SCALAR.items()}
SETTINGS = (
    "const model = kfModels[id], settings = { values: { ...model.parameters }, prior: "
    "model.prior };"
)
RUNS, STEPS = 100, 12


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
    """What a function of `given`'s entries returns; as text, for Playwright is slow with long
    arrays, and JSON has no NaN."""
    names = ", ".join(given)
    plain = (
        "(_, v) => v instanceof Float64Array ? [...v].map(String) : typeof v === 'number' ? "
        "String(v) : v"
    )
    text = page.evaluate(
        f"text => {{ const f = ({{ {names} }}) => {{ {body} }}; return "
        f"JSON.stringify(f(JSON.parse(text)), {plain}); }}",
        json.dumps(given),
    )
    return json.loads(text)


def array(values) -> np.ndarray:
    return np.array(values, dtype=float)


# ---------------------------------------------------------------- filters


def drawn(id: str) -> list[dict[str, np.ndarray]]:
    """Standard normal draws of two ensembles, the one for designing and the one for running; and
    their trajectories."""
    model, rng = SCALAR[id], np.random.default_rng(24)
    state, meter = compile_model(model)
    ensembles = []
    for _ in range(2):
        start = rng.standard_normal(RUNS)
        v, w = (
            rng.standard_normal((STEPS, RUNS, len(model.v))),
            rng.standard_normal((STEPS, RUNS, len(model.w))),
        )
        x = [(model.prior.mean[0] + np.sqrt(model.prior.cov[0, 0]) * start)[:, None]]
        for k in range(STEPS):
            x.append(state(x[-1], v[k]))
        y = [meter(x[k], w[k]) for k in range(STEPS)]
        ensembles.append({"start": start, "v": v, "w": w, "x": np.stack(x), "y": np.stack(y)})
    return ensembles


def shipped(draws: dict[str, np.ndarray]) -> dict:
    flat = {name: draws[name].reshape(STEPS, -1).tolist() for name in ("v", "w")}
    return {"n": RUNS, "steps": STEPS, "start": draws["start"].tolist(), **flat}


def of_package(model: Model, name: str, designing, running) -> np.ndarray:
    """D_k of a filter of the package, on the trajectories given."""
    (filter_,) = lab_filters(model, [name])
    instants = [
        Instant(designing["x"][k], designing["y"][k], designing["x"][k + 1]) for k in range(STEPS)
    ]
    if hasattr(filter_, "with_coefficients"):
        (filter_,) = design([filter_], instants)
    z = run(filter_, running["y"]).mean
    return ((running["x"][:-1] - z) ** 2).mean(axis=(1, 2))


def compared(page, id: str, designing, running) -> dict[str, list]:
    """The page's D_k and their standard errors, by filter, step by step."""
    body = (
        SETTINGS
        + """const first = kfLab.simulate(model, settings, designing), tracks = kfLab.simulate(model, settings, running);
        const filtered = kfLab.runAll(model, settings, kfLab.design(model, settings, first), tracks);
        return Object.fromEntries(Object.keys(filtered).map(name => [name,
            tracks.y.map((_, k) => kfLab.errorVariance(tracks.n, tracks.x[k], filtered[name].z[k]))]));"""
    )
    given = {"designing": shipped(designing), "running": shipped(running)}
    return computed(page, body, {"id": id, **given})


@pytest.mark.parametrize("id", weekly(zip(SCALAR)))
def test_the_same_draws_give_the_same_error_variances(page, id):
    """The package's D_k to 1e-9, from the draws alone: rounding of 1e-16, which a dozen steps of a
    filter and the division by small variances carry to 1e-12 and more."""
    designing, running = drawn(id)
    result = compared(page, id, designing, running)
    assert tuple(result) == LAB
    for name in LAB:
        value, error = array(result[name]).T
        assert_allclose(
            value, of_package(SCALAR[id], name, designing, running), rtol=1e-9, err_msg=name
        )
        assert (error > 0).all()


# ---------------------------------------------------------------- the exact filter, and what is
# said of the bound


@pytest.mark.parametrize("id", weekly(zip(SCALAR)))
def test_the_exact_filter_is_the_package_s(page, id):
    """Means within a hundredth of the posterior deviation and variances within 3 %, at the worst of
    steps; on average the means add 1e-5 to the bound and the variances 1e-3: a tenth of a percent,
    far below what some hundred trajectories can tell."""
    model = SCALAR[id]
    # twice as far out as the prior has them
    wide = replace(model, prior=model.prior._replace(cov=4 * model.prior.cov))
    y = simulate(wide, 16, 12, seed=5).y
    body = (
        SETTINGS
        + "return y.map(record => { const { z, p } = kfLab.exact(model, settings, record); return [z, "
        "p]; });"
    )
    result = array(computed(page, body, {"id": id, "y": y[..., 0].T.tolist()}))
    law = run(pointmass(model), y)
    mean, variance = law.mean[..., 0].T, law.cov[..., 0, 0].T
    off = np.abs(result[:, 0] - mean) / np.sqrt(variance)
    assert off.max() < 0.01 and (off**2).mean() < 1e-5
    ratio = result[:, 1] / variance
    assert np.abs(ratio - 1).max() < 0.03 and abs(ratio.mean() - 1) < 1e-3


COVERAGE = (
    SETTINGS
    + """
    const n = 4000, few = 400, steps = 3, names = ["aof-linearised", "aof-gaussian"], C = kfLab.CARRIER;
    const draws = (which, size) => kfLab.draws(1e6 * seed + 3e5 * which, size, steps, model.noises);
    const run = tracks => Object.fromEntries(names.map(name => [name, kfLab.run(model, settings, name, tracks)]));
    const tracks = kfLab.simulate(model, settings, draws(1, n)), all = run(tracks);
    const start = kfLab.widened(draws(2, few), 2.5), drawn = kfLab.simulate(model, settings, start), of = run(drawn);
    const exact = Array.from({ length: few }, (_, i) => kfLab.exact(model, settings, drawn.y.map(y => y[i])));
    const column = (key, k) => Float64Array.from(exact, law => law[key][k]);
    return names.map(name => [0, 1, 2].map(k => kfLab.aboveBound(
        { n, x: tracks.x[k], z: all[name].z[k], carrier: all[C].p[k] },
        { n: few, weight: start.weight, z: of[name].z[k], carrier: of[C].p[k], exact: column("z", k), variance: column("p", k) },
    )));"""
)


@pytest.mark.slow
@pytest.mark.parametrize("id", ["2", "53"])
def test_intervals_above_the_bound_cover(page, id):
    """95 % intervals of forty sets of draws, against the package's gap from many more trajectories.

    Over two filters and three steps together, which depend on each other: within three standard
    errors of forty independent ones, 0.95 - 3 sqrt(0.95 0.05 / 40) = 0.85.  The draws of the page
    are its own, so this compares these, too.
    """
    model = SCALAR[id]
    result = compare(lab_filters(model, [*LAB[:2], "aof-exact"]), model, runs=8000, steps=3, seed=1)
    drawn = np.array(
        [array(computed(page, COVERAGE, {"id": id, "seed": seed})) for seed in range(1, 41)]
    )
    ratio, error, bound = np.moveaxis(drawn, -1, 0)
    gaps = [result.gap(name) for name in ("aof-linearised", "aof-gaussian")]
    value, own = (
        np.array([getattr(gap, part) for gap in gaps]) for part in ("value", "standard_error")
    )
    assert (np.abs(ratio - value) < 1.96 * np.hypot(error, own)).mean() > 0.85
    # and their mean is the package's value, within four standard errors of forty: no bias that the
    # bands would not show
    assert (
        np.abs(ratio.mean(axis=0) - value) < 4 * np.hypot(ratio.std(axis=0) / np.sqrt(40), own)
    ).all()
    expected = result.bound()
    spread = np.hypot(bound.std(axis=0) / np.sqrt(40), expected.standard_error)
    assert (np.abs(bound.mean(axis=0) - expected.value) < 4 * spread).all()
