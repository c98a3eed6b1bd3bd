"""All vehicles agree, each on its own, whatever they see; checked against a plain model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import minisim
from dim import DecisionTable, Dim, HarmonyMatrix, decide
from dim.agent import GATES, Agent, Rules
from dim.decision import ORDERS
from dim.perception import COMMITS, Reader
from minisim.control import Go, Hold, Observed, Site, View, can_stop
from scenarios import Scenario, five_way, four_way, three_way
from tests.builders import digest

SITES = {n: maker().site() for n, maker in [(3, three_way), (4, four_way), (5, five_way)]}
LENGTH = 4.0


@st.composite
def views(draw: st.DrawFn, n: int) -> list[View]:
    """A few views in a row: vehicles of a lane in order, driving, entering, leaving, standing.

    Vehicle k of lane i has id 100·i + k in all views. Where they are is otherwise free, so that
    every combination of participants and crossing vehicles can come.
    """
    wishes = draw(st.lists(st.integers(1, n - 1), min_size=5 * n, max_size=5 * n))
    first = [0] * n
    result = []
    for time in range(draw(st.integers(1, 5))):
        seen = []
        for lane in range(n):
            first[lane] = min(first[lane] + draw(st.sampled_from([0, 0, 1])), 4)
            distance = draw(st.floats(-15.0, 9.0))
            for k in range(first[lane], min(first[lane] + draw(st.integers(0, 3)), 5)):
                speed = draw(st.sampled_from([0.0, 1.0, 2.5, 5.0]))
                wish = wishes[5 * lane + k]
                seen.append(Observed(100 * lane + k, lane, wish, distance, speed, LENGTH))
                distance += LENGTH + draw(st.floats(0.5, 5.0))
        result.append(View(float(time), tuple(v for v in seen if v.distance <= 8.5)))
    return result


@st.composite
def runs(draw: st.DrawFn) -> tuple[Site, Dim, list[View]]:
    n = draw(st.sampled_from([3, 4, 5]))
    dim = Dim(
        order=draw(st.sampled_from(ORDERS)),
        commit=draw(st.sampled_from(COMMITS)),
        # The model has no places of bodies: of "passed", see tests/unit/dim/test_passing.py.
        gate=draw(st.sampled_from([gate for gate in GATES if gate != "passed"])),
        priorities=draw(st.none() | st.permutations(range(n)).map(tuple)),
    )
    return SITES[n], dim, draw(views(n))


def is_crossing(vehicle: Observed, dim: Dim, b: float) -> bool:
    if vehicle.distance < 0:
        return True
    if dim.commit == "paper":
        return vehicle.distance < dim.zones.green / 2
    return not can_stop(vehicle, b)


def model(holding: set[int], view: View, dim: Dim, site: Site, matrix: HarmonyMatrix) -> set[int]:
    """Algorithm 1 again, for all vehicles at once."""
    near = [v for v in view.vehicles if v.distance <= 8.0]
    crossing = [v for v in near if is_crossing(v, dim, site.vehicle.deceleration)]
    before = sorted((v for v in near if v.distance >= 0), key=lambda v: -v.distance)
    front = {v.lane: v for v in before}.values()  # the nearest of each lane comes last
    waiting = [v for v in front if v not in crossing]
    going = {v.id for v in near if v.id in holding}
    if dim.commit == "paper":
        going |= {v.id for v in crossing}
    if crossing and dim.gate == "clear":
        return going
    admitted = [
        v
        for v in waiting
        if all(c.lane == v.lane or matrix.harmony(v.movement, c.movement) for c in crossing)
    ]
    chosen = decide([v.movement for v in admitted], matrix, dim.order, dim.ranks(site))
    going -= {v.id for v in waiting}
    return going | {v.id for v in admitted if v.movement in chosen}


@given(runs())
def test_the_session_follows_the_model(run: tuple[Site, Dim, list[View]]) -> None:
    site, dim, shown = run
    session, matrix = dim.start(site), dim.harmony(site)
    told: set[int] = set()
    holding: set[int] = set()
    for view in shown:
        commands = list(session.decide(view))
        goes = {c.vehicle for c in commands if isinstance(c, Go)}
        holds = {c.vehicle for c in commands if isinstance(c, Hold)}
        near = {v.id for v in view.vehicles if v.distance <= 8.0}
        assert goes <= near - told  # only changes are told,
        assert holds <= near & told  # each once, to vehicles that are there
        assert len(goes) + len(holds) == len({c for c in commands if isinstance(c, Go | Hold)})
        told = (told | goes) - holds
        holding = model(holding, view, dim, site, matrix)
        assert told & near == holding
        told &= near


@given(runs())
def test_decisions_are_unanimous(run: tuple[Site, Dim, list[View]]) -> None:
    """Each vehicle with a table, a reader and an agent of its own; nothing is shared."""
    site, dim, shown = run
    b, n, ranks = site.vehicle.deceleration, site.intersection.n, dim.ranks(site)
    minds: dict[int, tuple[Agent, Reader]] = {}
    session = dim.start(site)
    told: set[int] = set()
    for view in shown:
        for command in session.decide(view):
            if isinstance(command, Go):
                told.add(command.vehicle)
            elif isinstance(command, Hold):
                told.discard(command.vehicle)
        near = [v for v in view.vehicles if v.distance <= 8.0]
        for v in near:
            if v.id not in minds:
                own = DecisionTable(HarmonyMatrix.paper(n), dim.order, ranks)
                agent = Agent(v.id, v.lane, Rules(own, dim.gate, dim.commit))
                minds[v.id] = agent, Reader(n, dim.zones, (b,), dim.commit)
        percepts = {v.id: minds[v.id][1].read(view) for v in near}
        assert len(set(percepts.values())) <= 1
        going = {v.id for v in near if minds[v.id][0].decide(percepts[v.id])}
        assert going == {v.id for v in near if v.id in told}
        minds = {v.id: minds[v.id] for v in near}
        told = going


@pytest.mark.parametrize("maker", [three_way, four_way, five_way])
@pytest.mark.parametrize("commit", COMMITS)
@pytest.mark.parametrize("gate", GATES)
def test_wake_ups_lose_nothing(gate: str, commit: str, maker: Callable[..., Scenario]) -> None:
    """The same trips, and collisions of the paper's commit rule, as when looking all the time."""
    scenario = maker(density=350, horizon=600.0)
    dim = Dim(gate=gate, commit=commit)
    woken, always = (
        digest(minisim.simulate(scenario, controller, seed=1, on_collision="record"))
        for controller in (dim, replace(dim, period=scenario.profile.dt))
    )
    assert woken == always
