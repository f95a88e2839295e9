"""The usual way of a step, one trajectory after the other, compiled by numba: what `kernels`, `places` and `batch` say of arrays.

A trajectory goes the usual way if the kernels of its nodes overlap before and after the step, and nodes x = c + s sinh t resolve
its posterior.  Of any other it is said that it is LEFT.  Only with numba is this imported.

The numbers are those of NumPy but for rounding: sums are taken in another order, and exp(u), to 2e-13 of it, and ln(x) are
computed here, for many at once.

Compiling takes as long as there is code after all is put into its caller, and again into that one's: so `steps` itself calls what
several parts need.  What makes much code of little text is left out: arrays allocated here (they are rows of one that is given,
and no references are counted), whole slices that are assigned, `np.sqrt` of a number (`math.sqrt` is the same), a literal number
for an argument (compiled again for each; `np.int64` is not).
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp, hypot, isfinite, isnan, sqrt
from typing import Any

import numpy as np
from numba import njit, types
from numpy.polynomial import Chebyshev, Polynomial

from kfcourse.filters.densities import TINY
from kfcourse.filters.exact.batch import COEFFICIENTS, KINK, ORDER, ROUNDING
from kfcourse.filters.exact.constants import LOOKED, LOWEST, MORE, NEGLIGIBLE, NODES, ROOT, SPACINGS, TAIL, WIDTH
from kfcourse.filters.exact.kernels import OVERLAP, SEEN
from kfcourse.filters.exact.places import COARSELY, EXPLANATIONS, FRACTIONS, HIDDEN, HUMP, SEARCHED
from kfcourse.laws import Array

LEFT, DONE, NARROW = 0, 1, 2  # to NumPy; done; done, and the next kernels do not overlap
MOVES, METER = 0, 1  # which of the printed laws
BY_HALF, BY_ALL = np.int64(2), np.int64(3)  # a density: by every fourth kernel, then by every second, then by all

# Sums may be taken in any order, so that the processor adds several terms at once.
_CALLED: dict[str, Any] = {"error_model": "numpy", "fastmath": {"reassoc", "nsz", "contract"}}
_LOOP: dict[str, Any] = _CALLED | {"cache": True, "nogil": True, "no_cfunc_wrapper": True}
_ANY_ORDER = _CALLED | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False}  # only compiled functions call it

_VALUES, _MANY, _MANY_PARTS, _NUMBERS = types.float64[::1], types.float64[:, ::1], types.float64[:, :, ::1], types.int64[::1]
# Printed, with the constants of the model: law(number, c, x, mean, variance, signal, slope); MOVES makes no signal.
_LAW = types.FunctionType(types.void(types.int64, *[_VALUES] * 6))

_LN2 = np.log(2)
_LOWEST2 = LOWEST / _LN2
_POLYNOMIAL = tuple(Chebyshev.interpolate(np.exp2, 9, [-0.5, 0.5]).convert(kind=Polynomial).coef.tolist())
_WHOLE = 1.5 * 2.0**52  # what is added to it is rounded to a whole number, and this stands in the last bits
_BITS_OF_WHOLE, _BITS_OF_ROOT, _BITS_OF_LOWEST = np.array([_WHOLE, np.sqrt(0.5), -np.inf]).view(np.int64).tolist()
_AS_WRITTEN = _ANY_ORDER | {"fastmath": {"contract"}}  # no sum in another order
_ALL_BUT_SIGN = np.int64(2**63 - 1)
BEYOND = 7  # entries of an array after those of the most nodes
assert COARSELY % 4 == 0


@njit(**_AS_WRITTEN)
def _half(u, P):
    """2^-u, |u| < 1021.5, to 3e-14 of it: 2^k 2^r, |r| <= 1/2, by a polynomial.

    Here, and for the logarithm, no change from int to float and back, so that loops do many at once.
    """
    shifted = _WHOLE - u
    r = (_WHOLE - shifted) - u
    z = r * r
    even = (((P[8] * z + P[6]) * z + P[4]) * z + P[2]) * z + P[0]
    odd = (((P[9] * z + P[7]) * z + P[5]) * z + P[3]) * z + P[1]
    bits = np.float64(even + r * odd).view(np.int64) + (np.float64(shifted).view(np.int64) << 52)
    return np.int64(bits).view(np.float64)


@njit(**_AS_WRITTEN)
def _exp(u):
    """exp(u), |u| <= 708, to 2e-13 of it, as the power of 2 that it is has been rounded."""
    return _half(u * (-1 / _LN2), _POLYNOMIAL)


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


@njit(types.int64(types.int64), **_ANY_ORDER)
def _whole(count):
    """So many entries, to whole fours: what the processor does at once."""
    return 4 * ((count + 3) // 4)


@njit(types.int64(types.int64), **_ANY_ORDER)
def _in_order(bits):
    """Of a float's bits a whole number in the order of floats, and back: of these the largest of many is found at once."""
    return bits ^ ((bits >> 63) & _ALL_BUT_SIGN)


