"""Safety monitors on a recording: TTC, DRAC, PET and braking, as SUMO's SSM device defines them.

All are functions of a trajectory frame (`run.trajectories`; record="junction" is enough) and its
site. They look at bodies on their paths:

* following — a vehicle and the one ahead in its lane, until the latter's rear has left their
  shared path; or the last one from another arm that is before it on the way to its exit lane.
  TTC = gap/Δv (Hayward 1972), DRAC = Δv²/(2·gap), both only while closing (Δv > 0).
* encroachment — two vehicles through the same conflict area of two movements.
  PET = time the second enters − time the first has left; 0 or less means both were inside.
* crossing — two vehicles with right of way on conflicting movements, at constant speed: where
  the second would enter the conflict area before the first has left it, TTC = d/v of the second.
  A vehicle without right of way is about to stop, so it crosses no other's course.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from minisim.control import Site
from minisim.errors import instance
from minisim.junction.conflicts import Areas, conflict_areas
from minisim.junction.movements import Bools
from minisim.junction.partings import branch
from minisim.junction.paths import Floats
from minisim.results.metrics import PETS
from minisim.results.trajectories import (
    ACCELERATION,
    RIGHT_OF_WAY,
    SPEED,
    TIME,
    VEHICLE,
    S,
    check_trajectories,
    movement_index,
)

if TYPE_CHECKING:
    import pandas as pd

Ints = npt.NDArray[np.int64]

#: Longer than any path [m]: keeps the vehicles apart in one ascending array.
_FAR = 1e6


class Rows(NamedTuple):
    """A trajectory frame as arrays, sorted by time, then vehicle; shape (rows,) each."""

    time: Floats
    step: Ints
    vehicle: Ints
    movement: Ints
    s: Floats
    v: Floats
    goes: Bools


def safety_summary(frame: pd.DataFrame, site: Site) -> dict[str, float | int | None]:
    """The worst of a recording; None where nothing of the kind happened.

    Returns:
        `min_ttc_s` (following and crossing), `min_pet_s`, `max_drac_mps2` (following),
        `max_braking_mps2`, the number of encroachments `pets`, and how many of them were short
        (`minisim.results.metrics.PETS`).

    Raises:
        InputError: a column is missing, or a movement that the site does not have.
    """
    rows = _rows(frame, site)
    follow = _following(rows, site)
    pets = _encroachments(rows, site)["pet_s"]
    ttc = np.concatenate([follow["ttc_s"], _crossings(rows, site)["ttc_s"]])
    braking = -frame[ACCELERATION].to_numpy(dtype=float)
    return {
        "min_ttc_s": _smallest(ttc),
        "min_pet_s": _smallest(pets),
        "max_drac_mps2": _largest(follow["drac_mps2"]),
        "max_braking_mps2": _largest(np.maximum(braking, 0.0)),
        "pets": len(pets),
        **{name: int((pets < limit).sum()) for name, limit in PETS.items()},
    }


def near_junction(frame: pd.DataFrame, site: Site) -> pd.DataFrame:
    """The part of a recording of everything that `record="junction"` keeps."""
    from minisim.engine.state import RECORD_BEFORE, RECORD_PAST

    paths = site.intersection.paths
    last = np.array([path.exit + RECORD_PAST for path in paths])
    s = frame[S].to_numpy()
    near = (s >= paths[0].entry - RECORD_BEFORE) & (s <= last[movement_index(frame, site)])
    return frame[near]


def following(frame: pd.DataFrame, site: Site) -> pd.DataFrame:
    """Every vehicle behind another at every step.

    Returns:
        Columns `time_s, follower, leader, gap_m, closing_mps, ttc_s, drac_mps2`. TTC is NaN
        while not closing and 0 where bodies overlap; DRAC needs a gap and is NaN without one.
    """
    return _frame(_following(_rows(frame, site), site))


def encroachments(frame: pd.DataFrame, site: Site) -> pd.DataFrame:
    """Every two vehicles one after the other through a conflict area of two movements.

    A vehicle that is inside when its recording ends counts as leaving then; one whose entry was
    not recorded does not count.

    Returns:
        Columns `time_s` (the second enters), `first, second, pet_s`, sorted by time.
    """
    return _frame(_encroachments(_rows(frame, site), site))


def crossings(frame: pd.DataFrame, site: Site) -> pd.DataFrame:
    """Every step at which two vehicles with right of way are on a crossing course.

    Returns:
        Columns `time_s, first, second, ttc_s`.
    """
    return _frame(_crossings(_rows(frame, site), site))


def _rows(frame: pd.DataFrame, site: Site) -> Rows:
    instance("site", site, Site)
    check_trajectories(frame)
    time = frame[TIME].to_numpy(dtype=float)
    vehicle = frame[VEHICLE].to_numpy(dtype=np.int64)
    order = np.lexsort((vehicle, time))
    time = time[order]
    s = frame[S].to_numpy(dtype=float)[order]
    movement = movement_index(frame, site)[order]
    entries = np.array([path.entry for path in site.intersection.paths])
    released = frame[RIGHT_OF_WAY].to_numpy(dtype=bool)[order]
    return Rows(
        time=time,
        step=np.cumsum(np.diff(time, prepend=time[:1]) > 0.0),
        vehicle=vehicle[order],
        movement=movement,
        s=s,
        v=frame[SPEED].to_numpy(dtype=float)[order],
        goes=released | (s >= entries[movement]),
    )


def _following(rows: Rows, site: Site) -> dict[str, npt.NDArray[Any]]:
    in_lane, to_exit = _leaders_in_lane(rows, site), _leaders_to_exit(rows, site)
    follower, leader, gap = (np.concatenate(both) for both in zip(in_lane, to_exit, strict=True))
    closing = rows.v[follower] - rows.v[leader]
    with np.errstate(divide="ignore", invalid="ignore"):
        ttc = np.where(closing > 0.0, np.maximum(gap, 0.0) / closing, np.nan)
        drac = np.where((closing > 0.0) & (gap > 0.0), closing**2 / (2.0 * gap), np.nan)
    return {
        "time_s": rows.time[follower],
        "follower": rows.vehicle[follower],
        "leader": rows.vehicle[leader],
        "gap_m": gap,
        "closing_mps": closing,
        "ttc_s": ttc,
        "drac_mps2": drac,
    }


def _leaders_in_lane(rows: Rows, site: Site) -> tuple[Ints, Ints, Floats]:
    """Row pairs of follower and the nearest one ahead in its lane that is in its way; gaps [m]."""
    parts = branch(site.intersection, site.vehicle)
    lane = site.intersection.movements.origins[rows.movement]
    order = np.lexsort((-rows.s, lane, rows.step))
    group = (rows.step * site.intersection.n + lane)[order]
    rear = rows.s - site.vehicle.length
    followers, leaders = [], []
    pending, back = np.arange(len(order)), 1
    while len(pending := pending[pending >= back]):
        pending = pending[group[pending - back] == group[pending]]
        follower, leader = order[pending], order[pending - back]
        in_way = rear[leader] < parts[rows.movement[leader], rows.movement[follower]]
        followers.append(follower[in_way])
        leaders.append(leader[in_way])
        pending, back = pending[~in_way], back + 1
    follower, leader = _join(followers), _join(leaders)
    return follower, leader, rear[leader] - rows.s[follower]


def _leaders_to_exit(rows: Rows, site: Site) -> tuple[Ints, Ints, Floats]:
    """Row pairs in and past the junction: the next one before it on the way to its exit lane.

    Only those from another arm, for the others are leaders in the lane; and only where a gap is
    left, for two bodies side by side are no followers yet.
    """
    paths = site.intersection.paths
    movements = site.intersection.movements
    origin, exit_arm = movements.origins[rows.movement], movements.exits[rows.movement]
    ends = np.array([(path.entry, path.exit) for path in paths])[rows.movement]
    inside = np.flatnonzero(rows.s >= ends[:, 0])
    past = rows.s - ends[:, 1]
    order = inside[np.lexsort((-past[inside], exit_arm[inside], rows.step[inside]))]
    follower, leader = order[1:], order[:-1]
    gap = past[leader] - site.vehicle.length - past[follower]
    pairs = (
        (rows.step[follower] == rows.step[leader])
        & (exit_arm[follower] == exit_arm[leader])
        & (origin[follower] != origin[leader])
        & (gap > 0.0)
    )
    return follower[pairs], leader[pairs], gap[pairs]


def _encroachments(rows: Rows, site: Site) -> dict[str, npt.NDArray[Any]]:
    areas = conflict_areas(site.intersection, site.vehicle)
    vehicle, movement, enter, leave = _passages(rows, areas)
    by_movement = [np.flatnonzero(movement == p) for p in range(len(areas.enter))]
    times, firsts, seconds, pets = [], [], [], []
    for p, q in np.argwhere(np.triu(np.isfinite(areas.enter))).tolist():
        passing = np.concatenate([by_movement[p], by_movement[q]])
        other = np.repeat([q, p], [len(by_movement[p]), len(by_movement[q])])
        start, end = enter[passing, other], leave[passing, other]
        order = np.argsort(start, kind="stable")
        order = order[np.isfinite(start[order])]
        first, second = order[:-1], order[1:]
        changes = other[first] != other[second]
        first, second = first[changes], second[changes]
        times.append(start[second])
        firsts.append(vehicle[passing[first]])
        seconds.append(vehicle[passing[second]])
        pets.append(start[second] - end[first])
    time = _join(times, np.float64)
    order = np.argsort(time, kind="stable")
    return {
        "time_s": time[order],
        "first": _join(firsts)[order],
        "second": _join(seconds)[order],
        "pet_s": _join(pets, np.float64)[order],
    }


def _passages(rows: Rows, areas: Areas) -> tuple[Ints, Ints, Floats, Floats]:
    """Each vehicle's id and movement (k,), and when it enters and leaves the areas (k, m) [s]."""
    if not len(rows.time):
        empty = np.empty((0, len(areas.enter)))
        return np.empty(0, np.int64), np.empty(0, np.int64), empty, empty
    order = np.lexsort((rows.time, rows.vehicle))
    vehicle, first, code = np.unique(rows.vehicle[order], return_index=True, return_inverse=True)
    s, movement = rows.s[order], rows.movement[order][first]
    last = np.append(first[1:], len(order)) - 1
    here = code * _FAR + s

    def when(place: Floats) -> Floats:
        """Time at which each vehicle's front passes its places (k, m)."""
        known = np.minimum(place, s[last, None])
        query = np.arange(len(vehicle))[:, None] * _FAR + known
        return np.asarray(np.interp(query, here, rows.time[order]))

    enter, leave = areas.enter[movement], areas.leave[movement]
    seen = (enter >= s[first, None]) & (enter <= s[last, None])
    return vehicle, movement, np.where(seen, when(enter), np.nan), when(leave)


