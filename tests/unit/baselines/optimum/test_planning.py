import math

import numpy as np
import pytest

from baselines.optimum.planning import drivable
from baselines.optimum.separations import necessary
from scenarios.library import four_way, three_way
from scenarios.profiles import FAIR, PAPER, Profile


@pytest.mark.parametrize("profile", [FAIR, PAPER], ids=lambda it: it.name)
def test_vehicles_are_driven_no_closer_than_they_must_be(profile: Profile) -> None:
    site = four_way(profile=profile, density=100.0).site()
    least, driven = necessary(site), drivable(site, 0.2)
    kept = least.rules.between > -math.inf
    assert (driven.rules.between[kept] >= least.rules.between[kept]).all()
    same = ~site.intersection.movements.apart
    assert np.isfinite(least.rules.between[same]).all()


def test_bodies_that_only_nearly_come_close_may_pass_at_once() -> None:
    """Two long ones on wide lanes, opposite each other: near, but at no place too near."""
    site = three_way(profile=FAIR, density=100.0, fleet="truck", lane_width=3.5).site()
    driven = drivable(site, 0.2)
    a, b = (site.intersection.movements.index_of[lane, j] for lane, j in ((0, 1), (1, 2)))
    assert driven.rules.between[a, b] == -math.inf
