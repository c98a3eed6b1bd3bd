"""The searches through the states, on protocols so small that every number can be counted."""

from __future__ import annotations

import pytest

from dim import HarmonyMatrix
from dim.proofs.modelcheck import Exploration, explore, is_fair, is_stuck, prompt, starvation
from dim.proofs.protocol import (
    COMMITTED,
    LOOK,
    ROLLING,
    TURN,
    WAITING,
    Event,
    Front,
    Protocol,
    State,
)  # fmt: skip
from minisim.errors import InputError

PAPER = HarmonyMatrix.paper(3)

WAITS, GOES, ENTERS = Front(2, WAITING, False), Front(2, WAITING, True), Front(2, COMMITTED, True)


class Few(Protocol):
    """Only a2 and b2 ever come, which are in conflict, and b2 never before a2."""

    def arrivals(self, state: State):  # type: ignore[no-untyped-def]
        for event, after in super().arrivals(state):
            if event[1:3] == (0, 2) or (event[1:3] == (1, 2) and state.fronts[0]):
                yield event, after


class OneOf(Protocol):
    """Only a2 ever comes, and once it has entered it never leaves."""

    def arrivals(self, state: State):  # type: ignore[no-untyped-def]
        yield from (step for step in super().arrivals(state) if step[0][1:3] == (0, 2))

    def moves(self, state: State):  # type: ignore[no-untyped-def]
        yield from (s for s in super().moves(state) if s[0].what not in ("leave", "slow"))


def test_all_states_of_a_lone_lane() -> None:
    """The lane empty, waiting, going, committed; then inside, and another one waiting for ever."""
    protocol = OneOf(PAPER)
    search = explore(protocol)
    assert search.protocol is protocol
    assert (search.states, search.transitions) == (6, 5)
    assert (search.complete, search.unsafe) == (True, ())
    path = [str(event) for event in search.stuck or ()]
    assert path == ["arrive a2", "look", "commit a2", "enter a2"]


def test_the_limit_of_states_is_the_last_allowed() -> None:
    assert explore(OneOf(PAPER), max_states=6).states == 6
    with pytest.raises(InputError, match="more than 5 states: too many"):
        explore(OneOf(PAPER), max_states=5)
    with pytest.raises(InputError, match="max_states must be an integer of at least 1"):
        explore(OneOf(PAPER), max_states=0)
    with pytest.raises(InputError, match="protocol must be a Protocol"):
        explore("paper")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="protocol must be a Protocol"):
        starvation("paper")  # type: ignore[arg-type]


def test_progress_is_told_now_and_then() -> None:
    told: list[int] = []
    search = explore(Protocol(PAPER), progress=told.append)
    assert told == sorted(told)
    assert 0 < len(told) < search.transitions / 100
    assert told[-1] <= search.states


def test_the_nearest_unsafe_states_are_all_found_and_none_beyond() -> None:
    class Blind(Few):
        """No vehicle looks before it goes."""

        def look(self, state: State) -> State:
            fronts = tuple(f and Front(f.manoeuvre, f.phase, True) for f in state.fronts)
            return state._replace(fronts=fronts)

    search = explore(Blind(PAPER))
    assert isinstance(search, Exploration)
    assert not search.complete
    for path in search.unsafe:
        state = Blind(PAPER).start
        for event in path:
            (state,) = [s for e, s in Blind(PAPER).successors(state) if e == event]
        assert Blind(PAPER).conflict(state) is not None
    # Two come, all look, both commit and enter: one state, which has other ways to it.
    (path,) = search.unsafe
    assert len(path) == 7
    words = [event.what for event in path]
    assert sorted(words) == ["arrive", "arrive", "commit", "commit", "enter", "enter", "look"]


