"""Demand: arrivals against their distributions, shares, and profiles by time of day.

Statistical tests run on fixed seeds, so they never fail by chance; `ALPHA` is the chance with
which a correct model would fail one of them on a fresh seed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from minisim.arrivals import Arrivals
from minisim.demand import MODELS, Demand, DemandProfile, Period
from minisim.errors import InputError
from minisim.shares import Shares

ALPHA = 1e-3
DAY = 86_400.0
DENSITY = 350.0
RATE = DENSITY / 3600.0


def per_second(arrivals: Arrivals, lane: int, duration: float) -> np.ndarray:
    """Vehicles on the lane in each second."""
    seconds = np.floor(arrivals.time[arrivals.lane == lane]).astype(int)
    return np.bincount(seconds, minlength=int(duration))


def chi_square_poisson(counts: np.ndarray, rate: float, classes: int = 4) -> float:
    """p-value of Pearson's test that the counts are Poisson; the last class holds the tail.

    The 4 classes 0, 1, 2 and more have 7 or more expected vehicles in a day at 350 veh/h.
    """
    observed = np.bincount(np.minimum(counts, classes - 1), minlength=classes)
    probability = stats.poisson.pmf(np.arange(classes - 1), rate)
    expected = np.append(probability, 1.0 - probability.sum()) * len(counts)
    return float(stats.chisquare(observed, expected).pvalue)


@pytest.mark.parametrize(
    ("density", "classes", "seed"), [(350.0, 4, 1), (350.0, 4, 2), (350.0, 4, 3), (3600.0, 7, 8)]
)
def test_poisson_counts_per_second_pass_chi_square(density: float, classes: int, seed: int) -> None:
    arrivals = Demand(density=density).draw(4, DAY, seed)
    for lane in range(4):
        counts = per_second(arrivals, lane, DAY)
        assert chi_square_poisson(counts, density / 3600.0, classes) > ALPHA / 4


def test_the_chi_square_test_can_fail() -> None:
    """Its power: at least 1.5 s between vehicles leaves seconds with two of them empty."""
    shifted = Demand(density=DENSITY, model="shifted").draw(3, DAY, seed=1)
    assert chi_square_poisson(per_second(shifted, 0, DAY), RATE) < 1e-6


def test_poisson_arrivals_fall_on_whole_seconds_before_the_end() -> None:
    """The paper draws a number of vehicles for each second."""
    arrivals = Demand(density=3000.0).draw(3, 10.5, seed=1)
    assert (arrivals.time == np.floor(arrivals.time)).all()
    assert arrivals.time.max() <= 10.0


@pytest.mark.parametrize(
    ("model", "shift"), [("exponential", 0.0), ("shifted", 1.5), ("shifted", 4.0)]
)
def test_headways_pass_a_kolmogorov_smirnov_test(model: str, shift: float) -> None:
    demand = Demand(density=DENSITY, model=model, min_headway=shift or 1.5)
    arrivals = demand.draw(4, DAY, seed=5)
    for lane in range(4):
        headways = np.diff(arrivals.time[arrivals.lane == lane], prepend=0.0)
        assert headways.min() >= shift
        law = stats.expon(loc=shift, scale=1.0 / RATE - shift)
        assert stats.kstest(headways, law.cdf).pvalue > ALPHA / 4


@pytest.mark.parametrize("model", ["poisson", "exponential", "shifted"])
def test_every_model_has_the_mean_that_was_asked_for(model: str) -> None:
    """Within 4 σ of a Poisson count (the shifted model varies less)."""
    arrivals = Demand(density=DENSITY, model=model).draw(4, DAY, seed=9)
    expected = RATE * DAY
    counts = np.bincount(arrivals.lane, minlength=4)
    assert np.abs(counts - expected).max() < 4.0 * np.sqrt(expected)
    assert arrivals.rates(4, DAY) == pytest.approx(counts / 24.0)


@pytest.mark.parametrize("model", ["poisson", "exponential"])
def test_counts_have_the_variance_of_poisson_and_lanes_are_independent(model: str) -> None:
    """Counts of 10 s on 4 lanes over 10 days: variance = mean, no correlation."""
    arrivals = Demand(density=DENSITY, model=model).draw(4, 10 * DAY, seed=2)
    size = round(DAY)
    counts = np.zeros((4, size))
    np.add.at(counts, (arrivals.lane, (arrivals.time / 10.0).astype(int)), 1.0)
    # Of the index of dispersion D of n Poisson counts, (n − 1) D is chi-square with n − 1 degrees.
    dispersion = counts.var(axis=1, ddof=1) / counts.mean(axis=1)
    assert (np.abs(dispersion - 1.0) < 4.0 * np.sqrt(2.0 / size)).all()
    between = np.corrcoef(counts) - np.eye(4)
    within = [np.corrcoef(lane[:-1], lane[1:])[0, 1] for lane in counts]
    assert max(np.abs(between).max(), np.abs(within).max()) < 4.0 / np.sqrt(size)


@pytest.mark.parametrize("model", ["poisson", "exponential"])
def test_manoeuvres_do_not_depend_on_those_before_nor_on_other_lanes(model: str) -> None:
    arrivals = Demand(density=DENSITY, model=model).draw(4, 10 * DAY, seed=6)
    lanes = [arrivals.manoeuvre[arrivals.lane == lane] for lane in range(4)]
    short = min(map(len, lanes))
    for one, other in ((lanes[0][:-1], lanes[0][1:]), (lanes[1][:short], lanes[2][:short])):
        table = np.zeros((3, 3))
        np.add.at(table, (one - 1, other - 1), 1)
        assert stats.chi2_contingency(table).pvalue > ALPHA


def test_unbalanced_demand_keeps_the_total_and_gives_each_lane_its_share() -> None:
    """The paper's unbalanced demand: λ = share · D · N, shares 0.4, 0.3, 0.2, 0.1."""
    demand = Demand(density=350.0, split=(4, 3, 2, 1))
    assert demand.inflow(4).rates[0] == pytest.approx((560.0, 420.0, 280.0, 140.0))
    assert sum(demand.inflow(4).rates[0]) == pytest.approx(4 * 350.0)
    counts = np.bincount(demand.draw(4, DAY, seed=3).lane, minlength=4)
    expected = np.array([560.0, 420.0, 280.0, 140.0]) * 24.0
    assert (np.abs(counts - expected) < 4.0 * np.sqrt(expected)).all()


