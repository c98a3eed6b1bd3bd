"""One point in plain floats against many at once; bodies that drag a rear axle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given

from minisim.errors import InputError
from minisim.junction.geometry import Intersection
from minisim.junction.movements import Movement
from minisim.junction.paths import Path, dragged, locate, trail_of
from minisim.vehicle import VehicleType
from scenarios.strategies import floats, intersections
from tests.builders import share

AXLE = 8.0
BUS = VehicleType(length=10.1, width=2.4, rear_axle=AXLE)


@given(intersections())
def test_one_point_is_where_the_path_has_it(junction: Intersection) -> None:
    """Before the junction, at its ends, within, and beyond it; with lists and with arrays."""
    for path in junction.paths:
        headings = np.concatenate([path.heading_in, path.heading_out])
        past = np.array([-20.0, 0.0, *np.linspace(0.0, path.crossing, 9), path.crossing + 7.0])
        expected = path.position(path.entry + past)
        _, along = path.pose(path.entry + past, BUS)
        halves = trail_of(path, AXLE).halves
        for points, ends, trail in (
            (path.points, headings, halves),
            (path.points.tolist(), headings.tolist(), halves.tolist()),
        ):
            ours = [locate(points, ends, path.crossing, float(d)) for d in past]
            np.testing.assert_allclose(ours, expected, atol=1e-9)
            ours = [dragged(points, ends, path.crossing, float(d), trail, AXLE) for d in past]
            np.testing.assert_allclose(ours, along, atol=1e-9)


def rear_axle(path: Path, s: np.ndarray) -> np.ndarray:
    """The middle of the bus's rear axle with its front bumper at `s`, shape (..., 2) [m]."""
    return path.position(s) - AXLE * path.pose(s, BUS)[1]


def arc(radius: float, angle: float) -> Path:
    """A path around the origin, from heading north at (radius, 0)."""
    turn = np.linspace(0.0, angle, 33)
    points = radius * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    end = np.array([-math.sin(angle), math.cos(angle)])
    exit = 50.0 + radius * angle
    north = np.array([0.0, 1.0])
    return Path(Movement(0, 1), 1, 50.0, exit, exit + 100.0, radius, points, north, end)


@pytest.mark.parametrize("radius", [12.0, 20.0, 40.0])
def test_on_a_long_arc_the_rear_axle_follows_one_of_its_own(radius: float) -> None:
    """Its radius is √(R² − ℓ²), as front, rear axle and centre make a right-angled triangle."""
    path = arc(radius, 1.5 * math.pi)
    last = np.linspace(path.exit - 4.0, path.exit, 50)
    inner = np.linalg.norm(rear_axle(path, last), axis=-1)
    assert inner.mean() == pytest.approx(math.sqrt(radius**2 - AXLE**2), rel=0.01)


def test_on_a_straight_exit_the_rear_axle_runs_on_a_tractrix() -> None:
    """x = ℓ·ln((ℓ + √(ℓ² − y²))/y) − √(ℓ² − y²), with y its distance from the lane's middle."""
    path = arc(12.0, math.pi / 2.0)  # it leaves towards west, along y = 12
    s = path.exit + np.linspace(0.0, 25.0, 40)
    rear = rear_axle(path, s)
    y = 12.0 - rear[:, 1]
    assert y[0] > 2.0
    root = np.sqrt(AXLE**2 - y**2)
    x = AXLE * np.log((AXLE + root) / y) - root
    np.testing.assert_allclose(np.diff(-rear[:, 0]), np.diff(x), atol=1e-9)


@share(0.2)
@given(intersections(), floats(0.5, 12.0))
def test_a_rear_axle_only_rolls_along_its_body(junction: Intersection, axle: float) -> None:
    vehicle = VehicleType(length=12.0, rear_axle=axle)
    for path in junction.paths:
        s = np.linspace(path.entry - 2.0, path.exit + 20.0, 4000)
        headings = path.pose(s, vehicle)[1]
        rear = path.position(s) - axle * headings
        moved, along = np.diff(rear, axis=0), (headings[1:] + headings[:-1]) / 2.0
        sideways = moved[:, 0] * along[:, 1] - moved[:, 1] * along[:, 0]
        assert np.abs(sideways).max() < 3e-4, "a step is at least 10 mm"
        np.testing.assert_allclose(headings[0], path.heading_in, atol=1e-12)


def test_a_rear_axle_lies_on_the_body_and_not_on_one_of_sumos() -> None:
    with pytest.raises(InputError, match=r"rear_axle \[m\] must be above 0 and at most 5, got 6"):
        VehicleType(rear_axle=6.0)
    with pytest.raises(InputError, match=r"SUMO's rules \(sumo=…\) has no rear_axle"):
        VehicleType(rear_axle=3.0, model="krauss", sumo="1.18")
