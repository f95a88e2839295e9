"""The lab's variants and filters by name; hostile ones are refused.  That the shipped ones are well
posed: test_quality."""

import tomllib

import pytest

from kfcourse import Model, ModelError, NoClosedForm, gaussian, lab_filters, load_variants
from kfcourse.exercises.checks import ExerciseError, exercise
from kfcourse.exercises.checks.posing import unposed
from kfcourse.filters import Design, Filter
from kfcourse.lab import FILTERS, LAB, VariantError, find_variant, has_exact, title
from kfcourse.lab import variants as of_variants
from kfcourse.lab.variants import VariantWarning, read_variants

SHIPPED = load_variants()
GOOD = 'state = "0.9*x + v"\nmeter = "x + w"\n'


# --- the shipped variants


def test_the_shipped_variants():
    """Names, titles and structural functions of their own; scalar ones have the exact filter."""
    assert len(SHIPPED) >= 12
    assert str(SHIPPED["53"].model.state_equation[0]) == "c*x + e*v*x" and SHIPPED["53"].steps == 51
    assert all(variant.name == name for name, variant in SHIPPED.items())
    titles = {variant.title for variant in SHIPPED.values()}
    printed = {gaussian(variant.model).latex() for variant in SHIPPED.values()}
    assert "" not in titles and len(titles) == len(printed) == len(SHIPPED)
    for variant in SHIPPED.values():
        assert [each.name for each in lab_filters(variant.model)] == list(LAB)
        assert has_exact(variant.model) == (variant.model.n == 1)


# --- the filters by their short names


def test_every_filter_builds_and_carries_its_short_name():
    built = lab_filters(SHIPPED["53"].model, [*FILTERS, "duof"])
    assert [each.name for each in built] == list(FILTERS)  # and what is asked for twice, once
    assert all(isinstance(each, Filter | Design) for each in built)


def test_titles_are_distinct():
    assert len({title(name) for name in FILTERS}) == len(FILTERS)
    assert len({entry.russian for entry in FILTERS.values()}) == len(FILTERS)
    assert title("mine") == "mine"


def test_a_filter_that_a_model_does_not_admit_is_named_with_advice(tmp_path):
    path = tmp_path / "v.toml"
    path.write_text('[variants.t]\nstate = "0.9*x + v"\nmeter = "tan(x) + w"\n', encoding="utf-8")
    model = load_variants(path)["t"].model
    with pytest.raises(NoClosedForm, match=r"^fos-gaussian: .*tan\(x\).*unscented"):
        lab_filters(model, ["duof", "fos-gaussian"])
    with pytest.raises(ModelError, match=r"^aof-exact: .*noise enters nonlinearly"):
        lab_filters(Model.define("0.9*x + v", "x + w**2"), ["aof-exact"])
    (bound,) = lab_filters(SHIPPED["20"].model, ["aof-exact"])
    assert bound.name == "aof-exact" and bound.init(1).memory.effective == 1000  # particles
    assert (
        len(lab_filters(model, ["aof-linearised", "aof-unscented", "aof-gauss-hermite", "duof"]))
        == 4
    )


# --- files of variants


BAD_VARIANTS = {  # more that a model refuses: test_model, test_formula
    "no state": ('meter = "x + w"', "no state"),
    "unknown key": (GOOD + "speed = 1", "unknown key speed"),
    "bad formula": ('state = "x +* v"\nmeter = "x + w"', "cannot be read"),
    "no noise": ('state = "0.9*x"\nmeter = "x"', "no noise enters the state equation"),
    "a state known exactly": (
        GOOD + "prior = { variance = 0 }\nstate_noise = { variance = 0 }",
        "known exactly",
    ),
    "a number in quotes": (GOOD + 'prior = { mean = "1e5" }', "got mean = '1e5'"),
    "inputs in quotes": (
        GOOD.replace("x + w", "x + u + w") + 'inputs = { u = ["1", "2"] }',
        "the input u must be a list",
    ),
    "no inputs": (GOOD.replace("x + w", "x + u + w") + "inputs = 3", "`inputs` must be a table"),
    "angles 3": (GOOD + "angles = 3", "`angles` is a list of names of components"),
    "ten thousand hexadecimal digits": (
        GOOD + f"parameters = {{ c = 0x{'f' * 10_000} }}",
        "numbers of thousands of digits",
    ),
}


