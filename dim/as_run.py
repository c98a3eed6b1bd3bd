"""DIM as it was run for the published numbers: the authors' rules, quirks and all.

The paper describes one algorithm; the runs behind its figures followed another. This module repeats
those runs vehicle by vehicle. Intended or a slip, each difference is a quirk with a name:

1. *odometer zones*: the zones are stretches of the distance driven since insertion, not of the
   road. `bound`, where the junction begins for the rules, lies 1.2–1.4 m inside it;
2. *speeds by decree*: a vehicle that enters a zone gets another desired speed (14 m/s on the road,
   10 in the red zone, 0 without and 10 with the right of way, 20 beyond);
3. *names decide*: vehicles are visited in alphabetical order of their names, `v<second of
   demand>.<lane>_<manoeuvre>`, so that v100 comes before v99;
4. *short action list*: only as many vehicles take part as there are arms, first visited, first
   listed; a vehicle gives up its place 506 m after insertion;
5. *several of a lane*: the action list may hold two vehicles of one lane; of two with the same
   movement, only the later entry can be chosen;
6. *busy junction*: nothing is decided while any vehicle is between `bound` and 508 m;
7. *green zone goes*: a vehicle in the action list and within 2 m of `bound` drives on without any
   right of way, at a desired speed of 50 m/s, and keeps the junction busy;
8. *right of way by name*: it lasts until the next decision, wherever the vehicle is by then. A
   vehicle that loses it in the yellow zone is told 20 m/s for one step (the authors set 20 first,
   and 10 at the end of their loop for those that still have it);
9. *lanes first*: of the maximal cliques the one whose sorted movements come first in the
   alphabet wins, whatever its size (`order="size"` is the rule that the paper describes);
10. *a loop that breaks off*: where SUMO has taken a vehicle off the road, the step ends with an
    error at that vehicle, and nothing is decided in it.

All numbers are the authors'. Everything happens at the end of a step, with effect in the next.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from itertools import takewhile
from typing import Any, NamedTuple

from dim.decision import ORDERS, maximal_cliques
from dim.harmony import HarmonyMatrix
from minisim.control import NOTHING, Advise, Command, Observed, Plan, Site, View, Wake
from minisim.errors import InputError, printable
from minisim.junction.movements import Movement
from minisim.names import Name
from minisim.parameters import Spelled, checked, declared, part, real, word

#: Where the junction begins for the rules: arms -> distance driven [m] (the authors' `JUNC_BOUND`).
BOUND = {3: 492.0, 4: 490.0, 5: 488.0}
RED = {3: 20.0, 4: 20.0, 5: 25.0}  #: arms -> length of the red zone before the yellow one [m]
YELLOW = 5.0  #: length of the yellow zone, up to the bound [m]
GREEN = 2.0  #: length of the stretch before the bound where a vehicle goes regardless [m]
FREED = 506.0  #: distance driven at which a place in the action list is given up [m]
CLEAR = 508.0  #: distance driven at which a vehicle no longer keeps the junction busy [m]

#: Distance driven at which a vehicle is told 20 m/s for good [m], and no longer shown. The authors
#: have no such limit, but in three runs that we checked, no vehicle is told anything after 531 m.
FOLLOWED = 600.0
SEEN_BEYOND = 10.0  #: how much farther a vehicle stays in view, to be seen past that mark [m]

RED_SPEED = 10.0  #: desired in the red zone [m/s]
HELD_SPEED = 0.0  #: desired in the yellow zone without right of way [m/s]
GO_SPEED = 10.0  #: desired with right of way [m/s]
GREEN_SPEED = 50.0  #: desired in the green zone [m/s]
EXIT_SPEED = 20.0  #: desired beyond the bound, if nothing else is asked for [m/s]
INSERTION = 0.1  #: SUMO inserts a vehicle this far past its own length (`departPos="base"`) [m]
ROUNDING = 1e-9  #: tolerance when a mark and a distance are compared [m]


def _names(title: str, value: Any) -> str:
    """Check `AsRunDim.names`."""
    text = printable(title, value)
    if not text.isalpha() or len(set(text)) != len(text):
        raise InputError(f"{title} must be different letters, got {text!r}")
    return text


@declared
class AsRunDim:
    """DIM as the authors ran it for the published numbers, on 3, 4 and 5 arms; it may collide."""

    name = Name("dim-as-run")
    covers = NOTHING

    order: str = word(
        "what comes first: the highest-priority lanes, as in every published run, or the largest "
        "clique, as the paper describes",
        ORDERS, default="lanes",
    )  # fmt: skip
    matrix: Spelled[HarmonyMatrix | None] = part(
        "harmony of the movements; none means the paper's",
        HarmonyMatrix,
        kinds={"paper": HarmonyMatrix.paper, "file": HarmonyMatrix.from_csv},
        optional=True, default=None,
    )  # fmt: skip
    names: str = checked(
        "the authors' letters of the arms, clockwise from north; they decide which vehicle is "
        'first ("acbd" in the runs at 4:1:4:1)',
        _names, "different letters", default="abcde",
    )  # fmt: skip
    exit_speed: float = real(
        "speed desired behind the junction, 20 in every published run of DIM", "m/s",
        above=0.0, default=EXIT_SPEED,
    )  # fmt: skip

    def start(self, site: Site) -> AsRunSession:
        """Begin a run; raises `InputError` if the rules do not fit the site."""
        n = site.intersection.n
        if n not in BOUND:
            raise InputError(f"the as-run rules are for 3, 4 or 5 arms, the intersection has {n}")
        matrix = HarmonyMatrix.paper(n) if self.matrix is None else self.matrix
        if matrix.n != n:
            raise InputError(f"the matrix is for {matrix.n} arms, the intersection has {n}")
        if len(self.names) < n:
            raise InputError(f"names must be {n} letters, one per arm, got {self.names!r}")
        return AsRunSession(site, AsRunRules(self, matrix))


class Car(NamedTuple):
    """What the rules know about a vehicle: its name in the authors' script, and how far it is."""

    id: int
    name: str
    movement: Movement
    driven: float  # since insertion [m]


