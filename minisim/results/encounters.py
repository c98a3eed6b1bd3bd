"""Encounters of vehicles in a recording: followings, encroachments and crossing courses.

They are those of SUMO's SSM device:

* following — a vehicle and its leader: the vehicle ahead in the same lane, until its rear has left
  their shared path, or the next one from another arm bound for the same exit lane.
  TTC = gap/Δv (Hayward 1972) and DRAC = Δv²/(2·gap), both only while closing (Δv > 0).
* encroachment — two vehicles passing through the same conflict area of two movements.
  PET = time when the second enters − time when the first has left; at 0 or less, both were inside.
* crossing — two vehicles with right of way on conflicting movements. If, at constant speed, the
  second would enter the conflict area before the first has left it, TTC = d/v of the second.
  A vehicle without right of way is about to stop, so it is not on a crossing course.
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
from minisim.results.trajectories import (
    ACCELERATION,
    RIGHT_OF_WAY,
    SPEED,
    TIME,
    TYPE,
    VEHICLE,
    S,
    check_columns,
    movement_index,
)  # fmt: skip
from minisim.results.trips import Columns, Ints

if TYPE_CHECKING:
    import pandas as pd

    from minisim.results.run import Run

#: Longer than any path [m]: keeps vehicles apart in one ascending array.
_FAR = 1e6


class Rows(NamedTuple):
    """A recording as arrays, sorted by time, then by vehicle; shape (rows,) each."""

    time: Floats
    step: Ints
    vehicle: Ints
    movement: Ints
    type: Ints
    length: Floats
    s: Floats
    v: Floats
    a: Floats
    goes: Bools


class Encounters(NamedTuple):
    """The columns of `following`, `encroachments` and `crossings`, and all accelerations [m/s²]."""

    follow: Columns
    encroach: Columns
    cross: Columns
    a: Floats


def encounters_of(run: Run) -> Encounters:
    """Those in what `record="junction"` keeps; raises `InputError` without a recording.

    It makes no frame, since pandas takes longer to load than a run to be measured.
    """
    from minisim.laws import RECORD_BEFORE, RECORD_PAST

    trace, rows = run.recorded(RECORD_BEFORE, RECORD_PAST)
    recording = _recording(
        run.site, np.round(trace["tick"] * run.site.dt, 6), rows["id"], rows["path"], rows["type"],
        trace["s"], trace["v"], trace["a"], trace["released"] != 0,
    )  # fmt: skip
    return _encounters(recording, run.site)


def encounters_in(frame: pd.DataFrame, site: Site) -> Encounters:
    """Those in a trajectory frame; raises `InputError` as `safety_summary`."""
    return _encounters(_rows(frame, site), site)


def _encounters(rows: Rows, site: Site) -> Encounters:
    tables = _following(rows, site), _encroachments(rows, site), _crossings(rows, site)
    return Encounters(*tables, rows.a)


def following(frame: pd.DataFrame, site: Site) -> pd.DataFrame:
    """Each follower and its leader at each step.

    Columns `time_s, follower, leader, gap_m, closing_mps, ttc_s, drac_mps2`. TTC is NaN while not
    closing, and 0 where bodies overlap. DRAC is NaN without a gap.
    """
    return _frame(_following(_rows(frame, site), site))


def _following(rows: Rows, site: Site) -> Columns:
    in_lane, to_exit = _leaders_in_lane(rows, site), _leaders_to_exit(rows, site)
    follower, leader, gap = (np.concatenate(both) for both in zip(in_lane, to_exit, strict=True))
    closing = rows.v[follower] - rows.v[leader]
    with np.errstate(divide="ignore", invalid="ignore"):
        ttc = np.where(closing > 0.0, np.maximum(gap, 0.0) / closing, np.nan)
        drac = np.where((closing > 0.0) & (gap > 0.0), closing**2 / (2.0 * gap), np.nan)
    return {
        "time_s": rows.time[follower], "follower": rows.vehicle[follower],
        "leader": rows.vehicle[leader], "gap_m": gap, "closing_mps": closing, "ttc_s": ttc,
        "drac_mps2": drac,
    }  # fmt: skip


def encroachments(frame: pd.DataFrame, site: Site) -> pd.DataFrame:
    """Each pair of vehicles that pass a conflict area of two movements one after the other.

    A vehicle still inside when its recording ends counts as leaving then; one whose entry was not
    recorded does not count. Columns `time_s` (the second enters; sorted), `first, second, pet_s`.
    """
    return _frame(_encroachments(_rows(frame, site), site))


def _encroachments(rows: Rows, site: Site) -> Columns:
    areas = _areas(site)
    vehicle, movement, enter, leave = _passages(rows, areas)
    by_movement = [np.flatnonzero(movement == p) for p in range(areas.enter.shape[1])]
    pairs = [np.empty((0, 4))]
    for p, q in np.argwhere(np.triu(np.isfinite(areas.enter).any(axis=0))).tolist():
        passing = np.concatenate([by_movement[p], by_movement[q]])
        other = np.repeat([q, p], [len(by_movement[p]), len(by_movement[q])])
        start, end = enter[passing, other], leave[passing, other]
        order = np.argsort(start, kind="stable")
        order = order[np.isfinite(start[order])]
        changes = other[order[:-1]] != other[order[1:]]
        first, second = order[:-1][changes], order[1:][changes]
        ids = vehicle[passing[first]], vehicle[passing[second]]
        pairs.append(np.stack([start[second], *ids, start[second] - end[first]], axis=-1))
    table = np.concatenate(pairs)
    time, first, second, pet = table[np.argsort(table[:, 0], kind="stable")].T
    return {
        "time_s": time, "first": first.astype(np.int64), "second": second.astype(np.int64),
        "pet_s": pet,
    }  # fmt: skip


def crossings(frame: pd.DataFrame, site: Site) -> pd.DataFrame:
    """Each step with two vehicles on a crossing course: `time_s, first, second, ttc_s`."""
    return _frame(_crossings(_rows(frame, site), site))


def _crossings(rows: Rows, site: Site) -> Columns:
    areas = _areas(site)
    clear = np.array([path.exit for path in site.intersection.paths])[rows.movement] + rows.length
    going = np.flatnonzero(rows.goes & (rows.s < clear))
    firsts, seconds, ttcs = [], [], []
    pending, ahead = np.arange(len(going)), 1
    while len(pending := pending[pending + ahead < len(going)]):
        pending = pending[rows.step[going[pending]] == rows.step[going[pending + ahead]]]
        a, b = going[pending], going[pending + ahead]
        p, q = rows.movement[a], rows.movement[b]
        a_area, b_area = (rows.type[a], p, q), (rows.type[b], q, p)
        meet = np.isfinite(areas.enter[a_area] + areas.enter[b_area])
        a, b = a[meet], b[meet]
        a_area, b_area = (tuple(k[meet] for k in area) for area in (a_area, b_area))
        a_in, a_out = (_times(rows, a, place[a_area]) for place in areas)
        b_in, b_out = (_times(rows, b, place[b_area]) for place in areas)
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
        "time_s": rows.time[first], "first": rows.vehicle[first], "second": rows.vehicle[second],
        "ttc_s": _join(ttcs, np.float64),
    }  # fmt: skip


def _frame(columns: Columns) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(columns)


def _rows(frame: pd.DataFrame, site: Site) -> Rows:
    instance("site", site, Site)
    check_columns(frame)
    frame = frame.sort_values([TIME, VEHICLE])
    time, s, v, a = (frame[k].to_numpy(dtype=float) for k in (TIME, S, SPEED, ACCELERATION))
    type = np.zeros(len(frame), int)
    if TYPE in frame.columns:
        type = site.fleet.indices(frame[TYPE].to_numpy(dtype=str))
    vehicle, released = frame[VEHICLE].to_numpy(np.int64), frame[RIGHT_OF_WAY].to_numpy(bool)
    return _recording(site, time, vehicle, movement_index(frame, site), type, s, v, a, released)


def _recording(
    site: Site, time: Floats, vehicle: Ints, movement: Ints, type: Ints, s: Floats, v: Floats,
    a: Floats, released: Bools,
) -> Rows:  # fmt: skip
    entries = np.array([path.entry for path in site.intersection.paths])
    return Rows(
        time, np.cumsum(np.diff(time, prepend=time[:1]) > 0.0), vehicle, movement, type,
        np.array([it.length for it in site.types])[type], s, v, a,
        released | (s >= entries[movement]),
    )  # fmt: skip


def _leaders_in_lane(rows: Rows, site: Site) -> tuple[Ints, Ints, Floats]:
    """Rows of followers and of the next vehicles in their lane and way, and the gaps [m]."""
    parts = branch(site.intersection, site.fleet)
    lane = site.intersection.movements.origins[rows.movement]
    group = rows.step * site.intersection.n + lane
    order = np.argsort(group, kind="stable")
    behind = (np.diff(rows.s[order]) <= 0.0) | (np.diff(group[order]) > 0)
    if not behind.all():  # those of one lane are rarely in another order than in demand
        order = np.lexsort((-rows.s, group))
    group = group[order]
    rear = rows.s - rows.length
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
    """Rows of followers in and past the junction and of their leaders to the exit lane; gaps [m].

    Leaders come from another arm. There must be a gap: two bodies side by side do not follow yet.
    """
    paths, movements = site.intersection.paths, site.intersection.movements
    origin, exit_arm = movements.origins[rows.movement], movements.exits[rows.movement]
    ends = np.array([(path.entry, path.exit) for path in paths])[rows.movement]
    inside = np.flatnonzero(rows.s >= ends[:, 0])
    past = rows.s - ends[:, 1]
    order = inside[np.lexsort((-past[inside], exit_arm[inside], rows.step[inside]))]
    follower, leader = order[1:], order[:-1]
    gap = past[leader] - rows.length[leader] - past[follower]
    pairs = (gap > 0.0) & (origin[follower] != origin[leader])
    for same in (rows.step, exit_arm):
        pairs &= same[follower] == same[leader]
    return follower[pairs], leader[pairs], gap[pairs]


def _areas(site: Site) -> Areas:
    """The conflict areas of each type among all others, shape (types, m, m)."""
    own = [conflict_areas(site.intersection, it, site.fleet) for it in site.types]
    return Areas(*map(np.stack, zip(*own, strict=True)))


def _passages(rows: Rows, areas: Areas) -> tuple[Ints, Ints, Floats, Floats]:
    """Vehicles and their movements (k,), and when each enters and leaves the areas (k, m) [s]."""
    if not len(rows.time):
        empty = np.empty((0, areas.enter.shape[1]))
        return np.empty(0, np.int64), np.empty(0, np.int64), empty, empty
    order = np.argsort(rows.vehicle, kind="stable")
    vehicle, first, code = np.unique(rows.vehicle[order], return_index=True, return_inverse=True)
    s, movement, type = rows.s[order], rows.movement[order][first], rows.type[order][first]
    last = np.append(first[1:], len(order)) - 1
    here = code * _FAR + s

    def when(place: Floats) -> Floats:
        """When the front of each vehicle passes its places (k, m) [s]."""
        start = np.arange(len(vehicle))[:, None] * _FAR
        at = start + np.minimum(place, s[last, None])
        return np.asarray(np.interp(at, here, rows.time[order]))

    enter, leave = areas.enter[type, movement], areas.leave[type, movement]
    seen = (enter >= s[first, None]) & (enter <= s[last, None])
    return vehicle, movement, np.where(seen, when(enter), np.nan), when(leave)


def _times(rows: Rows, row: Ints, place: Floats) -> Floats:
    """Time until the fronts pass `place` at their present speeds [s]; 0 once they have passed."""
    distance = place - rows.s[row]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(distance <= 0.0, 0.0, distance / rows.v[row])


def _join(parts: list[npt.NDArray[Any]], dtype: type = np.int64) -> npt.NDArray[Any]:
    return np.concatenate([np.empty(0, dtype), *parts])
