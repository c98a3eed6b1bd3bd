"""The fixed-time signal: its timing, its schedule to the step, and what drivers do at amber."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import minisim
from baselines import FixedTime
from baselines.signals.fixed_time import Program, Programs
from baselines.signals.heads import Colour
from baselines.signals.webster import MIN_GREEN, webster
from minisim import simulate
from minisim.control import Command, Session, Site, View, Wake
from minisim.demand import DemandProfile, Period
from minisim.errors import InputError
from minisim.results.safety import safety_summary
from minisim.testing import drained, small_scenario
from minisim.vehicle import VehicleType
from scenarios import Scenario
from scenarios.library import four_way
from tests.builders import ScriptedSession, drive, replayed, said, seen

SITE = four_way(density=250).site()


def test_by_default_it_is_websters_signal_with_the_lost_time_as_amber() -> None:
    assert FixedTime().timing(SITE) == webster([250.0] * 4)


def test_webster_knows_the_amber_and_the_all_red() -> None:
    """L = 4 × (4 + 2) s: C0 = (1.5 × 24 + 5)/(1 − 800/1500)."""
    timing = FixedTime(amber=4.0, all_red=2.0).timing(four_way(density=200).site())
    assert timing.cycle == pytest.approx(41.0 / (1.0 - 800 / 1500))
    assert timing.greens == pytest.approx(((timing.cycle - 24.0) / 4,) * 4)


def test_a_lost_time_of_its_own_moves_green_to_where_vehicles_leave() -> None:
    """Webster: green and amber shown are the effective green and the lost time."""
    timing = FixedTime(amber=3.0, lost_time=2.0).timing(SITE)
    assert timing.cycle == pytest.approx(51.0)
    assert timing.greens == pytest.approx((9.75,) * 4)  # 10.75 s are effective
    assert timing.saturation == pytest.approx(FixedTime().timing(SITE).saturation)
    empty = FixedTime(amber=9.0, lost_time=2.0).timing(four_way(density=0).site())
    assert min(empty.greens) >= MIN_GREEN


def test_the_longest_cycle_of_an_over_saturated_junction_holds_all_that_is_shown() -> None:
    site = small_scenario(5, density=350).site(0)
    timing = FixedTime(amber=4.0, all_red=2.0, max_cycle=150.0).timing(site)
    assert timing.capped
    assert timing.cycle == pytest.approx(150.0)


def test_a_textbooks_signal() -> None:
    """Khanna & Justo, Highway Engineering: two phases, amber 2 s, 12 s of all-red in a cycle.

    Flows of 400 and 250 pcu/h at saturation flows of 1250 and 1000 (here at 1000) give a cycle of
    67.5 s and greens of 28.9 and 22.5 s.
    """
    junction = SimpleNamespace(n=2, approaches=(0, 1))
    site: Any = SimpleNamespace(intersection=junction, demand=(320.0, 250.0))
    timing = FixedTime(saturation_flow=1000.0, amber=2.0, all_red=6.0).timing(site)
    assert timing.cycle == pytest.approx(67.5, abs=0.1)
    assert timing.greens == pytest.approx((28.9, 22.5), abs=0.1)


def test_greens_may_be_one_number_or_one_per_lane() -> None:
    same = FixedTime(greens=8).timing(SITE)
    assert (same.greens, same.capped) == ((8.0,) * 4, False)
    each = FixedTime(greens=(5, 6, 7, 8)).timing(SITE)
    assert (each.greens, each.cycle) == ((5.0, 6.0, 7.0, 8.0), 26.0 + 8.0)


def test_unbalanced_demand_has_proportional_or_equal_greens() -> None:
    site = four_way(density=250, split=(4, 3, 2, 1)).site()
    fair, equal = FixedTime().timing(site), FixedTime(equal_greens=True).timing(site)
    assert np.array(fair.greens) / sum(fair.greens) == pytest.approx([0.4, 0.3, 0.2, 0.1])
    assert equal.greens == pytest.approx((10.75,) * 4)


@pytest.mark.parametrize("greens", [0, True, "10", (5, -1, 5, 5)])
def test_bad_greens_are_a_clear_error(greens: Any) -> None:
    with pytest.raises(InputError, match="green"):
        FixedTime(greens=greens)


def test_a_site_that_it_cannot_serve_is_a_clear_error() -> None:
    with pytest.raises(InputError, match="3 values for 4 lanes"):
        FixedTime(greens=(5, 6, 7)).start(SITE)
    with pytest.raises(InputError, match="max_cycle"):
        FixedTime(max_cycle=10).start(SITE)


def test_each_lane_is_open_in_turn_and_the_cycle_begins_with_a() -> None:
    assert drive(FixedTime(greens=(4, 5, 6, 7), amber=2.0, all_red=1.0), SITE, 35.0) == {
        0: ["Open 0"], 4: ["Close 0"], 7: ["Open 1"], 12: ["Close 1"], 15: ["Open 2"],
        21: ["Close 2"], 24: ["Open 3"], 31: ["Close 3"], 34: ["Open 0"],
    }  # fmt: skip


@pytest.mark.parametrize("dt", [0.1, 0.25, 0.03])
def test_no_cycle_drifts_by_more_than_a_step(dt: float) -> None:
    green, cycle = 5.083, 4 * 7.083
    answers = drive(FixedTime(greens=green), replace(SITE, dt=dt), 3600.0)
    opened = [time for time, commands in answers.items() if "Open 0" in commands]
    closed = [time for time, commands in answers.items() if "Close 0" in commands]
    assert len(opened) == 3600 // cycle + 1
    for k, (start, end) in enumerate(zip(opened, closed, strict=False)):
        # At the first step that is less than half a step before its time.
        assert -dt / 2 - 1e-6 <= start - k * cycle <= dt + 1e-6
        assert -dt / 2 - 1e-6 <= end - (k * cycle + green) <= dt + 1e-6


@dataclass(frozen=True)
class Restless:
    """A signal that every vehicle that clears the junction wakes."""

    signal: FixedTime
    name: str = "restless"

    def start(self, site: Site) -> Session:
        session = self.signal.start(site)

        def decide(view: View) -> Iterable[Command]:
            answer = session.decide(view)
            return [Wake(it.time) if isinstance(it, Wake) else it for it in answer]

        return ScriptedSession(session.plan, decide)


@pytest.mark.parametrize("density", [150, 350])
@pytest.mark.parametrize(
    ("signal", "profile"),
    [
        (FixedTime(), "fair"),
        (FixedTime(greens=7.04), "fair"),
        (FixedTime(), "as_run_signals"),
        (FixedTime(facing=True), "fair"),  # vehicles that turn are never left alone
    ],
)
def test_it_misses_nothing_while_it_is_undisturbed(
    signal: FixedTime, profile: str, density: float
) -> None:
    scenario = four_way(density, profile=profile, horizon=600.0)
    ours, restless = (simulate(scenario, it, 2) for it in (signal, Restless(signal)))
    assert ours.trips.equals(restless.trips)
    asked = [run.exchange["decisions"] for run in (ours, restless)]
    assert asked[0] == asked[1] if signal.facing else asked[0] < 0.8 * asked[1]


@pytest.mark.parametrize(("early", "due"), [(1e-9, True), (0.04, True), (0.06, False)])
def test_a_switch_less_than_half_a_step_away_is_due(early: float, due: bool) -> None:
    session = FixedTime(greens=10.0).start(four_way().site())
    session.decide(View(0.0, ()))
    expected = ["Close 0", "Wake 12"] if due else ["Wake 10"]
    assert said(session.decide(View(10.0 - early, ()))) == expected


def test_a_late_head_still_ends_on_time() -> None:
    session = FixedTime(greens=10.0, amber=2.0).start(four_way().site())
    crossing = seen(3, 0, 2, -5.0, 5.0)
    session.decide(View(0.0, ()))
    session.decide(View(10.0, (crossing,)))
    # b's green is due at 12 s, but a2 stands in the junction until 15 s.
    assert said(session.decide(View(12.0, (crossing,)))) == ["Wake 22"]
    later = copy.deepcopy(session)
    assert said(session.decide(View(15.0, ()))) == ["Open 1", "Wake 22"]
    assert said(session.decide(View(22.0, ()))) == ["Close 1", "Wake 24"]
    # Or until after its time: no vehicle of b got the right of way, so none is let go then.
    waiting = seen(4, 1, 2, 0.3, 1.5)
    assert said(later.decide(View(22.0, (crossing, waiting)))) == ["Wake 24"]


def test_at_amber_only_vehicles_that_cannot_stop_keep_going() -> None:
    session = FixedTime(greens=10.0).start(four_way(profile="fair").site())
    session.decide(View(0.0, ()))
    near, far = seen(3, 0, 2, 12.0, 14.0), seen(4, 0, 2, 30.0, 14.0)
    assert said(session.decide(View(10.0, (near, far)))) == ["Close 0", "Go 3", "Wake 12"]


@pytest.mark.parametrize("start", np.arange(0.0, 6.0, 0.6).tolist())
def test_at_amber_a_vehicle_either_passes_or_stops_comfortably(start: float) -> None:
    # Green a: 0 … 37 s. Free flow takes 487.8/14 = 34.8 s to the stop line, so that these
    # vehicles are up to 47 m before it or past it at the end of the green.
    scenario = replayed(four_way(profile="fair"), (start, 0, 2), horizon=100.0)
    run = minisim.simulate(scenario, FixedTime(greens=37.0, amber=2.0), record="all")
    path = run.site.intersection.paths[1]
    frame = run.trajectories
    braking = -frame.loc[frame["s_m"] < path.entry, "acceleration_mps2"].min()
    distance = path.entry - frame.loc[frame["time_s"] == 37.0, "s_m"].iloc[0]
    if distance < 14.0**2 / 9.0 + 0.5:
        assert frame["speed_mps"].min() > 6.0
        assert braking < 1e-6
    else:
        stopped = frame.loc[frame["speed_mps"] == 0.0, "s_m"]
        assert len(stopped) > 0
        assert 0.0 < path.entry - stopped.max() <= 0.3
        # At most comfortable, but for the few centimetres from the margin to where it stops.
        assert 4.0 < braking <= 4.5 * 1.01


def test_greens_on_the_road_are_where_the_timing_puts_them() -> None:
    signal = FixedTime(greens=(6.0, 9.0, 12.0, 7.5), amber=2.0)
    run = minisim.simulate(four_way(density=300, horizon=300.0), signal, seed=3, record="junction")
    frame = run.trajectories
    waiting = frame[frame["s_m"] < run.site.intersection.approach_length - 40.0]
    released = waiting[waiting["right_of_way"]]
    cycle = signal.timing(run.site).cycle
    for lane, start, green in (("a", 0, 6.0), ("b", 8, 9.0), ("c", 19, 12.0), ("d", 33, 7.5)):
        times = released.loc[released["lane"] == lane, "time_s"]
        # A step shows what was decided before it; a head may turn late, never early.
        assert ((times - start) % cycle).max() <= green + 0.1 + 1e-6
        assert len(times) > 30


def test_drivers_of_different_speeds_are_served_without_collision() -> None:
    scenario = drained(4, density=350, vehicle=VehicleType(speed_deviation=0.3))
    run = minisim.simulate(scenario, FixedTime(), seed=2, record="junction")
    assert run.summary()["unfinished"] == 0
    assert (safety_summary(run.trajectories, run.site)["min_pet_s"] or 0.0) > 0.0


def test_waiting_grows_with_the_red() -> None:
    # Little traffic and a long cycle: the mean wait tends to red²/2C of the uniform arrivals.
    # Accelerating and braking take the rest of the delay; 15 % covers the sample.
    green, cycle = 30.0, 4 * 32.0
    scenario = four_way(density=60, profile="fair", horizon=20_000.0)
    waiting = minisim.simulate(scenario, FixedTime(greens=green), 1).summary()["waiting_time_s"]
    red = cycle - green
    assert waiting == pytest.approx(red * red / (2 * cycle), rel=0.15)


def day(*rates: float, length: int = 3600) -> Scenario:
    """Periods of this length, in which lane a has these inflows and all others 100 veh/h."""
    starts = range(0, length * len(rates), length)
    periods = [Period(start=s, end=s + length, rates=(r, 100.0, 100.0, 100.0))
               for s, r in zip(starts, rates, strict=True)]  # fmt: skip
    return four_way(demand=DemandProfile(periods=tuple(periods)), profile="fair")


def test_each_plan_has_websters_greens_for_the_demand_of_its_time() -> None:
    site = day(100.0, 700.0, 300.0).site()
    signal = FixedTime(plans=7200)
    for timing, rate in zip(signal.timings(site), (400.0, 300.0), strict=True):
        alone = replace(site, demand=(rate, 100.0, 100.0, 100.0), inflow=None)
        assert timing == FixedTime().timing(alone)
    assert FixedTime().timings(site) == [FixedTime().timing(site)]
    assert len(FixedTime(plans=7200).timings(replace(site, inflow=None))) == 1


def test_a_plan_begins_when_the_cycle_before_it_ends() -> None:
    turns = (0,), (1,)
    cycle = Program(turns, (10.0, 20.0), 2.0, 0.0), Program(turns, (30.0, 5.0), 2.0, 0.0)
    programs = Programs(cycle, 100.0)  # cycles of 34 s, then 39 s: the second begins at 102 s
    assert programs.colours(99.0) == [Colour.RED, Colour.GREEN] == cycle[0].colours(99.0)
    assert programs.colours(101.0) == [Colour.RED, Colour.AMBER]
    assert programs.next_switch(101.0) == 102.0
    assert programs.colours(102.0) == [Colour.GREEN, Colour.RED]
    assert programs.next_switch(102.0) == 132.0
    assert programs.colours(102.0 + 39.0 * 50 + 33.0) == cycle[1].colours(33.0)


def test_plans_shorter_than_a_cycle_are_left_out() -> None:
    turns = (0,), (1,)
    long, short = Program(turns, (100.0, 100.0), 2.0, 0.0), Program(turns, (5.0, 5.0), 2.0, 0.0)
    programs = Programs([long, short, short, short, long], 60.0)
    assert programs.next_switch(203.0) == 204.0  # the fourth begins: its 180 … 240 s hold 204 s
    assert programs.colours(204.0 + 6.0) == [Colour.AMBER, Colour.RED]


def test_plans_of_a_constant_demand_change_nothing() -> None:
    always = day(200.0, 200.0, 200.0, length=600)
    runs = [simulate(always, FixedTime(plans=plans), 1) for plans in (None, 600.0)]
    assert runs[0].trips.equals(runs[1].trips)
    with pytest.raises(InputError, match="plans has an effect only with Webster's greens"):
        FixedTime(greens=20, plans=600)