class AsRunRules:
    """The authors' loop body: lists of vehicles and the desired speeds that follow from them."""

    def __init__(self, dim: AsRunDim, matrix: HarmonyMatrix) -> None:
        self.arms, self.matrix = matrix.n, matrix
        self.order, self.names, self.exit_speed = dim.order, dim.names, dim.exit_speed
        self.bound = BOUND[self.arms]
        self.yellow_start = self.bound - YELLOW
        self.red_start = self.yellow_start - RED[self.arms]
        self.green_start = self.bound - GREEN
        self.serving: list[int] = []  #: ids, from the red zone until the vehicles are clear
        self.action: list[int] = []  #: ids of the participants, in order of entry
        self.chosen: tuple[int, ...] = ()  #: ids of the vehicles with the right of way

    def step(self, cars: Mapping[int, Car]) -> dict[int, float]:
        """Update the lists; return the desired speeds set now [m/s].

        `cars` must hold every vehicle from the start of the red zone until it is clear.
        """
        speeds: dict[int, float] = {}
        visited = sorted(cars.values(), key=lambda car: (car.name, car.id))
        self._serve(visited, cars, speeds)
        busy = self._visit(visited, speeds)
        busy |= self._green(cars, speeds)
        lost = next((v for v in self.serving if v not in cars), None)
        if lost is not None:
            self.serving.remove(lost)
            self.action = [v for v in self.action if v != lost]
            self.chosen = tuple(v for v in self.chosen if v != lost)
            return speeds
        if not busy:
            # For each movement only the last entry counts.
            holder = {cars[vehicle].movement: vehicle for vehicle in self.action}
            clique = winner(self.matrix, frozenset(holder), self.order, self.names)
            self.chosen = tuple(holder[movement] for movement in clique)
        return speeds | dict.fromkeys(self.chosen, GO_SPEED)

    def _serve(self, visited: list[Car], cars: Mapping[int, Car], speeds: dict[int, float]) -> None:
        """Red zone: slow down, once."""
        for car in visited:
            if car.id not in self.serving and self.red_start <= car.driven < self.yellow_start:
                self.serving.append(car.id)
                speeds[car.id] = RED_SPEED
        self.serving = [v for v in self.serving if v not in cars or cars[v].driven <= CLEAR]

    def _visit(self, visited: list[Car], speeds: dict[int, float]) -> bool:
        """Yellow zone and beyond, vehicle by vehicle; return whether the junction is busy."""
        busy = False
        for car in visited:
            if self.yellow_start <= car.driven <= self.bound:
                if car.id not in self.chosen:
                    speeds[car.id] = HELD_SPEED
                if car.id not in self.action and len(self.action) < self.arms:
                    self.action.append(car.id)
                if car.id in self.chosen and car.id in self.action:
                    speeds[car.id] = self.exit_speed
            if car.driven > FREED and car.id in self.action:
                self.action.remove(car.id)
            if car.driven > self.bound and car.id not in self.action:
                speeds[car.id] = self.exit_speed
            busy |= self.bound < car.driven <= CLEAR
        return busy

    def _green(self, cars: Mapping[int, Car], speeds: dict[int, float]) -> bool:
        """Green zone: participants go regardless; return whether there are any."""
        known = takewhile(cars.__contains__, self.serving)
        going = [v for v in known if cars[v].driven >= self.green_start and v in self.action]
        speeds.update(dict.fromkeys(going, GREEN_SPEED))
        return bool(going)


