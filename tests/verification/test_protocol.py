"""All states of the protocol: safe, live, which lanes starve; agents decide as the model does."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from functools import cache, reduce
from operator import or_

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import minisim
from dim import DecisionTable, Dim, HarmonyMatrix
from dim.agent import GATES, Agent, Rules
from dim.decision import ORDERS
from dim.perception import COMMITS, Percept
from dim.proofs.conformance import Checked, ConformanceError
from dim.proofs.modelcheck import Lasso, explore, starvation
from dim.proofs.protocol import COMMITTED, PRIORITIES, WAITING, Event, Protocol, State
from minisim.control import Site
from minisim.errors import InputError
from scenarios import Scenario, four_way, three_way
from scenarios.counterexample import colliding_arrivals
from scenarios.strategies import scenarios
from tests.builders import digest, drained


@cache
def paper(n: int) -> HarmonyMatrix:
    return HarmonyMatrix.paper(n)


def states_of(protocol: Protocol, at_most: int = 10_000) -> list[State]:
    """The nearest ones."""
    seen = {protocol.start: None}
    queue = deque(seen)
    while queue and len(seen) < at_most:
        for _, after in protocol.successors(queue.popleft()):
            if after not in seen:
                seen[after] = None
                queue.append(after)
    return list(seen)


@pytest.mark.parametrize(
    ("n", "gate", "states"),
    [
        (3, "clear", 872),
        (3, "harmonious", 2620),
        (4, "clear", 37552),
        pytest.param(3, "passed", 168285, marks=pytest.mark.slow),
        pytest.param(4, "harmonious", 165632, marks=pytest.mark.slow),
    ],
)
def test_the_stoppable_rule_is_safe_and_never_stuck(n: int, gate: str, states: int) -> None:
    search = explore(Protocol(paper(n), gate=gate))
    assert (search.complete, search.unsafe, search.stuck) == (True, (), None)
    assert search.states == states


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("priorities", PRIORITIES)
@pytest.mark.parametrize("gate", GATES[:2])
def test_it_is_with_every_order_of_priority(gate: str, priorities: str, order: str) -> None:
    search = explore(Protocol(paper(3), order, gate, priorities=priorities))
    assert (search.complete, search.unsafe, search.stuck) == (True, (), None)


@pytest.mark.parametrize("order", ORDERS)
def test_with_the_gate_passed_it_is(order: str) -> None:
    """On three arms without near turns out of two; with all movements it is marked slow."""
    search = explore(Protocol(paper(3), order, "passed", closed=("a1", "b1")))
    assert (search.complete, search.unsafe, search.stuck) == (True, (), None)


class Blind(Protocol):
    """As if all vehicles inside were out of every way."""

    def look(self, state: State) -> State:
        return super().look(state._replace(inside=0))._replace(inside=state.inside)


def test_a_gate_that_overlooks_vehicles_inside_is_found() -> None:
    assert explore(Blind(paper(3), gate="passed")).unsafe


@pytest.mark.parametrize(("n", "gate"), [(3, "clear"), (3, "harmonious"), (4, "clear")])
def test_the_papers_commit_rule_is_not_safe(n: int, gate: str) -> None:
    search = explore(Protocol(paper(n), gate=gate, commit="paper"))
    assert not search.complete
    assert search.stuck is None
    assert {len(path) for path in search.unsafe} == {11}
    for path in search.unsafe:
        assert sum(event.what == "arrive" for event in path) == 2


@pytest.mark.parametrize("road", [three_way(), three_way(profile="fair")], ids=["paper", "fair"])
def test_its_counterexample_collides_in_the_simulator(road: Scenario) -> None:
    site = road.site()
    matrix = HarmonyMatrix.from_geometry(site.intersection, site.vehicle)
    paths = explore(Protocol(matrix, commit="paper")).unsafe
    dim = Dim(commit="paper")
    arrivals = colliding_arrivals(road, dim, paths)
    assert arrivals is not None
    assert len(arrivals) == 2
    scenario = replace(road, recorded=arrivals, horizon=200.0)
    assert minisim.simulate(scenario, dim, on_collision="record").collisions
    assert minisim.simulate(scenario, Dim()).columns.arrived.all()


def test_safe_paths_collide_nowhere() -> None:
    path = (Event("arrive", 0, 2), Event("arrive", 1, 2))
    short = replace(four_way(), horizon=100.0)
    assert colliding_arrivals(short, Dim(), [path]) is None


def test_with_the_stoppable_rule_all_vehicles_that_go_are_in_harmony() -> None:
    """This invariant of all states is why it is safe."""
    for gate in GATES:
        protocol = Protocol(paper(3), gate=gate)
        for state in states_of(protocol):
            after = State((None,) * 3, state.inside, passed=state.passed)
            for lane, front in enumerate(state.fronts):
                if front is not None and front.goes:
                    after = protocol.entered(after, lane, front.manoeuvre)
            assert protocol.conflict(after) is None


def agents_say(protocol: Protocol, state: State, table: DecisionTable) -> list[bool]:
    """Whether each front vehicle goes, by its own agent, after it has looked."""
    n, movements = protocol.matrix.n, protocol.matrix.movements
    present = [(lane, f) for lane, f in enumerate(state.fronts) if f is not None]
    participants = [(lane, f) for lane, f in present if f.phase != COMMITTED]
    crossing = [(lane, f) for lane, f in present if f.phase == COMMITTED]
    inside = [k for k in range(len(movements)) if state.inside >> k & 1]
    percept = Percept(
        participants=tuple(lane for lane, _ in participants),
        crossing=tuple(lane for lane, _ in crossing) + tuple(100 + k for k in inside),
        case=sum(f.manoeuvre * n**lane for lane, f in participants),
        occupied=sum(1 << lane * (n - 1) + f.manoeuvre - 1 for lane, f in crossing),
        barred=reduce(or_, (protocol.in_way(state, k) for k in inside), 0),
    )
    answers = []
    for lane, front in present:
        agent = Agent(lane, lane, Rules(table, protocol.gate, protocol.commit))
        agent.right_of_way = front.goes
        answers.append(agent.decide(percept))
    return answers


@pytest.mark.parametrize("gate", GATES)
@pytest.mark.parametrize("commit", COMMITS)
@pytest.mark.parametrize("order", ORDERS)
def test_in_every_state_the_agents_decide_as_the_model(gate: str, commit: str, order: str) -> None:
    protocol = Protocol(paper(3), order, gate, commit)
    table = DecisionTable(paper(3), order)
    for state in states_of(protocol, 3000):
        after = protocol.look(state)
        assert protocol.look(after) == after
        assert [f.goes for f in after.fronts if f] == agents_say(protocol, state, table)


def replay(protocol: Protocol, lasso: Lasso) -> None:
    """Follow a lasso: all vehicles look after each event, and the vehicle never goes."""
    state = protocol.start
    for event in lasso.stem:
        state = follow(protocol, state, event)
    first = state
    for event in lasso.cycle:
        front = state.fronts[lasso.lane]
        assert front is not None
        assert (front.phase, front.goes) == (WAITING, False)
        state = follow(protocol, state, event)
    assert state == first
    assert any(event.what == "enter" for event in lasso.cycle)


def follow(protocol: Protocol, state: State, event: Event) -> State:
    (after,) = [after for possible, after in protocol.successors(state) if possible == event]
    return protocol.look(after)


@pytest.mark.parametrize("n", [3, pytest.param(4, marks=pytest.mark.slow)])
def test_fixed_priorities_starve_all_but_the_first_lane(n: int) -> None:
    protocol = Protocol(paper(n), "lanes")
    first, *others = starvation(protocol)
    assert first is None
    for lane, lasso in enumerate(others, start=1):
        assert lasso is not None
        assert lasso.lane == lane
        assert (len(lasso.stem), len(lasso.cycle)) == (2, 4)
        replay(protocol, lasso)


@pytest.mark.parametrize(
    ("gate", "order", "priorities"),
    [
        *(("clear", "size", priorities) for priorities in PRIORITIES),
        ("harmonious", "size", "fixed"), ("harmonious", "lanes", "rotating"),
        ("harmonious", "lanes", "waiting"),
    ],
)  # fmt: skip
def test_every_lane_can_starve(gate: str, order: str, priorities: str) -> None:
    """Largest first, or behind the harmonious gate, whatever the priorities.

    There, vehicles in harmony with those inside go on for ever past one in conflict with them.
    """
    protocol = Protocol(paper(3), order, gate, priorities=priorities)
    for lasso in starvation(protocol):
        assert lasso is not None
        replay(protocol, lasso)
        if gate == "clear" and priorities == "rotating":
            assert "turn" in {event.what for event in lasso.cycle}


@pytest.mark.slow
@pytest.mark.parametrize(("order", "priorities"), [("size", "fixed"), ("lanes", "waiting")])
def test_behind_the_gate_passed_every_lane_can_starve(order: str, priorities: str) -> None:
    """A stream that is never out of a vehicle's way; without near turns out of two lanes."""
    protocol = Protocol(paper(3), order, "passed", priorities=priorities, closed=("a1", "b1"))
    for lasso in starvation(protocol):
        assert lasso is not None
        replay(protocol, lasso)


