"""Bodies near the junction, and which hides which."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import shapely
from hypothesis import given

from dim.senses.sight import Bodies, Body
from minisim.control import Site
from minisim.fleet import Fleet
from minisim.junction.geometry import Intersection
from minisim.testing import small_scenario
from minisim.vehicle import VehicleType
from scenarios.strategies import floats, intersections
from tests.builders import seen, share

SITE = small_scenario(4).site(0)
BODIES = Bodies(SITE)
HALF = SITE.vehicle.length / 2.0, SITE.vehicle.width / 2.0


def at(x: float, y: float, heading: float = 0.0) -> Body:
    """A body whose front points `heading` radians from east."""
    return Body(x, y, math.cos(heading), math.sin(heading), *HALF)


def outline(body: Body) -> shapely.Polygon:
    x, y, ux, uy, a, b = body
    return shapely.Polygon(
        [(x + i * a * ux - j * b * uy, y + i * a * uy + j * b * ux)
         for i, j in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
    )  # fmt: skip


@share(0.3)
@given(intersections(), floats(-20.0, 30.0))
def test_a_body_is_where_its_path_has_it(junction: Intersection, distance: float) -> None:
    """On every way: before the junction, with one bumper in it or both, and beyond it."""
    types = VehicleType(), VehicleType(name="dragging", rear_axle=3.5)
    bodies = Bodies(Site(junction, Fleet(types, ((0.5,), (0.5,))), 14.0, (100.0,) * junction.n))
    for path, (k, it) in itertools.product(junction.paths, enumerate(types)):
        through = path.exit - path.entry
        for past in (-distance, 0.0, 2.0, through / 2, through - 0.1, through + 1.0, through + 9.0):
            centre, heading = path.pose(path.entry + past, it)
            body = bodies.body(seen(0, *path.movement, -past)._replace(type=k))
            assert body[:4] == pytest.approx((*centre, *heading), abs=1e-9), (path.movement, past)


def test_a_body_between_hides_and_one_beside_does_not() -> None:
    eye, target = at(0, 0), at(30, 0)
    assert BODIES.hidden(eye, target, [at(15, 0, math.pi / 2)])  # across the line
    assert not BODIES.hidden(eye, target, [at(15, 6)])
    assert not BODIES.hidden(eye, target, [at(40, 0)])  # behind the target
    assert not BODIES.hidden(eye, target, [])


def test_hidden_is_what_shapely_says_in_many_scenes() -> None:
    random, answers = np.random.default_rng(1), []
    for _ in range(300):
        target, *others = (
            at(x, y, heading)
            for x, y, heading in zip(
                random.uniform(5, 20, 4), random.uniform(-4, 4, 4), random.uniform(0, 6.3, 4),
                strict=True,
            )
        )  # fmt: skip
        eye = at(*random.uniform(-2, 2, 2))
        blocking = [outline(body) for body in others]
        ends = [*list(outline(target).exterior.coords)[:4], (target.x, target.y)]
        lines = [shapely.LineString([(eye.x, eye.y), end]) for end in ends]
        hidden = all(any(line.intersects(area) for area in blocking) for line in lines)
        assert BODIES.hidden(eye, target, others) == hidden
        answers.append(hidden)
    assert 0.2 < sum(answers) / 300 < 0.8
