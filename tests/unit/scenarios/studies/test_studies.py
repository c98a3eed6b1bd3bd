"""Studies, crossings, fairness, capacity and the comparison with the paper."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines import FixedTime
from dim import Dim, Mixed
from figures.gallery import GALLERY
from figures.tables import Table
from minisim.errors import InputError
from scenarios import four_way
from scenarios.controllers import RIVALS
from scenarios.recipe import Recipe
from scenarios.statistics import GROWTH_SCORE
from scenarios.studies.archive import Archive
from scenarios.studies.capacity import Capacity, Search, capacities, grows
from scenarios.studies.comparison import (
    causes,
    compare,
    discrepancies,
    labels,
    published,
    score,
)
from scenarios.studies.crossing import (
    METRICS,
    crossing,
    paired_differences,
    tried,
    with_total_delay,
)
from scenarios.studies.fairness import gini, lane_waits
from scenarios.studies.results import Effort, collect
from scenarios.studies.study import STUDIES, Case, study_named
from scenarios.sweep.cells import saturated
from scenarios.sweep.keys import key_of
from scenarios.sweep.rows import outcome_of
from tests.builders import capacity_of, synthetic_find, synthetic_row

# --- studies ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["text", "as-run"])
def test_the_paper_s_grid_is_700_hours(name: str) -> None:
    """4 controllers × 5 densities × 3 splits on 4 arms, DIM × 5 on 3 and 5 arms, 10 seeds."""
    cases = STUDIES[name].cases
    assert len(cases) == len(set(cases)) == 4 * 5 * 3 + 2 * 5
    published_cells = published()[["series", "arms", "split", "density"]].drop_duplicates()
    wanted = {tuple(row) for row in published_cells.itertuples(index=False)}
    assert {(c.series, c.arms, c.split, c.density) for c in cases} == wanted
    runs = STUDIES[name].runs(10)
    assert len({key_of(experiment) for _, experiment in runs}) == len(runs)
    assert len(runs) == 700 - 7 * sum(c.series in STUDIES[name].few for c in cases)


def test_priorities_by_inflow_where_the_text_has_them() -> None:
    """The highest is that "with the maximum incoming traffic": a and c, then b and d."""
    wanted = Case("paper", "dim", "dim:priorities=inflow", 4, "4:1:4:1", 200.0)
    assert wanted in STUDIES["text"].cases
    experiment = wanted.experiment(1)
    assert isinstance(experiment.controller, Dim)
    assert experiment.controller.ranks(experiment.scenario.site()) == (0, 2, 1, 3)


def test_the_as_run_study_runs_what_ran() -> None:
    """Discrepancies 10 to 14: balanced V2I-C, 5 s of green, north and east loaded."""
    cases = {(c.series, c.split, c.density, c.arms): c for c in STUDIES["as-run"].cases}
    v2ic = cases["v2ic", "4:3:2:1", 200.0, 4].experiment(1)
    assert set(v2ic.scenario.rates) == {200.0}
    signal = cases["fixed-time", "4:3:2:1", 300.0, 4].experiment(1)
    assert signal.controller.greens == 5.0  # type: ignore[attr-defined]
    loaded = cases["adaptive", "4:1:4:1", 250.0, 4].experiment(1)
    assert loaded.scenario.rates == pytest.approx((400.0, 400.0, 100.0, 100.0))
    dim = cases["dim", "4:1:4:1", 250.0, 4].experiment(1)
    assert dim.scenario.rates == pytest.approx((400.0, 100.0, 400.0, 100.0))
    assert {c.experiment(1).scenario.profile.name for c in cases.values()} == {
        "as_run", "as_run_signals",
    }  # fmt: skip


def test_all_controllers_of_a_study_share_their_arrivals() -> None:
    study = STUDIES["fair"]
    same = [c for c in study.cases if c.density == 200.0]
    assert [c.series for c in same] == list(RIVALS)
    runs = [c.experiment(3, 120.0) for c in same]
    for one, other in pairwise(runs):
        assert (one.scenario, one.seed) == (other.scenario, other.seed)
        assert key_of(one) != key_of(other)


def test_the_humans_study_tells_its_shares_apart() -> None:
    study = STUDIES["humans"]
    assert len(study.cases) == len(set(study.cases)) == 2 * (2 * 7 + 1)
    runs = study.runs(2)
    assert len({(e.name, e.scenario.density, e.seed) for _, e in runs}) == len(runs)
    shares = {c.humans: c.experiment(1).driven for c in study.cases if c.series == "dim"}
    assert shares[0.0] == Dim()
    assert shares[0.4] == Mixed(Dim(), 0.4)
    assert str(Case("fair", "dim", "dim", 4, "balanced", 150.0, 0.4)).startswith("dim, 40% humans,")


def test_unknown_study_names_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean 'fair'"):
        study_named("fare")


def test_results_say_what_is_missing() -> None:
    study = STUDIES["gate"]
    effort = Effort(seeds=2, horizon=120.0)

    def find(asked: Sequence[Recipe]) -> list[Mapping[str, Any] | None]:
        rows: list[Mapping[str, Any] | None] = [dict(row) for row in map(synthetic_row, asked)]
        for k, experiment in enumerate(asked):
            if experiment.label == "dim:gate=harmonious":
                rows[k] = None if experiment.seed == 1 else {**rows[k], "error": "broken"}  # type: ignore[dict-item]
        return rows

    results = collect(study, effort, find)
    assert {case.series for case in results.missing} == {"dim:gate=harmonious"}
    assert len(results.missing) == len(study.cases) // 2 == len(results.failed)
    assert len(results.good) == len(study.cases)
    nothing = collect(study, effort, lambda asked: [None] * len(asked))
    assert nothing.good.empty
    assert nothing.missing == study.cases


def test_quick_effort_and_bad_ones() -> None:
    quick = Effort.quick()
    assert {c.density for c in quick.cases(STUDIES["fair"])} == {150.0, 350.0}
    few = collect(STUDIES["as-run"], Effort(seeds=5, horizon=60.0), synthetic_find).good
    assert few.groupby("series")["seed"].nunique().to_dict() == {
        "dim": 5, "fixed-time": 5, "adaptive": 5, "v2ic": 3,
    }  # fmt: skip
    for wrong in ({"seeds": 1}, {"horizon": 0.0}, {"densities": ("a",)}):
        with pytest.raises(InputError):
            Effort(**wrong)  # type: ignore[arg-type]


def free_flow(seconds: float) -> dict[str, float | None]:
    """Columns of a run of an hour with this travel time on a free road."""
    return {
        "horizon_s": 3600.0, "warmup_s": 0.0, "travel_time_s": seconds + 10.0, "time_loss_s": 10.0,
        "complete_travel_time_s": seconds, "complete_time_loss_s": 30.0,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("run", "expected"),
    [
        ({}, True),
        ({"horizon_s": 240.0}, True),
        ({"horizon_s": 239.0}, False),  # four times 60 s
        ({"horizon_s": 150.0, "travel_time_s": None}, True),  # 30 s of what was driven
        ({"horizon_s": 119.0, "travel_time_s": None}, False),
    ],
)
def test_roads_that_fill_are_no_growing_queue(run: Mapping[str, Any], expected: bool) -> None:
    quiet = {f"lanes_{k}_{key}": 0 for k in "abc" for key in ("trips", "queue_growth")}
    row = {"arms": 3, "trips": 100, "queue_growth": 100.0, **quiet, **free_flow(60.0), **run}
    assert saturated(pd.DataFrame([row])) is expected


def test_saturated_sums_over_runs_and_lanes() -> None:
    """`GROWTH_SCORE` standard deviations √(5/12 · trips); two runs have √2 times that."""
    limit = GROWTH_SCORE * math.sqrt(5.0 / 12.0 * 120)
    quiet = {
        f"lanes_{k}_{key}": v for k in "abc" for key, v in (("trips", 40), ("queue_growth", 0))
    }
    one = {"arms": 3, "trips": 120, "queue_growth": 0.9 * limit, **quiet, **free_flow(60.0)}
    assert not saturated(pd.DataFrame([one]))
    assert saturated(pd.DataFrame([one, one]))
    lane = {**one, "queue_growth": 0.0, "lanes_c_queue_growth": 0.9 * limit}
    assert saturated(pd.DataFrame([lane])), "1/√3 of the junction's limit is a lane's"


# --- crossings -------------------------------------------------------------------------------


def test_crossing_of_straight_lines() -> None:
    """Means −10, 0.5·… cross where they must, whatever the spread; the interval by hand."""
    spread = {100.0: (-12.0, -8.0), 200.0: (8.0, 12.0)}
    found = crossing(spread)
    # Mean −10 → 10: zero at 150. Half width 12.706·s/√2 with s = √8: 25.41 at both ends.
    assert found.density == pytest.approx(150.0)
    assert (found.low, found.high) == (-math.inf, math.inf)
    narrow = crossing({100.0: (-10.1, -9.9), 200.0: (9.9, 10.1)})
    assert narrow.density == pytest.approx(150.0)
    half = 12.7062 * 0.1  # t(0.975, 1)·s/√2, s = 0.1·√2
    assert narrow.low == pytest.approx(100.0 + 100.0 * (10.0 - half) / 20.0, abs=1e-3)
    assert narrow.high == pytest.approx(100.0 + 100.0 * (10.0 + half) / 20.0, abs=1e-3)
    assert narrow.until == math.inf


@given(st.floats(101.0, 799.0), st.floats(0.01, 5.0), st.integers(2, 8))
def test_crossing_finds_the_root_of_a_line(root: float, slope: float, points: int) -> None:
    densities = np.linspace(100.0, 800.0, points)
    differences = {float(d): [slope * (d - root)] * 3 for d in densities}
    found = crossing(differences)
    assert found.density == pytest.approx(root, abs=1e-6)
    assert found.low == pytest.approx(found.density)
    assert found.high == pytest.approx(found.density)


def test_crossing_at_the_ends() -> None:
    always = crossing({100.0: (1.0, 1.1), 200.0: (2.0, 2.1)})
    assert always.density == -math.inf
    assert always.point == "all"
    assert crossing({100.0: (1.0, 1.0), 200.0: (-1.0, -1.0)}).point == "up to 150"
    never = crossing({100.0: (-1.0, -1.1), 200.0: (0.0, 0.0)})
    assert never.density == math.inf
    assert str(never) == "never"
    again = crossing({0.0: (-1.0, -1.0), 100.0: (1.0, 1.0), 200.0: (1.0, 1.0), 400.0: (-1.0, -1.0)})
    assert (again.density, again.until) == (50.0, 300.0)
    assert str(again) == "50 to 300 (50 to 50)"
    assert tried([again, always]) == (0.0, 400.0)
    with pytest.raises(InputError, match="no crossing"):
        tried([])


def test_an_open_interval_says_which_end_it_has() -> None:
    """Means are positive throughout, 1 ± 12.7 and 20 ± 12.7: sure from 100 + 100·11.7/19 on."""
    found = crossing({100.0: (0.0, 2.0), 200.0: (19.0, 21.0)})
    assert str(found) == "all (162 at the latest)"
    mirrored = crossing({100.0: (-21.0, -19.0), 200.0: (-2.0, 0.0)})
    assert str(mirrored) == "never (138 at the earliest)"


def test_crossing_interval_covers_the_root() -> None:
    """95 % of intervals hold the true crossing; 400 draws, so 0.91 … 0.98 in all but 1 of 10⁴."""
    rng = np.random.default_rng(5)
    densities = np.arange(100.0, 500.0, 50.0)
    hits = 0
    for _ in range(400):
        draws = {float(d): (d - 260.0) / 50.0 + rng.normal(0.0, 2.0, 10) for d in densities}
        found = crossing({d: values.tolist() for d, values in draws.items()})
        hits += found.low <= 260.0 <= found.high
    assert 0.91 <= hits / 400 <= 0.985


def test_crossing_refuses() -> None:
    for wrong in ({}, {100.0: (1.0, 2.0)}, {100.0: (1.0,), 200.0: (1.0, 2.0)}):
        with pytest.raises(InputError):
            crossing(wrong)


def test_differences_are_paired_by_seed() -> None:
    rows = pd.DataFrame({
        "series": ["dim"] * 3 + ["x"] * 3, "density": [150.0] * 6, "seed": [1, 2, 3, 3, 2, 4],
        "m": [1.0, 2.0, 3.0, 30.0, 20.0, 40.0], "arrivals": "same", "error": None,
    })  # fmt: skip
    assert paired_differences(rows, "dim", "x", "m") == {150.0: [-18.0, -27.0]}
    assert paired_differences(rows, "dim", "nobody", "m") == {}


def test_total_delay_is_loss_and_departure_delay() -> None:
    rows = pd.DataFrame({"complete_time_loss_s": [3.0], "complete_depart_delay_s": [4.0]})
    assert list(with_total_delay(rows)["total_delay_s"]) == [7.0]
    assert "total_delay_s" in METRICS.values()


# --- fairness --------------------------------------------------------------------------------


def test_gini_closed_forms() -> None:
    assert gini([3.0] * 5) == pytest.approx(0.0)
    assert gini([0.0, 0.0, 0.0, 8.0]) == pytest.approx(1 - 1 / 4)
    # 1 … n: (n + 1)/(3n) − … = (n² − 1)/(3n(n + 1)) = (n − 1)/(3n).
    assert gini(range(1, 11)) == pytest.approx(9 / 30)
    assert gini([0.0, 0.0]) == 0.0


@given(st.lists(st.floats(0.0, 1e4), min_size=1, max_size=8), st.floats(0.1, 100.0))
def test_gini_ignores_scale_order_and_repetition(values: list[float], scale: float) -> None:
    found = gini(values)
    assert 0.0 <= found <= 1.0 - 1.0 / len(values) + 1e-9
    assert gini([scale * v for v in reversed(values)]) == pytest.approx(found, abs=1e-9)
    assert gini(values * 2) == pytest.approx(gini(values, [2.0] * len(values)), abs=1e-9)


@pytest.mark.parametrize("wrong", [([], None), ([-1.0], None), ([1.0], [0.0]), ([1.0], [1.0, 2.0])])
def test_gini_refuses(wrong: Any) -> None:
    with pytest.raises(InputError):
        gini(*wrong)


def test_worst_lane_of_rows() -> None:
    case = Case("fair", "dim", "dim", 4, "balanced", 200.0)
    rows = lane_waits(pd.DataFrame([synthetic_row(case.experiment(1))]), 4)
    row = rows.iloc[0]
    assert row["worst_lane_s"] == row["lanes_d_complete_waiting_time_s"]
    assert row["gini"] == pytest.approx(0.25), "lanes 1 : 2 : 3 : 4"


# --- capacity --------------------------------------------------------------------------------

CASE = Case("fair", "dim", "dim", 4, "balanced", 0.0)


@pytest.mark.parametrize("arms", [3, 4, 5, 6])
def test_bisection_finds_the_capacity_of_the_rows(arms: int) -> None:
    case = CASE._replace(arms=arms)
    (found,), missing = capacities([case], Search(step=10.0, seeds=2), synthetic_find)
    assert missing == []
    # A row grows by more than 2 % of its arrivals from 1/0.98 of its capacity on.
    assert found.interval.mean == pytest.approx(capacity_of("dim", arms) / 0.98, abs=10.0)


def test_capacity_says_no_more_than_the_search_knows() -> None:
    def found(*brackets: tuple[float, float]) -> str:
        return str(Capacity(CASE, brackets))

    assert found((390.0, 400.0), (390.0, 400.0)) == "395 ± 5", "equal seeds, rounded by the search"
    # t(0.975, 1)·s/√2 = 12.706·5 for two values 10 apart, and the 5 of the rounding.
    assert found((390.0, 400.0), (400.0, 410.0)) == "400 ± 69"
    assert found((390.0, 400.0)) == "395"
    assert found((0.0, 200.0), (200.0, 400.0)) == "< 400"
    assert found((600.0, math.inf), (400.0, 600.0)) == "> 400"
    assert found((600.0, math.inf), (0.0, 200.0)) == "–"


@pytest.mark.parametrize(("growth", "text"), [(1.0, "< 200"), (0.0, "> 600")])
def test_capacity_beyond_the_search(growth: float, text: str) -> None:
    def find(asked: Sequence[Recipe]) -> list[Mapping[str, Any] | None]:
        return [{"queue_growth": growth * 100.0, "trips": 100} for _ in asked]

    (capacity,), _ = capacities([CASE], Search.quick(), find)
    assert str(capacity) == text


def test_capacity_of_runs_that_fail_is_missing() -> None:
    asked: list[int] = []

    def broken(experiments: Sequence[Recipe]) -> list[Mapping[str, Any] | None]:
        asked.append(len(experiments))
        return [None] * len(experiments)

    assert capacities([CASE], Search(seeds=2), broken) == ([], [CASE])
    assert asked == [2, 0, 0, 0, 0, 0, 0], "a lost case is not asked for again"


def test_search_refuses() -> None:
    for wrong in ({"steps": 100}, {"steps": 1}, {"step": 0.0}, {"seeds": 0}):
        with pytest.raises(InputError):
            Search(**wrong)  # type: ignore[arg-type]


def test_capacity_of_a_signal_is_what_it_serves_when_saturated() -> None:
    """A signal's capacity is its outflow with a standing queue (Webster: s·g/C).

    Measured in two ways that share nothing: bisection for a queue that does not grow, and trips
    an hour when far more come than leave.
    """
    signal = FixedTime(greens=(8.0,) * 4)

    def find(experiments: Sequence[Recipe]) -> list[Mapping[str, Any] | None]:
        return [
            outcome_of(Recipe(e.scenario, signal, e.seed, label="signal")).row for e in experiments
        ]

    (found,), _ = capacities([CASE], Search(step=20.0, steps=32, seeds=3), find)
    flood = outcome_of(Recipe(four_way(800.0, profile="fair", horizon=3600.0), signal, 1)).row
    served = (flood["trips"] - flood["unfinished"]) / 4.0
    # The first 80 s pass before anybody has left; growth of 2 % still counts as served.
    expected = 1.02 * served / (1.0 - 80.0 / 3600.0)
    assert found.interval.mean == pytest.approx(expected, rel=0.05)


def test_growth_is_a_share_of_arrivals() -> None:
    assert not grows({"queue_growth": 10.0, "trips": 1000})
    assert grows({"queue_growth": 10.1, "trips": 1000})


# --- the paper's values ----------------------------------------------------------------------


def rows_of(study: str) -> pd.DataFrame:
    return collect(STUDIES[study], Effort(seeds=3), synthetic_find).good


def test_every_published_value_is_compared() -> None:
    table = compare(rows_of("as-run"))
    assert len(table) == len(published()) == 152
    assert (table["seeds"] == 3).all()
    assert score(table).judged + score(table, comparable=False).judged == 152
    assert score(table).judged == int((published()["comparable"] == "yes").sum())


def test_comparison_by_hand() -> None:
    rows = pd.DataFrame({
        "series": "dim", "arms": 4, "split": "balanced", "density": 150.0, "error": None,
        **free_flow(60.0),
        "waiting_time_s": [0.5, 0.7], "travel_time_s": [70.0, 72.0], "queue_growth": 0.0,
        "trips": 600, **{f"lanes_{k}_{c}": 0 for k in "abcd" for c in ("trips", "queue_growth")},
    }, index=[0, 1])  # fmt: skip
    table = compare(rows)
    row = table[(table["density"] == 150) & (table["seeds"] == 2)]
    wait = row[row["metric"] == "waiting_time_s"].iloc[0]
    # 0.6 ± 12.706·0.1414·√1.5; the paper has 0.7084.
    assert wait["sd"] == pytest.approx(0.141421, abs=1e-6)
    assert wait["high"] - wait["mean"] == pytest.approx(12.7062 * 0.141421 * math.sqrt(1.5), 1e-4)
    assert bool(wait["inside"])
    travel = row[row["metric"] == "travel_time_s"].iloc[0]
    assert travel["low"] == pytest.approx(71.0 - 12.7062 * math.sqrt(2.0) * math.sqrt(1.5), 1e-4)
    assert score(table).judged == 2
    assert int((table["seeds"] == 0).sum()) == 150


def test_equal_values_make_no_interval() -> None:
    def still(asked: Sequence[Recipe]) -> list[Mapping[str, Any] | None]:
        return [{**synthetic_row(e), "waiting_time_s": 0.0} for e in asked]

    table = compare(collect(STUDIES["as-run"], Effort(seeds=2), still).good)
    chosen = (table["metric"] == "waiting_time_s") & (table["lane"] == "all")
    assert table[chosen]["inside"].isna().all()
    assert table[~chosen]["inside"].notna().all()


def test_causes_that_share_a_number_have_letters() -> None:
    assert len(set(labels().values())) == len(labels())
    assert {"3", "9a", "9b", "9c"} <= set(labels().values())
    table = GALLERY["comparison-as-run"].build(Archive(synthetic_find, Effort(seeds=2), Search()))
    assert isinstance(table, Table)
    for row in table.rows:
        assert len(row[-1].split()) == len(set(row[-1].split()))


def test_causes_of_what_is_not_comparable() -> None:
    """Every value that cannot be compared has a named cause (discrepancies 9 to 13)."""
    for row in published().to_dict("records"):
        named = {known.number for known in causes("text", row)}
        assert (row["comparable"] == "yes") or named & {9, 10, 11, 12, 13}, row
    assert len({known.number for known in discrepancies()}) >= 8
    with pytest.raises(InputError):
        causes("fair", {})
