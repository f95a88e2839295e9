"""The linear Kalman filter in four arithmetic forms, covariance analysis and steady state, against
independent references."""

import control
import numpy as np
import oracles
import pytest
from numpy.testing import assert_allclose

from kfcourse import Gaussian
from kfcourse.linear import LinearSystem, covariances, run, simulate, steady_state
from kfcourse.linear.arithmetic import FORMS

# Conditions of the covariances below are up to 1e4: rounding of float64 (1e-16) times that, over a
# dozen steps.
ROUNDING = {"rtol": 1e-10, "atol": 1e-10}


def system(n, p, m, seed):
    """Nothing zero, unit, diagonal or of equal size."""
    rng = np.random.default_rng(seed)

    def covariance(size):
        root = rng.normal(size=(size, size))
        return symmetrical(root @ root.T + 0.3 * np.eye(size))

    A = rng.normal(size=(n, n))
    A *= 0.95 / max(abs(np.linalg.eigvals(A)))
    B = rng.normal(size=(n, m)) if m else None
    plant = LinearSystem(A, rng.normal(size=(p, n)), covariance(n), covariance(p), B)
    return plant, Gaussian(rng.normal(size=n), 3 * covariance(n))


def symmetrical(matrix):
    return (matrix + matrix.T) / 2


# states, measurements, inputs, seed
SYSTEMS = {
    "scalar": (1, 1, 1, 1),
    "two states": (2, 1, 0, 2),
    "large": (4, 3, 2, 4),
    "more meters": (2, 3, 2, 5),
}


@pytest.fixture(params=list(SYSTEMS))
def case(request):
    """A system, a prior, measurements with gaps (12, 5, p), inputs (12, 5, m)."""
    n, p, m, seed = SYSTEMS[request.param]
    plant, prior = system(n, p, m, seed)
    rng = np.random.default_rng(seed + 100)
    u = rng.normal(size=(12, 5, m)) if m else None
    y = simulate(plant, prior, 12, 5, seed, u).y
    gaps = y.copy()
    gaps[3, 1] = np.nan  # a whole measurement
    gaps[5, :, 0] = np.nan  # a component, of all runs
    gaps[7:9, 2, -1] = np.nan  # a component, of one run
    gaps[0, 4] = np.nan
    return plant, prior, y, gaps, u


@pytest.mark.parametrize("arithmetic", FORMS)
def test_every_form_is_the_filter_of_the_page(case, arithmetic):
    plant, prior, _, y, u = case
    result = run(plant, prior, y, u, arithmetic)
    for i in range(y.shape[1]):
        known = np.zeros((12, len(plant.A))) if u is None else u[:, i] @ plant.B.T
        steps = [(plant.A, a, plant.Q, plant.H, np.zeros(len(plant.H)), plant.R) for a in known]
        references = zip(*oracles.kalman_loop(steps, prior, y[:, i]), strict=True)
        for laws, reference in zip((result.predicted, result.posterior), references, strict=True):
            assert_allclose(laws.mean[:, i], [mean for mean, _ in reference], **ROUNDING)
            assert_allclose(laws.cov[:, i], [cov for _, cov in reference], **ROUNDING)


# ---------------------------------------------------------------- covariance analysis


def test_covariances_in_advance_are_those_of_the_run(case):
    plant, prior, y, _, u = case
    laws, ahead = run(plant, prior, y, u), covariances(plant, prior.cov, len(y))
    assert_allclose(ahead.predicted, laws.predicted.cov[:, 0], **ROUNDING)
    assert_allclose(ahead.posterior, laws.posterior.cov[:, 0], **ROUNDING)
    F = plant.H @ ahead.predicted @ plant.H.T + plant.R
    assert_allclose(ahead.gains @ F, ahead.predicted @ plant.H.T, **ROUNDING)


def test_steady_state_against_python_control(case):
    plant = case[0]
    steady = steady_state(plant)
    L, P, _ = control.dlqe(plant.A, np.eye(len(plant.A)), plant.H, plant.Q, plant.R)
    assert_allclose(steady.predicted, P, rtol=1e-9, atol=1e-9)
    # its gain is that of the prediction
    assert_allclose(plant.A @ steady.gain, L, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("growth", [1.0, 1.1])
def test_no_steady_state_of_what_is_not_seen(growth):
    with pytest.raises(ValueError, match=r"no stabilising solution.*covariances"):
        steady_state(
            LinearSystem(np.diag([0.5, growth]), np.array([[1.0, 0]]), np.eye(2), np.eye(1))
        )


# ---------------------------------------------------------------- short words


@pytest.fixture(scope="module")
def ill_conditioned():
    """Position, velocity, acceleration; a meter of 1 mm, 300 starts known to a kilometre, in
    float32; and the right answer."""
    dt, rng = 0.1, np.random.default_rng(2)
    A = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])
    short = LinearSystem(
        A, np.array([[1.0, 0, 0]]), np.diag([0, 0, 1e-6]), np.array([[1e-6]])
    ).astype(np.float32)
    y = simulate(
        short.astype(float), Gaussian(np.zeros(3), 0.01 * np.eye(3)), 40, 300, seed=3
    ).y.astype(np.float32)
    prior = Gaussian(
        np.zeros(3), 1e6 * 10 ** rng.uniform(-0.5, 0.5, (300, 3))[:, :, None] * np.eye(3)
    )
    right = run(short.astype(float), prior, y.astype(float), arithmetic="square-root").posterior
    return short, prior, y, right


