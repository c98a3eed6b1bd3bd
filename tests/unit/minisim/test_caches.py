"""What runs share because it depends on values alone."""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from dim import Dim
from dim.harmony import HarmonyMatrix
from minisim import simulate
from minisim.engine.state import build_layout
from minisim.errors import InputError
from minisim.junction.geometry import Intersection
from minisim.laws import build_law
from scenarios.library import four_way

SHORT = four_way(350, horizon=30)


def test_runs_that_differ_by_their_seed_share_road_law_plan_and_harmony() -> None:
    one, other = (SHORT.site(seed) for seed in (1, 2))
    plan, same = (Dim().start(site).plan for site in (one, other))
    assert (one.seed, other.seed) == (1, 2)
    assert plan is same
    assert build_layout(one, plan) is build_layout(other, plan)
    assert build_law(one, plan) is build_law(other, plan)
    assert Dim().harmony(one) is Dim().harmony(other)


def test_what_differs_is_not_shared() -> None:
    site, slower = SHORT.site(), replace(SHORT.site(), speed_limit=8.0)
    plan = Dim().start(site).plan
    later = replace(plan, marks=(3.0,))
    assert build_layout(site, plan).section_speed.max() > 8.0
    assert build_layout(slower, plan).section_speed.max() == 8.0
    assert len(build_layout(site, later).marks) == 2
    assert build_law(site, replace(plan, sight=77.0)).sight == 77.0
    assert build_law(replace(site, dt=0.05), plan).dt == 0.05
    near, far = (HarmonyMatrix.from_geometry(site.intersection, clearance=c) for c in (0.0, 5.0))
    assert near.values.sum() > far.values.sum()


def test_threads_get_the_same_runs() -> None:
    """Each begins with whatever the others have left in the caches."""

    def trips(seed: int) -> list[float]:
        return simulate(SHORT, Dim(), seed=seed).columns.travel_time.tolist()

    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(trips, range(12)))
    assert together == [trips(seed) for seed in range(12)]


def test_only_the_seed_of_a_cached_site_is_checked() -> None:
    with pytest.raises(InputError, match="seed"):
        SHORT.site(-1)
    assert replace(SHORT.site(3), seed=0) == SHORT.site()


def test_a_junction_travels_without_what_follows_from_it() -> None:
    junction = Intersection((0.0, 100.0, 200.0))
    plain = pickle.dumps(junction)
    assert len(junction.bundle.lines) == 6
    assert pickle.dumps(junction) == plain
    assert pickle.loads(plain) == junction
