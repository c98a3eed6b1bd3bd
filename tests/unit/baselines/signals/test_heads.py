"""Signal heads: what may still go after a green, and when a head may turn green."""

from __future__ import annotations

from functools import partial

import pytest

from baselines.signals.heads import Colour, Heads, committed, stopping_sight
from minisim.control import COMMIT_MARGIN, Observed, View, can_stop
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


NEEDED = 10.0**2 / 9.0 + COMMIT_MARGIN  # to stop from 10 m/s


@pytest.mark.parametrize(
    ("lane", "those"),
    [
        ([(NEEDED - 0.01, 10), (25, 10), (40, 10)], [0]),
        ([(NEEDED + 0.01, 10)], []),
        # The first two could stop; the third comes too fast to stop before the junction.
        ([(8, 2), (16, 8), (21, 14)], [0, 1, 2]),
        ([(0.1, 0), (7.6, 0)], []),  # standing at the line
        ([(-3, 10), (5, 10), (30, 10)], [1]),  # inside the junction it needs nothing
    ],
)
def test_what_cannot_stop_is_committed(lane: list[tuple[float, float]], those: list[int]) -> None:
    vehicles = [observed(k, 0, 1, *place) for k, place in enumerate(lane)]
    assert [v.id for v in committed(vehicles, lambda v: can_stop(v, BRAKING))] == those


def test_the_end_of_green_closes_the_lane_and_lets_the_committed_go() -> None:
    heads = heads_showing(GREEN, RED, RED, RED)
    near, far, other = seen(1, 0, 1, 3.0), seen(2, 0, 2, 40.0), seen(3, 1, 1, 1.0)
    assert show(heads, [near, far, other], AMBER, RED, RED, RED) == ["Close 0", "Go 1"]
    assert show(heads, [near, far, other], RED, RED, RED, RED) == []
    assert heads.colours == [RED] * 4


@pytest.mark.parametrize(
    ("arms", "vehicle", "lane", "waits"),
    [
        (4, seen(1, 0, 2, -4.0), 1, True),  # a2, straight on, crosses the way of b2
        # c1 turns left into d; a3 and b2 leave by d as well.
        (4, seen(1, 2, 1, -4.0), 0, True),
        (4, seen(1, 2, 1, -4.0), 1, True),
        # Held: braking on the last metre, it could not stop half a metre earlier.
        (4, seen(1, 0, 2, 0.4, speed=1.6), 1, False),
        (3, seen(1, 0, 1, -2.0), 1, False),  # a1 turns left into b: in harmony with all of b
    ],
)
def test_a_head_waits_for_conflicting(arms: int, vehicle: Observed, lane: int, waits: bool) -> None:
    heads = Heads(small_scenario(arms).site(0))
    wanted = [GREEN if i == lane else RED for i in range(arms)]
    assert show(heads, [vehicle], *wanted) == ([] if waits else [f"Open {lane}"])
    assert (heads.colours == [RED] * arms) is waits
    assert show(heads, [], *wanted) == ([f"Open {lane}"] if waits else [])


def test_a_head_waits_for_a_committed_vehicle_that_is_not_there_yet() -> None:
    heads = heads_showing(GREEN, RED, RED, RED)
    coming = seen(7, 0, 2, 9.0)
    show(heads, [coming], AMBER, RED, RED, RED)
    # It has slowed down behind another vehicle and could stop by now, but keeps its right of way.
    slower = seen(7, 0, 2, 4.0, speed=1.0)
    assert show(heads, [slower], RED, GREEN, RED, RED) == []
    assert show(heads, [seen(7, 0, 2, -1.0)], RED, GREEN, RED, RED) == []
    assert show(heads, [], RED, GREEN, RED, RED) == ["Open 1"]


def test_conflicting_lanes_are_never_green_together_whatever_is_wanted() -> None:
    heads = Heads(small_scenario(4).site(0))
    for expected in (["Open 0"], []):  # at once, and once
        assert show(heads, [], GREEN, GREEN, GREEN, GREEN) == expected
    assert heads.colours == [GREEN, RED, RED, RED]
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
