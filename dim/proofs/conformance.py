"""Runs checked against the protocol: their views and commands must form a path of the model.

    simulate(scenario, Checked(Dim()))

behaves like `Dim()` on any host, but raises an error if the host or the session does what
`dim.proofs.protocol` does not allow. So what was proved about the model holds for the run.
"""

from __future__ import annotations

from collections.abc import Iterable

from dim.controller import Dim, DimSession
from dim.perception import ROUNDING
from dim.proofs.protocol import COMMITTED, LOOK, ROLLING, WAITING, Event, Protocol, State
from minisim.control import Command, Go, Hold, Observed, Plan, Site, View
from minisim.errors import InputError, MinisimError, show
from minisim.parameters import declared, part


class ConformanceError(MinisimError):
    """A run left the protocol."""


@declared
class Checked:
    """A `Dim` whose runs are checked against the protocol as they go.

    `InputError` for one with priorities other than the lanes' own.
    """

    dim: Dim = part("the controller, with the lanes' own priorities", Dim)

    def __post_init__(self) -> None:
        if self.dim.priorities is not None:
            raise InputError(
                "the protocol is checked with the lanes' own priorities only, got priorities="
                f"{show(self.dim.priorities)}"
            )

    @property
    def name(self) -> str:
        """The name of the `Dim`."""
        return self.dim.name

    def start(self, site: Site) -> CheckedSession:
        """Begin a run."""
        return CheckedSession(self.dim, site)


class CheckedSession:
    """A session of DIM, its state in the protocol, and the number of events (`steps`) so far."""

    def __init__(self, dim: Dim, site: Site) -> None:
        self._session = DimSession(dim, site)
        self.plan: Plan = self._session.plan
        self.protocol = Protocol(self._session.rules.table.matrix, dim.order, dim.gate, dim.commit)
        self.state: State = self.protocol.start
        self.steps = 0
        self._start = dim.zones.yellow_start + ROUNDING
        self._fronts: dict[int, int] = {}  # lane -> vehicle
        self._inside: dict[int, int] = {}  # vehicle -> lane and manoeuvre, as a bit
        self._going: set[int] = set()

    def decide(self, view: View) -> Iterable[Command]:
        """DIM's commands; `ConformanceError` if one, or an event before it, is impossible."""
        commands = list(self._session.decide(view))
        self._follow(view)
        self.state = self.protocol.look(self.state)
        self.steps += 1
        self._compare(view, commands)
        return commands

    def _follow(self, view: View) -> None:
        """Take the model from the last view to this one: vehicles move on, leave and arrive."""
        near = [v for v in view.vehicles if v.distance <= self._start]
        fronts = {v.lane: v for v in reversed(near) if v.distance >= 0.0}
        index, typed = self.protocol.matrix.index, self._session.reader.typed
        inside = {v.id: 1 << index(typed(v)) for v in near if v.distance < 0}
        for lane, vehicle in self._fronts.items():
            now = fronts.get(lane)
            if now is not None and now.id == vehicle:
                self._move(view, now)
            else:
                self._inside[vehicle] = self._go_in(view, lane)
        for vehicle in self._inside.keys() - inside.keys():
            bit = self._inside.pop(vehicle)
            if bit not in self._inside.values():
                movement = self.protocol.matrix.movements[bit.bit_length() - 1]
                self._take(view, Event("leave", *movement))
        for vehicle in inside.keys() - self._inside.keys():
            raise ConformanceError(f"at {view.time:.1f} s vehicle {vehicle} entered unseen")
        for lane in sorted(fronts.keys() - {k for k, f in enumerate(self.state.fronts) if f}):
            self._take(view, Event("arrive", *typed(fronts[lane])))
        self._pass([v for v in near if v.distance < 0.0], view)
        self._fronts = {lane: v.id for lane, v in fronts.items()}

    def _pass(self, inside: Iterable[Observed], view: View) -> None:
        """Note whose way all on a movement have left since the last view."""
        reader, protocol = self._session.reader, self.protocol
        if reader.passing is None:
            return
        barred: dict[int, int] = {}
        for vehicle in inside:
            k = protocol.matrix.index(reader.typed(vehicle))
            barred[k] = barred.get(k, 0) | reader.passing.bars(vehicle)
        for k, still in barred.items():
            for event, _ in list(protocol.passes(self.state, k)):
                if not still >> event.foe & 1:
                    self._take(view, event)

    def _move(self, view: View, vehicle: Observed) -> None:
        """Move on a front vehicle that is still before the junction."""
        front = self.state.fronts[vehicle.lane]
        if front is None:
            raise ConformanceError(f"at {view.time:.1f} s vehicle {vehicle.id} arrived unseen")
        lane, manoeuvre = self._session.reader.typed(vehicle)
        paper = self.protocol.commit == "paper"
        if paper and front.phase == WAITING and front.goes:
            self._take(view, Event("roll", lane, manoeuvre))
        committed = self._session.reader.committed(vehicle)
        if committed and front.phase != COMMITTED:
            self._take(view, Event("commit", lane, manoeuvre))
        elif front.phase == COMMITTED and not committed:
            self._take(view, Event("slow", lane, manoeuvre))

    def _go_in(self, view: View, lane: int) -> int:
        """Take a front vehicle into the junction; return its movement as a bit."""
        front = self.state.fronts[lane]
        if front is None:
            raise ConformanceError(f"at {view.time:.1f} s a vehicle of lane {lane} left unseen")
        manoeuvre, phase, _ = front
        if phase == WAITING and self.protocol.commit == "paper":
            self._take(view, Event("roll", lane, manoeuvre))
            phase = ROLLING
        if phase != COMMITTED:
            self._take(view, Event("commit", lane, manoeuvre))
        self._take(view, Event("enter", lane, manoeuvre))
        return self.protocol.matrix.movements.bits[lane][manoeuvre]

    def _take(self, view: View, event: Event) -> None:
        for possible, after in self.protocol.successors(self.state):
            if possible == event != LOOK:
                self.state = after
                self.steps += 1
                return
        raise ConformanceError(
            f"at {view.time:.1f} s: {event} is not possible in {self.state.fronts} with "
            f"{self.state.inside:b} inside"
        )

    def _compare(self, view: View, commands: Iterable[Command]) -> None:
        """Raise unless the vehicles that go are exactly the ones that the model lets go."""
        for command in commands:
            if isinstance(command, Go):
                self._going.add(command.vehicle)
            elif isinstance(command, Hold):
                self._going.discard(command.vehicle)
        for lane, vehicle in self._fronts.items():
            front = self.state.fronts[lane]
            if front is None or front.goes != (vehicle in self._going):
                raise ConformanceError(
                    f"at {view.time:.1f} s vehicle {vehicle} of lane {lane} goes or waits where "
                    f"the protocol says otherwise: {front}"
                )
        self._going &= {v.id for v in view.vehicles}
