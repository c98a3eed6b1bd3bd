"""Where a vehicle will be, step by step, if its driver is like all others and it may drive on.

By the run's own law (`minisim.laws`) it follows the vehicles ahead in its lane, and those that
enter its exit lane first. Their motion is known. Positions count from the junction entry.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from minisim.carfollowing import ballistic, semi_implicit
from minisim.control import LATERAL_ACCELERATION, Plan, Site
from minisim.jit import njit
from minisim.laws import (
    Law,
    Traits,
    braking_begins,
    build_law,
    closeness,
    drive,
    hold,
    keep_room,
    room_behind,
    short_of,
    slow_down,
)

Floats = npt.NDArray[np.float64]

#: A number of steps: there was no room for all of them.
UNFINISHED = -1


def law_of(site: Site) -> Law:
    """The law of a site's vehicles."""
    return build_law(site, Plan(), depart_speed=None, record=None, record_window=(0.0, math.inf))


class Course(NamedTuple):
    """What a prediction needs to know about a path."""

    crossing: float  #: from entry to exit [m]
    turn: float  #: highest speed inside the junction [m/s]
    before: float  #: before it [m/s]
    behind: float  #: and behind it [m/s]
    end: float  #: where a vehicle has arrived [m]
    exit_arm: int  #: index of the arm that it leaves by


def courses(site: Site) -> tuple[Course, ...]:
    """The courses of all movements of a site."""
    junction, margin = site.intersection, law_of(site).margin
    turns = [junction.turn_speed(path.movement, LATERAL_ACCELERATION) for path in junction.paths]
    made = []
    for p, turn in zip(junction.paths, turns, strict=True):
        before, behind = site.limit(p.movement.origin), site.limit(p.exit_arm)
        end = p.length - margin - p.entry
        made.append(Course(p.crossing, min(before, turn), before, behind, end, p.exit_arm))
    return tuple(made)


class Leader(NamedTuple):
    """A vehicle with known motion, as its follower meets it."""

    s: Floats  #: positions [m], one per step from now on; after the last it is gone
    v: Floats  #: speeds [m/s]
    length: float  #: of its body [m]
    b_max: float  #: the most that its brakes can do [m/s²]
    until: float = math.inf  #: its rear matters up to this position on its own path [m]
    shift: float = 0.0  #: added to its position to measure it on the follower's path [m]


class Leaders(NamedTuple):
    """Several of them as arrays; a position is infinite once the vehicle is gone."""

    s: Floats  #: shape (leaders, steps) [m]
    v: Floats  #: the same [m/s]
    bound: Floats  #: `until` or `shift` of each [m]
    length: Floats  #: of each [m]
    b_max: Floats  #: of each [m/s²]


#: No leaders.
NONE = Leaders(np.empty((0, 0)), np.empty((0, 0)), *np.empty((3, 0)))


class Motion(NamedTuple):
    """How a vehicle will drive."""

    s: Floats  #: positions [m], one per step from now on, until it has arrived
    v: Floats  #: speeds [m/s]
    hard: bool  #: whether it brakes harder than is comfortable for another lane's vehicle


def predict(
    law: Law, me: Traits, course: Course, position: float, speed: float,
    *, lane: Sequence[Leader] = (), exit_lane: Sequence[Leader] = (), held: int = 0,
    advice: float = math.inf,
) -> Motion | None:  # fmt: skip
    """The motion of a vehicle until it arrives, if it may drive on; None if it hits a leader.

    For its first `held` steps it has to stop at the junction entry, and keeps to an advised speed
    [m/s]. `lane` holds the vehicles ahead, nearest first; `exit_lane` those that enter that lane
    earlier.
    """
    ahead = _stacked(lane, [leader.until for leader in lane])
    entering = _stacked(exit_lane, [leader.shift for leader in exit_lane])
    steps, count = 512, UNFINISHED
    while count == UNFINISHED:  # it ends: every leader arrives, and a free road is driven on
        steps *= 2
        s, v = np.empty(steps), np.empty(steps)
        count, hard = _drive(law, me, course, position, speed, ahead, entering, held, advice, s, v)
    return Motion(s[:count].copy(), v[:count].copy(), hard) if count else None


