"""Replays of the published runs: tolerances of the published means, and SUMO's own trips."""

from __future__ import annotations

import math

import pytest

import minisim
from minisim.errors import InputError
from scenarios.paper import GRID, Cell, controller_of, reference, reference_value, replay, scenario
from scenarios.published import published_arrivals, published_ways

#: Means of SUMO 1.18 on the same arrivals: waiting and travel [s]. Where no vehicle was teleported
#: they are the published ones, to the last digit.
SUMO = {
    Cell("balanced", 150, 3): (0.3113, 64.7888),
    Cell("balanced", 200, 3): (0.4536, 65.1907),
    Cell("balanced", 250, 3): (0.5359, 65.5841),
    Cell("balanced", 300, 3): (0.9524, 67.2984),
    Cell("balanced", 350, 3): (1.0447, 67.8727),
    Cell("balanced", 150, 4): (0.7084, 65.9427),
    Cell("balanced", 200, 4): (1.3676, 68.0629),
    Cell("balanced", 250, 4): (1.5513, 68.8290),
    Cell("balanced", 300, 4): (2.2580, 71.3836),
    Cell("balanced", 350, 4): (3.9578, 80.3505),
    Cell("balanced", 150, 5): (0.9820, 66.5304),
    Cell("balanced", 200, 5): (1.8261, 69.2819),
    Cell("balanced", 250, 5): (3.9285, 76.3352),
    Cell("balanced", 300, 5): (10.2468, 98.2507),
    Cell("balanced", 350, 5): (25.5077, 153.6784),
    Cell("4:1:4:1", 150, 4): (0.5097, 65.6543),
    Cell("4:1:4:1", 200, 4): (1.0816, 67.6040),
    Cell("4:1:4:1", 250, 4): (1.5082, 69.1067),
    Cell("4:1:4:1", 300, 4): (2.1333, 71.3460),
    Cell("4:1:4:1", 350, 4): (4.3662, 80.7408),
    Cell("4:3:2:1", 150, 4): (0.6656, 65.9373),
    Cell("4:3:2:1", 200, 4): (1.0305, 67.2343),
    Cell("4:3:2:1", 250, 4): (1.4195, 68.5731),
    Cell("4:3:2:1", 300, 4): (2.0152, 71.0457),
    Cell("4:3:2:1", 350, 4): (4.5474, 79.5909),
}

#: The one run that parts from SUMO's: an approach lane of the 3-arm network is 1 cm longer than its
#: siblings, from 1120 s on that decides who goes first.
PARTS = Cell("balanced", 350, 3)


def run(cell: Cell) -> dict[str, float]:
    return minisim.simulate(replay(*cell), controller_of(*cell), on_collision="teleport").summary()


def within(cell: Cell, summary: dict[str, float]) -> None:
    """The tolerances of as_run.md for replays of the DIM runs."""
    wait = reference_value(cell, "waiting_time_s")
    travel = reference_value(cell, "travel_time_s")
    assert summary["waiting_time_s"] == pytest.approx(wait, rel=0.10)
    assert summary["travel_time_s"] == pytest.approx(
        travel, abs=3.0 if cell.density == 350 else 0.5
    )


QUICK = [Cell("balanced", 150, 3), Cell("balanced", 150, 4), Cell("4:1:4:1", 350, 4)]


@pytest.mark.parametrize(
    "cell",
    [cell if cell in QUICK else pytest.param(cell, marks=pytest.mark.slow) for cell in SUMO],
    ids=str,
)
def test_replays_are_those_of_sumo_1_18_and_meet_the_published_means(cell: Cell) -> None:
    summary = run(cell)
    within(cell, summary)
    loose = 2e-2 if cell == PARTS else 1e-4
    wait, travel = SUMO[cell]
    assert summary["waiting_time_s"] == pytest.approx(wait, abs=loose)
    assert summary["travel_time_s"] == pytest.approx(travel, abs=loose)


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
    assert reference_value(cell, "travel_time_s", controller="fts") == 157.0664
    with pytest.raises(InputError, match="no travel_time_s of dim, lane d"):
        reference_value(cell, "travel_time_s", lane="d")
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
