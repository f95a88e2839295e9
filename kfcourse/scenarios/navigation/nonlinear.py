"""Nonlinear motion for the event-driven filter: a model whose formulas know the interval `dt`.

    x(t + dt) = a(x(t), v, dt, u),      N(m, P) -> N(tau(m, P; dt, u), Theta(m, P; dt, u))

tau and Theta are the structural functions of the model: of its linearisation, or its exact moments.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from kfcourse.angles import on_circle
from kfcourse.errors import expect
from kfcourse.laws import Array, Gaussian
from kfcourse.scenarios.navigation.dynamics import Inputs, Predictor
from kfcourse.symbolic.reading import ModelError
from kfcourse.symbolic.structure import Structure

INTERVAL, TIME = "dt", "t"


@dataclass(frozen=True)
class Motion:
    """How a state moves over any interval; for `fuse` in the place of `Dynamics`.

    Attributes
    ----------
    structure : Structure
        `linearised(model)` or `gaussian(model)` of a model with `inputs={"dt": [1], ...}`, of which only the names count; its
        meter is not used.  The noise must be that of an interval: sqrt(q*dt)*v, not v.

    Raises
    ------
    ModelError
        The formulas do not know dt, or the number k of a step, which events do not have.
    NoClosedForm
        A structure without formulas.
    """

    structure: Structure

    def __post_init__(self) -> None:
        expect(self.structure, Structure, "Motion")
        self.structure["tau"]  # NoClosedForm if there are none
        names = {symbol.name for symbol in self.structure.model.known.symbols}
        if INTERVAL not in names or "k" in names - set(self.structure.model.known.inputs):
            raise ModelError(
                f"a motion between events must know its interval, and no step: write dt into the formulas, with "
                f'inputs={{"dt": [1]}}, and t in the place of k; got {self.structure.model}'
            )

    @property
    def n(self) -> int:
        """Number of state components."""
        return self.structure.model.n

    def predictor(self, inputs: Inputs | None = None) -> Predictor:
        """(law, start, end) -> law, in as many pieces as there are values of the inputs.

        Raises
        ------
        ValueError
            Inputs of other names' number, of several runs, or that begin after they are needed.
        """
        model = self.structure.model
        formulas = self.structure.formulas
        assert formulas is not None
        function = formulas.compiled_predict.compiled.function
        symbols = [symbol.name for symbol in model.known.symbols]
        driven = [name for name in model.known.inputs if name != INTERVAL]
        times, values = self._checked(inputs, driven)

        def move(law: Gaussian, start: float, end: float) -> Gaussian:
            row = int(np.searchsorted(times, start, side="right")) - 1
            if row < 0:
                raise ValueError(f"the inputs begin at t = {times[0]:g} s, but are needed from t = {start:g} s")
            known = dict(zip(driven, values[row].ravel().tolist(), strict=True)) | {INTERVAL: end - start, TIME: start}
            mean, cov = function(law.mean, law.cov, np.array([known[name] for name in symbols]))
            return Gaussian(on_circle(np.broadcast_to(mean, law.mean.shape), model.angles.x), cov)

        def predict(law: Gaussian, start: float, end: float) -> Gaussian:
            inside = times[(times > start) & (times < end)].tolist()
            for left, right in pairwise([start, *inside, end]):
                law = move(law, left, right) if right > left else law
            return law

        return predict

    def _checked(self, inputs: Inputs | None, driven: list[str]) -> tuple[Array, Array]:
        """Times (s,) and values (s, m) of the inputs; one for all time if there are none."""
        if inputs is None and not driven:
            return np.array([-np.inf]), np.zeros((1, 1, 0))
        if inputs is None:
            raise ValueError(f"the motion has the known inputs {', '.join(driven)}; give them: inputs=Inputs(times, values)")
        times, values = np.asarray(inputs.times, dtype=float), np.asarray(inputs.values, dtype=float)
        if times.ndim != 1 or not len(times) or values.shape != (len(times), 1, len(driven)):
            wanted = f"{times.shape} and {values.shape}, not (s,) and (s, 1, {len(driven)}), for {driven}"
            raise ValueError(f"the times and values of the inputs have the shapes {wanted}")
        if not (np.isfinite(times).all() and np.isfinite(values).all() and (np.diff(times) > 0).all()):
            raise ValueError("inputs and their times must be finite, and the times ascending")
        return times, values
