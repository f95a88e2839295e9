"""Known mistakes of set o, question by question: edits of the keys, and what is said of each."""

from __future__ import annotations

from kfcourse.exercises.checks.editing import edits
from kfcourse.exercises.sets.o_modes.keys import chain, decide, merged, mixed, posterior, two_steps

TRANSPOSED = (
    "The matrix is used the other way round: its row is the mode that is left, its "
    "column the mode that is entered."
)
SPREAD_FORGOTTEN = (
    "Only the mean of the covariances is there. The laws disagree about the mean, "
    "and that is uncertainty too."
)
ROOT_FORGOTTEN = (
    "The density of a wide law is low everywhere: what stands before the exponential "
    "depends on the mode, and does not cancel."
)
DEVIATION = (
    "F is a variance already; the exponent, or the factor before it, takes it for a "
    "standard deviation."
)
OF_ROWS = (
    "The weights sum to one over the modes that are entered; they say where one of these "
    "comes from."
)
JOINT = (
    "These weights are joint probabilities: given the mode that is entered, they have to sum "
    "to one."
)
OTHER_AXIS = (
    "A vector acts along the wrong axis: the mode that is left is the row, and the mode "
    "that is entered the column."
)
ROW_TAKEN = (
    "The weights of a mode are taken from the wrong axis: they are its column; its row is "
    "what becomes of it."
)
NOT_MIXED = "Each mode goes on with its own law: which modes may it have come from?"
FIRST_AGAIN = (
    "The second step begins with the first law of the modes again: what has the first "
    "measurement told?"
)
CHAIN_FORGOTTEN = "The mode may have changed between the steps: the transition is missing."
SWAPPED = "The two losses have changed places: which one is paid if a fault is overlooked?"

# -- o1: the chain

BACKWARDS = "mu[:, None] * pi", "mu[:, None] * pi.T"
WRONG_CHAINS = edits(
    chain,
    ("transposed", TRANSPOSED, *BACKWARDS),
    (
        "row-for-column",
        OF_ROWS,
        "joint / joint.sum(axis=0)",
        "joint / joint.sum(axis=1, keepdims=True)",
    ),
    ("not-divided", JOINT, "joint / joint.sum(axis=0)", "joint"),
    (
        "transition-alone",
        "That is the chain without what is known of the mode now.",
        "joint / joint.sum(axis=0)",
        "pi / pi.sum(axis=0)",
    ),
    ("mode-kept", CHAIN_FORGOTTEN, "* pi", "* np.eye(len(mu))"),
    ("other-axis", OTHER_AXIS, "joint / joint.sum(axis=0)", "joint / joint.sum(axis=0)[:, None]"),
    ("other-axis", OTHER_AXIS, "mu[:, None] * pi", "mu * pi"),
)

# -- o2: Bayes' formula

LOGS = "-(nu**2) / (2 * F) - np.log(F) / 2"
WRONG_POSTERIORS = edits(
    posterior,
    (
        "prior-forgotten",
        "The likelihoods alone are compared: how probable was each mode before the measurement?",
        "c * np.exp",
        "np.exp",
    ),
    ("root-forgotten", ROOT_FORGOTTEN, " - np.log(F) / 2", ""),
    (
        "variance-before",
        "What stands before the exponential has another power of the variance.",
        "np.log(F) / 2",
        "np.log(F)",
    ),
    (
        "half-forgotten",
        "Look at the exponent of the normal density: a factor is missing.",
        "(2 * F)",
        "F",
    ),
    ("deviation-for-variance", DEVIATION, LOGS, "-(nu**2) / (2 * F**2) - np.log(F)"),
    ("deviation-for-variance", DEVIATION, "(2 * F)", "(2 * F**2)"),
    (
        "innovation-not-squared",
        "The exponent has the size of the innovation, not its square.",
        "-(nu**2)",
        "-np.abs(nu)",
    ),
    (
        "most-likely",
        "That is the likeliest mode alone; each mode has a probability.",
        "joint / joint.sum()",
        "(joint == joint.max()) * 1.0",
    ),
)

# -- o3: two steps

