"""Known mistakes of set o, question by question, and what is said of each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse.checks.question import Answer
from kfcourse.exercises.o_modes.keys import chain, decide, merged, mixed, posterior
from kfcourse.laws import Array

Weights = Callable[[Array, Array], tuple[Array, Array]]
Merge = Callable[[Array, Array, Array], tuple[Array, Array]]

TRANSPOSED = "The matrix is used the other way round: its row is the mode that is left, its column the mode that is entered."
SPREAD_FORGOTTEN = "Only the mean of the covariances is there. The laws disagree about the mean, and that is uncertainty too."
NOT_NORMALISED = "The probabilities do not sum to one."
ROOT_FORGOTTEN = (
    "The density of a wide law is low everywhere: what stands before the exponential depends on the mode, and does not cancel."
)
DEVIATION = "F is a variance already; the exponent, or the factor before it, takes it for a standard deviation."
OF_ROWS = "The weights sum to one over the modes that are entered; they say where one of these comes from."
JOINT = "These weights are joint probabilities: given the mode that is entered, they have to sum to one."
OTHER_AXIS = "A vector acts along the wrong axis: the mode that is left is the row, and the mode that is entered the column."
ROW_TAKEN = "The weights of a mode are taken from the wrong axis: they are its column; its row is what becomes of it."
NOT_MIXED = "Each mode goes on with its own law: which modes may it have come from?"
FIRST_AGAIN = "The second step begins with the first law of the modes again: what has the first measurement told?"
CHAIN_FORGOTTEN = "The mode may have changed between the steps: the transition is missing."

SWAPPED = "The two losses have changed places: which one is paid if a fault is overlooked?"

# -- o1: the chain


def of_rows(mu: Array, pi: Array) -> tuple[Array, Array]:
    """Joint probabilities divided by the sums of rows."""
    joint = mu[:, None] * pi
    return joint.sum(axis=0), joint / joint.sum(axis=1, keepdims=True)


WRONG_CHAINS: tuple[tuple[str, str, Answer], ...] = (
    ("transposed", TRANSPOSED, lambda mu, pi: (pi @ mu, (pi.T * mu[:, None]) / (pi @ mu))),
    (
        "row-for-column",
        OF_ROWS,
        of_rows,
    ),
    (
        "not-divided",
        JOINT,
        lambda mu, pi: (mu @ pi, mu[:, None] * pi),
    ),
    (
        "transition-alone",
        "That is the chain without what is known of the mode now.",
        lambda mu, pi: (mu @ pi, pi / pi.sum(axis=0)),
    ),
    ("mode-kept", CHAIN_FORGOTTEN, lambda mu, pi: (mu, np.eye(len(mu)))),
    ("other-axis", OTHER_AXIS, lambda mu, pi: (mu @ pi, mu[:, None] * pi / (mu @ pi)[:, None])),
    ("other-axis", OTHER_AXIS, lambda mu, pi: (mu @ pi, mu * pi / (mu @ pi))),
    ("other-axis", OTHER_AXIS, lambda mu, pi: ((mu * pi).sum(axis=0), mu * pi / (mu * pi).sum(axis=0))),
)

# -- o2: Bayes' formula


def bayes(density: Callable[[Array, Array], Array], prior: Callable[[Array], Array] = lambda c: c, divide: bool = True) -> Answer:
    """The posterior with another density of (innovation, F), another prior, or not divided by the sum."""

    def answer(c: Array, y: float, h: Array, F: Array) -> Array:
        joint = prior(c) * density(y - h, F)
        return joint / joint.sum() if divide else joint

    return answer


def normal(nu: Array, F: Array) -> Array:
    return np.exp(-(nu**2) / (2 * F)) / np.sqrt(2 * np.pi * F)


WRONG_POSTERIORS: tuple[tuple[str, str, Answer], ...] = (
    (
        "prior-forgotten",
        "The likelihoods alone are compared: how probable was each mode before the measurement?",
        bayes(normal, prior=np.ones_like),
    ),
    (
        "root-forgotten",
        ROOT_FORGOTTEN,
        bayes(lambda nu, F: np.exp(-(nu**2) / (2 * F))),
    ),
    (
        "variance-before",
        "What stands before the exponential has another power of the variance.",
        bayes(lambda nu, F: normal(nu, F) / np.sqrt(F)),
    ),
    ("not-divided", NOT_NORMALISED, bayes(normal, divide=False)),
    (
        "half-forgotten",
        "Look at the exponent of the normal density: a factor is missing.",
        bayes(lambda nu, F: normal(nu, F / 2) / np.sqrt(2)),
    ),
    (
        "deviation-for-variance",
        DEVIATION,
        bayes(lambda nu, F: np.exp(-(nu**2) / (2 * F**2)) / F),
    ),
    (
        "deviation-for-variance",
        DEVIATION,
        bayes(lambda nu, F: normal(nu, F**2) * np.sqrt(F)),
    ),
    (
        "exponent-grows",
        "The exponent has the wrong sign: what is further off is less likely.",
        bayes(lambda nu, F: np.exp(nu**2 / (2 * F)) / np.sqrt(F)),
    ),
    (
        "innovation-not-squared",
        "The exponent has the size of the innovation, not its square.",
        bayes(lambda nu, F: np.exp(-np.abs(nu) / (2 * F)) / np.sqrt(F)),
    ),
    (
        "measurement-for-innovation",
        "The density is taken at y as if zero were expected.",
        lambda c, y, h, F: bayes(normal)(c, y, 0 * h, F),
    ),
    (
        "densities-added",
        "Prior and likelihood are added; Bayes' formula multiplies them.",
        lambda c, y, h, F: (c + normal(y - h, F)) / (c + normal(y - h, F)).sum(),
    ),
    (
        "most-likely",
        "That is the likeliest mode alone; each mode has a probability.",
        lambda c, y, h, F: (posterior(c, y, h, F) == posterior(c, y, h, F).max()) * 1.0,
    ),
)

# -- o3: two steps


def two_steps_with(
    weights: Weights = chain,
    merge: Merge = merged,
    given: Answer = posterior,
    corrected: bool = True,
    moved: bool = True,
    noise: bool = True,
    own: bool = False,
) -> Answer:
    """Both steps with parts of them changed; `own`: each mode goes on with its own law, unmixed."""

    def answer(y: Array, m: float, d: float, a: float, q: float, C: Array, pi: Array, first: Array) -> tuple[Array, Array]:
        K = d / (d + C**2) if corrected else 0 * C
        before = given(first, y[0], np.full(len(C), m), d + C**2)
        z, p = m + K * (y[0] - m), d - K * d
        if moved:
            z, p = a * z, a**2 * p + q
        c, w = weights(before, pi)
        if not own:
            laws = [merge(w[:, j], z[:, None], p[:, None, None]) for j in range(len(C))]
            z, p = (np.array([np.ravel(law[which])[0] for law in laws]) for which in (0, 1))
        return before, given(c, y[1], z, p + C**2 if noise else p)

    return answer


def covariances_alone(mu: Array, z: Array, p: Array) -> tuple[Array, Array]:
    return mu @ z, np.tensordot(mu, p, 1)


def by_squares(mu: Array, z: Array, p: Array) -> tuple[Array, Array]:
    """Mean of the square less square of the mean: another covariance if the weights do not sum to one."""
    mean, square = about_zero(mu, z, p)
    return mean, square - np.outer(mean, mean)


def rows(mu: Array, pi: Array) -> tuple[Array, Array]:
    """Shares whose rows are taken for columns."""
    c, w = chain(mu, pi)
    return c, w.T


def first_forgotten(y: Array, m: float, d: float, a: float, q: float, C: Array, pi: Array, first: Array) -> tuple[Array, Array]:
    """The second step begins with the first law of the modes again."""
    return two_steps_with(weights=lambda mu, pi: (first @ pi, chain(mu, pi)[1]))(y, m, d, a, q, C, pi, first)


def first_mixed(y: Array, m: float, d: float, a: float, q: float, C: Array, pi: Array, first: Array) -> tuple[Array, Array]:
    """The chain moves on from the first law of the modes: shares and probabilities both."""
    return two_steps_with(weights=lambda mu, pi: chain(first, pi))(y, m, d, a, q, C, pi, first)


def chain_before(y: Array, m: float, d: float, a: float, q: float, C: Array, pi: Array, first: Array) -> tuple[Array, Array]:
    """The chain moves before the first measurement."""
    return two_steps_with()(y, m, d, a, q, C, pi, first @ pi)


def mixture_kept(y: Array, m: float, d: float, a: float, q: float, C: Array, pi: Array, first: Array) -> tuple[Array, Array]:
    """Bayes' formula with the mixtures as they are."""
    K = d / (d + C**2)
    before = posterior(first, y[0], np.full(len(C), m), d + C**2)
    z, p = a * (m + K * (y[0] - m)), a**2 * (d - K * d) + q
    joint = before[:, None] * pi * normal(y[1] - z[:, None], p[:, None] + C**2)
    return before, joint.sum(axis=0) / joint.sum()


