"""Keys of set o: probabilities of modes, merged laws, the IMM's mixing, a decision.

A scalar meter that may fail: x' = a x + sqrt(q) v, y = x + C_i w in mode i.
"""

from __future__ import annotations

import numpy as np

from kfcourse.exercises.derivations.setting import Setting
from kfcourse.exercises.derivations.typed import read_line
from kfcourse.laws import Array


def chain(mu: Array, pi: Array) -> tuple[Array, Array]:
    """Probabilities of the modes at the next step, (J,), and where each comes from, (J, J): column
    j sums to one."""
    joint = mu[:, None] * pi
    return joint.sum(axis=0), joint / joint.sum(axis=0)


def posterior(c: Array, y: float, h: Array, F: Array) -> Array:
    """Probabilities of the modes after y, (J,)."""
    nu = y - h
    logs = -(nu**2) / (2 * F) - np.log(F) / 2
    joint = c * np.exp(logs - logs.max())
    return joint / joint.sum()


def merged(mu: Array, z: Array, p: Array) -> tuple[Array, Array]:
    """Mean (n,) and covariance (n, n) of the mixture of N(z[j], p[j]) with the weights mu."""
    mean = mu @ z
    e = z - mean
    spread = np.einsum("j,ja,jb->ab", mu, e, e)
    return mean, np.tensordot(mu, p, 1) + spread


def two_steps(
    y: Array, m: float, d: float, a: float, q: float, C: Array, pi: Array, first: Array
) -> tuple[Array, Array]:
    """Probabilities of the modes after y_0 and after y_1, of x' = a x + sqrt(q) v, y = x + C_i w,
    x_0 ~ N(m, d)."""
    before = posterior(first, y[0], np.full(len(C), m), d + C**2)
    K = d / (d + C**2)
    z, p = m + K * (y[0] - m), d - K * d
    z, p = a * z, a**2 * p + q
    c, w = chain(before, pi)
    laws = [merged(column, z[:, None], p[:, None, None]) for column in w.T]
    h, Psi = (np.array([law[which].item() for law in laws]) for which in (0, 1))
    return before, posterior(c, y[1], h, Psi + C**2)


def mixed(mu: Array, pi: Array, z: Array, p: Array) -> tuple[Array, Array, Array]:
    """The IMM before a prediction: probabilities c (J,), means (J, n) and covariances (J, n, n)
    that each mode starts from."""
    c, w = chain(mu, pi)
    laws = [merged(column, z, p) for column in w.T]
    return c, np.array([mean for mean, _ in laws]), np.array([cov for _, cov in laws])


def decide(faulty: Array, missed: float, alarm: float) -> tuple[Array, Array]:
    """1 where the meter is called faulty, else 0, and the mean loss of that; of probabilities that
    it is faulty."""
    called = (1 - faulty) * alarm < faulty * missed
    return called * 1.0, np.where(called, (1 - faulty) * alarm, faulty * missed)


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
    """Two laws N(z1, p1), N(z2, p2) with the weights mu and 1 - mu: z and W are mean and variance
    of their mixture."""
    meanings = {
        "z": "mu*z1 + (1 - mu)*z2",
        "W": "mu*(p1 + (z1 - z)^2) + (1 - mu)*(p2 + (z2 - z)^2)",
    }
    return Setting(meanings={name: read_line(text) for name, text in meanings.items()}, known=GIVEN)