@njit(types.float64(_VALUES, types.int64), **_ANY_ORDER)
def _highest(values, count):
    most = _in_order(_BITS_OF_LOWEST)
    for i in range(count):
        value = _in_order(np.float64(values[i]).view(np.int64))
        most = value if value > most else most
    return np.int64(_in_order(most)).view(np.float64)


@njit(**_ANY_ORDER)
def _place_of(value, values):
    for i in range(len(values)):
        if values[i] == value:
            return i
    return 0


@njit(**_AS_WRITTEN)
def _asinh(a):
    """arsinh a, a >= 0, to 1e-15 of 1 + arsinh a."""
    return _log(a + sqrt(a * a + 1))


@njit(**_ANY_ORDER)
def _nodes(place, count, x, length):
    """`Place.nodes`: the nodes, and the lengths they stand for; to whole fours the last node again, of no length."""
    centre, scale, low, high = place
    first, last = -_asinh((centre - low) / scale), _asinh((high - centre) / scale)
    step, half = (last - first) / (count - 1), 0.5 * scale
    for i in range(_whole(count)):
        grown = _exp(first + step * np.int32(min(i, count - 1)))
        x[i] = centre + half * (grown - 1 / grown)
        length[i] = half * (grown + 1 / grown) * step if i < count else 0.0


@njit(**_ANY_ORDER)
def _span(place):
    centre, scale, low, high = place
    return _asinh((high - centre) / scale) + _asinh((centre - low) / scale)


@njit(**_ANY_ORDER)
def _kernels(x, mass, density, moved, chosen, kernel, parts, ends):
    """`overlapping` and `support`: the kernels of nodes, and the prediction's centre, width, and ends.

    Of each kernel the rate, the rate times the centre, and the rate times the mass.  Of those of every fourth node, of every
    second, and of all: the mass, and up to which sum there is nothing.
    """
    to, spread, count, slope = moved[0], moved[1], len(x), 0.0
    for j in range(count):
        mean, sigma = to[j], max(sqrt(spread[j]), 1e-150)
        rate = sqrt(0.5 / _LN2) / sigma
        kernel[0, j], kernel[1, j], kernel[2, j] = rate, mean * rate, mass[j] * rate
        low, high = WIDTH * sigma - mean, WIDTH * sigma + mean
        counts = mass[j] > NEGLIGIBLE
        ends[0, j] = (low if low < np.inf else np.inf) if counts else -np.inf
        ends[1, j] = (high if high < np.inf else np.inf) if counts else -np.inf
    for j in range(count, count + 4):
        kernel[0, j] = kernel[1, j] = kernel[2, j] = 0.0
    mass_2 = mass_4 = mass_all = weight_2 = weight_4 = weight_all = 0.0
    half, quarter = chosen[3], chosen[4]
    for j in range(count):
        mass_all += mass[j]
        mass_2 += half[j] * mass[j]
        mass_4 += quarter[j] * mass[j]
        weight_all += kernel[2, j]
        weight_2 += half[j] * kernel[2, j]
        weight_4 += quarter[j] * kernel[2, j]
    nothing = 2 * exp(-LOWEST)
    parts[0, 0], parts[0, 1], parts[0, 2] = mass_4 / 4, mass_2 / 2, mass_all
    parts[1, 0], parts[1, 1], parts[1, 2] = nothing * weight_4 / 4, nothing * weight_2 / 2, nothing * weight_all
    top = _place_of(_highest(density, count), density)
    if count > 1:
        top = min(max(top, 1), count - 2)
        slope = (to[top + 1] - to[top - 1]) / (x[top + 1] - x[top - 1])
    width = hypot(slope / (ROOT * density[top]) if isfinite(slope) else 0.0, max(sqrt(spread[top]), 1e-150))
    return to[top], width, -_highest(ends[0], count), _highest(ends[1], count)


