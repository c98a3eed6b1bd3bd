"""The adaptive signal: when a green is prolonged, when it ends, and what it costs to know."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import minisim
from baselines import Adaptive, FixedTime
from baselines.signals.adaptive import DelaySession, time_loss
from baselines.signals.phases import Verdict
from minisim.control import Observed, View
from minisim.errors import InputError
from scenarios.library import four_way
from tests.builders import drive, seen, show

SITE = four_way(profile="fair").site()
LIMIT = 14.0
#: Far away on lane b: it keeps the green of another lane from going on because all lanes are empty.
OTHER = seen(99, 1, 1, 80.0, 14.0)


def verdict(
    *vehicles: Observed, elapsed: float, lost: float = 2.0, signal: Adaptive | None = None
) -> Verdict:
    """Of lane a's phase; each vehicle has lost `lost` seconds on its detector by now."""
    session = DelaySession(signal or Adaptive(), SITE)
    now = 1000.0
    for v in vehicles:
        since = lost + (100.0 - v.distance) / LIMIT
        session.see(View(now - since, (v._replace(distance=100.0),)))
    session.see(View(now, vehicles))  # the first look counts
    return session.judge(View(now, vehicles), 0, elapsed)


PASS_ON = Verdict(1, 0.0)


def test_time_loss_is_the_integral_of_its_definition() -> None:
    dt = 0.001
    time = np.arange(0.0, 20.0, dt)
    speed = np.clip(14.0 - 1.4 * time, 0.0, None) + np.clip(2.0 * (time - 12.0), 0.0, 9.0)
    loss = float(np.sum(1.0 - speed / LIMIT) * dt)
    driven = float(np.sum(speed) * dt)
    assert time_loss(5.0, 100.0, 25.0, 100.0 - driven, LIMIT) == pytest.approx(loss, abs=1e-9)
    assert time_loss(5.0, 100.0, 5.0 + 50.0 / LIMIT, 50.0, LIMIT) == pytest.approx(0.0)


QUEUE = seen(1, 0, 2, 0.1), seen(2, 0, 1, 28.0), seen(3, 0, 3, 56.0)
FOR_EVER = Adaptive(extend_max_green=True)


@pytest.mark.parametrize(
    ("vehicles", "elapsed", "signal", "expected"),
    [
        ((seen(1, 0, 2, 70.0, 5.0), OTHER), 10.0, None, (0, 70.0 / LIMIT)),
        ((*QUEUE, OTHER), 10.0, None, (0, 56.0 / LIMIT)),  # the last counts
        ((seen(1, 0, 2, 0.0, 5.0), OTHER), 10.0, None, PASS_ON),  # past the line
        ((seen(1, 0, 2, -3.0, 5.0), OTHER), 10.0, None, PASS_ON),
        # 28 m are 2 s, 56 m are 4 s: which can pass before 50 s?
        ((*QUEUE[1:], OTHER), 46.5, None, (0, 2.0)),
        ((QUEUE[2], OTHER), 46.5, None, PASS_ON),
        ((QUEUE[2], OTHER), 46.0, None, (0, 4.0)),
        ((seen(1, 2, 2, 70.0),), 10.0, None, PASS_ON),  # of another lane
        # The shortest green is kept.
        ((OTHER,), 1.0, None, (0, 2.0)),
        ((OTHER,), 3.0, None, PASS_ON),
        # The longest ends it, but an idle signal may go on.
        ((QUEUE[0], OTHER), 50.0, None, PASS_ON),
        ((), 50.0, None, PASS_ON),
        ((), 50.0, FOR_EVER, (0, 1.0)),
        ((QUEUE[0],), 60.0, FOR_EVER, (0, 1.0)),
        ((QUEUE[0], OTHER), 60.0, FOR_EVER, PASS_ON),
    ],
)
def test_delayed_vehicles_prolong_by_the_time_to_the_line_at_the_limit(
    vehicles: tuple[Observed, ...], elapsed: float, signal: Adaptive | None, expected: Verdict
) -> None:
    assert verdict(*vehicles, elapsed=elapsed, signal=signal) == expected


def test_a_second_lost_at_most_prolongs_nothing() -> None:
    vehicles = seen(1, 0, 2, 70.0, 14.0), OTHER
    assert verdict(*vehicles, elapsed=10.0, lost=0.99) == PASS_ON
    assert verdict(*vehicles, elapsed=10.0, lost=1.01) != PASS_ON


