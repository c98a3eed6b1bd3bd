"""Where movements of one lane part, against the formula of the arc."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from minisim.fleet import Fleet
from minisim.junction.geometry import Intersection
from minisim.junction.movements import Movement
from minisim.junction.partings import branch, parting, showing, turning_room
from minisim.vehicle import VehicleType

CAR = VehicleType()
SQUARE = (0.0, 90.0, 180.0, 270.0)
FOUR = Intersection(SQUARE)


@pytest.mark.parametrize("side", ["left", "right"])
def test_branch_lies_in_the_junction_and_only_between_movements_of_one_arm(side: str) -> None:
    square = Intersection(SQUARE, side=side)
    leaves = branch(square, CAR)
    for p, q in itertools.product(range(12), repeat=2):
        if p == q:
            assert leaves[p, q] == math.inf
        elif p // 3 != q // 3:
            assert leaves[p, q] == 0.0
        else:
            assert square.paths[p].entry < leaves[p, q] < square.paths[p].exit + 1.0


def test_branch_from_a_straight_path_is_where_the_arc_is_left_behind() -> None:
    """The rear bumper must be 1.8 + 0.5 m from the arc of radius 5.6 m: 1 − cos, in closed form.

    Seen from the arc's path q the straight path p leaves the circle: at x past the entry it is
    √(R² + x²) − R away.
    """
    left, straight = FOUR.index(Movement(0, 1)), FOUR.index(Movement(0, 2))
    x = math.sqrt((5.6 + 2.3) ** 2 - 5.6**2)
    assert branch(FOUR, CAR)[straight, left] == pytest.approx(FOUR.approach_length + x, abs=0.3)
    angle = math.acos(1.0 - 2.3 / 5.6)
    along_arc = 5.6 * angle
    wanted = FOUR.approach_length + along_arc
    assert branch(FOUR, CAR)[left, straight] == pytest.approx(wanted, abs=0.3)


@pytest.mark.parametrize("tolerance", [0.1, 0.3, 0.6])
def test_a_turn_shows_where_the_arc_has_left_the_straight_lane(tolerance: float) -> None:
    """Beside a straight line an arc of radius r is r(1 − cos(s/r)) after s."""
    shows = showing(FOUR, tolerance)
    for turn in (0, 2):
        radius = FOUR.paths[turn].radius
        expected = radius * math.acos(1.0 - tolerance / radius)
        assert shows[turn, 1] == pytest.approx(expected, abs=0.06)
    assert shows[0, 0] == math.inf
    assert (shows[:3, 3:] == 0.0).all()


@pytest.mark.parametrize("apart", [0.3, 1.0, 2.0])
def test_ways_part_where_the_arc_has_left_the_straight_line(apart: float) -> None:
    """After s an arc of radius r is at r(1 − cos(s/r)), r·sin(s/r): to the tenth of a metre."""
    parts = parting(FOUR, apart)
    for turn in (0, 2):
        r = FOUR.paths[turn].radius
        s = np.arange(0.0, 10.0, 1e-4)
        gaps = np.hypot(r * (1.0 - np.cos(s / r)), s - r * np.sin(s / r))
        first = float(s[np.argmax(gaps > apart)])
        for measured in (parts[turn, 1], parts[1, turn]):
            assert first - 1e-3 <= measured <= first + 0.1 + 1e-3
    assert (np.diag(parts) == math.inf).all()
    assert (parts[FOUR.movements.apart] == -math.inf).all()
    assert (parting(FOUR, 1e3)[0, :3] == math.inf).all()  # never so far


def test_corners_need_room_in_a_turn_as_on_one_arc() -> None:
    """The tightest turn of four arms has a radius of 5.6 m; the search is in steps of w/10."""
    for length, width in ((5.0, 1.8), (4.0, 2.0)):
        arc = width * math.tan(math.asin(length / (2.0 * 5.6)))
        room = turning_room(FOUR, Fleet((VehicleType(length=length, width=width),)))
        assert arc <= room <= arc + 0.2 * width
