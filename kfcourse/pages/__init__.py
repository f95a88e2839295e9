"""What only the pages of the book call.

verification  equations, sentences and numbers that are checked where they are printed; a check that
              fails stops the build
exponents     squares completed in the exponents of normal laws
tables        tables of numbers
figures       the style of the figures, labels at the ends of curves
browser       the lab's filters as JavaScript, from their printed equations
explore       figures that answer when they are touched
scenes        those of single chapters, and of the front page
live          the page on which a reader moves the pointer
"""

from kfcourse.pages.figures import COLOURS, book_style, label_ends
from kfcourse.pages.tables import table
from kfcourse.pages.verification import Unverified, agree, claim, typeset, verified

__all__ = [
    "COLOURS",
    "Unverified",
    "agree",
    "book_style",
    "claim",
    "label_ends",
    "table",
    "typeset",
    "verified",
]
