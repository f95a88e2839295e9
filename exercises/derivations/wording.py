"""What is said of a slip: the kind and the term, and which rule the right step uses; never what
would be right."""

from __future__ import annotations

import re

from markupsafe import Markup, escape

from kfcourse.exercises.derivations.setting import Setting
from kfcourse.exercises.derivations.slips import Slip, named, term_path
from kfcourse.exercises.derivations.terms import (
    CALL,
    POWER,
    SUM,
    Node,
    at,
    letters,
    means_in,
    walk,
    written,
)

RULES = {
    "moments": "Moments of a normal law: M[x^(n+1)] = m M[x^n] + n d M[x^(n-1)] for x ~ N(m, d), "
    "from M[1] = 1 and M[x] = m.",
    "noise": "A noise is independent of the state and of the other noises, with M[w] = 0 and "
    "M[w^2] = 1.",
    "square": "The square of a sum has the square of each term, and each pair of terms twice.",
    "constant": "A constant comes out of a mean as it is, and out of a square squared.",
    "sign": "A minus before a bracket turns the sign of every term in it; even powers have no "
    "sign.",
    "functions": "M[exp(s x)] = exp(s m + s^2 d/2) for x ~ N(m, d); sines and cosines by "
    "imaginary s.",
    "terms": "Multiply both lines out, and compare them term by term: each term must stand in "
    "both.",
}
DEFINITIONS = {
    "gaussian": {
        "tau": "tau is the mean of the state equation over x and its noise.",
        "Theta": "Theta is the mean square of what the state equation deviates from tau.",
        "h": "h is the mean of the meter equation over x and its noise.",
        "G": "G is the derivative of h by the mean of the state.",
        "F": "F is the mean square of what the measurement deviates from h.",
        "y": "y is the meter equation.",
    },
    "linearised": {
        "tau": "Linearised, tau is the state equation at the mean, without noise.",
        "Theta": "Linearised, Theta is slope squared times variance, and the noise's factor at "
        "the mean, squared.",
        "h": "Linearised, h is the meter equation at the mean, without noise.",
        "G": "Linearised, G is the derivative of the meter equation by the state, at the mean.",
        "F": "Linearised, F is slope squared times variance, and the noise's factor at the mean, "
        "squared.",
        "y": "y is the meter equation.",
    },
}
UNEXPLAINED = (
    "It is not equal to {above}, and no single change explains it: was more than one "
    "step taken at once?"
)


def coded(text: str) -> Markup:
    """A text in HTML: what stands in backquotes is code."""
    return Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def shown(text: str, node: Node) -> str:
    """The term as it was typed."""
    return text[slice(*node.span)] if node.span else written(node)


def described(
    setting: Setting, slip: Slip, text: str, line: Node, text_above: str, above: Node
) -> str:
    """What to say of a slip.

    `text_above` is empty if nothing that the student typed stands above: then nothing of it is
    quoted.
    """
    if slip.above:
        term = shown(text_above, at(above, named(above, slip.path))) if text_above else ""
        where = f"`{term}` of the line above" if term else "a term of the definition"
        return f"what has been made of {where} is not right{_moment(slip)}"
    place = named(line, slip.path)
    term = shown(text, at(line, place))
    quoted = (
        f"`{shown(text_above, slip.lost)}`"
        if slip.lost is not None and slip.lost.span and text_above
        else ""
    )
    factor = slip.name or quoted
    of_above = f" of the line above, {quoted}" if quoted else ""
    one_with = f", one with {slip.name}" if slip.name else ""
    of = "the sign of" if place == term_path(line, slip.path) else "a sign in"
    says = {
        "sign": f"{of} `{term}` is not right",
        "doubled": f"`{term}` stands there twice",
        "letter": f"in `{term}` the letter {slip.name}, {_role(setting, slip.name)}, stands in "
        "another one's place",
        "moment": f"`{term}` is not right{_moment(slip)}",
        "power": f"{slip.name or 'something'} has the wrong power in `{term}`",
        "factor": f"a number in `{term}` is not right",
        "noise-forgotten": f"the mean square of the noise {slip.name} is forgotten: its part is "
        "missing",
        "lost-factor": f"a factor is lost from `{term}`{': ' * bool(factor)}{factor}",
        "extra": f"{'something in ' if slip.name else ''}`{term}` does not belong there",
        "lost": f"a term is lost{of_above or one_with}, in `{term}`",
    }
    return says[slip.kind]


def _moment(slip: Slip) -> str:
    if slip.order:
        return f": it takes a moment of order {slip.order} for another one"
    return ": the mean of a function, a square or a product is not that of means"


def _role(setting: Setting, name: str) -> str:
    law = setting.law
    if name in law.means:
        return "a mean"
    if name in [row[i] for i, row in enumerate(law.cov)]:
        return "a variance"
    if name in law.letters:
        return "a covariance"
    return "the state" if name in law.states else "a noise" if name in law.noises else "a parameter"


def rule(setting: Setting, slip: Slip | None, line: Node, above: Node, name: str) -> str:
    """Which rule the right step uses: the definition, if the line above is a name; else by what the
    step has done away with."""
    if definition := DEFINITIONS[setting.kind].get(name.rstrip("0123456789")):
        return definition
    kind = slip.kind if slip else ""
    lost = letters(above) - letters(line)
    noises = lost & set(setting.law.noises)
    if kind == "noise-forgotten" or (noises and kind in ("extra", "lost", "doubled", "")):
        return RULES["noise"]
    states = set(setting.law.states)
    means, left = (
        [mean for mean in means_in(node) if letters(mean) & states] for node in (above, line)
    )
    if kind == "moment" or len(means) > len(left):
        calls = any(inner.kind == CALL for mean in means for _, inner in walk(mean))
        return RULES["functions" if calls else "moments"]
    if kind in ("lost", "factor", "extra") and _squares(above) > _squares(line):
        return RULES["square"]
    if kind in ("power", "lost-factor") and slip and slip.name not in setting.law.random:
        return RULES["constant"]
    return RULES["sign" if kind == "sign" else "noise" if noises else "terms"]


def _squares(node: Node) -> int:
    return sum(inner.kind == POWER and inner.parts[0].kind == SUM for _, inner in walk(node))
