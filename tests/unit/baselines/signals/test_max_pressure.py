"""Max-pressure: which phase is next, ties, and that it serves every demand that fits."""

from __future__ import annotations

import pytest

import minisim
from baselines import FixedTime, MaxPressure
from baselines.signals.max_pressure import PressureSession
from minisim.control import Observed, View
from scenarios.library import four_way, regular
from tests.builders import drive, seen, show

SITE = four_way(profile="fair").site()


def queues(*lengths: int) -> list[Observed]:
    """So many vehicles standing on each lane."""
    return [
        seen(100 * lane + k, lane, 1, 0.25 + 7.5 * k)
        for lane, length in enumerate(lengths)
        for k in range(length)
    ]


def choices(*views: tuple[int, list[Observed]]) -> list[int]:
    """The lanes chosen one after the other; each view with the lane that is green in it."""
    session = PressureSession(MaxPressure(), SITE)
    return [
        session.judge(View(10.0 * k, tuple(vehicles)), lane, 10.0).lane
        for k, (lane, vehicles) in enumerate(views, start=1)
    ]


def test_the_longest_queue_goes_next() -> None:
    assert choices((0, queues(2, 3, 5, 4))) == [2]
    assert choices((2, queues(2, 3, 5, 4))) == [2]


def test_a_queue_is_all_vehicles_on_the_detector_before_the_line() -> None:
    inside = [seen(k, 1, 2, -1.0 - k, 5.0) for k in range(3)]
    far = [seen(10 + k, 2, 2, 101.0 + 10 * k, 14.0) for k in range(3)]
    coming = [seen(20, 3, 2, 99.0, 14.0)]
    assert choices((0, inside + far + coming)) == [3]


def test_an_empty_junction_keeps_its_green() -> None:
    assert choices((2, []), (2, [])) == [2, 2]


def test_among_equal_queues_the_one_that_waits_longest_goes() -> None:
    even = queues(2, 2, 2, 2)
    # A lane that was never green comes first, in the order of the arms; then by the last green.
    assert choices((2, even), (0, even), (1, even), (3, even), (2, even)) == [0, 1, 3, 2, 0]
    assert choices((0, queues(2, 0, 2, 0))) == [2], "the present lane gives way"


def test_it_looks_once_per_interval_and_changes_with_an_amber() -> None:
    def vehicles(time: float) -> tuple[Observed, ...]:
        return tuple(queues(0, 0, 3, 0) if 12.0 < time < 29.0 else queues(1, 0, 0, 0))

    assert drive(MaxPressure(), SITE, 60.0, vehicles) == {
        0: ["Open 0"], 20: ["Close 0"], 22: ["Open 2"], 32: ["Close 2"], 34: ["Open 0"],
    }  # fmt: skip


def test_the_interval_runs_from_the_green_that_is_shown() -> None:
    session = MaxPressure(interval=5.0).start(SITE)
    show(session, 0.0)
    crossing = seen(7, 0, 2, -2.0, 0.0)
    c = tuple(queues(0, 0, 3, 0))
    assert show(session, 5.0, crossing, *c) == ["Close 0"]
    assert show(session, 7.0, crossing, *c) == []
    assert show(session, 8.5, *c) == ["Open 2"]
    d = tuple(queues(0, 0, 0, 9))
    assert show(session, 12.0, *d) == []
    assert show(session, 13.5, *d) == ["Close 2"]


def test_queues_of_approaches_that_face_each_other_are_added() -> None:
    session = PressureSession(MaxPressure(facing=True), SITE)
    for lengths, first in (((5, 3, 0, 3), 1), ((5, 3, 2, 3), 0), ((0, 1, 0, 0), 1)):
        assert session.judge(View(10.0, tuple(queues(*lengths))), 0, 10.0).lane == first


@pytest.mark.parametrize("n", [3, 4, 5, 6])
def test_no_two_approaches_could_be_green_together(n: int) -> None:
    """Why a phase is one approach: a lane that carries all turns conflicts with every other."""
    site = regular(n, profile="fair").site()
    conflicts = site.conflicts.reshape(n, n - 1, n, n - 1).any(axis=(1, 3))
    assert all(conflicts[i, j] for i in range(n) for j in range(n) if i != j)


def test_the_busier_lanes_get_more_green() -> None:
    # At 4:4:1:1 the two busy lanes come to wait less than under equal treatment: all are served.
    scenario = four_way(200, split=(4, 4, 1, 1), profile="fair", horizon=1800.0)
    run = minisim.simulate(scenario, MaxPressure(), seed=1, record="all")
    frame = run.trajectories
    held = frame[~frame["right_of_way"] & (frame["s_m"] < run.site.intersection.approach_length)]
    share = held.groupby("lane").size() / frame.groupby("lane").size()
    assert max(share["a"], share["b"]) < min(share["c"], share["d"])


@pytest.mark.parametrize("facing", [False, True])
@pytest.mark.parametrize("split", [(1, 1, 1, 1), (4, 4, 1, 1), (8, 1, 1, 1)])
def test_it_serves_every_demand_that_fits(split: tuple[int, ...], facing: bool) -> None:
    """Varaiya 2013: queues stay bounded if any signal could serve the demand.

    In all, 1080 veh/h fit here. Greens that know as little of the demand, all alike, let the queues
    of uneven demand grow.
    """
    scenario = four_way(270, split=split, profile="fair", horizon=1800.0)
    grown, alike = (
        minisim.simulate(scenario, signal, 1).summary(["queue_growth"])["queue_growth"]
        for signal in (MaxPressure(facing=facing), FixedTime(equal_greens=True))
    )
    assert grown < 8.0
    assert (alike > 20.0) is (max(split) > 1)


def test_what_dim_sees_is_too_little_for_that() -> None:
    """At 8 m it sees whether any wait, not how many, and a lane of few vehicles gets too much."""
    scenario = four_way(300, split=(8, 1, 1, 1), profile="fair", horizon=1800.0)
    near, far = (
        minisim.simulate(scenario, signal, 1).summary(["queue_growth"])["queue_growth"]
        for signal in (MaxPressure(detector_range=8.0), MaxPressure())
    )
    assert far < 8.0
    assert near > 30.0
