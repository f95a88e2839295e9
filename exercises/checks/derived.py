"""A question whose answer is a derivation: a text, a step a line, each line checked against the one
above it.

The student's function takes nothing and returns the text.  `derivations.check_text` reads and
compares it, and goes on after a slip from the student's own line; what is added here is whether the
derivation begins where it should, shows its steps, and ends in the letters that are given.  There
is no catalogue of mistakes: what is said follows from the lines.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import sympy as sp

from kfcourse.exercises.checks.equality import Unusable
from kfcourse.exercises.checks.question import PASSED, WRONG, Question, Result
from kfcourse.exercises.derivations import DerivationError, Report, Verdict, check_text
from kfcourse.exercises.derivations.setting import Setting, of_model, of_side
from kfcourse.exercises.derivations.terms import Node, letter, letters, means_in, written
from kfcourse.exercises.derivations.values import are_equal
from kfcourse.exercises.derivations.verdicts import (
    AGAIN,
    BEGINS,
    DIFFERS,
    FOLLOWS,
    RIGHT,
    UNDECIDED,
    UNREADABLE,
    Derived,
)
from kfcourse.symbolic.formula import symbol
from kfcourse.symbolic.model import Model

if TYPE_CHECKING:
    from kfcourse.exercises.checks.exercises import Exercise

MOST_LINES = 60
LONGEST = 20_000  # characters
SHOWN = 70  # of a line that is quoted
# right steps that earn credit beside a slip: a step can be split up at will, and that earns no more
COUNTED = 4
# that may stand in an answer; the others would change what is asked
HEADINGS = ("letters", "positive")


@dataclass(frozen=True)
class ToDerive:
    """What is to be derived.

    Attributes
    ----------
    setting : Setting
        What letters mean.
    name : str
        At the left of the chain: "F".
    ends : frozenset of str
        Letters that may stand in its last line.
    averages : bool
        Whether a mean M[...] belongs into the derivation.
    fewest : int
        Lines, all different, that show the steps.
    """

    setting: Setting
    name: str
    ends: frozenset[str]
    averages: bool = True
    fewest: int = 3

    @property
    def latex(self) -> str:
        """The name, typeset."""
        return str(sp.latex(symbol(self.name)))

    @property
    def law(self) -> str:
        """That of the state, typeset, with its letters; of several components the letters in
        words."""
        law = of_side(self.setting, self.name).law
        if len(law.states) == 1:
            return rf"$x\sim\mathcal N({law.means[0]},{law.cov[0][0]})$"
        entries = dict.fromkeys(entry for row in law.cov for entry in row)
        states, means, covs = (
            ", ".join(f"`{name}`" for name in names) for names in (law.states, law.means, entries)
        )
        return f"the normal law of {states}, with the means {means} and the covariances {covs},"


def posed_by(model: Model, name: str) -> ToDerive:
    """The derivation of a structural function of a model; ModelError if derivations are not checked
    for it."""
    setting = of_model(model)
    return ToDerive(
        setting, name, frozenset(model.parameters) | set(of_side(setting, name).law.letters)
    )


@dataclass(frozen=True)
class Derivation(Question):
    """A question whose answer is a derivation; its key is a right one.

    Attributes
    ----------
    posed : callable
        Exercise -> ToDerive.
    """

    posed: Callable[[Exercise], ToDerive] = field(kw_only=True)

    def judge(self, exercise: Exercise, text: str) -> Result:
        """Check the text.

        Raises
        ------
        Unusable
            It cannot be read as a whole, or nothing in it is the chain that is asked for.
        """
        posed = self.posed(exercise)
        report, chain = _read(posed, text)
        faults = (DIFFERS, UNREADABLE, UNDECIDED)
        slip = next((verdict for verdict in report.verdicts if verdict.status in faults), None)
        right, steps = _counted(report, posed.name)
        if not right and slip is not None and slip.status != DIFFERS:
            raise Unusable(f"{_place(slip)}: {_words(slip)}")
        open_end = _open(posed, chain.end)
        earned, wrong = min(right, COUNTED), steps - right
        share = earned / (earned + max(wrong, 1)) * (0.5 if open_end else 1.0)
        if slip is not None:
            says, kinds = _says(report, slip, right, steps), slip.kinds or (slip.status,)
        elif open_end:
            so_far = (
                f"right so far, {steps} of {steps} steps." if steps else "nothing is derived yet."
            )
            says, kinds = f"{so_far} {open_end}", ("open-end",)
        elif not _is(posed, chain.end):
            says = (
                f"each line follows from the one above it, but the end is not {posed.name}: a "
                f"name was given another meaning."
            )
            kinds, share = ("other-meaning",), 0.0
        elif shown := _not_shown(posed, chain):
            says, kinds, share = f"the end is right. {shown}", ("steps-missing",), 1 / posed.fewest
        else:
            return self.result(PASSED, "right", share=1.0)
        return self.result(WRONG, says, diagnosis=kinds, share=share)


def _read(posed: ToDerive, text: str) -> tuple[Report, Derived]:
    """The report, and the chain that is asked for; Unusable if there is none."""
    text = text.lstrip("\n").rstrip()
    begin = f"begin the first line with `{posed.name} =`, and each further one with `=`"
    if not text.strip():
        raise Unusable(f"the derivation is empty; {begin}")
    lines = text.splitlines()
    if len(text) > LONGEST or len(lines) > MOST_LINES:
        raise Unusable(
            f"got {len(lines)} lines of {len(text)} characters; at most {MOST_LINES} lines and "
            f"{LONGEST} are read"
        )
    for number, line in enumerate(lines, 1):
        typed = line.partition("#")[0].strip()
        if typed and "=" not in typed and typed.split()[0] not in HEADINGS:
            raise Unusable(
                f"line {number}, `{_short(typed)}`, has no `=`; {begin}. A remark stands after #"
            )
    try:
        report = check_text(text, None, posed.setting)
    except DerivationError as error:
        raise Unusable(" ".join(str(error).split())) from None
    law = posed.setting.law
    for chain in report.chains:
        if chain.name in {*law.random, *law.letters, *posed.ends}:
            raise Unusable(
                f"a chain begins with `{chain.name} =`, which has a meaning already; derive "
                f"`{posed.name}`"
            )
    chains = [chain for chain in report.chains if chain.name == posed.name]
    if len(chains) != 1:
        raise Unusable(
            f"{len(chains) or 'no'} chain{'s' * (len(chains) != 1)} with `{posed.name}` at the "
            f"left; {begin}"
        )
    return report, chains[0]


def _counted(report: Report, name: str) -> tuple[int, int]:
    """Right steps, and all; a line that repeats the one above it is no step, nor is one that still
    has the name in it."""
    right = steps = 0
    for chain in report.chains:
        above = ""
        for verdict in chain.verdicts:
            same, above = verdict.text == above, verdict.text
            named = verdict.tree is not None and name in letters(verdict.tree)
            if verdict.status != BEGINS and not same and not named:
                steps += 1
                right += verdict.status in (RIGHT, FOLLOWS, AGAIN)
    return right, steps


def _open(posed: ToDerive, tree: Node | None) -> str:
    """What is still to be done after the last line; nothing if it is an end."""
    if tree is None or means_in(tree):
        return "In the last line a mean is still to be taken: go on until none is left."
    if left := sorted(letters(tree) - posed.ends):
        return (
            f"The last line still has {', '.join(left)} in it: go on until only given letters "
            f"are left."
        )
    return ""


def _is(posed: ToDerive, tree: Node | None) -> bool:
    """Whether the last line is what the name means, whatever other names were given in the text."""
    return tree is not None and are_equal(
        of_side(posed.setting, posed.name), tree, letter(posed.name)
    )


def _not_shown(posed: ToDerive, chain: Derived) -> str:
    trees = [verdict.tree for verdict in chain.verdicts if verdict.tree is not None]
    if posed.averages and not any(map(means_in, trees)):
        return "But a derivation is asked for: begin with a mean M[...], and take a step a line."
    if len({written(tree) for tree in trees}) < posed.fewest:
        return (
            f"But too much is done at once: a step a line, {posed.fewest} different lines at least."
        )
    return ""


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def _place(slip: Verdict) -> str:
    return f"line {slip.line}, `{_short(slip.text)}`"


def _words(slip: Verdict) -> str:
    """In one line: the pointer of the command line's report has no place here."""
    says = slip.says.split(chr(10))[0].removesuffix(".")
    return f"{says}{'' if says.endswith('?') else '.'} {slip.rule}".strip()


def _says(report: Report, slip: Verdict, right: int, steps: int) -> str:
    """The first line that is wrong, and what stands after it."""
    later: Sequence[Verdict] = report.verdicts[report.verdicts.index(slip) + 1 :]
    again = [f"line {verdict.line}" for verdict in later if verdict.status == DIFFERS]
    more = f" There is a slip of its own in {', '.join(again)} too." if again else ""
    on_top = sum(verdict.status == FOLLOWS for verdict in later)
    kept = (
        f" What follows is right on top of it ({on_top} step{'s' * (on_top != 1)})."
        if on_top
        else ""
    )
    return f"{_place(slip)}: {_words(slip)}{kept}{more} {right} of {steps} steps are right."
