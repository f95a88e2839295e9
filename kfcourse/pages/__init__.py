"""What only the pages of the book call.

verification  equations, sentences and numbers that are checked where they are printed; a check that fails stops the build
relations     what each typed relation of a page is: computed, a definition, quoted, stated
reader        reads a relation in LaTeX and computes its sides
tex           formulas as tokens
grammar       sums of products of factors, read into functions
values        what letters stand for, and how values add and multiply
letters       numbers for the letters that many pages share
sentences     numbers and words in the sentences of a page
exponents     squares completed in the exponents of normal laws
tables        tables of numbers
figures       the style of the figures, labels at the ends of curves
flights       pictures and tables of a flight and its estimates
browser       the lab's filters as JavaScript, from their printed equations
explore       figures that answer when they are touched
scenes        those of single chapters, and of the front page
live          the page on which a reader moves the pointer
"""

from kfcourse.pages.figures import COLOURS, book_style, label_ends
from kfcourse.pages.tables import table
from kfcourse.pages.verification import Unverified, agree, claim, typeset, verified

__all__ = ["COLOURS", "Unverified", "agree", "book_style", "claim", "label_ends", "table", "typeset", "verified"]
