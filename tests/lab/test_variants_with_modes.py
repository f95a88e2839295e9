"""Variants with modes on the command line: listed, checked, compared, and refused where nothing
knows modes."""

import json
import re
import tomllib
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from kfcourse import JumpModel, NotFinite, compare, load_variants, simulate
from kfcourse.exercises.notebooks import handing_out
from kfcourse.exercises.notebooks.jobs import Outcome
from kfcourse.filters import imm, logic_dynamic, pointmass
from kfcourse.lab import Structures, VariantError, find_variant, title
from kfcourse.lab.admission import admissions
from kfcourse.lab.short_names import JUMP_LAB, judging
from kfcourse.lab.variants import read_variants, summary
from kfcourse.montecarlo.modes import recognised

JUMPS = {
    name: each for name, each in read_variants()[0].items() if isinstance(each.model, JumpModel)
}
OWN = """
[variants.mine]
state = "0.9*x + v"
meter = "x + C*w"
modes = { sound = { parameters = { C = 1 } }, faulty = { parameters = { C = 5 } } }
transition = [[0.9, 0.1], [0.4, 0.6]]
first = [1, 0]

[variants.plain]
state = "0.9*x + v"
meter = "x + w"
"""


@pytest.fixture
def own(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(OWN)
    return path


def test_they_are_none_of_the_variants_that_the_exercises_ask_about(own):
    assert len(JUMPS) == 7  # and none of the exercises': test_tasks
    assert isinstance(find_variant("mine", own).model, JumpModel)
    assert list(load_variants(own)) == ["plain"]


@pytest.mark.parametrize("name", JUMPS)
def test_each_has_its_filters(name):
    outcome = {each.name: each for each in admissions(JUMPS[name].model)}
    if name in ("J3", "J4"):
        assert "no noise enters the object" in str(outcome["aof-exact"].reason)
    else:
        assert outcome["aof-exact"].built is not None
        assert (JUMPS[name].model.n == 1) or "by particles" in outcome["aof-exact"].says
    assert all(outcome[each].built for each in ("aof-jump-linearised", "imm", "gpb2"))
    for each in ("aof-averaged", "duof", "fos-averaged", "mfos-averaged", "fos-jump-gaussian"):
        reason = str(outcome[each].reason)
        assert (
            outcome[each].built or "closed" in reason or "nobody knows the probabilities" in reason
        )
        assert (outcome["duof"].built is None) == JUMPS[name].model.by_state


def test_the_lab_compares_filters_and_tells_the_share_of_right_modes(
    command, no_figures, tmp_path, own
):
    few = "--runs 2000 --steps 6 --out r --json n.json"
    result = command("lab mine --variants mine.toml", few)
    assert result.exit_code == 0, result.output
    for name in JUMP_LAB:
        assert title(name) in result.output
    assert "D_k above that of exact AOF" in result.output
    for name in ("report.html", "report.tex"):
        text = (tmp_path / "r" / name).read_text()
        assert "sound" in text and "faulty" in text
    assert (tmp_path / "r" / "modes.svg").is_file()
    numbers = json.loads((tmp_path / "n.json").read_text())
    assert list(numbers["model"]["modes"]) == ["sound", "faulty"] and numbers["model"]["first"] == [
        1,
        0,
    ]
    gaps = {name: gap["value"] for name, gap in numbers["mean_above_bound"].items()}
    assert gaps["gpb2"] < gaps["aof-jump-gaussian"] < gaps["aof-averaged"]


def test_listed_and_checked(command, own):
    listed = command("variants --variant J1").output
    assert listed.count("x' = ") == 1 and "        sound: C = 1\n        faulty: C = 10\n" in listed
    modes = {"sound": {}, "cubic": {"meter": "x**3 +\n C*w", "parameters": {"C": 2}}}
    table = {"state": "x + v", "meter": ["x + C*w"], "parameters": {"C": 1, "T": 1}, "modes": modes}
    assert summary("two", table).split("\n") == [
        "   two  no title",
        "        x' = x + v;  y = x + C*w",
        "        sound: as above",
        "        cubic: meter = x**3 + C*w;  C = 2",
    ]
    checked = command("variants --variants mine.toml --variant mine --check --runs 256")
    assert (
        checked.exit_code == 0
        and "has 2 modes: only whether it is bounded is checked" in checked.output
    )


def test_filters_are_told_for_modes(command):
    printed = command("filters J1").output
    assert "LD-GAOF" in printed and "GPB2" in printed and "particle" not in printed
    assert "LD-GFKP4" in printed and "LD-LFBP4" in printed
    assert title("fbp2-jump-linearised") == "LD-LFBP2"
    wrong = command("lab J1 --filters aof-gaussian")
    assert (
        wrong.exit_code == 1
        and "unknown filter 'aof-gaussian'; known: aof-jump-gaussian" in wrong.output
    )


def test_where_nothing_knows_modes_it_is_said(command, tmp_path, own):
    (tmp_path / "y.csv").write_text("y\n1\n2\n")
    for arguments in (
        "exercises --sets a --jobs 1 --variant J1 --out e",
        "estimate y.csv --model mine.toml --variant mine",
    ):
        result = command(arguments)
        assert result.exit_code != 0 and "jumps between modes" in result.output, (
            arguments,
            result.output,
        )
        assert "Traceback" not in result.output
    with pytest.raises(
        VariantError, match=r"jumps between modes.*`kfcourse lab J1`.*--variants FILE"
    ):
        find_variant("J1").plain("the exercises")


def test_nobody_gets_a_variant_with_modes_and_it_is_said(command, tmp_path, own, monkeypatch):
    monkeypatch.setattr(
        handing_out, "run_all", lambda work, *_: [Outcome(job, "written") for job in work]
    )
    (tmp_path / "list.csv").write_text("name,group\nA,1\nB,1\n")
    call = partial(command, "exercises --variants mine.toml --sets a --out e")
    for whom in ("--all", "--students list.csv"):
        result = call(whom)
        assert result.exit_code == 0 and re.search(
            "Left out, since they jump between modes.*: mine\n", result.output
        )
    assert "mine" not in (tmp_path / "e" / "assignment.csv").read_text()
    named = call("--variant plain")
    assert named.exit_code == 0 and "Left out" not in named.output
    several = call("--variant mine")
    assert several.exit_code == 1 and several.output.count("jumps between modes") == 1
    own.write_text(OWN.partition("[variants.plain]")[0])
    for whom in ("--all", "--students list.csv"):
        result = call(whom)
        assert (
            result.exit_code == 1
            and "no other variants than those that jump between modes" in result.output
        )


def test_the_share_of_right_modes_is_that_of_the_trajectories():
    model = JUMPS["J1-lasting"].model
    filter_ = logic_dynamic(Structures(model).gaussian, model.transition_at, model.first)
    outcome = recognised([filter_, pointmass(model)], model, 160, 8, 4)
    _, y, mode = simulate(model, 160, 8, 4)
    state, right = filter_.init(160), []
    for k in range(8):
        state = filter_.step(state, y[k])
        right.append((state.memory.probability[:, 1] > 0.5) == (mode[k] == 1))
    assert outcome.share[filter_.name].value == pytest.approx(np.mean(right), abs=1e-12)
    assert outcome.guess == pytest.approx((mode == 0).mean(), abs=1e-12)
    shown = next(k for k in range(160) if 0 < mode[:, k].mean() < 1)  # the first with both modes
    assert_array_equal(outcome.mode, mode[:, shown])
    assert outcome.probability[filter_.name].shape == (8, 2)
    assert [*outcome.share] == [filter_.name, "aof-exact"]


@pytest.mark.slow
@pytest.mark.parametrize("name", [*load_variants(), *JUMPS])
def test_the_lab_takes_every_variant_that_is_shipped(name, command, tmp_path):
    result = command("lab", name, "--runs 40 --steps 4 --jobs 1 --scores --out report")
    assert result.exit_code == 0, result.output
    assert "exact AOF left out" not in result.output
    assert (tmp_path / "report" / "report.html").exists()


def test_predictions_are_judged_where_transitions_depend_on_the_state():
    model = JUMPS["J1-overload"].model
    filter_ = imm(Structures(model).gaussian, model)
    result = compare([filter_], model, 20, 3, 1, scores=judging(model))
    assert np.isfinite(result.log_score(filter_.name).value).all()


def test_a_filter_that_cannot_go_on_has_no_share():
    model = JUMPS["J1-lasting"].model
    steady = imm(Structures(model).gaussian, model.transition_at, model.first)

    def step(state, y):
        if state.step == 3:
            raise NotFinite("step 3")
        return steady.step(state, y)

    stopped = replace(steady, name="stopped", step=step)
    assert [*recognised([stopped, steady], model, 20, 5, 1).share] == [steady.name]


def test_the_chapter_shows_the_shipped_table():
    page = (Path(__file__).parents[2] / "book" / "beyond/models-that-jump.md").read_text(
        encoding="utf-8"
    )
    (block,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    (name, shown), *_ = tomllib.loads(block)["variants"].items()
    assert shown == {key: value for key, value in JUMPS[name].table.items() if key != "title"}
