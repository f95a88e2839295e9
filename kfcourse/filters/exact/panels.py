r"""The Stratonovich equation for one trajectory, compiled: densities on panels, halved until
polynomials resolve them.

A density is held as its logarithm at the Q Lobatto points of each panel.  The polynomials through
these points are the density, and their two last Legendre coefficients tell how good it is.
Lobatto's points see both ends of a panel: a hump at an end would lie between the points of Gauss.
A step takes three functions, read in this order:

kernels    the prediction, a normal kernel for each point of the posterior.  Where those of a panel
           would leave gaps it is halved, and its polynomial gives the points between.  Kernels far
           narrower than their panel are widened from s to S, and a factor keeps the curvature:
           N(mu, s^2) = N(mu, S^2) (1 - (S^2 - s^2) / (2 S^2) (u^2 - 1)) up to the fourth derivative
search     first panels, halved until the standardised residual (y - b(x)) / sigma_w(x) can hide no
           hump of the likelihood between two points
corrected  the posterior on these panels, halved until it is resolved

Looking back, `corrected` multiplies by what later measurements tell of x (`sources`):

    p(x_k | all y) ~ p(x_k | y_0..k) Integral p(x' | x_k) r(x') dx',
    r = all that y_k+1.. tell of x'

A model comes as the address of one small function,
law(which, points, y, constants, x, mean, deviation) (`laws`), so that all this is compiled once for
all models.  Everything compiled stands in this file, as the compiler keeps its work by the file's
date.
"""

from __future__ import annotations

from math import exp, floor, log, sqrt
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.polynomial import Chebyshev, Polynomial, hermite_e, legendre

from kfcourse.filters.exact.columns import (
    ERROR,
    EVIDENCE,
    EXPECTED,
    KEPT,
    LEFT,
    LIKELY,
    LOST,
    MEAN,
    PROBABILITY,
    RIGHT,
    STATUS,
    VARIANCE,
    Q,
)

# deviations that the kernels of a panel may cover at accuracy 1e-3: eight points err with the 14th
# power
SPAN = 5.0
# of a panel's length: kernels are widened to it, its fourth power is the error that is left
BLUR = 0.01
REACH = 7.0  # deviations of a law that count: 1e-11 lies beyond
WINDOW = 9.0  # deviations beyond which a kernel is left out of a sum: 1e-18 of its height
APART = 3.0  # deviations of first borders from one another
JUMP = 2.0  # of the residual between two points, beyond which a hump may be hidden
LEFT_OUT = 1e-11  # mass of a density that its panels may lack
FAINT = 30.0  # below the highest log-likelihood that humps are sought: 1e-13 of it
NOTHING = 46.0  # below the highest log-density where no panel is looked at: 1e-20 of it
IMPOSSIBLE = 9.0  # deviations of the meter's noise that no record of the model has: 1e-19
GOES_ON = 23.0  # below the highest log-density where a density has not ended: 1e-10 of it
CURVED = 0.1  # times the square of the last coefficients of a density, a bound of the rule's error
ROUNDING = 1e-15  # of a state
SHORTEST = 1e-14  # of a state, or of a whole, that a panel may be long
PANELS, KERNELS = 3000, 200_000  # that a posterior and a prediction may have
TURNS = 100  # halvings one after the other, at most
WOUND = 50  # turns of an angle whose noise is so large that it tells nothing

# how a step ended; the others: why there is no posterior
FINE, PANELLED, KERNELLED, EMPTY = range(4)

# Columns of a panel's row that are of the step itself, behind those that are kept.
HIGH, MASS, FIRST, SECOND, ROUGH, LOG_ROUGH, BOUND, SHARE, COLUMNS = range(KEPT, KEPT + 9)

POINT = np.concatenate([[-1.0], legendre.legroots(legendre.legder([0] * (Q - 1) + [1])), [1.0]])
WEIGHT = 2 / (Q * (Q - 1) * legendre.legval(POINT, [0] * (Q - 1) + [1]) ** 2)
LN_WEIGHT = np.log(WEIGHT)
# of Legendre's polynomials, from values
COEFFICIENT = np.linalg.inv(legendre.legvander(POINT, Q - 1))
LAST, LAST_BUT_ONE = COEFFICIENT[-1].copy(), COEFFICIENT[-2].copy()
POWER = np.array([legendre.leg2poly(column) for column in COEFFICIENT.T])
SLOPE = np.array([legendre.legval(POINT, legendre.legder(column)) for column in COEFFICIENT.T])

# of a normal law, and what they weigh
NODE, NODE_WEIGHT = hermite_e.hermegauss(Q)
NODE_WEIGHT /= NODE_WEIGHT.sum()

EXP2 = tuple(Chebyshev.interpolate(np.exp2, 9, [-0.5, 0.5]).convert(kind=Polynomial).coef.tolist())
LN2, SHIFT = np.log(2), 1.5 * 2.0**52
ROOT_BITS, SHIFT_BITS = np.array([np.sqrt(0.5), SHIFT]).view(np.int64).tolist()
LOG_ROOT = 0.5 * np.log(2 * np.pi)
TURN = 2 * np.pi

