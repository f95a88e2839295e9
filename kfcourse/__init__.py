"""Kalman and nonlinear suboptimal filtering: the package behind the course companion.

model = Model.define("c*x + e*x*v", "g*x + f*x**2*w", dict(c=0.9, e=0.05, g=1, f=0.02))
gaussian(model).latex()                            structural functions, derived
compare(lab_filters(model), model, 100_000, 51, seed=1).ranking()

A folder is a floor; each one's docstring says what lives there.  Below them all: `laws` (normal
laws, gain with its pseudo-inverse, correction, missing measurements), `angles` (the short way
round), `limits` (a time limit for a block of code), `errors` (exceptions that a report can reword,
checks of arguments), `files`
(whole or not at all).
"""

from kfcourse.errors import ModelError, NoClosedForm, NotFinite
from kfcourse.lab import lab_filters, load_variants
from kfcourse.laws import Gaussian
from kfcourse.montecarlo.comparison import Comparison
from kfcourse.montecarlo.designing import design
from kfcourse.montecarlo.ensemble import Ensemble, Trajectories, simulate
from kfcourse.montecarlo.experiment import compare, predictions, run
from kfcourse.records import likelihood, read_measurements, smooth
from kfcourse.symbolic.formula import FormulaError
from kfcourse.symbolic.jumping import JumpModel
from kfcourse.symbolic.model import AngleWarning, Model
from kfcourse.symbolic.moments import GaussianMoments
from kfcourse.symbolic.quadrature import QuadratureWarning, gauss_hermite, unscented
from kfcourse.symbolic.structure import Structure, gaussian, linearised

__all__ = [
    "AngleWarning",
    "Comparison",
    "Ensemble",
    "FormulaError",
    "Gaussian",
    "GaussianMoments",
    "JumpModel",
    "Model",
    "ModelError",
    "NoClosedForm",
    "NotFinite",
    "QuadratureWarning",
    "Structure",
    "Trajectories",
    "compare",
    "design",
    "gauss_hermite",
    "gaussian",
    "lab_filters",
    "likelihood",
    "linearised",
    "load_variants",
    "predictions",
    "read_measurements",
    "run",
    "simulate",
    "smooth",
    "unscented",
]