def test_a_lane_without_share_stays_empty() -> None:
    arrivals = Demand(density=350.0, split=(1, 0, 1)).draw(3, 3600.0, seed=1)
    assert set(arrivals.lane.tolist()) == {0, 2}
    assert len(Demand(density=0.0).draw(3, 3600.0, seed=1)) == 0


@pytest.mark.parametrize("shares", [(4.0, 3.0, 2.0, 1.0), [4, 3, 2, 1], "4:3:2:1", "4: 3:2 :1"])
def test_shares_are_numbers_or_a_text(shares: Shares) -> None:
    demand = Demand(density=350.0, split=shares, turns=shares)
    assert demand == Demand(density=350.0, split=(4, 3, 2, 1), turns=(4, 3, 2, 1))
    assert hash(demand) == hash(Demand(density=350.0, split=(4, 3, 2, 1), turns=(4, 3, 2, 1)))
    assert Demand(density=1.0, split="balanced", turns="uniform") == Demand(density=1.0)


@pytest.mark.parametrize("turns", [None, (1, 2, 1), (0, 1, 0)])
def test_manoeuvres_follow_their_shares_on_every_lane(turns: tuple[float, ...] | None) -> None:
    arrivals = Demand(density=350.0, turns=turns).draw(4, DAY, seed=4)
    shares = np.array(turns or (1, 1, 1)) / sum(turns or (1, 1, 1))
    table = np.zeros((4, 3))
    np.add.at(table, (arrivals.lane, arrivals.manoeuvre - 1), 1)
    assert (table[:, shares == 0] == 0).all()
    if (shares > 0).sum() > 1:
        expected = table.sum(axis=1, keepdims=True) * shares
        assert stats.chisquare(table, expected, axis=1).pvalue.min() > ALPHA / 4
        assert stats.chi2_contingency(table).pvalue > ALPHA


