"""Set l, answers as a student would type them: the right ones pass, the wrong ones are told apart or not named at all."""

import numpy as np
import sympy as sp
from answers import test_no_wrong_kind_of_mistake_is_named, test_right_answers_pass, test_what_cannot_be_compared_is_explained  # noqa: F401


def l1_by_slice(steps, ratio, first):
    sizes = np.ones(steps)
    sizes[first::ratio] += 1
    return sizes


def l1(rule, base=1):
    return lambda steps, ratio, first: [base + (1 if rule(k, ratio, first) else 0) for k in range(steps)]


def l3(there=np.isfinite, cov=lambda P, K, H: P - K @ H @ P, F=lambda H, P, R: H @ P @ H.T + R, rows_of_R="both"):
    def answer(m, P, y, H, R):
        use = np.flatnonzero(there(y))
        Hs = H[use]
        Rs = R[use][:, use] if rows_of_R == "both" else R[: len(use), : len(use)]
        if not len(use):
            return m, P
        K = P @ Hs.T @ np.linalg.inv(F(Hs, P, Rs))
        return m + K @ (y[use] - Hs @ m), cov(P, K, Hs)

    return answer


def l3_one_by_one_would_be_wrong(m, P, y, H, R):
    for i in np.flatnonzero(np.isfinite(y)):
        h = H[i]
        gain = P @ h / (h @ P @ h + R[i, i])
        m, P = m + gain * (y[i] - h @ m), P - np.outer(gain, h @ P)
    return m, P


def l3_zero_for_missing(m, P, y, H, R):
    return l3()(m, P, np.nan_to_num(y), H, R)


def l3_innovation_zero(m, P, y, H, R):
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    return m + K @ np.nan_to_num(y - H @ m), P - K @ H @ P


def l3_all_or_nothing(m, P, y, H, R):
    return (m, P) if np.isnan(y).any() else l3()(m, P, y, H, R)


def l3_by_information(m, P, y, H, R):
    use = ~np.isnan(y)
    W = H[use].T @ np.linalg.inv(R[np.ix_(use, use)]) if use.any() else np.zeros((len(m), 0))
    new = np.linalg.inv(np.linalg.inv(P) + W @ H[use])
    return new @ (np.linalg.inv(P) @ m + W @ y[use]), new


def l4(
    Q=lambda t: [[t**3 / 3, t**2 / 2], [t**2 / 2, t]],
    carry=lambda A, P: A @ P @ A.T,
    A=lambda t: [[1, t], [0, 1]],
    mean="carried",
):
    def answer(m, P, dt, q):
        step = np.array(A(dt), dtype=float)
        return (m if mean == "kept" else step @ m), carry(step, P) + q * np.array(Q(dt), dtype=float)

    return answer


def l4_in_small_steps(m, P, dt, q):
    for part in (0.25, 0.5, 0.25):
        t = part * dt
        P = np.array(
            [
                [P[0, 0] + 2 * t * P[0, 1] + t**2 * P[1, 1] + q * t**3 / 3, P[0, 1] + t * P[1, 1] + q * t**2 / 2],
                [P[0, 1] + t * P[1, 1] + q * t**2 / 2, P[1, 1] + q * t],
            ]
        )
        m = m + t * np.array([m[1], 0])
    return m, P


def l5(
    order=lambda tags, arrivals: np.argsort(tags),
    moment=lambda tags, arrivals, i: tags[i],
    use=lambda tags, arrivals, i, now: arrivals[i] <= now,
    to_now=True,
):
    def answer(tags, arrivals, values, m, P, q, r, now):
        clock = 0.0
        for i in order(tags, arrivals):
            if use(tags, arrivals, i, now):
                t = moment(tags, arrivals, i)
                m, P = l4()(m, P, t - clock, q)
                m, P = l3()(m, P, np.array([values[i]]), np.array([[1.0, 0]]), np.array([[r]]))
                clock = t
        return l4()(m, P, now - clock, q) if to_now else (m, P)

    return answer


def l5_late_ones_dropped(tags, arrivals, values, m, P, q, r, now):
    newest = [i for i in range(len(tags)) if tags[i] == max(tags[: i + 1])]
    return l5()(tags[newest], arrivals[newest], values[newest], m, P, q, r, now)


def l5_stops_at_the_first_not_arrived(tags, arrivals, values, m, P, q, r, now):
    order = np.argsort(tags)
    missing = [i for i, k in enumerate(order) if arrivals[k] > now]
    used = order[: missing[0]]
    return l5()(tags[used], arrivals[used], values[used], m, P, q, r, now)


