"""Speed and errors of the exact filter, against closed forms and plain fine grids, in one run.

    .venv/bin/python benchmarks/exact.py [--runs 512] [--steps 51] [--variants 53 2]

For every scalar variant that is shipped, and variant 53 with a meter ten times worse (53/f=.2):
microseconds of processor time a trajectory-step, panels of a posterior, the stated errors in
posterior deviations (50 %, 99 % and the worst of all steps, each with those before it), and how far
the mean is from the same filter's at accuracy 1e-6 (99 % and the worst).  Below them true over
stated error where the answer is known otherwise: from the Kalman filter, and from 4,001 equidistant
points.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from kfcourse import Model, load_variants, run, simulate
from kfcourse.filters import kalman_filter, pointmass

# a, its noise's deviation, b, the deviations of the meter and of the prior, half the grid
GRIDS = {
    "5": (lambda x: 0.95 * x, 0.2, np.sin, lambda x: 0.3, 1.0, 9.0),
    "7": (lambda x: 0.9 * x, 0.3, lambda x: x, lambda x: 0.3 * (1 + x**2), 1.0, 9.0),
    "11": (lambda x: x + 0.1 * (x - x**3), 0.15, lambda x: x, lambda x: 0.5, 0.3**0.5, 5.0),
}


def followed(
    model: Model, y: np.ndarray, accuracy: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, float]:
    """Means, deviations and stated errors (steps, runs), panels of a posterior, seconds of the
    processor."""
    exact = pointmass(model, accuracy)
    exact.step(exact.init(y.shape[1]), y[0])  # what is compiled once
    state, laws, panels, start = exact.init(y.shape[1]), [], [], time.process_time()
    for measured in y:
        state = exact.step(state, measured)
        laws.append(
            (state.posterior.mean[:, 0], np.sqrt(state.posterior.cov[:, 0, 0]), state.memory.error)
        )
        panels.append(len(state.memory.panels) / y.shape[1])
    spent = time.process_time() - start
    mean, sd, stated = (np.array(column) for column in zip(*laws, strict=True))
    return mean, sd, stated, float(np.mean(panels)), spent


def quantiles(errors: np.ndarray, *levels: float) -> str:
    return "".join(f"{error:10.0e}" for error in np.quantile(errors, levels, method="higher"))


def on_a_grid(y: np.ndarray, a, q, b, r, sd, half_width) -> tuple[np.ndarray, np.ndarray]:
    """Means and deviations (steps, runs) on equidistant points, a, b and r as functions of them."""
    x = np.linspace(-half_width, half_width, 4001)
    kernel = np.exp(-0.5 * ((x[:, None] - a(x)) / q) ** 2)
    density, laws, spread = np.exp(-0.5 * (x[:, None] / sd) ** 2), [], np.reshape(r(x), (-1, 1))
    for measured in y[..., 0]:
        density = density * np.exp(-0.5 * ((measured - b(x)[:, None]) / spread) ** 2) / spread
        density /= density.sum(axis=0)
        mean = x @ density
        laws.append((mean, np.sqrt(x**2 @ density - mean**2)))
        density = kernel @ density
    mean, sd = np.moveaxis(np.array(laws), 1, 0)
    return mean, sd


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=512)
    parser.add_argument("--steps", type=int, default=51)
    parser.add_argument("--variants", nargs="*")
    options = parser.parse_args()
    models = {name: variant.model for name, variant in load_variants().items()}
    models["53/f=.2"] = models["53"].replace(f=0.2)
    print(
        f"{'variant':>8}{'us':>8}{'panels':>8}{'stated 50 %':>12}"
        f"{'99 %':>10}{'worst':>10}{'off 99 %':>10}{'worst':>10}"
    )
    for name in options.variants or [
        name for name, model in models.items() if model.n == model.p == 1
    ]:
        y = simulate(models[name], options.runs, options.steps, seed=1).y
        mean, sd, stated, panels, spent = followed(models[name], y, 1e-3)
        off = np.abs(mean - run(pointmass(models[name], 1e-6), y).mean[..., 0]) / sd
        rate = 1e6 * spent / (options.runs * options.steps)
        print(
            f"{name:>8}{rate:8.1f}{panels:8.1f}  "
            f"{quantiles(stated, 0.5, 0.99, 1)}{quantiles(off, 0.99, 1)}",
            flush=True,
        )
    linear = Model.define("0.95*x + 0.3*v - 1", "2*x + 0.4*w", prior={"mean": 5.0, "variance": 4.0})

    def kalman(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        estimate = run(kalman_filter(linear), y)
        return estimate.mean[..., 0], np.sqrt(estimate.cov[..., 0, 0])

    known = {"Kalman": (linear, kalman)}
    known |= {
        name: (models[name], lambda y, grid=grid: on_a_grid(y, *grid))
        for name, grid in GRIDS.items()
    }
    for name, (model, answer) in known.items():
        y = simulate(model, 40, 12, seed=2).y
        expected, width = answer(y)
        for accuracy in (1e-3, 1e-6):
            mean, sd, stated, *_ = followed(model, y, accuracy)
            off = np.maximum(np.abs(mean - expected) / width, np.abs(sd / width - 1)) / stated
            print(
                f"{name:>8} true / stated at accuracy {accuracy:g}: 99 % "
                f"{np.quantile(off, 0.99):.2f}, worst {off.max():.2f}"
            )


if __name__ == "__main__":
    main()
