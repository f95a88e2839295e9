"""LaTeX as MathML, which browsers show without any script; what the converter spells wrongly is put
right."""

from __future__ import annotations

import re

from latex2mathml.converter import convert

_THIN = '<mspace width="0.167em" />'
_NAME = r"<mi>[A-Za-z]{2,}</mi>"
_FUNCTION = rf"(?:<ms(?:up|ub|ubsup)>{_NAME}(?:(?!</ms).)*</ms(?:up|ub|ubsup)>|{_NAME})"


def mathml(latex: str, display: str = "block") -> str:
    """The formula as a `math` element, display "block" or "inline".

    Examples
    --------
    >>> from kfcourse.symbolic.markup import mathml
    >>> mathml("h", "inline")
    '<math xmlns="http://www.w3.org/1998/Math/MathML"
    display="inline"><mrow><mi>h</mi></mrow></math>'
    """
    text = convert(latex, display=display)
    text = text.replace("<mi>&#x0007E;</mi>", "<mo>&#x0223C;</mo>")  # distributed as, a relation
    text = re.sub(r"<mo>([A-Za-z]{2,})</mo>", r"<mi>\1</mi>", text)  # the name of an operator
    # A thin space between a function and what stands beside it without brackets: h sin x, not
    # hsinx.
    text = re.sub(rf"(?<=</mi>|</mn>)(?={_FUNCTION})", _THIN, text)
    text = re.sub(rf"(?<=</msup>|</msub>)(?={_FUNCTION})", _THIN, text)
    return re.sub(rf"({_FUNCTION})(?=<m(?:i|n|sup|sub|frac|sqrt)>)", rf"\1{_THIN}", text)
