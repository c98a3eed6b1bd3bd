"""Level of service: the manual's limits, and delay by the time at which vehicles came."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from baselines import Actuated, Adaptive, AllWayStop, FixedTime, MaxPressure
from minisim import simulate
from minisim.demand import DemandProfile, Period
from minisim.errors import InputError
from minisim.results.service import kind_of_junction, level_of_service, service
from scenarios import four_way
from scenarios.controllers import controller_named, safe


@pytest.mark.parametrize(
    ("kind", "levels"),
    [
        ("signalised", {10.0: "A", 10.1: "B", 20.0: "B", 35.0: "C", 55.0: "D", 80.0: "E", 81: "F"}),
        ("unsignalised", {0.0: "A", 10.1: "B", 15.1: "C", 35.0: "D", 50.0: "E", 50.1: "F"}),
    ],
)
def test_levels_are_those_of_the_manual(kind: str, levels: dict[float, str]) -> None:
    assert {delay: level_of_service(delay, kind) for delay in levels} == levels
    assert level_of_service(math.nan) == ""
    with pytest.raises(InputError, match=r"unknown kind of junction 'signal'.*'signalised'"):
        level_of_service(1.0, "signal")


def test_worked_examples_of_a_stop_controlled_junction() -> None:
    """U.S. 95 at Styner and Lauder Avenue: Highway Capacity Manual Applications Guidebook (NCHRP
    3-64, 2003), exhibit 1-9, with the movements 1, 4, 7, 8-9, 10 and 11-12, and two approaches."""
    delays = (8.6, 8.3, 36.0, 27.6, 47.0, 25.3, 29.3, 30.6)
    assert "".join(map(level_of_service, delays)) == "AAEDEDDD"


def test_worked_example_of_a_signalised_junction() -> None:
    """Example problem 1 of the Highway Capacity Manual, 7th ed. (2022), chapter 31, exhibit 31-81.

    Transcribed by github.com/crosstraffic/transportations-library (tests/chapter19_integration.rs):
    lane groups (left, through, right) from the west, east, south and north, the approaches, all.
    """
    groups = (45.5, 29.9, 30.6, 43.5, 35.5, 36.2, 13.5, 72.0, 76.7, 32.6, 17.0, 17.1)
    levels = "".join(level_of_service(delay, "signalised") for delay in groups)
    # The manual gives the two E an F, since their demand is over capacity (1.05 and 1.07).
    assert levels == "DCCDDDBEECBB"
    delays = (32.4, 37.0, 70.0, 19.6, 45.9)
    assert "".join(level_of_service(delay, "signalised") for delay in delays) == "CDEBD"


def test_worked_examples_of_all_way_stops() -> None:
    """Example problems 1 and 2 for all-way stops of the same manual, chapter 32, as transcribed
    there (tests/chapter21_integration.rs): lanes, approaches, then the whole junction."""
    assert "".join(map(level_of_service, (13.0, 13.5, 12.8))) == "BBB"
    assert "".join(map(level_of_service, (12.1, 16.1, 15.3, 14.0))) == "BCCB"


def test_worked_examples_of_two_way_stops() -> None:
    """Example problems 1 and 3 for two-way stops of the same manual, chapter 32, as transcribed
    there (tests/chapter20_integration.rs): movement 4 and the approach that stops; movements 1
    and 4 and both approaches. The last two are WBL and NBR in exhibit 3-30 of the Guidebook."""
    assert "".join(map(level_of_service, (8.3, 14.9))) == "AB"
    assert "".join(map(level_of_service, (8.4, 8.2, 18.3, 15.6))) == "AACC"
    assert "".join(map(level_of_service, (67.0, 464.0))) == "FF"


def test_worked_examples_of_roundabouts_which_have_the_same_limits() -> None:
    """Example problems 1 and 2 for roundabouts of the same manual, chapter 33, as transcribed there
    (tests/chapter22_integration.rs): lanes, approaches, then the whole junction."""
    one = (22.6, 14.0, 0.0, 22.0, 26.8, 20.2, 23.3, 4.7, 17.5)
    assert "".join(map(level_of_service, one)) == "CBACDCCAC"
    two = (11.8, 13.0, 14.6, 14.0, 16.1, 8.8, 7.8, 15.1, 12.3)
    assert "".join(map(level_of_service, two)) == "BBBBCAACB"


@pytest.mark.parametrize("name", safe())
def test_signals_are_graded_as_signals_and_all_others_as_unsignalised(name: str) -> None:
    run = simulate(four_way(250, profile="fair", horizon=60.0), controller_named(name))
    signal = isinstance(run.controller, FixedTime | Adaptive | Actuated | MaxPressure)
    assert kind_of_junction(run) == ("signalised" if signal else "unsignalised")


def test_a_run_is_graded_by_the_delay_of_all_its_trips() -> None:
    scenario = four_way(350, profile="fair", horizon=300.0)
    for controller, kind in ((FixedTime(), "signalised"), (AllWayStop(), "unsignalised")):
        run = simulate(scenario, controller, 1)
        summary = run.summary(["level_of_service", "control_delay_s"], by=["movement"])
        for group in (summary, *summary["lanes"].values(), *summary["movements"].values()):
            level = level_of_service(group["complete"]["control_delay_s"], kind)
            assert "ABCDEF"[group["level_of_service"] - 1] == level
        assert service(run)["los"].tolist() == service(run, kind=kind)["los"].tolist()
    empty = simulate(four_way(0, horizon=10.0), FixedTime())
    assert empty.summary(["level_of_service"])["level_of_service"] is None


def test_the_table_divides_the_trips_of_the_summary() -> None:
    quarter = Period(start=25_200, end=26_100, rates=(300.0,) * 4)
    empty = replace(quarter, start=26_100, end=27_000, rates=(0.0,) * 4)
    last = replace(quarter, start=27_000, end=27_900)
    day = DemandProfile(periods=(quarter, empty, last))
    run = simulate(four_way(demand=day, profile="fair", warmup=60.0), AllWayStop(), 3)
    table, summary = service(run, 300.0), run.summary(["control_delay_s"])
    assert table["time"].tolist()[:3] == ["07:01", "07:06", "07:11"]
    assert table["trips"].sum() == summary["trips"]
    assert table["served"].sum() == summary["trips"] - summary["unfinished"]
    assert table["trips"][4] == 0
    assert np.isnan(table["control_delay_s"][4])
    assert table["los"][4] == ""
    whole = np.nansum(table["control_delay_s"] * table["trips"]) / summary["trips"]
    assert whole == pytest.approx(summary["complete"]["control_delay_s"])
    with pytest.raises(InputError, match="interval"):
        service(run, 0.0)
