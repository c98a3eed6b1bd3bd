"""The paper's cells: what the labels say, what ran, and how near the signal's runs come."""

from __future__ import annotations

import statistics

import pytest

import minisim
from baselines import Actuated, Adaptive, FixedTime, webster
from dim import AsRunDim
from dim.as_run import winner
from dim.harmony import HarmonyMatrix
from minisim.control import Controller
from minisim.errors import InputError
from minisim.junction.movements import Movement
from scenarios.paper import (
    BASELINE_GRID,
    GREENS,
    GRID,
    PHASES,
    RAN,
    SPLITS,
    Cell,
    controller_of,
    reference,
    reference_value,
    replay,
    scenario,
)
from scenarios.published import published_arrivals
from scenarios.scenario import AS_RUN, AS_RUN_SIGNALS


def test_the_grids_are_every_published_run() -> None:
    table = reference()
    rows = table[table["metric"] == "travel_time_s"]
    published = {Cell(r.split, r.density, r.arms, r.controller) for r in rows.itertuples()}
    assert published == {*GRID, *BASELINE_GRID}
    assert len(GRID) + len(BASELINE_GRID) == 70


def test_what_ran_otherwise_is_what_is_not_comparable() -> None:
    """Column `comparable` of the reference numbers, from the authors' files."""
    table = reference()
    odd = table[table["comparable"].str.startswith("no")]
    assert {(r.controller, r.split) for r in odd.itertuples()} == set(RAN)


def test_every_baseline_cell_can_be_set_up_and_replayed() -> None:
    for cell in BASELINE_GRID:
        arrivals = published_arrivals(*cell)
        what = replay(*cell)
        assert len(what.arrivals(1)) == len(arrivals) > 400
        # What arrived is at most what was demanded, as shares of a split or as it really was.
        drawn = scenario(*cell)
        assert sum(drawn.rates) == pytest.approx(4 * cell.density)
        assert scenario(*cell, as_labelled=True).density == cell.density


@pytest.mark.parametrize("controller", ["dim", "fts", "ats", "v2ic"])
def test_at_4141_dim_loads_north_and_south_the_others_north_and_east(controller: str) -> None:
    """as_run.md, discrepancy 13; lanes are a north, b east, c south, d west."""
    cell = Cell("4:1:4:1", 250, 4, controller)
    north, east, south, west = replay(*cell).rates
    if controller == "dim":
        assert min(north, south) > 2.5 * max(east, west)
        assert scenario(*cell).rates == pytest.approx((400, 100, 400, 100))
    else:
        assert min(north, east) > 1.5 * max(south, west)
        assert scenario(*cell).rates == pytest.approx((400, 400, 100, 100))
        assert scenario(*cell, as_labelled=True).rates == pytest.approx((400, 100, 400, 100))


def test_v2ic_ran_balanced_where_it_says_4321() -> None:
    """as_run.md, discrepancy 10."""
    cell = Cell("4:3:2:1", 350, 4, "v2ic")
    assert scenario(*cell).rates == pytest.approx((350,) * 4)
    assert max(replay(*cell).rates) < 1.15 * min(replay(*cell).rates)
    assert max(scenario(*cell, as_labelled=True).rates) == pytest.approx(560)


def test_the_fixed_signal_has_the_published_greens() -> None:
    """Webster's to a quarter of a second; 5 s at every density where 4:3:2:1 ran (no. 11)."""
    for density, green in GREENS.items():
        assert green == pytest.approx(webster((density,) * 4).greens[0], abs=0.11)
        cell = Cell("balanced", density, 4, "fts")
        assert controller_of(*cell) == FixedTime(greens=green, order=PHASES)
        unbalanced = cell._replace(split="4:3:2:1")
        assert controller_of(*unbalanced) == FixedTime(greens=5.0, order=PHASES)
        assert controller_of(*unbalanced, as_labelled=True) == FixedTime(greens=green, order=PHASES)


def test_each_run_has_its_vehicle() -> None:
    def profile(controller: str, split: str, as_labelled: bool = False) -> object:
        return scenario(split, 200, 4, controller, as_labelled=as_labelled).profile

    assert profile("fts", "balanced") == profile("ats", "4:1:4:1") == AS_RUN_SIGNALS
    assert profile("dim", "4:3:2:1") == profile("v2ic", "balanced") == AS_RUN
    assert profile("fts", "4:3:2:1") == profile("fts", "4:1:4:1") == AS_RUN
    assert profile("fts", "4:3:2:1", as_labelled=True) == AS_RUN_SIGNALS


def test_every_published_controller_is_to_be_had() -> None:
    for cell in (*GRID, *BASELINE_GRID):
        assert isinstance(controller_of(*cell), Controller)


