"""Cross-validation: statistics of hand-made trips, verdicts, the report and its figures."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from baselines import FixedTime, V2ICAsRun
from dim import AsRunDim, Dim
from figures import save
from figures.crossval import crossval_figures
from figures.plots import DODGE
from minisim.errors import SumoError
from minisim.junction.paths import Floats
from minisim.results.metrics import MEANS
from minisim.results.run import Run
from minisim.results.trajectories import LANE, MANOEUVRE
from minisim.results.trips import Trips
from minisim.simulation import simulate
from scenarios import four_way
from scenarios.crossval import Case, Result, crossvalidate, film, replayed_cases, runs, write_report
from scenarios.crossval import comparison as hosts
from scenarios.crossval.comparison import CLOSE, Pair, Tolerance
from scenarios.crossval.report import markdown, summary, table
from scenarios.paper import GREENS, GRID, PHASES, Cell, replay
from scenarios.profiles import AS_RUN, AS_RUN_SIGNALS
from scenarios.published import published_arrivals
from scenarios.statistics import ks_distance, mean_interval
from tests.builders import reference_value
from tests.unit.scenarios.cli.test_cli import fails

END = 100.0
LANES = (0, 1, 0, 1)


def trips(waiting: Sequence[float], travel: Sequence[float], arrived: Sequence[bool]) -> Trips:
    """Four trips of the lanes a, b, a, b, on the road from 10, 20, 30 and 40 s on."""
    depart = np.array([10.0, 20.0, 30.0, 40.0])
    zero: Floats = np.zeros(4)
    done = np.array(arrived)
    return Trips(
        end=END, vehicle=np.arange(4), demand_time=depart, depart=depart,
        arrival=np.where(done, depart + travel, np.nan), lane=np.array(LANES),
        manoeuvre=np.array([1, 2, 3, 1]), exit_lane=np.array([1, 3, 3, 2]),
        waiting_time=np.array(waiting), travel_time=np.array(travel), time_loss=zero,
        depart_delay=zero, departed=np.ones(4, bool), arrived=done,
        type=np.zeros(4, int),
    )  # fmt: skip


ALL = [True] * 4
OURS = trips([0, 1, 2, 3], [50, 51, 52, 53], ALL)
SAME = Pair(1, OURS, OURS)


def pair(seed: int = 1) -> Pair:
    """The last trip waits longer in SUMO; the third never ends there."""
    return Pair(seed, OURS, trips([0, 1, 2, 3.5], [50, 51.05, 70, 54], [True, True, False, True]))


@given(
    st.lists(st.integers(0, 20), min_size=1, max_size=40),
    st.lists(st.integers(0, 20), min_size=1, max_size=40),
)
def test_ks_distance_is_the_largest_gap_of_ecdfs(first: list[int], second: list[int]) -> None:
    one, other = (stats.ecdf(sample).cdf for sample in (first, second))
    expected = max(abs(one.evaluate(x) - other.evaluate(x)) for x in range(21))
    assert ks_distance(first, second) == pytest.approx(expected, abs=1e-12)
    assert ks_distance(second, first) == ks_distance(first, second)


def test_means_are_over_the_trips_that_ended_in_each_host() -> None:
    rows = {(row.lane, row.metric): row for row in hosts.compare([pair()], 3)}
    assert set(rows) == {(lane, metric) for lane in ("all", "a", "b", "c") for metric in MEANS}
    overall = rows["all", "waiting_time_s"]
    assert overall.trips == (4, 3)
    assert overall.minisim.mean == pytest.approx(1.5)
    assert overall.sumo.mean == pytest.approx((0 + 1 + 3.5) / 3)
    assert overall.difference.mean == pytest.approx(0.0)
    assert math.isnan(overall.difference.half_width), "one seed tells no spread"
    assert overall.ks == pytest.approx(1 / 3), "at 3: 4 of 4 against 2 of 3"
    assert overall.within == pytest.approx(3 / 4), "the third waited 2 s so far in both"
    assert rows["a", "travel_time_s"].within == pytest.approx(1 / 2), "the third is far apart"
    assert rows["b", "travel_time_s"].difference.mean == pytest.approx((0.05 + 1.0) / 2)
    empty = rows["c", "travel_time_s"]
    assert empty.trips == (0, 0)
    values = (empty.minisim.mean, empty.sumo.mean, empty.difference.mean, empty.ks, empty.within)
    assert all(map(math.isnan, values)), "a lane without trips is no error"


def test_differences_are_paired_by_seed() -> None:
    """Seeds spread widely and the hosts hardly: the interval of the difference is narrow."""
    waits = [(0.0, 0.1), (10.0, 10.2), (30.0, 30.3)]
    pairs = [
        Pair(seed, *(trips([wait] * 4, [50.0] * 4, ALL) for wait in both))
        for seed, both in enumerate(waits)
    ]
    row = hosts.compare(pairs, 2)[MEANS.index("waiting_time_s")]
    assert row.difference == pytest.approx(mean_interval([0.1, 0.2, 0.3]))
    assert row.difference.half_width < 0.3 < row.minisim.half_width


def test_same_trips_need_both_times() -> None:
    assert hosts.agreement([pair()]) == pytest.approx(2 / 4)
    assert hosts.agreement([SAME]) == 1.0


def test_rounding_makes_no_difference() -> None:
    ours = trips([0.1 + 0.2] * 4, [50.0] * 4, ALL)
    theirs = trips([0.3] * 4, [50.0 + CLOSE] * 4, ALL)
    row = hosts.compare([Pair(1, ours, theirs)], 2)[0]
    assert (row.ks, row.within) == (0.0, 1.0)
    assert hosts.times(ours, "waiting_time_s").tolist() == [0.3] * 4
    assert hosts.agreement([Pair(1, ours, theirs)]) == 1.0


def test_the_first_divergence_is_the_first_in_demand() -> None:
    found = hosts.first_divergence(pair(seed=7))
    assert found is not None
    assert (found.seed, found.vehicle, found.movement, found.depart) == (7, 2, "a3", 30.0)
    assert found.travel == (52.0, 70.0)
    assert found.end == END, "it never arrives in SUMO"
    assert hosts.first_divergence(SAME) is None


def test_hosts_part_where_a_vehicle_is_at_two_places() -> None:
    def frame(shift: dict[tuple[int, float], float]) -> pd.DataFrame:
        rows = [
            (time, vehicle, 10.0 * time + shift.get((vehicle, time), 0.0), 10.0, "a", 2)
            for time in (1.0, 2.0, 3.0)
            for vehicle in (4, 5, 6)
        ]
        columns = ["time_s", "vehicle", "s_m", "speed_mps", LANE, MANOEUVRE]
        return pd.DataFrame(rows, columns=columns)

    same = frame({})
    assert hosts.first_parting(same, frame({(4, 1.0): 0.4})) is None
    found = hosts.first_parting(same, frame({(4, 2.0): 0.6, (6, 2.0): -2.0, (5, 3.0): 9.0}))
    assert found is not None
    assert (found.time, found.vehicle, found.positions) == (2.0, 6, (20.0, 18.0))
    assert found.movement == "a2"


def test_tolerances() -> None:
    share, either = Tolerance(0.03), Tolerance(0.1, 0.3)
    assert [share.holds(100.0, difference) for difference in (-3.0, 3.01)] == [True, False]
    assert either.holds(1.0, 0.29)
    assert [either.holds(10.0, difference) for difference in (0.9, math.nan)] == [True, False]


def test_replays_are_the_published_grid_and_its_numbers() -> None:
    cases = replayed_cases([], ["dim"], [], [], "as_run", 3600.0)
    assert [case.published for case in cases] == list(GRID)
    chosen = replayed_cases(["four-way"], ["dim"], [350], ["4:1:4:1"], "as_run", 3600.0)
    assert [case.name for case in chosen] == ["four-way 4:1:4:1 350 dim"]
    assert chosen[0].reference("waiting_time_s", "all") == 4.3662
    short = replayed_cases(["four-way"], ["dim"], [350], ["balanced"], "as_run", 600.0)
    assert short[0].reference("waiting_time_s", "all") is None, "the paper's are of an hour"


def test_replays_have_the_vehicle_and_controller_that_ran_and_the_numbers_of_the_label() -> None:
    (v2ic,) = replayed_cases([], ["v2ic"], [350], ["4:3:2:1"], None, 3600.0)
    assert v2ic.name == "four-way 4:3:2:1 350 v2ic"
    assert v2ic.recipe().controller == V2ICAsRun(approach_speed=14.0)
    assert v2ic.reference("travel_time_s", "all") == reference_value(
        Cell("4:3:2:1", 350, 4, "v2ic"), "travel_time_s"
    )
    assert v2ic.reference_tolerance("travel_time_s") == Tolerance(0.0, 1.0)
    balanced, unbalanced = replayed_cases(
        [], ["fixed-time"], [200], ["balanced", "4:3:2:1"], None, 3600.0
    )
    hosted = replace(AS_RUN_SIGNALS.vehicle, sumo=None)
    assert balanced.scenario.profile == replace(AS_RUN_SIGNALS, vehicle=hosted)
    assert balanced.recipe().controller == FixedTime(greens=GREENS[200], order=PHASES)
    assert unbalanced.scenario.profile.vehicle == replace(AS_RUN.vehicle, sumo="1.28")
    assert unbalanced.recipe().controller == FixedTime(greens=5.0, order=PHASES)
    assert balanced.reference_tolerance("travel_time_s") == Tolerance(0.0, 2.0)
    (dim,) = replayed_cases([], ["dim"], [150], ["4:1:4:1"], None, 3600.0)
    assert dim.recipe().controller == AsRunDim(names="acbd"), "its arms have other names"
    assert dim.reference_tolerance("travel_time_s") == Tolerance(0.0, 0.5)


def test_published_arrivals_with_another_vehicle() -> None:
    """The controller goes with the vehicle, and the paper's numbers are not asked for."""
    dim, signal = replayed_cases([], ["dim", "fixed-time"], [200], ["4:1:4:1"], "fair", 3600.0)
    assert (dim.recipe().controller, signal.recipe().controller) == (Dim(), FixedTime())
    assert dim.reference("waiting_time_s", "all") is None
    recorded = dim.scenario.arrivals(0)
    assert np.array_equal(recorded.time, published_arrivals("4:1:4:1", 200, 4).time)


