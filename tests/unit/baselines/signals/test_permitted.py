"""Permitted turns: who yields, which gaps are taken, and the manual's saturation flow."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import numpy.typing as npt
import pytest

import minisim
from baselines import FixedTime, MaxPressure
from baselines.signals.heads import Colour
from baselines.signals.permitted import CRITICAL_GAP, FOLLOW_UP, PermittedHeads, travel_time
from minisim.control import Observed
from minisim.errors import InputError
from scenarios.library import four_way, regular
from tests.builders import car, replayed, said, view

SITE = four_way(profile="fair").site()  # left-hand traffic: a3 is a far turn, and waits for c1, c2
RED, AMBER, GREEN = Colour.RED, Colour.AMBER, Colour.GREEN
ALONG, ACROSS, ALL_RED = (GREEN, RED, GREEN, RED), (RED, GREEN, RED, GREEN), (RED,) * 4

#: Standing at the line.
waiting = partial(car, distance=0.25)
LIMIT = 14.0


def heads() -> PermittedHeads:
    """Heads that show green to a and c, with no vehicle around."""
    made = PermittedHeads(SITE, "test")
    made.show(view(), ALONG)
    return made


def told(
    it: PermittedHeads, *vehicles: Observed, time: float = 10.0, wanted: tuple[Colour, ...] = ALONG
) -> list[str]:
    return said(it.show(view(*vehicles, time=time), wanted))


def test_vehicles_that_need_not_yield_go_at_once() -> None:
    assert told(heads(), car(1, "a2", 40, 14.0), car(2, "c1", 30, 14.0), car(3, "b2", 0.3)) == [
        "Go 1", "Go 2",
    ]  # fmt: skip


def test_a_far_turn_goes_if_none_comes_or_all_turn_likewise() -> None:
    assert told(heads(), waiting(1, "a3")) == ["Go 1"]
    assert told(heads(), waiting(1, "a3"), waiting(2, "c3")) == ["Go 1", "Go 2"]


@pytest.mark.parametrize("gap", [CRITICAL_GAP - 0.1, CRITICAL_GAP + 0.1])
def test_a_far_turn_takes_the_critical_gap(gap: float) -> None:
    """The conflict zone of c2 with a3 begins 5 m inside the junction."""
    coming = car(2, "c2", gap * LIMIT - 5.0, LIMIT)
    taken = gap > CRITICAL_GAP
    assert told(heads(), waiting(1, "a3"), coming) == (["Go 1"] if taken else ["Go 2"])


def test_a_vehicle_that_is_just_past_begins_the_gap() -> None:
    coming = car(2, "c2", (CRITICAL_GAP - 0.5) * LIMIT - 5.0, LIMIT)
    past = car(3, "c2", -17.0, LIMIT)  # its front was at the zone 0.86 s ago
    assert "Go 1" in told(heads(), waiting(1, "a3"), coming, past)
    assert "Go 1" not in told(heads(), waiting(1, "a3"), coming)
    crossing = car(3, "c2", -13.0, LIMIT)
    assert "Go 1" not in told(heads(), waiting(1, "a3"), coming, crossing)


def test_one_that_can_no_longer_stop_is_awaited_however_slow_it_may_be() -> None:
    site = four_way(profile="paper").site()  # which brakes at 2 m/s²
    it = PermittedHeads(site, "test")
    it.show(view(), ALONG)
    far = (CRITICAL_GAP + 0.5) * 20.0
    assert "Go 1" not in told(it, waiting(1, "a3"), car(2, "c2", far, 20.0))


def test_those_behind_one_that_waits_do_not_come() -> None:
    waits, behind = waiting(2, "c3"), car(3, "c2", 7.75)
    blocking = car(4, "a2", 30.0, LIMIT)
    assert told(heads(), waiting(1, "a3"), waits, behind) == ["Go 1", "Go 2"]
    assert told(heads(), car(1, "a3", 90.0, LIMIT), blocking, waits, behind) == ["Go 4"]


def test_two_of_a_lane_take_a_gap_no_sooner_than_they_can_follow() -> None:
    it, far = heads(), car(9, "c2", 90.0, LIMIT)
    assert "Go 1" in told(it, waiting(1, "a3"), far, time=10.0)
    first, second = car(1, "a3", -6.0, 5.0), car(2, "a3", 1.0, 1.0)
    assert "Go 2" not in told(it, first, second, far, time=10.0 + FOLLOW_UP - 0.2)
    assert "Go 2" in told(it, first, second, far, time=10.0 + FOLLOW_UP)


def test_an_oncoming_vehicle_loses_its_right_of_way_while_it_can_stop() -> None:
    """To the turning vehicle, which is not out of its way in time at its present speed."""
    it = heads()
    assert told(it, waiting(1, "a3"), car(2, "c2", 80.0, LIMIT)) == ["Go 1"]
    slow, quick = car(1, "a3", -5.0, 1.0), car(1, "a3", -13.0, 7.0)
    assert told(it, quick, car(2, "c2", 25.0, LIMIT)) == ["Go 2"]
    assert told(it, slow, car(2, "c2", 25.0, LIMIT)) == ["Hold 2"]
    assert told(it, slow, car(2, "c2", 24.0, LIMIT), car(3, "c2", 40.0, LIMIT)) == []
    assert told(it, car(2, "c2", 23.0, LIMIT), car(3, "c2", 39.0, LIMIT)) == ["Go 2", "Go 3"]


@pytest.mark.parametrize("place", [-17.0, -22.0])  # it has left the junction at −18.8 m
def test_a_turning_vehicle_counts_as_no_faster_than_the_one_ahead(place: float) -> None:
    it = heads()
    told(it, waiting(1, "a3"))
    crawling = car(7, "a3", place, 0.5)
    assert told(it, car(1, "a3", -12.0, 7.0), car(2, "c2", 22.0, LIMIT)) == ["Go 2"]
    assert told(it, crawling, car(1, "a3", -12.0, 7.0), car(2, "c2", 22.0, LIMIT)) == ["Hold 2"]


def test_a_vehicle_for_the_same_exit_follows_when_the_turning_one_has_left() -> None:
    it = heads()
    told(it, waiting(1, "a3"))
    assert told(it, car(1, "a3", -18.0, 7.0), car(2, "c1", 30.0, LIMIT)) == []
    assert told(it, car(2, "c1", 29.0, LIMIT)) == ["Go 2"]


def test_at_the_end_of_green_what_waits_at_the_line_still_goes_before_the_others() -> None:
    it = heads()
    close = car(2, "c2", 5.0, LIMIT)
    assert told(it, waiting(1, "a3"), close, car(3, "a2", 7.75), car(4, "b2", 0.25)) == ["Go 2"]
    assert told(it, waiting(1, "a3"), close, car(4, "b2", 0.25), wanted=ALL_RED) == []
    assert told(it, waiting(1, "a3"), car(2, "c2", -10.0, LIMIT), wanted=ACROSS) == []
    assert it.colours[1] is RED
    assert told(it, waiting(1, "a3"), car(4, "b2", 0.25), wanted=ACROSS) == ["Go 1"]
    assert told(it, car(1, "a3", -9.0, 6.0), car(4, "b2", 0.25), wanted=ACROSS) == []
    assert told(it, car(4, "b2", 0.25), wanted=ACROSS) == ["Go 4"]


def test_at_the_end_of_green_vehicles_that_can_stop_are_held() -> None:
    it = heads()
    told(it, car(1, "a2", 20.0, LIMIT), car(2, "a2", 40.0, LIMIT), car(3, "c3", 30.0, LIMIT))
    assert told(it, car(1, "a2", 18.0, LIMIT), car(2, "a2", 38.0, LIMIT), wanted=ALL_RED) == [
        "Hold 2"
    ]


def test_it_looks_until_the_way_of_a_head_that_should_be_green_is_clear() -> None:
    it = heads()
    told(it, car(1, "a2", 5.0, LIMIT))
    assert told(it, car(1, "a2", -12.0, LIMIT), time=11.0, wanted=ACROSS) == []
    assert it.next_look == pytest.approx(11.2)
    told(it, car(1, "a2", -19.5, LIMIT), time=11.2, wanted=ACROSS)
    assert it.colours == list(ACROSS)
    assert it.next_look == math.inf


def test_a_vehicle_behind_the_junction_keeps_no_head_red() -> None:
    it = heads()
    assert told(it, car(1, "a3", -22.0, 7.0), car(4, "b2", 0.25), wanted=ACROSS) == ["Go 4"]
    assert it.next_look == math.inf


def test_it_looks_often_only_while_a_vehicle_may_have_to_wait() -> None:
    it = heads()
    told(it, car(1, "a2", 40, 14.0), time=10.0)
    assert it.next_look == math.inf
    told(it, car(1, "a3", 40, 14.0), time=10.0)
    assert it.next_look == pytest.approx(10.2)


def test_an_approach_that_faces_none_has_an_ordinary_head() -> None:
    it = PermittedHeads(regular(3, profile="fair").site(), "test")
    assert said(it.show(view(car(1, "a2", 20.0, LIMIT)), (GREEN, RED, RED))) == ["Open 0"]
    assert said(it.show(view(car(1, "a2", 5.0, LIMIT)), (RED,) * 3)) == ["Close 0", "Go 1"]


@pytest.mark.parametrize("controller", [FixedTime(facing=True), MaxPressure(facing=True)])
def test_vehicles_for_which_no_signal_is_safe_are_refused(controller: FixedTime) -> None:
    site = four_way(profile="as_run").site()
    with pytest.raises(InputError, match=f"{controller.name} is for vehicles of the models"):
        controller.start(site)


def turning(
    flow: float, seconds: float, greens: tuple[float, ...]
) -> tuple[npt.NDArray[np.float64], ...]:
    """When far turns from a queue on lane a, and a random flow straight on from c, arrived [s].

    The flow is in veh/h. Neither is slower behind the junction, so the gaps are those in it.
    """
    rng = np.random.default_rng(1)
    times = np.cumsum(rng.exponential(3600.0 / flow, int(flow * seconds / 3600.0)))
    trips = [(2.0 * k, 0, 3) for k in range(int(seconds / 2.0))]
    trips += [(float(t), 2, 2) for t in times if t < seconds]
    scenario = replayed(four_way(profile="fair"), *trips, horizon=seconds)
    run = minisim.simulate(scenario, FixedTime(greens=greens, facing=True))
    arrivals = (run.trips[run.trips["lane"] == lane]["arrival_s"].dropna() for lane in "ac")
    return tuple(np.sort(t[t > 300.0].to_numpy()) for t in arrivals)


def permitted(flow: float) -> float:
    """The permitted saturation flow of HCM 2010, chapter 31 [veh/h]."""
    q = flow / 3600.0
    return flow * math.exp(-q * CRITICAL_GAP) / (1.0 - math.exp(-q * FOLLOW_UP))


def test_the_manuals_permitted_saturation_flow() -> None:
    """At 200 veh/h the HCM has 1200 veh/h; ours is within 3 %."""
    went, came = turning(200.0, 2400.0, (3600.0, 0.5, 3600.0, 0.5))
    hours = 2100.0 / 3600.0
    assert len(went) / hours == pytest.approx(permitted(len(came) / hours), rel=0.03)


def test_more_traffic_is_less_random_on_one_lane_and_its_own_gaps_are_used() -> None:
    """Vehicles that follow each other leave fewer gaps than the manual's random ones."""
    went, came = turning(600.0, 1500.0, (3600.0, 0.5, 3600.0, 0.5))
    gaps = np.diff(came)
    fit = np.floor((gaps[gaps >= CRITICAL_GAP] - CRITICAL_GAP) / FOLLOW_UP) + 1.0
    assert len(went) == pytest.approx(fit.sum(), rel=0.12)
    assert fit.sum() < permitted(len(came) * 3.0) / 3.0


def test_without_gaps_one_goes_at_the_end_of_each_green() -> None:
    """A sneaker; those of the manual that wait inside the junction would be two."""
    went, _ = turning(1700.0, 700.0, (26.0, 0.5, 26.0, 0.5))
    cycles = np.bincount((went // 30.5).astype(int))[10:-1]
    assert np.median(cycles) == 1


def test_least_times() -> None:
    assert travel_time(-1.0, 3.0, 2.0, 10.0) == 0.0
    assert travel_time(25.0, 0.0, 2.0, 10.0) == 5.0
    assert travel_time(45.0, 0.0, 2.0, 10.0) == 7.0
    assert travel_time(30.0, 15.0, 2.0, 10.0) == 2.0
