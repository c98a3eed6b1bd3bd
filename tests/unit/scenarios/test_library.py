"""Ready-made scenarios: the paper's three junctions and any other."""

from __future__ import annotations

import pytest

import scenarios
from minisim.errors import InputError
from scenarios.library import (
    five_way,
    four_way,
    from_bearings,
    regular,
    scenario_named,
    three_way,
)
from scenarios.scenario import FAIR


@pytest.mark.parametrize(
    ("maker", "n", "approach"),
    [(three_way, 3, 495.84), (four_way, 4, 492.80), (five_way, 5, 491.6)],
)
def test_the_papers_junctions_have_the_lanes_of_the_authors_networks(
    maker: object, n: int, approach: float
) -> None:
    scenario = maker()  # type: ignore[operator]
    assert scenario.intersection.n == n
    assert scenario.intersection.approach_length == pytest.approx(approach, abs=0.005)
    assert scenario.intersection.arm_length == 500.0
    assert scenario.intersection.side == "left"
    assert (scenario.density, scenario.horizon) == (pytest.approx(350.0), 3600.0)
    assert scenario.profile.name == "paper"


def test_all_are_from_bearings_with_given_bearings() -> None:
    assert four_way(200, side="right") == from_bearings(
        (0, 90, 180, 270), 200, name="four-way", side="right"
    )
    assert regular(4).intersection == four_way().intersection
    assert regular(6).name == "6-way"


def test_demand_and_profile_go_through() -> None:
    scenario = three_way(
        100, split=[2, 1, 1], turns=[3, 1], model="shifted", min_headway=2.0, profile="fair"
    )
    assert scenario.demand.split == (2.0, 1.0, 1.0)
    assert scenario.demand.turns == (3.0, 1.0)
    assert (scenario.demand.model, scenario.demand.min_headway) == ("shifted", 2.0)
    assert scenario.profile is FAIR


def test_scenarios_have_the_names_of_the_command_line() -> None:
    assert scenario_named("four-way", density=100) == four_way(100)
    assert scenario_named("five-way") == five_way()
    assert scenario_named("7-way") == regular(7)
    custom = scenario_named("custom", bearings=(0, 80, 190, 260))
    assert custom.intersection.bearings == (0.0, 80.0, 190.0, 260.0)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("four_way", "unknown scenario 'four_way'.*did you mean 'four-way'"),
        ("4way", r"N-way \(such as 6-way\), custom; did you mean '4-way'"),
        ("3way", "did you mean '3-way'"),
        ("4-ways", "did you mean '4-way'"),
        ("junction", r"custom$"),
        ("9" * 5000, "unknown scenario"),
        ("2-way", "number of arms must be an integer 3 … 12, got 2"),
        ("13-way", "number of arms"),
        ("-way", "unknown scenario"),
        ("٤-way", "unknown scenario"),
        ("custom", "needs bearings"),
        ("", "unknown scenario"),
        (4, "scenario must be a str"),
        (["four-way"], "scenario must be a str"),
    ],
)
def test_unknown_scenarios_are_refused(name: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        scenario_named(name)


def test_bearings_belong_to_custom_alone() -> None:
    with pytest.raises(InputError, match="bearings go with the scenario 'custom'"):
        scenario_named("four-way", bearings=(0, 90, 180, 270))


def test_bad_options_are_refused_where_they_are_given() -> None:
    for options, message in [
        ({"density": -1}, "density"),
        ({"profile": "papers"}, "did you mean 'paper'"),
        ({"side": "centre"}, "unknown side"),
        ({"split": "4:3:2:1"}, "split must be a sequence"),
        ({"horizon": 0}, "horizon"),
        ({"lane_width": 30}, "lane_width"),
    ]:
        with pytest.raises(InputError, match=message):
            four_way(**options)  # type: ignore[arg-type]


def test_the_package_offers_its_names() -> None:
    assert all(hasattr(scenarios, name) for name in scenarios.__all__)
    assert scenarios.four_way is four_way