@lru_cache(maxsize=100_000)
def winner(
    matrix: HarmonyMatrix, movements: frozenset[Movement], order: str, names: str = "abcde"
) -> tuple[Movement, ...]:
    """The maximal clique that wins, sorted by name; no two movements of a lane are in harmony."""

    def named(movement: Movement) -> tuple[str, int]:
        return names[movement.origin], movement.manoeuvre

    def rank(clique: tuple[Movement, ...]) -> tuple[int, list[tuple[str, int]]]:
        return -len(clique) if order == "size" else 0, [named(movement) for movement in clique]

    found = maximal_cliques(tuple(movements), matrix)
    cliques = [tuple(sorted(clique, key=named)) for clique in found]
    return min(cliques, key=rank, default=())


class AsRunSession:
    """One run: reads the host's views, which come where a zone begins or ends."""

    def __init__(self, site: Site, rules: AsRunRules) -> None:
        self.rules = rules
        site.intersection.refuse_roads("the as-run DIM")
        self._origin = site.intersection.approach_length - site.vehicle.length - INSERTION
        zones = rules.red_start, rules.yellow_start, rules.green_start, rules.bound
        if rules.red_start > self._origin:
            least = rules.red_start - self._origin + site.intersection.arm_length
            raise InputError(
                f"the as-run zones begin {rules.red_start:g} m after insertion, but the approach "
                f"lanes leave {self._origin:.4g} m; "
                f"{site.intersection.too_short(f'at least {least:g}')}"
            )
        self.plan = Plan(
            marks=tuple(self._origin - edge for edge in (*zones, FREED, CLEAR, FOLLOWED)),
            sight=self._origin - rules.red_start,
            reach=max(FOLLOWED + SEEN_BEYOND - self._origin, 0.0),
            lanes_open=True,
        )
        self._dt = site.dt
        self._desired: dict[int, float] = {}

    def decide(self, view: View) -> Iterable[Command]:
        """One round of the rules; another one in the next step, until nothing changes any more."""
        rules = self.rules
        before = [*rules.action], rules.chosen
        cars = {vehicle.id: self._car(vehicle) for vehicle in view.vehicles}
        lost = any(vehicle not in cars for vehicle in rules.serving)
        speeds = rules.step(cars)
        speeds.update((v, rules.exit_speed) for v, car in cars.items() if car.driven >= FOLLOWED)
        told = {v: speed for v, speed in speeds.items() if v in cars}
        commands: list[Command] = [
            Advise(v, speed) for v, speed in told.items() if self._desired.get(v) != speed
        ]
        self._desired = {v: speed for v, speed in self._desired.items() if v in cars} | told
        if lost or before != (rules.action, rules.chosen):
            commands.append(Wake(view.time + self._dt))
        return commands

    def _car(self, vehicle: Observed) -> Car:
        second = int(vehicle.demand_time + ROUNDING)
        lane = self.rules.names[vehicle.lane]
        name = f"v{second}.{lane}_{vehicle.manoeuvre}"
        driven = self._origin - vehicle.distance + ROUNDING
        return Car(vehicle.id, name, vehicle.movement, driven)
