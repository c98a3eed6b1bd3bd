"""Replays of the published runs: tolerances of the published means, and SUMO's own trips."""

from __future__ import annotations

import math

import pytest

import minisim
from minisim.errors import InputError
from scenarios.paper import GRID, Cell, controller_of, reference, replay, scenario
from scenarios.published import published_arrivals, published_ways
from tests.builders import reference_value

#: Means of SUMO 1.28 (CC model, same arrivals in the same order, step 0.01 s): wait and travel [s].
#: Up to 300 veh/h and on 3 arms from a driver written for this comparison, others from our host.
SUMO = {
    Cell("balanced", 150, 4): (0.7589, 65.9877),
    Cell("balanced", 200, 4): (1.2420, 67.6987),
    Cell("balanced", 250, 4): (1.4782, 68.4513),
    Cell("balanced", 300, 4): (1.9918, 70.3453),
    Cell("balanced", 150, 3): (0.3006, 64.7428),
    Cell("balanced", 350, 3): (1.1222, 68.1589),
    Cell("balanced", 350, 4): (4.0452, 80.9100),
    Cell("4:3:2:1", 350, 4): (4.2089, 79.1332),
    Cell("4:1:4:1", 350, 4): (4.8362, 80.6999),
}


def run(cell: Cell) -> dict[str, float]:
    return minisim.simulate(replay(*cell), controller_of(*cell), on_collision="record").summary()


def within(cell: Cell, summary: dict[str, float]) -> None:
    """The tolerances of as_run.md for replays of the DIM runs."""
    wait = reference_value(cell, "waiting_time_s")
    travel = reference_value(cell, "travel_time_s")
    assert summary["waiting_time_s"] == pytest.approx(wait, rel=0.10)
    assert summary["travel_time_s"] == pytest.approx(
        travel, abs=3.0 if cell.density == 350 else 0.5
    )


@pytest.mark.parametrize("cell", [Cell("balanced", 150, 3), Cell("balanced", 150, 4)], ids=str)
def test_replays_meet_the_published_means_and_sumo(cell: Cell) -> None:
    summary = run(cell)
    within(cell, summary)
    wait, travel = SUMO[cell]
    assert summary["waiting_time_s"] == pytest.approx(wait, abs=1e-4)
    assert summary["travel_time_s"] == pytest.approx(travel, abs=5e-4)  # a step in a trip of ten


@pytest.mark.slow
@pytest.mark.parametrize("cell", list(SUMO), ids=str)
def test_replays_equal_sumo(cell: Cell) -> None:
    summary = run(cell)
    wait, travel = SUMO[cell]
    assert summary["waiting_time_s"] == pytest.approx(wait, abs=2e-3)
    assert summary["travel_time_s"] == pytest.approx(travel, abs=2e-3)


def test_the_grid_is_every_published_dim_run() -> None:
    table = reference()
    dim = table[(table["controller"] == "dim") & (table["metric"] == "travel_time_s")]
    published = {Cell(r.split, r.density, r.arms) for r in dim.itertuples()}
    assert published == set(GRID)
    assert len(GRID) == 25


def test_every_cell_has_arrivals_of_its_geometry() -> None:
    for cell in GRID:
        arrivals = published_arrivals(*cell)
        arrivals.check(cell.arms)
        what = replay(*cell)
        assert len(what.arrivals(seed=1)) == len(arrivals) > 300
        assert (arrivals.time % 1.0).max() == pytest.approx(0.01, abs=1e-9)
        assert what.intersection.n == cell.arms


def test_drawn_scenarios_of_the_grid_have_the_split() -> None:
    what = scenario("4:3:2:1", 300, 4, profile="fair")
    assert what.rates == pytest.approx((480, 360, 240, 120))
    assert what.profile_name == "fair"
    assert scenario("balanced", 150, 5).rates == pytest.approx((150,) * 5)


def test_reference_numbers() -> None:
    cell = Cell("balanced", 350, 4)
    assert reference_value(cell, "waiting_time_s") == 3.9629
    assert reference_value(cell, "waiting_time_s", lane="d") == 10.2094
    fixed = cell._replace(controller="fts")
    assert reference_value(fixed, "travel_time_s") == 157.0664
    table = reference()
    table.loc[:, "value"] = math.nan
    assert reference_value(cell, "waiting_time_s") == 3.9629


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        (("balanced", 400, 4), "no run of balanced 400"),
        (("4:3:2:1", 350, 5), "3 and 5 arms were balanced only"),
        (("1:1", 350, 4), "unknown split"),
        (("balanced", 350.5, 4), "density"),
    ],
)
def test_cells_that_were_not_published(cell: tuple[str, int, int], message: str) -> None:
    with pytest.raises(InputError, match=message):
        replay(*cell)


def test_ways_of_other_junctions_are_not_published() -> None:
    with pytest.raises(InputError, match="published junction"):
        published_ways(6)
    with pytest.raises(InputError, match="published run"):
        published_arrivals("balanced", 100, 4)
