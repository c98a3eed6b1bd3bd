"""Geometry against closed forms: lengths, arcs, mirror images, bodies and corridors."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from minisim.errors import InputError
from minisim.junction.geometry import Intersection
from minisim.junction.movements import Movement
from minisim.vehicle import VehicleType

CAR = VehicleType()
SQUARE = (0.0, 90.0, 180.0, 270.0)
STAR = (0.0, 72.0, 144.0, 216.0, 288.0)
ODD = (10.0, 80.0, 190.5, 260.0, 300.0)


@pytest.fixture(scope="module", params=["left", "right"])
def square(request: pytest.FixtureRequest) -> Intersection:
    return Intersection(SQUARE, side=request.param)


def test_approach_lanes_are_as_long_as_in_the_authors_sumo_networks() -> None:
    for bearings, approach in (((0.0, 120.0, 240.0), 495.84), (SQUARE, 492.80)):
        assert Intersection(bearings).approach_length == pytest.approx(approach, abs=0.005)


def test_four_way_lengths_are_quarter_circles_and_a_straight_line() -> None:
    """Left-hand traffic, lanes of 3.2 m, entries 7.2 m out: radii 7.2 ∓ 1.6 m."""
    four = Intersection(SQUARE)
    paths = [four.path(Movement(0, j)) for j in (1, 2, 3)]
    assert [p.exit - p.entry for p in paths] == pytest.approx(
        [5.6 * math.pi / 2, 14.4, 8.8 * math.pi / 2], abs=1e-12
    )
    assert [p.radius for p in paths] == pytest.approx([5.6, math.inf, 8.8])
    assert [p.length for p in paths] == pytest.approx([2 * 492.8 + p.exit - p.entry for p in paths])


def test_default_radius_leaves_the_kerb_of_netconvert() -> None:
    """Kerb lines of neighbouring arms at 90° then meet in a circle of 4 m."""
    assert Intersection(SQUARE).junction_radius == pytest.approx(3.2 + 4.0)
    assert Intersection(SQUARE, lane_width=3.0).junction_radius == pytest.approx(7.0)
    smallest = Intersection((0.0, 30.0, 180.0)).junction_radius
    assert smallest == pytest.approx(7.2 / math.tan(math.radians(15.0)))


@pytest.mark.parametrize("bearings", [SQUARE, STAR, ODD])
@pytest.mark.parametrize("side", ["left", "right"])
def test_paths_are_arcs_tangent_to_both_lanes(bearings: tuple[float, ...], side: str) -> None:
    """The circle that the entry alone defines must meet the exit lane."""
    intersection = Intersection(bearings, side=side)  # type: ignore[arg-type]
    keep = 1.6 if side == "left" else -1.6
    for path in intersection.paths:
        arm = intersection.arms[path.exit_arm]
        out = np.array(arm.outward)
        exit_point = out * intersection.junction_radius + keep * np.array([-out[1], out[0]])
        np.testing.assert_allclose(path.points[-1], exit_point, atol=1e-12)
        np.testing.assert_allclose(path.heading_out, out)
        if math.isinf(path.radius):
            assert abs(np.linalg.det([path.heading_in, path.points[-1] - path.points[0]])) < 1e-12
            continue
        turn = np.linalg.det([path.heading_in, path.heading_out])  # positive to the left
        normal = np.array([-path.heading_in[1], path.heading_in[0]]) * np.sign(turn)
        centre = path.points[0] + path.radius * normal
        distance = np.linalg.norm(path.points - centre, axis=1)
        np.testing.assert_allclose(distance, path.radius, rtol=1e-9)
        assert abs((path.points[-1] - centre) @ path.heading_out) < 1e-9
        angle = math.acos(np.clip(path.heading_in @ path.heading_out, -1.0, 1.0))
        assert path.exit - path.entry == pytest.approx(path.radius * angle)


def test_an_almost_straight_path_joins_the_straight_one_smoothly() -> None:
    """Where arcs become lines (turns under 1e-4 rad), the path must not jump."""
    base = Intersection((0.0, 90.0, 180.0)).path(Movement(0, 2))
    for degrees in (0.004, 0.006, 0.02):
        bent = Intersection((0.0, 90.0, 180.0 + degrees)).path(Movement(0, 2))
        assert np.abs(bent.points - base.points).max() < 0.01
        assert bent.exit == pytest.approx(base.exit, abs=0.01)


def test_paths_start_and_end_at_the_far_ends_of_their_arms(square: Intersection) -> None:
    for path in square.paths:
        start, end = path.position([0.0, path.length])
        assert np.hypot(*np.array([start, end]).T) == pytest.approx(math.hypot(500.0, 1.6))
        assert end @ path.heading_out == pytest.approx(500.0)


def test_bodies_are_rectangles_with_both_bumpers_on_the_path(square: Intersection) -> None:
    for path in square.paths:
        s = np.linspace(path.entry, path.exit + CAR.length, 40)
        corners = path.bodies(s, CAR)
        rectangles = shapely.polygons(corners)
        np.testing.assert_allclose(shapely.area(rectangles), CAR.length * CAR.width, rtol=1e-12)
        front, rear = corners[:, :2].mean(axis=1), corners[:, 2:].mean(axis=1)
        heading = (front - rear) / CAR.length
        np.testing.assert_allclose(np.linalg.norm(heading, axis=1), 1.0)
        np.testing.assert_allclose(front, path.position(s), atol=1e-9)
        # The rear lies on the chord, which is shorter than the arc by L³/24R² at most.
        off = np.linalg.norm(rear - path.position(s - CAR.length), axis=1)
        assert off.max() <= CAR.length**3 / (24.0 * path.radius**2) + 0.005


def test_turn_speed_needs_exactly_the_lateral_acceleration() -> None:
    four = Intersection(SQUARE)
    v = four.turn_speed(Movement(0, 1), lateral=2.0)
    assert v * v / 5.6 == pytest.approx(2.0)
    assert four.turn_speed(Movement(0, 2), lateral=2.0) == math.inf


@pytest.mark.parametrize(
    ("bearings", "message"),
    [
        ((0, 90), "3 … 12 arms, got 2"),
        (tuple(range(0, 390, 30)), "3 … 12 arms, got 13"),
        ((0, 29, 180), "arms a and b are 29° apart; at least 30° are needed"),
        ((10, 180, 345), "arms c and a are 25° apart"),
        ((90, 0, 180), "did you mean 0, 90, 180"),
        ((0, 90, 360), "bearing 3 .* below 360, got 360"),
        ((-10, 90, 180), "bearing 1 .* at least 0"),
        ((0, 90, math.nan), r"bearings\[2\]"),
        ("abc", "bearings must be a sequence of numbers"),
        ((0, 0, 180), "arms a and b are 0° apart"),
    ],
)
def test_bearings_that_cannot_be_are_refused(bearings: tuple[float, ...], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Intersection(bearings)


def test_arms_exactly_at_the_least_angle_are_accepted() -> None:
    assert Intersection((0.0, 30.0, 60.0)).n == 3
    assert Intersection((0.1, 30.1, 180.0)).n == 3  # 30.1 − 0.1 is a rounding error below 30


def test_a_radius_fits_the_arms_and_a_car() -> None:
    with pytest.raises(InputError, match=r"junction_radius .* below 490"):
        Intersection(SQUARE, junction_radius=491)
    with pytest.raises(InputError, match=r"3\.9 m; a car needs 4 m \(the default here is 7\.2 m"):
        Intersection(SQUARE, junction_radius=5.5)


def test_intersections_are_values() -> None:
    assert Intersection(SQUARE) == Intersection([0, 90, 180, 270])  # type: ignore[arg-type]
    assert len({Intersection(SQUARE), Intersection(SQUARE), Intersection(STAR)}) == 2
