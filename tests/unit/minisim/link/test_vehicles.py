"""What the vehicles' side of a link says and does."""

from __future__ import annotations

import math
from collections.abc import Callable

from minisim.control import (
    Advise,
    Go,
    Hold,
    Observed,
    Plan,
    Reserve,
)
from minisim.link.messages import Confirmed, Order, Status
from minisim.link.vehicles import Vehicles
from scenarios import four_way
from tests.builders import car, said, view

FAIR = four_way(250, profile="fair", horizon=300.0)
SITE = FAIR.site(1)
PLAN = Plan(marks=(50.0,), sight=100.0, wake_on_clear=True)


def obeyed(vehicles: Vehicles, *messages: Order | Reserve | Confirmed, now: int = 0) -> list[str]:
    return said(it for message in messages for it in vehicles.obey(message, now))


def beside(vehicle: Observed, now: int = 0) -> Vehicles:
    vehicles = Vehicles(SITE)
    vehicles.look(view(vehicle, time=now * SITE.dt))
    return vehicles


def test_a_vehicle_does_what_the_newest_order_says() -> None:
    vehicles = beside(car(0, "a2", 40.0, 5.0))
    new, old = Order(0, 2, go=True, speed=3.0, braking=1.0), Order(0, 1)
    assert obeyed(vehicles, new, old, new) == ["Go 0", "Advise 0", "Brake 0"]
    assert obeyed(vehicles, Order(0, 3, go=True), Order(0, 4)) == ["Advise 0", "Brake 0", "Hold 0"]
    (status,) = vehicles.statuses(7)
    assert status == Status(car(0, "a2", 40.0, 5.0), 7, number=4, holds=False, left=False)


def test_an_acceleration_is_told_and_released_by_messages() -> None:
    vehicles = beside(car(0, "a2", 40.0, 5.0))
    told = Order(0, 1, acceleration=-1.0)
    assert obeyed(vehicles, told) == ["Accelerate 0"]
    assert obeyed(vehicles, told._replace(number=2)) == []
    assert obeyed(vehicles, Order(0, 3)) == ["Accelerate 0"]


def test_one_that_cannot_stop_keeps_its_right_of_way_and_says_so() -> None:
    vehicles = beside(car(0, "a2", 5.0, 13.0))
    assert obeyed(vehicles, Order(0, 1, go=True), Order(0, 2)) == ["Go 0"]
    (status,) = vehicles.statuses(0)
    assert (status.number, status.holds) == (2, True)


def test_a_vehicle_says_that_it_left_until_that_is_confirmed() -> None:
    vehicles = beside(car(0, "a2", -10.0, 10.0))
    vehicles.look(view())
    (status,) = vehicles.statuses(1)
    assert status.left
    assert obeyed(vehicles, Order(0, 1, go=True)) == []
    assert obeyed(vehicles, Confirmed(0)) == []
    assert not vehicles.talking


def reserving(time: float, keeps: Callable[[Observed, float], bool]) -> Reserve:
    return Reserve(0, time, keeps)


def test_a_reservation_takes_effect_when_both_know() -> None:
    vehicles = beside(car(0, "a2", 40.0, 5.0))
    assert obeyed(vehicles, reserving(0.5, lambda *_: True), now=3) == []
    assert said(vehicles.reserve(4)) == []
    assert said(vehicles.reserve(5)) == ["Go 0"]
    assert [status.holds for status in vehicles.statuses(5)] == [True]


def test_one_that_comes_too_late_is_void() -> None:
    vehicles = beside(car(0, "a2", 40.0, 5.0))
    obeyed(vehicles, reserving(0.5, lambda *_: True), now=6)
    assert said(vehicles.reserve(6)) == []


def test_a_vehicle_off_its_passage_gives_it_up_if_it_can_stop() -> None:
    vehicles = beside(car(0, "a2", 40.0, 5.0))
    obeyed(vehicles, reserving(0.0, lambda me, time: time < 1.0))
    assert said(vehicles.reserve(0)) == ["Go 0"]
    vehicles.look(view(car(0, "a2", 5.0, 13.0), time=1.0))
    assert said(vehicles.reserve(10)) == []
    vehicles.look(view(car(0, "a2", 5.0, 3.0), time=1.1))
    assert said(vehicles.reserve(11)) == ["Hold 0"]
    assert [status.holds for status in vehicles.statuses(11)] == [False]


def test_no_order_counts_during_a_passage() -> None:
    vehicles = beside(car(0, "a2", 40.0, 5.0))
    obeyed(vehicles, Order(0, 1, speed=3.0))
    passage = reserving(0.5, lambda _, time: time < 1.0)
    obeyed(vehicles, passage, now=3)
    assert list(vehicles.reserve(5)) == [Go(0), Advise(0, math.inf)]
    assert obeyed(vehicles, passage, Order(0, 2, speed=4.0), now=5) == []
    assert list(vehicles.reserve(5)) == []
    assert list(vehicles.reserve(10)) == [Hold(0), Advise(0, 4.0)]
