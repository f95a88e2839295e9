"""Each line of a derivation beside the one above it.

After a line that differs the check goes on from that line, as the student did: a later one is right
on top of it, or wrong in itself; or it is right in itself, equal to what stood before the slip.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from kfcourse.exercises.derivations.chains import Chain, FindModel, Typed, read_chains
from kfcourse.exercises.derivations.setting import Law, Setting, of_side
from kfcourse.exercises.derivations.slips import find_slips, named
from kfcourse.exercises.derivations.terms import Node, at, letter
from kfcourse.exercises.derivations.typed import read_line
from kfcourse.exercises.derivations.values import (
    EQUAL,
    IF_POSITIVE,
    NO_VALUE,
    Uncomputed,
    compare,
)
from kfcourse.exercises.derivations.wording import UNEXPLAINED, described, rule
from kfcourse.limits import OutOfTime, time_limit
from kfcourse.symbolic.formula import FormulaError

BEGINS, RIGHT, DIFFERS, FOLLOWS, AGAIN, UNREADABLE, UNDECIDED = (
    "begins", "right", "differs", "follows", "right in itself", "unreadable", "undecided",
)  # fmt: skip
MARKS = {
    BEGINS: "·",
    RIGHT: "✓",
    FOLLOWS: "✓",
    AGAIN: "✓",
    DIFFERS: "✗",
    UNREADABLE: "?",
    UNDECIDED: "?",
}
SECONDS = 20.0  # for one line


@dataclass(frozen=True)
class Verdict:
    """What is said of one line.

    Attributes
    ----------
    line, column : int
        Where it stands: number of the line from 1, column from 0.
    text : str
    status : {"begins", "right", "differs", "follows", "right in itself", "unreadable", "undecided"}
        Follows: equal to the line above, which stands on a slip.
    says : str
    kinds : tuple of str
        Of slips that explain a line that differs; more than one only if two explain it equally
        well.
    spans : tuple of pairs
        Where the terms stand in the text that they name; none for a term of the line above.
    rule : str
        Which the right step uses.
    tree : Node, optional
        If it can be read.
    """

    line: int
    column: int
    text: str
    status: str
    says: str = ""
    kinds: tuple[str, ...] = ()
    spans: tuple[tuple[int, int], ...] = ()
    rule: str = ""
    tree: Node | None = None

    def __str__(self) -> str:
        words = f"{self.line:>4} {MARKS[self.status]} {self.text}"
        return words + "".join(f"\n       {part}" for part in (self.says, self.rule) if part)


@dataclass(frozen=True)
class Derived:
    """One chain: its name, if a name stands at its left; its lines."""

    name: str
    verdicts: tuple[Verdict, ...]

    @property
    def right(self) -> bool:
        return all(verdict.status in (BEGINS, RIGHT) for verdict in self.verdicts)

    @property
    def end(self) -> Node | None:
        """The last line, if it can be read."""
        return self.verdicts[-1].tree if self.verdicts else None


@dataclass(frozen=True)
class Report:
    """What is said of a whole derivation; shows itself as text."""

    chains: tuple[Derived, ...]

    @property
    def verdicts(self) -> list[Verdict]:
        return [verdict for chain in self.chains for verdict in chain.verdicts]

    @property
    def right(self) -> bool:
        return all(chain.right for chain in self.chains)

    @property
    def undecided(self) -> bool:
        """Whether a line cannot be read, or not be compared."""
        return any(verdict.status in (UNREADABLE, UNDECIDED) for verdict in self.verdicts)

    @property
    def first(self) -> Verdict | None:
        """The first line that differs."""
        return next((verdict for verdict in self.verdicts if verdict.status == DIFFERS), None)

    def __str__(self) -> str:
        return "\n\n".join("\n".join(map(str, chain.verdicts)) for chain in self.chains)


def check_text(text: str, find: FindModel | None, setting: Setting | None = None) -> Report:
    """Check a derivation.

    Parameters
    ----------
    text : str
        Headings and chains of lines (see `chains`).
    find : callable or None
        Name of a variant -> its model; None where no heading may name one.
    setting : Setting, optional
        What letters mean before any heading.

    Raises
    ------
    DerivationError
        It cannot be read as a whole.

    Examples
    --------
    >>> from kfcourse.exercises.derivations import check_text
    >>> print(check_text("S = M[(x - m)^4]\\n  = d^2", find=None))
       1 · M[(x - m)^4]
           nothing to compare it with: the chain is checked from here
       2 ✗ d^2
           the line differs from the one above: a number in `d^2` is not right
           Moments of a normal law: M[x^(n+1)] = m M[x^n] + n d M[x^(n-1)] for x ~ N(m, d), from
           M[1] = 1 and M[x] = m.
    """
    derived: dict[str, tuple[Law, Node]] = {}
    return Report(
        tuple(_Checking(chain, derived).checked() for chain in read_chains(text, find, setting))
    )


class _Checking:
    """A chain while it is checked, with what was derived before it, by name, and the law whose
    letters that has.

    previous, above : the line above, or what the name means, and as it was typed
    right : the last line that is right
    broken : number of the line with the first slip, after which nothing was right in itself, or 0
    """

    def __init__(self, chain: Chain, derived: dict[str, tuple[Law, Node]]):
        first, *rest = chain.links
        self.derived = derived
        self.name = first.text if first.text.isidentifier() else ""
        self.links = rest if self.name else chain.links
        self.setting = of_side(chain.setting, self.name)
        for name, (law, tree) in derived.items():
            if law == self.setting.law and name != self.name:
                meanings = {**self.setting.meanings, name: tree}
                self.setting = replace(self.setting, meanings=meanings)
        meant = self.name in self.setting.meanings
        self.previous = self.right = letter(self.name) if meant else None
        self.above, self.broken = "" if self.name else first.text, 0
        self.verdicts: list[Verdict] = []

    def checked(self) -> Derived:
        """The verdicts; what the chain derives is added."""
        for link in self.links:
            node = None
            try:
                with time_limit(SECONDS):
                    node = read_line(link.text, self.setting.problem)
                    self._judge(link, node)
            except FormulaError as error:
                self._says(link, UNREADABLE, _marked(link, error))
                continue
            except (Uncomputed, OutOfTime) as error:
                late = f"it cannot be compared within {SECONDS:g} s: split the step up"
                self._says(link, UNDECIDED, str(error) or late, node)
                continue
            self.previous, self.above = node, link.text
        end, taken = self.previous, {"", *self.setting.law.letters}
        # nothing is derived in a circle
        if end and self.name not in taken | self.setting.opened(end, closed=self.name):
            self.derived[self.name] = self.setting.law, end
        return Derived(self.name, tuple(self.verdicts))

    def _says(
        self, link: Typed, status: str, says: str = "", tree: Node | None = None, **more: Any
    ) -> None:
        self.verdicts.append(Verdict(*link, status, says, tree=tree, **more))

    def _judge(self, link: Typed, node: Node) -> None:
        """Judge one line."""
        if self.previous is None:
            compare(self.setting, node, node)  # a mean that is not computed is said here
            says = "nothing to compare it with: the chain is checked from here"
            self._says(link, BEGINS, says, node)
            self.right = node
            return
        result = compare(self.setting, node, self.previous)
        if result == EQUAL and not self.broken:
            self._says(link, RIGHT, tree=node)
            self.right = node
        elif result == EQUAL:
            self._says(link, FOLLOWS, f"right on top of line {self.broken}", node)
        elif self.broken and self.right and compare(self.setting, node, self.right) == EQUAL:
            says = f"right in itself: equal to what stood before the slip of line {self.broken}"
            self._says(link, AGAIN, says, node)
            self.broken = 0
        else:
            self._differs(link, node, self.previous, result)
            self.broken = self.broken or link.line

    def _differs(self, link: Typed, node: Node, previous: Node, result: str) -> None:
        """Say how a line differs."""
        name = "" if self.above else self.name
        where = f"what {name} means" if name else "the one above"
        if result == NO_VALUE:
            raise Uncomputed(
                node,
                f"no value to compare with {where}: a division by zero, a root of something "
                f"negative, or numbers too large",
            )
        if result == IF_POSITIVE:
            says = (
                f"equal to {where} only for positive letters: declare them in a line of its "
                f"own before the chain, positive ..."
            )
            self._says(link, DIFFERS, says, node, kinds=("positive",))
            return
        slips = find_slips(self.setting, node, previous)
        words = " or ".join(
            described(self.setting, slip, link.text, node, self.above, previous) for slip in slips
        )
        places = [at(node, named(node, slip.path)).span for slip in slips if not slip.above]
        self._says(
            link,
            DIFFERS,
            f"the line differs from {where}: {words}" if words else UNEXPLAINED.format(above=where),
            node,
            kinds=tuple(slip.kind for slip in slips),
            spans=tuple(place for place in places if place),
            rule=rule(self.setting, slips[0] if slips else None, node, previous, name),
        )


def _marked(link: Typed, error: FormulaError) -> str:
    place = link.column + error.column
    shown = link.text[max(0, error.column - 60) : error.column + 40]
    return (
        f"cannot be read at column {place + 1}: {error.problem}\n       {shown}\n       "
        f"{' ' * min(error.column, 60)}^"
    )
