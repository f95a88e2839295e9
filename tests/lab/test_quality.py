"""Quality of variants: each criterion against a reference of its own, bad variants refused for the
intended reason, proposals."""

import re
import tomllib
from collections import Counter
from functools import partial
from itertools import product

import numpy as np
import pytest
from weekly import weekly

from kfcourse import Comparison, Model, load_variants
from kfcourse.exercises.checks.posing import unposed
from kfcourse.lab import Structures, grammar, quality, read_variant
from kfcourse.lab.grammar import PIECES, generate, propose
from kfcourse.lab.quality import (
    Finding,
    Quality,
    bounded,
    examine,
    examine_all,
    not_diverging,
    solvable,
    table,
)
from kfcourse.lab.variants import STEPS
from kfcourse.montecarlo import BATCHES, FEWEST

SHIPPED = load_variants()


def variant(state, meter, parameters=None, **options):
    return read_variant(
        "t", {"state": state, "meter": meter, "parameters": parameters or {}} | options, "the test"
    )


# --- the shipped variants


@pytest.mark.parametrize("name", weekly([(name,) for name in SHIPPED]))
def test_a_shipped_variant_is_well_posed(name):
    """In variant 12 the filters differ by a thousandth only, in 8 by half a per cent, in 53 by a few
    tails: that takes more trajectories to see; and a vector gets an eighth."""
    more = {"8": 20_000, "12": 20_000, "53": 20_000, "20": 8_000, "21": 8_000}
    quality_ = examine(SHIPPED[name], more.get(name, 4_000))
    assert quality_.well_posed, quality_.faults
    assert quality_.linear == (name == "1")
    assert quality_.findings["filters differ"].ok == (name != "1")
    assert 0 < quality_.findings["observable"].value < 0.5
    assert ("decays to a constant" in quality_.remarks) == (name == "53")
    assert ("linear: the Kalman filter is exact" in quality_.remarks) == (name == "1")


def test_the_result_does_not_depend_on_the_number_of_processes():
    chosen = [SHIPPED["53"], SHIPPED["1"]]
    first, two = (list(examine_all(chosen, 512, 3, jobs)) for jobs in (1, 2))
    assert [quality_.name for quality_ in first] == ["53", "1"]
    assert first == two
    assert first[0].findings["bounded"] != examine(chosen[0], 512, 4).findings["bounded"]


# --- bad variants, each refused for its own reason

