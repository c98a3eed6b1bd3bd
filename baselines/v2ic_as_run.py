"""V2I-C as it was run for the published numbers: Li and Liu's code, adapted, with its slips.

`baselines.v2ic` is the intended controller; this is what was run for the paper's comparison:

1. *another junction's constants*: the reference point stays 400 m after insertion although the
   junction begins at 488.7 m. So the "stop line" is 108.7 m before the junction, and vehicles
   leave the list 64.7 m before they enter it; inside nothing is regulated;
2. *right-hand conflicts*: the conflicts are for right-hand traffic, but the network is left-hand:
   of 60 ordered pairs of foes 28 are missing, and 24 others are listed;
3. *no stop line*: vehicles only get speeds, and one that cannot keep out of the way drives on;
4. *free for a moment is free*: on release a vehicle is expected to leave after (v_des − v)/a,
   although v_des is cut to 20 m/s: for one step, the vehicles behind it in the list assume
   1.3 s instead of 11 s;
5. *advice is for good*: the speed of the release, √(v² + 2aD) up to 20 m/s, is never replaced;
6. *speeds explode*: leaving times are distance over present speed plus 10⁻⁵ m/s, without a cap;
   advice of 0 stops a vehicle at once.

The loop of the authors' script runs every 0.01 s, and what it sets takes effect in the next step.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

import shapely

from baselines.v2ic import CRAWL
from minisim.control import NOTHING, Advise, Command, Plan, Radio, Site, View, Wake
from minisim.errors import InputError
from minisim.junction.geometry import Intersection
from minisim.names import Name
from minisim.parameters import declared, real

REFERENCE = 400.0  #: where the rules take the junction to be: distance driven [m]
RANGE = 200.0  #: how far before it vehicles register [m]
REGISTRATION = 100.0  #: length of the stretch on which they do [m]
STOP_LINE = 20.0  #: from the "stop line" to the reference, and to be cleared beyond it [m]
PLATOON = 4.0  #: length of a platoon of one vehicle [m]
ACCELERATION = 2.6  #: of the release formula [m/s²]
TOP_SPEED = 20.0  #: advice is cut to this [m/s]
NEVER_BLOCKED = 1e-5  #: a leaving time up to this blocks no vehicle [s]

#: Distances driven between which a vehicle registers, and at which it leaves the list [m].
FIRST, LAST = REFERENCE - RANGE, REFERENCE - RANGE + REGISTRATION
LEFT = REFERENCE + PLATOON + STOP_LINE
INSERTION = 0.1  #: SUMO inserts a vehicle this far past its own length (`departPos="base"`) [m]
ROUNDING = 1e-9  #: tolerance when a mark and a distance are compared [m]
#: A junction radius at which opposite far turns do not meet, as with several lanes [m].
WIDE = 20.0


@declared
class V2ICAsRun:
    """V2I-C as the authors of the paper ran it, for 4 arms; it may collide."""

    name = Name("v2ic-as-run")
    covers = NOTHING
    radio = Radio()

    approach_speed: float = real(
        "speed desired from insertion to the first advice: 16.6 in the balanced runs, 14 (the "
        "vehicle's own) in the others", "m/s",
        above=0, high=100, default=16.6,
    )  # fmt: skip

    def start(self, site: Site) -> V2ICAsRunSession:
        """Begin a run; raises `InputError` where the rules do not fit the site."""
        return V2ICAsRunSession(self, site)


@lru_cache
def right_hand_conflicts() -> tuple[frozenset[int], ...]:
    """For each movement of a wide 4-arm junction with right-hand traffic, the ones it meets.

    Movements are numbered as in `Intersection.movements`. Only centre lines count.
    """
    junction = Intersection((0.0, 90.0, 180.0, 270.0), side="right", junction_radius=WIDE)
    ways = [shapely.LineString(path.points) for path in junction.paths]
    arms = [movement.origin for movement in junction.movements]
    every = range(len(ways))
    return tuple(
        frozenset(q for q in every if arms[q] != arms[p] and ways[p].intersects(ways[q]))
        for p in every
    )


class Platoon(NamedTuple):
    """What the rules know about one vehicle at one moment."""

    movement: int  #: its index
    driven: float  #: distance since insertion [m]
    speed: float  #: [m/s]
    #: Sorts vehicles that register in the same step, as the authors' script spawned them.
    order: tuple[float, ...]


class AsRunList:
    """The authors' loop body: the serving list, and the desired speeds that follow from it."""

    def __init__(self) -> None:
        self.order: list[int] = []  #: ids of the listed vehicles, in order of registration
        self.granted: set[int] = set()  #: ids of the vehicles that were released ("priority 0")
        self._conflicts = right_hand_conflicts()

    def step(self, platoons: dict[int, Platoon]) -> dict[int, float]:
        """Update the list from what is on the road; return the desired speeds set now [m/s]."""
        self._register(platoons)
        speeds: dict[int, float] = {}
        leaving: list[tuple[int, float]] = []  # movement and leaving time of those ahead
        for vehicle in self.order:
            movement, driven, speed, _ = platoons[vehicle]
            if vehicle in self.granted:
                leaving.append((movement, (LEFT - driven) / (speed + CRAWL)))
                continue
            foes = self._conflicts[movement]
            blocked = max([time for q, time in leaving if q in foes], default=0.0)
            if blocked > NEVER_BLOCKED:
                crawling, to_line = speed + CRAWL, REFERENCE - STOP_LINE - driven
                speeds[vehicle] = min(max(2.0 * to_line / blocked - crawling, 0.0), TOP_SPEED)
                time = (to_line + PLATOON + 2.0 * STOP_LINE) / crawling
            else:
                self.granted.add(vehicle)
                reached = math.sqrt(speed**2 + 2.0 * ACCELERATION * (LEFT - driven))
                speeds[vehicle] = min(reached, TOP_SPEED)
                time = (speeds[vehicle] - speed) / ACCELERATION
            leaving.append((movement, time))
        return speeds

    def _register(self, platoons: dict[int, Platoon]) -> None:
        """Remove vehicles that have left, and append those that have come."""
        self.order = [v for v in self.order if v in platoons and platoons[v].driven < LEFT]
        self.granted.intersection_update(self.order)
        coming = [v for v, platoon in platoons.items() if FIRST <= platoon.driven < LAST]
        new = set(coming).difference(self.order)
        self.order += sorted(new, key=lambda v: platoons[v].order)


