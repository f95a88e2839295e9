"""Loops of the compiled engine in which no formula of a model stands.  Only with numba is this imported.

The formulas are in printed loops over trajectories (`compiled.loop`), which these call: all filters use the same, compiled once.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types

_ROW, _ROWS, _STARTS = types.float64[::1], types.float64[:, ::1], types.int64[::1]
_OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "fastmath": {"reassoc", "nsz"}}

# Printed, with the constants c of the step and what they add up: step(c, y, lam, Psi, z, p, x, weight, totals), with lam and Psi
# in place; of a design sums(number, c, y, lam, Psi, x, x_next, near, totals) for each regression, and after(c, y, lam, Psi).
_STEP, _AFTER = (types.FunctionType(types.void(*[_ROW] * count)) for count in (9, 4))
_PAIRS = types.FunctionType(types.void(types.int64, *[_ROW] * 8))


@njit(types.void(_STEP, _ROWS, _ROWS, _ROWS, _ROW, _STARTS, *[_ROW] * 6, *[_ROWS] * 5), **_OPTIONS)
def advance(step, table, y, x, weight, starts, lam, Psi, lam_next, Psi_next, z, p, errors, squares, own, normalised, largest):
    """Steps of a filter, and of each the sums over batches that `Sums.record` keeps, (K, B).

    The constants of each step are a row of the table; z and p of the last are left if there is room for more than a batch.
    """
    totals = np.empty(5)
    for b in range(len(starts) - 1):
        here = slice(starts[b], starts[b + 1])
        w, lam_0, Psi_0, lam_b, Psi_b = weight[here], lam[here], Psi[here], lam_next[here], Psi_next[here]
        place = here if len(z) == len(weight) else slice(0, len(w))
        for i in range(len(w)):
            lam_b[i], Psi_b[i] = lam_0[i], Psi_0[i]
        for k in range(len(y)):
            step(table[k], y[k, here], lam_b, Psi_b, z[place], p[place], x[k, here], w, totals)
            errors[k, b], squares[k, b], own[k, b] = totals[0], totals[1], totals[2]
            normalised[k, b], largest[k, b] = totals[3], totals[4]


@njit(types.void(_PAIRS, _AFTER, types.int64, types.int64, _ROWS, _ROWS, _ROWS, _ROW, _ROW), **_OPTIONS)
def design(sums, after, parameters, regressions, table, y, x, lam, Psi):
    """Steps of a design on y (K, N) and x (K + 1, N): coefficients go into the table (K, m), lambda and Psi are those after them.

    A regression over all trajectories finds matrix, offset and residual, as in `designed.Scatter.regression`.  First deviations
    from the means of a few trajectories, which are near enough to those of all that nothing cancels.  What rounding has made
    negative is no variance: NaN says that the plain loop is to look at it.
    """
    near, found = np.empty(2), np.empty(5)
    for k in range(len(y)):
        c = table[k]
        for number in range(regressions):
            near[:] = 0.0
            for size in (min(64, len(lam)), len(lam)):
                sums(number, c, y[k, :size], lam[:size], Psi[:size], x[k, :size], x[k + 1, :size], near, found)
                dt, dr = found[0] / size, found[1] / size
                near[0] += dt
                near[1] += dr
            tt, tr, rr = found[2] - size * dt * dt, found[3] - size * dt * dr, found[4] - size * dr * dr
            matrix, at = tr / rr if rr > 0 else 0.0 if rr == 0 else np.nan, parameters + 3 * number
            c[at], c[at + 1], c[at + 2] = matrix, near[0] - matrix * near[1], max((tt - matrix * tr) / size, 0.0)
        after(c, y[k], lam, Psi)


@njit(types.void(_ROWS, _ROW, _STARTS, _ROWS), **_OPTIONS)
def squares(x, weight, starts, sums):
    """Sums of weight x^2 over batches, (K, B), of states x (K, N)."""
    for k in range(len(x)):
        for b in range(len(starts) - 1):
            x_b, w, square = x[k, starts[b] : starts[b + 1]], weight[starts[b] : starts[b + 1]], 0.0
            for i in range(len(w)):
                square += w[i] * x_b[i] * x_b[i]
            sums[k, b] = square


@njit(types.void(types.npy_rng, types.float64[::1]), cache=True, nogil=True)
def normals(rng, out):
    """`rng.standard_normal(out=out)`, the same bits in less than half the time: no call for each number."""
    for i in range(len(out)):
        out[i] = rng.standard_normal()