WRONG_STEPS = edits(
    two_steps,
    ("chain-forgotten", CHAIN_FORGOTTEN, "chain(before, pi)", "chain(before, np.eye(len(C)))"),
    ("transposed", TRANSPOSED, *BACKWARDS),
    ("other-axis", ROW_TAKEN, "column in w.T", "column in w"),
    ("spread-forgotten", SPREAD_FORGOTTEN, " + spread", ""),
    (
        "not-mixed",
        NOT_MIXED,
        "posterior(c, y[1], h, Psi + C**2)",
        "posterior(c, y[1], z, p + C**2)",
    ),
    ("first-law-again", FIRST_AGAIN, "chain(before, pi)", "first @ pi, chain(before, pi)[1]"),
    ("first-law-again", FIRST_AGAIN, "chain(before, pi)", "chain(first, pi)"),
    ("probability-kept", CHAIN_FORGOTTEN, "posterior(c, y", "posterior(before, y"),
    (
        "chance-forgotten",
        "At the second step only the densities are compared: how probable was each mode before "
        "the measurement?",
        "posterior(c, y",
        "posterior(1, y",
    ),
    (
        "not-corrected",
        "The laws of the state have not seen the first measurement.",
        "K = d / (d + C**2)",
        "K = 0 * C",
    ),
    (
        "not-moved",
        "The state has moved between the measurements.",
        "    z, p = a * z, a**2 * p + q\n",
        "",
    ),
    ("root-forgotten", ROOT_FORGOTTEN, " - np.log(F) / 2", ""),
)

# -- o4: laws merged

WRONG_MERGED = edits(
    merged,
    ("spread-forgotten", SPREAD_FORGOTTEN, " + spread", ""),
    (
        "spread-alone",
        "Only the spread of the means is there; each law has a covariance of its own.",
        "np.tensordot(mu, p, 1) + ",
        "",
    ),
    (
        "about-zero",
        "The means are squared about zero; a covariance is about the mean of all.",
        "z - mean",
        "z",
    ),
    (
        "sum-of-variables",
        "That is the covariance of a weighted sum of independent quantities; here one of the laws "
        "holds, we do not know which.",
        "np.tensordot(mu, p, 1) + spread",
        "np.tensordot(mu**2, p, 1)",
    ),
    (
        "equal-weights",
        "All laws count alike; each has its probability.",
        "    mean =",
        "    mu = np.full(len(mu), 1 / len(mu)); mean =",
    ),
    (
        "spread-subtracted",
        "The spread of the means is subtracted; it makes us less sure.",
        "+ spread",
        "- spread",
    ),
    (
        "no-cross-terms",
        "The spread has only squares of components; their products belong there too.",
        "+ spread",
        "+ np.diag(np.diagonal(spread))",
    ),
    (
        "information-merged",
        "The inverses are averaged, as of several measurements of one thing; here only one of the "
        "laws holds.",
        "np.tensordot(mu, p, 1) + spread",
        "np.linalg.inv(np.tensordot(mu, np.linalg.inv(p), 1))",
    ),
)

# -- o6: the IMM's mixing

WRONG_MIXED = edits(
    mixed,
    ("transposed", TRANSPOSED, *BACKWARDS),
    (
        "row-for-column",
        OF_ROWS,
        "joint / joint.sum(axis=0)",
        "joint / joint.sum(axis=1, keepdims=True)",
    ),
    ("not-divided", JOINT, "joint / joint.sum(axis=0)", "joint"),
    ("other-axis", ROW_TAKEN, "in w.T", "in w"),
    (
        "all-alike",
        "All modes start from the same mixture; each has come from other modes, and has weights "
        "of its own.",
        "merged(column, z, p)",
        "merged(mu, z, p)",
    ),
    ("spread-forgotten", SPREAD_FORGOTTEN, " + spread", ""),
    (
        "about-the-estimate",
        "The spread is about the mean of all laws; it is about the mean of those that lead to the "
        "mode.",
        "    laws =",
        "    mean = mu @ z\n    laws =",
        "[cov for _, cov in laws]",
        "[cov + np.outer(own - mean, own - mean) for own, cov in laws]",
    ),
)

# -- o7: sound or faulty

WRONG_DECISIONS = edits(
    decide,
    (
        "losses-ignored",
        "The likelier mode is called, whatever an error costs.",
        "(1 - faulty) * alarm < faulty * missed",
        "faulty > 0.5",
    ),
    ("losses-swapped", SWAPPED, "    called =", "    missed, alarm = alarm, missed; called ="),
    (
        "losses-swapped",
        SWAPPED,
        "np.where(called, (1 - faulty) * alarm, faulty * missed)",
        "np.where(called, (1 - faulty) * missed, faulty * alarm)",
    ),
    (
        "other-way",
        "The larger of the two losses is chosen.",
        "alarm < faulty",
        "alarm > faulty",
    ),
    (
        "odds",
        "That is the limit of the odds, the probability of a fault over that of none, not of the "
        "probability.",
        "(1 - faulty) * alarm < faulty * missed",
        "faulty > alarm / missed",
    ),
    (
        "right-calls-paid",
        "The loss is that of a right call: who says faulty pays only if the meter is sound.",
        "np.where(called, (1 - faulty) * alarm, faulty * missed)",
        "np.where(called, faulty * alarm, (1 - faulty) * missed)",
    ),
    (
        "probabilities-forgotten",
        "The losses alone are compared: how probable is each error?",
        "    called =",
        "    return 0 * faulty + (alarm < missed), 0 * faulty + min(alarm, missed)\n    called =",
    ),
)
