"""Arrival tables: whatever can be drawn can be written, read back and checked."""

from __future__ import annotations

import contextlib
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from minisim.arrivals import Arrivals
from minisim.demand import Demand, DemandProfile, Period
from minisim.demandfile import read_demand, write_demand
from minisim.errors import FileError
from minisim.recorded import read_arrivals, write_arrivals
from minisim.streams import stream
from scenarios.strategies import demand_profiles, demands, floats

N = 4


@st.composite
def tables(draw: st.DrawFn) -> Arrivals:
    row = st.tuples(floats(0.0, 1e7), st.integers(0, N - 1), st.integers(1, N - 1))
    drawn = draw(st.lists(row, max_size=30))
    columns = ([one[k] for one in drawn] for k in range(3))
    time, lane, manoeuvre = map(np.array, columns, (float, int, int))
    return Arrivals(time, lane, manoeuvre)


@given(tables())
def test_writing_and_reading_a_table_changes_no_bit(table: Arrivals) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arrivals.csv"
        write_arrivals(table, path)
        again = read_arrivals(path, n=N)
    for column in ("time", "lane", "manoeuvre"):
        assert getattr(again, column).tobytes() == getattr(table, column).tobytes()


@given(st.binary(max_size=60) | st.text(max_size=60).map(lambda text: text.encode()))
def test_any_bytes_after_the_header_are_a_table_or_a_file_error(junk: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arrivals.csv"
        path.write_bytes(b"demand_time_s,lane,manoeuvre\n1,a,1\n" + junk)
        with contextlib.suppress(FileError):
            read_arrivals(path, n=N).check(N)


@given(demands(N), floats(1.0, 600.0), st.integers(0, 2**64))
def test_drawn_tables_are_sorted_and_fit(demand: Demand, duration: float, seed: int) -> None:
    table = demand.draw(N, duration, seed)
    table.check(N)
    assert (np.diff(table.time) >= 0).all()
    assert ((table.time >= 0) & (table.time < duration)).all()
    rates = demand.inflow(N).rates[0]
    assert all(rates[lane] > 0 for lane in set(table.lane.tolist()))


def rows(table: Arrivals) -> list[tuple[float, int, int]]:
    """Each vehicle's demand time, lane and manoeuvre."""
    columns = table.time.tolist(), table.lane.tolist(), table.manoeuvre.tolist()
    return list(zip(*columns, strict=True))


@given(demands(N), st.integers(0, 2**32), floats(1.0, 5000.0), floats(0.0, 5000.0))
def test_longer_only_adds_arrivals(demand: Demand, seed: int, duration: float, more: float) -> None:
    short, long = (rows(demand.draw(N, t, seed)) for t in (duration, duration + more))
    assert long[: len(short)] == short
    assert all(time >= duration for time, *_ in long[len(short) :])


@given(demands(N, 300.0), st.integers(0, 2**32), st.integers(0, N - 1), floats(0.1, 2.0))
def test_the_rate_of_a_lane_is_its_own(demand: Demand, seed: int, lane: int, factor: float) -> None:
    """With the other rates as they are: as numbers, not as shares of another total."""
    split = [factor if k == lane else 1.0 for k in range(N)]
    density = 200.0 * sum(split) / N
    one = replace(demand, density=200.0, split=None).draw(N, 1000.0, seed)
    other = replace(demand, density=density, split=split).draw(N, 1000.0, seed)
    for k in set(range(N)) - {lane}:
        mine, theirs = ([row for row in rows(it) if row[1] == k] for it in (one, other))
        np.testing.assert_allclose(mine, theirs, rtol=1e-9)  # rates differ by rounding


@given(demands(N, 300.0), st.integers(0, 2**32), floats(1.0, 3.0))
def test_more_inflow_only_adds_poisson_arrivals(demand: Demand, seed: int, factor: float) -> None:
    fewer = replace(demand, model="poisson")
    more = replace(fewer, density=demand.density * factor)
    tables = (demand.draw(N, 600.0, seed) for demand in (fewer, more))
    few, many = (Counter(zip(table.time, table.lane, strict=True)) for table in tables)
    assert few <= many


@given(tables())
def test_ranks_count_the_vehicles_of_each_lane(table: Arrivals) -> None:
    for lane in range(N):
        assert table.rank[table.lane == lane].tolist() == list(range(sum(table.lane == lane)))


@given(st.integers(0, 2**128), st.integers(0, 2**128))
def test_different_seeds_give_different_streams(one: int, other: int) -> None:
    same = stream(one, "arrivals").bytes(16) == stream(other, "arrivals").bytes(16)
    assert same == (one == other)


@given(demand_profiles(N), st.integers(0, 2**32), st.data())
def test_what_comes_before_a_time_does_not_depend_on_what_comes_after(
    demand: DemandProfile, seed: int, data: st.DataObject
) -> None:
    """Other rates and turns, or more of the same, from a period on."""
    ahead = [period for period in demand.periods if period.end > demand.start]
    one, other = data.draw(st.sampled_from(ahead)), data.draw(demand_profiles(N)).periods[0]
    changed = replace(one, rates=other.rates, turns=other.turns)
    more = Period(start=demand.periods[-1].end, end=10_000, rates=other.rates, turns=other.turns)
    periods = (*(changed if it is one else it for it in demand.periods), more)
    until = float(max(one.start - demand.start, 0))
    mine, theirs = (
        [row for row in rows(it.draw(N, demand.duration, seed)) if row[0] < until]
        for it in (demand, replace(demand, periods=periods))
    )
    assert mine == theirs


@given(demand_profiles(N), st.integers(0, 2**32), st.integers(0, N - 1), floats(0.0, 300.0))
def test_the_profile_of_a_lane_changes_no_other(
    demand: DemandProfile, seed: int, lane: int, rate: float
) -> None:
    def other(period: Period) -> Period:
        rates = tuple(rate if k == lane else it for k, it in enumerate(period.rates))
        return replace(period, rates=rates)

    changed = replace(demand, periods=tuple(map(other, demand.periods)))
    mine, theirs = (
        [row for row in rows(it.draw(N, demand.duration, seed)) if row[1] != lane]
        for it in (demand, changed)
    )
    assert mine == theirs


@given(demand_profiles(N), st.integers(0, 2**32), st.data())
def test_a_period_divided_into_two_draws_the_same(
    demand: DemandProfile, seed: int, data: st.DataObject
) -> None:
    """So a profile that is always the same is a constant demand."""
    one = data.draw(
        st.sampled_from([it for it in demand.periods if it.end - it.start > 1] or [None])
    )
    if one is None:
        return
    middle = data.draw(st.integers(one.start + 1, one.end - 1))
    halves = (replace(one, end=middle), replace(one, start=middle))
    periods = [half for it in demand.periods for half in (halves if it is one else (it,))]
    mine, theirs = (
        rows(it.draw(N, demand.duration, seed))
        for it in (demand, replace(demand, periods=tuple(periods)))
    )
    np.testing.assert_allclose(mine, theirs, rtol=1e-9)  # headways differ by rounding


@given(demand_profiles(N), st.floats(0.0, 4000.0), st.floats(0.0, 4000.0))
def test_the_mean_inflow_is_that_of_all_seconds(
    demand: DemandProfile, first: float, length: float
) -> None:
    inflow = demand.inflow(N)
    whole = np.array(inflow.mean(first, first + length)) * length
    parts = [np.array(inflow.mean(a, a + length / 7)) * length / 7
             for a in first + length / 7 * np.arange(7)]  # fmt: skip
    np.testing.assert_allclose(whole, np.sum(parts, axis=0), atol=1e-6)


@given(demand_profiles(N))
def test_writing_and_reading_demand_changes_nothing(demand: DemandProfile) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "day.toml"
        write_demand(demand, path)
        assert read_demand(path) == demand
