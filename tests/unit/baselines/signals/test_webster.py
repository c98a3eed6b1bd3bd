"""Webster's formulae against the values of the paper and limits of the theory."""

from __future__ import annotations

import math
from typing import Any

import pytest

from baselines.signals.webster import MIN_GREEN, optimal_cycle, timing_of, webster, webster_delay
from minisim.errors import InputError

#: Density: cycle, green, degree of saturation and long-run delay, worked out by hand with
#: L = 8 s and s = 1500 veh/h. The paper's greens are 5, 7, 10.75, 19.25 (printed as 19.75, but
#: (85 − 8)/4 = 19.25, as in the authors' network file) and 61.75 s.
PAPER = {
    150: (28.333, 5.083, 0.557, 15.99),
    200: (36.429, 7.107, 0.683, 22.13),
    250: (51.000, 10.75, 0.791, 33.60),
    300: (85.000, 19.25, 0.883, 61.67),
    350: (255.00, 61.75, 0.964, 209.3),
}


@pytest.mark.parametrize("density", PAPER)
def test_balanced_demand_on_four_arms_gives_the_papers_timing(density: int) -> None:
    cycle, green, saturation, delay = PAPER[density]
    timing = webster([density] * 4)
    assert timing.cycle == pytest.approx(cycle, abs=5e-4)
    assert timing.greens == pytest.approx((green,) * 4, abs=5e-4)
    assert timing.flow_ratio == pytest.approx(4 * density / 1500)
    assert timing.saturation == pytest.approx((saturation,) * 4, abs=5e-4)
    assert not timing.capped
    assert webster_delay(density, timing.greens[0], timing.cycle) == pytest.approx(delay, rel=5e-4)


def test_an_optimum_shorter_than_the_longest_cycle_is_not_cut() -> None:
    assert webster([0.96 * 1500 / 4] * 4).capped
    assert not webster([0.96 * 1500 / 4] * 4, max_cycle=1000.0).capped


def test_unbalanced_demand_shares_the_green_in_proportion() -> None:
    timing = webster([320, 240, 160, 80])
    assert timing.cycle == pytest.approx(17.0 / (1.0 - 800 / 1500))
    # x is the same on every lane: that is what proportional greens are for.
    assert timing.saturation == pytest.approx((timing.saturation[0],) * 4)
    assert timing.greens[0] == pytest.approx(4 * timing.greens[3])


def test_equal_greens_over_saturate_the_major_arm() -> None:
    for density, saturation in {200: 1.09, 250: 1.27, 300: 1.41, 350: 1.54}.items():
        timing = webster([density * share for share in (1.6, 1.2, 0.8, 0.4)], equal_greens=True)
        assert len(set(timing.greens)) == 1
        assert timing.saturation[0] == pytest.approx(saturation, abs=0.006)


def test_without_demand_webster_shares_its_shortest_cycle_equally() -> None:
    timing = webster([0, 0, 0, 0])
    assert timing.greens == pytest.approx(((1.5 * 8 + 5 - 8) / 4,) * 4)
    assert timing.saturation == (0.0,) * 4
    assert webster([0, 0, 0, 0], min_green=6).greens == (6,) * 4


def test_an_empty_lane_lengthens_the_cycle_by_its_least_green() -> None:
    timing = webster([600, 600, 600 - 1e-9, 0], saturation_flow=3000)
    optimum = optimal_cycle(0.6, 8.0)
    assert timing.greens[:3] == pytest.approx(((optimum - 8.0) / 3,) * 3)
    assert timing.greens[3] == MIN_GREEN
    assert timing.cycle == pytest.approx(optimum + MIN_GREEN)


def test_in_a_capped_cycle_the_others_make_room_for_the_least_green() -> None:
    timing = webster([2000, 1000, 10, 0])
    assert timing.capped
    assert timing.cycle == pytest.approx(180.0)
    assert timing.greens[2:] == (MIN_GREEN, MIN_GREEN)
    assert timing.greens[:2] == pytest.approx((168.0 * 2 / 3, 168.0 / 3))


def test_given_greens_are_described_not_changed() -> None:
    timing = timing_of([10, 30], 44, [300, 600], 1500)
    assert timing.greens == (10, 30)
    assert timing.flow_ratio == pytest.approx(0.6)
    assert timing.saturation == pytest.approx((300 * 44 / 15000, 600 * 44 / 45000))


def test_delay_without_traffic_is_the_mean_wait_for_a_green() -> None:
    # A lone vehicle comes at a uniform time: it meets red with probability r/C, then waits r/2.
    green, cycle, red = 20.0, 60.0, 40.0
    assert webster_delay(0, green, cycle) == pytest.approx(red * red / (2 * cycle))
    assert webster_delay(1e-9, green, cycle) == pytest.approx(red * red / (2 * cycle), rel=1e-3)
    # Nor is it bounded at saturation.
    assert webster_delay(500, 20, 60) == math.inf
    assert webster_delay(800, 20, 60) == math.inf
    assert webster_delay(499.9, 20, 60) > 1000


@pytest.mark.parametrize(
    ("rates", "options", "message"),
    [
        ([], {}, "at least one lane"),
        ([-1, 2, 3], {}, "rate"),
        ("350", {}, "sequence of numbers"),
        ([350, math.nan, 350], {}, "rates"),
        ([350] * 4, {"saturation_flow": 0}, "saturation_flow"),
        ([350] * 4, {"lost_time_per_phase": -1}, "lost_time"),
        ([350] * 4, {"min_green": 0}, "min_green"),
        ([350] * 4, {"max_cycle": 15}, "max_cycle .* at least 16"),
    ],
)
def test_bad_input_is_one_clear_error(rates: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        webster(rates, **options)


@pytest.mark.parametrize(
    "values", [(-1, 10, 60, 1500), (100, 0, 60, 1500), (100, 61, 60, 1500), (100, 10, 60, 0)]
)
def test_delay_of_an_impossible_signal_is_an_error(values: tuple[float, ...]) -> None:
    with pytest.raises(InputError):
        webster_delay(*values)
