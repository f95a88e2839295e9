"""Derivations made by code, from the shipped variants: right ones in unusual forms, and the same
with one planted slip.

A chain goes, for a structural function or a gain of a variant, from its definition over the
expanded mean and the means of the noises to the moments, and on to another form of the result;
SymPy and `GaussianMoments` do these steps, neither of which the
checker calls.  Each line is then rewritten at random, by rules of algebra that keep its value:
terms and factors in another order, brackets multiplied out, a number split into two, ^ or **, steps
left out, other letters for mean and variance.

A slip is one change of the tree of one line: a sign, a number, a power, a letter for another, a
factor or a term lost, a term doubled, the fourth moment taken as 3 d^2, a noise's mean square
forgotten.  `differs` makes sure, by SymPy, that it changes the
value.  The lines after it are either rewritten from the line with the slip (right on top of it) or
from the right one.
"""

import random
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from itertools import islice

import sympy as sp

from kfcourse import GaussianMoments, Model, NoClosedForm, load_variants
from kfcourse.exercises.derivations.terms import (
    CALL,
    LETTER,
    MEAN,
    NUMBER,
    POWER,
    PRODUCT,
    SUM,
    Node,
    Path,
    at,
    changed,
    letters,
    number,
    power,
    product,
    total,
    walk,
    written,
)
from kfcourse.exercises.derivations.typed import read_line
from kfcourse.exercises.derivations.worked import stages, without_expm1
from kfcourse.symbolic.formula import symbol

LAWS = (None, None, ("mu", "P"), ("lambda", "Psi"))


@dataclass(frozen=True)
class Chain:
    """A derivation: its headings and lines, and how to compute a line independently of the
    checker."""

    variant: str
    law: tuple[str, str] | None  # letters of mean and variance that a heading names
    name: str
    lines: tuple[Node, ...]
    moments: GaussianMoments
    noises: tuple[sp.Symbol, ...]

    def text(self, rng: random.Random) -> str:
        law = f"x ~ N({self.law[0]}, {self.law[1]})\n" if self.law else ""
        lines = f"\n{' ' * rng.randint(0, 4)}= ".join(typed(line, rng) for line in self.lines)
        return f"variant {self.variant}\n{law}{self.name} = {lines}"


@dataclass(frozen=True)
class Planted:
    """A chain with a slip: number of the line (among the lines of the chain), kind, way to the term
    in its tree."""

    chain: Chain
    line: int
    kind: str
    path: Path
    follows: bool


def typed(line: Node, rng: random.Random) -> str:
    text = written(line)
    if rng.random() < 0.5:
        text = text.replace("^", "**")
    return text.replace(" ", "") if rng.random() < 0.3 else text


# ---------------------------------------------------------------- chains by SymPy


def chains(seed: int, count: int) -> list[Chain]:
    """Right chains of the shipped variants, in turn."""
    rng, made = random.Random(seed), []
    wanted = [
        pair for name, variant in load_variants().items() for pair in functions(name, variant.model)
    ]
    rng.shuffle(wanted)
    for variant, function in (wanted * count)[:count]:
        model = load_variants()[variant].model
        law = rng.choice(LAWS) if model.n == 1 else None
        law = None if law and set(law) & set(model.parameters) else law
        mean, cov = law or (("z", "p") if function[0] in "tT" else ("m", "d"))
        formulas, moments = staged(variant, function, mean, cov)
        lines = [read_line(str(formula)) for formula in formulas]
        if function != "K":
            # implicit steps
            lines[2:] = [line for line in lines[2:] if rng.random() < 0.85] or lines[-1:]
        rewritten = tuple(_rewritten(line, rng, rng.randint(0, 3)) for line in lines)
        noises = model.v if function[0] in "tT" else model.w
        made.append(Chain(variant, law, name_of(function, model), rewritten, moments, noises))
    return made


def name_of(function: str, model: Model) -> str:
    """What a derivation calls it: nothing, if the letter has another meaning."""
    taken = {*model.parameters, *(s.name for s in (*model.x, *model.v, *model.w))}
    return function if function not in taken else "M[y]" if function == "h" else ""


def functions(variant: str, model: Model) -> list[tuple[str, str]]:
    names = ["tau", "Theta", "h", "G", "F", "K"]
    if model.n > 1:
        components = range(1, model.n + 1)
        # of the second component a line is a page
        names = [*(f"tau{i}" for i in components), *(f"Theta1{i}" for i in components)]
        names += ["h1", "F11"] if model.p > 1 else ["h", "F"]
    return [(variant, name) for name in names if name_of(name, model)]


