"""What one vehicle sees of the others, and how it reads that.

Seeing and reading are apart. A `Perception` says what an ego sees of the true view: everything
(`ExactPerception`), or less, later, or wrong (`dim.senses.noise`). `Reader` turns what was seen
into the few facts that Algorithm 1 needs, the same way for every vehicle.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable

from dim.zones import Zones
from minisim.control import Observed, Site, View, can_stop
from minisim.junction.movements import movements_of
from minisim.parameters import declared, part, real, whole, word

#: When a vehicle before the junction is committed. "stoppable": it can no longer stop before the
#: junction by comfortable braking. "paper": it is past half of the green zone.
COMMITS = ("stoppable", "paper")

#: A host may report a front bumper that has just passed a mark a rounding error before it [m].
ROUNDING = 1e-6

#: The manoeuvre of a vehicle whose intent the ego does not know, in what it sees: it may take any.
UNKNOWN = 0

#: What an ego sees of a view: again a view, ordered as every view is. It sees itself exactly.
See = Callable[[View, Observed], View]


@runtime_checkable
class Perception(Protocol):
    """A recipe for the vehicles' senses: hashable, picklable, never changed by a run."""

    @property
    def period(self) -> float | None:
        """How often vehicles must look [s]; None where what they see changes at wake-ups only.

        DIM's few wake-ups suffice as long as all vehicles see the same (`dim.controller`). Where
        what one sees may change by itself, vehicles have to look again and again.
        """

    def start(self, site: Site) -> See:
        """Begin a run: random streams and memory, if there are any, belong to the result."""


@declared
class ExactPerception:
    """Every vehicle sees everything, at once and as it is: the paper's assumption."""

    @property
    def period(self) -> None:
        """None: the wake-ups suffice."""

    def start(self, site: Site) -> See:  # noqa: ARG002  (Perception's argument)
        """The view itself, which a session reads once for all vehicles."""
        return see_all


def see_all(view: View, ego: Observed) -> View:  # noqa: ARG001  (See's argument)
    """The view itself."""
    return view


class Percept(NamedTuple):
    """What Algorithm 1 needs to know of a view.

    Attributes:
        participants: ids of the vehicles that take part, by lane: the front vehicle of each lane,
            if its front bumper is between the start of the yellow zone and the junction and
            it is not committed. While it is committed, no vehicle of its lane takes part.
        crossing: ids of the vehicles that are crossing: committed, or any part of the body in
            the junction.
        case: the participants' movements as an integer, see `DecisionTable`.
        occupied: the crossing vehicles' movements, an integer with bit k for the k-th movement;
            all of its lane where the intent is `UNKNOWN`.
        unknown: lanes whose participant's intent is `UNKNOWN`, an integer with bit i for lane i;
            the case is without them.
    """

    participants: tuple[int, ...]
    crossing: tuple[int, ...]
    case: int
    occupied: int
    unknown: int = 0


@declared
class Reader:
    """How a view is read, by public rules that every vehicle shares."""

    n: int = whole("number of arms", low=3, high=12, label="number of arms")
    zones: Zones = part("the road markings", Zones)
    deceleration: float = real("the vehicles' comfortable braking", "m/s²", above=0)
    commit: str = word(
        "when a vehicle is committed, see `COMMITS`", COMMITS, default="stoppable",
        label="commit rule",
    )  # fmt: skip

    def committed(self, vehicle: Observed) -> bool:
        """Whether others must treat a vehicle before the junction as crossing.

        A vehicle that brakes comfortably for the hold line never is: the green zone is longer
        than the margin of `can_stop`.
        """
        if self.commit == "paper":
            return vehicle.distance < self.zones.green / 2.0
        return not can_stop(vehicle, self.deceleration)

    def read(self, view: View) -> Percept:
        """Participants and crossing vehicles of a view, ordered by lane and front to back."""
        n, start = self.n, self.zones.yellow_start + ROUNDING
        bits = movements_of(n).bits
        participants, crossing = [], []
        case = occupied = unknown = 0
        lane_served = -1
        for vehicle in view.vehicles:
            if vehicle.distance > start:
                continue
            _, lane, manoeuvre, distance, _, _, _ = vehicle
            front = distance >= 0.0 and lane != lane_served
            if front:
                lane_served = lane
            if distance < 0.0 or self.committed(vehicle):
                crossing.append(vehicle.id)
                occupied |= bits[lane][manoeuvre]
            elif front:
                participants.append(vehicle.id)
                case += manoeuvre * n**lane
                unknown |= (manoeuvre == UNKNOWN) << lane
        return Percept(tuple(participants), tuple(crossing), case, occupied, unknown)