EXACT: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract"}}
FAST: dict[str, Any] = {"error_model": "numpy", "fastmath": {"reassoc", "nsz", "contract", "arcp"}}
# Functions with a `Room` are called from here alone: what would let Python call them takes long to
# compile.  They allocate nothing, and need not count who holds an array: that took a third of the
# time.
INNER: dict[str, Any] = {
    **FAST,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "_nrt": False,
}


@njit(**EXACT)
def half(u):
    """2^-u, |u| < 1021, to 3e-14 of it, by arithmetic that a processor does for many numbers at
    once."""
    whole = SHIFT - u
    r = (SHIFT - whole) - u
    z = r * r
    even = (((EXP2[8] * z + EXP2[6]) * z + EXP2[4]) * z + EXP2[2]) * z + EXP2[0]
    odd = (((EXP2[9] * z + EXP2[7]) * z + EXP2[5]) * z + EXP2[3]) * z + EXP2[1]
    bits = np.float64(even + r * odd).view(np.int64) + (np.float64(whole).view(np.int64) << 52)
    return np.int64(bits).view(np.float64)


@njit(**EXACT)
def ln(x):
    """ln x, 1e-300 < x < 1e300, likewise."""
    bits = np.float64(x).view(np.int64)
    k = (bits - ROOT_BITS) >> 52
    m = np.int64(bits - (k << 52)).view(np.float64)
    s = (m - 1) / (m + 1)
    z, series = s * s, 0.0
    for power in range(15, 0, -2):
        series = series * z + 1 / power
    return (np.int64(k + SHIFT_BITS).view(np.float64) - SHIFT) * LN2 + 2 * s * series


@njit(**FAST)
def density(logarithm):
    """The exponential of a log-density."""
    return half(-1 / LN2 * max(logarithm, -700.0))


class Setting(NamedTuple):
    """A model's function, which of its laws are the object's and the meter's, its constants at a
    step, and the turns of y and x.

    The turn of what is no angle is infinite.
    """

    law: Any
    moves: int
    meter: int
    constants: np.ndarray
    turns: np.ndarray


class Room(NamedTuple):
    """Where a step works: room for the hardest one, allocated once for many trajectories.

    ::

        panels (PANELS + 4, COLUMNS)
        kernel (4, KERNELS): rate r and r times centre, of half((r x - r centre)^2); weight, and
            the weight of the factor u^2
        group (3, KERNELS / Q): of Q kernels, where they begin and end, their least deviation
        edge (4 PANELS, 3): a place; +1 where a law begins, -1 where it ends, 0 at a border; a
            deviation
        later: three vectors (KERNELS,), what later measurements tell: points, weights, deviations
        stack (TURNS + 2, 2): parts of a panel that wait
        point: five vectors (Q,), for arguments and results of the law; work: four
    """

    panels: np.ndarray
    kernel: np.ndarray
    group: np.ndarray
    edge: np.ndarray
    later: tuple[np.ndarray, ...]
    stack: np.ndarray
    point: tuple[np.ndarray, ...]
    work: tuple[np.ndarray, ...]


class Sum(NamedTuple):
    """How much of the room a prediction takes: groups, edges; its mass, a bound of its density, an
    error of it."""

    groups: int
    edges: int
    mass: float
    height: float
    rough: float


@njit(**INNER)
def points(left, right, x):
    for i in range(Q):
        x[i] = 0.5 * (left + right) + 0.5 * (right - left) * POINT[i]


@njit(**FAST)
def short_way(z, turn):
    """The residual of an angle, the short way round."""
    return z - turn * floor(z / turn + 0.5) if turn < np.inf else z


@njit(**FAST)
def wound(z, turn):
    """What winding around the circle adds to an angle's log-likelihood: densities of all turns add
    up."""
    total, k = 1.0, 1
    while k <= WOUND:
        away = turn * k
        nearer = exp(-0.5 * away * (away - 2 * z))
        total += nearer + exp(-0.5 * away * (away + 2 * z))
        k = k + 1 if nearer > 1e-17 else WOUND + 1
    return log(total)


@njit(**INNER)
def unresolved(values):
    """The sizes of the two last Legendre coefficients of what has these values on a panel."""
    last = last_but_one = 0.0
    for i in range(Q):
        last += LAST[i] * values[i]
        last_but_one += LAST_BUT_ONE[i] * values[i]
    return abs(last) + abs(last_but_one)