@cache
def staged(
    variant: str, function: str, mean: str, cov: str
) -> tuple[list[sp.Expr], GaussianMoments]:
    model = load_variants()[variant].model
    if model.n == 1:
        m, P = sp.Matrix([symbol(mean)]), sp.Matrix([symbol(cov)])
    else:
        m = sp.Matrix([symbol(f"{mean}{i + 1}") for i in range(model.n)])
        P = sp.Matrix(model.n, model.n, lambda i, j: symbol(f"{cov}{min(i, j) + 1}{max(i, j) + 1}"))
    if function != "K":
        return stages(model, function, m, P)
    (*_, slope), law = stages(model, "G", m, P)
    (*_, noise_state, whole), _ = stages(model, "F", m, P)
    first, gain = P[0] * slope / noise_state, P[0] * slope / whole
    return [first, gain, sp.cancel(gain) if not gain.has(sp.exp) else gain], law


# ---------------------------------------------------------------- unusual forms


def _rewritten(node: Node, rng: random.Random, times: int) -> Node:
    """The tree after some rules of algebra in random places."""
    for _ in range(times):
        path, part = rng.choice(list(walk(node)))
        rule = rng.choice(RULES)
        new = rule(part, rng)
        if new is not None and _size(node) < 150:
            node = read_line(written(changed(node, path, new)))
    return read_line(written(node))


def _size(node: Node) -> int:
    return sum(1 for _ in walk(node))


def _shuffled(node: Node, rng: random.Random) -> Node | None:
    if node.kind not in (SUM, PRODUCT) or len(node.parts) < 2:
        return None
    pairs = list(zip(node.parts, node.data, strict=True))
    rng.shuffle(pairs)
    return replace(
        node, parts=tuple(part for part, _ in pairs), data=tuple(data for _, data in pairs)
    )


def _distributed(node: Node, rng: random.Random) -> Node | None:
    if node.kind != PRODUCT or any(e < 0 for e in node.data):
        return None
    sums = [i for i, part in enumerate(node.parts) if part.kind == SUM]
    if not sums:
        return None
    i = rng.choice(sums)
    rest = [part for j, part in enumerate(node.parts) if j != i]
    return total(*(product(*rest, part) for part in node.parts[i].parts), signs=node.parts[i].data)


def _split(node: Node, rng: random.Random) -> Node | None:
    if node.kind != NUMBER or node.data.denominator != 1 or node.data < 2:
        return None
    part = rng.randint(1, int(node.data) - 1)
    return total(number(part), number(node.data - part))


RULES = (_shuffled, _distributed, _split)


# ---------------------------------------------------------------- slips


def planted(made: list[Chain], seed: int) -> list[Planted]:
    """Chains with one slip each, so far as they allow one; every kind of slip in turn."""
    rng, slips = random.Random(seed), []
    for chain in made:
        kinds = [SLIPS[(len(slips) + k) % len(SLIPS)] for k in range(len(SLIPS))]
        possible = (slip for kind in kinds if (slip := _plant(chain, kind, rng)))
        slips.extend(list(islice(possible, 1)))
    return slips


def _plant(chain: Chain, slip, rng: random.Random) -> Planted | None:
    places = [(i, *pair) for i in range(1, len(chain.lines)) for pair in walk(chain.lines[i])]
    rng.shuffle(places)
    for i, path, node in places:
        line = chain.lines[i]
        instead = slip(node, rng, line, chain)
        if instead is None:
            continue
        where = path if node.kind == SUM else _term(line, path)
        new = read_line(written(changed(line, path, instead)))
        try:
            if not differs(chain, line, new):
                continue
        except NoClosedForm:  # exp(x^2)
            continue
        while not _there(new, where):  # brackets that are no longer needed are gone
            where = where[:-1]
        follows = rng.random() < 0.5
        rest = [_rewritten(new if follows else after, rng, 2) for after in chain.lines[i + 1 :]]
        return Planted(
            replace(chain, lines=(*chain.lines[:i], new, *rest)),
            i,
            slip.__name__.strip("_"),
            where,
            follows,
        )
    return None


def _there(node: Node, path: Path) -> bool:
    for i in path:
        if i >= len(node.parts):
            return False
        node = node.parts[i]
    return True


def _term(line: Node, path: Path) -> Path:
    for length in range(len(path), 0, -1):
        if at(line, path[: length - 1]).kind == SUM:
            return path[:length]
    return ()


# Each gives what takes the place of a node, or None where it cannot be made.


def _sign(node, rng, line, chain):
    return None if node.kind == SUM else total(node, signs=(-1,))


