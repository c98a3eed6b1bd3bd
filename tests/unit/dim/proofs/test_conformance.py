"""Views that no run shows: the checked session says what is impossible, and when."""

from __future__ import annotations

import pytest

from dim import Dim
from dim.perception import ROUNDING
from dim.proofs.conformance import Checked, CheckedSession, ConformanceError
from dim.proofs.protocol import COMMITTED, LOOK, WAITING, Event, State
from minisim.control import Go, Hold, Observed, View
from scenarios import four_way
from tests.builders import seen


def session(dim: Dim | None = None) -> CheckedSession:
    return Checked(dim or Dim()).start(four_way().site())


def view(time: float, *vehicles: Observed) -> View:
    return View(time, vehicles)


def test_it_wraps_a_dim() -> None:
    dim = Dim(order="lanes", gate="harmonious", commit="paper")
    checked = session(dim)
    rules = checked.protocol
    assert (rules.order, rules.gate, rules.commit) == ("lanes", "harmonious", "paper")
    assert rules.matrix == dim.harmony(four_way().site())
    assert checked.plan == dim.start(four_way().site()).plan
    assert (checked.state, checked.steps) == (rules.start, 0)


def test_it_follows_a_vehicle_across() -> None:
    checked = session()
    assert list(checked.decide(view(0.0, seen(7, 1, 2, 8.5)))) == []  # not yet in the yellow zone
    assert (checked.state, checked.steps) == (checked.protocol.start, 1)
    assert Go(7) in list(checked.decide(view(1.0, seen(7, 1, 2, 8.0, 1.0))))
    front = checked.state.fronts[1]
    assert front is not None
    assert (front.manoeuvre, front.phase, front.goes) == (2, WAITING, True)
    assert checked.steps == 3  # arrive, look
    checked.decide(view(2.0, seen(7, 1, 2, 0.0, 5.0)))  # on the line it is not yet inside
    assert checked.state.fronts[1] == (2, COMMITTED, True)
    checked.decide(view(3.0, seen(7, 1, 2, 0.1, 0.0)))
    assert checked.state.fronts[1] == (2, WAITING, True)  # it can stop again
    checked.decide(view(4.0, seen(7, 1, 2, -1.0, 5.0)))
    assert checked.state == State((None,) * 4, 1 << 4)  # b2 inside
    checked.decide(view(5.0))
    assert checked.state == checked.protocol.start
    assert checked.steps == 12  # and commit, look, slow, look, commit, enter, look, leave, look


def test_the_yellow_zone_begins_where_a_host_may_round_it_to() -> None:
    for distance, there in [(8.0 + ROUNDING / 2, True), (8.0 + 2 * ROUNDING, False)]:
        checked = session()
        checked.decide(view(0.0, seen(7, 1, 2, distance, 1.0)))
        assert (checked.state.fronts[1] is not None) is there


def test_of_two_on_one_movement_the_last_one_leaves_it() -> None:
    checked = session(Dim(gate="harmonious"))
    one, two = seen(1, 0, 2, 8.0, 5.0), seen(2, 0, 2, 8.0, 5.0)
    checked.decide(view(0.0, one))
    checked.decide(view(1.0, seen(1, 0, 2, -1.0, 5.0), two))
    checked.decide(view(2.0, seen(1, 0, 2, -9.0, 5.0), seen(2, 0, 2, -0.5, 5.0)))
    checked.decide(view(3.0, seen(2, 0, 2, -6.0, 5.0)))
    assert checked.state.inside == 1 << 1
    checked.decide(view(4.0))
    assert checked.state.inside == 0


def test_a_vehicle_that_appears_inside_is_refused() -> None:
    with pytest.raises(ConformanceError, match=r"^at 3\.0 s vehicle 9 entered unseen$"):
        session().decide(view(3.0, seen(9, 1, 2, -2.0)))


def test_a_vehicle_that_went_without_the_right_of_way_is_refused() -> None:
    checked = session()
    a, b = seen(1, 0, 2, 6.0, 1.0), seen(2, 1, 2, 6.0, 1.0)  # a2 and b2 are in conflict
    checked.decide(view(0.0, a, b))
    with pytest.raises(ConformanceError, match=r"^at 1\.5 s: commit b2 is not possible in"):
        checked.decide(view(1.5, a, seen(2, 1, 2, -0.5, 5.0)))


def test_by_the_papers_rule_it_rolls_unseen_into_the_junction() -> None:
    checked = session(Dim(commit="paper"))
    checked.decide(view(0.0, seen(1, 0, 2, 6.0, 1.0)))
    checked.decide(view(1.0, seen(1, 0, 2, -0.5, 5.0)))
    assert checked.state == State((None,) * 4, 1 << 1)
    assert checked.steps == 6  # arrive, look, roll, commit, enter, look


def test_by_the_papers_rule_a_committed_vehicle_stays_committed() -> None:
    checked = session(Dim(commit="paper"))
    checked.decide(view(0.0, seen(1, 0, 2, 6.0, 1.0)))
    checked.decide(view(1.0, seen(1, 0, 2, 0.9, 1.0)))  # past half of the green zone of 2 m
    with pytest.raises(ConformanceError, match=r"^at 2\.0 s: slow a2 is not possible"):
        checked.decide(view(2.0, seen(1, 0, 2, 1.5, 1.0)))


def test_no_event_but_a_look_is_a_look() -> None:
    checked = session()
    checked.decide(view(0.0, seen(1, 0, 2, 6.0, 1.0)))
    with pytest.raises(ConformanceError, match="look is not possible"):
        checked._take(view(1.0), LOOK)
    with pytest.raises(ConformanceError, match=r"at 1\.0 s: enter c1 is not possible"):
        checked._take(view(1.0), Event("enter", 2, 1))


def test_a_front_that_the_model_has_lost_is_refused() -> None:
    checked = session()
    checked.decide(view(0.0, seen(1, 0, 2, 6.0, 1.0)))
    checked.state = checked.protocol.start
    with pytest.raises(ConformanceError, match=r"^at 1\.0 s vehicle 1 arrived unseen$"):
        checked.decide(view(1.0, seen(1, 0, 2, 5.0, 1.0)))
    checked.state = checked.protocol.start
    with pytest.raises(ConformanceError, match=r"^at 1\.0 s a vehicle of lane 0 left unseen$"):
        checked.decide(view(1.0, seen(1, 0, 2, -1.0, 1.0)))


@pytest.mark.parametrize(("command", "vehicle"), [(Go, 2), (Hold, 1)])
def test_a_wrong_command_is_refused(
    command: type[Go | Hold], vehicle: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """a2 goes and b2 waits; anything else is another protocol."""
    checked = session()
    both = (seen(1, 0, 2, 6.0, 1.0), seen(2, 1, 2, 6.0, 1.0))
    assert list(checked.decide(view(0.0, *both)))
    monkeypatch.setattr(checked._session, "decide", lambda view: [command(vehicle)])
    lane = vehicle - 1
    message = rf"^at 1\.0 s vehicle {vehicle} of lane {lane} goes or waits where the protocol says"
    with pytest.raises(ConformanceError, match=message):
        checked.decide(view(1.0, *both))
