"""Where a vehicle inside no longer bars a movement, compared with the bodies."""

from __future__ import annotations

import math

import pytest

from dim import Dim, HarmonyMatrix
from dim.passing import Passing
from minisim.junction.coordination import region
from scenarios import Scenario, five_way, four_way, three_way
from tests.builders import car

JUNCTIONS = [three_way(), four_way(), five_way()]


def bars(
    scenario: Scenario, movement: str, past: float, matrix: HarmonyMatrix | None = None
) -> set[str]:
    site = scenario.site()
    matrix = matrix or Dim().harmony(site)
    barred = Passing(matrix, site).bars(car(1, movement, -past))
    return {str(m) for k, m in enumerate(matrix.movements) if barred >> k & 1}


def foes(matrix: HarmonyMatrix, movement: str) -> set[str]:
    return {
        str(m) for m in matrix.movements
        if str(m)[0] != movement[0] and not matrix.harmony(m, movement)
    }  # fmt: skip


@pytest.mark.parametrize("scenario", JUNCTIONS, ids=lambda it: it.name)
def test_at_the_entry_it_bars_all_foes_and_further_on_ever_fewer(scenario: Scenario) -> None:
    matrix = Dim().harmony(scenario.site())
    for movement in map(str, matrix.movements):
        before = foes(matrix, movement)
        assert bars(scenario, movement, 0.01) == before
        for past in range(2, 30, 4):
            after = bars(scenario, movement, past)
            assert after <= before
            before = after


def test_one_that_it_no_longer_bars_can_go_all_the_way_without_coming_close() -> None:
    """Wherever both are from then on; and most are barred for less than the whole crossing."""
    site = four_way().site()
    matrix = Dim().harmony(site)
    passing, freed = Passing(matrix, site), 0
    for way, movement in enumerate(matrix.movements):
        for quarter in range(80):
            past = quarter / 4 + 0.01
            barred = passing.bars(car(1, str(movement), -past))
            for foe, other in enumerate(matrix.movements):
                if str(other) not in foes(matrix, str(movement)) or barred >> foe & 1:
                    continue
                freed += 1
                shared = region(site.intersection, site.vehicle, foe, way)
                assert shared is None or shared.room(0.0, past) == math.inf
    assert freed > 500


def test_two_that_share_an_exit_lane_bar_each_other_until_they_have_left() -> None:
    assert "b1" in foes(Dim().harmony(four_way().site()), "d3")
    assert "a2" in bars(four_way(), "b1", 100.0) or "c2" in bars(four_way(), "b1", 100.0)


def test_what_only_the_matrix_has_in_conflict_bars_until_it_has_left() -> None:
    values = HarmonyMatrix.paper(4).values.copy()
    values[:] = False
    assert len(bars(four_way(), "a1", 100.0, HarmonyMatrix(4, values))) >= 5