def test_manoeuvres_are_drawn_from_their_own_stream() -> None:
    """Other turn shares leave the arrival times as they are (common random numbers)."""
    uniform = Demand(density=350.0).draw(4, 3600.0, seed=1)
    turning = Demand(density=350.0, turns=(5, 1, 5)).draw(4, 3600.0, seed=1)
    np.testing.assert_array_equal(uniform.time, turning.time)
    assert (uniform.manoeuvre != turning.manoeuvre).any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"split": ()}, "split must be shares"),
        ({"split": (0, 0)}, "split must be shares"),
        ({"split": (1, -1)}, "split must be shares"),
        ({"split": (1e308, 1e308)}, "split must be shares"),
        ({"turns": "ab"}, "turns must be uniform or like 4:3:2:1, got 'ab'"),
        ({"split": "uniform"}, "split must be balanced or like"),
        ({"split": 4}, "split must be a sequence"),
        ({"turns": "1:2/2:x"}, r"turns\[1\] must be uniform or like"),
        ({"turns": [(1, 2), (0, 0)]}, r"turns\[1\] must be shares ≥ 0"),
    ],
)
def test_impossible_shares_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Demand(**{"density": 100.0, **options})  # type: ignore[arg-type]  # wrong on purpose


def test_demand_that_does_not_match_the_geometry_is_refused() -> None:
    with pytest.raises(InputError, match="split has 3 shares for 4 lanes"):
        Demand(density=100.0, split=(1, 2, 3)).inflow(4)
    with pytest.raises(InputError, match="turns has 2 shares for 3 manoeuvres"):
        Demand(density=100.0, turns=(1, 2)).draw(4, 60.0, seed=1)
    with pytest.raises(InputError, match="turns has 2 rows for 4 lanes"):
        Demand(density=100.0, turns="1:2:1/1:2:1").draw(4, 60.0, seed=1)
    with pytest.raises(InputError, match="turns on lane b has 2 shares for 3 manoeuvres"):
        Demand(density=100.0, turns="1:2:1/1:2/uniform/1:2:1").draw(4, 60.0, seed=1)
    with pytest.raises(InputError, match="gives a lane 4000 veh/h; at most 3600"):
        Demand(density=1000.0, split=(1, 0, 0, 0)).inflow(4)
    with pytest.raises(InputError, match="leave no room for a min_headway of 4 s"):
        Demand(density=1000.0, model="shifted", min_headway=4.0).inflow(4)
    with pytest.raises(InputError, match="duration"):
        Demand(density=100.0).draw(4, 0.0, seed=1)


@pytest.mark.parametrize(
    "turns", ["1:0:0/uniform/0:1:1/0:0:5", [(1, 0, 0), None, [0, 1, 1], "0:0:5"]]
)
def test_turns_may_differ_by_lane(turns: object) -> None:
    demand = Demand(density=350.0, turns=turns)
    assert demand.turns == ((1, 0, 0), None, (0, 1, 1), (0, 0, 5))
    assert demand.words == ("balanced", "1:0:0/uniform/0:1:1/0:0:5")
    table = np.zeros((4, 3))
    arrivals = demand.draw(4, DAY, seed=4)
    np.add.at(table, (arrivals.lane, arrivals.manoeuvre - 1), 1)
    shares = np.array([[1, 0, 0], [1 / 3] * 3, [0, 0.5, 0.5], [0, 0, 1]])
    expected = table.sum(axis=1, keepdims=True) * shares
    np.testing.assert_array_less(np.abs(table - expected), 4.0 * np.sqrt(expected) + 1e-9)


MORNING = Period(start="07:00", end="07:15", rates=(400, 0, 200, 100), turns="1:0:0")
NOON = Period(start="07:15", end="09:15", rates=(100, 50, 0, 300), turns="1:1:0/0:1:1/1:0:1/0:1:0")
PROFILE = DemandProfile(name="Market", periods=(MORNING, NOON))


@pytest.mark.parametrize("model", MODELS)
def test_each_period_has_its_rates_and_turns(model: str) -> None:
    """Over 200 runs, counts by period, lane and manoeuvre are within 4.5 σ of their means."""
    counts = np.zeros((2, 4, 3))
    demand = replace(PROFILE, model=model)
    for seed in range(200):
        it = demand.draw(4, demand.duration, seed)
        np.add.at(counts, ((it.time >= 900.0).astype(int), it.lane, it.manoeuvre - 1), 1)
    rates = np.array([MORNING.rates, NOON.rates]) * [[0.25], [2.0]] * 200
    turns = [[[1, 0, 0]] * 4, [[0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0, 1, 0]]]
    expected = rates[:, :, None] * np.array(turns)
    np.testing.assert_array_less(np.abs(counts - expected), 4.5 * np.sqrt(expected) + 1e-9)


