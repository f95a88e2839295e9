"""Normal moments without a closed form: against adaptive quadrature, on the laws that occur; what is refused, what is said."""

import json
from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
import scipy.stats
from click.testing import CliRunner

from kfcourse.cli import main
from kfcourse.filters import aof, fos
from kfcourse.lab import checked_quadrature as cq
from kfcourse.lab.admission import admissions
from kfcourse.lab.short_names import FILTERS, LAB, Structures, lab_filters
from kfcourse.montecarlo.ensemble import simulate
from kfcourse.montecarlo.experiment import compare, states
from kfcourse.scenarios import benchmarks
from kfcourse.symbolic.model import Model
from kfcourse.symbolic.moments import NoClosedForm
from kfcourse.symbolic.quadrature import gauss_hermite

CUBIC = Model.define("x/(1 + x**2) + v", "x**3 + x + w", prior={"mean": 0.1, "variance": 1})


def checked(model):
    return Structures(model).quadrature


def test_the_moments_are_those_of_adaptive_quadrature_at_laws_of_fresh_trajectories():
    """The pilot's own laws are others; on these its promise holds too, a root mean square, so four times as much for one."""
    found = checked(CUBIC)
    assert found.structure.name == "gaussian" and found.apart <= cq.CLOSE
    visited = states(aof(found.structure), simulate(CUBIC, 12, 6, seed=9).y)[1:]
    for state in visited:
        z, p = (one[:, 0] for one in (state.posterior.mean, state.posterior.cov[..., 0]))
        tau, theta = found.structure.predict(*state.posterior)
        for i in range(12):
            law = scipy.stats.norm(z[i], np.sqrt(p[i]))
            first, second = (
                scipy.integrate.quad(lambda x, n=n, law=law: (x / (1 + x**2)) ** n * law.pdf(x), -np.inf, np.inf)[0]
                for n in (1, 2)
            )
            sd = np.sqrt(second - first**2 + 1)
            assert abs(tau[i, 0] - first) < 4 * cq.CLOSE * sd
            assert abs(theta[i, 0, 0] - sd**2) < 4 * cq.CLOSE * sd**2


def test_the_order_is_the_first_that_does():
    found = checked(CUBIC)
    less, same = (cq._apart(*(gauss_hermite(CUBIC, n) for n in (order, 2 * order))) for order in (found.order // 2, found.order))
    assert less > cq.CLOSE >= same == found.apart
    narrow = checked(Model.define("x/(1 + x**2) + 0.1*v", "x**3 + x + w", prior={"mean": 0.1, "variance": 0.01}))
    assert narrow.order < found.order  # smoother over narrower laws


def test_a_comparison_by_a_higher_order_is_the_same():
    """What the comparison sees of the order: no more than CLOSE allows, 2e-4 of the error variance."""
    structures = [replace(gauss_hermite(CUBIC, order), name=f"gh{order}") for order in (checked(CUBIC).order, 100)]
    result = compare(
        [family(one) for family in (aof, fos) for one in structures], CUBIC, 4000, 8, 1, threads=1, progress=False, wide=1
    )
    for family in ("aof", "fos"):
        one, other = (result.error_variance(f"{family}-{structure.name}").value for structure in structures)
        np.testing.assert_allclose(one, other, rtol=2e-4)


@pytest.mark.parametrize(
    ("model", "says"),
    [
        (benchmarks.growth_model(), r"160 points an axis still errs by \d+ %"),  # its laws are wider than the hump of the slope
        (Model.define("0.9*x + v", "tan(x) + w"), "without bound"),  # there is no mean
        (Model.define("0.9*x + v", "sign(x) + w"), r"160 points an axis still errs by"),
    ],
)
def test_what_no_order_does_is_refused_and_the_term_still_named(model, says):
    structures = Structures(model)
    with pytest.raises(NoClosedForm, match=r"no closed-form Gaussian mean of the term .*" + says):
        _ = structures.normal
    assert structures.quadrature is structures.quadrature  # not sought again for every filter
    with pytest.raises(NoClosedForm, match=r"^fos-gaussian: .*" + says):
        lab_filters(model, ["fos-gaussian"])


def test_too_many_axes_are_refused_before_they_take_hours(monkeypatch):
    monkeypatch.setattr(cq, "MOST", 10)
    model = Model.define(["x1/(1 + x2**2) + 0.3*v1", "0.9*x2 + v2"], "x1 + w")
    with pytest.raises(NoClosedForm, match="no closed-form Gaussian mean"):
        _ = Structures(model).normal


def test_points_count_the_noises_that_multiply():
    assert cq._points(CUBIC, 5) == 5
    assert cq._points(Model.define("x/(1 + x**2)*v", "x*w1 + w2"), 5) == 25
    assert cq._points(Model.define("0.9*x + v", "sin(w1)*w2/(1 + x**2)"), 3) == 27


@pytest.mark.filterwarnings("ignore::kfcourse.symbolic.quadrature.QuadratureWarning")
@pytest.mark.parametrize("size", [1, 7, 50])
@pytest.mark.parametrize("timed", ["", " + 0.1*k"])
def test_pieces_make_the_whole(size, timed):
    model = Model.define(["x1/(1 + x2**2) + 0.3*v1" + timed, "0.9*x2 + v2"], "x1 + w*x2")
    whole = gauss_hermite(model, 3)
    pieces = cq._in_pieces(whole, size)
    rng = np.random.default_rng(1)
    mean = rng.normal(size=(20, 2))
    for cov in (np.array([[1.0, 0.2], [0.2, 0.5]]), np.stack([np.diag(d) for d in rng.uniform(0.1, 1, size=(20, 2))])):
        for function in ("predict", "measure"):
            for one, other in zip(
                getattr(pieces.at(2), function)(mean, cov), getattr(whole.at(2), function)(mean, cov), strict=True
            ):
                np.testing.assert_allclose(one, np.broadcast_to(other, one.shape), rtol=1e-13, atol=1e-15)


def test_a_model_with_formulas_keeps_them(variant53):
    structures = Structures(variant53)
    assert structures.quadrature is None and structures.normal is structures.gaussian


def test_who_chooses_a_filter_is_told():
    for one in admissions(CUBIC, [name for name in FILTERS if name.endswith("-gaussian")]):
        assert one.verdict == "yes" and f"Gauss-Hermite quadrature, {checked(CUBIC).order} points an axis" in one.says
    assert [one.name for one in lab_filters(CUBIC)] == list(LAB)


def test_the_lab_says_so_in_its_reports(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text('[variants.c]\nstate = "x/(1 + x**2) + v"\nmeter = "x**3 + x + w"\n', encoding="utf-8")
    call = ["lab", "c", "--variants", "mine.toml", "--runs", "300", "--steps", "4", "--slow-runs", "0", "--designs", "1"]
    result = CliRunner().invoke(main, [*call, "--report", "ru", "--out", "r", "--json", "r.json"])
    assert result.exit_code == 0, result.output
    assert "Gaussian filters: no closed form: means over normal laws by Gauss-Hermite quadrature" in result.output
    numbers = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert not numbers["left_out"] and {"aof-gaussian", "fos-gaussian", "mfos-gaussian"} <= set(numbers["error_variance"])
    page, handin = ((tmp_path / "r" / f"{name}.html").read_text(encoding="utf-8") for name in ("report", "handin"))
    assert "points an axis" in page and "No&#x000A0;closed&#x000A0;form:&#x000A0;by&#x000A0;quadrature" in page
    assert "узлов по каждой оси" in handin and "экспонент" not in handin