def _stacked(leaders: Sequence[Leader], bound: list[float]) -> Leaders:
    if not leaders:
        return NONE
    steps = max((len(leader.s) for leader in leaders), default=0)
    s, v = np.full((len(leaders), steps), np.inf), np.zeros((len(leaders), steps))
    for j, leader in enumerate(leaders):
        s[j, : len(leader.s)], v[j, : len(leader.v)] = leader.s, leader.v
    length, b_max = np.array([(it.length, it.b_max) for it in leaders]).reshape(-1, 2).T.copy()
    return Leaders(s, v, np.array(bound), length, b_max)


@njit
def _drive(
    law: Law, me: Traits, course: Course, position: float, speed: float,
    lane: Leaders, exit_lane: Leaders, held: int, advice: float, s_out: Floats, v_out: Floats,
) -> tuple[int, bool]:  # fmt: skip
    """Fill `s_out` and `v_out` as `minisim.engine.kernel` would drive the vehicle.

    Returns the number of steps, 0 if it hits a leader or `UNFINISHED`, and whether it brakes hard.
    """
    s, v, hard = position, speed, False
    for k in range(len(s_out)):
        if s >= course.end:
            return k, hard
        s_out[k], v_out[k] = s, v
        first = True  # no vehicle is between it and the junction
        z, room = 0.0, math.inf
        # A vehicle that cannot stop before the junction sees past a leader that may turn off.
        near = s < course.crossing and v * v > -2.0 * me.b_max * s
        behind = False
        for j in range(len(lane.s)):
            if k >= lane.s.shape[1] or lane.s[j, k] == math.inf:
                continue
            first = first and lane.s[j, k] >= 0.0
            rear = lane.s[j, k] - lane.length[j]
            if rear < lane.bound[j] and (not behind or lane.s[j, k] >= 0.0):
                if rear <= s:
                    return 0, hard
                if not behind:
                    z = closeness(v, rear - s, lane.v[j, k], me, law)
                room = min(room, room_behind(rear - s, lane.v[j, k], lane.b_max[j], me, law))
                behind = True
            if not near and (behind or s >= course.crossing):
                break
        z_exit = 0.0
        if k >= held and (first or near or s >= 0.0) and k < exit_lane.s.shape[1]:
            for j in range(len(exit_lane.s) - 1, -1, -1):
                if exit_lane.s[j, k] >= 0.0:  # the last to enter it
                    if exit_lane.s[j, k] < math.inf:
                        rear = exit_lane.s[j, k] + exit_lane.bound[j] - exit_lane.length[j]
                        if first or s >= 0.0:
                            z_exit = closeness(v, rear - s, exit_lane.v[j, k], me, law)
                        if rear >= course.crossing:
                            b_ahead = exit_lane.b_max[j]
                            behind_it = room_behind(rear - s, exit_lane.v[j, k], b_ahead, me, law)
                            room = min(room, behind_it)
                    break
        v0 = course.before if s < 0.0 else course.turn if s < course.crossing else course.behind
        acc = drive(v, v0, advice if k < held else math.inf, max(z, z_exit), me, law)
        if z_exit > z and acc < -me.b:
            hard = True
        if s < 0.0 and braking_begins(v, -s, me, law):
            acc = min(acc, slow_down(v, acc, course.turn, -s, me, law))
        left = course.crossing - s
        if left > 0.0 and course.behind < course.turn and braking_begins(v, left, me, law):
            acc = min(acc, slow_down(v, acc, course.behind, left, me, law))
        if k < held and s < 0.0:
            acc = min(acc, hold(v, s + law.entry, me, law))
        if short_of(room, v, v + acc * law.dt, me, law):
            acc = min(acc, keep_room(v, room, me, law))
        acc = max(acc, -me.b_max)
        if law.semi_implicit:
            s, v = semi_implicit(s, v, acc, law.dt)
        else:
            s, v = ballistic(s, v, acc, law.dt)
    return UNFINISHED, hard
