"""Lane priorities that change with time: by hand, and the same for all vehicles."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import minisim
from dim import Dim, Zones
from dim.controller import DimSession
from dim.priorities import SAME_TIME, TURN_TIME, PassingTimes, longest_waiting, memory_of, rotating
from minisim.control import Command, Site, View
from minisim.errors import InputError
from scenarios import four_way
from scenarios.strategies import scenarios
from tests.builders import digest, drained, replayed, said, seen


def test_turns_follow_the_clock() -> None:
    assert [rotating(t, 4, 10.0) for t in (0.0, 9.9, 10.0, 20.0, 30.0, 40.0)] == [
        ((0, 1, 2, 3), 10.0), ((0, 1, 2, 3), 10.0), ((3, 0, 1, 2), 20.0), ((2, 3, 0, 1), 30.0),
        ((1, 2, 3, 0), 40.0), ((0, 1, 2, 3), 50.0),
    ]  # fmt: skip
    # A rounding error before the end of a turn.
    assert rotating(2.9999999, 3, 3.0) == ((2, 0, 1), 6.0)


def test_a_turn_is_longer_than_a_crossing() -> None:
    """22 m from a stand at 2.6 m/s²: t = √(2·22 / 2.6) = 4.1 s."""
    assert TURN_TIME > 2 * (2 * 22 / 2.6) ** 0.5


def test_the_longest_wait_comes_first() -> None:
    ranking = longest_waiting(30.0, 4, {0: 29.0, 2: 25.0, 3: 27.0}, memory=8.0, turn_time=100.0)
    assert ranking.ranks == (2, 3, 0, 1)  # c, d, a; none waits on b
    assert ranking.until == 33.0  # then c's wait counts no more
    assert longest_waiting(0.0, 3, {2: 0.0}, 8.0, 100.0).ranks == (1, 2, 0)  # has just come


def test_no_wait_counts_more_than_the_memory() -> None:
    since = {0: 29.0, 2: 1.0, 3: 15.0}
    ranks = [longest_waiting(30.0 + t, 4, since, 8.0, 10.0).ranks for t in (0.0, 10.0)]
    assert ranks == [(2, 3, 1, 0), (0, 3, 1, 2)]  # c, d alike, and d's turn; then all, and a's


def test_waits_that_differ_by_rounding_tie_and_others_do_not() -> None:
    """2e-7 s apart are one instant, and the turn decides; 0.4 s apart are not."""
    one_turn = {"memory": 50.0, "turn_time": 100.0}
    assert longest_waiting(30.0, 2, {0: 20.0, 1: 20.0 - 2e-7}, **one_turn).ranks == (0, 1)
    assert longest_waiting(30.0, 2, {0: 20.0, 1: 20.0 - 0.4}, **one_turn).ranks == (1, 0)
    assert longest_waiting(30.0, 2, {0: 20.0, 1: 20.0 - 2e-6}, **one_turn).ranks == (1, 0)


def test_ranks_hold_until_a_wait_reaches_the_memory_or_the_turn_ends() -> None:
    assert longest_waiting(30.0, 3, {1: 25.0, 2: 24.0}, 8.0, 100.0).until == 32.0
    assert longest_waiting(30.0, 3, {1: 25.0, 2: 24.0}, 8.0, 31.0).until == 31.0
    assert longest_waiting(30.0, 3, {1: 22.0}, 8.0, 100.0).until == 100.0  # it has just done so
    assert longest_waiting(0.0, 3, {1: 0.0}, SAME_TIME, 100.0).until == 100.0


def test_memory_is_how_long_each_vehicle_has_watched() -> None:
    """100 m range, yellow zone from 8 m: 92 m at 40 km/h."""
    site = four_way().site()
    assert memory_of(site, Zones()) == pytest.approx(92.0 / (40.0 / 3.6))
    with pytest.raises(InputError, match="sensors that reach 8 m"):
        memory_of(site, Zones(), 8.0)
    with pytest.raises(InputError, match="sensors that reach 8 m"):
        Dim(priorities="waiting", sensor_range=8.0).start(site)
    assert memory_of(site, Zones(), 8.5) == pytest.approx(0.5 / (40.0 / 3.6))


def test_passing_times_by_hand() -> None:
    watch = PassingTimes(8.0)
    assert watch.look(1.0, [seen(1, 0, 2, 8.1)]) == {}
    assert watch.look(2.0, [seen(1, 0, 2, 7.9), seen(5, 2, 2, 3.0)]) == {0: 2.0, 2: 2.0}
    assert PassingTimes(8.0).look(2.0, [seen(1, 0, 2, 8.0), seen(5, 2, 2, 0.0)]) == {0: 2.0, 2: 2.0}
    assert watch.look(3.0, [seen(1, 0, 2, -1.0), seen(2, 0, 2, 6.0), seen(5, 2, 2, 3.0)]) == {
        0: 3.0,
        2: 2.0,
    }
    assert watch.look(4.0, [seen(2, 0, 2, 2.0)]) == {0: 3.0}
    assert watch.look(5.0, [seen(2, 0, 2, 2.0), seen(5, 2, 2, 3.0)]) == {0: 3.0, 2: 5.0}


def test_a_session_looks_again_when_the_turn_ends() -> None:
    session = Dim(priorities="rotating").start(four_way().site())
    both = (seen(0, 0, 2, 2.2), seen(1, 1, 2, 2.2))  # a2 and b2 are in conflict
    assert said(session.decide(View(9.0, both))) == ["Go 0", "Wake 10"]
    assert said(session.decide(View(10.0, both))) == ["Hold 0", "Go 1", "Wake 20"]
    alone = (both[0],)
    assert said(session.decide(View(11.0, alone))) == ["Go 0"]  # none waits: no wake-up


def test_the_longest_waiting_lane_goes() -> None:
    session = Dim(priorities="waiting").start(four_way().site())
    first, second = seen(1, 1, 2, 2.2), seen(0, 0, 2, 2.2)
    assert said(session.decide(View(1.0, (first,)))) == ["Go 1"]
    assert said(session.decide(View(3.0, (second, first)))) == ["Wake 9.28"]
    # Both have waited for 8.28 s, which is as much as counts; it is b's turn from 10 s on.
    assert said(session.decide(View(12.0, (second, first)))) == ["Wake 20"]


@given(
    scenarios(horizon=60.0, max_density=500.0),
    st.integers(0, 2**32 - 1),
    st.sampled_from(["rotating", "waiting"]),
    st.sampled_from(["clear", "harmonious"]),
    st.sampled_from(["size", "lanes"]),
)
@settings(max_examples=20)
def test_safe_and_wake_ups_lose_nothing(scenario, seed, priorities, gate, order) -> None:
    scenario = drained(scenario, seed, 900.0)
    dim = Dim(priorities=priorities, gate=gate, order=order)
    woken = minisim.simulate(scenario, dim, seed=seed)
    assert woken.columns.arrived.all()
    always = minisim.simulate(scenario, replace(dim, period=scenario.profile.dt), seed=seed)
    assert digest(woken) == digest(always)


@pytest.mark.parametrize(("reach", "agree"), [(100.0, True), (12.0, False)])
def test_late_vehicles_agree(reach: float, agree: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A vehicle that has watched from 100 m on knows as much as the others about every wait.

    One that sees only 12 m but counts as if it saw 100 m does not.
    """
    agreed: list[bool] = []
    start = Zones().yellow_start + 1e-6

    class Watched(DimSession):
        """Beside DIM, each vehicle has a watch of its own, which starts when its sensors reach."""

        def __init__(self, dim: Dim, site: Site) -> None:
            super().__init__(dim, site)
            self.plan = replace(self.plan, sight=reach, period=site.dt)
            self.memory = memory_of(site, dim.zones)
            self.watches: dict[int, PassingTimes] = {}

        def ranks(self, view: View, watcher: int) -> tuple[int, ...]:
            watch = self.watches.setdefault(watcher, PassingTimes(start))
            since = watch.look(view.time, view.vehicles)
            return longest_waiting(view.time, 4, since, self.memory).ranks

        def decide(self, view: View) -> Iterable[Command]:
            common = self.ranks(view, -1)
            for ego in view.vehicles:
                own = self.ranks(view, ego.id)
                if 0.0 <= ego.distance <= start:
                    agreed.append(own == common)
            return super().decide(view)

    monkeypatch.setattr("dim.controller.DimSession", Watched)
    scenario = four_way(density=300.0, profile="fair", horizon=400.0)
    minisim.simulate(scenario, Dim(priorities="waiting"), seed=2)
    assert len(agreed) > 2000
    assert all(agreed) is agree


