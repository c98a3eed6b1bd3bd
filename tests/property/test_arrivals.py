"""Arrival tables: whatever can be drawn can be written, read back and checked."""

from __future__ import annotations

import contextlib
import tempfile
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from minisim.arrivals import Arrivals, Demand, read_arrivals, write_arrivals
from minisim.errors import FileError
from minisim.streams import stream
from scenarios.strategies import demands, floats

N = 4


@st.composite
def tables(draw: st.DrawFn) -> Arrivals:
    rows = draw(
        st.lists(
            st.tuples(floats(0.0, 1e7), st.integers(0, N - 1), st.integers(1, N - 1)), max_size=30
        )
    )
    time, lane, manoeuvre = (
        (list(column) for column in zip(*rows, strict=True)) if rows else ([],) * 3
    )
    return Arrivals(
        np.array(time, dtype=float), np.array(lane, dtype=int), np.array(manoeuvre, dtype=int)
    )


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
def test_drawn_tables_are_sorted_within_the_duration_and_fit_the_geometry(
    demand: Demand, duration: float, seed: int
) -> None:
    table = demand.draw(N, duration, seed)
    table.check(N)
    assert (np.diff(table.time) >= 0).all()
    assert ((table.time >= 0) & (table.time < duration)).all()
    rates = demand.rates(N)
    assert all(rates[lane] > 0 for lane in set(table.lane.tolist()))


@given(demands(N), st.integers(0, 2**32))
def test_a_longer_run_begins_with_the_same_arrivals(demand: Demand, seed: int) -> None:
    """Only lane a: the other lanes draw after it from the same stream."""
    short, long = (demand.draw(N, t, seed) for t in (100.0, 200.0))
    first = long.time[(long.lane == 0) & (long.time < 100.0)]
    np.testing.assert_array_equal(short.time[short.lane == 0], first)


@given(st.integers(0, 2**128), st.integers(0, 2**128))
def test_different_seeds_give_different_streams(one: int, other: int) -> None:
    same = stream(one, "arrivals").bytes(16) == stream(other, "arrivals").bytes(16)
    assert same == (one == other)