@njit(**INNER)
def residual(model, which, y, spread, point):
    """At a panel's points: z = (y - b) / sigma, and near, of an angle the short way round; q with
    ln p(y | x) = q - near^2 / 2; a turn in deviations.

    z is 1e100 where no noise makes y, and at a single state without noise, as it has no mass.  A
    missing y (NaN) tells nothing: z = q = 0.
    """
    x, z, q, near, turn = point
    model.law(which, Q, y, model.constants, x, z, q)
    whole = model.turns[0 if which == model.meter else 1]
    # a loop for each array, so that processors take many numbers at once
    n = len(x)
    for i in range(n):
        q[i] = max(sqrt(q[i] * q[i] + spread * spread), 1e-150)
    for i in range(n):
        away = y - z[i]
        z[i] = away / q[i]
        if not 1e-150 < q[i] < np.inf or z[i] != z[i]:
            z[i] = -np.inf if away < 0 else np.inf
        z[i] = min(max(z[i], -1e100), 1e100)
    for i in range(n):
        near[i] = z[i]
        turn[i] = np.inf
    if whole < np.inf:
        for i in range(n):
            turn[i] = whole / q[i]
    for i in range(n):
        q[i] = -ln(min(q[i], 1e150)) - LOG_ROOT if 1e-150 < q[i] < np.inf else -345.0
    if y != y:
        for i in range(n):
            z[i] = near[i] = q[i] = 0.0
            turn[i] = np.inf
    for i in range(n if whole < np.inf and y == y else 0):
        near[i] = short_way(z[i], turn[i])
        q[i] += wound(abs(near[i]), turn[i])


@njit(**INNER)
def predicted(room, total, x, logs):
    """Logarithm of the prediction at the points of a panel."""
    kernel, group = room.kernel, room.group
    for i in range(Q):
        logs[i] = 0.0
    g = 0
    while g < total.groups:
        begin = g
        while g < total.groups and group[0, g] <= x[Q - 1] and group[1, g] >= x[0]:
            g += 1
        rate, centre = kernel[0, Q * begin : Q * g], kernel[1, Q * begin : Q * g]
        weight, bent = kernel[2, Q * begin : Q * g], kernel[3, Q * begin : Q * g]
        for i in range(Q if g > begin else 0):
            part = 0.0
            for j in range(len(rate)):
                u = x[i] * rate[j] - centre[j]
                u = min(u * u, 1000.0)
                part += (weight[j] - bent[j] * u) * half(u)
            logs[i] += part
        g += g == begin
    for i in range(Q):
        if logs[i] > 1e-16 * total.height:
            logs[i] = ln(logs[i])
        else:  # far out: the nearest kernel's slope, exact where there is one kernel, the prior
            away = np.inf
            for g in range(total.groups):
                beyond = max(group[0, g] - x[i], x[i] - group[1, g], 0.0)
                away = min(away, WINDOW + beyond / group[2, g])
            logs[i] = log(total.height) - 0.5 * away * away


@njit(**INNER)
def log_later(model, room, later):
    """Adds to z at a panel's points what later measurements tell of x, through the object's law."""
    x, mean, deviation, _, _ = room.point
    place, weight, blur = room.later
    model.law(model.moves, Q, 0.0, model.constants, x, mean, deviation)
    for i in range(Q):
        total = 0.0
        for j in range(later):
            square = deviation[i] * deviation[i] + blur[j] * blur[j] + 1e-300
            u = (place[j] - mean[i]) * (place[j] - mean[i]) / square
            extra = 0.5 * blur[j] * blur[j] / square
            factor = (1 + extra - extra * u) / sqrt(square)
            total += weight[j] * factor * half(min(0.5 / LN2 * u, 1000.0))
        mean[i] = ln(total) - LOG_ROOT if total > 1e-290 else -700.0


@njit(**INNER)
def evaluate(model, room, y, p, total, later):
    """The logarithm of the posterior at the points of a panel, and what follows from it."""
    row, (x, z, q, near, _) = room.panels[p], room.point
    points(row[LEFT], row[RIGHT], x)
    predicted(room, total, x, row)
    if row[BOUND] == np.inf:  # else `search` knows what y tells
        residual(model, model.meter, y, 0.0, room.point)
        for i in range(Q):
            row[LIKELY + i] = q[i] - 0.5 * near[i] * near[i]
    if later:
        log_later(model, room, later)
        for i in range(Q):
            row[LIKELY + i] += z[i]
    high = -np.inf
    for i in range(Q):
        row[i] = max(row[i] + row[LIKELY + i], -1e100)
        high = max(high, row[i])
    mass = first = second = 0.0
    logarithms, values = z, q
    for i in range(Q):
        logarithms[i] = max(row[i] - high, -80.0)
        values[i] = density(logarithms[i])
        mass += WEIGHT[i] * values[i]
        first += WEIGHT[i] * values[i] * POINT[i]
        second += WEIGHT[i] * values[i] * POINT[i] * POINT[i]
    row[HIGH], row[MASS] = high, 0.5 * (row[RIGHT] - row[LEFT]) * mass
    row[FIRST], row[SECOND] = first / mass, second / mass
    row[ROUGH] = CURVED * (unresolved(values) / mass) ** 2
    row[LOG_ROUGH] = unresolved(logarithms)


