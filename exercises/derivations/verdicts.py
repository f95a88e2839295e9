"""Each line of a derivation beside the one above it.

After a line that differs the check goes on from that line, as the student did: a later one is right
on top of it, or wrong in itself; or it is right in itself, equal to what stood before the slip.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from kfcourse.exercises.derivations.chains import Chain, FindModel, Typed, read_chains
from kfcourse.exercises.derivations.setting import Law, Setting, of_side
from kfcourse.exercises.derivations.slips import find_slips, named
from kfcourse.exercises.derivations.terms import LETTER, Node, at, letter, walk
from kfcourse.exercises.derivations.values import (
    DIFFERENT,
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
        tuple(_Chain(chain, derived).checked() for chain in read_chains(text, find, setting))
    )


@dataclass
class _Chain:
    chain: Chain
    derived: dict[str, tuple[Law, Node]]  # by name, with the law whose letters it has
    verdicts: list[Verdict] = field(default_factory=list)

    def checked(self) -> Derived:
        first, *rest = self.chain.links
        name = first.text if first.text.isidentifier() else ""
        self.setting = of_side(self.chain.setting, name)
        for letter_, (law, tree) in self.derived.items():
            if law == self.setting.law and letter_ != name:
                self.setting = self.setting.defining(letter_, tree)
        meant = name in self.setting.meanings
        previous: Node | None = letter(name) if meant else None
        above = "" if name else first.text
        links = iter(rest if name else self.chain.links)
        self.right: Node | None = previous  # the last line that is right
        # number of the line with the first slip, after which nothing was right in itself
        broken = 0
        for link in links:
            node = None
            defined = name if previous is not None and not above else ""
            try:
                with time_limit(SECONDS):
                    node = link.read(self.setting)
                    broken = self._line(link, node, previous, above, defined, broken)
            except FormulaError as error:
                self._says(link, UNREADABLE, _marked(link, error))
                continue
            except (Uncomputed, OutOfTime) as error:
                late = f"it cannot be compared within {SECONDS:g} s: split the step up"
                self._says(link, UNDECIDED, str(error) or late, node)
                continue
            previous, above = node, link.text
        if (
            name
            and previous is not None
            and name not in self.setting.law.letters
            and not self._comes_back(name, previous)
        ):
            self.derived[name] = self.setting.law, previous
        return Derived(name, tuple(self.verdicts))

    def _comes_back(self, name: str, tree: Node) -> bool:
        """Whether what stands for a name has the name in it again, as the letters mean here:
        nothing is derived in a circle."""
        seen: set[str] = set()
        waiting = [tree]
        while waiting:
            new = {inner.data for _, inner in walk(waiting.pop()) if inner.kind == LETTER} - seen
            seen |= new
            waiting += [
                self.setting.meanings[letter_]
                for letter_ in new
                if letter_ != name and letter_ in self.setting.meanings
            ]
        return name in seen

    def _says(
        self, link: Typed, status: str, says: str = "", tree: Node | None = None, **more: Any
    ) -> None:
        place = link.line, link.column, link.text
        self.verdicts.append(Verdict(*place, status, says, tree=tree, **more))

    def _line(
        self, link: Typed, node: Node, previous: Node | None, above: str, name: str, broken: int
    ) -> int:
        """Judge one line; returns the number of the line with the slip on which it stands, or 0."""
        if previous is None:
            compare(self.setting, node, node)  # a mean that is not computed is said here
            says = "nothing to compare it with: the chain is checked from here"
            self._says(link, BEGINS, says, node)
            self.right = node
            return 0
        result = compare(self.setting, node, previous)
        if result == EQUAL:
            if not broken:
                self._says(link, RIGHT, tree=node)
                self.right = node
            else:
                self._says(link, FOLLOWS, f"right on top of line {broken}", node)
            return broken
        if broken and self.right is not None and compare(self.setting, node, self.right) == EQUAL:
            says = f"right in itself: equal to what stood before the slip of line {broken}"
            self._says(link, AGAIN, says, node)
            return 0
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
            return broken or link.line
        slips = find_slips(self.setting, node, previous) if result == DIFFERENT else []
        words = " or ".join(
            described(self.setting, slip, link.text, node, above, previous) for slip in slips
        )
        places = [at(node, named(node, slip.path)).span for slip in slips if not slip.above]
        says = (
            f"the line differs from {where}: {words}" if words else UNEXPLAINED.format(above=where)
        )
        self._says(
            link,
            DIFFERS,
            says,
            node,
            kinds=tuple(slip.kind for slip in slips),
            spans=tuple(place for place in places if place),
            rule=rule(self.setting, slips[0] if slips else None, node, previous, name),
        )
        return broken or link.line


def _marked(link: Typed, error: FormulaError) -> str:
    place = link.column + error.column
    shown = link.text[max(0, error.column - 60) : error.column + 40]
    return (
        f"cannot be read at column {place + 1}: {error.problem}\n       {shown}\n       "
        f"{' ' * min(error.column, 60)}^"
    )
