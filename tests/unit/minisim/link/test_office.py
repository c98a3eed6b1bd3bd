"""What the controller's side of a link knows and tells."""

from __future__ import annotations

from typing import Any

import pytest

from minisim.channel import Channel
from minisim.control import (
    Advise,
    Go,
    Hold,
    Observed,
    Plan,
    Reserve,
)
from minisim.link.messages import Order, Status
from minisim.link.office import Office
from scenarios import four_way
from tests.builders import car

FAIR = four_way(250, profile="fair", horizon=300.0)
SITE = FAIR.site(1)
PLAN = Plan(marks=(50.0,), sight=100.0, wake_on_clear=True)


def told(office: Office, now: int) -> list[Order]:
    return [*office.orders(now, 1)]


def heard(office: Office, *vehicles: Observed, at: int = 0, **more: Any) -> bool:
    """Hear from vehicles; returns whether the session is woken."""
    news = {"number": 0, "holds": False, "left": False} | more
    return max([office.hear(Status(it, at, **news)) for it in vehicles])


def test_an_order_is_repeated_until_the_vehicle_names_it() -> None:
    office, me = Office(SITE, PLAN), car(0, "a2", 40.0)
    heard(office, me)
    office.take(Go(0))
    assert told(office, 0) == told(office, 1) == [Order(0, 1, go=True)]
    office.take(Advise(0, 5.0))
    assert told(office, 2) == [Order(0, 2, go=True, speed=5.0)]
    heard(office, me, at=3, number=1, holds=True)
    assert told(office, 3) == [Order(0, 2, go=True, speed=5.0)]
    heard(office, me, at=4, number=2, holds=True)
    assert told(office, 4) == []
    office.take(Advise(0, 5.0))  # nothing new
    assert not office.talking


def test_right_of_way_waits_until_no_vehicle_in_conflict_may_hold_it() -> None:
    office, first, second = (
        Office(SITE, PLAN),
        car(0, "a2", 40.0),
        car(0, "b2", 40.0)._replace(id=1),
    )
    heard(office, first, second)
    for vehicle in (0, 1):
        office.take(Go(vehicle))
    assert told(office, 0) == [Order(0, 1, go=True)]
    office.take(Hold(0))  # lost, perhaps, and the first message was not
    assert told(office, 1) == [Order(0, 2)]
    heard(office, first, at=2, number=1, holds=True)
    heard(office, first, at=3, number=2, holds=True)  # it could no longer stop
    assert told(office, 3) == []
    heard(office, first, at=4, number=2, holds=False)
    assert told(office, 4) == [Order(1, 1, go=True)]


def test_an_early_word_does_not_free_the_way() -> None:
    """It held nothing when it said so, but a grant was under way."""
    office, first, second = (
        Office(SITE, PLAN),
        car(0, "a2", 40.0),
        car(0, "b2", 40.0)._replace(id=1),
    )
    heard(office, first, second)
    office.take(Go(0))
    told(office, 0)
    office.take(Hold(0))
    office.take(Go(1))
    heard(office, first, at=1, number=0, holds=False)
    assert [order.vehicle for order in told(office, 1)] == [0]
    heard(office, first, at=9, number=2, holds=False)
    heard(office, first, at=2, number=1, holds=True)  # overtaken on the way
    assert [order.vehicle for order in told(office, 9)] == [1]


def test_a_vehicle_is_known_once_all_ahead_of_it_are_and_until_it_says_that_it_left() -> None:
    office = Office(SITE, PLAN)
    leader, follower = car(0, "a2", 40.0), car(1, "a2", 60.0)
    assert not heard(office, follower)
    assert office.view(0).vehicles == ()
    assert heard(office, leader)
    assert office.view(0).vehicles == (leader, follower)
    assert heard(office, leader, left=True)
    assert not heard(office, leader, at=0)  # it came late
    assert office.view(1).vehicles == (follower,)
    office.take(Go(0))
    assert not office.talking


def test_one_that_left_unheard_holds_up_none() -> None:
    office = Office(SITE, PLAN)
    heard(office, car(1, "a2", 60.0))
    heard(office, car(0, "a2", -20.0), left=True)
    assert [it.id for it in office.view(0).vehicles] == [1]


def test_in_a_lane_right_of_way_is_given_from_front_to_back() -> None:
    office = Office(SITE, PLAN)
    heard(office, car(0, "a2", 40.0), car(1, "a1", 60.0))
    office.take(Go(1))
    assert told(office, 0) == []
    office.take(Go(0))
    assert [order.vehicle for order in told(office, 1)] == [0]
    assert [order.vehicle for order in told(office, 2)] == [0, 1]


def test_the_session_wakes_at_its_marks() -> None:
    office = Office(SITE, PLAN)
    assert heard(office, car(0, "a2", 70.0))
    assert not heard(office, car(0, "a2", 60.0), at=1)
    assert heard(office, car(0, "a2", 50.0), at=2)
    assert not heard(office, car(0, "a2", 40.0), at=3)


def test_a_view_says_when_each_vehicle_spoke() -> None:
    office = Office(SITE, PLAN)
    heard(office, car(0, "a2", 70.0), at=3, holds=True)
    assert office.view(9).time == pytest.approx(0.9)
    assert office.view(9).reports == {0: (pytest.approx(0.3), True, True)}


def test_a_view_says_whether_a_vehicle_follows_what_it_was_told() -> None:
    office, me = Office(SITE, PLAN), car(0, "a2", 40.0)
    heard(office, me)
    office.take(Advise(0, 5.0))
    assert not office.view(1).reports[0].follows
    heard(office, me, at=2, number=1)
    assert office.view(2).reports[0].follows


def test_a_promise_is_repeated_as_long_as_it_is_sure_to_come_in_time() -> None:
    """It takes up to 0.2 s and is due at 1 s, so the last one is sent at 0.8 s."""
    office = Office(SITE.with_channel(Channel(latency=0.1, jitter=0.1)), PLAN)
    heard(office, car(0, "a2", 40.0))
    office.take(Reserve(0, 1.0, lambda *_: True))
    assert office.talking
    assert [now for now in range(12) for _ in office.promises(now, 3)] == [0, 3, 6]
    assert not office.talking
    office.take(Reserve(0, 2.0, lambda *_: True))
    office.take(late := Reserve(0, 2.1, lambda *_: True))
    assert [*office.promises(12, 3)] == [late]
    heard(office, car(0, "a2", -10.0), left=True)
    assert [*office.promises(15, 3)] == []
