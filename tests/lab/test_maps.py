"""The map over two parameters: each cell is its own comparison, and says what that says."""

import pytest

from kfcourse import load_variants
from kfcourse.lab.maps import parameter_map


@pytest.fixture(scope="module")
def found():
    model = load_variants()["53"].model
    return parameter_map(model, {"e": (0.02, 0.05), "f": (0.02, 0.05)}, design_runs=5000, runs=300)


def test_each_cell_has_its_parameters(found):
    assert [*found] == [(0.02, 0.02), (0.02, 0.05), (0.05, 0.02), (0.05, 0.05)]
    for (e, f), result in found.items():
        assert float(result.model.parameters["e"]) == e
        assert float(result.model.parameters["f"]) == f
        assert result.runs == 300


def test_leaders_are_those_not_significantly_worse_than_the_best(found):
    result = found[0.05, 0.02]
    several = 0
    for k in range(result.steps):
        best, *others = result.leaders(k)
        assert result.gap(best).value[k] == min(
            result.gap(name).value[k] for name in result.entrants
        )
        several += bool(others)
        for name in set(result.entrants) - {best}:
            low, _ = result.gap_difference(name, best)[k].interval(0.95)
            assert (low <= 0) == (name in others)
        assert set(result.leaders(k, 0.5)) <= set(result.leaders(k, 0.999))
    assert several


def test_where_the_meter_is_poor_and_the_object_quiet_the_duof_leads(found):
    """The lab's conclusion is turned round; by how much: the GAOF is 100 % above the bound, the
    DUOF 10 %."""
    assert found[0.02, 0.05].leaders(2) == ["duof"]
    assert "duof" not in found[0.05, 0.02].leaders(2)[:1]
