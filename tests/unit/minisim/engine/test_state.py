"""The arrays of a run: what a vehicle is depends on seed, lane and rank in it, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from minisim.arrivals import Arrivals
from minisim.control import Site
from minisim.demand import Demand
from minisim.engine.state import build_vehicles
from minisim.vehicle import VehicleType
from scenarios import four_way

SITE = replace(four_way(profile="fair").site(5), fleet=VehicleType(speed_deviation=0.1))


def factors(arrivals: Arrivals, lane: int, site: Site = SITE) -> list[float]:
    """Speed factors of the vehicles of a lane."""
    vehicles = build_vehicles(site, arrivals)
    factors: list[float] = vehicles["factor"][vehicles["lane"] == lane].tolist()
    return factors


def test_speed_factors_depend_on_lane_and_rank_only() -> None:
    demand = Demand(density=300.0)
    short, long = (demand.draw(4, time, 5) for time in (600.0, 1200.0))
    alone = Demand(density=75.0, split=(0, 0, 1, 0)).draw(4, 1200.0, 5)
    one = factors(long, 2)
    assert factors(short, 2) == one[: len(factors(short, 2))]
    assert factors(alone, 2) == one
    assert one[:20] != factors(long, 1)[:20]
    assert one != factors(long, 2, replace(SITE, seed=6))


def test_speed_factors_are_normal_and_cut() -> None:
    many = np.full(20_000, 0.0), np.zeros(20_000, int), np.ones(20_000, int)
    drawn = np.array(factors(Arrivals(*many), 0))
    assert drawn.mean() == pytest.approx(1.0, abs=5 * 0.1 / len(drawn) ** 0.5)
    assert drawn.std() == pytest.approx(0.1, rel=0.03)
    wild = factors(Arrivals(*many), 0, replace(SITE, fleet=VehicleType(speed_deviation=0.5)))
    assert (min(wild), max(wild)) == (0.2, 2.0)


def test_ranks_are_places_in_the_lane() -> None:
    table = Arrivals(np.array([3.0, 1.0, 2.0, 1.0]), np.array([1, 1, 0, 2]), np.ones(4, int))
    vehicles = build_vehicles(SITE, table)
    assert vehicles[["lane", "rank", "id"]].tolist() == [(0, 0, 2), (1, 0, 0), (1, 1, 3), (2, 0, 1)]
