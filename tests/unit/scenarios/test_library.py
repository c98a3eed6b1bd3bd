"""Ready-made scenarios: the paper's three junctions and any other."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import scenarios
from minisim.demand import Demand, DemandProfile, Period
from minisim.errors import InputError
from scenarios.library import (
    Options,
    five_way,
    four_way,
    from_bearings,
    regular,
    replayed,
    scenario_named,
    three_way,
)
from scenarios.profiles import FAIR
from scenarios.scenario import Scenario
from tests import ROOT


@pytest.mark.parametrize(
    ("maker", "n", "approach"),
    [(three_way, 3, 495.84), (four_way, 4, 492.80), (five_way, 5, 491.6)],
)
def test_the_papers_junctions_have_the_lanes_of_the_authors_networks(
    maker: Callable[..., Scenario], n: int, approach: float
) -> None:
    scenario = maker()
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
    assert scenario.demand == Demand(
        density=100, split=(2, 1, 1), turns=(3, 1), model="shifted", min_headway=2.0
    )
    assert scenario.profile is FAIR


@pytest.mark.parametrize("text", ["4,3,2,1", "(4, 3, 2, 1)", "[4,3,2,1]", " 4 : 3:2:1 "])
def test_shares_may_be_a_tuple_or_list_in_a_text(text: str) -> None:
    assert four_way(split=text).demand.split == (4.0, 3.0, 2.0, 1.0)


def test_recorded_arrivals_replace_the_demand() -> None:
    recorded = four_way(100, horizon=60.0).arrivals(1)
    assert four_way(recorded=recorded).recorded is recorded
    with pytest.raises(InputError, match="recorded replaces density, split; give one or the"):
        four_way(100, split="4:3:2:1", recorded=recorded)
    with pytest.raises(InputError, match="min_headway needs the model 'shifted'"):
        four_way(min_headway=2.0)


def test_demand_by_time_of_day_replaces_the_constant_one_and_gives_the_horizon() -> None:
    half = Period(start=0, end=1800, rates=(100, 0, 200), turns="1:3")
    day = DemandProfile(periods=(half, replace(half, start=1800, end=3600, rates=(300, 0, 0))))
    scenario = three_way(demand=day)
    assert scenario.horizon == 3600.0
    assert scenario.rates == pytest.approx((200, 0, 100))
    assert scenario.density == pytest.approx(100)
    site = scenario.site(1)
    assert site.expected(0, 1800) == (100, 0, 200)
    assert site.expected(900, 2700) == pytest.approx((200, 0, 100))
    assert three_way(demand=day, horizon=1800).site(1).demand == (100, 0, 200)
    assert three_way(100).site(1).expected(900, 2700) == (100, 100, 100)
    with pytest.raises(InputError, match="demand replaces density, split; give one or the"):
        three_way(100, demand=day, split="1:1:1")
    with pytest.raises(InputError, match="recorded replaces demand"):
        three_way(demand=day, recorded=scenario.arrivals(1))
    with pytest.raises(InputError, match="'profile' has 3 lanes, the junction has 4"):
        four_way(demand=day)
    with pytest.raises(InputError, match="ends 3600 s after its start, before the run of 3601 s"):
        three_way(demand=day, horizon=3601)
    with pytest.raises(InputError, match="demand must be a DemandProfile"):
        three_way(demand="day.toml")


def test_a_demand_brings_its_fleet_and_one_given_beside_it_wins() -> None:
    quarter = Period(start=0, end=900, rates=(100, 0, 200))
    day = DemandProfile(periods=(quarter,), fleet="car:0.5,lcv:0.5")
    own = three_way(demand=day, profile="fair")
    assert str(own.vehicles) == str(own.site().fleet) == "car:0.5,lcv:0.5"
    assert not own.replaced
    beside = three_way(demand=day, fleet="truck")
    assert beside.vehicles.names == ("truck",)
    assert beside.replaced == "the fleet truck replaces that of the demand 'profile'"
    assert not three_way(100, fleet="truck").replaced
    like = replace(FAIR, vehicle=replace(FAIR.vehicle, model="krauss"))
    assert {it.model for it in three_way(demand=day, profile=like).vehicles.types} == {"krauss"}
    with pytest.raises(InputError, match=r"a fleet, .*, needs the profile paper or"):
        three_way(demand=day, profile="as_run")


@pytest.mark.parametrize("text", ["", "(4,3,2,1", "4;3;2;1", "4:x", "::", "even"])
def test_bad_shares_are_one_sentence(text: str) -> None:
    with pytest.raises(InputError, match="split must be balanced or like 4:3:2:1, got"):
        four_way(split=text)
    with pytest.raises(InputError, match="turns must be uniform or like 4:3:2:1, got"):
        four_way(turns=text)


def test_keywords_are_seen_by_completion() -> None:
    for make in (three_way, four_way, five_way, regular, from_bearings):
        shown = inspect.signature(make).parameters
        assert set(Options.__annotations__) | {"density"} <= set(shown)
        assert shown["horizon"].default == 3600.0
        assert all(parameter.kind is not parameter.VAR_KEYWORD for parameter in shown.values())


@pytest.mark.slow  # mypy takes 20 s without its cache
def test_keywords_are_seen_by_mypy(tmp_path: Path) -> None:
    from mypy import api

    code = (
        "from dim import Dim\n"
        "from dim.senses.noise import NoisyPerception\n"
        "from minisim.control import Plan\n"
        "from scenarios import four_way, from_bearings, regular\n"
        "from scenarios.recipe import Recipe\n"
        "four_way(200, splt='4:3:2:1')\n"
        "regular(6, horizn=60.0)\n"
        "from_bearings((0, 90, 180), profile=3)\n"
        "Dim(monitor=1)\n"
        "Recipe(four_way(), 7)\n"
        # What is accepted at run time is accepted here.
        "four_way(200, split='4:3:2:1', warmup=60.0)\n"
        "Dim(monitor='on', zones={'yellow': 20.0}, perception='noisy', matrix='paper(4)')\n"
        "Dim(priorities=[0, 1, 2, 3], matrix=None, monitor=None, perception=NoisyPerception())\n"
        "NoisyPerception(shared='off', occlusion=True, unsignalled=[0.1, 0.2])\n"
        "Plan(marks=[1.0, 2.0])\n"
        "made = Recipe(four_way(), 'dim:gate=harmonious', metrics='pets')\n"
        "Recipe(four_way(), {'name': 'dim', 'gate': 'harmonious'}, metrics=['pets', len])\n"
        "made.controller.start(made.scenario.site())\n"
        "print(Dim().zones.green, Plan().marks[0], NoisyPerception().unsignalled[1])\n"
    )
    (tmp_path / "used.py").write_text(code, encoding="utf-8")
    told = api.run(["--config-file", str(ROOT / "pyproject.toml"), str(tmp_path / "used.py")])[0]
    wrong = [int(line.split(":")[1]) for line in told.splitlines() if "error:" in line]
    assert wrong == [6, 7, 8, 9, 10], told


def test_scenarios_have_the_names_of_the_command_line() -> None:
    assert scenario_named("four-way", density=100) == four_way(100)
    assert scenario_named("five-way") == five_way()
    assert scenario_named("7-way") == regular(7)
    custom = scenario_named("custom", bearings=(0, 80, 190, 260))
    assert custom.intersection.bearings == (0.0, 80.0, 190.0, 260.0)
    with pytest.raises(InputError, match="bearings go with the scenario 'custom'"):
        scenario_named("four-way", bearings=(0, 90, 180, 270))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("four_way", "unknown scenario 'four_way'.*did you mean 'four-way'"),
        ("4way", r"N-way \(such as 6-way\), custom, or .*; did you mean '4-way'"),
        ("4-ways", "did you mean '4-way'"),
        ("junction", r"custom, or a file such as junction.toml$"),
        ("9" * 5000, "unknown scenario"),
        ("2-way", "number of arms must be an integer 3 … 12, got 2"),
        ("-way", "unknown scenario"),
        ("٤-way", "unknown scenario"),
        ("custom", "needs bearings"),
        ("", "unknown scenario"),
        (4, "scenario must be a text"),
    ],
)
def test_unknown_scenarios_are_refused(name: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        scenario_named(name)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"densty": 300}, "scenario 'densty'; allowed: density, .*; did you mean 'density'"),
        ({"profile": "papers"}, "did you mean 'paper'"),
        ({"split": 4}, "split must be a sequence"),
        ({"density": -1}, "density"),
    ],
)
@pytest.mark.parametrize("make", [three_way, four_way, five_way])
def test_bad_options(make: Callable[..., Scenario], options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make(**options)


def test_the_package_offers_its_names() -> None:
    assert all(hasattr(scenarios, name) for name in scenarios.__all__)
    assert scenarios.four_way is four_way
    assert not hasattr(scenarios, "four_ways")


@pytest.mark.parametrize(
    ("text", "fleet", "message"),
    [
        ("25300,a,1,car", None, r"horizon of 10 s from 25260 s \(07:01\) on: the first recorded "
         r"arrival is at 25300 s \(07:01:40\)"),
        ("25261,a,1,bus", None, r"type 'bus', but the profile paper drives car alone; a fleet .*"
         "such as car:0.9,bus:0.1"),
        ("25261,a,1,buss", None, r"unknown vehicle type of the arrivals: 'buss'.*mean 'bus'\?"),
        ("25261,a,1,cars", {"car": 0.5, "lcv": 0.5}, r"'cars'; allowed: car, lcv; did .*'car'\?"),
    ],
)  # fmt: skip
def test_what_a_file_of_arrivals_does_not_fit_is_said_by_its_clock(
    tmp_path: Path, text: str, fleet: Any, message: str
) -> None:
    (tmp_path / "a.csv").write_text(f"demand_time_s,lane,manoeuvre,type\n{text}\n")
    with pytest.raises(InputError, match=rf"a\.csv: .*{message}"):
        replayed(four_way(fleet=fleet, horizon=10.0), tmp_path / "a.csv", "07:01")