@njit(**_ANY_ORDER)
def _density(x, count, kernels, kernel, parts, powers, many, found):
    """`Kernels.density` by every fourth kernel, by every second, and by all: the first so many of these.

    Two kernels at a time.  The numbers of `powers` are no constants here: the processor takes what it finds in memory as a part
    of an operation.
    """
    whole, most = _whole(count), powers[10]
    P = (
        powers[0], powers[1], powers[2], powers[3], powers[4], powers[5], powers[6], powers[7], powers[8], powers[9],
    )  # fmt: skip
    for part in range(many):
        sums, first, step = found[part], (0, 2, 1)[part], (4, 4, 2)[part]
        for i in range(whole):
            sums[i] = found[part - 1, i] if part else 0.0
        for j in range(first, kernels, 2 * step):
            rate, centre, weight = kernel[0, j], kernel[1, j], kernel[2, j]
            rate_2, centre_2, weight_2 = kernel[0, j + step], kernel[1, j + step], kernel[2, j + step]
            for i in range(whole):
                u, u_2 = x[i] * rate - centre, x[i] * rate_2 - centre_2
                u, u_2 = u * u, u_2 * u_2
                sums[i] += weight * _half(u if u < most else most, P) + weight_2 * _half(u_2 if u_2 < most else most, P)
    for part in range(many):
        sums, least, over = found[part], parts[1, part], sqrt(_LN2 / np.pi) / parts[0, part]
        for i in range(whole):
            sums[i] = sums[i] * over if sums[i] > least else 0.0


@njit(types.void(_MANY, _MANY, _MANY, _MANY_PARTS, types.float64, _MANY_PARTS), **_LOOP)
def add_bells(x, rate, centre, weights, lowest, result):
    """`kernels.add_bells`."""
    bells = np.empty(x.shape[1])
    for t in range(len(x)):
        for j in range(rate.shape[1]):
            for i in range(x.shape[1]):
                u = x[t, i] * rate[t, j] - centre[t, j]
                bells[i] = _exp(max(-(u * u), -lowest))
            for part in range(weights.shape[2]):
                for i in range(x.shape[1]):
                    result[t, part, i] += weights[t, j, part] * bells[i]


@njit(types.void(_LAW, types.int64, _VALUES, _VALUES, types.int64, _MANY), **_ANY_ORDER)
def _made(law, number, c, x, count, made):
    """Mean, variance, signal and slope by a printed law, in the first rows."""
    law(number, c, x[:count], made[0], made[1], made[2], made[3])


@njit(**_ANY_ORDER)
def _residuals(law, c, of_noise, y, x, count, shown):
    """Of y at points x, in shown[0]."""
    _made(law, METER, c, x, count, shown)
    mean, signal = shown[0], shown[2]
    for i in range(count):
        mean[i] = (abs(y - mean[i]) if of_noise else y) - signal[i]


@njit(**_ANY_ORDER)
def _seen(law, c, y, x, count, kernels, kernel, parts, powers, many, found, shown):
    """Densities of a prediction, and logarithms of the likelihood, in shown[0], and of the posterior, in shown[4].

    The latter are -inf where they are no numbers.
    """
    _made(law, METER, c, x, _whole(count), shown)
    _density(x, count, kernels, kernel, parts, powers, many, found)
    mean, variance, density, logs = shown[0], shown[1], found[many - 1], shown[4]
    for i in range(_whole(count)):
        spread = max(variance[i], TINY)
        mean[i] = -0.5 * ((y - mean[i]) * (y - mean[i]) / spread + _log(2 * np.pi * spread))
    if isnan(y):
        for i in range(_whole(count)):
            mean[i] = 0.0
    for i in range(_whole(count)):
        log = mean[i] + _log(density[i])
        logs[i] = log if log < np.inf else np.inf if log > 0 else -np.inf


