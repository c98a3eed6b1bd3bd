"""The fixed-time signal: its timing, its schedule to the step, and what drivers do at amber."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import minisim
from baselines import FixedTime
from baselines.signals.webster import webster
from minisim.arrivals import Arrivals
from minisim.control import Command, Observed, View, Wake
from minisim.errors import InputError
from minisim.results.safety import safety_summary
from minisim.testing import SmallScenario, drained, small_scenario
from minisim.vehicle import VehicleType
from scenarios.library import four_way

# Timing.


def test_by_default_it_is_websters_signal_with_the_lost_time_as_amber() -> None:
    site = four_way(density=250).site()

    timing = FixedTime().timing(site)

    assert timing == webster([250.0] * 4)
    assert timing.cycle == pytest.approx(51.0)
    assert timing.greens == pytest.approx((10.75,) * 4)


def test_the_cycle_counts_what_is_really_lost() -> None:
    site = four_way(density=250).site()
    timing = FixedTime(amber=3.0, all_red=1.0).timing(site)

    assert timing.greens == pytest.approx((10.75,) * 4)
    assert timing.cycle == pytest.approx(4 * (10.75 + 4.0))
    assert timing.saturation == pytest.approx((250 * 59 / (1500 * 10.75),) * 4)


def test_greens_may_be_one_number_or_one_a_lane() -> None:
    site = four_way(density=250).site()
    assert FixedTime(greens=8).timing(site).greens == (8.0,) * 4
    assert FixedTime(greens=(5, 6, 7, 8)).timing(site).greens == (5.0, 6.0, 7.0, 8.0)
    assert FixedTime(greens=(5, 6, 7, 8)).timing(site).cycle == 26.0 + 8.0
    assert not FixedTime(greens=8).timing(site).capped


def test_unbalanced_demand_has_proportional_or_equal_greens() -> None:
    site = four_way(density=250, split=(4, 3, 2, 1)).site()
    fair, equal = FixedTime().timing(site), FixedTime(equal_greens=True).timing(site)

    assert np.array(fair.greens) / sum(fair.greens) == pytest.approx([0.4, 0.3, 0.2, 0.1])
    assert equal.greens == pytest.approx((10.75,) * 4)
    assert equal.saturation[0] == pytest.approx(1.27, abs=0.006)


def test_an_over_saturated_junction_has_a_capped_cycle() -> None:
    timing = FixedTime(max_cycle=120.0).timing(small_scenario(5, density=350).site(0))
    assert timing.capped
    assert timing.cycle == pytest.approx(120.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"greens": 0}, "green"),
        ({"greens": True}, "green"),
        ({"greens": "10"}, "greens"),
        ({"greens": (5, -1, 5, 5)}, "green"),
        ({"amber": -1}, "amber"),
        ({"amber": None}, "amber"),
        ({"all_red": float("inf")}, "all_red"),
        ({"saturation_flow": 0}, "saturation_flow"),
        ({"lost_time": -2}, "lost_time"),
        ({"equal_greens": 1}, "equal_greens"),
        ({"max_cycle": 0}, "max_cycle"),
    ],
)
def test_bad_arguments_are_clear_errors(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        FixedTime(**arguments)


def test_a_site_that_it_cannot_serve_is_a_clear_error() -> None:
    site = four_way(density=250).site()
    with pytest.raises(InputError, match="3 values for 4 lanes"):
        FixedTime(greens=(5, 6, 7)).start(site)
    with pytest.raises(InputError, match="max_cycle"):
        FixedTime(max_cycle=10).start(site)
    with pytest.raises(InputError, match="site must be a Site"):
        FixedTime().start("four-way")  # type: ignore[arg-type]


# Schedule.


def said(commands: Iterable[Command]) -> list[str]:
    """Commands in words; as a reader would say it."""
    return [f"{type(command).__name__} {dataclasses.astuple(command)[0]:g}" for command in commands]


def drive(signal: FixedTime, until: float, dt: float = 0.1) -> dict[float, list[str]]:
    """Commands by time of a session that a host with step `dt` wakes; nobody is around."""
    session = signal.start(replace(four_way(density=250).site(), dt=dt))
    answers: dict[float, list[str]] = {}
    tick = 0
    while tick * dt < until:
        commands = list(session.decide(View(tick * dt, ())))
        (wake,) = [c for c in commands if isinstance(c, Wake)]
        answers[round(tick * dt, 6)] = said(c for c in commands if c is not wake)
        tick, before = int(np.ceil(wake.time / dt - 1e-6)), tick
        assert tick > before
    return answers


def test_each_lane_is_open_in_turn_and_the_cycle_begins_with_a() -> None:
    answers = drive(FixedTime(greens=(4, 5, 6, 7), amber=2.0, all_red=1.0), 35.0)
    assert {time: commands for time, commands in answers.items() if commands} == {
        0: ["Open 0"], 4: ["Close 0"], 7: ["Open 1"], 12: ["Close 1"], 15: ["Open 2"],
        21: ["Close 2"], 24: ["Open 3"], 31: ["Close 3"], 34: ["Open 0"],
    }  # fmt: skip


@pytest.mark.parametrize("dt", [0.1, 0.25, 0.03])
def test_no_cycle_drifts_by_more_than_a_step(dt: float) -> None:
    green, cycle = 5.083, 4 * 7.083
    answers = drive(FixedTime(greens=green), 3600.0, dt)

    opened = [time for time, commands in answers.items() if "Open 0" in commands]
    closed = [time for time, commands in answers.items() if "Close 0" in commands]
    assert len(opened) == 3600 // cycle + 1
    for k, (start, end) in enumerate(zip(opened, closed, strict=False)):
        # At the first step that is less than half a step before its time.
        assert -dt / 2 - 1e-6 <= start - k * cycle <= dt + 1e-6
        assert -dt / 2 - 1e-6 <= end - (k * cycle + green) <= dt + 1e-6


@pytest.mark.parametrize(("early", "due"), [(1e-9, True), (0.04, True), (0.06, False)])
def test_a_switch_less_than_half_a_step_away_is_due(early: float, due: bool) -> None:
    session = FixedTime(greens=10.0).start(four_way().site())
    session.decide(View(0.0, ()))
    expected = ["Close 0", "Wake 12"] if due else ["Wake 10"]
    assert said(session.decide(View(10.0 - early, ()))) == expected


def test_a_late_head_still_ends_on_time() -> None:
    session = FixedTime(greens=10.0, amber=2.0).start(four_way().site())
    crossing = Observed(3, 0, 2, -5.0, 5.0, 4.0)
    session.decide(View(0.0, ()))
    session.decide(View(10.0, (crossing,)))

    # b's green is due at 12 s, but a2 stands in the junction until 15 s.
    assert said(session.decide(View(12.0, (crossing,)))) == ["Wake 22"]
    assert said(session.decide(View(15.0, ()))) == ["Open 1", "Wake 22"]
    assert said(session.decide(View(22.0, ()))) == ["Close 1", "Wake 24"]


def test_a_head_that_could_not_turn_green_stays_red() -> None:
    session = FixedTime(greens=10.0, amber=2.0).start(four_way().site())
    crossing = Observed(3, 0, 2, -5.0, 0.0, 4.0)
    session.decide(View(0.0, ()))
    session.decide(View(10.0, (crossing,)))
    session.decide(View(12.0, (crossing,)))

    # Nobody of lane b got a right of way, so nobody is let go when its time is over.
    waiting = Observed(4, 1, 2, 0.3, 1.5, 4.0)
    assert said(session.decide(View(22.0, (crossing, waiting)))) == ["Wake 24"]


def test_at_amber_only_those_who_cannot_stop_keep_going() -> None:
    session = FixedTime(greens=10.0).start(four_way(profile="fair").site())
    session.decide(View(0.0, ()))
    near, far = Observed(3, 0, 2, 12.0, 14.0, 5.0), Observed(4, 0, 2, 30.0, 14.0, 5.0)
    assert said(session.decide(View(10.0, (near, far)))) == ["Close 0", "Go 3", "Wake 12"]


# On the road.


@dataclass(frozen=True, kw_only=True)
class OneVehicle(SmallScenario):
    """One vehicle, a2, that comes at `start`."""

    start: float = 0.0

    def arrivals(self, seed: int) -> Arrivals:
        return Arrivals(np.array([self.start]), np.array([0]), np.array([2]))


@pytest.mark.parametrize("start", np.arange(0.0, 6.0, 0.3).tolist())
def test_at_amber_a_vehicle_either_passes_or_stops_comfortably(start: float) -> None:
    # Green a: 0 … 37 s. Free flow takes 487.8/14 = 34.8 s to the stop line, so that these
    # vehicles are up to 47 m before it or past it at the end of the green.
    scenario = OneVehicle(start=start, demand_time=70.0)
    run = minisim.simulate(scenario, FixedTime(greens=37.0, amber=2.0), record="all")

    path = run.site.intersection.paths[1]
    frame = run.trajectories
    braking = -frame.loc[frame["s_m"] < path.entry, "acceleration_mps2"].min()
    at_amber = frame.loc[frame["time_s"] == 37.0].iloc[0]
    distance = path.entry - at_amber["s_m"]
    passes = distance < 0.0 or distance < 14.0**2 / 9.0 + 0.5
    if passes:
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
    worst = safety_summary(run.trajectories, run.site)["min_pet_s"]
    assert worst is not None
    assert worst > 0.0


def test_waiting_grows_with_the_red() -> None:
    # Little traffic and a long cycle: the mean wait tends to red²/2C of the uniform arrivals.
    # Accelerating and braking take the rest of the delay; 15 % covers the sample.
    green, cycle = 30.0, 4 * 32.0
    run = minisim.simulate(
        four_way(density=60, profile="fair", horizon=20_000.0), FixedTime(greens=green), seed=1
    )
    red = cycle - green
    waiting = run.summary()["waiting_time_s"]
    assert waiting == pytest.approx(red * red / (2 * cycle), rel=0.15)
