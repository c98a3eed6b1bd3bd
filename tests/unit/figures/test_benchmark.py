"""The page of a benchmark, from made-up rows."""

from pathlib import Path

import pandas as pd
import pytest

from figures.benchmark import cells_figure, measures_figure, names, overall_figure
from figures.benchmark_report import means, write_page
from scenarios.benchmark.results import FILE, Result, load

CELLS = {"calm": 1.0, "busy": 2.0, "40 % humans": 1.5}
DELAYS = {"dim": 4.0, "reservation": 1.5, "mine": 9.0, "schedule": 1.2}


def row(cell: str, name: str, seed: int) -> dict[str, object]:
    delay = DELAYS[name] * CELLS[cell] + 0.01 * seed
    refused = name == "reservation" and cell == "40 % humans"
    numbers = {
        "delay_s": delay, "least_delay_s": CELLS[cell],
        "above_least_percent": 100.0 * (delay / CELLS[cell] - 1.0), "delay_s_p95": 3.0 * delay,
        "stops": 0.004 * delay, "messages": 5 if name == "reservation" else 0, "trips": 10,
        "collisions": 3 if name == "mine" and cell == "busy" else 0, "unfinished": 0,
    }  # fmt: skip
    head = {"cell": cell, "controller": name, "seed": seed}
    return {**head, "error": "humans send none"} if refused else {**head, "error": None, **numbers}


@pytest.fixture(scope="module")
def result() -> Result:
    rows = [row(cell, name, seed) for cell in CELLS for seed in (1, 2, 3) for name in DELAYS]
    head = {
        "benchmark": "ours", "benchmark_version": 3, "digest": "abc", "quick": False,
        "seeds": [1, 2, 3], "cells": [*CELLS], "plain": ["calm", "busy"],
        "no_least": {},
        "controllers": ["dim", "reservation", "mine"], "minisim": "1", "results": 1,
        "commit": None,
    }  # fmt: skip
    return Result(head, pd.DataFrame(rows))


def texts(figure) -> list[str]:
    (axes,) = figure.axes
    return [text.get_text() for text in axes.texts]


def test_controllers_are_listed_by_rank_and_those_without_one_last(result: Result) -> None:
    assert names(result) == ["reservation", "dim", "mine", "schedule"]


def test_the_overall_figure_shows_times_the_least_delay_and_ranks(result: Result) -> None:
    figure = overall_figure(result)
    (axes,) = figure.axes
    assert texts(figure) == ["1", "2", "no rival"]
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert labels == ["reservation", "DIM", "schedule (knows all arrivals)"]
    drawn = [float(line.get_xdata()[0]) for line in axes.lines if len(line.get_xdata()) == 1]
    assert min(abs(x - 4.015) for x in drawn) < 1e-3  # √(4.02·4.01) = 4.015


def test_the_map_of_cells_has_percent_above_the_least_or_a_cross(result: Result) -> None:
    assert texts(cells_figure(result)) == [
        "52", "51", "×",
        "302", "301", "301",
        "802", "×", "801",
        "22", "21", "21",
    ]  # fmt: skip


def test_the_map_of_measures_shows_what_the_rows_have_per_trip(result: Result) -> None:
    figure = measures_figure(result)
    heads = [label.get_text() for label in figure.axes[0].get_xticklabels()]
    assert heads == ["delay\n[s]", "delay,\n95 % [s]", "stops", "messages\nper trip"]
    assert texts(figure)[:4] == ["2.3", "6.8", "0.009", "0.5"]


def test_means_have_intervals_and_say_what_went_wrong(result: Result) -> None:
    table = means(result).set_index(["cell", "controller"])
    assert table.loc[("calm", "dim"), "delay_s"] == pytest.approx(4.02)
    assert table.loc[("calm", "dim"), "delay_s_ci95"] == pytest.approx(0.0248, abs=1e-4)
    assert table.loc[("busy", "mine"), "trouble"] == "9 collisions"
    assert table.loc[("40 % humans", "reservation"), "trouble"] == "humans send none"


def test_the_page_has_all_of_it(result: Result, tmp_path: Path) -> None:
    done = []
    write_page(result, tmp_path, "12 rows.", lambda *at: done.append(at))
    assert done == [(1, 3), (2, 3), (3, 3)]
    report = (tmp_path / "report.md").read_text()
    assert "Benchmark ours 3" in report
    assert "smoke test" not in report
    assert "| reservation | 1 | 1.51 | " in report
    assert "| 40 % humans | reservation | humans send none |" in report
    assert "| busy | mine | 9 collisions |" in report
    for name in ("overall", "cells", "measures"):
        assert f"(figures/{name}.png)" in report
        assert (tmp_path / "figures" / f"{name}.png").stat().st_size > 10_000
    assert len((tmp_path / "cells.csv").read_text().splitlines()) == 1 + 12
    assert load(tmp_path / FILE).head == result.head


def test_a_benchmark_that_none_has_served_has_a_page_too(result: Result, tmp_path: Path) -> None:
    rows = result.rows.assign(error="no road")
    write_page(Result(result.head, rows), tmp_path, "", lambda *_: None)
    report = (tmp_path / "report.md").read_text()
    assert report.count("no road") == 12
    assert "overall.png" not in report
