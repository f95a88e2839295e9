"""Keys of set o: probabilities of modes, merged laws, the IMM's mixing, a decision; by the functions of the package's filters.

A scalar meter that may fail: x' = a x + sqrt(q) v, y = x + C_i w in mode i.
"""

from __future__ import annotations

import numpy as np

from kfcourse.derivations.setting import Setting
from kfcourse.derivations.typed import read_line
from kfcourse.filters.multiple_models import mixture, modes_given, onward
from kfcourse.laws import Array, Gaussian, Measurement


def chain(mu: Array, pi: Array) -> tuple[Array, Array]:
    """Probabilities of the modes at the next step, (J,), and where each comes from, (J, J): column j sums to one."""
    expected, weights = onward(mu[None], pi)
    return expected[0], weights[0]


def posterior(c: Array, y: float, h: Array, F: Array) -> Array:
    """Probabilities of the modes after y, (J,)."""
    one = np.ones((1, 1))  # the density does not ask how the state is measured
    expected = [Measurement(np.array([[h_j]]), one, np.array([[F_j]]), one) for h_j, F_j in zip(h, F, strict=True)]
    return modes_given(c[None], expected, np.array([[y]]))[0][0]


def merged(mu: Array, z: Array, p: Array) -> tuple[Array, Array]:
    """Mean (n,) and covariance (n, n) of the mixture of N(z[j], p[j]) with the weights mu."""
    laws = [Gaussian(mean[None], cov[None]) for mean, cov in zip(z, p, strict=True)]
    found = mixture(laws, mu[None])
    return found.mean[0], found.cov[0]


def two_steps(y: Array, m: float, d: float, a: float, q: float, C: Array, pi: Array, first: Array) -> tuple[Array, Array]:
    """Probabilities of the modes after y_0 and after y_1, of x' = a x + sqrt(q) v, y = x + C_i w, x_0 ~ N(m, d)."""
    before = posterior(first, y[0], np.full(len(C), m), d + C**2)
    gain = d / (d + C**2)
    z, p = m + gain * (y[0] - m), gain * C**2
    c, weights = chain(before, pi)
    laws = [merged(column, a * z[:, None], (a**2 * p + q)[:, None, None]) for column in weights.T]
    h, Psi = (np.array([law[which].item() for law in laws]) for which in (0, 1))
    return before, posterior(c, y[1], h, Psi + C**2)


def mixed(mu: Array, pi: Array, z: Array, p: Array) -> tuple[Array, Array, Array]:
    """The IMM before a prediction: probabilities c (J,), means (J, n) and covariances (J, n, n) that each mode starts from."""
    c, w = chain(mu, pi)
    laws = [merged(column, z, p) for column in w.T]
    return c, np.array([mean for mean, _ in laws]), np.array([cov for _, cov in laws])


def decide(faulty: Array, missed: float, alarm: float) -> tuple[Array, Array]:
    """1 where the meter is called faulty, else 0, and the mean loss of that; of probabilities that it is faulty."""
    losses = np.stack([np.multiply(faulty, missed), np.multiply(1 - faulty, alarm)])
    return (losses[1] < losses[0]).astype(float), losses.min(axis=0)


# -- o5: the spread of the means, line by line

SPREAD = """W = mu*(p1 + z1^2) + (1 - mu)*(p2 + z2^2) - z^2
# the mean put in
  = mu*(p1 + z1^2) + (1 - mu)*(p2 + z2^2) - (mu*z1 + (1 - mu)*z2)^2
# variances and means apart
  = mu*p1 + (1 - mu)*p2 + mu*z1^2 + (1 - mu)*z2^2 - (mu*z1 + (1 - mu)*z2)^2
# the square multiplied out: mu - mu^2 is mu*(1 - mu)
  = mu*p1 + (1 - mu)*p2 + mu*(1 - mu)*z1^2 + mu*(1 - mu)*z2^2 - 2*mu*(1 - mu)*z1*z2
# a square
  = mu*p1 + (1 - mu)*p2 + mu*(1 - mu)*(z1 - z2)^2"""

GIVEN = frozenset({"mu", "z1", "z2", "p1", "p2"})


def spread_setting() -> Setting:
    """Two laws N(z1, p1), N(z2, p2) with the weights mu and 1 - mu: z and W are mean and variance of their mixture."""
    meanings = {"z": "mu*z1 + (1 - mu)*z2", "W": "mu*(p1 + (z1 - z)^2) + (1 - mu)*(p2 + (z2 - z)^2)"}
    return Setting(meanings={name: read_line(text) for name, text in meanings.items()}, known=GIVEN)
