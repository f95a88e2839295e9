"""Set f, answers as a student would type them: the right ones pass, the wrong ones are told apart or not named at all."""

import math

import numpy as np
import pytest
from answers import test_no_wrong_kind_of_mistake_is_named, test_right_answers_pass, test_what_cannot_be_compared_is_explained  # noqa: F401
from scipy.stats import norm


def f1(mean_of=None, spread=None, mass=lambda density, h: density.sum() * h, returned=None):
    def answer(density, x):
        h = x[1] - x[0]
        q = density / mass(density, h)
        mean = mean_of(q, x, h) if mean_of else (x * q).sum() * h
        var = spread(q, x, h, mean) if spread else (x**2 * q).sum() * h - mean**2
        return (density if returned == "as it came" else q), mean, var

    return answer


def normal(u, mean, variance):
    return norm.pdf(u, loc=mean, scale=np.sqrt(variance))


def f2(law=normal, joint=np.multiply, evidence=lambda joint, h: joint.sum() * h, returned=lambda C: C, divide=True):
    def answer(predicted, y, x, see):
        weights = law(y, *see(x))
        product = joint(weights, predicted)
        C = evidence(product, x[1] - x[0])
        return product / C if divide else product, returned(C)

    return answer


def f2_by_logarithms(predicted, y, x, see):
    mean, variance = see(x)
    exponent = -0.5 * (y - mean) ** 2 / variance - 0.5 * np.log(2 * np.pi * variance)
    scaled = np.exp(exponent - exponent.max()) * predicted
    mass = np.trapezoid(scaled, x)
    return scaled / mass, mass * np.exp(exponent.max())


def f3_by_loop(posterior, x, move):
    following = np.zeros_like(x)
    for weight, mean, variance in zip(posterior, *move(x), strict=True):
        following += weight * normal(x, mean, variance)
    return following * (x[1] - x[0])


def f3(law=normal, transposed=False, step=True, variance_of="before"):
    def answer(posterior, x, move):
        mean, variance = move(x)
        kernel = law(x[:, None], mean[None, :], variance[:, None] if variance_of == "after" else variance[None, :])
        h = x[1] - x[0]
        return (kernel.T if transposed else kernel) @ posterior * (h if step else 1)

    return answer


def f3_normalised(posterior, x, move):
    following = f3()(posterior, x, move)
    return following / (following.sum() * (x[1] - x[0]))


def f3_nodes_moved(posterior, x, move):
    return np.interp(x, move(x)[0], posterior)


def f3_node_by_node(posterior, x, move):
    return normal(x, *move(x)) * posterior


def f3_normal(posterior, x, move):
    mean, variance = move(x)
    weights = posterior * (x[1] - x[0])
    z = (weights * mean).sum()
    return normal(x, z, (weights * variance).sum() + (weights * mean**2).sum() - z**2)


right_moments, right_correct, right_predict = f1(), f2(), f3_by_loop


def f4(
    first=False,
    missing="skipped",
    log=np.log,
    returned="posterior",
    spread=lambda p: p,
    predict=f3_by_loop,
    total_of=lambda total, steps: total,
):
    def answer(y, x, prior, move, see):
        law = predict(prior, x, move) if first else prior
        out, total = [], 0.0
        for y_k in y:
            gone = np.isnan(y_k)
            if gone and missing == "zero":
                y_k, gone = 0.0, False
            before, evidence = law, None
            if not gone:
                law, evidence = right_correct(law, y_k, x, see)
                total += log(evidence)
            _, mean, var = right_moments(law if returned == "posterior" else before, x)
            out.append((mean, spread(var)))
            if not (gone and missing == "frozen"):
                law = predict(law, x, move)
        z, p = np.array(out).T
        return z, p, total_of(total, len(y))

    return answer


def f4_product(y, x, prior, move, see):
    z, p, total = f4()(y, x, prior, move, see)
    return z, p, math.exp(total)


def f4_row_left_out(y, x, prior, move, see):
    z, p, total = f4()(y, x, prior, move, see)
    return z[~np.isnan(y)], p[~np.isnan(y)], total


def f4_missing_not_handled(y, x, prior, move, see):
    law, out, total = prior, [], 0.0
    for y_k in y:
        law, evidence = right_correct(law, y_k, x, see)
        total += np.log(evidence)
        out.append(right_moments(law, x)[1:])
        law = right_predict(law, x, move)
    return *np.array(out).T, total


def f5_by_trial(low, high, sigma, error):
    nodes = 2
    while 2 * math.exp(-2 * (math.pi * sigma * (nodes - 1) / (high - low)) ** 2) > error:
        nodes += 1
    return nodes


def f5(more=1, factor=2, whole=math.ceil, step=lambda sigma, L: math.pi * sigma * math.sqrt(2 / L)):
    return lambda low, high, sigma, error: whole((high - low) / step(sigma, math.log(factor / error))) + more