def lost(mean, right, since=0):
    """Share of the runs in which the estimate is more than three standard deviations from the right
    one at some step."""
    sd = np.sqrt(np.diagonal(right.cov, axis1=-2, axis2=-1))
    return (abs(mean - right.mean)[since:] > 3 * sd[since:]).any(axis=(0, 2)).mean()


def test_short_words_do_not_break_the_square_root(ill_conditioned):
    short, prior, y, right = ill_conditioned
    laws = run(short, prior, y, arithmetic="square-root").posterior
    assert lost(laws.mean, right) == 0
    # The condition number of the root is 1e6: with rounding of 6e-8 and 40 steps, below 0.3 for all
    # 300 starts.
    assert_allclose(laws.cov[5:], right.cov[5:], rtol=0.3, atol=0.3 * abs(right.cov[5:]).max())
    assert (np.diagonal(laws.cov, axis1=-2, axis2=-1) >= 0).all()


# ---------------------------------------------------------------- errors


GOOD = {"A": np.eye(2), "H": np.ones((1, 2)), "Q": np.eye(2), "R": np.eye(1), "B": np.ones((2, 1))}


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        (
            "A",
            np.ones((2, 3)),
            r"A must be a finite matrix, with 2 states and 1 measurements of the shape \(2, 2\)",
        ),
        ("Q", np.array([[1, 0.5], [0, 1]]), "Q is a covariance: symmetric and not negative"),
    ],
)
def test_a_system_that_is_none(name, value, message):
    with pytest.raises(ValueError, match=message):
        LinearSystem(**(GOOD | {name: value}))


GOOD_PRIOR = Gaussian(np.zeros(2), np.eye(2))
SOUND, BARE = LinearSystem(**GOOD), LinearSystem(**(GOOD | {"B": None}))


def ran(**change):
    return run(**({"system": SOUND, "prior": GOOD_PRIOR, "y": np.zeros((4, 3, 1))} | change))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ran(y=np.zeros((4, 1))), r"shape \(steps, runs, 1\), .* got \(4, 1\)"),
        (lambda: ran(y=np.full((4, 3, 1), np.inf)), "must be finite.*12 of them infinite"),
        (lambda: ran(prior=Gaussian(np.zeros(2), -np.eye(2))), "variances must not be negative"),
        (
            lambda: ran(arithmetic="exact"),
            "no form 'exact' of the Kalman filter; known: covariance, symmetrised",
        ),
        (lambda: ran(system=BARE, u=np.zeros((4, 3, 1))), "no matrix B"),
        (
            lambda: covariances(SOUND, np.eye(3), 4),
            r"expected a covariance \(2, 2\) and gains .* got \(3, 3\)",
        ),
    ],
)
def test_arguments_that_do_not_fit(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_the_square_root_needs_noise_of_the_meter():
    silent = LinearSystem(**(GOOD | {"R": np.zeros((1, 1))}))
    with pytest.raises(ValueError, match="R must be positive definite; use joseph"):
        run(silent, GOOD_PRIOR, np.zeros((4, 3, 1)), arithmetic="square-root")
    for arithmetic in ("covariance", "symmetrised", "joseph"):
        law = run(silent, GOOD_PRIOR, np.ones((1, 1, 1)), arithmetic=arithmetic).posterior
        assert_allclose(law.mean[0, 0], [0.5, 0.5], rtol=1e-14)  # x1 + x2 = 1 exactly
        assert_allclose(law.cov[0, 0], [[0.5, -0.5], [-0.5, 0.5]], rtol=1e-14)


@pytest.mark.parametrize("arithmetic", FORMS)
def test_float32_stays_float32(arithmetic, ill_conditioned):
    # In this case the variance of a measurement gets negative.
    short, prior, y, _ = ill_conditioned
    for laws in run(short, prior, y, arithmetic=arithmetic):
        assert (laws.mean.dtype, laws.cov.dtype) == (np.float32, np.float32)
    plant, calm = system(3, 2, 1, 4)
    y, u = simulate(plant, calm, 5, 3, 1).y, np.ones((5, 3, 1))
    y[2, 1, 0] = np.nan
    for laws in run(plant.astype(np.float32), calm, y, u, arithmetic):
        assert (laws.mean.dtype, laws.cov.dtype) == (np.float32, np.float32)
