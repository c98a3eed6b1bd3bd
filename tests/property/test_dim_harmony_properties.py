"""Harmony over random geometries: mirroring, clearance, bigger vehicles."""

from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from dim import HarmonyMatrix
from minisim.junction.geometry import Intersection
from minisim.junction.movements import Movement
from minisim.vehicle import VehicleType
from scenarios.strategies import fleets, intersections, vehicles
from tests.builders import share


def mirrored(intersection: Intersection) -> tuple[Intersection, list[Movement]]:
    """The mirror image (east for west), and for each movement the one that it becomes."""
    images = [(360.0 - b) % 360.0 for b in intersection.bearings]
    bearings = sorted(images)
    side = "right" if intersection.side == "left" else "left"
    image = dataclasses.replace(intersection, bearings=tuple(bearings), side=side)
    # The j-th arm clockwise is the (n−j)-th clockwise in the mirror.
    return image, [
        Movement(bearings.index(images[m.origin]), intersection.n - m.manoeuvre)
        for m in intersection.movements
    ]


@settings(max_examples=30)
@given(intersections(max_arms=5), vehicles())
def test_a_mirror_mirrors_the_matrix(intersection: Intersection, vehicle: VehicleType) -> None:
    image, becomes = mirrored(intersection)
    matrix = HarmonyMatrix.from_geometry(intersection, vehicle)
    reflected = HarmonyMatrix.from_geometry(image, vehicle)
    rows = [reflected.index(m) for m in becomes]
    np.testing.assert_array_equal(matrix.values, reflected.values[np.ix_(rows, rows)])


def test_the_mirror_moves_what_it_should() -> None:
    """Guards the property above: on 4 arms left and right turns and the arms b, d swap."""
    _, becomes = mirrored(Intersection((0.0, 90.0, 180.0, 270.0)))
    assert " ".join(map(str, becomes)) == "a3 a2 a1 d3 d2 d1 c3 c2 c1 b3 b2 b1"


@settings(max_examples=12)
@given(intersections(max_arms=5), st.floats(0.0, 0.5))
def test_wider_vehicles_only_remove_harmony(intersection: Intersection, extra: float) -> None:
    narrow = HarmonyMatrix.from_geometry(intersection, VehicleType(width=1.6))
    wide = HarmonyMatrix.from_geometry(intersection, VehicleType(width=1.6 + extra))
    assert not np.any(wide.values & ~narrow.values)


@share(0.03)
@given(intersections(), st.data())
def test_harmony_by_type_is_that_of_two_types_and_the_worst_is_all_of_it(
    junction: Intersection, data: st.DataObject
) -> None:
    fleet = data.draw(fleets(junction))
    types, m = len(fleet.types), len(junction.movements)
    matrix = HarmonyMatrix.from_geometry(junction, fleet, by_type=True)
    assert matrix.types == types
    blocks = matrix.values.reshape(types, m, types, m)
    worst = HarmonyMatrix.from_geometry(junction, fleet).values
    np.testing.assert_array_equal(blocks.all(axis=(0, 2)), worst)
    for k, it in enumerate(fleet.types):
        own = HarmonyMatrix.from_geometry(junction, it).values
        np.testing.assert_array_equal(blocks[k, :, k], own)
        for movement in junction.movements:
            typed = Movement(movement.origin, k * (junction.n - 1) + movement.manoeuvre)
            assert matrix.index(typed) == k * m + junction.index(movement)
