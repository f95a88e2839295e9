"""The tree of a line as it was typed: nothing is simplified, so that each term can be named and
changed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, TypeAlias

Path: TypeAlias = tuple[int, ...]

NUMBER, LETTER, SUM, PRODUCT, POWER, CALL, MEAN = (
    "number",
    "letter",
    "sum",
    "product",
    "power",
    "call",
    "mean",
)


@dataclass(frozen=True, eq=False)
class Node:
    """A node of the tree; two nodes are the same only if they are one object, so that values can be
    kept by node.

    Attributes
    ----------
    kind : {"number", "letter", "sum", "product", "power", "call", "mean"}
    parts : tuple of Node
    data
        Of a number its value (Fraction), of a letter its name, of a function its name, of a power
        its exponent (Fraction); of a sum a sign for each term; of a product 1 for a factor and -1
        for a divisor.
    span : pair of int, optional
        Where it stands in the line.
    """

    kind: str
    parts: tuple[Node, ...] = ()
    data: Any = None
    span: tuple[int, int] | None = None


def number(value: int | Fraction) -> Node:
    return Node(NUMBER, data=Fraction(value))


def letter(name: str) -> Node:
    return Node(LETTER, data=name)


def total(*terms: Node, signs: tuple[int, ...] = ()) -> Node:
    """The sum of terms."""
    return Node(SUM, terms, signs or (1,) * len(terms))


def product(*factors: Node, exponents: tuple[int, ...] = ()) -> Node:
    """The product of factors; -1 marks those that divide."""
    return Node(PRODUCT, factors, exponents or (1,) * len(factors))


def power(base: Node, exponent: int | Fraction) -> Node:
    return Node(POWER, (base,), Fraction(exponent))


def mean(of: Node) -> Node:
    return Node(MEAN, (of,))


def difference(left: Node, right: Node) -> Node:
    return total(left, right, signs=(1, -1))


def walk(node: Node) -> Iterator[tuple[Path, Node]]:
    """Every node with the way to it from the root."""
    waiting: list[tuple[Path, Node]] = [((), node)]
    while waiting:
        path, node = waiting.pop()
        yield path, node
        waiting += [((*path, i), part) for i, part in enumerate(node.parts)][::-1]


def at(node: Node, path: Path) -> Node:
    for i in path:
        node = node.parts[i]
    return node


def changed(node: Node, path: Path, new: Node) -> Node:
    """The tree with another node in one place; all that is beside the way is the same objects."""
    if not path:
        return new
    parts = list(node.parts)
    parts[path[0]] = changed(parts[path[0]], path[1:], new)
    return replace(node, parts=tuple(parts))


def letters(node: Node) -> set[str]:
    return {inner.data for _, inner in walk(node) if inner.kind == LETTER}


def means_in(node: Node) -> list[Node]:
    """Means that are left to be taken."""
    return [inner for _, inner in walk(node) if inner.kind == MEAN]


def replaced(node: Node, names: dict[str, Node]) -> Node:
    """The tree with other nodes in the place of letters."""
    if node.kind == LETTER:
        return names.get(node.data, node)
    return replace(node, parts=tuple(replaced(part, names) for part in node.parts))


def written(node: Node) -> str:
    """The tree as it can be typed."""
    return _written(node, 0)


def _written(node: Node, strength: int) -> str:
    """`strength` is that of the operator around: 1 sum, 2 product, 3 divisor or base."""
    if node.kind == NUMBER:
        own, text = (0 if node.data < 0 else 4 if node.data.denominator == 1 else 2), str(node.data)
    elif node.kind == LETTER:
        own, text = 4, node.data
    elif node.kind == SUM:
        pairs = list(zip(node.data, node.parts, strict=True))
        text = "".join(f" {'+' if sign > 0 else '-'} {_written(part, 2)}" for sign, part in pairs)
        own, text = 1, text[3:] if pairs[0][0] > 0 else f"-{text[3:]}"
    elif node.kind == PRODUCT:
        text = "".join(
            f"{'*' if e > 0 else '/'}{_written(part, 3)}"
            for e, part in zip(node.data, node.parts, strict=True)
        )
        own, text = 2, text[1:] if node.data[0] > 0 else f"1{text}"
    elif node.kind == POWER:
        own, text = 3, f"{_written(node.parts[0], 4)}^{_written(number(node.data), 4)}"
    else:
        inner = _written(node.parts[0], 0)
        own, text = 4, f"M[{inner}]" if node.kind == MEAN else f"{node.data}({inner})"
    return f"({text})" if own < strength or (own < 1 <= strength) else text
