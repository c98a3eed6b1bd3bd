"""Traffic that is made up as it goes: vehicles come when it hurts, with the model as oracle.

A run's arrivals are fixed when it starts, so each rule adds to the list and runs again from the
beginning up to now. That costs little, and shows one thing more: what comes later changes nothing
that was before.
"""

from __future__ import annotations

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
from dim.conformance import Checked
from dim.decision import ORDERS
from minisim.control import Observed, View, can_stop
from minisim.errors import CollisionError
from minisim.simulation import Simulation
from scenarios import Scenario, regular
from tests.runs import replayed

#: Short roads: from insertion to the yellow zone it takes a few seconds.
ARM_LENGTH = 80.0
HORIZON = 2000.0
#: After so long a few vehicles have left the junction behind [s].
EMPTIED = 30.0

LANES, TURNS = st.integers(0, 4), st.integers(1, 4)


class Traffic(RuleBasedStateMachine):
    """One junction under DIM. A collision or a step outside the model raises."""

    commit = "stoppable"

    @initialize(
        n=st.sampled_from([3, 4, 5]),
        gate=st.sampled_from(GATES),
        order=st.sampled_from(ORDERS),
        profile=st.sampled_from(["paper", "fair"]),
    )
    def begin(self, n: int, gate: str, order: str, profile: str) -> None:
        self.n = n
        self.road: Scenario = regular(n, arm_length=ARM_LENGTH, profile=profile)
        self.dim = Dim(gate=gate, order=order, commit=self.commit)
        self.trips: list[tuple[float, int, int]] = []
        self.time = 0.0
        self.lead = self._time_to_yellow_zone()

    @rule(lane=LANES, manoeuvre=TURNS)
    def comes_now(self, lane: int, manoeuvre: int) -> None:
        """Somebody wants to enter the road."""
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
        """Two come on an empty road, so fast that the second may revoke what the first was given
        when that one can no longer stop."""
        self._run_to(self.time + EMPTIED)
        self._add(self.time, *first)
        self._add(self.time + tenths / 10, *second)
        self._run_to(self.time + self.lead + 3.0)

    def teardown(self) -> None:
        """In the end everybody has been served."""
        if self.trips:
            run = self._simulation().run()
            assert run.columns.arrived.all()

    def _add(self, time: float, lane: int, manoeuvre: int) -> None:
        before = self._view()
        self.trips.append((round(time, 1), lane % self.n, 1 + manoeuvre % (self.n - 1)))
        # Ids follow the order of demand: those of earlier vehicles stay.
        assert [v[1:] for v in self._view().vehicles if v.distance < ARM_LENGTH - 15] == [
            v[1:] for v in before.vehicles if v.distance < ARM_LENGTH - 15
        ]

    def _run_to(self, time: float) -> None:
        self.time = round(time, 1)
        for vehicle in self._view().vehicles:
            self._obeys(vehicle)

    def _obeys(self, vehicle: Observed) -> None:
        """Who cannot stop any more before the junction has the right of way."""
        b = self.road.profile.vehicle.deceleration
        if self.commit == "stoppable" and vehicle.distance >= 0.0 and not can_stop(vehicle, b):
            assert vehicle.id in self.going

    def _view(self) -> View:
        simulation = self._simulation()
        simulation.advance(self.time)
        session = simulation._session
        # Of `CheckedSession`; the protocol of sessions does not have it.
        self.going = set(session._going)  # type: ignore[attr-defined]
        return simulation.view()

    def _simulation(self) -> Simulation:
        trips = self.trips or [(HORIZON, 0, 1)]
        scenario = replayed(self.road, *trips, horizon=HORIZON)
        return Simulation(scenario, Checked(self.dim))

    def _time_to_yellow_zone(self) -> float:
        """From demand to the start of the yellow zone, on an empty road [s]."""
        self.trips = [(0.0, 0, 1)]
        while not any(v.distance <= 8.0 for v in self._view().vehicles):
            self.time = round(self.time + 0.1, 1)
        lead, self.time, self.trips = self.time, 0.0, []
        return lead


TestTraffic = Traffic.TestCase
TestTraffic.settings = settings(max_examples=15, stateful_step_count=15)


class CarelessTraffic(Traffic):
    """The same where vehicles that cannot stop may lose their right of way."""

    commit = "paper"


def test_the_machine_finds_what_the_papers_commit_rule_does() -> None:
    wanted = settings(
        max_examples=60,
        stateful_step_count=15,
        phases=[Phase.generate],
        report_multiple_bugs=False,
        print_blob=False,
    )
    with pytest.raises(CollisionError):
        run_state_machine_as_test(CarelessTraffic, settings=wanted)