RIGHT = [
    ("f1", f1()),
    ("f2", f2()),
    ("f2", f2_by_logarithms),
    ("f3", f3_by_loop),
    ("f3", f3()),
    ("f4", f4()),
    ("f5", f5_by_trial),
    ("f5", f5()),
]

WRONG = [
    ("f1", "step-forgotten", f1(mass=lambda density, h: density.sum())),
    (
        "f1",
        "step-forgotten",
        f1(
            mass=lambda density, h: density.sum(),
            mean_of=lambda q, x, h: (x * q).sum(),
            spread=lambda q, x, h, m: ((x - m) ** 2 * q).sum(),
        ),
    ),
    ("f1", "about-zero", f1(spread=lambda q, x, h, m: (x**2 * q).sum() * h)),
    ("f1", "deviation", f1(spread=lambda q, x, h, m: np.sqrt(((x - m) ** 2 * q).sum() * h))),
    ("f1", "not-normalised", f1(returned="as it came")),
    ("f1", "mode", f1(mean_of=lambda q, x, h: x[q.argmax()])),
    ("f1", "median", f1(mean_of=lambda q, x, h: x[(q.cumsum() * h > 0.5).argmax()])),
    ("f1", "", f1(mean_of=lambda q, x, h: x[(q.cumsum() * h > 0.25).argmax()])),  # depends on the density, by jumps
    ("f1", "weights-forgotten", f1(mean_of=lambda q, x, h: x.mean(), spread=lambda q, x, h, m: x.var())),
    ("f1", "not-normalised", f1(mass=lambda density, h: 1.0)),
    ("f2", "variance-for-deviation", f2(law=lambda y, m, v: norm.pdf(y, m, v))),
    ("f2", "factor-forgotten", f2(law=lambda y, m, v: np.exp(-((y - m) ** 2) / (2 * v)))),
    ("f2", "half-a-factor", f2(law=lambda y, m, v: np.exp(-((y - m) ** 2) / (2 * v)) / np.sqrt(2 * np.pi))),
    ("f2", "half-forgotten", f2(law=lambda y, m, v: np.exp(-((y - m) ** 2) / v) / np.sqrt(2 * np.pi * v))),
    ("f2", "not-normalised", f2(divide=False)),
    ("f2", "step-forgotten", f2(evidence=lambda joint, h: joint.sum())),
    ("f2", "likelihood-summed prediction-ignored", f2(joint=lambda weights, predicted: weights)),
    ("f2", "constant-inverted", f2(returned=lambda C: 1 / C)),
    ("f3", "transposed", f3(transposed=True)),
    ("f3", "normalised", f3_normalised),
    ("f3", "step-forgotten", f3(step=False)),
    ("f3", "variance-of-target", f3(variance_of="after")),
    ("f3", "variance-for-deviation", f3(law=lambda u, m, v: norm.pdf(u, m, v))),
    ("f3", "factor-forgotten", f3(law=lambda u, m, v: np.exp(-((u - m) ** 2) / (2 * v)))),
    ("f3", "not-spread", f3_nodes_moved),
    ("f3", "node-by-node", f3_node_by_node),
    ("f3", "normal-prediction", f3_normal),
    ("f4", "predicted-first", f4(first=True)),
    ("f4", "missing-as-zero", f4(missing="zero")),
    ("f4", "missing-step-skipped sometimes", f4(missing="frozen")),
    ("f4", "predictions-returned", f4(returned="predicted")),
    ("f4", "deviation", f4(spread=np.sqrt)),
    ("f4", "sum-of-densities", f4(log=lambda C: C)),
    ("f4", "factor", f4(log=np.log10)),
    ("f4", "constant-inverted", f4(log=lambda C: -np.log(C))),
    ("f4", "factor", f4(total_of=lambda total, steps: total / steps)),
    ("f4", "not-predicted", f4(predict=lambda law, x, move: law)),
    ("f4", "product", f4_product),
    ("f5", "intervals rounded-down", f5(more=0)),
    ("f5", "factor-before", f5(factor=1)),
    ("f5", "intervals rounded-down", f5(whole=int)),
    ("f5", "sometimes", f5(whole=round)),
    ("f5", "factor-inside", f5(step=lambda sigma, L: math.pi * sigma / math.sqrt(L))),
    ("f5", "root-forgotten", f5(step=lambda sigma, L: math.pi * sigma * 2 / L)),
]
UNUSABLE = [
    ("f4", "expected an array of shape", f4_row_left_out),
    ("f4", "a missing measurement used", f4_missing_not_handled),
]


@pytest.mark.parametrize("variant", ["21", "53", "5"])
def test_rounding_to_the_nearest_is_not_enough(told, variant):
    assert told("f5", f5(whole=round), variant).diagnosis == ("sometimes",)