def test_the_adaptive_signal_was_an_actuated_one_at_4321() -> None:
    """as_run.md, discrepancy 12; the phases come in the order of the authors' network."""
    assert controller_of("balanced", 150, 4, "ats") == Adaptive(order=PHASES)
    assert controller_of("4:1:4:1", 150, 4, "ats") == Adaptive(order=PHASES)
    assert controller_of("4:3:2:1", 150, 4, "ats") == Actuated(order=PHASES)
    assert controller_of("4:3:2:1", 150, 4, "ats", as_labelled=True) == Adaptive(order=PHASES)


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        (("balanced", 350, 5, "fts"), "no run of fts, balanced 350"),
        (("balanced", 350, 4, "sumo"), "unknown published controller 'sumo'"),
    ],
)
def test_cells_of_others_that_were_not_published(cell: Cell, message: str) -> None:
    for ask in (scenario, replay, controller_of):
        with pytest.raises(InputError, match=message):
            ask(*cell)


# --- DIM's names at 4:1:4:1 -------------------------------------------------------------------


def test_names_decide_who_is_first() -> None:
    """b2 and c1 exclude each other; c is called b where the arms are named acbd."""
    matrix = HarmonyMatrix.paper(4)
    case = frozenset({Movement(1, 2), Movement(2, 1)})
    assert not matrix.harmony(*case)
    assert {str(m) for m in winner(matrix, case, "lanes")} == {"b2"}
    assert {str(m) for m in winner(matrix, case, "lanes", "acbd")} == {"c1"}
    assert controller_of("4:1:4:1", 200, 4) == AsRunDim(names="acbd")
    assert controller_of("4:3:2:1", 200, 4) == AsRunDim()


def test_names_are_checked() -> None:
    with pytest.raises(InputError, match="names must be different letters"):
        AsRunDim(names="abca")
    with pytest.raises(InputError, match="names must be 4 letters"):
        AsRunDim(names="abc").start(scenario("balanced", 150, 4).site())


def test_dim_at_4141_meets_the_published_means() -> None:
    """150 veh/h: wait within 10 %, travel within 0.5 s (as_run.md, replays)."""
    cell = Cell("4:1:4:1", 150, 4)
    run = minisim.simulate(replay(*cell), controller_of(*cell), on_collision="record")
    summary = run.summary()
    assert summary["waiting_time_s"] == pytest.approx(
        reference_value(cell, "waiting_time_s"), rel=0.10
    )
    assert summary["travel_time_s"] == pytest.approx(
        reference_value(cell, "travel_time_s"), abs=0.5
    )


# --- the fixed-time signal's published runs ---------------------------------------------------


def test_phases_come_in_the_given_order() -> None:
    what = scenario("balanced", 150, 4, "fts")
    program = controller_of("balanced", 150, 4, "fts").start(what.site())._program  # type: ignore[attr-defined]
    assert [phase.lanes for phase in program.phases] == [(2,), (1,), (0,), (3,)]
    with pytest.raises(InputError, match="order must be the lanes 0 … 3"):
        FixedTime(order=(0, 1, 2)).start(what.site())
    with pytest.raises(InputError, match="lane in order"):
        FixedTime(order=(0, 1.5, 2, 3))  # type: ignore[arg-type]


@pytest.mark.parametrize("density", [150, 200, 250, 300, 350])
def test_replays_of_the_fixed_signal_meet_the_published_means(density: int) -> None:
    """Wait within 10 % (as_run.md); travel within 2.5 s: drivers' speed factors are not on record,
    and minisim follows vehicles that turn off longer than SUMO does (tests/sumo/test_krauss.py).
    """
    cell = Cell("balanced", density, 4, "fts")
    summary = minisim.simulate(replay(*cell), controller_of(*cell), 0).summary()
    assert summary["collisions"] == 0
    assert summary["waiting_time_s"] == pytest.approx(
        reference_value(cell, "waiting_time_s"), rel=0.10
    )
    assert summary["travel_time_s"] == pytest.approx(
        reference_value(cell, "travel_time_s"), abs=2.5
    )


@pytest.mark.parametrize("split", SPLITS)
@pytest.mark.parametrize(("density", "allowed"), [(150, 0.10), (250, 0.10), (350, 0.13)])
def test_replays_of_the_adaptive_signal_meet_the_published_means(
    split: str, density: int, allowed: float
) -> None:
    """Wait within 10 %, travel within 2 s (as_run.md), over three drawings of drivers' factors.

    At 350 ours wait 12 % longer: SUMO 1.28 with the same factors waits 4 % longer than published;
    another 5 % is that our heads turn green only when the junction is clear.
    """
    cell = Cell(split, density, 4, "ats")
    runs = [minisim.simulate(replay(*cell), controller_of(*cell), k).summary() for k in range(3)]
    assert [run["collisions"] for run in runs] == [0, 0, 0]
    wait, travel = (
        statistics.fmean(run[metric] for run in runs)
        for metric in ("waiting_time_s", "travel_time_s")
    )
    assert wait == pytest.approx(reference_value(cell, "waiting_time_s"), rel=allowed)
    assert travel == pytest.approx(reference_value(cell, "travel_time_s"), abs=2.0)
