"""Perception that errs: intents misread, vehicles out of sight, seen late or in the wrong place.

    simulate(scenario, Dim(perception=NoisyPerception(intent_error=0.15)))

An ego always sees itself, and the order of the vehicles in each lane, exactly. Its view lacks the
vehicles that it does not see, and holds none that were never there.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from functools import lru_cache

from dim.perception import ROUNDING, UNKNOWN, See, see_all
from dim.senses.intent import KINDS, Lane
from dim.senses.sight import Bodies, Body
from minisim.control import Observed, Site, View
from minisim.parameters import Reals, Switch, declared, real, reals, switch, word
from minisim.streams import Draws

#: Error of published manoeuvre classifiers: Phillips, Wheeler, Kochenderfer (IEEE IV 2017), more
#: than 85 % right on 3 and 4 arms; tail lights, Sensors 24(16), 5162 (2024), 85.2 %.
CLASSIFIER = 0.15

#: Shares of near and far turns without a signal: 29 % of right and 25 % of left turns in right-hand
#: traffic (Sullivan, Bao, Goudy, Konet, "Characteristics of turn signal use at intersections in
#: baseline naturalistic driving", AAP 74, 2015). SAE 2012-01-0261 (Ponziani): 25 % of all turns.
UNSIGNALLED = (0.29, 0.25)

#: 10 Hz, like rotating lidars and V2V safety messages [s]. So what happens is seen up to one frame
#: late, or 0.6 m at 20 km/h.
FRAME = 0.1

_ALL = -1  # stands for all observers or all moments in a draw
_POSITION, _SPEED = 8, 9  # what a draw is for; above the purposes in `dim.senses.intent`


@declared
class NoisyPerception:
    """How vehicles misperceive each other; by default they do not.

    Parameters of errors that never happen are allowed, so a series can start without errors.
    """

    intent_error: float = real(
        "probability that a shown intent is misread", low=0, high=1, default=0.0
    )
    kind: str = word(
        "how: a turn's signal is missed, or any other manoeuvre is equally likely to be read",
        KINDS, default="missed", label="kind of intent error",
    )  # fmt: skip
    shared: Switch = switch(
        "whether all observers err alike (a dirty lamp, the sun), or each on its own", default=True
    )
    persistent: Switch = switch(
        "whether an error lasts as long as the vehicles meet, or is redrawn each frame",
        default=True,
    )
    unsignalled: Reals[tuple[float, float]] = reals(
        "shares of near and of far turns without a signal, which all others take for straight on; "
        "0.29 and 0.25 are published",
        count=2, low=0, high=1, default=(0.0, 0.0), label="unsignalled shares of turns",
    )  # fmt: skip
    confidence: float | None = real(
        "an intent read with less confidence is unknown: the vehicle may take any manoeuvre; none "
        "believes every reading",
        above=0, high=1, optional=True, default=None,
    )  # fmt: skip
    sensor_range: float | None = real(
        "how far a vehicle sees, from centre to centre; none means no limit", "m",
        low=1, high=1000, optional=True, default=None,
    )  # fmt: skip
    # Views do not hold vehicles that have left the junction, so such vehicles block nothing.
    occlusion: Switch = switch("whether bodies block the line of sight", default=False)
    delay: float = real("age of what is seen of the others", "s", low=0, high=10, default=0.0)
    position_noise: float = real(
        "standard deviation of the others' positions along the lane, redrawn each frame", "m",
        low=0, high=20, default=0.0,
    )  # fmt: skip
    speed_noise: float = real(
        "standard deviation of the others' speeds, redrawn each frame", "m/s",
        low=0, high=20, default=0.0,
    )  # fmt: skip
    frame: float | None = real(
        f"time between two looks, at least the host's step; none is {FRAME:g} or a longer step",
        "s", low=0.01, high=1, optional=True, default=None,
    )  # fmt: skip

    @property
    def misreads(self) -> bool:
        """Whether intents are ever misread."""
        return self.intent_error > 0.0 or max(self.unsignalled) > 0.0

    @property
    def period(self) -> float | None:
        """The time between two looks [s], see `Perception`."""
        moved = max(self.delay, self.position_noise, self.speed_noise) > 0.0
        errs = self.misreads or moved or self.occlusion or self.sensor_range is not None
        return (self.frame or FRAME) if errs else None

    def start(self, site: Site) -> See:
        """Begin a run; if nothing errs, perception is exact. `InputError` for too short a frame."""
        if self.frame is not None:
            site.period("frame of the perception", self.frame)
        return see_all if self.period is None else _Senses(self, site).see


class _Senses:
    """The sensors of all vehicles in one run."""

    def __init__(self, recipe: NoisyPerception, site: Site) -> None:
        self._recipe = recipe
        self._frame = recipe.frame or max(FRAME, site.dt)
        self._draws = Draws(site.seed, "perception")
        self._bodies = Bodies(site)
        self._lanes = [
            Lane.of(site, lane, recipe.intent_error, recipe.kind, recipe.unsignalled)
            for lane in range(site.intersection.n)
        ]
        self._intent = lru_cache(maxsize=1024)(self._read)
        self._past: deque[View] = deque()
        self._at: dict[int, Body] = {}  # bodies of `_at_time`
        self._at_time = -math.inf

    def see(self, view: View, ego: Observed) -> View:
        """What one vehicle sees."""
        recipe = self._recipe
        seen = self._late(view) if recipe.delay else view
        moment = math.floor(seen.time / self._frame + ROUNDING)
        vehicles: Iterable[Observed] = with_ego(seen.vehicles, ego) if recipe.delay else seen[1]
        if recipe.occlusion or recipe.sensor_range is not None:
            vehicles = self._visible(seen, vehicles, ego)
        own = ego.id
        observer = _ALL if recipe.shared else self._key(ego.lane, ego.rank)
        sensed = tuple(ego if v.id == own else self._sense(v, observer, moment) for v in vehicles)
        if recipe.delay or recipe.position_noise:
            sensed = in_order(sensed, ego)
        return View(view.time, sensed)

    def _late(self, view: View) -> View:
        """The newest view that is old enough, or an empty junction."""
        past = self._past
        if not past or past[-1] is not view:
            past.append(view)
        due = view.time - self._recipe.delay + ROUNDING
        while len(past) > 1 and past[1].time <= due:
            past.popleft()
        return past[0] if past[0].time <= due else View(due, ())

    def _visible(
        self, seen: View, vehicles: Iterable[Observed], ego: Observed
    ) -> Iterator[Observed]:
        """The ego and the vehicles within range and line of sight, in their order."""
        if seen.time != self._at_time:
            self._at_time = seen.time
            self._at = {v.id: self._bodies.body(v) for v in seen.vehicles}
        at, reach = self._at, self._recipe.sensor_range or math.inf
        eye = at.get(ego.id) or self._bodies.body(ego)
        for vehicle in vehicles:
            if vehicle.id == ego.id:
                yield ego
                continue
            body = at[vehicle.id]
            near = math.hypot(body.x - eye.x, body.y - eye.y) <= reach
            others = (b for v, b in at.items() if v != ego.id and v != vehicle.id)
            if near and not (self._recipe.occlusion and self._bodies.hidden(eye, body, others)):
                yield vehicle

    def _key(self, lane: int, rank: int) -> int:
        """A number for each vehicle, which depends on no other lane."""
        return rank * len(self._lanes) + lane

    def _sense(self, vehicle: Observed, observer: int, moment: int) -> Observed:
        """One vehicle as an observer perceives it."""
        recipe, draws = self._recipe, self._draws
        _, lane, manoeuvre, distance, speed, _, _, rank, *_ = vehicle
        key = self._key(lane, rank)
        if recipe.misreads and manoeuvre != UNKNOWN:
            when = _ALL if recipe.persistent else moment
            manoeuvre = self._intent(lane, manoeuvre, key, observer, when)
        if recipe.position_noise:
            distance += recipe.position_noise * draws.normal(_POSITION, key, observer, moment)
        if recipe.speed_noise:
            speed += recipe.speed_noise * draws.normal(_SPEED, key, observer, moment)
        return vehicle._replace(manoeuvre=manoeuvre, distance=distance, speed=max(speed, 0.0))

    def _read(self, lane: int, manoeuvre: int, vehicle: int, observer: int, when: int) -> int:
        """What a manoeuvre is taken for, or `UNKNOWN`."""
        reader, threshold = self._lanes[lane], self._recipe.confidence
        read = reader.read(self._draws, manoeuvre, vehicle, observer, when)
        if threshold is None:
            return read
        sure = reader.confidence(self._draws, manoeuvre, read, vehicle, observer, when)
        return read if sure >= threshold else UNKNOWN


def with_ego(vehicles: tuple[Observed, ...], ego: Observed) -> tuple[Observed, ...]:
    """An older view's vehicles with the ego as it is now; a new ego is the last in its lane."""
    if any(v.id == ego.id for v in vehicles):
        return vehicles
    behind = next((k for k, v in enumerate(vehicles) if v.lane > ego.lane), len(vehicles))
    return (*vehicles[:behind], ego, *vehicles[behind:])


def in_order(vehicles: tuple[Observed, ...], ego: Observed) -> tuple[Observed, ...]:
    """Vehicles without the overtaking that noise has caused; the ego keeps its place."""
    ordered: list[Observed] = []
    at = next(k for k, v in enumerate(vehicles) if v.id == ego.id)
    for k, vehicle in enumerate(vehicles):
        distance = vehicle.distance
        if ordered and ordered[-1].lane == vehicle.lane:
            distance = max(distance, ordered[-1].distance)
        if k < at and vehicle.lane == ego.lane:
            distance = min(distance, ego.distance)
        ordered.append(vehicle._replace(distance=distance))
    return tuple(ordered)
