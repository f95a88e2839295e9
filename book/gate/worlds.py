r"""Numbers for the letters of a page: definitions in LaTeX, read by the reader that reads the page.

A world is a text whose lines are done one after another::

    \Psi, R: cov 2                     draw: cov n, any n m, eye n, in a b, num, share n (they sum
                                       to one), list n any m
    k: range 0 4                       an index that runs
    x, v: nodes \lambda \Psi           nodes of independent normal laws, and the operators \mathsf M
                                       and \mathsf D over them
    x, v: sample 60                    numbers by chance, with the means of a sample
    K = \Psi G^T(G\Psi G^T+R)^{-1}      define, of letters that stand above
    f(x) = \sin x                      define a function; f = f(z) gives it a value without brackets
    H = \operatorname{slope}(f, z)     a derivative; tr, rank and expm are known, too
    \Psi_{k+1} = Ap_kA^T+Q             lines with an index follow each other for each k of its
                                       range; \Psi_0 = P begins, \Psi = \Psi_2 is one without it
    c_j = \sum_i\mu_i\pi_{ij}           for each j of a range
    again:                             what follows, down to `then:`, again and again until nothing
                                       changes
    keep: K, p                         forget all other letters; `forget: a, b` these
    "|v|" = \sqrt{v^Tv}                a letter that looks like something else; `"p(x|z)" of x =
                                       ...` moves with x

A page's relation must hold in a world with all its letters, so a world says things in another way
than the page: an inverse for a gain, a sum or an integral for a closed form.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby, product
from typing import Any

import numpy as np
import scipy

from gate.relation import Reader, keys_of
from gate.tex import normal
from gate.values import At, Indexed, Of, Operator

AGAIN = 5000  # rounds of what comes to rest; those of the pages take some hundred


def world(text: str) -> Callable[[np.random.Generator], dict[str, Any]]:
    """The letters of a text of definitions, drawn with a generator."""
    lines = [line for row in text.splitlines() if (line := row.partition("#")[0].strip())]
    stepped = {line.partition("_{k+1}")[0] for line in lines if "_{k+1}" in line.partition("=")[0]}

    def make(rng: np.random.Generator) -> dict[str, Any]:
        letters, rounds = dict(FUNCTIONS), 1
        for kind, group in groupby(lines, _kind):
            if kind == "draw":
                for names, what in (line.split(": ", 1) for line in group):
                    letters = _drawn(letters, rng, names, what)
            elif kind in ("again:", "then:"):
                rounds = AGAIN if kind == "again:" else 1
            else:
                pairs = [re.fullmatch('((?:".*")?[^=]*?) *=(.*)', line).groups() for line in group]
                if kind == "step":
                    _steps(letters, pairs)
                else:
                    _define(letters, pairs, stepped, rounds)
        return letters

    return make


def _kind(line: str) -> str:
    left, equals, _ = line.partition(" =")
    if line in ("again:", "then:"):
        return line
    if not equals or line.startswith(("keep: ", "forget: ")):
        return "draw"
    return "step" if re.fullmatch(r'[^"]*_(k|\{k\+1\})', left) else "once"


def _drawn(
    letters: dict[str, Any], rng: np.random.Generator, names: str, what: str
) -> dict[str, Any]:
    if names in ("keep", "forget"):
        listed = what.split(", ")
        return {name: letters[name] for name in letters if (name in listed) == (names == "keep")}
    (kind, *words), each = what.split(), names.split(", ")
    if kind == "nodes":
        law = [float(_computed(word, letters, {})) for word in words]
        nodes, weights = normal_nodes(len(each), *law)
        return letters | dict(zip(each, nodes, strict=True)) | means(weights)
    if kind == "sample":
        values = rng.normal(size=(len(each), int(words[0])))
        return letters | dict(zip(each, values, strict=True)) | means(1 / int(words[0]))
    if kind == "list":
        draw = " ".join(words[1:])
        return letters | {
            name: Indexed([_drawn({}, rng, "", draw)[""] for _ in range(int(words[0]))])
            for name in each
        }
    draws = {
        "any": lambda *sizes: rng.normal(size=[int(size) for size in (*sizes, 1)[:2]]),
        "cov": lambda size: covariance(rng, int(size)),
        "eye": lambda size: np.eye(int(size)),
        "in": lambda low, high: rng.uniform(float(low), float(high)),
        "num": rng.normal,
        "range": lambda *ends: range(*map(int, ends)),
        "share": lambda *sizes: Indexed(
            rng.dirichlet(np.ones(int(sizes[-1])), size=[int(size) for size in sizes[:-1]])
        ),
    }
    return letters | {name: draws[kind](*words) for name in each}


def _steps(letters: dict[str, Any], pairs: list[tuple[str, str]]) -> None:
    for k in letters["k"]:
        for left, right in pairs:
            name, index = left.rsplit("_", 1)
            values = letters.setdefault(name, Indexed({})).values
            values[k + ("+1" in index)] = _computed(right, letters, {"k": k})


def _define(
    letters: dict[str, Any], pairs: list[tuple[str, str]], stepped: set[str], rounds: int
) -> None:
    before: list[Any] = []
    for _ in range(rounds):
        values = []
        for left, right in pairs:
            name, value = _defined(left, right, letters, stepped)
            letters[name] = _joined(letters.get(name), value)
            values.append(value)
        if before and all(map(_at_rest, values, before)):
            return
        before = values


def _at_rest(value: Any, before: Any) -> bool:
    return callable(value) or np.allclose(value, before, rtol=1e-14, atol=1e-300)


def _defined(
    left: str, right: str, letters: Mapping[str, Any], stepped: set[str]
) -> tuple[str, Any]:
    """The letter that a definition makes, and its value."""
    own = dict(letters)

    def function(names: Sequence[str]) -> Callable[..., Any]:
        def value(*given: Any) -> Any:
            at = dict(zip(names[: len(given)], given, strict=True))
            return _computed(right, own | at, at)

        return value

    if quoted := re.fullmatch('"(.*)"(?: of (.*))?', left):
        name, moved = quoted.groups()
        names = moved.split(", ") if moved else []
        return name, Of(function(names), *names) if moved else function([])()
    if call := re.fullmatch(r"(.+?)\(([^()]*)\)", left):
        return call[1], function(call[2].split(", "))
    if (start := re.fullmatch(r"(.+)_(\d)", left)) and start[1] in stepped:
        return start[1], Indexed({int(start[2]): function([])()})
    indices = re.fullmatch(r"(.+)_(?:\{(\w+)\}|(\w))", left)
    names = indices and (indices[2] or indices[3])
    if names and all(isinstance(own.get(index), range) for index in names):
        values = {at: function(names)(*at) for at in product(*(own[index] for index in names))}
        return indices[1], Indexed(lambda *at: values[at])
    return left, function([])()


def _joined(known: Any, value: Any) -> Any:
    """A function, or a letter with indices, keeps them beside its value without."""
    if callable(value) or isinstance(value, Indexed | Of):
        return value
    if isinstance(known, Indexed):
        return Indexed(known.values, value)
    if isinstance(known, At):
        return At(known.function, value)
    return At(known, value) if callable(known) else value


def _computed(text: str, letters: Mapping[str, Any], at: Mapping[str, Any]) -> Any:
    reader = Reader(normal(text).split(), keys_of(letters), at)
    value = reader.total()
    if reader.next or reader.failed:
        raise ValueError(f"cannot make {text}: {reader.failed or reader.text[reader.place :]}")
    return value


def covariance(rng: np.random.Generator, size: int) -> np.ndarray:
    """A positive definite matrix (size, size) without any symmetry but its own."""
    root = rng.normal(size=(size, size))
    return root @ root.T + np.eye(size)


def slope(function: Callable[[Any], Any], x: Any) -> Any:
    """The derivative of a function of a number, or the Jacobian of one of a column, by complex
    steps."""
    if np.ndim(x) == 0:
        return np.imag(function(x + 1e-30j)) / 1e-30
    return np.hstack([function(x + 1e-30j * e[:, None]).imag / 1e-30 for e in np.eye(len(x))])


def normal_nodes(
    count: int, mean: float, variance: float, order: float = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (count, ...) for so many independent normal laws, and their weights (Gauss and
    Hermite)."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(int(order) or 60 // count)
    axes = [mean + np.sqrt(variance) * nodes] * count
    shares = np.meshgrid(*[weights / weights.sum()] * count)
    return np.reshape(np.meshgrid(*axes), (count, -1)), np.prod(shares, axis=0).ravel()


def means(weights: Any) -> dict[str, Operator]:
    r"""The operators \mathsf M and \mathsf D over values with these weights."""

    def mean(values: Any) -> Any:
        return np.sum(weights * values)

    return {
        r"\mathsf M": Operator(mean),
        r"\mathsf D": Operator(lambda values: mean(values**2) - mean(values) ** 2),
    }


FUNCTIONS = {
    r"\operatorname{tr}": np.trace,
    r"\operatorname{rank}": np.linalg.matrix_rank,
    r"\operatorname{expm}": scipy.linalg.expm,
    r"\operatorname{slope}": slope,
}