def by_density_alone(y: Array, m: float, d: float, a: float, q: float, C: Array, pi: Array, first: Array) -> tuple[Array, Array]:
    """The second measurement weighs the modes without what the chain says of them."""
    before, after = two_steps_with()(y, m, d, a, q, C, pi, first)
    likelihood = after / chain(before, pi)[0]
    return before, likelihood / likelihood.sum()


WRONG_STEPS: tuple[tuple[str, str, Answer], ...] = (
    ("chain-forgotten", CHAIN_FORGOTTEN, two_steps_with(weights=lambda mu, pi: (mu, np.eye(len(mu))))),
    ("transposed", TRANSPOSED, two_steps_with(weights=lambda mu, pi: chain(mu, pi.T / pi.T.sum(axis=1, keepdims=True)))),
    ("transposed", TRANSPOSED, two_steps_with(weights=lambda mu, pi: (pi @ mu, (pi.T * mu[:, None]) / (pi @ mu)))),
    ("other-axis", ROW_TAKEN, two_steps_with(weights=rows)),
    ("other-axis", ROW_TAKEN, two_steps_with(weights=rows, merge=by_squares)),
    ("spread-forgotten", SPREAD_FORGOTTEN, two_steps_with(merge=covariances_alone)),
    ("not-mixed", NOT_MIXED, two_steps_with(own=True)),
    (
        "mixture-kept",
        "The mixtures are kept as they are, and that is exact; here a normal law takes the place of each before the measurement.",
        mixture_kept,
    ),
    (
        "first-law-again",
        FIRST_AGAIN,
        first_forgotten,
    ),
    (
        "first-law-again",
        FIRST_AGAIN,
        first_mixed,
    ),
    (
        "probability-kept",
        CHAIN_FORGOTTEN,
        two_steps_with(weights=lambda mu, pi: (mu, chain(mu, pi)[1])),
    ),
    (
        "chance-forgotten",
        "At the second step only the densities are compared: how probable was each mode before the measurement?",
        by_density_alone,
    ),
    ("not-corrected", "The laws of the state have not seen the first measurement.", two_steps_with(corrected=False)),
    ("not-moved", "The state has moved between the measurements.", two_steps_with(moved=False)),
    ("chain-before", "The law of the modes that is given is already that at the first measurement.", chain_before),
    (
        "meter-noise-forgotten",
        "At the second step the noise of the meter is missing in the variance of what is measured.",
        two_steps_with(noise=False),
    ),
    (
        "root-forgotten",
        ROOT_FORGOTTEN,
        two_steps_with(given=bayes(lambda nu, F: np.exp(-(nu**2) / (2 * F)))),
    ),
)