@njit(**INNER)
def new(P, n, left, right):
    P[n, LEFT], P[n, RIGHT], P[n, MASS], P[n, BOUND] = left, right, -1.0, np.inf


@njit(**INNER)
def depth(z, near, turn, i):
    """How near to 0 the residual may come between its points i and i + 1.

    To 0 where it changes its sign, or passes a whole turn.  At a dip, twice as deep as a parabola.
    """
    a, b = abs(near[i]), abs(near[i + 1])
    if near[i] * near[i + 1] <= 0 or abs(z[i + 1] - z[i]) > 0.5 * turn[i]:
        return 0.0
    left = i == 0 or abs(near[i - 1]) > a
    right = i == Q - 2 or abs(near[i + 2]) > b
    if not (left and right):
        return min(a, b)
    before = abs(z[i - 1] - 2 * z[i] + z[i + 1]) if i else 0.0
    after = abs(z[i] - 2 * z[i + 1] + z[i + 2]) if i < Q - 2 else 0.0
    return max(0.0, min(a, b) - 0.5 * max(before, after))


@njit(**INNER)
def search(model, which, y, spread, room, n):
    """Halves n panels until no hump of the likelihood is hidden between two points: their
    number."""
    P, (x, z, q, near, turn) = room.panels, room.point
    best, p, shortest = -np.inf, 0, ROUNDING * (P[n - 1, RIGHT] - P[0, LEFT])
    while p < n:
        left, right = P[p, LEFT], P[p, RIGHT]
        points(left, right, x)
        residual(model, which, y, spread, room.point)
        bound, hidden = -np.inf, False
        for i in range(Q):
            P[p, LIKELY + i] = q[i] - 0.5 * near[i] * near[i]
            best = max(best, P[p, LIKELY + i])
        for i in range(Q - 1):
            low = depth(z, near, turn, i)
            top = max(q[i], q[i + 1]) - 0.5 * low * low
            bound = max(bound, top)
            hidden |= top > best - FAINT and abs(z[i + 1] - z[i]) > JUMP
        middle = 0.5 * (left + right)
        if hidden and n < PANELS and right - left > max(shortest, SHORTEST * abs(middle)):
            new(P, n, middle, right)
            P[p, RIGHT] = middle
            n += 1
        else:
            new(P, p, left, right)
            P[p, BOUND] = bound if which == model.meter else np.inf
            p += 1
    return n


@njit(**INNER)
def weighed(P, n, likeliest, peak):
    """Shares of the panels, and of the density the integral, mean from the middle of a panel,
    variance."""
    total = mean = variance = 0.0
    origin = 0.5 * (P[likeliest, LEFT] + P[likeliest, RIGHT])
    for p in range(n):
        middle, size = 0.5 * (P[p, LEFT] + P[p, RIGHT]) - origin, 0.5 * (P[p, RIGHT] - P[p, LEFT])
        P[p, SHARE] = P[p, MASS] * density(P[p, HIGH] - peak)
        total += P[p, SHARE]
        mean += P[p, SHARE] * (middle + size * P[p, FIRST])
    mean /= total
    for p in range(n):
        P[p, SHARE] /= total
        middle = 0.5 * (P[p, LEFT] + P[p, RIGHT]) - origin - mean
        size = 0.5 * (P[p, RIGHT] - P[p, LEFT])
        square = middle * middle + 2 * middle * size * P[p, FIRST] + size * size * P[p, SECOND]
        variance += P[p, SHARE] * square
    return total, mean, variance


@njit(**INNER)
def sorted_rows(P, n, whole):
    """The panels that count, in order and first, their density divided by e^whole: how many."""
    kept = 0
    for p in range(n):
        if P[p, SHARE] > LEFT_OUT:
            place = kept
            for i in range(Q):
                P[kept, i] = P[p, i] - whole
                P[kept, LIKELY + i] = P[p, LIKELY + i] - whole
            P[kept, LEFT], P[kept, RIGHT] = P[p, LEFT], P[p, RIGHT]
            while place and P[place - 1, LEFT] > P[place, LEFT]:
                for i in range(KEPT):
                    P[place, i], P[place - 1, i] = P[place - 1, i], P[place, i]
                place -= 1
            kept += 1
    return kept


@njit(**INNER)
def lacking(room, groups, place, top):
    """Error by each mass that the prediction lacks, if all of it were where the posterior is.

    The prediction, of the logarithm `top`, is nearly nothing where the record contradicts the
    model.
    """
    nearest, away = 0, np.inf
    for g in range(groups):
        far = abs(room.group[0, g] + room.group[1, g] - 2 * place)
        if far < away:
            nearest, away = g, far
    return exp(min(-top, 100.0)) / room.group[2, nearest]


@njit(**INNER)
def at_its_highest(model, room, y, p):
    """Where a panel's posterior is highest: the logarithm of the prediction, and how far y is, in
    deviations of the meter."""
    row, (x, _, _, near, _) = room.panels[p], room.point
    points(row[LEFT], row[RIGHT], x)
    residual(model, model.meter, y, 0.0, room.point)
    top = fit = 0.0
    for i in range(Q):
        if row[i] == row[HIGH]:
            top, fit = row[i] - row[LIKELY + i], abs(near[i])
    return top, fit


