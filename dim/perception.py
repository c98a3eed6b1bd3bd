"""What one vehicle, the ego, sees of the others, and how it reads that.

A `Perception` says what an ego sees of the true view: everything (`ExactPerception`), or less,
later, or wrong (`dim.senses.noise`). A `Reader` picks out the few facts that Algorithm 1 needs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable

from dim.passing import Passing
from dim.zones import Zones
from minisim.control import Observed, Site, View, can_stop
from minisim.junction.movements import Movement, movements_of
from minisim.parameters import declared

#: When a vehicle before the junction is committed. "stoppable": when comfortable braking can no
#: longer stop it before the junction. "paper": when it is past the middle of the green zone.
COMMITS = ("stoppable", "paper")

ROUNDING = 1e-6  #: how far short of a mark a vehicle past it may seem to be [m]
UNKNOWN = 0  #: the manoeuvre that an ego sees if it does not know the intent

#: Turns a view and an ego in it into the view that the ego sees. The ego sees itself exactly.
See = Callable[[View, Observed], View]


@runtime_checkable
class Perception(Protocol):
    """A recipe for the vehicles' senses: hashable, picklable, never changed by a run."""

    @property
    def period(self) -> float | None:
        """How often vehicles look [s], at most every step; None if wake-ups suffice.

        They do if all vehicles see the same.
        """

    def start(self, site: Site) -> See:
        """Begin a run; its random numbers and its memory belong to the result."""


@declared
class ExactPerception:
    """Every vehicle sees everything at once and as it is, as the paper assumes."""

    period = None  #: the wake-ups suffice

    def start(self, site: Site) -> See:  # noqa: ARG002  (Perception's argument)
        """Begin a run."""
        return see_all


def see_all(view: View, ego: Observed) -> View:  # noqa: ARG001  (See's argument)
    """The view itself."""
    return view


class Percept(NamedTuple):
    """What Algorithm 1 needs to know about a view.

    The front vehicle of a lane takes part between the start of the yellow zone and the junction,
    until it is committed. While it is committed, no vehicle of its lane takes part.
    """

    participants: tuple[int, ...]  #: ids of the vehicles that take part, by lane
    crossing: tuple[int, ...]  #: ids of those that are committed, or partly in the junction
    case: int  #: the participants' movements as an integer, see `DecisionTable`
    #: The crossing vehicles' movements, bit k for the k-th; all of the lane's if `UNKNOWN`.
    occupied: int
    #: Lanes of participants with `UNKNOWN` intent, which are not in the case; bit i for lane i, or
    #: as `DecisionTable.surely` has it.
    unknown: int = 0
    #: Movements that may not enter, bit k for the k-th, since vehicles inside that have left some
    #: ways, and are not in `occupied`, are still in theirs (gate "passed").
    barred: int = 0

    @property
    def asked(self) -> tuple[int, int, int, int]:
        """What the decision depends on, as `DecisionTable.surely` takes it."""
        return self.case, self.unknown, self.occupied, self.barred


class Reader(NamedTuple):
    """The public rules by which every vehicle reads a view; `commit` is one of `COMMITS`."""

    n: int  # arms
    zones: Zones
    decelerations: tuple[float, ...]  # comfortable braking of each type [m/s²]
    commit: str
    types: int = 1  # those that the harmony matrix tells apart
    passing: Passing | None = None  # where vehicles leave others' ways, if the gate asks

    def committed(self, vehicle: Observed) -> bool:
        """Whether others must treat a vehicle before the junction as crossing.

        Not one braking comfortably for the hold line: the green zone exceeds the margin.
        """
        if self.commit == "paper":
            return vehicle.distance < self.zones.green / 2.0
        return not can_stop(vehicle, self.decelerations[vehicle.type])

    def typed(self, vehicle: Observed) -> Movement:
        """Its movement as the matrix counts it (`minisim.junction.movements.Movements`)."""
        kind = vehicle.type if self.types > 1 else 0
        return Movement(vehicle.lane, movements_of(self.n).typed(kind, vehicle.manoeuvre))

    def read(self, view: View) -> Percept:
        """Participants and crossing vehicles of a view, ordered by lane and front to back."""
        n, types, start = self.n, self.types, self.zones.yellow_start + ROUNDING
        movements, base = movements_of(n), movements_of(n, types).choices + 1
        bits, kind = movements.bits, 0
        participants, crossing = [], []
        case = occupied = unknown = barred = 0
        lane_served = -1
        for vehicle in view.vehicles:
            if vehicle.distance > start:
                continue
            _, lane, manoeuvre, distance, *_ = vehicle
            front = distance >= 0.0 and lane != lane_served
            if types > 1:
                kind = vehicle.type
            if front:
                lane_served = lane
            if distance < 0.0 or self.committed(vehicle):
                crossing.append(vehicle.id)
                if self.passing and distance < 0.0 and manoeuvre != UNKNOWN:
                    barred |= self.passing.bars(vehicle)
                    continue
                occupied |= bits[lane][manoeuvre] << kind * len(movements)
            elif front:
                participants.append(vehicle.id)
                if manoeuvre == UNKNOWN:
                    unknown += (kind + 1) * (types + 1) ** lane
                else:
                    case += (movements.typed(kind, manoeuvre) if kind else manoeuvre) * base**lane
        return Percept(tuple(participants), tuple(crossing), case, occupied, unknown, barred)
