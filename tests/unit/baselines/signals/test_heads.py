"""Signal heads: who is let go at the end of a green, and when a head may turn green."""

from __future__ import annotations

from functools import partial

from baselines.signals.heads import Colour, Heads, committed, stopping_sight
from minisim.control import COMMIT_MARGIN, Observed, View
from minisim.testing import small_scenario
from minisim.vehicle import VehicleType
from tests.builders import said
from tests.builders import seen as observed

RED, AMBER, GREEN = Colour.RED, Colour.AMBER, Colour.GREEN
seen = partial(observed, speed=10.0)

#: Comfortable braking of the vehicles of the small scenario [m/s²].
BRAKING = 4.5


def heads_showing(*colours: Colour) -> Heads:
    """Heads of the 4-arm junction that show these colours, with no vehicle around."""
    heads = Heads(small_scenario(4).site(0))
    heads.show(View(0.0, ()), colours)
    assert heads.colours == list(colours)
    return heads


def show(heads: Heads, vehicles: list[Observed], *wanted: Colour) -> list[str]:
    """The answer in words."""
    return said(heads.show(View(10.0, tuple(vehicles)), wanted))


# Committed: 10 m/s needs 10²/9 = 11.11 m to stop, plus the margin.


def test_only_vehicles_that_cannot_stop_are_committed() -> None:
    needed = 10.0**2 / 9.0 + COMMIT_MARGIN
    lane = [seen(1, 0, 1, needed - 0.01), seen(2, 0, 1, 25.0), seen(3, 0, 1, 40.0)]
    assert [v.id for v in committed(lane, BRAKING)] == [1]
    assert committed([seen(1, 0, 1, needed + 0.01)], BRAKING) == []


def test_every_vehicle_before_a_committed_vehicle_goes_too() -> None:
    # The first two could stop; the third comes too fast to stop before the junction.
    lane = [
        seen(1, 0, 1, 8.0, speed=2.0),
        seen(2, 0, 1, 16.0, speed=8.0),
        seen(3, 0, 1, 21.0, speed=14.0),
    ]
    assert [v.id for v in committed(lane, BRAKING)] == [1, 2, 3]


def test_a_vehicle_standing_at_the_line_is_not_committed() -> None:
    assert committed([seen(1, 0, 1, 0.1, speed=0.0), seen(2, 0, 1, 7.6, speed=0.0)], BRAKING) == []


def test_vehicles_inside_the_junction_need_nothing() -> None:
    lane = [seen(1, 0, 1, -3.0), seen(2, 0, 1, 5.0), seen(3, 0, 1, 30.0)]
    assert [v.id for v in committed(lane, BRAKING)] == [2]


# Heads.


def test_an_empty_junction_turns_green_at_once() -> None:
    heads = Heads(small_scenario(4).site(0))
    assert heads.colours == [RED] * 4
    assert show(heads, [], GREEN, RED, RED, RED) == ["Open 0"]
    assert show(heads, [], GREEN, RED, RED, RED) == []
    assert heads.colours == [GREEN, RED, RED, RED]


def test_the_end_of_green_closes_the_lane_and_lets_the_committed_go() -> None:
    heads = heads_showing(GREEN, RED, RED, RED)
    near, far, other = seen(1, 0, 1, 3.0), seen(2, 0, 2, 40.0), seen(3, 1, 1, 1.0)

    assert show(heads, [near, far, other], AMBER, RED, RED, RED) == ["Close 0", "Go 1"]
    assert show(heads, [near, far, other], RED, RED, RED, RED) == []
    assert heads.colours == [RED] * 4


def test_a_head_waits_for_a_conflicting_vehicle_in_the_junction() -> None:
    heads = Heads(small_scenario(4).site(0))
    # a2, straight on from the north, crosses the way of b2 from the east.
    crossing = seen(1, 0, 2, -4.0)

    assert show(heads, [crossing], RED, GREEN, RED, RED) == []
    assert heads.colours == [RED] * 4
    assert show(heads, [], RED, GREEN, RED, RED) == ["Open 1"]


def test_a_head_waits_for_a_vehicle_that_merges_into_the_same_exit() -> None:
    # c1 turns left into d; a3 and b2 leave by d as well.
    for lane in (0, 1):
        heads = Heads(small_scenario(4).site(0))
        wanted = [GREEN if i == lane else RED for i in range(4)]
        assert show(heads, [seen(1, 2, 1, -4.0)], *wanted) == []


def test_a_head_waits_for_a_committed_vehicle_that_is_not_there_yet() -> None:
    heads = heads_showing(GREEN, RED, RED, RED)
    coming = seen(7, 0, 2, 9.0)
    show(heads, [coming], AMBER, RED, RED, RED)

    # It has slowed down behind another vehicle and could stop by now, but keeps its right of way.
    slower = seen(7, 0, 2, 4.0, speed=1.0)
    assert show(heads, [slower], RED, GREEN, RED, RED) == []
    assert show(heads, [seen(7, 0, 2, -1.0)], RED, GREEN, RED, RED) == []
    assert show(heads, [], RED, GREEN, RED, RED) == ["Open 1"]


def test_a_head_does_not_wait_for_a_held_vehicle_however_near() -> None:
    heads = Heads(small_scenario(4).site(0))
    # Braking to its line on the last metre, it could not stop half a metre earlier.
    braking = seen(1, 0, 2, 0.4, speed=1.6)
    assert show(heads, [braking], RED, GREEN, RED, RED) == ["Open 1"]


def test_a_head_does_not_wait_for_harmonious_vehicles() -> None:
    # On three arms kept to the left, a1 (left, into b) meets c1 (into a) nowhere, but crosses
    # or meets movements of lane b: b2 leaves by a, b1 by c.
    site = small_scenario(3).site(0)
    left_of_a = site.conflicts[0].reshape(3, 2)
    assert not left_of_a[1].any()
    heads = Heads(site)
    assert show(heads, [seen(1, 0, 1, -2.0)], RED, GREEN, RED) == ["Open 1"]


def test_conflicting_lanes_are_never_green_together_whatever_is_wanted() -> None:
    heads = Heads(small_scenario(4).site(0))
    assert show(heads, [], GREEN, GREEN, GREEN, GREEN) == ["Open 0"]
    assert show(heads, [], RED, GREEN, GREEN, GREEN) == ["Close 0", "Open 1"]
    assert heads.colours == [RED, GREEN, RED, RED]


def test_without_any_amber_the_next_lane_waits_for_the_committed() -> None:
    heads = heads_showing(GREEN, RED, RED, RED)
    assert show(heads, [seen(1, 0, 2, 3.0)], RED, GREEN, RED, RED) == ["Close 0", "Go 1"]
    assert heads.colours == [RED] * 4
    assert show(heads, [], RED, GREEN, RED, RED) == ["Open 1"]


def test_sight_reaches_beyond_the_longest_way_to_stop() -> None:
    alike = small_scenario(4).site(0)
    assert stopping_sight(alike) >= 14.0**2 / 9.0 + 0.5
    mixed = small_scenario(4, vehicle=VehicleType(speed_deviation=0.1)).site(0)
    assert stopping_sight(mixed) >= 28.0**2 / 9.0 + 0.5
