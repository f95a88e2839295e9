"""Loops of the compiled engine in which no formula of a model stands.  Only with numba is this imported.

The texts are put around printed functions of one trajectory (`compiled.function`), into the same module.  Each passes over arrays
once, and the processor takes eight entries at a time: rows of their own that are counted from 0, and sums in any order, let it.
"""

from __future__ import annotations

from typing import Any

from numba import njit, types

from kfcourse.symbolic.compiled import INNER, OPTIONS

_ROW, _ROWS = "float64[::1]", "float64[:, ::1]"
_SUMS = '["reassoc", "nsz"]'
_ANY_ORDER = f"{OPTIONS}, fastmath=set({_SUMS})"
_OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "fastmath": {"reassoc", "nsz"}}

# x (K + 1, N) and y (K, N) from x[0] and the noises (K, n), by `model`, of the trajectories from `first` to `last`.
_SIMULATE = """
def simulate(c, first, last, x, y, {noises}):
    constants, here = {constants}, slice(first, last)
    for k in range(len(y)):
        x_k, y_k, x_next, {rows} = x[k, here], y[k, here], x[k + 1, here], {noises_k}
        for i in range(len(x_k)):
            y_k[i], x_next[i] = model(constants, x_k[i], {entries})
"""

# Steps of a filter, and of each the sums over batches that `Sums.record` keeps, (K, B).  The constants of each step are a row of
# the table; z and p of the last are left if there is room for more than a batch.  The largest square is found among whole
# numbers: their order is that of floats that are not negative.
_ADVANCE = f"""

@njit("void({_ROWS}, {_ROWS}, {_ROWS}, {_ROW}, int64[::1], {", ".join([_ROW] * 6 + [_ROWS] * 5)})", {_ANY_ORDER})
def advance(table, y, x, weight, starts, lam, Psi, lam_next, Psi_next, z, p, errors, squares, own, normalised, largest):
    for b in range(len(starts) - 1):
        here = slice(starts[b], starts[b + 1])
        w, lam_0, Psi_0, lam_b, Psi_b = weight[here], lam[here], Psi[here], lam_next[here], Psi_next[here]
        place = here if len(z) == len(weight) else slice(0, len(w))
        z_b, p_b = z[place], p[place]
        for i in range(len(w)):
            lam_b[i], Psi_b[i] = lam_0[i], Psi_0[i]
        for k in range(len(y)):
            c, y_k, x_k = table[k], y[k, here], x[k, here]
            constants = {{constants}}
            error, square, variance, quotient, most = 0.0, 0.0, 0.0, 0.0, np.int64(0)
            for i in range(len(w)):
                mean, cov, lam_b[i], Psi_b[i] = step(constants, y_k[i], lam_b[i], Psi_b[i])
                z_b[i], p_b[i] = mean, cov
                e = x_k[i] - mean
                term = w[i] * e * e
                error += w[i] * e
                square += term
                variance += w[i] * cov
                quotient += term / (cov if term > 0 else 1.0)
                most = max(most, np.float64(term).view(np.int64))
            errors[k, b], squares[k, b], own[k, b], normalised[k, b] = error, square, variance, quotient
            largest[k, b] = np.int64(most).view(np.float64)
"""

# A regression over all trajectories, of target and regressor that `pair` makes: matrix, offset and residual, as in
# `designed.Scatter.regression`.  First deviations from the means of a few trajectories, which are near enough to those of all
# that nothing cancels.  What rounding has made negative is no variance: NaN says that the plain loop is to look at it.
_FIT = f"""

@njit({INNER}, fastmath=set({_SUMS}))
def fit{{number}}(c, y, lam, Psi, x, x_next):
    constants, t, r = {{constants}}, 0.0, 0.0
    for size in (min(64, len(y)), len(y)):
        dt, dr, tt, tr, rr = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(size):
            target, regressor = pair{{number}}(constants, y[i], lam[i], Psi[i], x[i], x_next[i])
            target, regressor = target - t, regressor - r
            dt += target
            dr += regressor
            tt += target * target
            tr += target * regressor
            rr += regressor * regressor
        dt, dr = dt / size, dr / size
        t, r = t + dt, r + dr
    tt, tr, rr = tt - size * dt * dt, tr - size * dt * dr, rr - size * dr * dr
    matrix = tr / rr if rr > 0 else 0.0 if rr == 0 else nan
    return matrix, t - matrix * r, max((tt - matrix * tr) / size, 0.0)
"""

# Steps of a design on y (K, N) and x (K + 1, N): coefficients go into the table (K, m), lambda and Psi are those after them.
_DESIGN = f"""

@njit("void({_ROWS}, {_ROWS}, {_ROWS}, {_ROW}, {_ROW})", {_ANY_ORDER})
def design(table, y, x, lam, Psi):
    for k in range(len(y)):
        c, y_k, x_k, x_next = table[k], y[k], x[k], x[k + 1]
        {{fits}}
        constants = {{constants}}
        for i in range(len(lam)):
            _, _, lam[i], Psi[i] = step(constants, y_k[i], lam[i], Psi[i])
"""


def advance(constants: int) -> str:
    """The loop around `step`, of so many constants."""
    return _ADVANCE.format(constants=_entries(constants))


def design(parameters: int, regressions: int) -> str:
    """The loops around `pair0`, `pair1`, ..., and that which takes them and `step` in turn."""
    firsts = [parameters + 3 * i for i in range(regressions + 1)]
    texts = [_FIT.format(number=i, constants=_entries(one)) for i, one in enumerate(firsts[:-1])]
    fits = [f"c[{one}], c[{one + 1}], c[{one + 2}] = fit{i}(c, y_k, lam, Psi, x_k, x_next)" for i, one in enumerate(firsts[:-1])]
    return "".join([*texts, _DESIGN.format(fits="\n        ".join(fits), constants=_entries(firsts[-1]))])


def simulate(noises: int, constants: int) -> str:
    """The loop around `model`, of so many constants."""
    names = [f"noise{i}" for i in range(noises)]
    text = f'\n\n@njit("void({", ".join([_ROW, "int64", "int64"] + [_ROWS] * (2 + noises))})", {OPTIONS}){_SIMULATE}'
    rows, of_step, entries = (", ".join(one.format(name) for name in names) for one in ("{}_k", "{}[k]", "{}_k[i]"))
    return text.format(noises=", ".join(names), rows=rows, noises_k=of_step, entries=entries, constants=_entries(constants))


def _entries(constants: int) -> str:
    return "(" + "".join(f"c[{i}], " for i in range(constants)) + ")"


@njit(types.void(types.float64[:, ::1], types.float64[::1], types.int64[::1], types.float64[:, ::1]), **_OPTIONS)
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