class V2ICAsRunSession:
    """One run; it is called where vehicles are inserted, register and leave the list.

    While any vehicle waits, it is called in every step. It commands what changes.
    """

    def __init__(self, controller: V2ICAsRun, site: Site) -> None:
        junction = site.intersection
        self._rows = junction.movements.rows
        if junction.n != 4:
            raise InputError(f"the as-run V2I-C is for 4 arms, the intersection has {junction.n}")
        junction.refuse_roads("the as-run V2I-C")
        self._origin = junction.approach_length - site.vehicle.length - INSERTION
        if self._origin < LEFT:
            least = LEFT - self._origin + junction.arm_length
            raise InputError(
                f"the as-run V2I-C ends {LEFT:g} m after insertion, but the approach lanes leave "
                f"{self._origin:.4g} m; {junction.too_short(f'at least {least:g}')}"
            )
        insertion = self._origin + INSERTION
        self.rules = AsRunList()
        marks = insertion, self._origin - FIRST, self._origin - LEFT
        self.plan = Plan(marks=marks, sight=insertion, lanes_open=True)
        self._dt = site.dt
        self._approach_speed = controller.approach_speed
        self._desired: dict[int, float] = {}

    def decide(self, view: View) -> Iterable[Command]:
        """One round of the rules, and another in the next step while any vehicle waits."""
        rules, desired = self.rules, self._desired
        speeds = {v.id: self._approach_speed for v in view.vehicles if v.id not in desired}
        speeds.update(rules.step(self._platoons(view)))
        changed = [(v, speed) for v, speed in speeds.items() if desired.get(v) != speed]
        commands: list[Command] = [Advise(vehicle, speed) for vehicle, speed in changed]
        desired.update(speeds)
        self._desired = {v.id: desired[v.id] for v in view.vehicles}
        if len(rules.granted) < len(rules.order):
            commands.append(Wake(view.time + self._dt))
        return commands

    def _platoons(self, view: View) -> dict[int, Platoon]:
        """The vehicles that may be in the list; most of those in view cannot be."""
        platoons = {}
        for vehicle, lane, manoeuvre, distance, speed, _, demand_time, *_ in view.vehicles:
            driven = self._origin - distance + ROUNDING
            if FIRST <= driven < LEFT:
                order = (math.floor(demand_time + ROUNDING), lane, vehicle)
                platoons[vehicle] = Platoon(self._rows[lane][manoeuvre], driven, speed, order)
        return platoons
