"""Whether the protocol is safe and live, found by visiting all its states one by one.

Safe: no two conflicting movements are inside at once. Live: whenever vehicles are there, one can go
on once all have looked; every move except slowing down takes a vehicle forward, so the junction
empties if no new ones come. Fair: no vehicle waits forever while others come and cross.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import networkx as nx

from dim.proofs.protocol import TURN, WAITING, Event, Protocol, State
from minisim.errors import InputError, instance, integer

MAX_STATES = 3_000_000  #: the most states to visit: they take about a gigabyte of memory

Path = tuple[Event, ...]
Steps = tuple[tuple[State, Event], ...]  #: states, and the event that happens in each
Visited = Callable[[int], object]  #: called with the number of states visited

#: State -> the state from which it was first reached, and the event; nearest first.
Reached = dict[State, tuple[State, Event] | None]


@dataclass(frozen=True)
class Exploration:
    """The result of a search through the states, which ends at the nearest unsafe ones."""

    protocol: Protocol
    states: int
    transitions: int
    complete: bool  # whether all states were visited
    unsafe: tuple[Path, ...]  # the shortest path to each state with a conflict inside
    stuck: Path | None  # the shortest path to a state in which no vehicle can go on


@dataclass(frozen=True)
class Lasso:
    """How a lane's front vehicle waits forever: the events that lead there, then those repeated."""

    lane: int
    stem: Path
    cycle: Path


def explore(
    protocol: Protocol, max_states: int = MAX_STATES, progress: Visited | None = None
) -> Exploration:
    """Visit states, nearest first, up to the first unsafe ones.

    Raises `InputError` for more than `max_states`, of which each takes about 300 bytes of memory.
    """
    instance("protocol", protocol, Protocol)
    integer("max_states", max_states, low=1)
    reached: Reached = {protocol.start: None}
    queue = deque([protocol.start])
    transitions = 0
    unsafe: list[Path] = []
    stuck = None
    while queue:
        state = queue.popleft()
        if unsafe and len(_path(reached, state)) == len(unsafe[0]):
            break
        if stuck is None and is_stuck(protocol, state):
            stuck = _path(reached, state)
        for event, after in protocol.successors(state):
            transitions += 1
            if after in reached:
                continue
            reached[after] = state, event
            queue.append(after)
            if event.what == "enter" and protocol.conflict(after):
                unsafe.append(_path(reached, after))
        if len(reached) > max_states:
            raise InputError(f"more than {max_states} states: too many to visit them all")
        if progress is not None and transitions % 1024 < 8:
            progress(len(reached))
    return Exploration(protocol, len(reached), transitions, not unsafe, tuple(unsafe), stuck)


def is_stuck(protocol: Protocol, state: State) -> bool:
    """Whether vehicles are there and, after all have looked, none can go on."""
    if not state.inside and not any(state.fronts):
        return False
    return next(protocol.moves(protocol.look(state)), None) is None


def starvation(protocol: Protocol) -> tuple[Lasso | None, ...]:
    """For each lane, the shortest way for its front vehicle to wait forever, or None.

    None proves over all states that it cannot, if all vehicles look between any two events, a
    vehicle that can go on eventually does, and a rotating priority lasts long enough to decide.
    Raises `InputError` for what is not a protocol.
    """
    instance("protocol", protocol, Protocol)
    reached: Reached = {protocol.start: None}
    queue = deque([protocol.start])
    while queue:
        state = queue.popleft()
        for event, after in prompt(protocol, state):
            if after not in reached:
                reached[after] = state, event
                queue.append(after)
    return tuple(_starving(protocol, reached, lane) for lane in range(protocol.matrix.n))


def _starving(protocol: Protocol, reached: Reached, lane: int) -> Lasso | None:
    graph: nx.DiGraph[State] = nx.DiGraph()
    for state in reached:
        if _waits(state, lane):
            for event, after in prompt(protocol, state):
                if _waits(after, lane):
                    graph.add_edge(state, after, event=event)
    for part in list(nx.strongly_connected_components(graph)):
        steps = graph.subgraph(part).edges(data=True)
        if not is_fair(protocol, tuple((state, data["event"]) for state, _, data in steps)):
            graph.remove_nodes_from(part)
    return _shortest(protocol, graph, reached, lane) if graph else None


def prompt(protocol: Protocol, state: State) -> Iterator[tuple[Event, State]]:
    """What can happen next in the fairest case: all look after each event, and none slows down."""
    for event, after in protocol.successors(state):
        if event.what not in ("look", "slow"):
            yield event, protocol.look(after)


def _waits(state: State, lane: int) -> bool:
    front = state.fronts[lane]
    return front is not None and front.phase == WAITING and not front.goes


def _shortest(protocol: Protocol, graph: nx.DiGraph[State], reached: Reached, lane: int) -> Lasso:
    """The fair lasso with the fewest events; `graph` is known to hold a fair cycle."""
    distance: dict[State, int] = {}
    for state, came_from in reached.items():
        distance[state] = 0 if came_from is None else distance[came_from[0]] + 1
    starts = [state for state in reached if state in graph]
    total = distance[starts[0]] + 1
    while True:
        total += 1
        for start in starts:
            if distance[start] + 2 > total:
                break
            for cycle in _cycles(graph, start, total - distance[start]):
                if is_fair(protocol, cycle):
                    events = tuple(event for _, event in cycle)
                    return Lasso(lane, _path(reached, start), events)


def _cycles(graph: nx.DiGraph[State], start: State, length: int) -> Iterator[Steps]:
    """Closed walks of `length` steps from `start`."""
    trail: list[tuple[State, Event]] = []

    def walk(state: State, left: int) -> Iterator[Steps]:
        for after, data in graph[state].items():
            if left > 1 or after == start:
                trail.append((state, data["event"]))
                if left == 1:
                    yield tuple(trail)
                else:
                    yield from walk(after, left - 1)
                trail.pop()

    return walk(start, length)


def is_fair(protocol: Protocol, steps: Steps) -> bool:
    """Whether `steps`, repeated forever, get somewhere and leave no other vehicle out.

    A vehicle enters. One that can go on in every state does so. One inside in every state leaves
    (or others follow on the same movement). A turn that can end in every state ends.
    """
    events = {event for _, event in steps}
    states = [state for state, _ in steps]
    if not any(event.what == "enter" for event in events):
        return False
    if protocol.priorities == "rotating" and TURN not in events and all(s.decided for s in states):
        return False
    moving = {event.lane for event in events if event.what in ("roll", "commit", "enter")}
    passing = {event[1:3] for event in events if event.what in ("enter", "leave")}
    able = set(range(protocol.matrix.n))
    inside = -1
    for state in states:
        inside &= state.inside
        able &= {lane for lane, f in enumerate(state.fronts) if f and (f.goes or f.phase)}
    staying = {tuple(m) for k, m in enumerate(protocol.matrix.movements) if inside >> k & 1}
    return able <= moving and staying <= passing


def _path(reached: Reached, state: State) -> Path:
    events: list[Event] = []
    while (came_from := reached[state]) is not None:
        state, event = came_from
        events.append(event)
    return tuple(reversed(events))