@njit(**INNER)
def corrected(model, room, y, n, total, later, accuracy, lost, beyond, numbers):
    """The posterior from the n first panels: how it ended, and how many are left, in order.

    The prediction lacks a mass `lost`, and with it `beyond` of the density of y.

    numbers: mean, variance, ln p(y | the past), estimated error of mean and deviation in
    deviations.
    """
    P = room.panels
    n = search(model, model.meter, y, 0.0, room, n)
    if later:
        n = search(model, model.moves, numbers[MEAN], sqrt(numbers[VARIANCE]), room, n)
    low, high, likeliest, peak, tolerance = np.inf, -np.inf, 0, -np.inf, 0.2 * accuracy
    for p in range(n):
        low, high = min(low, P[p, LEFT]), max(high, P[p, RIGHT])
        likeliest = p if P[p, BOUND] > P[likeliest, BOUND] else likeliest
    integral = mean = variance = error = origin = stride = 0.0
    for _ in range(TURNS):
        for i in range(n):
            p = (i + likeliest) % n
            if P[p, MASS] < 0 and P[p, BOUND] + log(total.height) < peak - NOTHING:
                P[p, HIGH] = P[p, 0] = P[p, Q - 1] = -1e300
                P[p, MASS] = P[p, FIRST] = P[p, SECOND] = P[p, ROUGH] = P[p, LOG_ROUGH] = 0.0
            elif P[p, MASS] < 0:
                evaluate(model, room, y, p, total, later)
                peak = max(peak, P[p, HIGH])
        for p in range(n):
            likeliest = p if P[p, HIGH] > P[likeliest, HIGH] else likeliest
        integral, mean, variance = weighed(P, n, likeliest, peak)
        if not 0 < integral < np.inf:
            return EMPTY, 0
        variance = max(variance, 1e-300)  # of a single point, as long as panels are too long
        origin, error, before = 0.5 * (P[likeliest, LEFT] + P[likeliest, RIGHT]), 0.0, n
        for p in range(before):
            if n > PANELS - 4:
                return PANELLED, 0
            left, right = P[p, LEFT], P[p, RIGHT]
            # far where the density still rises; else by one panel, then by twice as much, since a
            # panel far too long would count as mass
            further = 2 * (high - low) if p == likeliest else max(2 * stride, right - left)
            if left == low and P[p, 0] > peak - GOES_ON:
                stride, low = further, left - further
                new(P, n, low, left)
                n += 1
            if right == high and P[p, Q - 1] > peak - GOES_ON:
                stride, high = further, right + further
                new(P, n, right, high)
                n += 1
            far = max(abs(left - origin - mean), abs(right - origin - mean))
            share = P[p, SHARE] * (1 + far * far / variance)
            rough = share * max(P[p, LOG_ROUGH], P[p, ROUGH])
            if rough > tolerance and right - left > SHORTEST * abs(origin):
                new(P, n, 0.5 * (left + right), right)
                new(P, p, left, 0.5 * (left + right))
                n += 1
                continue
            error += 0.25 * share * (P[p, LOG_ROUGH] + P[p, ROUGH])
        if n == before:
            break
    else:
        return PANELLED, 0
    whole, (top, fit) = peak + log(integral), at_its_highest(model, room, y, likeliest)
    error += ROUNDING * abs(origin) / sqrt(variance)
    if not variance > 1e-300:
        return EMPTY, 0
    error += 1.0 if fit > IMPOSSIBLE else 0.0
    numbers[LOST] = exp(min(log(beyond) - whole, 100.0)) if beyond > 0 else 0.0
    error += lost * lacking(room, total.groups, origin, top) + REACH * REACH * numbers[LOST]
    error += total.rough
    numbers[MEAN], numbers[VARIANCE] = origin + mean, variance
    numbers[EVIDENCE], numbers[ERROR] = whole, error
    return FINE, sorted_rows(P, n, whole)


@njit(**INNER)
def widths(B, p):
    """Deviations to which kernels are widened at both ends of a panel: those of neighbours agree.

    A jump of widths from panel to panel would make ripples of per cents.
    """
    size = B[p, RIGHT] - B[p, LEFT]
    before = after = BLUR * size
    if p > 0 and B[p - 1, RIGHT] == B[p, LEFT]:
        before = min(before, BLUR * (B[p - 1, RIGHT] - B[p - 1, LEFT]))
    if p < len(B) - 1 and B[p + 1, LEFT] == B[p, RIGHT]:
        after = min(after, BLUR * (B[p + 1, RIGHT] - B[p + 1, LEFT]))
    return before, after


@njit(**FAST)
def between(before, after, t):
    """From `before` at t = -1 to `after` at t = 1, smoothly."""
    t = 0.25 * (1 + t) * (1 + t) * (2 - t)
    return (1 - t) * before + t * after


