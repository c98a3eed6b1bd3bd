"""Perception that errs: intents misread, vehicles out of sight, seen late or in the wrong place.

    simulate(scenario, Dim(perception=NoisyPerception(intent_error=0.15)))

An ego always sees itself exactly, and who drives behind whom in a lane. Vehicles that it does not
see are missing in its view; a view holds no vehicle that is not there, or was not.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache

from dim.perception import ROUNDING, UNKNOWN, See, see_all
from dim.senses.intent import KINDS, Lane
from dim.senses.sight import Bodies, Body
from minisim.control import Observed, Site, View
from minisim.errors import InputError, choice, instance, number, numbers
from minisim.streams import Draws

#: Error of published classifiers of manoeuvres, about 0.15: Phillips, Wheeler, Kochenderfer (IEEE
#: IV 2017), more than 85 % right on 3 and 4 arms; tail lights, Sensors 24(16), 5162 (2024), 85.2 %.
CLASSIFIER = 0.15

#: Shares of turns to the near and to the far side that are driven without a signal: 29 % of right
#: and 25 % of left turns in right-hand traffic (Sullivan, Bao, Goudy, Konet, "Characteristics of
#: turn signal use at intersections in baseline naturalistic driving", AAP 74, 2015). SAE
#: 2012-01-0261 (Ponziani) counts 25 % of all turns.
UNSIGNALLED = (0.29, 0.25)

#: How often sensors look [s]: 10 Hz, as rotating lidars and V2V safety messages do.
FRAME = 0.1

#: Stands for all observers alike, and for all time, where draws ask for one.
_ALL = -1

#: What a draw is for; above those of `dim.senses.intent`.
_POSITION, _SPEED = 8, 9


@dataclass(frozen=True)
class NoisyPerception:
    """How vehicles misperceive each other; by default they do not.

    Attributes:
        intent_error: probability that a shown intent is misread, see `dim.senses.intent.RATES`.
        kind: "missed", a turn's signal is not seen; "symmetric", any manoeuvre is taken for each
            other one alike.
        shared: all observers err alike (a dirty lamp, the sun), or each for itself.
        persistent: an error lasts as long as the vehicles meet, or every frame errs anew.
        unsignalled: shares of turns to the near and to the far side without a signal, for which
            everybody takes them for straight on. `UNSIGNALLED` has published ones.
        confidence: an intent read with less confidence is unknown: the vehicle may take any
            manoeuvre (see `dim.senses.intent.confidence`). None takes every reading as it is.
        sensor_range: how far a vehicle sees, from centre to centre [m]; None has no end.
        occlusion: bodies block the line of sight. Of vehicles that have left the junction no view
            tells, so they block nothing.
        delay: age of what is seen of the others [s].
        position_noise, speed_noise: standard deviations along the lane of what is seen of the
            others [m], [m/s], drawn anew each frame.
        frame: time between two looks [s]. What a sensor could see only between two of them is
            lost: who becomes committed is seen so up to a frame later, 0.6 m at 20 km/h.

    Raises:
        InputError: a value that is not allowed.
    """

    intent_error: float = 0.0
    kind: str = "missed"
    shared: bool = True
    persistent: bool = True
    unsignalled: tuple[float, float] = (0.0, 0.0)
    confidence: float | None = None
    sensor_range: float | None = None
    occlusion: bool = False
    delay: float = 0.0
    position_noise: float = 0.0
    speed_noise: float = 0.0
    frame: float = FRAME

    def __post_init__(self) -> None:
        number("intent_error", self.intent_error, low=0, high=1)
        choice("kind of intent error", self.kind, KINDS)
        shares = numbers("unsignalled", self.unsignalled)
        if len(shares) != 2 or not all(0.0 <= share <= 1.0 for share in shares):
            raise InputError(
                "unsignalled must be the shares of near and far turns without a signal, two "
                f"numbers from 0 to 1, got {shares}"
            )
        object.__setattr__(self, "unsignalled", shares)
        if self.confidence is not None:
            number("confidence", self.confidence, above=0, high=1)
        if self.sensor_range is not None:
            number("sensor_range [m]", self.sensor_range, low=1, high=1000)
        for name in ("shared", "persistent", "occlusion"):
            instance(name, getattr(self, name), bool)
        number("delay [s]", self.delay, low=0, high=10)
        number("position_noise [m]", self.position_noise, low=0, high=20)
        number("speed_noise [m/s]", self.speed_noise, low=0, high=20)
        number("frame [s]", self.frame, low=0.01, high=1)

    @property
    def misreads(self) -> bool:
        """Whether intents are ever misread."""
        return self.intent_error > 0.0 or max(self.unsignalled) > 0.0

    @property
    def name(self) -> str:
        """What errs, such as `missed-0.15-own`; "exact" where nothing does."""
        if self.period is None:
            return "exact"
        parts = {
            f"{self.kind}-{self.intent_error:g}": self.intent_error > 0.0,
            "unsignalled": max(self.unsignalled) > 0.0,
            "own": not self.shared,
            "flicker": not self.persistent,
            f"sure-{self.confidence}": self.confidence is not None,
            f"range-{self.sensor_range}": self.sensor_range is not None,
            "occlusion": self.occlusion,
            f"late-{self.delay:g}": self.delay > 0.0,
            f"position-{self.position_noise:g}": self.position_noise > 0.0,
            f"speed-{self.speed_noise:g}": self.speed_noise > 0.0,
        }
        return "-".join(part for part, differs in parts.items() if differs)

    @property
    def period(self) -> float | None:
        """How often vehicles must look, see `Perception`."""
        moved = max(self.delay, self.position_noise, self.speed_noise) > 0.0
        errs = self.misreads or moved or self.occlusion or self.sensor_range is not None
        return self.frame if errs else None

    def start(self, site: Site) -> See:
        """Begin a run; without any error that is exact perception."""
        return see_all if self.period is None else _Senses(self, site).see


class _Senses:
    """The sensors of all vehicles in one run."""

    def __init__(self, recipe: NoisyPerception, site: Site) -> None:
        self._recipe = recipe
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
        moment = math.floor(seen.time / recipe.frame + ROUNDING)
        vehicles: Iterable[Observed] = with_ego(seen.vehicles, ego) if recipe.delay else seen[1]
        if recipe.occlusion or recipe.sensor_range is not None:
            vehicles = self._visible(seen, vehicles, ego)
        who = ego.id
        found = tuple(ego if v.id == who else self._sense(v, who, moment) for v in vehicles)
        if recipe.delay or recipe.position_noise:
            found = in_order(found, ego)
        return View(view.time, found)

    def _late(self, view: View) -> View:
        """The newest view that is old enough; without one, an empty junction."""
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
        """Those in range and in line of sight, in their order; the ego always."""
        if seen.time != self._at_time:
            self._at_time = seen.time
            self._at = {v.id: self._bodies.body(v) for v in seen.vehicles}
        at, reach = self._at, self._recipe.sensor_range
        eye = at.get(ego.id) or self._bodies.body(ego)
        for vehicle in vehicles:
            if vehicle.id == ego.id:
                yield ego
                continue
            body = at[vehicle.id]
            if reach is not None and math.hypot(body.x - eye.x, body.y - eye.y) > reach:
                continue
            others = [b for v, b in at.items() if v != ego.id and v != vehicle.id]
            if not (self._recipe.occlusion and self._bodies.hidden(eye, body, others)):
                yield vehicle

    def _sense(self, vehicle: Observed, ego: int, moment: int) -> Observed:
        """One vehicle as the ego reads it."""
        recipe, draws = self._recipe, self._draws
        observer = _ALL if recipe.shared else ego
        id, lane, manoeuvre, distance, speed, length, demand_time = vehicle
        if recipe.misreads and manoeuvre != UNKNOWN:
            when = _ALL if recipe.persistent else moment
            manoeuvre = self._intent(lane, manoeuvre, id, observer, when)
        if recipe.position_noise:
            distance += recipe.position_noise * draws.normal(_POSITION, id, observer, moment)
        if recipe.speed_noise:
            speed += recipe.speed_noise * draws.normal(_SPEED, id, observer, moment)
        return Observed(id, lane, manoeuvre, distance, max(speed, 0.0), length, demand_time)

    def _read(self, lane: int, manoeuvre: int, vehicle: int, observer: int, when: int) -> int:
        """What a manoeuvre is taken for, or `UNKNOWN`."""
        reader, threshold = self._lanes[lane], self._recipe.confidence
        read = reader.read(self._draws, manoeuvre, vehicle, observer, when)
        if threshold is None:
            return read
        sure = reader.confidence(self._draws, manoeuvre, read, vehicle, observer, when)
        return read if sure >= threshold else UNKNOWN


def with_ego(vehicles: tuple[Observed, ...], ego: Observed) -> tuple[Observed, ...]:
    """An older view's vehicles with the ego as it is now: new, it is the last of its lane."""
    if any(v.id == ego.id for v in vehicles):
        return vehicles
    behind = next((k for k, v in enumerate(vehicles) if v.lane > ego.lane), len(vehicles))
    return (*vehicles[:behind], ego, *vehicles[behind:])


def in_order(vehicles: tuple[Observed, ...], ego: Observed) -> tuple[Observed, ...]:
    """Front to back again, where noise had vehicles of one lane overtake each other.

    Who drives behind whom is seen right, so nobody is put before a vehicle that he follows. The
    ego, which knows where it is, keeps its place.

    Args:
        vehicles: by lane, each lane in its true order, and the ego among them.
        ego: as it is.
    """
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
