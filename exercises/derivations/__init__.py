"""A student's derivation, read and checked line by line.

terms     the tree of a line as it was typed: nothing is simplified, so that its terms can be named
typed     text -> tree, read without running it
setting   what letters mean: the law of the state, noises, the structural functions of a model
values    a tree at random points, means by Gauss-Hermite quadrature; are two lines equal?
slips     which single change of a line makes it equal to the one above?
wording   what is said of a slip, and which rule the right step uses
chains    the text of a whole derivation: its headings, its chains of lines
worked    right derivations of structural functions, for worked solutions
verdicts  each line beside the one above it; after a slip the check goes on from the student's line
"""

from kfcourse.exercises.derivations.chains import DerivationError
from kfcourse.exercises.derivations.verdicts import Report, Verdict, check_text

__all__ = ["DerivationError", "Report", "Verdict", "check_text"]
