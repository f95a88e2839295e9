"""Known mistakes in a step of the filter: Jacobian (g1), prediction (g3), correction (g4), information form (g7)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from kfcourse.checks.question import Answer
from kfcourse.exercises import messages
from kfcourse.exercises.g_extended.hidden import root
from kfcourse.exercises.g_extended.keys import (
    Information,
    information,
    information_with,
    jacobian,
    jacobian_with,
    prediction_with,
    spread,
)
from kfcourse.exercises.shared import Map
from kfcourse.laws import Array, apply, gain, transpose

# -- g1: a Jacobian by differences


def _all_at_once(function: Map, x: Array, step: float) -> Array:
    difference = (function(x + step) - function(x - step)) / (2 * step)
    return np.repeat(difference[..., None], x.shape[-1], axis=-1)


WRONG_JACOBIANS: tuple[tuple[str, str, Answer], ...] = (
    ("one-sided", messages.ONE_SIDED_DIFFERENCE, jacobian_with(backward=0.0, divisor=lambda step: step)),
    ("one-sided", messages.ONE_SIDED_DIFFERENCE, jacobian_with(forward=0.0, divisor=lambda step: step)),
    ("divided-by-one-step", "The two points are two steps apart.", jacobian_with(divisor=lambda step: step)),
    (
        "step-forgotten",
        "It is a difference of values; divide by the distance of the points.",
        jacobian_with(divisor=lambda step: 1.0),
    ),
    ("all-at-once", "All components are shifted at once; a partial derivative shifts one.", _all_at_once),
    (
        "transposed",
        "It is transposed: row i holds the derivatives of component i of the function.",
        lambda function, x, step: np.swapaxes(jacobian(function, x, step), -1, -2),
    ),
    (
        "multiplied-by-step",
        "The distance of the points multiplies; it divides.",
        jacobian_with(divisor=lambda step: 1 / (2 * step)),
    ),
    ("multiplied-by-step", "The distance of the points is upside down.", jacobian_with(divisor=lambda step: 2 / step)),
    ("one-sided", messages.ONE_SIDED_DIFFERENCE, jacobian_with(backward=0.0)),
    (
        "half-step",
        "The points are half a step away; take a whole step to either side.",
        jacobian_with(forward=0.5, backward=-0.5, divisor=lambda step: step),
    ),
    (
        "second-difference",
        "That is the second derivative; the first is asked for.",
        lambda function, x, step: (
            jacobian_with(backward=0.0, divisor=lambda h: h**2)(function, x, step)
            - jacobian_with(forward=0.0, divisor=lambda h: h**2)(function, x, step)
        ),
    ),
    (
        "higher-order",
        "That is nearer to the derivative than the question's formula is; its two points, h to either side, are asked for.",
        lambda function, x, step: (4 * jacobian(function, x, step) - jacobian(function, x, 2 * step)) / 3,
    ),
)


# -- g3: the prediction

WRONG_PREDICTIONS: tuple[tuple[str, str, Answer], ...] = (
    (
        "jacobian-at-prediction",
        "The Jacobian is taken at the prediction; the function is expanded where the state is believed to be, at the estimate.",
        prediction_with(at=lambda z, f: f(z)),
    ),
    (
        "noise-at-prediction",
        "The factor of the noise is taken at the prediction; the noise acts on the state before the step.",
        prediction_with(noise_at=lambda z, f: f(z)),
    ),
    (
        "jacobian-transposed",
        "The Jacobian is transposed: in M p M^T the transposed one stands on the right.",
        prediction_with(lambda Phi, p, g, D: spread(transpose(Phi), p, g, D)),
    ),
    (
        "noise-forgotten",
        "The noise of the object is not added: a filter that believes its object to be undisturbed stops learning.",
        prediction_with(lambda Phi, p, g, D: Phi @ p @ transpose(Phi)),
    ),
    (
        "factor-forgotten",
        "The covariance of the noise is added without its factor g.",
        prediction_with(lambda Phi, p, g, D: Phi @ p @ transpose(Phi) + D),
    ),
    (
        "noise-covariance-forgotten",
        "The covariance of the noise is missing between its factors.",
        prediction_with(lambda Phi, p, g, D: spread(Phi, p, g, np.eye(len(D)))),
    ),
    (
        "noise-power",
        "The factor of the noise enters with the wrong power: a covariance goes with it on both sides.",
        prediction_with(lambda Phi, p, g, D: Phi @ p @ transpose(Phi) + g @ D),
    ),
    (
        "factor-transposed",
        "The factor of the noise is transposed: in g D g^T the transposed one stands on the right.",
        prediction_with(lambda Phi, p, g, D: Phi @ p @ transpose(Phi) + transpose(g) @ D @ g),
    ),
    (
        "covariance-squared",
        "The covariance of the noise enters twice, as if it were a root.",
        prediction_with(lambda Phi, p, g, D: spread(Phi, p, g, D @ D)),
    ),
    (
        "slope-power",
        "The Jacobian enters only once: a covariance goes with it on both sides.",
        prediction_with(lambda Phi, p, g, D: Phi @ p + g @ D @ transpose(g)),
    ),
    (
        "state-forgotten",
        "Only the noise is there: the uncertainty of the estimate comes through the equation too.",
        prediction_with(lambda Phi, p, g, D: g @ D @ transpose(g)),
    ),
    (
        "mean-by-jacobian",
        "The estimate is multiplied by the Jacobian; the prediction is the function itself at the estimate.",
        prediction_with(mean=lambda z, f, Phi: apply(Phi(z), z)),
    ),
    ("mean-kept", "The prediction is not the estimate: the object moves.", prediction_with(mean=lambda z, f, Phi: z)),
    (
        "noise-by-deviation",
        "A root of the noise's covariance stands between its factors; the covariance itself belongs there.",
        prediction_with(lambda Phi, p, g, D: spread(Phi, p, g, np.sqrt(np.abs(D)))),
    ),
    ("noise-sign", messages.NOISE_SIGN, prediction_with(lambda Phi, p, g, D: spread(Phi, p, g, -D))),
    ("mean-twice", "The mean goes through the state equation twice.", prediction_with(mean=lambda z, f, Phi: f(f(z)))),
    (
        "product",
        "The two parts of the covariance are multiplied; they add.",
        prediction_with(cov=lambda Phi, p, g, D_xi: (Phi @ p @ transpose(Phi)) * (g @ D_xi @ transpose(g))),
    ),
)


# -- g4: the correction


def of_gain(Psi: Array, G: Array, R: Array) -> Array:
    """K = Psi G^T (G Psi G^T + R)^-1."""
    return gain(Psi @ transpose(G), G @ Psi @ transpose(G) + R)


def correction_with(
    K_of: Callable[[Array, Array, Array], Array] = of_gain,
    expected: Callable[[Array, Map, Map], Array] = lambda lam, S, H: S(lam),
    covariance: Callable[[Array, Array, Array], Array] = lambda Psi, K, G: Psi - K @ G @ Psi,
    sign: float = 1.0,
) -> Answer:
    """A correction with one thing changed."""

    def answer(lam: Array, Psi: Array, y: Array, S: Map, H: Map, D_n: Map) -> tuple[Array, Array]:
        K = K_of(Psi, H(lam), D_n(lam))
        return lam + sign * apply(K, y - expected(lam, S, H)), covariance(Psi, K, H(lam))

    return answer


WRONG_CORRECTIONS: tuple[tuple[str, str, Answer], ...] = (
    (
        "noise-of-meter-forgotten",
        "The noise of the meter is missing in the covariance that the gain is divided by: the meter is taken as perfect.",
        correction_with(lambda Psi, G, R: gain(Psi @ transpose(G), G @ Psi @ transpose(G))),
    ),
    (
        "forms-mixed",
        "That gain puts the covariance of the prediction into the information form's formula, which has that of the estimate.",
        correction_with(lambda Psi, G, R: gain(Psi @ transpose(G), R)),
    ),
    (
        "noise-by-deviation",
        messages.NOISE_BY_DEVIATION,
        correction_with(lambda Psi, G, R: gain(Psi @ transpose(G), G @ Psi @ transpose(G) + root(R))),
    ),
    (
        "gain-not-divided",
        "The gain is not divided by the covariance of the innovation.",
        correction_with(lambda Psi, G, R: Psi @ transpose(G)),
    ),
    (
        "gain-without-Psi",
        messages.GAIN_WITHOUT_PSI,
        correction_with(lambda Psi, G, R: gain(transpose(G), G @ Psi @ transpose(G) + R)),
    ),
    (
        "expected-by-jacobian",
        "The prediction is multiplied by the Jacobian; what is expected of y is the signal itself at the prediction.",
        correction_with(expected=lambda lam, S, H: apply(H(lam), lam)),
    ),
    ("innovation-without-S", messages.MEASUREMENT_FOR_INNOVATION, correction_with(expected=lambda lam, S, H: np.zeros(()))),
    ("innovation-sign", messages.INNOVATION_SIGN, correction_with(sign=-1.0)),
    ("covariance-kept", messages.COVARIANCE_KEPT, correction_with(covariance=lambda Psi, K, G: Psi)),
    ("covariance-added", messages.COVARIANCE_ADDED, correction_with(covariance=lambda Psi, K, G: Psi + K @ G @ Psi)),
    (
        "covariance-once",
        "K H is a share, without units: it has to be multiplied by Psi before it is subtracted from it.",
        correction_with(covariance=lambda Psi, K, G: Psi - K @ G),
    ),
    (
        "share-only",
        messages.SHARE_ONLY,
        correction_with(covariance=lambda Psi, K, G: np.eye(Psi.shape[-1]) - K @ G),
    ),
    (
        "noise-by-deviation",
        messages.NOISE_BY_DEVIATION,
        correction_with(lambda Psi, G, R: gain(Psi @ transpose(G), G @ Psi @ transpose(G) + np.sqrt(np.abs(R)))),
    ),
    (
        "noise-squared",
        messages.NOISE_SQUARED,
        correction_with(lambda Psi, G, R: gain(Psi @ transpose(G), G @ Psi @ transpose(G) + R @ R)),
    ),
    (
        "noise-inherited",
        messages.NOISE_INHERITED,
        correction_with(
            covariance=lambda Psi, K, G: (np.eye(Psi.shape[-1]) - K @ G) @ Psi @ transpose(np.eye(Psi.shape[-1]) - K @ G)
        ),
    ),
    (
        "gain-multiplied",
        messages.GAIN_MULTIPLIED,
        correction_with(lambda Psi, G, R: Psi @ transpose(G) @ (G @ Psi @ transpose(G) + R)),
    ),
    ("covariance-explained", messages.EXPLAINED_ONLY, correction_with(covariance=lambda Psi, K, G: K @ G @ Psi)),
)


# -- g7: the information form


def _gain_from_prior(p: Array, W: Array, H: Array, D_n: Array) -> Array:
    return gain(np.linalg.pinv(W) @ transpose(H), D_n)


def _through_inverse(W: Array, H: Array, D_n: Array) -> tuple[Array, Array]:
    Psi = np.linalg.pinv(W)
    K = of_gain(Psi, H, D_n)
    return Psi - K @ H @ Psi, K


WRONG_INFORMATION: tuple[tuple[str, str, Information], ...] = (
    ("inverse-forgotten", messages.INFORMATION_FOR_COVARIANCE, information_with(inverted=False)),
    (
        "inverse-forgotten-in-p",
        messages.INFORMATION_FOR_COVARIANCE,
        lambda W, H, D_n: (information_with(inverted=False)(W, H, D_n)[0], information(W, H, D_n)[1]),
    ),
    (
        "noise-not-inverted",
        "The covariance of the noise multiplies; a noisy measurement must tell less: its inverse belongs there.",
        information_with(added=lambda H, D_n: transpose(H) @ D_n @ H),
    ),
    (
        "prior-inverted",
        "W is an information already and is not inverted again; where nothing is known it has no inverse.",
        information_with(prior=np.linalg.pinv),
    ),
    (
        "prior-ignored",
        "Only the measurement's information is there: what was known before is added to it.",
        information_with(prior=lambda W: 0 * W),
    ),
    (
        "information-subtracted",
        "Information is added: a measurement cannot take any away.",
        information_with(added=lambda H, D_n: -transpose(H) @ np.linalg.solve(D_n, H)),
    ),
    (
        "gain-from-prediction",
        "The gain of this form has the covariance of the estimate, not that of the prediction.",
        information_with(K_of=_gain_from_prior),
    ),
    (
        "gain-not-divided",
        "The gain is not divided by the covariance of the noise.",
        information_with(K_of=lambda p, W, H, D_n: p @ transpose(H)),
    ),
    (
        "gain-by-information",
        "The gain is multiplied by the information; the covariance, its inverse, belongs there.",
        lambda W, H, D_n: (information(W, H, D_n)[0], information_with(inverted=False)(W, H, D_n)[1]),
    ),
    (
        "gain-multiplied",
        "The gain is multiplied by the covariance of the noise; it is divided by it.",
        information_with(K_of=lambda p, W, H, D_n: p @ transpose(H) @ D_n),
    ),
    ("through-the-inverse", "The inverse of W is taken; where nothing is known before there is none.", _through_inverse),
)
