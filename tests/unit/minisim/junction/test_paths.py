"""One point in plain floats against many at once."""

from __future__ import annotations

import numpy as np
from hypothesis import given

from minisim.junction.geometry import Intersection
from minisim.junction.paths import locate
from scenarios.strategies import intersections


@given(intersections())
def test_one_point_is_where_the_path_has_it(junction: Intersection) -> None:
    """Before the junction, at its ends, within, and beyond it; with lists and with arrays."""
    for path in junction.paths:
        headings = np.concatenate([path.heading_in, path.heading_out])
        past = np.array([-20.0, 0.0, *np.linspace(0.0, path.crossing, 9), path.crossing + 7.0])
        expected = path.position(path.entry + past)
        for points, ends in ((path.points, headings), (path.points.tolist(), headings.tolist())):
            ours = [locate(points, ends, path.crossing, float(d)) for d in past]
            np.testing.assert_allclose(ours, expected, atol=1e-9)