def test_stuck_vehicles_are_there_and_cannot_go_on() -> None:
    class Mute(Protocol):
        def look(self, state: State) -> State:
            return state

        def moves(self, state: State):  # type: ignore[no-untyped-def]
            yield from (step for step in super().moves(state) if step[0].what != "leave")

    mute = Mute(PAPER)
    assert not is_stuck(mute, mute.start)
    assert is_stuck(mute, State((WAITS, None, None)))
    assert is_stuck(mute, State((None, None, None), 1))
    assert not is_stuck(mute, State((GOES, None, None)))
    assert not is_stuck(Protocol(PAPER), State((None, None, None), 1))


def test_prompt_vehicles_look_after_each_event_and_never_slow_down() -> None:
    protocol = Protocol(PAPER)
    steps = dict(prompt(protocol, protocol.start))
    assert steps[Event("arrive", 0, 2)] == State((GOES, None, None))
    events = {event.what for event, _ in prompt(protocol, State((ENTERS, None, None)))}
    assert events == {"arrive", "enter"}
    assert LOOK not in dict(prompt(protocol, State((WAITS, None, None))))


ENTER = Event("enter", 1, 2)


@pytest.mark.parametrize(
    ("fair", "steps"),
    [
        (False, [(State((None, None, None)), Event("arrive", 0, 1))]),  # none enters
        (True, [(State((WAITS, ENTERS, None)), ENTER)]),
        (False, [(State((GOES, ENTERS, None)), ENTER)]),  # a could go and does not
        (False, [(State((ENTERS, ENTERS, None)), ENTER)]),
        (False, [(State((Front(2, ROLLING, False), ENTERS, None)), ENTER)]),
        (True, [(State((GOES, ENTERS, None)), ENTER), (State((WAITS, ENTERS, None)), ENTER)]),
        (True, [(State((GOES, ENTERS, None)), ENTER),
                (State((GOES, ENTERS, None)), Event("commit", 0, 2))]),
        (True, [(State((GOES, ENTERS, None)), ENTER),
                (State((GOES, ENTERS, None)), Event("roll", 0, 2))]),
        (False, [(State((GOES, ENTERS, None)), ENTER),
                 (State((GOES, ENTERS, None)), Event("arrive", 0, 2))]),
        (False, [(State((None, ENTERS, None), 1), ENTER)]),  # a1 never leaves
        (True, [(State((None, ENTERS, None), 1), ENTER),
                (State((None, ENTERS, None), 1), Event("leave", 0, 1))]),
        (True, [(State((None, ENTERS, None), 1), ENTER), (State((None, ENTERS, None)), ENTER)]),
        (True, [(State((None, ENTERS, None)), ENTER), (State((None, ENTERS, None), 1), ENTER)]),
        (True, [(State((None, ENTERS, None), 8), ENTER)]),  # others follow b2
    ],
)  # fmt: skip
def test_fair_cycles_leave_no_vehicle_out(fair: bool, steps: list[tuple[State, Event]]) -> None:
    assert is_fair(Protocol(PAPER), tuple(steps)) is fair


def test_a_turn_that_could_end_ends() -> None:
    rotating = Protocol(PAPER, priorities="rotating")
    undecided = State((WAITS, ENTERS, None))
    decided = undecided._replace(decided=True)
    assert not is_fair(rotating, ((decided, ENTER),))
    assert is_fair(rotating, ((decided, ENTER), (undecided, ENTER)))
    assert is_fair(rotating, ((decided, ENTER), (decided, TURN)))
    assert is_fair(Protocol(PAPER), ((decided, ENTER),))


def test_where_only_a_and_b_come_b_starves() -> None:
    """a2 goes again and again, one close behind the other, and b2 is always second."""
    first, second, third = starvation(Few(PAPER, "lanes"))
    assert (first, third) == (None, None)
    assert second is not None
    assert [str(event) for event in second.stem] == ["arrive a2", "arrive b2"]
    assert second.lane == 1
    assert sorted(str(event) for event in second.cycle) == [
        "arrive a2", "commit a2", "enter a2", "leave a2",
    ]  # fmt: skip
