"""The school's test tasks: shipped as the note has them, with formulas worked out there by hand;
structural functions and filters of D1, D2 and J4 are those of tests/golden."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from kfcourse import JumpModel, Model, gaussian, linearised, load_variants, simulate
from kfcourse.lab import VariantError, find_variant, read_variant
from kfcourse.lab.variants import read_variants

TASKS = {name: find_variant(name) for name in ("D1", "D2", "D3", "J1", "J2", "J3", "J4")}
BETWEEN = {name: find_variant(name) for name in ("C1", "C2", "C3", "CD1", "CD2", "CD3")}


def law(model, seed, spread=0.1):
    """A mean and a covariance such as a filter may meet, near the prior."""
    rng = np.random.default_rng(seed)
    root = np.sqrt(np.diagonal(model.prior.cov))
    mixing = np.eye(model.n) + 0.3 * rng.normal(size=(model.n, model.n))
    cov = mixing @ mixing.T * np.outer(root, root)
    return model.prior.mean + spread * root * rng.normal(size=model.n), cov


def test_each_is_shipped_stays_finite_and_is_none_of_the_exercises():
    shipped = {*TASKS, *BETWEEN}
    assert shipped <= set(read_variants()[0]) and not shipped & set(load_variants())
    assert (TASKS["D1"].steps, TASKS["D2"].steps, TASKS["D3"].steps) == (21, 51, 101)
    for name, task in TASKS.items():
        assert isinstance(task.model, JumpModel) == (name[0] == "J")
        assert np.isfinite(simulate(task.model, 5_000, task.steps, seed=1).x).all(), name
    for name, task in BETWEEN.items():
        end = float(task.model.known.interval) * (task.steps - 1)
        assert end == {"C3": 100, "CD3": 100}.get(name, 20)


@pytest.mark.slow
@pytest.mark.parametrize("name", BETWEEN)
def test_those_in_continuous_time_stay_finite(name):
    x = simulate(BETWEEN[name].model, 200, BETWEEN[name].steps, seed=1).x
    assert np.isfinite(x).all() and np.abs(x).max() < 130


def test_the_moments_of_their_meters_are_those_of_the_note():
    """What moves them between measurements: test_between."""
    for name, noise in (("CD1", 1), ("C1", 10)):
        (m,), ((d,),) = law(BETWEEN[name].model, 1)
        z, p = m + 2, d + 0.5
        h, G, F, _ = gaussian(BETWEEN[name].model).at(0).measure(np.array([z]), np.array([[p]]))
        wanted = [z + 0.5 * (z**2 + p), 1 + z, (1 + z) ** 2 * p + 0.5 * p**2 + noise]
        assert_allclose([np.squeeze(each) for each in (h, G, F)], wanted, rtol=1e-12)
    for name, noise in (("CD2", 1), ("C2", 10)):
        z, p = law(BETWEEN[name].model, 2)
        _, G, F, _ = gaussian(BETWEEN[name].model).at(0).measure(z, p)
        assert_allclose(F - p, noise * np.eye(2), atol=1e-12)
        assert_array_equal(G, np.eye(2))  # in the source diag(1, 0)


def test_one_second_of_the_landing_is_a_step_of_d3_but_for_euler_s_error():
    x = simulate(BETWEEN["CD3"].model, 3, 40, seed=2).x
    step = linearised(TASKS["D3"].model)
    for k in (5, 30):
        euler = step.at(k).predict(x[k], np.zeros((3, 3))).mean
        assert_allclose(x[k + 1], euler, atol=0.02)
        assert np.abs(x[k + 1] - euler).max() > 1e-4


@pytest.mark.parametrize(("seconds", "sign"), [(20, -1), (45, 0), (46, 1)])
@pytest.mark.parametrize(
    ("name", "factor", "multiplied", "added"),
    [
        ("D3", 1, 1e-4, 4e-14), ("J3", 0.01, 1e-4, 4e-10),
        ("CD3", 1, 1e-4, 4e-14), ("C3", 1, 2e-4, 8e-10),
    ],
)  # fmt: skip
def test_the_meter_of_the_landing_has_the_jacobian_of_the_note(
    name, factor, multiplied, added, seconds, sign
):
    """Columns 2 E rho / x1, E (-rho_2, rho_1), -beta E rho; in the second mode all times gamma.
    Those of J4 are held by tests/golden."""
    model = {**TASKS, **BETWEEN}[name].model
    modes = [model] if isinstance(model, Model) else model.modes
    for mode, gamma in zip(modes, (1.0, factor), strict=False):
        m, d = law(mode, 3)
        k = int(seconds / float(mode.known.interval))
        h, G, F, R = linearised(mode).at(k).measure(m, d)
        speed, angle, height = m[:3]
        E, kappa = 0.0433333 * speed**2 * np.exp(-0.09 * height), 0.3 * sign
        rho = np.array(
            [np.cos(angle) - kappa * np.sin(angle), np.sin(angle) + kappa * np.cos(angle)]
        )
        turned = np.array([-rho[1], rho[0]])
        columns = [2 * E * rho / speed, E * turned, -0.09 * E * rho]
        wanted = gamma * np.column_stack(columns)
        assert_allclose(h, gamma * E * rho, rtol=1e-9)
        assert_allclose(G, wanted, rtol=1e-9, atol=1e-18)
        noise = np.diag(E**2 * rho**2 * multiplied + added)
        assert_allclose(R, gamma**2 * noise, rtol=1e-9, atol=1e-30)
        assert_allclose(F, G @ d @ G.T + R, rtol=1e-9)


@pytest.mark.parametrize("name", ["D3", "J3"])
def test_the_lift_is_switched_at_45_s(name):
    """The path angle's step without what gravity and the planet's curvature make of it: c kappa(t)
    x1 exp(-beta x3)."""
    model = TASKS[name].model
    x = simulate(model, 50, 60, seed=2).x
    mode = model if isinstance(model, Model) else model.modes[0]
    g0 = float(mode.parameters["g0"])
    speed, angle, height = np.moveaxis(x[..., :3], -1, 0)
    turned = np.diff(angle, axis=0) - (np.cos(angle) * (speed / (3400 + height) - g0 / speed))[:-1]
    push = (0.0433333 * 0.3 * speed * np.exp(-0.09 * height))[:-1]
    signs = np.sign(np.arange(59) - 45.0)
    assert_allclose(turned, signs[:, None] * push, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("given", [{"steps": 0}, {"steps": 2.5}, {"runs": "many"}])
def test_a_variant_says_how_many_in_a_whole_number(given):
    what = rf"variant a in here: .*{next(iter(given))}.* must be a positive whole number.*, got"
    with pytest.raises(VariantError, match=what):
        read_variant("a", {"state": "x + v", "meter": "x + w", **given}, "here")


def test_the_lab_takes_the_steps_and_trajectories_of_the_variant(command, tmp_path, no_figures):
    table = '[variants.a]\nstate = "0.9*x + v"\nmeter = "x + w"\nsteps = 3\nruns = 200\n'
    (tmp_path / "own.toml").write_text(table)
    options = ["--variants", "own.toml", "--filters", "duof", "--out", "r", "--json", "n"]
    assert command("lab", "a", *options).exit_code == 0
    numbers = (tmp_path / "n").read_text()
    assert '"steps": 3,' in numbers and '"runs": 200,' in numbers
