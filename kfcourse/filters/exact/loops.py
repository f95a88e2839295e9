"""The usual way of a step, one trajectory after the other, compiled by numba: what `kernels`, `places` and `batch` say of arrays.

A trajectory goes the usual way if the kernels of its nodes overlap before and after the step, and nodes x = c + s sinh t resolve
its posterior.  Of any other it is said that it is LEFT.  Only with numba is this imported.

The numbers are those of NumPy but for rounding: sums are taken in another order, and exp(u), to 2e-13 of it, and ln(x) are
computed here, for many at once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit, types

from kfcourse.filters.densities import TINY
from kfcourse.filters.exact.batch import COEFFICIENTS, KINK, ORDER, ROUNDING
from kfcourse.filters.exact.constants import LOOKED, LOWEST, MORE, NEGLIGIBLE, NODES, ROOT, SPACINGS, TAIL, WIDTH
from kfcourse.filters.exact.kernels import OVERLAP, SEEN
from kfcourse.filters.exact.places import COARSELY, EXPLANATIONS, FRACTIONS, HIDDEN, HUMP, SEARCHED

LEFT, DONE, NARROW = 0, 1, 2  # to NumPy; done; done, and the next kernels do not overlap
MOVES, METER = 0, 1  # which of the printed laws

# Sums may be taken in any order, so that the processor adds several terms at once.
_CALLED: dict[str, Any] = {"error_model": "numpy", "fastmath": {"reassoc", "nsz", "contract"}}
_ANY_ORDER = _CALLED | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}  # of what only compiled functions call

_VALUES, _MANY, _MANY_PARTS, _NUMBERS = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1], types.int64[::1]

_LN2 = np.log(2)
_WHOLE = 1.5 * 2.0**52  # what is added to it is rounded to a whole number, and this stands in the last bits
_BITS_OF_WHOLE, _BITS_OF_ROOT = np.array([_WHOLE, np.sqrt(0.5)]).view(np.int64).tolist()
_AS_WRITTEN = _ANY_ORDER | {"fastmath": {"contract"}}  # no sum in another order


@njit(**_AS_WRITTEN)
def _exp(u):
    """exp(u), |u| < 708, to 2e-13 of it: 2^k exp(r), |r| < .35, by Taylor's polynomial.

    Here, and for the logarithm, no change from int to float and back, so that loops do many at once.
    """
    shifted = u * (1 / _LN2) + _WHOLE
    k = shifted - _WHOLE
    r = u - k * _LN2
    p = 1 / 39916800
    p = p * r + 1 / 3628800
    p = p * r + 1 / 362880
    p = p * r + 1 / 40320
    p = p * r + 1 / 5040
    p = p * r + 1 / 720
    p = p * r + 1 / 120
    p = p * r + 1 / 24
    p = p * r + 1 / 6
    p = p * r + 1 / 2
    p = p * r + 1
    p = p * r + 1
    return p * np.int64((np.float64(shifted).view(np.int64) + 1023) << 52).view(np.float64)


@njit(**_AS_WRITTEN)
def _log(x):
    """ln x to 1e-15, x >= 0 no smaller than numbers are in full: k ln 2 + ln m, 1/2 < m^2 < 2, ln m = 2 artanh s."""
    bits = np.float64(x).view(np.int64)
    k = (bits - _BITS_OF_ROOT) >> 52
    m = np.int64(bits - (k << 52)).view(np.float64)
    s = (m - 1) / (m + 1)
    z = s * s
    p = 1 / 19
    p = p * z + 1 / 17
    p = p * z + 1 / 15
    p = p * z + 1 / 13
    p = p * z + 1 / 11
    p = p * z + 1 / 9
    p = p * z + 1 / 7
    p = p * z + 1 / 5
    p = p * z + 1 / 3
    p = p * z + 1
    value = (np.int64(k + _BITS_OF_WHOLE).view(np.float64) - _WHOLE) * _LN2 + 2 * s * p
    return -np.inf if x == 0 else value if x < np.inf else x


@njit(**_ANY_ORDER)
def _arrays(size):
    return np.empty(size), np.empty(size), np.empty(size), np.empty(size)


@njit(**_ANY_ORDER)
def _nodes(place, x, length):
    """`Place.nodes`: the nodes, and the lengths they stand for."""
    count, (centre, scale, low, high) = len(x), place
    first, last = np.arcsinh((low - centre) / scale), np.arcsinh((high - centre) / scale)
    for i in range(count):
        grown = _exp(first + (last - first) * (i / (count - 1)))
        x[i] = centre + 0.5 * scale * (grown - 1 / grown)
        length[i] = 0.5 * scale * (grown + 1 / grown) * ((last - first) / (count - 1))


@njit(**_ANY_ORDER)
def _span(place):
    centre, scale, low, high = place
    return np.arcsinh((high - centre) / scale) + np.arcsinh((centre - low) / scale)


@njit(**_ANY_ORDER)
def _kernels(x, mass, density, moved, kernel, parts):
    """`overlapping` and `support`: the kernels of nodes, and the prediction's centre, width, and ends.

    Of each kernel the rate, the rate times the centre, and the rate times the mass; first those of every fourth node, then the
    others of every second, then the rest: the sums over `quarter` and `even` are parts of the sum over all.  Of each part: where
    it ends, the mass up to there, and up to which sum there is nothing.
    """
    (to, spread, _, _), count, place, top, low, high, weight, total = moved, len(x), 0, 0, np.inf, -np.inf, 0.0, 0.0
    for part, first, step in ((0, 0, 4), (1, 2, 4), (2, 1, 2)):
        for j in range(first, count, step):
            mean, sigma = to[j], max(np.sqrt(spread[j]), 1e-150)
            rate = np.sqrt(0.5) / sigma
            kernel[0, place], kernel[1, place], kernel[2, place] = rate, mean * rate, mass[j] * rate
            weight += mass[j] * rate
            total += mass[j]
            if mass[j] > NEGLIGIBLE:
                low, high = min(low, mean - WIDTH * sigma), max(high, mean + WIDTH * sigma)
            place += 1
        parts[0, part], parts[1, part], parts[2, part] = place, total, 2 * np.exp(-LOWEST) * weight
    parts[1, 2] = 1.0
    for j in range(count):
        top = j if density[j] > density[top] else top
    top = min(max(top, 1), count - 2)
    slope = (to[top + 1] - to[top - 1]) / (x[top + 1] - x[top - 1])
    width = np.hypot(slope / (ROOT * density[top]) if np.isfinite(slope) else 0.0, max(np.sqrt(spread[top]), 1e-150))
    return to[top], width, low, high


@njit(**_ANY_ORDER)
def _density(x, kernel, parts, found):
    """`Kernels.density` by every fourth kernel, by every second, and by all, as far as there is room."""
    first, count = 0, len(x)
    for part in range(len(found)):
        sums = found[part]
        for i in range(count):
            sums[i] = found[part - 1, i] if part else 0.0
        for j in range(first, int(parts[0, part])):
            rate, centre, weight = kernel[0, j], kernel[1, j], kernel[2, j]
            for i in range(count):
                u = x[i] * rate - centre
                sums[i] += weight * _exp(-min(u * u, LOWEST))
        first = int(parts[0, part])
    for part in range(len(found)):
        for i in range(count):
            value = found[part, i]
            found[part, i] = value / (np.sqrt(np.pi) * parts[1, part]) if value > parts[2, part] else 0.0


@njit(types.void(_MANY, _MANY, _MANY, _MANY_PARTS, types.float64, _MANY_PARTS), cache=True, nogil=True, **_CALLED)
def add_bells(x, rate, centre, weights, lowest, result):
    """`kernels.add_bells`."""
    bells = np.empty(x.shape[1])
    for t in range(len(x)):
        for j in range(rate.shape[1]):
            for i in range(x.shape[1]):
                u = x[t, i] * rate[t, j] - centre[t, j]
                bells[i] = _exp(-min(u * u, lowest))
            for part in range(weights.shape[2]):
                for i in range(x.shape[1]):
                    result[t, part, i] += weights[t, j, part] * bells[i]


@njit(**_ANY_ORDER)
def _residual(y, mean, signal, of_noise):
    return np.abs(y - mean) - signal if of_noise else y - signal


@njit(**_ANY_ORDER)
def _log_likelihood(y, mean, variance):
    if np.isnan(y):
        return 0.0
    variance = max(variance, TINY)
    return -0.5 * ((y - mean) * (y - mean) / variance + _log(2 * np.pi * variance))


@njit(**_ANY_ORDER)
def _explanations(law, c, of_noise, y, place, x, shown):
    """`explanations`: the roots of b(x, m_w) = y in the support, those nearest to the middle, in x[2]; how many."""
    (at, length, root, left, right, far), (mean, variance, signal, slope), known = x, shown, 0
    at = at[:SEARCHED]
    _nodes(place, at, length)
    law(METER, c, at, mean, variance, signal, slope)
    for i in range(1, SEARCHED):
        before, after = _residual(y, mean[i - 1], signal[i - 1], of_noise), _residual(y, mean[i], signal[i], of_noise)
        if (before > 0) == (after > 0) or not np.abs(after - before) < np.inf:
            continue
        distance, j = np.abs(0.5 * (at[i] + at[i - 1]) - place[0]), min(known, EXPLANATIONS)
        while j and distance < far[j - 1]:
            j -= 1
            far[j + 1], left[j + 1], right[j + 1] = far[j], left[j], right[j]
        far[j], left[j], right[j] = distance, at[i - 1], at[i]
        known = min(known + 1, EXPLANATIONS)
    law(METER, c, left[:known], mean, variance, signal, slope)
    for j in range(known):
        far[j] = _residual(y, mean[j], signal[j], of_noise) > 0
    for halving in range(COARSELY + 1):
        for j in range(known):
            root[j] = 0.5 * (left[j] + right[j])
        if halving < COARSELY:
            law(METER, c, root[:known], mean, variance, signal, slope)
            for j in range(known):
                same = (_residual(y, mean[j], signal[j], of_noise) > 0) == (far[j] > 0)
                left[j], right[j] = (root[j], right[j]) if same else (left[j], root[j])
    for _ in range(2):
        law(METER, c, root[:known], mean, variance, signal, slope)
        for j in range(known):
            newton = root[j] + _residual(y, mean[j], signal[j], of_noise) / slope[j]
            root[j] = newton if left[j] < newton < right[j] else root[j]
    return known


@njit(**_ANY_ORDER)
def _candidates(law, c, y, known, place, x, shown, kernel, parts, found, candidates):
    """`likeliest`: centres, widths and masses of humps, of the roots in x[2] and of the middle; the place of the likeliest."""
    (middle, width, low, high), (mean, variance, signal, slope) = place, shown
    at = x[2][: known + 1]
    at[known] = min(max(middle, low), high)
    law(METER, c, at, mean, variance, signal, slope)
    _density(at, kernel, parts, found[:2])
    best, highest, of_middle = known, -np.inf, width
    for j in range(known + 1):
        scale = of_middle
        if j < known:
            by_meter = np.sqrt(variance[j]) / np.abs(slope[j])
            scale = by_meter if by_meter < width else width
            of_middle = min(of_middle, np.hypot(at[j] - at[known], scale))
        log_mass = _log(found[1, j] * scale * ROOT) + _log_likelihood(y, mean[j], variance[j])
        log_mass = log_mass if scale > 0 and not np.isnan(log_mass) else -np.inf
        candidates[0, j], candidates[1, j], candidates[2, j] = at[j], scale, log_mass
        if log_mass > highest:
            best, highest = j, log_mass
    return candidates[0, best], candidates[1, best], low, high


@njit(**_ANY_ORDER)
def _overlap(mass):
    share = 1 - np.log(max(mass, SEEN)) / np.log(SEEN)
    return OVERLAP * np.sqrt(min(max(share, 0.0), 1.0))


@njit(**_ANY_ORDER)
def _looked(law, c, y, place, x, shown, moved, kernel, parts, found, dense):
    """`looked`: centre, width and ends of the highest hump; and in `dense` how densely its kernels want their nodes.

    The width is NaN where nothing is seen.
    """
    at, length, logs, (mean, variance, signal, slope), count = x[0][:LOOKED], x[1], x[2], shown, LOOKED
    _nodes(place, at, length)
    law(METER, c, at, mean, variance, signal, slope)
    _density(at, kernel, parts, found[:2])
    top = 0
    for i in range(count):
        log = _log(found[1, i]) + _log_likelihood(y, mean[i], variance[i])
        logs[i] = -np.inf if np.isnan(log) else log
    for i in range(count):
        top = i if logs[i] > logs[top] else top
    highest, area, fallen = logs[top], 0.0, np.inf
    for i in range(count):
        if logs[i] < highest - 0.5:
            fallen = min(fallen, np.abs(at[i] - at[top]))
        logs[i] = _exp(max(logs[i] - highest, -708.0)) * length[i]
        area += logs[i]
    if not area < np.inf:
        return 0.0, np.nan, 0.0, 0.0
    first, last = count, 0
    for i in range(count):
        if logs[i] > TAIL * area:
            first, last = min(first, i), i
    mean, variance, signal, slope = moved
    law(MOVES, c, at, mean, variance, signal, slope)
    for i in range(count):
        wanted = np.abs(slope[i]) / max(np.sqrt(variance[i]), 1e-150)
        dense[i] = _overlap(logs[i] / area) * wanted
    return at[top], min(area / ROOT, 2 * fallen), at[max(first - 1, 0)], at[min(last + 1, count - 1)]


@njit(**_ANY_ORDER)
def _spaced(hump, at, dense, candidates, known, spacing):
    """`spaced`: the place with which the fewest nodes do, and how many."""
    centre, width, low, high = hump
    likeliest, nodes, fewest, fewest_by_humps = -np.inf, NODES[-1], np.inf, np.inf
    best = best_by_humps = np.nan
    for j in range(known + 1):
        likeliest = max(likeliest, candidates[2, j])
    for fraction in FRACTIONS:
        scale = width * ((high - low) / width) ** fraction
        by_kernels = by_humps = 0.0
        for i in range(LOOKED):
            away = at[i] - centre
            by_kernels = max(by_kernels, dense[i] * dense[i] * (scale * scale + away * away))
        for j in range(known + 1):
            if candidates[2, j] > likeliest + HIDDEN:
                away, narrow = candidates[0, j] - centre, candidates[1, j]
                by_humps = max(by_humps, (scale * scale + away * away) / (narrow * narrow))
        by_humps = max(np.sqrt(by_humps), np.hypot(scale, HUMP * width) / (spacing * width))
        span = _span((centre, scale, low, high))
        wanted = span * max(by_humps, np.sqrt(by_kernels))
        if wanted < fewest:
            best, fewest = scale, wanted
        if span * by_humps < fewest_by_humps:
            best_by_humps, fewest_by_humps = scale, span * by_humps
    if not fewest < nodes:
        best, fewest = best_by_humps, fewest_by_humps
    return (centre, best, low, high), fewest + 1


@njit(**_ANY_ORDER)
def _hidden(candidates, known, place, count):
    """`hidden`: whether a hump that may count could fall between two nodes."""
    centre, scale, low, high = place
    likeliest, step = -np.inf, _span(place) / (count - 1)
    for j in range(known + 1):
        likeliest = max(likeliest, candidates[2, j])
    for j in range(known + 1):
        at, width, log_mass = candidates[0, j], candidates[1, j], candidates[2, j]
        inside = low <= at <= high
        if log_mass > likeliest + HIDDEN and not (inside and np.hypot(scale, at - centre) * step <= 2 * width):
            return True
    return False


@njit(**_ANY_ORDER)
def _distance(x, masses, step, whole):
    """`Summary.distance` of every so many of the masses, taken so many times, from mean, variance and total."""
    total = mean = variance = 0.0
    for i in range(0, len(x), step):
        total += masses[i]
        mean += masses[i] * x[i]
    mean /= total
    for i in range(0, len(x), step):
        variance += masses[i] * (x[i] - mean) * (x[i] - mean)
    of_mean, of_variance, of_total = whole
    change = np.abs(variance / total / of_variance - 1) + np.abs(step * total / of_total - 1)
    return np.abs(mean - of_mean) / np.sqrt(of_variance) + change


@njit(**_ANY_ORDER)
def _roughness(x, mass, step, mean, variance, every, differences):
    """`roughness` of every so many of the masses, taken so many times; with room for zeros before and after them."""
    count, before = (len(x) - 1) // step + 1, ORDER // 2
    every[: count + ORDER] = 0.0
    for i in range(count):
        every[before + i] = step * mass[step * i]
    most = 0.0
    for i in range(count):
        difference = 0.0
        for m in range(ORDER + 1):  # of so few terms that it is unrolled, and many differences are taken at once
            difference += COEFFICIENTS[m] * every[i + m]
        differences[i] = difference
    for i in range(count):
        away = (x[step * i] - mean) / np.sqrt(variance)
        most = max(most, np.abs(differences[i]) * (1 + np.abs(away) + np.abs(away * away - 1)))
    return most


@njit(**_ANY_ORDER)
def _extrapolated(change, before):
    q = change / before if before > 0 else 1.0
    return change * min(max(q, min(change, 1.0) ** 0.75), 1.0)


@njit(**_ANY_ORDER)
def _cautious(change, before):
    return min(change, KINK * _extrapolated(change, before))


@njit(**_ANY_ORDER)
def _posterior(law, c, y, x, length, shown, away, kernel, parts, found, padded, mass, density):
    """`posteriors` on nodes: mean, variance, and estimated error, of these nodes and inherited."""
    (mean, variance, signal, slope), count = shown, len(x)
    law(METER, c, x, mean, variance, signal, slope)
    _density(x, kernel, parts, found)
    highest, total = -np.inf, 0.0
    for i in range(count):
        mean[i] = _log_likelihood(y, mean[i], variance[i])
        variance[i] = mean[i] + _log(found[2, i])
    for i in range(count):
        highest = max(highest, variance[i])
    for i in range(count):
        log = mean[i] - highest
        likelihood = (np.inf if log > 708 else _exp(max(log, -708.0))) * length[i]
        for part in range(3):
            found[part, i] *= likelihood
        total += found[2, i]
    m = v = 0.0
    for i in range(count):
        mass[i] = found[2, i] / total
        density[i] = mass[i] / length[i]
        m += mass[i] * x[i]
    for i in range(count):
        v += mass[i] * (x[i] - m) * (x[i] - m)
    whole, rounding = (m, v, total), ROUNDING * np.abs(m) / np.sqrt(v)
    # By every second and fourth node, by every second and fourth kernel; roughness of all and of every second.
    for i, (part, step) in enumerate(((2, 2), (2, 4), (1, 1), (0, 1))):
        away[i] = _distance(x, found[part], step, whole)
    for step in (1, 2):
        away[3 + step] = _roughness(x, mass, step, m, v, padded, signal)
    for i in (0, 2, 4):
        away[i] = max(away[i] - rounding, 0.0)
    error = max(_extrapolated(away[0], away[1]), _cautious(away[4], away[5]))
    error += (mass[0] + mass[-1]) * max(m - x[0], x[-1] - m) / np.sqrt(v)
    return m, v, error, rounding + _cautious(away[2], away[3])


@njit(**_ANY_ORDER)
def _apart(mass, moved):
    """`apart`: how far the kernels of neighbouring nodes are, up to 1 their sum is as good as the integral."""
    (to, spread, _, _), most = moved, 0.0
    for i in range(1, len(mass) - 1):
        here = to[i]
        gap = max(np.abs(to[i + 1] - here), np.abs(here - to[i - 1])) / max(np.sqrt(spread[i]), 1e-150)
        if not gap * OVERLAP <= most:
            most = max(most, gap * _overlap(mass[i]))
    return most


@njit(**_ANY_ORDER)
def _predicted(mass, moved):
    """`Kernels.moments`."""
    (to, spread, _, _), mean, variance = moved, 0.0, 0.0
    for i in range(len(mass)):
        mean += mass[i] * to[i]
    for i in range(len(mass)):
        sigma = max(np.sqrt(spread[i]), 1e-150)
        variance += mass[i] * (sigma * sigma + (to[i] - mean) * (to[i] - mean))
    return mean, variance


# Printed, with the constants of the model: law(number, c, x, mean, variance, signal, slope); MOVES makes no signal.
_LAW = types.FunctionType(types.void(types.int64, *[_VALUES] * 6))


def _with(constants: tuple[Any, ...]) -> Callable[..., int]:
    """The loop, for numba to keep beside these constants: what is in a closure is looked at when machine code is read again."""

    @njit(
        types.int64(
            _LAW, _VALUES, types.boolean, _MANY, _NUMBERS, _NUMBERS, _VALUES, types.float64, types.float64,
            _MANY, _MANY, _NUMBERS, _NUMBERS,
        ),
        cache=True,
        nogil=True,
        **_CALLED,
    )  # fmt: skip
    def steps(law, c, of_noise, before, start, count, y, accuracy, fine_nodes, after, numbers, size, status):
        """One step of many trajectories: the length of `after` that is filled.

        law : of state and meter, with their constants c; whether the signal is the noise's deviation
        before (3, M), start, count (T,) : nodes, masses and densities; where those of each trajectory begin, and how many
        y (T,), accuracy, fine_nodes : as of `pointmasses`
        after (3, T * most) : as `before`, one after the other
        numbers (5, T), size, status (T,) : mean, variance, error, mean and variance predicted; nodes; LEFT, DONE or NARROW
        """
        most, filled = constants[0][-1], 0
        kernel, found, parts, candidates = np.empty((3, most)), np.empty((3, most)), np.empty((3, 3)), np.empty((3, 4))
        nodes, dense, changes, padded = np.empty((4, most)), np.empty(LOOKED), np.empty(6), np.empty(most + ORDER)
        moved, shown, few = _arrays(most), _arrays(most), _arrays(most) + _arrays(most)[:2]
        for t in range(len(y)):
            status[t], n = LEFT, count[t]
            end = start[t] + n
            x, mass, density = before[0, start[t] : end], before[1, start[t] : end], before[2, start[t] : end]
            law(MOVES, c, x, moved[0], moved[1], moved[2], moved[3])
            place = _kernels(x, mass, density, moved, kernel, parts)
            if not -np.inf < place[2] < place[3] < np.inf or np.isnan(place[1]):
                continue
            known = _explanations(law, c, of_noise, y[t], place, few, shown)
            place = _candidates(law, c, y[t], known, place, few, shown, kernel, parts, found, candidates)
            hump = _looked(law, c, y[t], place, few, shown, moved, kernel, parts, found, dense)
            if np.isnan(hump[1]):
                continue
            least = 0.0
            for spacing in SPACINGS:
                place, wanted = _spaced(hump, few[0], dense, candidates, known, spacing)
                n = NODES[0]
                for number in NODES:
                    n = number if n < max(wanted, least) else n
                x, length = nodes[0, :n], nodes[1, :n]
                mass, density = nodes[2, :n], nodes[3, :n]
                _nodes(place, x, length)
                m, v, error, inherited = _posterior(
                    law, c, y[t], x, length, shown, changes, kernel, parts, found, padded, mass, density
                )
                law(MOVES, c, x, moved[0], moved[1], moved[2], moved[3])
                apart = _apart(mass, moved)
                least_now = (n - 1) * apart + 1
                least_now = least_now if least_now <= most else fine_nodes
                seen = error <= accuracy and inherited < np.inf and not _hidden(candidates, known, place, n)
                if seen and least_now <= n:
                    status[t], size[t] = NARROW if apart > 1 else DONE, n
                    numbers[0, t], numbers[1, t], numbers[2, t] = m, v, error + inherited
                    numbers[3, t], numbers[4, t] = _predicted(mass, moved)
                    for i in range(n):
                        after[0, filled], after[1, filled], after[2, filled] = x[i], mass[i], density[i]
                        filled += 1
                    break
                if n == most:
                    break
                least = max(least_now, 0.0 if seen and least_now <= n else MORE * n)
        return filled

    return steps


_OF_DENSITIES = WIDTH, NEGLIGIBLE, TAIL, LOWEST, ROOT, TINY, OVERLAP, SEEN, KINK, ROUNDING, ORDER, tuple(COEFFICIENTS)
_OF_PLACES = MORE, LOOKED, SEARCHED, COARSELY, EXPLANATIONS, HIDDEN, HUMP, tuple(FRACTIONS)
steps = _with((NODES, SPACINGS, _OF_DENSITIES, _OF_PLACES))
