"""How a view is read: participants, crossing vehicles, and the two commit rules."""

from __future__ import annotations

import pytest

from dim import DecisionTable, ExactPerception, HarmonyMatrix, Perception, Zones
from dim.perception import UNKNOWN, Reader
from minisim.control import COMMIT_MARGIN
from scenarios import four_way
from tests.builders import car, view

MATRIX = HarmonyMatrix.paper(4)
TABLE = DecisionTable(MATRIX)
STOPPABLE = Reader(4, Zones(), (2.0,), "stoppable")
PAPER = Reader(4, Zones(), (2.0,), "paper")


def occupied(*movements: str) -> int:
    return sum(1 << MATRIX.index(m) for m in movements)


def test_a_vehicle_of_unknown_intent_may_take_any_manoeuvre() -> None:
    crossing = car(1, "b2", -3.0)._replace(manoeuvre=UNKNOWN)
    taking_part = car(2, "c1", 4.0)._replace(manoeuvre=UNKNOWN)
    percept = STOPPABLE.read(view(crossing, taking_part, car(3, "d3", 5.0)))
    assert percept == ((2, 3), (1,), 3 * 4**3, occupied("b1", "b2", "b3"), 1 << 2, 0)


def test_with_types_told_apart_a_vehicle_counts_as_one_of_its_type() -> None:
    reader, m = STOPPABLE._replace(types=2, decelerations=(2.0, 2.0)), 12
    bus, lost = (car(k, of, 4.0)._replace(type=1) for k, of in ((1, "a2"), (2, "c1")))
    crossing = car(3, "b2", -3.0)._replace(type=1)
    percept = reader.read(view(bus, crossing, lost._replace(manoeuvre=UNKNOWN), car(4, "d3", 5.0)))
    assert percept == (
        (1, 2, 4), (3,), (3 + 2) + 3 * 7**3, occupied("b2") << m, 2 * 3**2, 0,
    )  # fmt: skip
    assert reader.typed(bus) == (0, 5)
    assert STOPPABLE.typed(bus) == (0, 2)


def test_front_vehicles_between_yellow_start_and_junction_take_part() -> None:
    percept = STOPPABLE.read(
        view(
            car(1, "a1", 8.0),  # at the start of the yellow zone
            car(2, "b2", 2.0),  # at the hold line
            car(3, "c3", 0.0),  # stands at the very end of the green zone
            car(4, "d2", 8.1),  # not there yet
        )
    )
    assert percept.participants == (1, 2, 3)
    assert percept.crossing == ()
    assert percept.case == TABLE.case(["a1", "b2", "c3"])
    assert percept.occupied == 0


def test_a_mark_passed_within_rounding_counts() -> None:
    assert STOPPABLE.read(view(car(1, "a1", 8.0 + 1e-9))).participants == (1,)
    assert STOPPABLE.read(view(car(1, "a1", 8.0 + 1e-3))).participants == ()


@pytest.mark.parametrize(
    ("reader", "distance", "speed"),
    [
        (STOPPABLE, 2.0, 4.0),  # 4²/(2·2) = 4 > 2
        (STOPPABLE, 0.01, 0.5),
        (PAPER, 0.9, 0.0),
        (PAPER, 0.9, 5.0),
    ],
)
def test_a_committed_vehicle_blocks_its_lane(reader: Reader, distance: float, speed: float) -> None:
    others = car(2, "a3", 7.0), car(3, "b1", 5.0)
    percept = reader.read(view(car(1, "a1", distance, speed), *others))
    assert percept == ((3,), (1,), TABLE.case(["b1"]), occupied("a1"), 0, 0)
    percept = reader.read(view(car(1, "a1", -0.01, speed), *others))
    assert percept == ((2, 3), (1,), TABLE.case(["a3", "b1"]), occupied("a1"), 0, 0)


def test_all_committed_vehicles_of_a_lane_are_crossing() -> None:
    """6.25 m to stop at 5 m/s: neither of the two can."""
    percept = STOPPABLE.read(view(car(1, "a1", 0.5, 5.0), car(2, "a2", 5.5, 5.0)))
    assert percept == ((), (1, 2), 0, occupied("a1", "a2"), 0, 0)


def test_behind_vehicles_in_the_junction_the_next_one_is_the_front_vehicle() -> None:
    percept = STOPPABLE.read(
        view(car(1, "a1", -12.0, 5.0), car(2, "a1", -3.0, 5.0), car(3, "a3", 4.0), car(4, "a1", 8))
    )
    assert percept == ((3,), (1, 2), TABLE.case(["a3"]), occupied("a1"), 0, 0)


@pytest.mark.parametrize(
    ("distance", "speed", "committed"),
    [
        (2.0, 0.0, False),
        (0.05, 0.0, False),  # revoked, stands inside the margin: not committed
        (1.0 + COMMIT_MARGIN, 2.0, False),  # 2²/(2·2) = 1
        (0.99 + COMMIT_MARGIN, 2.0, True),
        (1.0 + COMMIT_MARGIN, 2.01, True),
        (6.25 + COMMIT_MARGIN, 5.0, False),  # 5²/(2·2) = 6.25
        (6.24 + COMMIT_MARGIN, 5.0, True),
    ],
)
def test_commit_stoppable(distance: float, speed: float, committed: bool) -> None:
    vehicle = car(1, "b2", distance, speed)
    assert STOPPABLE.committed(vehicle) is committed
    assert STOPPABLE.read(view(vehicle)).crossing == ((1,) if committed else ())


@pytest.mark.parametrize("speed", [0.0, 5.0])
@pytest.mark.parametrize(
    ("distance", "committed"), [(2.0, False), (1.0, False), (0.99, True), (0.0, True)]
)
def test_commit_paper_is_half_a_green_zone(distance: float, committed: bool, speed: float) -> None:
    vehicle = car(1, "b2", distance, speed)
    assert PAPER.committed(vehicle) is committed
    assert PAPER.read(view(vehicle)).crossing == ((1,) if committed else ())


@pytest.mark.parametrize("green", [COMMIT_MARGIN, 2.0, 5.0])
@pytest.mark.parametrize("b", [1.0, 2.0, 4.5])
def test_braking_for_the_hold_line_never_looks_committed(green: float, b: float) -> None:
    """At v = √(2b·x) a vehicle x metres before the hold line just stops at it."""
    reader = Reader(4, Zones(green=green), (b,), "stoppable")
    for x in (0.0, 0.1, 1.0, 3.0, 6.0):
        speed = (2 * b * x) ** 0.5 * (1 - 1e-9)
        assert not reader.committed(car(1, "a1", green + x, speed)), x


def test_exact_perception_is_the_view_itself() -> None:
    see = ExactPerception().start(four_way().site())
    seen = view(car(1, "a1", 3.0), car(2, "b1", 3.0))
    assert see(seen, seen.vehicles[0]) is seen
    assert isinstance(ExactPerception(), Perception)
    assert ExactPerception() == ExactPerception()