@njit(**INNER)
def highest(row, start):
    """Of a row's logarithms from `start` on."""
    top = -np.inf
    for i in range(Q):
        top = max(top, row[start + i])
    return top


@njit(**INNER)
def polynomial(row, start, top, power):
    """Powers' coefficients of a row's logarithms, from `start` on, less the highest of them."""
    for k in range(Q):
        power[k] = 0.0
    for i in range(Q):
        value = max(row[start + i] - top, -80.0)
        for k in range(Q):
            power[k] += POWER[i, k] * value


@njit(**FAST)
def value_at(power, t):
    """The polynomial at t, at most 1: between points it may not rise far above their highest, 0."""
    value = 0.0
    for k in range(Q - 1, -1, -1):
        value = value * t + power[k]
    return min(value, 1.0)


@njit(**INNER)
def in_halves(stack, waiting, a, b):
    """Puts both halves of [a, b] on the stack, the left one on top."""
    middle = 0.5 * (a + b)
    stack[waiting], stack[waiting + 1] = (middle, b), (a, middle)
    return waiting + 2


@njit(**INNER)
def kernels(model, weight_law, shift, B, room, total, accuracy):
    """Adds the prediction from panels B to the room: how it ended, and how much it now takes.

    The logarithm of a weight is `shift`; a weight that depends on the state is a law, `weight_law`
    < 0.
    """
    kernel, group, edge, stack = room.kernel, room.group, room.edge, room.stack
    (x, m, s, slope, _), (power, mass, deviation, weight) = room.point, room.work
    count, many, whole, height, error = total
    span = SPAN * min(accuracy / 1e-3, 1.0) ** (1 / 14)
    for p in range(len(B)):
        middle, size = 0.5 * (B[p, LEFT] + B[p, RIGHT]), 0.5 * (B[p, RIGHT] - B[p, LEFT])
        top, (before, after) = highest(B[p], 0), widths(B, p)
        stack[0], waiting, low, high = (-1.0, 1.0), 1, np.inf, -np.inf
        while waiting:
            waiting -= 1
            a, b = stack[waiting, 0], stack[waiting, 1]
            part = 0.5 * (b - a)
            points(middle + size * a, middle + size * b, x)
            weight[:] = 1.0
            if weight_law < 0:
                model.law(weight_law, Q, 0.0, model.constants, x, weight, s)
            model.law(model.moves, Q, 0.0, model.constants, x, m, s)
            share, given, covered, least, calm, steep = 0.0, 0.0, 0.0, np.inf, np.inf, False
            for i in range(Q):
                covered, calm = max(covered, abs(m[i] - m[0])), min(calm, s[i])
                slope[i] = 0.0
            for k in range(Q):
                for i in range(Q):
                    slope[i] += SLOPE[k, i] * m[k]
            length = ln(part * size)
            for i in range(Q):
                value = B[p, i] - top
                if part < 1:
                    value = value_at(power, 0.5 * (a + b) + part * POINT[i])
                x[i] = value + top + shift + length + LN_WEIGHT[i]
            for i in range(Q):
                mass[i] = density(x[i])
                share += mass[i]
                mass[i] *= weight[i]
                given += mass[i]
            for i in range(Q):
                t = 0.5 * (a + b) + part * POINT[i]
                blur = abs(slope[i]) / (part * size) * between(before, after, t)
                # beside a jump or a pole the slope of a point is no measure of a panel's
                steep |= blur > covered
                blur = min(blur, covered / span)
                deviation[i] = sqrt(s[i] * s[i] + blur * blur + 1e-300)
                least = min(least, deviation[i])
            digits = 10 * ROUNDING * abs(m[0])
            rough = max(unresolved(m) + unresolved(s) - digits, 0.0) / least
            if weight_law < 0:
                rough += unresolved(weight)
            # a measurement may ask for what has little share
            gaps = (
                covered > span * least
                or sqrt(share) * rough > 0.03 * accuracy
                or (steep and covered > calm)
            )
            if share > 1e-10 and gaps and part > 1e-9:
                if part == 1:
                    polynomial(B[p], 0, top, power)
                waiting = in_halves(stack, waiting, a, b)
                continue
            if count == KERNELS // Q:
                return KERNELLED, Sum(0, 0, 0.0, 0.0, 0.0)
            group[0, count], group[1, count], group[2, count] = np.inf, -np.inf, least
            for i in range(Q):
                j, wide = Q * count + i, max(deviation[i], covered / span)
                rate, extra = sqrt(0.5 / LN2) / wide, 0.5 - 0.5 * (s[i] / wide) ** 2
                amount = mass[i] * rate * sqrt(LN2 / np.pi)
                kernel[0, j], kernel[1, j] = rate, m[i] * rate
                kernel[2, j], kernel[3, j] = amount * (1 + extra), amount * extra * 2 * LN2
                height += kernel[2, j]
                group[0, count] = min(group[0, count], m[i] - WINDOW * wide)
                group[1, count] = max(group[1, count], m[i] + WINDOW * wide)
                reach = REACH * REACH + 2 * x[i]
                if reach > 0:
                    low = min(low, m[i] - sqrt(reach) * wide)
                    high = max(high, m[i] + sqrt(reach) * wide)
            count += 1
            whole += given
            error += share * rough
            if a == -1:
                edge[many] = m[0], 0.0, deviation[0]
                many += 1
            if b == 1:
                edge[many] = m[Q - 1], 0.0, deviation[Q - 1]
                many += 1
        if low < high:
            edge[many], edge[many + 1] = (low, 1.0, 0.0), (high, -1.0, 0.0)
            many += 2
    return FINE, Sum(count, many, whole, height, error)