@given(
    st.dictionaries(st.integers(0, 4), st.integers(0, 300), min_size=1, max_size=5),
    st.integers(10, 100),
    st.integers(0, 200),
    st.integers(0, 200),
)
def test_an_observer_agrees(passed: dict[int, int], memory: int, early: int, later: int) -> None:
    """In tenths of a second: passing times, and an observer that began `early` before it must."""
    now = max(passed.values()) + later
    began = now - memory - early
    truth = {lane: when / 10 for lane, when in passed.items()}
    seen = {lane: max(when, began) / 10 for lane, when in passed.items()}
    rankings = [longest_waiting(now / 10, 5, since, memory / 10) for since in (truth, seen)]
    assert rankings[0] == rankings[1]


def crosses(every: float, **rules: str) -> bool:
    """Whether a vehicle d2 gets across against an a2 every so many seconds, in five minutes."""
    stream = [(every * k, 0, 2) for k in range(int(300 / every))]
    scenario = replayed(four_way(0, profile="fair"), *stream, (100.0, 3, 2), horizon=300.0)
    trips = minisim.simulate(scenario, Dim(**rules)).columns
    return bool(trips.arrived[trips.lane == 3].all())


@pytest.mark.parametrize("priorities", ["rotating", "waiting"])
def test_behind_the_harmonious_gate_priorities_decide_only_once_the_junction_is_empty(
    priorities: str,
) -> None:
    """An a2 every 3 s never leaves it empty, one every 3.5 s does (docs/background/safety.md)."""
    assert not crosses(3.0, gate="harmonious", priorities=priorities)
    assert crosses(3.5, gate="harmonious", priorities=priorities)
    assert not crosses(3.5, gate="harmonious")
    assert crosses(3.0, gate="passed", priorities=priorities)
    assert crosses(3.0, gate="clear", priorities=priorities)
