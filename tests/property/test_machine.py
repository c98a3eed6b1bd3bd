"""Traffic that is made up on the way: vehicles come at bad moments, with the model as oracle.

A run's arrivals are fixed when it starts, so each rule adds to the list and runs again from the
beginning up to now. That costs little, and shows that later arrivals change no earlier event.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import pytest
from hypothesis import Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    precondition,
    rule,
    run_state_machine_as_test,
)

from dim import Dim
from dim.agent import GATES
from dim.decision import ORDERS
from dim.proofs.conformance import Checked
from minisim.control import Brake, Command, Controller, Observed, Site, View, can_stop
from minisim.errors import CollisionError
from minisim.simulation import Simulation
from scenarios import Scenario, regular
from tests.builders import Reading, replayed

#: Short roads: a vehicle reaches the yellow zone in a few seconds.
ARM_LENGTH = 80.0
HORIZON = 2000.0
#: By then a few vehicles have left the junction [s].
EMPTIED = 30.0

LANES, TURNS = st.integers(0, 4), st.integers(1, 4)


class Traffic(RuleBasedStateMachine):
    """One junction under DIM. A collision or a step outside the model raises."""

    commit = "stoppable"

    @initialize(
        n=st.sampled_from([3, 4, 5]), gate=st.sampled_from(GATES), order=st.sampled_from(ORDERS),
        profile=st.sampled_from(["paper", "fair"]),
    )  # fmt: skip
    def begin(self, n: int, gate: str, order: str, profile: str) -> None:
        self.n = n
        self.road: Scenario = regular(n, arm_length=ARM_LENGTH, profile=profile)
        self.dim = Dim(gate=gate, order=order, commit=self.commit)
        self.trips: list[tuple[float, int, int]] = []
        self.time = 0.0
        self.lead = self._time_to_yellow_zone()

    @rule(lane=LANES, manoeuvre=TURNS)
    def comes_now(self, lane: int, manoeuvre: int) -> None:
        """A vehicle wants to enter the road."""
        self._add(self.time, lane, manoeuvre)

    @rule(tenths=st.integers(1, 100))
    def time_passes(self, tenths: int) -> None:
        self._run_to(self.time + tenths / 10)

    @rule(lane=LANES, manoeuvre=TURNS, tenths=st.integers(-10, 10))
    @precondition(lambda self: self.trips)
    def comes_when_another_does(self, lane: int, manoeuvre: int, tenths: int) -> None:
        """A late arrival in the yellow zone: just as the last one rolls through it."""
        latest = max(time for time, _, _ in self.trips)
        self._add(max(self.time, latest + tenths / 10), lane, manoeuvre)

    @rule(first=st.tuples(LANES, TURNS), second=st.tuples(LANES, TURNS), tenths=st.integers(0, 15))
    def a_pair_comes(self, first: tuple[int, int], second: tuple[int, int], tenths: int) -> None:
        """On an empty road: the second may revoke the first's right of way when it cannot stop."""
        self._run_to(self.time + EMPTIED)
        self._add(self.time, *first)
        self._add(self.time + tenths / 10, *second)
        self._run_to(self.time + self.lead + 3.0)

    def teardown(self) -> None:
        """In the end every vehicle has been served."""
        if self.trips:
            assert self._simulation().run().columns.arrived.all()

    def _add(self, time: float, lane: int, manoeuvre: int) -> None:
        before = self._view()
        self.trips.append((round(time, 1), lane % self.n, 1 + manoeuvre % (self.n - 1)))
        # Earlier vehicles stay what they are, but for ids, which follow the order of demand.
        old, new = (
            [v[1:] for v in view.vehicles if v.distance < ARM_LENGTH - 15]
            for view in (before, self._view())
        )
        assert new == old

    def _run_to(self, time: float) -> None:
        """Vehicles that can no longer stop before the junction have the right of way there."""
        self.time = round(time, 1)
        b = self.road.profile.vehicle.deceleration
        for vehicle in self._view().vehicles:
            if self.commit == "stoppable" and vehicle.distance >= 0.0 and not can_stop(vehicle, b):
                assert vehicle.id in self.going

    def _view(self) -> View:
        simulation = self._simulation()
        simulation.advance(self.time)
        released = simulation._vehicles["go"] == 1
        self.going = set(simulation._vehicles["id"][released].tolist())
        return simulation.view()

    def _simulation(self) -> Simulation:
        trips = self.trips or [(HORIZON - 1.0, 0, 1)]  # none comes before the end
        scenario = replayed(self.road, *trips, horizon=HORIZON)
        return Simulation(scenario, self._controller())

    def _controller(self) -> Controller:
        return Checked(self.dim)

    def _time_to_yellow_zone(self) -> float:
        """From demand to the start of the yellow zone, on an empty road [s]."""
        self.trips = [(0.0, 0, 1)]
        while not any(v.distance <= 8.0 for v in self._view().vehicles):
            self.time = round(self.time + 0.1, 1)
        lead, self.time, self.trips = self.time, 0.0, []
        return lead


