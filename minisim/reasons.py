"""Why a vehicle waits or goes: reasons as data, each of which is said in one sentence.

A session that keeps the protocol `Explaining` says why its vehicles wait. For all others, and for
vehicles that a session says nothing of, `Witness` tells what can be seen from the commands: which
vehicles hold the right of way. No session is asked unless a run is to be explained.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple, Protocol, runtime_checkable

from minisim.control import (
    Accelerate,
    Advise,
    Close,
    Command,
    Go,
    Hold,
    Observed,
    Open,
    Session,
    Site,
    View,
)

#: Each kind of reason, and the sentence that says it of a vehicle.
KINDS: Mapping[str, str] = {
    "not there": "Vehicle {me} is not on the road: {note}.",
    "no room": "Vehicle {me} has wanted to enter the road since {since}, but there is no room yet.",
    "free": "Vehicle {me} drives on: it has not come to the junction yet.",
    "comes": "Vehicle {me} drives on: it decides when it reaches its zone before the junction.",
    "left": "Vehicle {me} has left the junction and drives on.",
    "behind": "Vehicle {me} is behind {others} in its lane.",
    "crossing": "Vehicle {me} is crossing the junction.",
    "goes": "Vehicle {me} has the right of way.",
    "advised": "Vehicle {me} is told to drive at {note} at most.",
    "told": "Vehicle {me} is told to accelerate at {note}.",
    "clique goes": "Vehicle {me} has the right of way with its clique, {clique}. {note}",
    "committed": "Vehicle {me} can no longer stop before the junction, so it goes on.",
    "held": "Vehicle {me} does not have the right of way.",
    "held for": (
        "Vehicle {me} does not have the right of way: {others} {hold} it on a way that conflicts "
        "with its own."
    ),
    "not clear": "Vehicle {me} waits until the junction is clear: {others} {is_are} still inside.",
    "not in harmony": "Vehicle {me} waits for {others}, which {cross} on a way that conflicts.",
    "other clique": (
        "Vehicle {me} is not in the clique that goes, {clique}: it conflicts with {others}. {note}"
    ),
    "intent unknown": (
        "Vehicle {me} does not know what {others} will do, so it waits: it may go only if it "
        "could go in every case."
    ),
    "looks again": "Vehicle {me} decides again when it next looks.",
    "passage": "Vehicle {me} has a passage through the junction, and enters it at {until}.",
    "no passage": (
        "Vehicle {me} has no passage yet: the one that it asks for does not fit that of {others}."
    ),
    "after": "Vehicle {me} is to pass at {until}, after {others} on a way that conflicts.",
    "planned": "Vehicle {me} is to pass at {until}, as planned.",
    "listed": "Vehicle {me} is in the serving list after {others} on a way that conflicts.",
    "not heard": "Vehicle {me} has not been heard by the controller yet.",
    "not told": "Vehicle {me} may go, but the message that says so has not reached it yet.",
    "told for later": "Vehicle {me} has a passage, and the right of way from {until} on.",
    "in doubt": "Vehicle {me} waits until it is known that {others} {no_longer} the right of way.",
    "monitor": "Vehicle {me} is braked by its safety monitor for {others}.",
    "red": "Vehicle {me} waits: its signal has been red{head}.",
    "amber": "Vehicle {me} stops: its signal has been amber{head}.",
    "gap": (
        "Vehicle {me} has a green signal, but waits for a gap: {others} {cross} on a way that "
        "conflicts."
    ),
    "approaching": "Vehicle {me} must first stand at the line.",
    "reaction": "Vehicle {me} has stopped and looks; it cannot go before {until}.",
    "others first": (
        "The driver of vehicle {me} waits for {others}, which came earlier or {cross} in its way."
    ),
    "turn": "Vehicle {me} waits for its turn: {others} came first.",
    "clearing": "It is the turn of vehicle {me}, but {others} {is_are} still in its way.",
}


def _listed(vehicles: Sequence[int]) -> str:
    names = [str(vehicle) for vehicle in vehicles]
    if len(names) < 2:
        return f"vehicle {names[0]}" if names else "others"
    return f"vehicles {', '.join(names[:-1])} and {names[-1]}"


@dataclass(frozen=True, slots=True)
class Reason:
    """Why a vehicle does what it does, as data."""

    kind: str  #: one of `KINDS`
    vehicle: int
    vehicles: tuple[int, ...] = ()  #: those that it waits for, or that are in its way
    clique: tuple[str, ...] = ()  #: the movements that have the right of way, such as "a1"
    since: float | None = None  #: when this began [s]
    until: float | None = None  #: when it will end [s], as far as the controller knows now
    note: str = ""  #: more, in words

    @property
    def sentence(self) -> str:
        """The reason in plain words."""
        one = len(self.vehicles) == 1
        head = "" if self.since is None else f" since {self.since:.1f} s"
        head += "" if self.until is None else f"; it turns green at {self.until:.1f} s"
        return KINDS[self.kind].format(
            me=self.vehicle, others=_listed(self.vehicles), clique=" ".join(self.clique),
            since="?" if self.since is None else f"{self.since:.1f} s",
            until="?" if self.until is None else f"{self.until:.1f} s",
            head=head, note=self.note, is_are="is" if one else "are",
            hold="holds" if one else "hold",
            no_longer="no longer holds" if one else "no longer hold",
            cross="crosses" if one else "cross",
        ).strip()  # fmt: skip

    def as_dict(self) -> dict[str, Any]:
        """What is known, with the sentence; for JSON."""
        known = {name: value for name, value in asdict(self).items() if value not in ((), None, "")}
        return {**known, "sentence": self.sentence}


class Told(NamedTuple):
    """A reason that holds from a time on, until the next of the same vehicle."""

    time: float  # [s]
    reason: Reason


class Shown(NamedTuple):
    """What a signal head shows from a time on, until the next of the same lane."""

    time: float  # [s]
    lane: int
    state: str  # "green", "amber" or "red"


@runtime_checkable
class Explaining(Session, Protocol):
    """A session that can say why."""

    def reasons(self, view: View) -> Mapping[int, Reason]:
        """The reasons of vehicles in this view, as of the last decision; nothing may change."""


@runtime_checkable
class Signalling(Session, Protocol):
    """A session with signal heads."""

    @property
    def heads(self) -> Sequence[str]:
        """What the head of each lane shows now: "green", "amber" or "red"."""

    def green_from(self, lane: int, time: float) -> float | None:
        """When a lane's head turns green next, seen from `time` [s]; None if that is open."""


