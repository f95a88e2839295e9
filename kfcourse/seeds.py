"""Seeds: a whole number, or a generator that draws one."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

Seed: TypeAlias = int | np.random.Generator


def seed_number(seed: Seed) -> int:
    """The number that a seed stands for: itself, or one drawn from the generator, which goes on from there.

    Two calls with one generator give two numbers, so two simulations with it differ; generators in the same state give the same.

    Raises
    ------
    ValueError
        Neither a non-negative whole number nor a `numpy.random.Generator`.
    """
    if isinstance(seed, np.random.Generator):
        return int(seed.integers(2**63))
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise ValueError(f"the seed must be a non-negative whole number or a numpy.random.Generator, got {seed!r}")
    return int(seed)


def generator(seed: Seed) -> np.random.Generator:
    """The generator of a seed: itself, which goes on from where it is, or a new one of this number; errors of `seed_number`."""
    return seed if isinstance(seed, np.random.Generator) else np.random.default_rng(seed_number(seed))