def test_the_end_of_a_period_does_not_hold_back_a_lane() -> None:
    """Headways go on over it: a lane of 20 veh/h, then 900, has its first vehicle soon after."""
    slow = Period(start=0, end=60, rates=(20, 20, 20))
    fast = Period(start=60, end=3660, rates=(900, 900, 900))
    demand = DemandProfile(periods=(slow, fast), model="exponential")
    first = [it.time[it.time > 60].min() for it in (demand.draw(3, 3600, k) for k in range(200))]
    assert stats.kstest(np.array(first) - 60, stats.expon(scale=4.0 / 3.0).cdf).pvalue > ALPHA


def test_a_run_may_begin_within_a_period() -> None:
    later = replace(PROFILE, start="07:10")
    assert later.duration == 125 * 60
    assert later.inflow(4).starts == (0.0, 300.0)
    assert PROFILE.inflow(4).mean(0, 1800) == pytest.approx((250, 25, 100, 200))
    assert replace(PROFILE, start=NOON.start).inflow(4).rates == (NOON.rates,)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"periods": ()}, "at least one period"),
        ({"periods": (NOON, MORNING)}, "the period 07:15-09:15 overlaps the next, 07:00-07:15"),
        (
            {"periods": (MORNING, replace(NOON, start=26_500))},
            "the period 07:00-07:15 leaves a hole before the next, 07:21:40-09:15",
        ),
        ({"periods": (MORNING, replace(NOON, rates=(1, 2, 3)))}, "4 rates, the next 3"),
        ({"start": "06:00"}, "start is 06:00, but the demand is from 07:00 to 09:15"),
        ({"start": "09:15"}, "start is 09:15, but"),
        ({"start": 25_200.5}, "start must be whole seconds"),
    ],
)
def test_periods_that_do_not_fit_together_are_refused(
    changes: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        replace(PROFILE, **changes)  # type: ignore[arg-type]  # wrong on purpose


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"end": "07:00"}, "the period 07:00-07:00 must end after its start"),
        ({"end": "7 o'clock"}, "end must be a time of day such as 07:00 or seconds"),
        ({"rates": (1, -2, 3, 4)}, r"rates \[veh/h\]\[1\] must be at least 0"),
        ({"rates": (1, 2)}, "needs a rate per lane, got 2"),
        ({"rates": (9999, 2, 3)}, "must be at least 0 and at most 3600"),
    ],
)
def test_impossible_periods_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        replace(MORNING, **changes)  # type: ignore[arg-type]  # wrong on purpose


def test_a_profile_must_fit_the_junction_and_the_run() -> None:
    with pytest.raises(InputError, match="the demand 'Market' has 4 lanes, the junction has 3"):
        PROFILE.check(3, 60.0)
    with pytest.raises(InputError, match="ends 8100 s after its start, before the run of"):
        PROFILE.draw(4, 8101.0, seed=1)
    crowded = replace(PROFILE, model="shifted", min_headway=10)
    with pytest.raises(InputError, match="400 veh/h leave no room for a min_headway of 10 s"):
        crowded.check(4, 60.0)


def test_forbidden_manoeuvres_are_not_drawn_and_no_share_of_them_is_dropped() -> None:
    allowed = np.ones((4, 3), bool)
    allowed[0, 0] = False  # as in a no-left-turn
    allowed[3] = False  # an exit only
    quiet = replace(NOON, rates=(100, 50, 20, 0), turns=None)
    demand = DemandProfile(name="Market", periods=(quiet,))
    demand.check(4, 60.0, allowed)
    drawn = demand.draw(4, 7200.0, 1, allowed)
    assert not ((drawn.lane == 0) & (drawn.manoeuvre == 1)).any()
    assert (drawn.manoeuvre[drawn.lane == 1] == 1).any()
    by_lane = replace(demand, periods=(replace(quiet, turns="1:1:1/1:1:1/1:1:1/1:1:1"),))
    message = "turns of 07:15-09:15 send vehicles of lane a where none may go"
    with pytest.raises(InputError, match=message):
        by_lane.check(4, 60.0, allowed)
    with pytest.raises(InputError, match="turns of 07:15-09:15 leave lane a none of"):
        replace(demand, periods=(replace(quiet, turns="1:0:0"),)).check(4, 60.0, allowed)
    with pytest.raises(InputError, match="'Market' has vehicles from lane d, but none may come"):
        replace(demand, periods=(NOON,)).check(4, 60.0, allowed)