def in_order_of_arrival(tags, arrivals):
    return range(len(tags))


def l5_whole_trajectory(tags, arrivals, values, m, P, q, r, now):
    """One large normal law of the positions and of the state now, and conditioning."""
    known = [i for i in range(len(tags)) if arrivals[i] <= now]
    times = np.array([tags[i] for i in known] + [now])

    def cross(s, t):
        short = min(s, t)
        _, at_short = l4()(m, P, short, q)
        later = np.array([[1, max(s, t) - short], [0, 1]])
        return later @ at_short if s >= t else at_short @ later.T

    C = np.block([[cross(s, t) for t in times] for s in times])
    mean = np.concatenate([[m[0] + t * m[1], m[1]] for t in times])
    pick = 2 * np.arange(len(known))
    last = np.array([2 * len(known), 2 * len(known) + 1])
    G = C[np.ix_(last, pick)] @ np.linalg.pinv(C[np.ix_(pick, pick)] + r * np.eye(len(known)))
    return mean[last] + G @ (np.array([values[i] for i in known]) - mean[pick]), C[np.ix_(last, last)] - G @ C[np.ix_(pick, last)]


def l6_from_the_motion(V, a, tau):
    t = sp.Symbol("t")
    s = V * t + a * t**2 / 2
    return s.subs(t, -tau) - s.subs(t, 0), sp.diff(s, t).subs(t, -tau) - V


def l7_normal_equations(edges, stamps):
    A = np.column_stack([stamps, np.ones(len(stamps))])
    slope, level = np.linalg.lstsq(A, edges, rcond=None)[0]
    return 1 / slope, -level / slope


def l7(x="stamps", result=lambda s, c: (1 / s, -c / s)):
    def answer(edges, stamps):
        s, c = np.polyfit(*((stamps, edges) if x == "stamps" else (edges, stamps)), 1)
        return result(s, c)

    return answer


def l7_ends(edges, stamps):
    rate = (stamps[-1] - stamps[0]) / (edges[-1] - edges[0])
    return rate, stamps[0] - rate * edges[0]


def l7_through_origin(edges, stamps):
    rate = (stamps @ stamps) / (stamps @ edges)
    return rate, np.mean(stamps - rate * edges)


RIGHT = [
    ("l1", l1_by_slice),
    ("l2", lambda reading, rate, shift: reading / rate - shift / rate),
    ("l3", l3()),
    ("l3", l3_by_information),
    ("l4", l4()),
    ("l4", l4_in_small_steps),
    ("l5", l5()),
    ("l5", l5_whole_trajectory),
    ("l6", l6_from_the_motion),
    ("l7", l7_normal_equations),
]