@dataclass(frozen=True)
class Stall:
    """A vehicle that brakes comfortably from a time on, and stands until another."""

    vehicle: int
    start: float
    end: float


@dataclass(frozen=True)
class Change:
    """A vehicle whose indicator shows another manoeuvre until a time."""

    vehicle: int
    shown: int
    until: float


def indicators(changes: tuple[Change, ...]) -> Reading:
    """All vehicles, even the one itself, go by what its indicator shows at the time."""

    def shown(view: View, _: Observed, vehicle: Observed) -> int:
        now = (c for c in changes if c.vehicle == vehicle.id and view.time < c.until - 1e-6)
        return next((c.shown for c in now), vehicle.manoeuvre)

    return Reading(shown)


@dataclass(frozen=True)
class Stalling:
    """DIM, and vehicles that stall."""

    dim: Dim
    stalls: tuple[Stall, ...]
    name = "stalling"

    def start(self, site: Site) -> StallingSession:
        return StallingSession(self, site)


class StallingSession:
    def __init__(self, recipe: Stalling, site: Site) -> None:
        self._dim = recipe.dim.start(site)
        self._stalls = recipe.stalls
        self._hard = site.vehicle.deceleration
        self._stalled: set[int] = set()
        self.plan = replace(self._dim.plan, period=site.dt)

    def decide(self, view: View) -> Iterable[Command]:
        now = {s.vehicle for s in self._stalls if s.start - 1e-6 <= view.time < s.end - 1e-6}
        yield from self._dim.decide(view)
        yield from (Brake(vehicle, self._hard) for vehicle in sorted(now))
        yield from (Brake(vehicle, 0.0) for vehicle in sorted(self._stalled - now))
        self._stalled = now


class DisturbedTraffic(Traffic):
    """The same where vehicles stall, anywhere, and change their minds while they still may.

    The model knows neither. But no vehicles may collide, those that cannot stop must have the right
    of way, and in the end all must have been served.
    """

    stalls: tuple[Stall, ...] = ()
    changes: tuple[Change, ...] = ()

    @rule(which=st.integers(0, 20), tenths=st.integers(5, 150))
    @precondition(lambda self: self.trips)
    def stalls_now(self, which: int, tenths: int) -> None:
        """A vehicle in sight, before the junction or inside, stands for a while."""
        here = self._view().vehicles
        free = [v.id for v in here if all(s.vehicle != v.id for s in self.stalls)]
        if free:
            vehicle = free[which % len(free)]
            self.stalls += (Stall(vehicle, self.time, round(self.time + tenths / 10, 1)),)

    @rule(which=st.integers(0, 20), manoeuvre=TURNS)
    @precondition(lambda self: self.trips)
    def changes_indicator(self, which: int, manoeuvre: int) -> None:
        """A vehicle that can still stop changes its way, and its indicator from now on."""
        b = self.road.profile.vehicle.deceleration
        here = [v for v in self._view().vehicles if v.distance >= 0.0 and can_stop(v, b)]
        free = [v for v in here if all(c.vehicle != v.id for c in self.changes)]
        if not free:
            return
        vehicle = free[which % len(free)]
        before = self.trips, self.changes
        # Ids are the order of demand, of equals that of lanes.
        order = sorted(range(len(self.trips)), key=lambda k: self.trips[k][:2])
        changed = list(self.trips)
        time, lane, shown = changed[order[vehicle.id]]
        assert (lane, shown) == (vehicle.lane, vehicle.manoeuvre)
        changed[order[vehicle.id]] = time, lane, 1 + manoeuvre % (self.n - 1)
        self.trips, self.changes = changed, (*self.changes, Change(vehicle.id, shown, self.time))
        # On its way to another exit it may have come a little faster: too fast for a change.
        now = next((v for v in self._view().vehicles if v.id == vehicle.id), None)
        if now is None or now.distance < 0.0 or not can_stop(now, b):
            self.trips, self.changes = before

    def _controller(self) -> Controller:
        dim = replace(self.dim, perception=indicators(self.changes))
        return Stalling(dim, self.stalls)


TestTraffic = Traffic.TestCase
TestDisturbedTraffic = DisturbedTraffic.TestCase
TestDisturbedTraffic.settings = settings(max_examples=8, stateful_step_count=12)
TestTraffic.settings = settings(max_examples=15, stateful_step_count=15)


class CarelessTraffic(Traffic):
    """The same where vehicles that cannot stop may lose their right of way."""

    commit = "paper"


def test_the_machine_finds_what_the_papers_commit_rule_does() -> None:
    wanted = settings(
        max_examples=400, stateful_step_count=15, phases=[Phase.generate],
        report_multiple_bugs=False, print_blob=False,
    )  # fmt: skip
    with pytest.raises(CollisionError):
        run_state_machine_as_test(CarelessTraffic, settings=wanted)
