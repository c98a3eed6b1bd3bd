"""Sites, markings, and whether a vehicle can stop."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from minisim.control import (
    COMMIT_MARGIN,
    Controller,
    Counting,
    Kinds,
    Marking,
    Plan,
    Session,
    Site,
    Unregulated,
    can_stop,
    keeps,
    stopping_distance,
)
from minisim.errors import InputError
from minisim.junction.geometry import Intersection
from minisim.junction.movements import Movement
from minisim.vehicle import VehicleType
from tests.builders import seen

FOUR = Intersection((0.0, 90.0, 180.0, 270.0))
SITE = Site(FOUR, VehicleType(), speed_limit=14.0, demand=(350.0,) * 4)


def test_stopping_distance_is_v_squared_over_2b() -> None:
    """The paper's 23.14 m for 40 to 20 km/h at 2 m/s² are the difference of two of these."""
    v, w = 40 / 3.6, 20 / 3.6
    assert stopping_distance(v, 2.0) == pytest.approx(30.86, abs=0.005)
    assert stopping_distance(v, 2.0) - stopping_distance(w, 2.0) == pytest.approx(23.15, abs=0.01)


def test_a_vehicle_can_stop_while_the_stopping_distance_fits_before_the_junction() -> None:
    needed = stopping_distance(10.0, 2.0) + COMMIT_MARGIN
    assert can_stop(seen(1, 2, 3, needed + 1e-9, 10.0), 2.0)
    assert not can_stop(seen(1, 2, 3, needed - 1e-6, 10.0), 2.0)
    assert can_stop(seen(1, 2, 3, 0.0), 2.0), "it stands"
    assert not can_stop(seen(1, 2, 3, -0.01), 2.0), "it stands inside"


def test_conflicts_leave_out_movements_of_one_arm() -> None:
    conflicts = SITE.conflicts
    np.testing.assert_array_equal(conflicts, conflicts.T)
    for arm in range(4):
        assert not conflicts[3 * arm : 3 * arm + 3, 3 * arm : 3 * arm + 3].any()
    assert conflicts[FOUR.index(Movement(0, 2)), FOUR.index(Movement(1, 2))]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"demand": (1.0, 2.0)}, "demand must be 4 numbers"),
        ({"demand": (1.0, 2.0, 3.0, -1.0)}, "demand must be 4 numbers"),
        (
            {"fleet": VehicleType(length=12.0, width=2.5)},
            r"12 × 2\.5 m \(car\) do not fit lanes of 3\.2",
        ),
        ({"fleet": VehicleType(width=3.3)}, "do not fit lanes"),
        (
            {
                "fleet": VehicleType(length=12.0),
                "intersection": Intersection(
                    FOUR.bearings, lane_width=6.0, junction_radius=20.0, arm_length=31.0
                ),
            },
            "no vehicle of 12 m can be inserted on an approach lane of 11 m; .* more than 32, got",
        ),
    ],
)
def test_sites_are_checked(change: dict[str, object], message: str) -> None:
    options = {"intersection": FOUR, "fleet": VehicleType(), "speed_limit": 14.0}
    with pytest.raises(InputError, match=message):
        Site(**{**options, "demand": (350.0,) * 4, **change})  # type: ignore[arg-type]


def test_markings_are_checked() -> None:
    wrong: Any = ("red",), Marking("red", 30, 8)
    for markings, message in zip(wrong, ("must be a Marking", "must be a tuple"), strict=True):
        with pytest.raises(InputError, match=message):
            Plan(markings=markings)
    with pytest.raises(InputError, match=r"start of marking red .* above 30"):
        Marking("red", 8.0, 30.0)


def test_keeps_agrees_with_isinstance() -> None:
    """Members may be of the class or of the object; a method that is None is none."""

    class Own:
        def __init__(self, **members: Any) -> None:
            vars(self).update(members)

    def call(*_: Any) -> list[Any]:
        return []

    values = [
        Unregulated(), Unregulated().start(SITE), Own(), Own(plan=None, decide=call), Unregulated,
        Own(plan=Plan(), decide=None), Own(name=None, start=call), Own(start=call), None, 3,
        Own(plan=Plan(), decide=call, counts={}), Own(plan=Plan(), decide=call, kind=call),
    ]  # fmt: skip
    for protocol in (Controller, Session, Counting, Kinds):
        kept = [keeps(value, protocol) for value in values]
        assert kept == [isinstance(value, protocol) for value in values]
        assert 0 < sum(kept) < len(values)