WRONG = [
    ("l1", "from-the-first-step", l1(lambda k, ratio, first: k % ratio == 0)),
    ("l1", "before-the-first", l1(lambda k, ratio, first: (k - first) % ratio == 0)),
    ("l1", "receiver-only", l1(lambda k, ratio, first: k >= first and (k - first) % ratio == 0, base=0)),
    ("l1", "held", l1(lambda k, ratio, first: k >= first)),
    ("l1", "one-step-off", l1(lambda k, ratio, first: k + 1 >= first and (k + 1 - first) % ratio == 0)),
    ("l1", "one-step-late", l1(lambda k, ratio, first: k > first and (k - first) % ratio == 1)),
    ("l1", "one-step-late", l1(lambda k, ratio, first: k % ratio == (first + 1) % ratio)),
    ("l1", "reversed", l1(lambda k, ratio, first: not (k >= first and (k - first) % ratio == 0))),
    ("l1", "receiver-only", lambda steps, ratio, first: (np.arange(steps) - first) % ratio == 0),
    ("l2", "other-way", lambda reading, rate, shift: rate * reading + shift),
    ("l2", "shift-not-divided", lambda reading, rate, shift: reading / rate - shift),
    ("l2", "rate-forgotten", lambda reading, rate, shift: reading - shift),
    ("l2", "shift-sign", lambda reading, rate, shift: (reading + shift) / rate),
    ("l2", "rate-multiplied", lambda reading, rate, shift: (reading - shift) * rate),
    ("l2", "shift-forgotten", lambda reading, rate, shift: reading / rate),
    ("l2", "sign", lambda reading, rate, shift: (shift - reading) / rate),
    ("l3", "missing-as-expected missing-as-zero", l3_zero_for_missing),
    ("l3", "missing-as-expected missing-as-zero", l3_innovation_zero),
    ("l3", "whole-vector-dropped", l3_all_or_nothing),
    ("l3", "wrong-part-of-R", l3(rows_of_R="first")),
    ("l3", "correlation-forgotten", l3_one_by_one_would_be_wrong),
    ("l3", "noise-forgotten", l3(F=lambda H, P, R: H @ P @ H.T)),
    ("l4", "constant-in-interval", l4(Q=lambda t: [[t**4 / 4, t**3 / 2], [t**3 / 2, t**2]])),
    ("l4", "diagonal", l4(Q=lambda t: [[t**3 / 3, 0], [0, t]])),
    ("l4", "velocity-only", l4(Q=lambda t: [[0, 0], [0, t]])),
    ("l4", "noise-forgotten", l4(Q=lambda t: [[0, 0], [0, 0]])),
    ("l4", "noise-of-fixed-step", l4(Q=lambda t: [[0, 0], [0, 1]])),
    ("l4", "correlation-sign", l4(Q=lambda t: [[t**3 / 3, -(t**2) / 2], [-(t**2) / 2, t]])),
    ("l4", "same-on-both", l4(Q=lambda t: [[t, 0], [0, t]])),
    ("l4", "carried-once", l4(carry=lambda A, P: A @ P)),
    ("l4", "covariance-not-carried", l4(carry=lambda A, P: P)),
    ("l4", "transition-transposed", l4(A=lambda t: [[1, 0], [t, 1]])),
    ("l4", "unused", l4(A=lambda t: [[1, 1], [0, 1]])),
    ("l4", "backwards", l4(A=lambda t: [[1, -t], [0, 1]])),
    ("l4", "mean-not-moved", l4(mean="kept")),
    (
        "l5",
        "arrival-for-tag",
        l5(order=lambda tags, arrivals: np.argsort(arrivals), moment=lambda tags, arrivals, i: arrivals[i]),
    ),
    ("l5", "arrival-for-tag", l5(moment=lambda tags, arrivals, i: arrivals[i], order=in_order_of_arrival)),
    ("l5", "limit", l5_stops_at_the_first_not_arrived),
    ("l5", "time-runs-backwards", l5(order=in_order_of_arrival)),
    ("l5", "future-used", l5(use=lambda tags, arrivals, i, now: True)),
    ("l5", "future-used", l5(use=lambda tags, arrivals, i, now: tags[i] <= now)),
    ("l5", "not-predicted-to-now", l5(to_now=False)),
    ("l5", "late-dropped", l5_late_ones_dropped),
    ("l6", "truth-minus-estimate", lambda V, a, tau: (V * tau - a * tau**2 / 2, a * tau)),
    ("l6", "constant-speed", lambda V, a, tau: (-V * tau, 0)),
    ("l6", "past-speed", lambda V, a, tau: (-V * tau - a * tau**2 / 2, -a * tau)),
    ("l6", "half-forgotten", lambda V, a, tau: (-V * tau + a * tau**2, -a * tau)),
    ("l6", "constant-speed", lambda V, a, tau: (-V * tau, -a * tau)),
    ("l6", "constant-speed", lambda V, a, tau: (-V * tau + a * tau**2 / 2, 0)),
    ("l6", "half-in-velocity", lambda V, a, tau: (-V * tau + a * tau**2 / 2, -a * tau / 2)),
    ("l6", "truth-minus-estimate", lambda V, a, tau: (V * tau + a * tau**2 / 2, a * tau)),
    ("l7", "regression-other-way", l7(x="edges", result=lambda s, c: (s, c))),
    ("l7", "inverse-clock shift-in-filter-time", l7(result=lambda s, c: (s, c))),
    ("l7", "inverse-clock shift-in-filter-time", l7(result=lambda s, c: (1 / s, c))),
    ("l7", "sign", l7(result=lambda s, c: (1 / s, c / s))),
    ("l7", "inverse-clock", l7(result=lambda s, c: (s, -c / s))),
    ("l7", "end-points", l7_ends),
    ("l7", "through-the-origin", l7_through_origin),
]
UNUSABLE = [
    ("l3", "a missing measurement used", l3(there=np.isnan)),
    ("l1", "expected an array of shape", lambda steps, ratio, first: 1 + (first % ratio == 0)),
    ("l3", "a missing measurement used", l3(there=lambda y: np.ones(len(y)))),
]