@njit(**_ANY_ORDER)
def _explanations(law, c, of_noise, y, place, few, shown):
    """`explanations`: the roots of b(x, m_w) = y in the support, those nearest to the middle, in few[2]; how many.

    Its halving is that of `roots.halved`, which takes arrays and a function, written for one bracket, as numba compiles it.
    """
    at, root, left, right, far, residual, slope = few[0], few[2], few[3], few[4], few[5], shown[0], shown[3]
    known = 0
    for i in range(1, SEARCHED):
        before, after = residual[i - 1], residual[i]
        if (before > 0) == (after > 0) or not abs(after - before) < np.inf:
            continue
        distance, j = abs(0.5 * (at[i] + at[i - 1]) - place[0]), min(known, EXPLANATIONS)
        while j and distance < far[j - 1]:
            j -= 1
            far[j + 1], left[j + 1], right[j + 1] = far[j], left[j], right[j]
        far[j], left[j], right[j] = distance, at[i - 1], at[i]
        known = min(known + 1, EXPLANATIONS)
    many = np.int64(17)
    for j in range(known):
        begin, end = left[j], right[j]
        for _ in range(COARSELY // 4):  # four halvings at once: all points at which they may look
            step, i = (end - begin) / 16, 0
            for point in range(many):
                at[point] = begin + step * np.int32(point)
            _residuals(law, c, of_noise, y, at, many, shown)
            for gap in (8, 4, 2, 1):
                i += gap if (residual[i + gap] > 0) == (residual[0] > 0) else 0
            begin, end = at[i], at[i + 1]
        root[j] = 0.5 * (begin + end)
        for _ in range(2):
            _residuals(law, c, of_noise, y, root[j:], np.int64(1), shown)
            newton = root[j] + residual[0] / slope[0]
            root[j] = newton if begin < newton < end else root[j]
    return known


@njit(**_ANY_ORDER)
def _candidates(known, place, at, shown, candidates):
    """`likeliest`: centres, widths and masses of humps, of the roots and of the middle; the place of the likeliest."""
    (_, width, low, high), variance, slope, logs, of_middle = place, shown[1], shown[3], shown[4], place[1]
    best, highest = known, -np.inf
    for j in range(known + 1):
        scale = of_middle
        if j < known:
            by_meter = sqrt(variance[j]) / abs(slope[j])
            scale = by_meter if by_meter < width else width
            of_middle = min(of_middle, hypot(at[j] - at[known], scale))
        log_mass = logs[j] + _log(scale * ROOT) if 0 < scale < np.inf else -np.inf
        candidates[0, j], candidates[1, j], candidates[2, j] = at[j], scale, log_mass
        if log_mass > highest:
            best, highest = j, log_mass
    return candidates[0, best], candidates[1, best], low, high


@njit(**_ANY_ORDER)
def _overlap(mass):
    share = 1 - _log(max(mass, SEEN)) / np.log(SEEN)
    return OVERLAP * sqrt(min(max(share, 0.0), 1.0))


@njit(**_ANY_ORDER)
def _looked(few, logs, moved, dense):
    """`looked`: centre, width and ends of the highest hump; and in `dense` how densely its kernels want their nodes.

    The width is NaN where nothing is seen.
    """
    at, length, away, variance, slope, count = few[0], few[1], few[3], moved[1], moved[3], np.int64(LOOKED)
    whole = _whole(count)
    highest, area = _highest(logs, count), 0.0
    top = _place_of(highest, logs)
    for i in range(whole):
        away[i] = -abs(at[i] - at[top]) if logs[i] < highest - 0.5 else -np.inf
        logs[i] = _exp(max(logs[i] - highest, -708.0)) * length[i]
        area += logs[i]
    if not area < np.inf:
        return 0.0, np.nan, 0.0, 0.0
    fallen, first, last = -_highest(away, count), 0, count - 1
    while first < count and not logs[first] > TAIL * area:
        first += 1
    while last > 0 and not logs[last] > TAIL * area:
        last -= 1
    for i in range(whole):
        wanted = abs(slope[i]) / max(sqrt(variance[i]), 1e-150) * _overlap(logs[i] / area)
        dense[i] = wanted * wanted
    return at[top], min(area / ROOT, 2 * fallen), at[max(first - 1, 0)], at[min(last + 1, count - 1)]


@njit(**_ANY_ORDER)
def _spaced(hump, at, dense, candidates, known, spacing, wanted):
    """`spaced`: the place with which the fewest nodes do, and how many."""
    centre, width, low, high = hump
    likeliest, nodes, fewest, fewest_by_humps = -np.inf, NODES[-1], np.inf, np.inf
    best = best_by_humps = np.nan
    for j in range(known + 1):
        likeliest = max(likeliest, candidates[2, j])
    wide = _log((high - low) / width)
    for fraction in FRACTIONS:
        scale = width * _exp(fraction * wide)
        by_humps = 0.0
        for i in range(_whole(LOOKED)):
            away = at[i] - centre
            by_kernel = dense[i] * (scale * scale + away * away)
            wanted[i] = by_kernel if by_kernel < np.inf else np.inf
        for j in range(known + 1):
            if candidates[2, j] > likeliest + HIDDEN:
                away, narrow = candidates[0, j] - centre, candidates[1, j]
                by_humps = max(by_humps, (scale * scale + away * away) / (narrow * narrow))
        by_humps = max(sqrt(by_humps), sqrt(scale * scale + (HUMP * width) ** 2) / (spacing * width))
        span = _span((centre, scale, low, high))
        number = span * max(by_humps, sqrt(_highest(wanted, np.int64(LOOKED))))
        if number < fewest:
            best, fewest = scale, number
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
        if log_mass > likeliest + HIDDEN and not (inside and hypot(scale, at - centre) * step <= 2 * width):
            return True
    return False


@njit(**_ANY_ORDER)
def _distance(x, masses, count, whole):
    """`Summary.distance` of masses from mean, variance and total."""
    (of_mean, of_variance, of_total), total, first, second = whole, 0.0, 0.0, 0.0
    for i in range(_whole(count)):
        away = x[i] - of_mean
        total += masses[i]
        first += masses[i] * away
        second += masses[i] * away * away
    mean = first / total
    change = abs((second / total - mean * mean) / of_variance - 1) + abs(total / of_total - 1)
    return abs(mean) / sqrt(of_variance) + change


@njit(types.float64(_VALUES, _VALUES, types.int64, types.float64, types.float64, _VALUES, _VALUES), **_ANY_ORDER)
def _roughness(x, mass, step, mean, variance, every, differences):
    """`roughness` of every so many of the masses, taken so many times; with room for zeros before and after them."""
    count, before, rate = (len(x) - 1) // step + 1, ORDER // 2, 1 / sqrt(variance)
    for i in range(count + ORDER):
        every[i] = 0.0
    for i in range(count):
        every[before + i] = step * mass[step * i]
    for i in range(count):
        difference = 0.0
        for m in range(ORDER + 1):  # of so few terms that it is unrolled, and many differences are taken at once
            difference += COEFFICIENTS[m] * every[i + m]
        differences[i] = difference
    for i in range(count):
        away = (x[step * i] - mean) * rate
        rough = abs(differences[i]) * (1 + abs(away) + abs(away * away - 1))
        differences[i] = rough if rough < np.inf else np.inf
    return _highest(differences, count)


@njit(**_ANY_ORDER)
def _extrapolated(change, before):
    q = change / before if before > 0 else 1.0
    return change * min(max(q, min(change, 1.0) ** 0.75), 1.0)


@njit(**_ANY_ORDER)
def _cautious(change, before):
    return min(change, KINK * _extrapolated(change, before))


@njit(**_ANY_ORDER)
def _posterior(x, length, mass, density, count, shown, found, chosen):
    """`posteriors` on nodes, which fills masses and densities: mean, variance, total."""
    whole = _whole(count)
    likelihood, highest, total, m, v = shown[0], _highest(shown[4], count), 0.0, 0.0, 0.0
    for i in range(whole):
        log = likelihood[i] - highest
        likelihood[i] = (np.inf if log > 708 else _exp(max(log, -708.0))) * length[i]
    # By every fourth and second kernel, by all, and of these by every second and fourth node.
    for part in range(len(found) - 1, -1, -1):
        for i in range(whole):
            found[part, i] = chosen[part, i] * found[min(part, 2), i] * likelihood[i]
    for i in range(whole):
        total += found[2, i]
        m += found[2, i] * x[i]
    m /= total
    for i in range(whole):
        mass[i] = found[2, i] / total
        density[i] = mass[i] / length[i]
        v += mass[i] * (x[i] - m) * (x[i] - m)
    return m, v, total


@njit(**_ANY_ORDER)
def _errors(x, mass, count, moments, found, rough, rough_2, away):
    """Estimated errors of a posterior, of its own nodes and inherited; roughness of all masses and of every second."""
    m, v, _ = moments
    rounding = ROUNDING * abs(m) / sqrt(v)
    for part in range(len(found)):
        away[part] = _distance(x, found[part], count, moments)
    error = max(_extrapolated(max(away[3] - rounding, 0.0), away[4]), _cautious(max(rough - rounding, 0.0), rough_2))
    error += (mass[0] + mass[count - 1]) * max(m - x[0], x[count - 1] - m) / sqrt(v)
    return error, rounding + _cautious(max(away[1] - rounding, 0.0), away[0])


@njit(**_ANY_ORDER)
def _apart(mass, moved, gaps):
    """`apart`: how far the kernels of neighbouring nodes are, up to 1 their sum is as good as the integral."""
    to, spread, count = moved[0], moved[1], len(mass) - 2
    for i in range(count):
        before, here, after = to[i], to[i + 1], to[i + 2]
        gap = max(abs(after - here), abs(here - before)) / max(sqrt(spread[i + 1]), 1e-150) * _overlap(mass[i + 1])
        gaps[i] = gap if gap < np.inf else np.inf
    return _highest(gaps, count)


@njit(**_ANY_ORDER)
def _predicted(mass, moved):
    """`Kernels.moments`."""
    to, spread, mean, variance = moved[0], moved[1], 0.0, 0.0
    for i in range(len(mass)):
        mean += mass[i] * to[i]
    for i in range(len(mass)):
        sigma = max(sqrt(spread[i]), 1e-150)
        variance += mass[i] * (sigma * sigma + (to[i] - mean) * (to[i] - mean))
    return mean, variance


def room() -> Array:
    """The arrays that `steps` works with, as rows of one: what is allocated by compiled code takes long to compile."""
    rows = np.zeros((38, NODES[-1] + BEYOND + ORDER))
    rows[8:11], rows[11, ::2], rows[12, ::4] = 1, 2, 4  # all, every second, every fourth, so many times
    rows[37, :11] = *_POLYNOMIAL, _LOWEST2
    return rows


def _with(constants: tuple[Any, ...]) -> Callable[..., int]:
    """The loop, for numba to keep beside these constants: what is in a closure is looked at when machine code is read again."""

    @njit(
        types.int64(
            _LAW, _VALUES, types.boolean, _MANY, _NUMBERS, _NUMBERS, _VALUES, types.float64, types.float64,
            _MANY, _MANY, _NUMBERS, _NUMBERS, _MANY,
        ),
        **_LOOP | {"_nrt": False},
    )  # fmt: skip
    def steps(law, c, of_noise, before, start, count, y, accuracy, fine_nodes, after, numbers, size, status, rows):
        """One step of many trajectories: the length of `after` that is filled.

        law : of state and meter, with their constants c; whether the signal is the noise's deviation
        before (3, M), start, count (T,) : nodes, masses and densities; where those of each trajectory begin, and how many
        y (T,), accuracy, fine_nodes : as of `pointmasses`
        after (3, T * most) : as `before`, one after the other
        numbers (5, T), size, status (T,) : mean, variance, error, mean and variance predicted; nodes; LEFT, DONE or NARROW
        rows : `room()`
        """
        most, filled = constants[0][-1], np.int64(0)
        kernel, found, chosen, moved, shown, few = rows[:3], rows[3:8], rows[8:13], rows[13:17], rows[17:22], rows[22:28]
        candidates, parts, length, dense = rows[28:31], rows[31:33], rows[33], rows[34]
        padded, changes, powers, searched, looked = rows[35], rows[36], rows[37], np.int64(SEARCHED), np.int64(LOOKED)
        for t in range(len(y)):
            status[t], kernels = LEFT, count[t]
            end = start[t] + kernels
            x, mass, density = before[0, start[t] : end], before[1, start[t] : end], before[2, start[t] : end]
            if kernels > 1:
                _made(law, MOVES, c, x, kernels, moved)
            else:
                moved[0, 0], moved[1, 0] = x[0], density[0] * density[0]
            place = _kernels(x, mass, density, moved, chosen, kernel, parts, found)
            if not -np.inf < place[2] < place[3] < np.inf or isnan(place[1]):
                continue
            _nodes(place, searched, few[0], few[1])
            _residuals(law, c, of_noise, y[t], few[0], searched, shown)
            known = _explanations(law, c, of_noise, y[t], place, few, shown)
            few[2, known] = min(max(place[0], place[2]), place[3])
            _seen(law, c, y[t], few[2], known + 1, kernels, kernel, parts, powers, BY_HALF, found, shown)
            place = _candidates(known, place, few[2], shown, candidates)
            _nodes(place, looked, few[0], few[1])
            _seen(law, c, y[t], few[0], looked, kernels, kernel, parts, powers, BY_HALF, found, shown)
            _made(law, MOVES, c, few[0], _whole(looked), moved)
            hump = _looked(few, shown[4], moved, dense)
            if isnan(hump[1]):
                continue
            least = 0.0
            x, mass, density = after[0, filled:], after[1, filled:], after[2, filled:]
            for spacing in SPACINGS:
                place, wanted = _spaced(hump, few[0], dense, candidates, known, spacing, few[3])
                n = np.int64(NODES[0])
                for number in NODES:
                    n = np.int64(number) if n < max(wanted, least) else n
                _nodes(place, n, x, length)
                _seen(law, c, y[t], x, n, kernels, kernel, parts, powers, BY_ALL, found, shown)
                m, v, total = _posterior(x, length, mass, density, n, shown, found, chosen)
                rough = _roughness(x[:n], mass, 1, m, v, padded, shown[0])
                rough_2 = _roughness(x[:n], mass, 2, m, v, padded, shown[0])
                error, inherited = _errors(x, mass, n, (m, v, total), found, rough, rough_2, changes)
                _made(law, MOVES, c, x, _whole(n), moved)
                apart = _apart(mass[:n], moved, shown[0])
                least_now = (n - 1) * apart + 1
                least_now = least_now if least_now <= most else fine_nodes
                seen = error <= accuracy and inherited < np.inf and not _hidden(candidates, known, place, n)
                if seen and least_now <= n:
                    status[t], size[t] = NARROW if apart > 1 else DONE, n
                    numbers[0, t], numbers[1, t], numbers[2, t] = m, v, error + inherited
                    numbers[3, t], numbers[4, t] = _predicted(mass[:n], moved)
                    filled += n
                    break
                if n == most:
                    break
                least = max(least_now, 0.0 if seen and least_now <= n else MORE * n)
        return filled

    return steps


_OF_DENSITIES = WIDTH, NEGLIGIBLE, TAIL, LOWEST, ROOT, TINY, OVERLAP, SEEN, KINK, ROUNDING, ORDER, tuple(COEFFICIENTS)
_OF_PLACES = MORE, LOOKED, SEARCHED, COARSELY, EXPLANATIONS, HIDDEN, HUMP, tuple(FRACTIONS)
steps = _with((NODES, SPACINGS, _OF_DENSITIES, _OF_PLACES))