@njit(**INNER)
def borders(room, many):
    """First panels, between edges of the prediction that are far enough from one another: how
    many."""
    edge, P = room.edge, room.panels
    for i in range(1, many):
        while i and edge[i - 1, 0] > edge[i, 0]:
            for column in range(3):
                edge[i, column], edge[i - 1, column] = edge[i - 1, column], edge[i, column]
            i -= 1
    open_, n, last, width = 0, 0, edge[0, 0], 0.0
    for i in range(many):
        place, kind, deviation = edge[i, 0], edge[i, 1], edge[i, 2]
        apart = kind == 0 and open_ > 0 and place - last > APART * min(deviation, width)
        ends = (kind > 0 and open_ == 0) or (kind < 0 and open_ == 1)
        if place > last and n < PANELS // 2 and (apart or ends):
            new(P, n, last, place)
            last, width = place, deviation
            n += 1
        open_ += int(kind)
    return n


@njit(**INNER)
def sources(B, least, room):
    """What y_k+1.. tell of the next state, as points, weights and deviations of kernels: how many.

    0 where they do not fit into the room.
    """
    (place, weight, blurs), stack, power, count = room.later, room.stack, room.work[0], 0
    for p in range(len(B)):
        middle, size = 0.5 * (B[p, LEFT] + B[p, RIGHT]), 0.5 * (B[p, RIGHT] - B[p, LEFT])
        top, (before, after) = highest(B[p], LIKELY), widths(B, p)
        polynomial(B[p], LIKELY, top, power)
        stack[0], waiting = (-1.0, 1.0), 1
        while waiting:
            waiting -= 1
            a, b = stack[waiting, 0], stack[waiting, 1]
            blur = min(before, after)
            if (b - a) * size > SPAN * sqrt(least * least + blur * blur) and b - a > 1e-9:
                waiting = in_halves(stack, waiting, a, b)
                continue
            if count > KERNELS - Q:
                return 0
            for i in range(Q):
                t = 0.5 * (a + b) + 0.5 * (b - a) * POINT[i]
                amount = WEIGHT[i] * 0.5 * (b - a) * size
                place[count] = middle + size * t
                weight[count] = amount * exp(min(max(value_at(power, t) + top, -700.0), 700.0))
                blurs[count] = between(before, after, t)
                count += 1
    return count


@njit(**INNER)
def least_deviation(model, room, n):
    """Of the object's noise at the points of n panels."""
    (x, m, s, _, _), least = room.point, np.inf
    for p in range(n):
        points(room.panels[p, LEFT], room.panels[p, RIGHT], x)
        model.law(model.moves, Q, 0.0, model.constants, x, m, s)
        for i in range(Q):
            least = min(least, s[i])
    return least