def _crossings(rows: Rows, site: Site) -> dict[str, npt.NDArray[Any]]:
    areas = conflict_areas(site.intersection, site.vehicle)
    clear = np.array([path.exit for path in site.intersection.paths]) + site.vehicle.length
    going = np.flatnonzero(rows.goes & (rows.s < clear[rows.movement]))
    firsts, seconds, ttcs = [], [], []
    pending, ahead = np.arange(len(going)), 1
    while len(pending := pending[pending + ahead < len(going)]):
        pending = pending[rows.step[going[pending]] == rows.step[going[pending + ahead]]]
        a, b = going[pending], going[pending + ahead]
        p, q = rows.movement[a], rows.movement[b]
        meet = np.isfinite(areas.enter[p, q])
        a, b, p, q = a[meet], b[meet], p[meet], q[meet]
        a_in, a_out = _times(rows, a, areas.enter[p, q]), _times(rows, a, areas.leave[p, q])
        b_in, b_out = _times(rows, b, areas.enter[q, p]), _times(rows, b, areas.leave[q, p])
        a_first = a_in <= b_in
        late = np.where(a_first, b_in, a_in)
        free = np.where(a_first, a_out, b_out)
        course = (late > 0.0) & (late < free)
        firsts.append(np.where(a_first, a, b)[course])
        seconds.append(np.where(a_first, b, a)[course])
        ttcs.append(late[course])
        ahead += 1
    first, second = _join(firsts), _join(seconds)
    return {
        "time_s": rows.time[first],
        "first": rows.vehicle[first],
        "second": rows.vehicle[second],
        "ttc_s": _join(ttcs, np.float64),
    }


def _times(rows: Rows, row: Ints, place: Floats) -> Floats:
    """Time until the fronts pass `place` at their present speeds [s]; 0 where they have."""
    distance = place - rows.s[row]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(distance <= 0.0, 0.0, distance / rows.v[row])


def _join(parts: list[npt.NDArray[Any]], dtype: type = np.int64) -> npt.NDArray[Any]:
    return np.concatenate([np.empty(0, dtype), *parts])


def _smallest(values: Floats) -> float | None:
    values = values[np.isfinite(values)]
    return float(values.min()) if len(values) else None


def _largest(values: Floats) -> float | None:
    values = values[np.isfinite(values)]
    return float(values.max()) if len(values) else None


def _frame(columns: dict[str, npt.NDArray[Any]]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(columns)
