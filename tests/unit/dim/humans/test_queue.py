"""Which vehicles are in the queue, and in which order."""

from __future__ import annotations

import numpy as np
import pytest

from dim import Zones
from dim.humans.drivers import Drivers
from dim.humans.queue import Queue
from minisim.control import AT_LINE, HALTING, Observed
from tests.builders import seen, view

DRIVERS = Drivers(0.5, 1)
HUMAN = np.array([[DRIVERS[lane, i].human for lane in range(4)] for i in range(400)])
P, Q = np.flatnonzero(HUMAN.all(axis=1)).tolist()[:2]  # ids of humans, whatever the lane
X, Y = np.flatnonzero(~HUMAN.any(axis=1)).tolist()[:2]  # and of vehicles of DIM
ZONES = Zones()
A, B, C, D = range(4)


def queue(*looks: tuple[Observed, ...]) -> Queue:
    made = Queue(ZONES, DRIVERS)
    for time, vehicles in enumerate(looks):
        made.look(view(*vehicles, time=float(time)))
    return made


@pytest.mark.parametrize(
    ("id_", "distance", "speed", "has_come"),
    [
        (X, ZONES.yellow_start, 5.0, True),
        (X, ZONES.yellow_start + 1e-3, 5.0, False),
        (X, 0.0, 0.0, True),
        (X, -1e-3, 0.0, False),
        (P, ZONES.green + AT_LINE, HALTING, True),
        (P, ZONES.green + AT_LINE + 1e-3, 0.0, False),
        (P, ZONES.green, HALTING + 1e-3, False),
    ],
)
def test_when_a_vehicle_has_come(id_: int, distance: float, speed: float, has_come: bool) -> None:
    assert list(queue((seen(id_, A, 2, distance, speed),)).heads) == [id_] * has_come


def test_the_first_to_come_stays_the_first_until_it_enters() -> None:
    driver, car = seen(P, B, 2, 2.0), seen(X, A, 2, 6.0, 4.0)
    assert list(queue((driver,), (driver, car)).heads) == [P, X]
    assert list(queue((car,), (driver, car)).heads) == [X, P]
    rolling = driver._replace(distance=0.5, speed=2.0)  # its place is kept until it is inside
    assert list(queue((driver,), (driver, car), (rolling, car)).heads) == [P, X]
    entered = driver._replace(distance=-0.1, speed=3.0)
    assert list(queue((driver,), (driver, car), (entered, car)).heads) == [X]


def test_at_once_dim_comes_before_humans_and_then_lane_a_before_b() -> None:
    there = (seen(P, A, 2, 2.0), seen(Q, B, 2, 2.0), seen(X, C, 2, 2.0), seen(Y, D, 2, 2.0))
    assert list(queue(there).heads) == [X, Y, P, Q]


def test_only_the_first_of_a_lane_comes_and_the_next_when_that_has_entered() -> None:
    first, next_ = seen(P, A, 2, 2.0), seen(X, A, 2, 7.8)
    assert list(queue((first, next_)).heads) == [P]
    assert list(queue((first, next_), (first._replace(distance=-0.1), next_)).heads) == [X]


def test_whether_humans_are_there() -> None:
    """In the queue or inside; a human that rolls towards the line looks, and does not count yet."""
    for vehicle, near, there in (
        (seen(P, A, 2, 2.0), True, True),
        (seen(P, A, 2, 6.0, 4.0), True, False),
        (seen(P, A, 2, 9.0, 4.0), False, False),
        (seen(P, A, 2, -6.0, 4.0), False, True),
        (seen(X, A, 2, 2.0), False, False),
    ):
        made = queue((vehicle,))
        assert (made.near == [vehicle], made.humans) == (near, there)