def _number(node, rng, line, chain):
    if node.kind == NUMBER:
        return number(node.data + rng.choice((1, 2, -1)) if node.data > 1 else 2)
    if node.kind == PRODUCT:
        return product(number(rng.choice((2, 3, Fraction(1, 2)))), node)
    return None


def _power(node, rng, line, chain):
    if node.kind != POWER or node.data.denominator != 1 or node.data < 1:
        return None
    return power(node.parts[0], rng.choice([k for k in (1, 2, 3, 4) if k != node.data]))


def _letter(node, rng, line, chain):
    others = sorted(letters(line) - {node.data}) if node.kind == LETTER else []
    return Node(LETTER, data=rng.choice(others)) if others else None


def _lost_factor(node, rng, line, chain):
    if node.kind != PRODUCT or len(node.parts) < 2:
        return None
    i = rng.randrange(len(node.parts))
    if node.parts[i].kind not in (LETTER, POWER) or (
        node.parts[i].parts and node.parts[i].parts[0].kind != LETTER
    ):
        return None
    return changed(node, (i,), number(1))


def _without(node, i):
    """A sum without its term number i."""
    terms, signs = (values[:i] + values[i + 1 :] for values in (node.parts, node.data))
    return Node(SUM, terms, signs)


def _lost_term(node, rng, line, chain):
    if node.kind != SUM or len(node.parts) < 2:
        return None
    return _without(node, rng.randrange(len(node.parts)))


def _twice(node, rng, line, chain):
    if node.kind != SUM or len(node.parts) < 2:
        return None
    i = rng.randrange(len(node.parts))
    return Node(SUM, (*node.parts, node.parts[i]), (*node.data, node.data[i]))


def _moment(node, rng, line, chain):
    """Put 3 d^2, or the fourth power of the mean, in the place of a fourth moment that is computed
    in this line."""
    mean, cov = chain.moments.mean[0], chain.moments.cov[0, 0]
    if node.kind != SUM or differs_formula(chain, node, mean**4 + 6 * mean**2 * cov + 3 * cov**2):
        return None
    return read_line(str(rng.choice((3 * cov**2, mean**4, 3 * (mean**2 + cov) ** 2))))


def _noise(node, rng, line, chain):
    """Forget the mean square of the noise: without the mean of w^2, what it multiplies is gone."""
    if node.kind != SUM or len(node.parts) < 2:
        return None
    noises = {noise.name for noise in chain.noises}
    for i, term in enumerate(node.parts):
        if any(part.kind == MEAN and noises & letters(part) for _, part in walk(term)):
            return _without(node, i)
    return None


SLIPS = (_sign, _number, _power, _letter, _lost_factor, _lost_term, _twice, _moment, _noise)


# ---------------------------------------------------------------- an independent value of a line


def formula_of(node: Node, moments: GaussianMoments) -> sp.Expr:
    """The line in SymPy, means by `GaussianMoments`."""
    parts = [formula_of(part, moments) for part in node.parts]
    if node.kind == NUMBER:
        return sp.Rational(node.data.numerator, node.data.denominator)
    if node.kind == LETTER:
        return symbol(node.data)
    if node.kind == SUM:
        return sp.Add(*(sign * part for sign, part in zip(node.data, parts, strict=True)))
    if node.kind == PRODUCT:
        return sp.Mul(*(part**e for e, part in zip(node.data, parts, strict=True)))
    if node.kind == POWER:
        return parts[0] ** sp.Rational(node.data.numerator, node.data.denominator)
    if node.kind == CALL:
        return getattr(sp, node.data)(parts[0])
    return mean_of(moments, parts[0])


@cache
def mean_of(moments: GaussianMoments, formula: sp.Expr) -> sp.Expr:
    return without_expm1(moments.mean_of(formula))


def differs_formula(chain: Chain, node: Node, formula: sp.Expr) -> bool:
    if any(part.kind == MEAN for _, part in walk(node)):
        return True
    return not _same(formula_of(node, chain.moments), formula)


def differs(chain: Chain, first: Node, second: Node) -> bool:
    return not _same(*(formula_of(line, chain.moments) for line in (first, second)))


def _same(first: sp.Expr, second: sp.Expr) -> bool:
    """At three points, to 20 digits of 30."""
    names = sorted(first.free_symbols | second.free_symbols, key=str)
    for k in range(3):
        source = random.Random(k)
        point = {s: sp.Rational(source.randint(101, 397), source.randint(101, 397)) for s in names}
        a, b = (sp.N(formula.xreplace(point), 30) for formula in (first, second))
        if not abs(a - b) <= sp.Float("1e-20") * (1 + abs(b)):
            return False
    return True
