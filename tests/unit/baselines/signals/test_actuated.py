"""The actuated signal: where its loops are, which gap ends a green, and when."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import pytest

import minisim
from baselines import Actuated, Adaptive
from baselines.signals.actuated import GapSession
from baselines.signals.phases import Verdict
from minisim.control import Observed, View
from minisim.errors import InputError
from minisim.testing import small_scenario
from minisim.vehicle import VehicleType
from scenarios.library import four_way
from scenarios.profiles import AS_RUN_SIGNALS
from tests.builders import Greens, drive, queues, seen

SITE = four_way(profile="fair").site()
#: (3/1.9 + 0.5) places of 7.5 m: nearer than two seconds at 14 m/s.
LOOP = 15.592105


def verdict(left: float | None, elapsed: float, *now: Observed, **more: Any) -> Verdict:
    """Of lane a's phase at 1000 s, when a vehicle left its loop `left` seconds ago, or none."""
    session = GapSession(Actuated(**more), SITE)
    if left is not None:
        session.see(View(1000.0 - left, (seen(1, 0, 2, LOOP - 5.1, 10.0),)))
    view = View(1000.0, now)
    session.see(view)
    return session.judge(view, 0, elapsed)


PASS_ON = Verdict(1, 0.0)


def test_the_loop_is_two_seconds_before_the_line_or_nearer() -> None:
    """Nearer where the vehicles in between could not all leave in the shortest green."""
    assert Actuated().detector(SITE) == pytest.approx(LOOP)
    assert Actuated(min_green=10.0).detector(SITE) == pytest.approx(28.0)
    short = small_scenario(4, arm_length=30.0).site(0)
    length = short.intersection.approach_length
    assert Actuated(min_green=30.0, detector_gap=20.0).detector(short) == pytest.approx(length)


def test_it_is_woken_when_a_rear_bumper_leaves_the_loop() -> None:
    plan = Actuated().start(SITE).plan
    assert plan.marks == pytest.approx((LOOP - SITE.vehicle.length, 0.0))
    assert plan.sight > LOOP


def test_a_vehicle_leaves_the_loop_once() -> None:
    session = GapSession(Actuated(presence=False), SITE)
    gone = seen(1, 0, 2, 10.0, 10.0)
    for time in (10.0, 11.0, 12.0):
        session.see(View(time, (gone,)))
    assert session.judge(View(12.9, ()), 0, 3.0) == (0, 1.0)  # 2.9 s
    assert session.judge(View(13.0, ()), 0, 3.0) == PASS_ON  # 3 s


def test_a_gap_of_three_seconds_ends_the_green() -> None:
    assert verdict(2.99, 5.0).lane == 0
    assert verdict(3.0, 5.0) == PASS_ON
    assert verdict(None, 5.0) == PASS_ON
    assert verdict(3.0, 5.0, max_gap=4.0).lane == 0


@pytest.mark.parametrize(
    ("left", "elapsed", "end"),
    [
        (0.0, 3.0, 5.0),  # two seconds to the line
        (0.7, 5.0, 7.0),  # 1.3 s, up to a whole second of the phase
        (1.0, 5.0, 6.0),
        (2.5, 5.0, 6.0),  # already over the line: one step, up to a whole second
        (0.5, 49.0, 50.0),  # not beyond the longest
    ],
)
def test_a_green_lasts_until_the_last_is_over(left: float, elapsed: float, end: float) -> None:
    lane, after = verdict(left, elapsed)
    assert lane == 0
    assert elapsed + after == pytest.approx(end)


def test_a_vehicle_standing_on_the_loop_leaves_no_gap() -> None:
    for distance in (LOOP - 0.1, LOOP - 4.9):
        assert verdict(100.0, 5.0, seen(2, 0, 1, distance)) == (0, 2.0)
        assert verdict(100.0, 5.0, seen(2, 1, 1, distance)) == PASS_ON, "of another lane"
        assert verdict(None, 49.5, seen(2, 0, 1, distance)).after == pytest.approx(0.5)
        assert verdict(None, 50.0, seen(2, 0, 1, distance)) == PASS_ON, "the longest green"
    assert verdict(100.0, 5.0, seen(2, 0, 1, LOOP + 0.1)) == PASS_ON


def test_a_vehicle_between_loop_and_line_prolongs_the_green() -> None:
    """It counts as one that is at the line now, and left the loop at the speed limit."""
    near = seen(2, 0, 1, 0.0)

    def waiting(elapsed: float, **more: Any) -> Verdict:
        session = GapSession(Actuated(**more), SITE)
        for time in (900.0, 1000.0):
            session.see(View(time, (near,)))
        return session.judge(View(1000.0, (near,)), 0, elapsed)

    assert waiting(5.0).lane == 0
    assert waiting(5.0, presence=False) == PASS_ON, "as in SUMO"
    assert waiting(50.0) == PASS_ON, "the longest green"
    session = GapSession(Actuated(), SITE)
    for time in (9.0, 10.0, 12.0):
        session.see(View(time, (near,)))
    after = Actuated().max_gap - (LOOP - 5.0) / 14.0
    assert session.judge(View(12.0 + after - 0.1, ()), 0, 5.0).lane == 0
    assert session.judge(View(12.0 + after + 0.1, ()), 0, 5.0) == PASS_ON


def test_on_an_empty_junction_every_green_is_the_shortest() -> None:
    assert drive(Actuated(), SITE, 18.0) == {
        0: ["Open 0"], 3: ["Close 0"], 5: ["Open 1"], 8: ["Close 1"], 10: ["Open 2"],
        13: ["Close 2"], 15: ["Open 3"],
    }  # fmt: skip


def test_no_green_ends_while_its_queue_stands_with_the_loop_in_a_gap() -> None:
    """Vehicles of 6 m with gaps of 2.5 m: the third begins 17 m before the line."""
    queue = queues(VehicleType(length=6.0))
    for presence in (True, False):
        watched = Greens(Actuated(presence=presence))
        minisim.simulate(queue, watched)
        assert any(watched.left) is not presence, "without it, as in SUMO"


def test_it_waits_longer_than_the_adaptive_signal_where_one_lane_has_most() -> None:
    """The claim "ATS declines" at 4:3:2:1 depends on it (as published: 5.9 to 7.9 s)."""
    scenario = four_way(350, profile=AS_RUN_SIGNALS, split=(4, 3, 2, 1), horizon=1800.0)
    actuated, adaptive = (
        minisim.simulate(scenario, signal, seed=1).summary()["waiting_time_s"]
        for signal in (Actuated(presence=False), Adaptive())
    )
    assert actuated > 1.1 * adaptive


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(InputError, match="max_green must be at least min_green, 20 s, got 10 s"):
        Actuated(min_green=20.0, max_green=Fraction(10))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"order must be the lanes a \(0\), b"):
        Actuated(order=(0, 1, 1, 3)).start(SITE)