SAME = "no two filters differ"
BAD = {
    "exploding": (dict(state="1.2*x + v", meter="x + w"), {"bounded": r"grows 9\.\de\+03 times"}),
    "slowly exploding": (
        dict(state="1.06*x + 0.1*v", meter="x + 0.1*x**2 + w"),
        {"bounded": r"grows \d\d\.\d times"},
    ),
    "infinite": (
        dict(state="2*x**3 + v", meter="x + w"),
        {"bounded": "trajectories become infinite"},
    ),
    "rarely infinite": (
        dict(state="0.9*x + 0.05*x**3 + 0.1*v", meter="x + 0.3*w", prior={"variance": 0.09}),
        {"bounded": "infinite when deviations are 1.5 times larger"},
    ),
    "heavy tails": (
        dict(state="0.9*x + 0.9*x*v", meter="x + 0.3*w"),
        {"bounded": "too heavy tails"},
    ),
    "noise only": (
        dict(state="0.9*x + v", meter="x*w"),
        {"observable": "hardly tells", "filters differ": SAME},
    ),
    "far too noisy": (
        dict(state="0.9*x + 0.2*sin(x) + v", meter="x + 20*w"),
        {"observable": r"leaves 9\d(\.\d)? % .* of x$"},
    ),
    "symmetric": (
        dict(state="0.9*x + 0.3*v", meter="x**2 + 0.3*w"),
        {"observable": "hardly tells"},
    ),
    "a component not seen": (
        dict(state=["0.9*x1 + 0.3*v1", "0.8*x2 + 0.3*v2"], meter=["x1 + 0.3*(1 + x1**2)*w1"]),
        {"observable": "of the variance of x2$", "filters differ": SAME},
    ),
    "a constant component": (
        dict(
            state=["0.9*x1 + x2*v1", "x2"],
            meter=["x1 + x2 + 0.3*w1"],
            prior={"mean": [1, 1], "variance": [1, 0]},
        ),
        {"observable": "x2 does not vary", "filters differ": SAME},
    ),
    "a perfect meter": (dict(state="sin(x) + 0.3*v", meter="x"), {"filters differ": SAME}),
    "almost linear": (
        dict(state="0.9*x + 0.3*v", meter="x + 0.001*x**2 + 0.5*w"),
        {"filters differ": SAME},
    ),
    "not differentiable": (
        dict(state="0.9*x + 0.3*v", meter="abs(x) + x + 0.3*w"),
        {"solvable": r"term Abs\(x\)"},
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_variant_is_refused_for_its_reason(case):
    body, reasons = BAD[case]
    quality_ = examine(variant(**body), 2048)
    assert not quality_.well_posed
    assert set(quality_.faults) == set(reasons)
    for criterion, reason in reasons.items():
        assert re.search(reason, quality_.faults[criterion])
    if "bounded" in reasons:
        assert "observable" not in quality_.findings
        assert "filters differ" not in quality_.findings


def test_long_formulas_are_refused():
    for power, says in ((9, "557 operations"), (10, "693 operations")):
        model = Model.define("0.9*x + v", f"(1 + x)**{power} + w")
        quality_ = solvable(Structures(model))
        assert says in quality_.says and quality_.ok == ("more than 600" not in quality_.says)
        assert quality_.ok == (power == 9)


def test_a_filter_diverges_at_ten_times_the_variance_of_the_state():
    x = np.random.default_rng(1).normal(size=(1, BATCHES, 1))
    for times, diverges in ((8, False), (12, True)):
        sums = {"weight": np.ones(BATCHES), "square": np.full((1, 1, 1, BATCHES), times * x.var())}
        result = Comparison(SHIPPED["53"].model, ("duof",), BATCHES, 1, 1, sums)
        assert bool(not_diverging(result, x)) == diverges


def test_a_derivation_without_end_is_given_up(monkeypatch):
    monkeypatch.setattr(quality, "SECONDS", 1e-3)
    quality_ = examine(SHIPPED["21"], FEWEST, ask=unposed)
    assert list(quality_.faults) == ["solvable"]
    assert "not found in 0.001 s" in quality_.faults["solvable"]
    assert "bounded" not in quality_.findings


def test_a_variant_whose_questions_cannot_be_posed_is_named_with_the_question():
    """What `unposed` says of models that the exercises cannot ask about: test_variants."""
    late = Finding(False, "question c3 of the exercises cannot be posed (no steps)")
    assert examine(SHIPPED["2"], FEWEST, ask=lambda _: late).faults["solvable"] == late.says
    assert unposed(SHIPPED["2"]) is None


# --- bounded


def test_growth_is_that_of_the_second_moment():
    signs = np.random.default_rng(1).choice([-1.0, 1.0], (51, 400, 1))
    for growth in (8.0, 12.0):
        # maxima at the steps 50 and 25
        x = growth ** (np.arange(51)[:, None, None] / 50) * signs
        assert bounded(x).value == pytest.approx(growth, rel=1e-12)
        assert bounded(x).ok == (growth < 10)
    assert bounded(x[::-1]).ok
    assert bounded(x[:1]).ok  # one step does not grow
    # the worst component
    assert bounded(np.concatenate([x[::-1], x], axis=2)).value == pytest.approx(12, rel=1e-12)


def test_a_moment_of_a_few_trajectories_is_refused():
    x = np.zeros((4, 1000, 1))
    x[:, :9] = 1.0  # (sum u^2)^2 / sum u^4 is nearly their number
    x[:, 0] = -1.0
    assert not bounded(x).ok
    x[:, :12] = 1.0
    assert bounded(x).ok


# --- observable


def riccati(steps):
    """Error variance of the Kalman filter of variant 1 over the state's variance, mean over the
    steps."""
    c, e, g, f = 0.9, 0.3, 1.0, 0.5
    free = prior = 1.0
    ratios = []
    for _ in range(steps):
        posterior = prior * f**2 / (g**2 * prior + f**2)
        ratios.append(posterior / free)
        free, prior = c**2 * free + e**2, c**2 * posterior + e**2
    return sum(ratios) / steps


def test_the_share_of_a_linear_variant_is_that_of_the_riccati_equation():
    """The variances over which it is taken are those of a sample: with 10,000 trajectories good to
    1.4 % at a step, and at some ten independent steps."""
    share = examine(SHIPPED["1"], 10_000).findings["observable"].value
    assert share == pytest.approx(riccati(STEPS), rel=4 * np.sqrt(2 / 10_000 / 10))


# --- the table

GOOD = {
    "bounded": Finding(True, "", 1.0),
    "observable": Finding(True, "", 0.1234),
    "filters differ": Finding(True, "", 0.05),
    "solvable": Finding(True, "", 10.0),
}


def test_the_table_tells_everything():
    same = {"filters differ": Finding(False, "same", 0.0)}
    bad = GOOD | {"observable": Finding(False, "blind", 0.97)} | same
    lost = {"bounded": Finding(False, "explodes", 1e9), "solvable": GOOD["solvable"]}
    lines = table(
        [
            Quality("bad", bad),
            Quality("lin", GOOD | same, True, ("linear",)),
            Quality("lost", lost, remarks=("one", "two")),
        ]
    ).splitlines()
    assert [line.split() for line in lines[:4]] == [
        ["variant", "bounded", "observable", "filters", "differ", "solvable", "remarks"],
        ["bad", "yes", "NO", "97", "%", "NO", "yes"],
        ["lin", "yes", "yes", "12.3", "%", "equal", "yes", "linear"],
        ["lost", "NO", "-", "-", "yes", "one;", "two"],
    ]
    assert lines[-3:] == [
        "variant bad is not well posed, observable: blind",
        "variant bad is not well posed, filters differ: same",
        "variant lost is not well posed, bounded: explodes",
    ]


# --- proposals


def test_every_candidate_is_a_model_with_numbers_to_type():
    shapes = set()
    for index in range(60):
        proposed = propose(5, index)
        model = read_variant("t", proposed, "the test").model
        assert all(float(f"{value:.2g}") == value for value in proposed["parameters"].values())
        assert (
            set(proposed["parameters"])
            == {s.name for s in model.values}
            <= {
                s.name
                for s in model.state_equation.free_symbols | model.meter_equation.free_symbols
            }
        )
        shapes.add(str([proposed["state"], proposed["meter"]]))
    assert len(shapes) > 40
    assert any("x2" in shape for shape in shapes)
    assert propose(5, 3) == propose(5, 3) != propose(6, 3)


def test_no_two_pieces_of_an_equation_share_a_parameter():
    for kinds in (("drift", "object_noise", "signal", "meter_noise"), ("force", "vector_meters")):
        for pieces in product(*(PIECES[kind] for kind in kinds)):
            names = [name for _, _, ranges, _ in pieces for name in ranges]
            assert len(set(names)) == len(names)


@pytest.fixture(scope="module")
def generated():
    return generate(1, seed=5, runs=512, jobs=1)


def test_what_is_generated_is_read_back(generated, tmp_path):
    path = tmp_path / "new.toml"
    path.write_text(generated.toml(), encoding="utf-8")
    (read,), (before,) = load_variants(path).values(), generated.variants
    assert (read.name, read.model, read.title) == ("g1", before.model, before.title)
    assert read.model.prior.cov.tolist() == before.model.prior.cov.tolist()


@pytest.mark.slow
def test_the_same_seed_generates_the_same_text_whatever_the_processes(generated):
    again = generate(1, seed=5, runs=512, jobs=2)
    assert again.toml() == generated.toml()
    assert again.rejected == generated.rejected


def test_candidates_are_rejected_for_each_reason_and_formulas_are_seldom_repeated(monkeypatch):
    """Candidates x' = c x + i v with c = 0, 1, ..., i = c // 2, of which the first four have a
    fault and the fifth is linear, without any simulation."""

    def judge(candidate, *_):
        c = int(candidate["parameters"]["c"])
        fault = {name: Finding(False, "") for name in [*GOOD][c : c + 1]}
        return Quality("", GOOD | fault, linear=c == len(GOOD))

    def proposed(c):
        return {"state": f"c*x + {c // 2}*v", "meter": "x + w", "parameters": {"c": float(c)}}

    monkeypatch.setattr(grammar, "_judge", judge)
    monkeypatch.setattr(grammar, "propose", lambda _, index: proposed(index))
    few = generate(3, jobs=1)
    others = "formulas of another one"
    assert few.rejected == Counter({name: 1 for name in GOOD} | {"linear": 1, others: 1})
    assert [float(each.model.parameters["c"]) for each in few.variants] == [5, 6, 8]
    assert [each.name for each in few.variants] == ["g1", "g2", "g3"]
    monkeypatch.setattr(grammar, "propose", lambda *_: proposed(9))  # a search without end
    outcome = generate(4, jobs=1)
    assert len(outcome.variants) == 1 and outcome.rejected == {others: 4 * 20 - 1}
    assert len(generate(150, jobs=1).variants) == 4


# --- the command line


@pytest.fixture
def call(command):
    return partial(command, "variants")


def test_check_says_by_its_status_whether_all_are_well_posed(call, tmp_path):
    result = call("--check --variant 1 --runs 512 --jobs 1")
    assert result.exit_code == 0, result.output
    assert "equal" in result.stdout and "not well posed" not in result.output
    (tmp_path / "mine.toml").write_text(
        '[variants.boom]\nstate = "1.2*x + v"\nmeter = "x**2 + x + w"\n', encoding="utf-8"
    )
    result = call("--check --variants mine.toml --runs 256 --jobs 1")
    assert result.exit_code == 1
    assert "variant boom is not well posed, bounded: the second moment grows" in result.stdout


def test_proposals_are_printed_or_go_to_a_new_file(call, tmp_path, monkeypatch):
    def made(wanted, seed, *_):
        proposals = [
            read_variant(f"g{i + 1}", propose(seed, i), "the test") for i in range(min(wanted, 2))
        ]
        return grammar.Generated(proposals, Counter({"bounded": 3, "linear": 1}))

    monkeypatch.setattr(grammar, "generate", made)
    result = call("--generate 2 --seed 9")
    assert result.exit_code == 0
    assert list(tomllib.loads(result.stdout)["variants"]) == ["g1", "g2"]
    made_by = "# Made by: kfcourse variants --generate 2 --seed 9 --runs 40000\n"
    assert result.stdout.startswith(made_by)
    assert result.stderr == "Candidates rejected: 3 bounded, 1 linear\n"
    result = call("--generate 3 --out new.toml")  # too few are written, and it is said
    assert (result.exit_code, result.stdout) == (1, "")
    assert "only 2 of 3 variants found" in result.stderr
    assert list(load_variants(tmp_path / "new.toml")) == ["g1", "g2"]
    assert [path.name for path in tmp_path.iterdir()] == ["new.toml"]


@pytest.mark.parametrize(
    "out", ["old.toml", ".", "no/such/folder/new.toml", "old.toml/new.toml", "dangling"]
)
def test_a_bad_out_is_refused_before_the_computation(call, tmp_path, monkeypatch, out):
    monkeypatch.setattr(grammar, "generate", lambda *_: pytest.fail("the computation began"))
    (tmp_path / "old.toml").write_text("precious", encoding="utf-8")
    (tmp_path / "dangling").symlink_to("nowhere")
    result = call("--generate 1 --out", out)
    assert result.exit_code == 1
    assert f"cannot go to {out}" in result.stderr
    assert (tmp_path / "old.toml").read_text(encoding="utf-8") == "precious"


@pytest.mark.parametrize(
    "arguments",
    [
        "--generate 201",
        "--generate 1 --check",
        "--generate 1 --variant 53",
        "--generate 1 --variants mine.toml",
        "--check --out new.toml",
        "--out new.toml",
    ],
)
def test_impossible_options_are_usage_errors(call, monkeypatch, arguments):
    for module, name in ((grammar, "generate"), (quality, "examine_all")):
        monkeypatch.setattr(module, name, lambda *_: pytest.fail("the computation began"))
    result = call(arguments)
    assert result.exit_code == 2
    assert "Traceback" not in result.output
