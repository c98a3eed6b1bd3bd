"""Level of service: the manual's limits, and delay by the time at which vehicles came."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from baselines import AllWayStop
from minisim import simulate
from minisim.demand import DemandProfile, Period
from minisim.errors import InputError
from minisim.results.service import level_of_service, service
from scenarios import four_way


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