# -- o4: laws merged


def about_zero(mu: Array, z: Array, p: Array) -> tuple[Array, Array]:
    return mu @ z, np.tensordot(mu, p, 1) + np.einsum("j,ja,jb->ab", mu, z, z)


def spread(mu: Array, z: Array, p: Array) -> Array:
    """Of the means, weighted."""
    e = z - mu @ z
    return np.einsum("j,ja,jb->ab", mu, e, e)


def equally(mu: Array, z: Array, p: Array) -> tuple[Array, Array]:
    return merged(np.full(len(mu), 1 / len(mu)), z, p)


def likeliest(mu: Array, z: Array, p: Array) -> tuple[Array, Array]:
    return z[mu.argmax()], p[mu.argmax()]


WRONG_MERGED: tuple[tuple[str, str, Answer], ...] = (
    ("spread-forgotten", SPREAD_FORGOTTEN, covariances_alone),
    (
        "spread-alone",
        "Only the spread of the means is there; each law has a covariance of its own.",
        lambda mu, z, p: (mu @ z, spread(mu, z, p)),
    ),
    ("about-zero", "The means are squared about zero; a covariance is about the mean of all.", about_zero),
    (
        "sum-of-variables",
        "That is the covariance of a weighted sum of independent quantities; here one of the laws holds, we do not know which.",
        lambda mu, z, p: (mu @ z, np.tensordot(mu**2, p, 1)),
    ),
    (
        "spread-subtracted",
        "The spread of the means is subtracted; it makes us less sure.",
        lambda mu, z, p: (mu @ z, np.tensordot(mu, p, 1) - spread(mu, z, p)),
    ),
    ("equal-weights", "All laws count alike; each has its probability.", equally),
    ("likeliest", "That is the likeliest law alone; the others are left out.", likeliest),
    (
        "spread-unweighted",
        "The spread of the means is not weighted with the probabilities.",
        lambda mu, z, p: (mu @ z, np.tensordot(mu, p, 1) + np.einsum("ja,jb->ab", z - mu @ z, z - mu @ z)),
    ),
    (
        "no-cross-terms",
        "The spread has only squares of components; their products belong there too.",
        lambda mu, z, p: (mu @ z, np.tensordot(mu, p, 1) + np.diag(np.diagonal(spread(mu, z, p)))),
    ),
    (
        "information-merged",
        "The inverses are averaged, as of several measurements of one thing; here only one of the laws holds.",
        lambda mu, z, p: (mu @ z, np.linalg.inv(np.tensordot(mu, np.linalg.inv(p), 1))),
    ),
)