@njit(**FAST)
def room_for_a_step():
    return Room(
        np.empty((PANELS + 4, COLUMNS)),
        np.empty((4, KERNELS)),
        np.empty((3, KERNELS // Q)),
        np.empty((4 * PANELS, 3)),
        (np.empty(KERNELS), np.empty(KERNELS), np.empty(KERNELS)),
        np.empty((TURNS + 2, 2)),
        (np.empty(Q), np.empty(Q), np.empty(Q), np.empty(Q), np.empty(Q)),
        (np.empty(Q), np.empty(Q), np.empty(Q), np.empty(Q)),
    )


@njit(**INNER)
def mixed(numbers):
    """Probabilities of a trajectory's modes, from the densities of what each measured."""
    top, total = -np.inf, 0.0
    for j in range(len(numbers)):
        top = max(top, numbers[j, EVIDENCE])
    for j in range(len(numbers)):
        numbers[j, PROBABILITY] = exp(numbers[j, EVIDENCE] - top) if top > -np.inf else 0.0
        total += numbers[j, PROBABILITY]
    for j in range(len(numbers)):
        numbers[j, PROBABILITY] /= total


@njit(**INNER)
def prediction(model, posterior, begin, numbers, weight, room, accuracy):
    """The sum of kernels from the posteriors of all modes to the model's: how it ended, how much
    room it takes.

    weight : probabilities of transitions (J, J), negative where they depend on the state.
    """
    status, total, modes, mode = FINE, Sum(0, 0, 0.0, 0.0, 0.0), len(weight), model.meter // 2
    for i in range(modes):
        rows, by_state = posterior[begin[i] : begin[i + 1]], weight[i, mode] < 0
        share = numbers[i, PROBABILITY] * abs(weight[i, mode])
        if status == FINE and len(rows) and share > 0:
            weight_law = -1 - i * modes - mode if by_state else 0
            status, total = kernels(model, weight_law, log(share), rows, room, total, accuracy)
    return status, total


@njit(**INNER)
def left_out(earlier, model, posterior, begin, numbers, weight, y, room):
    """The mass that the prediction lacks, and its part of the density of y.

    All that a posterior's panels have lost is taken to lie at both of their ends.  So a record that
    contradicts the model is known: measurements lead to where the state was never thought to be, by
    and by or at once, and what is lost grows with each.  Of records as the model makes them it does
    not grow, in the mean.
    """
    (x, z, q, near, _), lost, beyond = room.point, 0.0, 0.0
    modes, mode = len(weight), model.meter // 2
    for i in range(modes):
        rows = posterior[begin[i] : begin[i + 1]]
        mass = numbers[i, PROBABILITY] * (numbers[i, LOST] + LEFT_OUT)
        lost += mass
        if not len(rows):
            continue
        for place in (rows[0, LEFT], rows[len(rows) - 1, RIGHT]):
            x[:], share = place, 0.5 * mass * abs(weight[i, mode])
            if weight[i, mode] < 0:
                earlier.law(-1 - i * modes - mode, Q, 0.0, earlier.constants, x, z, q)
                share *= z[0]
            earlier.law(earlier.moves, Q, 0.0, earlier.constants, x, z, q)
            for k in range(Q):
                x[k] = z[k] + q[k] * NODE[k]
            residual(model, model.meter, y, 0.0, room.point)
            for k in range(Q):
                beyond += share * NODE_WEIGHT[k] * density(q[k] - 0.5 * near[k] * near[k])
    return lost, beyond


@njit(cache=True, nogil=True, error_model="numpy")
def advance(
    law,
    constants,
    turns,
    y,
    before,
    begin,
    later,
    later_begin,
    chain,
    first,
    back,
    accuracy,
    numbers,
):
    """One step of some trajectories, forward, or back.

    Parameters
    ----------
    law : the model's function
    constants : ndarray (2, ...)
        Of this step, and of the one before.
    turns : ndarray (2,)
        Of y and of x, infinite for what is no angle.
    y : ndarray (T,)
    before, begin : ndarray (rows, KEPT), (T J + 1,)
        Posteriors of the step before.
    later, later_begin
        What is known of the next step, looking back.
    chain : ndarray (J, J)
        Transitions to this step; negative where they depend on the state.
    first : bool
        Whether the object's law is the prior, whatever was before.
    back : bool
    accuracy : float
    numbers : ndarray (T J, NUMBERS)
        Of the step before; PROBABILITY is used; looking back MEAN and VARIANCE of the next.  Is
        filled.

    Returns
    -------
    panels : ndarray (rows, KEPT)
        The posterior of each mode of each trajectory, one below the other; begin : where they
        begin.
    """
    room = room_for_a_step()
    T, modes, used = len(y), len(chain), 0
    after, places = np.empty((8 * T * modes + 64, KEPT)), np.zeros(T * modes + 1, dtype=np.int64)
    for t in range(T):
        start = t * modes
        here = numbers[start : start + modes]
        known, later_count = here.copy(), 0
        for j in range(modes):
            moves = 2 * modes if first else 2 * j
            earlier = Setting(law, moves, 2 * j + 1, constants[1], turns)
            model = Setting(law, 2 * j, 2 * j + 1, constants[0], turns)
            status, total = prediction(earlier, before, begin[start:], known, chain, room, accuracy)
            n = borders(room, total.edges) if status == FINE and total.edges else 0
            if back and n:
                rows = later[later_begin[t] : later_begin[t + 1]]
                later_count = sources(rows, least_deviation(model, room, n), room)
                status = status if later_count or not len(rows) else KERNELLED
            kept, here[j, EVIDENCE] = 0, -np.inf
            # where there is no prediction, the step is refused
            here[j, EXPECTED] = total.mass if status == FINE else 1.0
            if status == FINE and n:
                lost = beyond = 0.0
                if not first:
                    lost, beyond = left_out(
                        earlier, model, before, begin[start:], known, chain, y[t], room
                    )
                status, kept = corrected(
                    model,
                    room,
                    y[t],
                    n,
                    total,
                    later_count,
                    accuracy,
                    lost,
                    beyond,
                    here[j],
                )
            here[j, STATUS] = status
            if used + kept > len(after):
                more = np.empty((2 * len(after) + kept, KEPT))
                more[:used] = after[:used]
                after = more
            after[used : used + kept] = room.panels[:kept, :KEPT]
            used += kept
            places[start + j + 1] = used
        mixed(here)
    return after[:used].copy(), places