@pytest.mark.parametrize("case", BAD_VARIANTS)
def test_a_bad_variant_is_refused_by_file_and_name(tmp_path, case):
    body, problem = BAD_VARIANTS[case]
    path = tmp_path / "mine.toml"
    path.write_text(f"[variants.good]\n{GOOD}\n[variants.bad]\n{body}\n", encoding="utf-8")
    with pytest.raises(VariantError) as caught:
        find_variant("bad", path)
    message = str(caught.value)
    assert message.startswith(f"variant bad in {path}: ")
    assert problem in message
    # no matter what else is in the file
    assert find_variant("good", path).model == Model.define("0.9*x + v", "x + w")
    with pytest.warns(VariantWarning, match=r"^variant bad in") as warned:
        assert list(load_variants(path)) == ["good"]
    assert [str(each.message) for each in warned] == [message]


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("", "no variants"),
        ("variants = 3", "no variants"),
        ("[variant.53]\n" + GOOD, "no variants"),
        ("[variants.a]\nstate = c*x + v", "column 9); formulas and other texts stand in quotes"),
        (
            "[variants.a]\n" + GOOD + "parameters = { c = .9 }",
            "column 20); formulas and other texts stand in quotes, and a number has a digit "
            "before its point",
        ),
        ("[variants.a]\n" + GOOD + "[variants.a]\n" + GOOD, "not valid TOML"),
        ("[variants.a]\n" + GOOD + f"prior = {{ mean = {'9' * 10_000} }}", "is not valid TOML"),
        (
            "[variants.a]\n" + GOOD + f"prior = {{ mean = {'[' * 5000}{']' * 5000} }}",
            "is not valid TOML",
        ),
        ("[variants]\nbad = 5", "variant bad in"),
        (b"\xff\xfe", "line 1: a byte that is not UTF-8"),
    ],
)
def test_a_bad_file_is_refused_by_name(tmp_path, content, problem):
    path = tmp_path / "mine.toml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(VariantError) as caught:
        load_variants(path)
    assert str(path) in str(caught.value)
    assert problem in str(caught.value)


def test_only_the_variants_asked_for_are_built(tmp_path, monkeypatch):
    path, built = tmp_path / "many.toml", []
    text = "".join(f"[variants.{i}]\n{GOOD}" for i in range(5000))
    path.write_text(text, encoding="utf-8-sig")  # an editor's byte order mark is no part of it
    whole = of_variants.read_variant
    monkeypatch.setattr(
        of_variants, "read_variant", lambda name, *rest: built.append(name) or whole(name, *rest)
    )
    assert find_variant("4711", path).name == "4711" and built == ["4711"]
    with pytest.raises(
        VariantError, match=r"no variant 'x'; there are 0, 1, .*39, \.\.\. \(5000 in all\)$"
    ):
        find_variant("x", path)


def test_models_that_all_jump_are_no_empty_list(tmp_path):
    path = tmp_path / "mine.toml"
    modes = "[variants.a.modes.one.parameters]\nC = 1\n[variants.a.modes.two.parameters]\nC = 2\n"
    path.write_text(
        '[variants.a]\nstate = "0.9*x + v"\nmeter = "x + C*w"\ntransition = [0.5, 0.5]\n' + modes,
        encoding="utf-8",
    )
    with pytest.raises(
        VariantError,
        match=r"has no other variants than those that jump .*`read_variants` reads them",
    ):
        load_variants(path)
    assert [*read_variants(path)[0]] == ["a"]


def test_time_inputs_and_angles_are_read_and_the_exercises_say_what_they_cannot_ask_about(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        '[variants.drive]\nstate = "0.9*x + u + 0.3*v + (1 if t < 1 else 0)"\nmeter = "x + w"\n'
        'inputs = { u = [0, 1, -1] }\ninterval = 0.5\nmeter_noise = { variance = "1 + k/10" '
        '}\nangles = ["y"]\n',
        encoding="utf-8",
    )
    model = find_variant("drive", path).model
    assert model.known.inputs == {"u": (0.0, 1.0, -1.0)} and model.known.at(2).tolist() == [
        2.0,
        1.0,
        -1.0,
    ]
    assert model.angles.y == (0,)
    finding = unposed(find_variant("drive", path))
    assert finding is not None and finding.ok is False
    assert "an input of variant drive ends after 3" in finding.says
    table = tomllib.loads(path.read_text(encoding="utf-8"))["variants"]["drive"]
    with pytest.raises(
        ExerciseError, match=r"a model without angles in the measurement.*take another variant"
    ):
        exercise("b", table)
    del table["angles"]
    with pytest.raises(
        ExerciseError, match=r"an input of variant own ends after 3.*a value for every step"
    ):
        exercise("b", table)
    table["inputs"] = {"u": [0.0, 1.0, -1.0] * 7}
    assert exercise("b", table).model.known.steps == 21