class Witness:
    """Writes down reasons and signal heads during a run."""

    def __init__(self, site: Site, session: Session) -> None:
        self.told: list[Told] = []  #: by time
        self.shown: list[Shown] = []  #: by time
        self._says = session if isinstance(session, Explaining) else None
        self._signals = session if isinstance(session, Signalling) else None
        self._rows, self._conflicts = site.intersection.movements.rows, site.conflicts
        self._open: set[int] = set()  # lanes
        if session.plan.lanes_open:
            self._open.update(range(site.intersection.n))
        self._gone: set[int] = set()  # vehicles
        self._advice: dict[int, float] = {}  # [m/s]
        self._told: dict[int, float] = {}  # [m/s²]
        self._last: dict[int, Reason] = {}
        self._heads: list[str] = []
        self._turned: dict[int, float] = {}  # lane: when its head turned to what it shows [s]

    def note(self, commands: Iterable[Command]) -> None:
        """Take note of what a session has just commanded."""
        for command in commands:
            match command:
                case Go(vehicle):
                    self._gone.add(vehicle)
                case Hold(vehicle):
                    self._gone.discard(vehicle)
                case Advise(vehicle, speed):
                    self._advice[vehicle] = speed
                case Accelerate(vehicle, acceleration):
                    self._told[vehicle] = acceleration
                case Open(lane):
                    self._open.add(lane)
                case Close(lane):
                    self._open.discard(lane)

    def look(self, view: View) -> None:
        """Write down what is new at the time of a view."""
        self._look_at_heads(view.time)
        said = self._says.reasons(view) if self._says is not None else {}
        seen_lanes: dict[int, int] = {}
        for vehicle in view.vehicles:  # by lane, front to back
            reason = said.get(vehicle.id) or self._seen(vehicle, view, seen_lanes.get(vehicle.lane))
            if vehicle.distance >= 0.0:
                seen_lanes[vehicle.lane] = vehicle.id
            if self._last.get(vehicle.id) != reason:
                self._last[vehicle.id] = reason
                self.told.append(Told(view.time, reason))
        here = {vehicle.id for vehicle in view.vehicles}
        for gone in [vehicle for vehicle in self._last if vehicle not in here]:
            del self._last[gone]
            self.told.append(Told(view.time, Reason("left", gone)))

    def _look_at_heads(self, time: float) -> None:
        if self._signals is None:
            return
        before, self._heads = self._heads, list(self._signals.heads)
        for lane, state in enumerate(self._heads):
            if not before or before[lane] != state:
                self._turned[lane] = time
                self.shown.append(Shown(time, lane, state))

    def _seen(self, me: Observed, view: View, ahead: int | None) -> Reason:
        """The reason as far as commands and positions tell."""
        if me.distance < 0.0:
            return Reason("crossing", me.id)
        if self._may_go(me):
            if (speed := self._advice.get(me.id, math.inf)) < math.inf:
                return Reason("advised", me.id, note=f"{speed:.1f} m/s")
            if (rate := self._told.get(me.id, math.inf)) < math.inf:
                return Reason("told", me.id, note=f"{rate:.1f} m/s²")
            return Reason("goes", me.id)
        if ahead is not None:
            return Reason("behind", me.id, (ahead,))
        if self._signals is not None and (colour := self._heads[me.lane]) != "green":
            green = self._signals.green_from(me.lane, view.time)
            return Reason(colour, me.id, since=self._turned[me.lane], until=green)
        against = self._conflicts[self._rows[me.lane][me.manoeuvre]]
        rivals = tuple(
            v.id
            for v in view.vehicles
            if (v.distance < 0.0 or self._may_go(v)) and against[self._rows[v.lane][v.manoeuvre]]
        )
        if self._signals is not None:
            return Reason("gap", me.id, rivals)
        return Reason("held for", me.id, rivals) if rivals else Reason("held", me.id)

    def _may_go(self, vehicle: Observed) -> bool:
        return vehicle.id in self._gone or vehicle.lane in self._open