def test_own_arrivals_stand_beside_comparable_numbers_only() -> None:
    fts = Case(four_way(350, profile="as_run"), "fixed-time")
    assert fts.reference("waiting_time_s", "all") == 73.9598
    assert fts.reference_tolerance("waiting_time_s") is None, "not the same arrivals"
    unbalanced = Case(four_way(350, split=(4, 3, 2, 1), profile="as_run"), "fixed-time")
    assert unbalanced.reference("waiting_time_s", "all") is None, "5 s of green: not comparable"


@pytest.fixture(autouse=True)
def _in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs see what a test puts in place of SUMO."""
    monkeypatch.setattr(runs, "processes", ThreadPoolExecutor)


def result(case: Case, *pairs: Pair) -> Result:
    return Result(case, pairs, sumo="SUMO 1.0")


def test_own_laws_are_judged_by_means_and_the_same_law_trip_by_trip() -> None:
    fair = Case(four_way(profile="fair"), "dim")
    assert result(fair, pair()).hosts_agree
    assert not result(fair, Pair(1, OURS, trips([9] * 4, [50, 51, 52, 53], ALL))).hosts_agree
    none = trips([0.0] * 4, [50.0] * 4, [False] * 4)
    assert result(fair, Pair(1, none, none)).hosts_agree is None, "no trip ended"
    same = Case(four_way(profile="as_run"), "dim")
    assert not result(same, pair()).hosts_agree, "means agree, half of the trips do not"
    assert result(same, SAME).hosts_agree


def test_replays_are_judged_by_the_papers_means() -> None:
    cell = Cell("balanced", 150, 4)  # published: waiting 0.7084, travel 65.94
    case = Case(replay(*cell), "dim", cell)
    good = trips([0.75] * 4, [66.4] * 4, ALL)
    bad = trips([0.75] * 4, [66.6] * 4, ALL)
    judged = result(case, Pair(0, good, bad))
    assert judged.meets_paper("minisim") is True
    assert judged.meets_paper("sumo") is False
    assert summary([judged]) == (
        "0 of 1 cell: both hosts agree within the tolerances; minisim meets the paper in 1 of 1; "
        "SUMO meets the paper in 0 of 1; 1 verdict over fewer than 30 trips"
    )
    text = markdown([judged], "x", {})
    row = "| dim | 4 | balanced | 150 | 0.75 | 0.75 | 0.71 | 66.40 | 66.60 | 65.94 | 0.0 % | yes |"
    assert row in text
    drawn = result(Case(four_way(), "dim"), pair())
    assert drawn.meets_paper("minisim") is None
    assert "Against the paper" not in markdown([drawn], "x", {})


def test_a_run_that_fails_is_a_row(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def die(*_: object, **__: object) -> None:
        raise SumoError("SUMO's process died | after 3.0 s")

    monkeypatch.setattr("minisim.sumo.simulate", die)
    monkeypatch.setattr("importlib.metadata.version", lambda _: "1.0")
    case = Case(four_way(150, profile="fair", horizon=20), "dim")
    (failed,) = film(crossvalidate([case], [1, 2], folder=tmp_path))
    assert list(tmp_path.iterdir()) == [], "a run that fails is not kept"
    assert [(f.host, f.seed) for f in failed.failures] == [("sumo", 1), ("sumo", 2)]
    assert failed.hosts_agree is None, "what never ran is no disagreement"
    frame = table([failed])
    assert frame["error"].tolist() == ["SUMO's process died | after 3.0 s"] * 2
    text = markdown([failed], "minisim crossval", {})
    assert "| four-way balanced 150 dim | sumo | 1 | SUMO's process died \\| after 3.0 s |" in text
    assert "| four-way balanced 150 dim | 0 | – | – | 0 / 0 | – | – | – |" in text
    assert summary([failed]) == "no cell could be compared; 2 runs failed"
    good = result(Case(four_way(150), "dim"), pair())
    once = replace(failed, failures=failed.failures[:1])
    assert summary([good, once]).endswith(
        "; 1 cell could not be compared; 1 verdict over fewer than 30 trips; 1 run failed"
    )


def test_verdicts_over_few_trips_are_marked() -> None:
    case = Case(four_way(150, profile="fair"), "dim")
    few, many = result(case, pair()), result(case, *(pair(seed) for seed in range(10)))
    assert (few.trips, many.trips) == ((4, 3), (40, 30))
    assert (few.few, many.few) == (True, False)
    assert "| yes, few trips |" in markdown([few], "x", {})
    assert "few trips |" not in markdown([many], "x", {})


def test_cells_are_told_apart_by_their_fleets() -> None:
    mixed = "car:0.5/0.4/0.5/0.5,lcv:0.5/0.6/0.5/0.5"
    cases = [Case(four_way(300, profile="fair", fleet=it), "dim") for it in (None, "lcv", mixed)]
    assert [case.name.removeprefix("four-way balanced 300 ") for case in cases] == [
        "dim", "lcv dim", f"{mixed} dim",
    ]  # fmt: skip
    done = [result(case, pair()) for case in cases]
    assert table(done)["fleet"].unique().tolist() == [str(it.scenario.vehicles) for it in cases]
    files = [name for name, *_ in crossval_figures(done)]
    assert len({*files}) == len(files) >= 3
    assert not any("/" in name or ":" in name for name in files)


def test_sumos_runs_are_used_again(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    ran: list[int] = []

    def instead(scenario: Any, controller: Any, seed: int, **options: Any) -> Run:
        ran.append(seed)
        return simulate(scenario, controller, seed, **options)

    monkeypatch.setattr("minisim.sumo.simulate", instead)
    monkeypatch.setattr("importlib.metadata.version", lambda _: "1.0")
    case = Case(four_way(300, profile="fair", horizon=90), "dim")

    def agreement_of(what: Case) -> float:
        return crossvalidate([what], [1, 2], folder=tmp_path)[0].agreement

    assert agreement_of(case) == agreement_of(case) == 1.0
    assert sorted(ran) == [1, 2], "the second time nothing is run in SUMO"
    files = sorted((tmp_path / "sumo").iterdir())
    assert len(files) == 2
    files[0].write_bytes(b"PK half of a file")
    assert agreement_of(case) == 1.0
    assert len(ran) == 3, "what is not whole is run again"
    agreement_of(Case(case.scenario, "dim:gate=harmonious"))
    assert len(ran) == 5, "another controller is another run"


def test_a_fault_of_the_program_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(*_: object, **__: object) -> None:
        raise ZeroDivisionError("oops")

    monkeypatch.setattr(runs, "_run", wrong)
    (failed,) = crossvalidate([Case(four_way(150), "dim")], [1])
    assert [f.error for f in failed.failures] == ["ZeroDivisionError: oops"] * 2


def compared(monkeypatch: pytest.MonkeyPatch, simulate_instead: object) -> Result:
    """A short case with something else in place of SUMO."""
    monkeypatch.setattr("minisim.sumo.simulate", simulate_instead)
    case = Case(four_way(300, profile="fair", horizon=150), "dim")
    return film(crossvalidate([case], [1]))[0]


def test_a_host_that_does_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    same = compared(monkeypatch, simulate)
    assert (same.agreement, same.divergence, same.parting) == (1.0, None, None)
    assert "No trip differs: four-way balanced 300 dim." in markdown([same], "x", {})
    assert [n for n, _, _ in crossval_figures([same])] == ["trips_four-way_balanced_dim"]


def test_a_host_with_another_controller(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The harmonious gate lets vehicles go earlier; the report and a figure show the first."""

    def other(scenario: Any, _: object, seed: int, **options: Any) -> Run:
        return simulate(scenario, Dim(gate="harmonious"), seed, **options)

    result = compared(monkeypatch, other)
    assert 0.0 < result.agreement < 1.0
    assert result.parting is not None
    where = result.parting.time, result.parting.vehicle
    both = tuple(
        frame.set_index(["time_s", "vehicle"])["s_m"][where]
        for frame in (result.parting.minisim, result.parting.sumo)
    )
    assert both == result.parting.positions
    figures = {name: figure for name, _, figure in crossval_figures([result])}
    parting = figures["parting_four-way_balanced_300_dim"]
    assert [axes.get_ylabel() for axes in parting.axes] == [f"lane {lane} [m]" for lane in "abcd"]
    for name, figure in figures.items():
        save(figure, tmp_path / f"{name}.png")
    write_report([result], tmp_path, "minisim crossval", {f"{name}.png": name for name in figures})
    links = re.findall(r"\]\((.*?)\)", (tmp_path / "crossval.md").read_text())
    assert len(links) == 2
    assert all((tmp_path / link).is_file() for link in links)
    assert f"vehicle {where[1]} " in (tmp_path / "crossval.md").read_text()


def test_means_are_drawn_over_density() -> None:
    two = [result(Case(four_way(q, profile="fair"), "dim"), pair(1), pair(2)) for q in (350, 150)]
    figures = {name: figure for name, _, figure in crossval_figures(two)}
    waiting = figures["means_four-way_balanced_dim"].axes[0]
    lines = {bar.get_label(): bar.lines[0].get_xydata() for bar in waiting.containers}
    assert list(lines) == ["minisim", "SUMO"]
    assert lines["minisim"][:, 0].tolist() == [150 - DODGE / 2, 350 - DODGE / 2]
    assert lines["minisim"][:, 1].tolist() == [1.5, 1.5]


def test_without_sumo_the_install_command_is_told(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "libsumo", None)
    said = fails(capsys, "crossval", "--out", str(tmp_path / "new"))
    assert "pip install 'minisim-traffic[sumo]'" in said
    assert list(tmp_path.iterdir()) == []