# -- o6: the IMM's mixing


def mixed_with(weights: Weights = chain, merge: Merge = merged) -> Answer:
    """The mixing with other weights, or laws merged otherwise."""

    def answer(mu: Array, pi: Array, z: Array, p: Array) -> tuple[Array, Array, Array]:
        c, w = weights(mu, pi)
        laws = [merge(w[:, j], z, p) for j in range(len(mu))]
        return c, np.array([law[0] for law in laws]), np.array([law[1] for law in laws])

    return answer


def all_alike(mu: Array, pi: Array, z: Array, p: Array) -> tuple[Array, Array, Array]:
    """Every mode starts from the mixture of all."""
    m, P = merged(mu, z, p)
    return mu @ pi, np.tile(m, (len(mu), 1)), np.tile(P, (len(mu), 1, 1))


def about_the_estimate(mu: Array, pi: Array, z: Array, p: Array) -> tuple[Array, Array, Array]:
    """Deviations from the mean of all, not of those that lead to a mode."""
    c, means, _ = mixed(mu, pi, z, p)
    w, e = chain(mu, pi)[1], z - mu @ z
    return c, means, np.einsum("ij,iab->jab", w, p + e[:, :, None] * e[:, None, :])


WRONG_MIXED: tuple[tuple[str, str, Answer], ...] = (
    ("transposed", TRANSPOSED, mixed_with(weights=lambda mu, pi: (pi @ mu, (pi.T * mu[:, None]) / (pi @ mu)))),
    (
        "row-for-column",
        OF_ROWS,
        mixed_with(weights=of_rows),
    ),
    (
        "not-divided",
        JOINT,
        mixed_with(weights=lambda mu, pi: (mu @ pi, mu[:, None] * pi)),
    ),
    (
        "other-axis",
        ROW_TAKEN,
        mixed_with(weights=rows),
    ),
    ("not-mixed", NOT_MIXED, lambda mu, pi, z, p: (mu @ pi, z, p)),
    (
        "all-alike",
        "All modes start from the same mixture; each has come from other modes, and has weights of its own.",
        all_alike,
    ),
    ("spread-forgotten", SPREAD_FORGOTTEN, mixed_with(merge=covariances_alone)),
    ("probability-kept", CHAIN_FORGOTTEN, lambda mu, pi, z, p: (mu, *mixed(mu, pi, z, p)[1:])),
    (
        "about-the-estimate",
        "The spread is about the mean of all laws; it is about the mean of those that lead to the mode.",
        about_the_estimate,
    ),
)

# -- o7: sound or faulty


WRONG_DECISIONS: tuple[tuple[str, str, Answer], ...] = (
    (
        "losses-ignored",
        "The likelier mode is called, whatever an error costs.",
        lambda f, missed, alarm: ((f > 0.5) * 1.0, np.where(f > 0.5, (1 - f) * alarm, f * missed)),
    ),
    (
        "losses-swapped",
        SWAPPED,
        lambda f, missed, alarm: decide(f, alarm, missed),
    ),
    (
        "losses-swapped",
        SWAPPED,
        lambda f, missed, alarm: (
            decide(f, alarm, missed)[0],
            np.where(decide(f, alarm, missed)[0] == 1, (1 - f) * alarm, f * missed),
        ),
    ),
    (
        "other-way",
        "The larger of the two losses is chosen.",
        lambda f, missed, alarm: ((f * missed < (1 - f) * alarm) * 1.0, np.maximum(f * missed, (1 - f) * alarm)),
    ),
    (
        "odds",
        "That is the limit of the odds, the probability of a fault over that of none, not of the probability.",
        lambda f, missed, alarm: ((f > alarm / missed) * 1.0, np.where(f > alarm / missed, (1 - f) * alarm, f * missed)),
    ),
    (
        "right-calls-paid",
        "The loss is that of a right call: who says faulty pays only if the meter is sound.",
        lambda f, missed, alarm: (
            decide(f, missed, alarm)[0],
            np.where(decide(f, missed, alarm)[0] == 1, f * alarm, (1 - f) * missed),
        ),
    ),
    (
        "probabilities-forgotten",
        "The losses alone are compared: how probable is each error?",
        lambda f, missed, alarm: (np.full(np.shape(f), float(missed > alarm)), np.full(np.shape(f), float(min(missed, alarm)))),
    ),
)
