"""Loops of the compiled engine in which no formula of a model stands.  Only with numba is this imported.

The formulas are in printed loops over trajectories (`compiled.choice`), which these call: the same for all filters, made once.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types

_ROW, _ROWS, _STARTS = types.float64[::1], types.float64[:, ::1], types.int64[::1]
# Sums may be taken in any order, so that the processor adds several terms at once.
_OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "fastmath": {"reassoc", "nsz"}}

# Printed, with the constants c of the step: step(number, c, y, lam, Psi, x, x_next, first, second).  The number says what is
# made: by POSTERIOR z and p, with the next lam and Psi in place; of a design by AFTER these alone, and by REGRESSION, and the
# numbers after it, what is predicted and from what.
_STEP = types.FunctionType(types.void(types.int64, *[_ROW] * 8))
POSTERIOR, AFTER, REGRESSION = 0, 1, 2
AT_ONCE = 1024  # trajectories whose numbers stay in the nearest cache


@njit(types.void(_STEP, _ROWS, _ROWS, _ROWS, _ROW, _STARTS, *[_ROW] * 6, *[_ROWS] * 5), **_OPTIONS)
def advance(step, table, y, x, weight, starts, lam, Psi, lam_next, Psi_next, z, p, errors, squares, own, normalised, largest):
    """Steps of a filter, and of each the sums over batches that `Sums.record` keeps, (K, B).

    The constants of each step are a row of the table; z and p of the last are left if there is room for more than a batch.
    """
    for b in range(len(starts) - 1):
        here = slice(starts[b], starts[b + 1])
        w, lam_0, Psi_0, lam_b, Psi_b = weight[here], lam[here], Psi[here], lam_next[here], Psi_next[here]
        place = here if len(z) == len(weight) else slice(0, len(w))
        z_b, p_b = z[place], p[place]
        for i in range(len(w)):
            lam_b[i], Psi_b[i] = lam_0[i], Psi_0[i]
        for k in range(len(y)):
            x_b, error, square, variance, quotient, most = x[k, here], 0.0, 0.0, 0.0, 0.0, np.int64(0)
            step(POSTERIOR, table[k], y[k, here], lam_b, Psi_b, x_b, x_b, z_b, p_b)
            for i in range(len(w)):
                e = x_b[i] - z_b[i]
                term = w[i] * e * e
                error += w[i] * e
                square += term
                variance += w[i] * p_b[i]
                quotient += term / (p_b[i] if term > 0 else 1.0)
                bits = np.float64(term).view(np.int64)  # whole numbers in the order of floats that are not negative
                most = bits if bits > most else most
            errors[k, b], squares[k, b], own[k, b], normalised[k, b] = error, square, variance, quotient
            largest[k, b] = np.int64(most).view(np.float64)


@njit(types.void(_STEP, types.int64, types.int64, _ROWS, _ROWS, _ROWS, _ROW, _ROW), **_OPTIONS)
def design(step, parameters, regressions, table, y, x, lam, Psi):
    """Steps of a design on y (K, N) and x (K + 1, N): coefficients go into the table (K, m), lambda and Psi are those after them.

    A regression over all trajectories finds matrix, offset and residual, as in `designed.Scatter.regression`.  First deviations
    from the means of a few trajectories, which are near enough to those of all that nothing cancels.  What rounding has made
    negative is no variance: NaN says that the plain loop is to look at it.
    """
    first, second = np.empty(AT_ONCE), np.empty(AT_ONCE)
    for k in range(len(y)):
        c = table[k]
        for number in range(regressions):
            t = r = 0.0
            for size in (min(64, len(lam)), len(lam)):
                dt = dr = tt = tr = rr = 0.0
                for begin in range(0, size, AT_ONCE):
                    here = slice(begin, min(begin + AT_ONCE, size))
                    y_b = y[k, here]
                    step(REGRESSION + number, c, y_b, lam[here], Psi[here], x[k, here], x[k + 1, here], first, second)
                    for i in range(len(y_b)):
                        d, e = first[i] - t, second[i] - r
                        dt += d
                        dr += e
                        tt += d * d
                        tr += d * e
                        rr += e * e
                dt /= size
                dr /= size
                t += dt
                r += dr
            tt, tr, rr = tt - size * dt * dt, tr - size * dt * dr, rr - size * dr * dr
            matrix, at = tr / rr if rr > 0 else 0.0 if rr == 0 else np.nan, parameters + 3 * number
            c[at], c[at + 1], c[at + 2] = matrix, t - matrix * r, max((tt - matrix * tr) / size, 0.0)
        step(AFTER, c, y[k], lam, Psi, x[k], x[k + 1], first, second)


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
