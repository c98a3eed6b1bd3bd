"""Arrivals against their distributions, and the arrival table.

Statistical tests run on fixed seeds, so they never fail by chance; `ALPHA` is the chance with
which a correct model would fail one of them on a fresh seed.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from minisim.arrivals import Arrivals, Demand, Shares
from minisim.errors import InputError

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


def test_inflow_counts_vehicles_before_the_horizon() -> None:
    """Three vehicles in the first minute are 180 an hour, however many come later."""
    time, lane = np.array([0.0, 20.0, 59.9, 60.0, 61.0]), np.array([0, 0, 1, 1, 0])
    arrivals = Arrivals(time, lane, np.ones(5, int))
    assert arrivals.rates(3, 60.0) == pytest.approx((120.0, 60.0, 0.0))
    assert arrivals.rates(3, 3600.0) == pytest.approx((3.0, 2.0, 0.0))


def test_unbalanced_demand_keeps_the_total_and_gives_each_lane_its_share() -> None:
    """The paper's unbalanced demand: λ = share · D · N, shares 0.4, 0.3, 0.2, 0.1."""
    demand = Demand(density=350.0, split=(4, 3, 2, 1))
    assert demand.rates(4) == pytest.approx((560.0, 420.0, 280.0, 140.0))
    assert sum(demand.rates(4)) == pytest.approx(4 * 350.0)
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


def test_the_table_is_sorted_by_time_then_lane_and_read_only() -> None:
    table = Arrivals(
        time=np.array([2.0, 1.0, 2.0]), lane=np.array([1, 2, 0]), manoeuvre=np.array([1, 2, 3])
    )
    assert table.time.tolist() == [1.0, 2.0, 2.0]
    assert table.lane.tolist() == [2, 0, 1]
    assert table.manoeuvre.tolist() == [2, 3, 1]
    with pytest.raises(ValueError, match="read-only"):
        table.time[0] = 0.0


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (([1.0], [0, 1], [1]), "as many times as lanes"),
        (([-1.0], [0], [1]), "finite and not negative"),
        (([np.nan], [0], [1]), "finite and not negative"),
        (([np.inf], [0], [1]), "finite and not negative"),
        (([1e300], [0], [1]), "demand times must be at most 1e\\+07 s"),
        (([1.0], [0.5], [1]), "lane must be a one-dimensional column of int64"),
        (([1.0], [np.nan], [1]), "lane must be"),
        (([1.0], ["a"], [1]), "lane must be"),
        (([[1.0]], [0], [1]), "demand_time_s must be a one-dimensional"),
        (([1j], [0], [1]), "demand_time_s must be"),
        ((None, [0], [1]), "demand_time_s must be"),
    ],
)
def test_broken_columns_are_refused(columns: tuple[object, ...], message: str) -> None:
    time, lane, manoeuvre = columns
    with pytest.raises(InputError, match=message):
        Arrivals(time=time, lane=lane, manoeuvre=manoeuvre)  # type: ignore[arg-type]  # wrong on purpose


def test_check_names_what_the_geometry_does_not_have() -> None:
    def table(lane: int, manoeuvre: int) -> Arrivals:
        return Arrivals(np.array([0.0]), np.array([lane]), np.array([manoeuvre]))

    table(2, 2).check(3)
    for lane, manoeuvre, message in [
        (3, 1, r"lane d is not in the geometry \(lanes a … c\)"),
        (-1, 1, "lane -1"),
        (99, 1, "lane 99"),
        (0, 3, r"manoeuvre 3 does not exist with 3 arms \(1 … 2\)"),
        (0, 0, "manoeuvre 0"),
    ]:
        with pytest.raises(InputError, match=message):
            table(lane, manoeuvre).check(3)


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
    ],
)
def test_impossible_shares_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Demand(**{"density": 100.0, **options})  # type: ignore[arg-type]  # wrong on purpose


def test_demand_that_does_not_match_the_geometry_is_refused() -> None:
    with pytest.raises(InputError, match="split has 3 shares for 4 lanes"):
        Demand(density=100.0, split=(1, 2, 3)).rates(4)
    with pytest.raises(InputError, match="turns has 2 shares for 3 manoeuvres"):
        Demand(density=100.0, turns=(1, 2)).draw(4, 60.0, seed=1)
    with pytest.raises(InputError, match="gives a lane 4000 veh/h; at most 3600"):
        Demand(density=1000.0, split=(1, 0, 0, 0)).rates(4)
    with pytest.raises(InputError, match="leave no room for a min_headway of 4 s"):
        Demand(density=1000.0, model="shifted", min_headway=4.0).rates(4)
    with pytest.raises(InputError, match="duration"):
        Demand(density=100.0).draw(4, 0.0, seed=1)