@pytest.mark.parametrize(
    ("gate", "states"),
    [("clear", 9379), pytest.param("harmonious", 83736, marks=pytest.mark.slow)],
)
def test_with_types_told_apart_it_is_safe_and_never_stuck(gate: str, states: int) -> None:
    site = three_way(fleet="car:0.5,bus:0.5", lane_width=3.5).site()
    matrix = HarmonyMatrix.from_geometry(site.intersection, site.fleet, by_type=True)
    search = explore(Protocol(matrix, gate=gate))
    assert (search.complete, search.unsafe, search.stuck) == (True, (), None)
    assert search.states == states


@pytest.mark.parametrize("priorities", ["rotating", "waiting"])
def test_lanes_first_with_changing_priorities_starves_no_lane(priorities: str) -> None:
    assert starvation(Protocol(paper(3), "lanes", priorities=priorities)) == (None,) * 3


@given(
    scenarios(max_arms=5, max_density=600.0, horizon=60.0),
    st.integers(0, 2**32 - 1),
    st.builds(
        Dim, gate=st.sampled_from(GATES), order=st.sampled_from(ORDERS),
        commit=st.sampled_from(COMMITS),
    ),
)  # fmt: skip
@settings(max_examples=30)
def test_every_run_is_a_path_of_the_model(scenario: Scenario, seed: int, dim: Dim) -> None:
    scenario = drained(scenario, seed, 1500.0)
    checked = minisim.simulate(scenario, Checked(dim), seed=seed, on_collision="record")
    plain = minisim.simulate(scenario, dim, seed=seed, on_collision="record")
    assert digest(checked) == digest(plain)


