"""The arrays that a run consists of.

Vehicles form one structured array sorted by (lane, demand time), so the vehicle ahead in a lane is
the row before. Lanes form another array. `Layout` and `Law` hold what never changes during a run.
Few arguments keep a call into the compiled kernel cheap, since unboxing arrays is most of its cost.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple, get_type_hints

import numpy as np
import numpy.typing as npt

from minisim.arrivals import LEAST_FACTOR, MOST_FACTOR, Arrivals
from minisim.control import LATERAL_ACCELERATION, Marking, Observed, Plan, Site
from minisim.fleet import Fleet
from minisim.jit import COMPILED
from minisim.junction.geometry import Intersection
from minisim.junction.partings import branch
from minisim.junction.paths import Path, trail_of
from minisim.laws import Traits, traits_of
from minisim.streams import Draws

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Records = npt.NDArray[np.void]

#: Values of the field `status`.
WAITING, DRIVING, ARRIVED = 0, 1, 2

VEHICLE = np.dtype(
    [
        ("id", np.int64),  # row of the trip table
        ("lane", np.int64),
        ("rank", np.int64),  # its place among the vehicles of its lane
        ("manoeuvre", np.int64),
        ("path", np.int64),  # index of the movement
        ("type", np.int64),  # index into `Layout.types`
        ("demand_tick", np.int64),
        ("length", np.float64),  # of its type [m]
        ("b_max", np.float64),  # the most that its brakes can do [m/s²]
        ("factor", np.float64),  # the driver's factor on the speed limit
        ("status", np.int64),
        ("s", np.float64),  # front bumper on its path [m], see `minisim.junction.paths`
        ("v", np.float64),  # [m/s]
        ("a", np.float64),  # of the step just taken [m/s²]
        ("section", np.int64),  # of the speed profile
        ("mark", np.int64),  # next wake-up mark
        ("ahead", np.int64),  # last vehicle ahead bound for the same exit lane, or -1
        ("cleared", np.int64),  # rear bumper has left the junction
        ("go", np.int64),  # has a right of way of its own
        ("advice", np.float64),  # cap on its speed [m/s]
        ("told", np.float64),  # acceleration in place of its wish [m/s²], or infinite
        ("brake", np.float64),  # cap on its acceleration [m/s²]: negative, or infinite
        ("depart_tick", np.int64),
        ("arrival_tick", np.int64),
        ("waiting_ticks", np.int64),
        ("lost_ticks", np.float64),
    ]
)

#: The right of way of an open lane is about to end (`minisim.control.Open`).
AMBER = 2

LANE = np.dtype(
    [
        ("end", np.int64),  # one past its last row
        ("first", np.int64),  # first row not yet arrived
        ("next", np.int64),  # next row to be inserted
        ("front", np.int64),  # first row whose front has not entered the junction
        ("open", np.int64),  # 0, 1 or `AMBER`
        ("last", np.int64),  # last row that entered the junction for the exit lane of this arm
        ("tail", np.int64),  # its slot (`minisim.engine.packed`), or -1 once it has arrived
        ("slot", np.int64),  # slot of its first vehicle on the road
        ("driving", np.int64),  # how many it has there
        ("entered", np.int64),  # how many of these have entered the junction
    ]
)

#: The fields of `minisim.laws.Traits`.
TRAITS = np.dtype([(name, np.float64) for name in Traits._fields])

#: One line of a trajectory recording.
TRACE = np.dtype([
    ("tick", np.int64), ("row", np.int64), ("s", np.float64), ("v", np.float64), ("a", np.float64),
    ("released", np.int64),
])  # fmt: skip

_TYPES = {int: np.int64, float: np.float64}

#: The fields of `minisim.control.Observed`.
OBSERVED = np.dtype([(name, _TYPES[kind]) for name, kind in get_type_hints(Observed).items()])


class Layout(NamedTuple):
    """The paths as arrays; p counts movements, k sections of the speed profile."""

    #: (p, 4): `s` of the junction exit and of the road's end [m], index of exit arm, `s` of the
    #: road's beginning [m]
    ends: Floats
    shape: Floats  #: (p, ARC_SEGMENTS + 1, 2): polyline from entry to exit [m]
    headings: Floats  #: (p, 4): unit vectors in (x, y) and out (x, y)
    section_start: Floats  #: (p, k) [m], infinite past the last section
    section_speed: Floats  #: (p, k): limit from there on [m/s]
    branch: Floats  #: (p, p) [m], see `minisim.junction.partings.branch`
    marks: Floats  #: (j,): `s` of the wake-up marks, ascending, the last one infinite [m]
    trails: Floats  #: (types, p, ARC_SEGMENTS + 1): `minisim.junction.paths.Trail.halves`
    types: Any  #: `Traits` of each type of vehicle, as records where the kernel is compiled


def build_layout(site: Site, plan: Plan) -> Layout:
    """Lay out the paths with the speed profile of the site and the plan's markings.

    Runs that differ in nothing of that share it.
    """
    limits = tuple(site.limit(arm) for arm in range(site.intersection.n))
    return _layout(
        site.intersection, site.fleet, limits, site.speed_limit, plan.markings, plan.marks
    )


@lru_cache(maxsize=64)
def _layout(
    intersection: Intersection, fleet: Fleet, limits: tuple[float, ...], speed_limit: float,
    markings: tuple[Marking, ...], marks: tuple[float, ...],
) -> Layout:  # fmt: skip
    paths = intersection.paths
    profiles = [_speed_profile(intersection, path, limits, markings) for path in paths]
    width = max(len(profile) for profile in profiles) + 1
    start = np.full((len(paths), width), np.inf)
    speed = np.full((len(paths), width), speed_limit)  # of sections that never begin
    for p, profile in enumerate(profiles):
        for k, (s, limit) in enumerate(profile):
            start[p, k], speed[p, k] = s, limit
    ascending = sorted(intersection.approach_length - distance for distance in marks)
    return Layout(
        ends=np.array([(p.exit, p.length, float(p.exit_arm), p.start) for p in paths]),
        shape=np.array([p.points for p in paths]),
        headings=np.array([(*p.heading_in, *p.heading_out) for p in paths]),
        section_start=start,
        section_speed=speed,
        branch=np.array(branch(intersection, fleet)),
        trails=_trails(intersection, fleet),
        marks=np.array([*ascending, np.inf]),
        types=_types(fleet),
    )


def _trails(intersection: Intersection, fleet: Fleet) -> Floats:
    """The trails of each type on each path, shape (types, p, points); 0 for chords."""
    paths = intersection.paths
    return np.array([
        [trail_of(path, it.rear_axle).halves if it.rear_axle else np.zeros(len(path.points))
         for path in paths]
        for it in fleet.types
    ])  # fmt: skip


def _types(fleet: Fleet) -> Any:
    """The traits of the types, as the kernel reads them fastest."""
    traits = tuple(map(traits_of, fleet.types))
    records = np.array([tuple(it) for it in traits], TRAITS)
    return records.view(np.recarray) if COMPILED else traits


def _speed_profile(
    intersection: Intersection, path: Path, limits: Sequence[float], markings: Iterable[Marking]
) -> list[tuple[float, float]]:
    """Piecewise-constant limit along a path: ascending (start [m], speed [m/s])."""
    before, behind = limits[path.movement.origin], limits[path.exit_arm]
    turn = intersection.turn_speed(path.movement, LATERAL_ACCELERATION)
    stretches = [(0.0, path.exit, before), (path.entry, path.exit, turn)]
    stretches += [(path.exit, np.inf, behind)]
    stretches += [
        (path.entry - m.start, path.entry - m.end, m.speed) for m in markings if m.speed is not None
    ]
    edges = sorted({max(s, 0.0) for *ends, _ in stretches for s in ends if s < np.inf})
    profile: list[tuple[float, float]] = []
    for edge in edges:
        limit = min(speed for start, end, speed in stretches if start <= edge < end)
        if not profile or profile[-1][1] != limit:
            profile.append((edge, limit))
    return profile


def build_vehicles(site: Site, arrivals: Arrivals) -> Records:
    """All vehicles of an arrival table, sorted by (lane, demand time), none on the road yet."""
    order = np.lexsort((arrivals.time, arrivals.lane))
    vehicles = np.zeros(len(order), VEHICLE)
    vehicles["id"] = order
    vehicles["lane"] = arrivals.lane[order]
    vehicles["rank"] = arrivals.rank[order]
    vehicles["manoeuvre"] = arrivals.manoeuvre[order]
    index_of = site.intersection.movements.index_of
    vehicles["path"] = index_of[vehicles["lane"], vehicles["manoeuvre"]]
    vehicles["demand_tick"] = np.ceil(arrivals.time[order] / site.dt - 1e-6)
    vehicles["type"] = types_of(site, arrivals)[order]
    kinds = vehicles["type"]
    vehicles["length"] = np.array([it.length for it in site.types], float)[kinds]
    vehicles["b_max"] = np.array([it.max_deceleration for it in site.types], float)[kinds]
    factors = arrivals.speed_factor
    vehicles["factor"] = _speed_factors(site, vehicles) if factors is None else factors[order]
    for name in ("ahead", "depart_tick", "arrival_tick"):
        vehicles[name] = -1
    for name in ("advice", "told", "brake"):
        vehicles[name] = np.inf
    return vehicles


def types_of(site: Site, arrivals: Arrivals) -> Ints:
    """Index of each vehicle's type, as recorded or drawn, in the order of the arrivals."""
    if arrivals.type is not None:
        return site.fleet.indices(arrivals.type)
    return site.fleet.drawn(arrivals.lane, arrivals.rank, site.seed)


def _speed_factors(site: Site, vehicles: Records) -> Floats:
    deviation = np.array([it.speed_deviation for it in site.types])[vehicles["type"]]
    if not deviation.any():
        return np.ones(len(vehicles))
    draws = Draws(site.seed, "drivers")
    drawn = [draws.normal(*which) for which in vehicles[["lane", "rank"]].tolist()]
    factors: Floats = 1.0 + deviation * np.array(drawn, float)
    return factors.clip(LEAST_FACTOR, MOST_FACTOR)


def build_lanes(site: Site, vehicles: Records, lanes_open: bool) -> Records:
    """The lanes, with their rows in the vehicle array."""
    n = site.intersection.n
    starts = np.searchsorted(vehicles["lane"], np.arange(n + 1))
    lanes = np.zeros(n, LANE)
    lanes["end"] = starts[1:]
    for name in ("first", "next", "front"):
        lanes[name] = starts[:-1]
    lanes["open"] = lanes_open
    for name in ("last", "tail"):
        lanes[name] = -1
    return lanes