def test_a_green_goes_on_while_no_other_lane_has_a_vehicle() -> None:
    assert verdict(elapsed=3.0) == (0, 1.0)
    assert verdict(seen(1, 0, 2, 7.0), elapsed=3.0) == (0, 1.0)
    assert verdict(seen(1, 0, 2, 70.0), elapsed=3.0) == (0, 5.0)
    # A vehicle beyond the detector does not count; one whose rear is still on its lane does.
    assert verdict(seen(1, 1, 2, 100.5), elapsed=3.0) == (0, 1.0)
    assert verdict(seen(1, 1, 2, -4.9), elapsed=3.0) == PASS_ON
    assert verdict(seen(1, 1, 2, -5.1), elapsed=3.0) == (0, 1.0)


def test_the_greens_come_in_the_given_order() -> None:
    session = DelaySession(Adaptive(order=(2, 1, 0, 3)), SITE)
    assert [session.judge(View(0.0, ()), k, 50.0).lane for k in (2, 1, 0, 3)] == [1, 0, 3, 2]
    answers = drive(Adaptive(order=(2, 1, 0, 3)), SITE, 60.0)
    assert answers == {0: ["Open 2"], 50: ["Close 2"], 52: ["Open 1"]}


def test_on_an_empty_junction_every_green_lasts_as_long_as_it_may() -> None:
    """As under SUMO's signal."""
    assert drive(Adaptive(), SITE, 170.0) == {
        0: ["Open 0"], 50: ["Close 0"], 52: ["Open 1"], 102: ["Close 1"], 104: ["Open 2"],
        154: ["Close 2"], 156: ["Open 3"],
    }  # fmt: skip
    assert drive(Adaptive(extend_max_green=True), SITE, 500.0) == {0: ["Open 0"]}


def test_with_vehicles_on_every_lane_each_has_the_shortest_green_in_turn() -> None:
    # They come onto their detectors at every moment, so none has lost a second.
    def fresh(time: float) -> tuple[Observed, ...]:
        return tuple(seen(int(time * 10) * 4 + lane, lane, 1, 90.0, 14.0) for lane in range(4))

    assert drive(Adaptive(), SITE, 22.0, fresh) == {
        0: ["Open 0"], 3: ["Close 0"], 5: ["Open 1"], 8: ["Close 1"], 10: ["Open 2"],
        13: ["Close 2"], 15: ["Open 3"], 18: ["Close 3"], 20: ["Open 0"],
    }  # fmt: skip


def test_the_time_of_a_phase_runs_from_the_green_that_is_shown() -> None:
    session = Adaptive().start(SITE)
    assert show(session, 0.0, OTHER) == ["Open 0"]
    crossing = seen(7, 0, 2, -2.0, 0.0)
    assert show(session, 3.0, crossing, OTHER) == ["Close 0"]
    # The amber is over, but a2 still stands in the way of b.
    assert show(session, 5.0, crossing, OTHER) == []
    assert show(session, 9.0, crossing, OTHER) == []
    assert show(session, 9.5, OTHER) == ["Open 1"]
    c = seen(98, 2, 1, 80.0, 14.0)
    assert show(session, 12.0, c) == []
    assert show(session, 12.5, c) == ["Close 1"]


def test_without_amber_the_next_lane_opens_at_once() -> None:
    session = Adaptive(amber=0.0).start(SITE)
    assert show(session, 0.0, OTHER) == ["Open 0"]
    assert show(session, 3.0, OTHER) == ["Close 0", "Open 1"]


def test_it_is_never_called_without_need() -> None:
    plan = Adaptive().start(SITE).plan
    assert (plan.marks, plan.period) == ((100.0,), None)


def test_it_waits_less_than_the_fixed_time_signal() -> None:
    scenario = four_way(250, profile="fair", horizon=1200.0)
    adaptive, fixed = (
        minisim.simulate(scenario, signal, seed=1).summary()["waiting_time_s"]
        for signal in (Adaptive(), FixedTime())
    )
    assert adaptive < 0.6 * fixed


def test_what_does_not_fit_is_refused() -> None:
    refusals: list[tuple[dict[str, Any], str]] = [
        ({"min_green": 20.0, "max_green": 10.0}, "max_green must be at least min_green, 20 s"),
        ({"order": "abc"}, "order must be a sequence of lanes"),
        ({"order": (0, 1.5)}, "lane in order"),
        ({"order": (0, 1, 2)}, r"order must be the lanes a \(0\), b"),
        ({"detector_range": 11.0}, r"detector_range \[m\] must be at least 11.25, got 11"),
    ]
    for options, message in refusals:
        with pytest.raises(InputError, match=message):
            Adaptive(**options).start(SITE)
