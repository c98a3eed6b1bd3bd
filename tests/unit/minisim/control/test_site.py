"""Sites are checked, and know which movements conflict."""

from __future__ import annotations

import numpy as np
import pytest

from minisim.control import (
    Site,
)
from minisim.errors import InputError
from minisim.junction.geometry import Intersection
from minisim.junction.movements import Movement
from minisim.vehicle import VehicleType

FOUR = Intersection((0.0, 90.0, 180.0, 270.0))
SITE = Site(FOUR, VehicleType(), speed_limit=14.0, demand=(350.0,) * 4)


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