@pytest.mark.parametrize("gate", GATES)
def test_every_run_that_tells_types_apart_is_one(gate: str) -> None:
    scenario = four_way(300, fleet="india", lane_width=3.5, profile="fair", horizon=300.0)
    dim = Dim(gate=gate, bodies="own")
    checked = minisim.simulate(scenario, Checked(dim), seed=3)
    assert digest(checked) == digest(minisim.simulate(scenario, dim, seed=3))


def test_a_run_that_leaves_the_model_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each rule in which the model differs from the session shows."""
    scenario = four_way(density=350.0, horizon=300.0)

    def run(dim: Dim, **model: str) -> None:
        start = Checked.start

        def other(self: Checked, site: Site) -> object:
            session = start(self, site)
            session.protocol = replace(session.protocol, **model)
            return session

        with monkeypatch.context() as patch:
            patch.setattr(Checked, "start", other)
            minisim.simulate(scenario, Checked(dim), seed=2, on_collision="record")

    run(Dim())
    for dim, model in [
        (Dim(), {"gate": "harmonious"}),
        (Dim(gate="harmonious"), {"gate": "clear"}),
        (Dim(order="lanes"), {"order": "size"}),
        (Dim(commit="paper"), {"commit": "stoppable"}),
    ]:
        with pytest.raises(ConformanceError, match=r"at [0-9.]+ s"):
            run(dim, **model)


def test_only_the_lanes_own_priorities_are_checked() -> None:
    with pytest.raises(InputError, match="own priorities only"):
        Checked(Dim(priorities="rotating"))
    assert Checked(Dim(gate="harmonious")).name == "dim:gate=harmonious"
