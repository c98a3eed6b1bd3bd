import dataclasses
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pytest

from minisim.errors import FileError, InputError
from scenarios import optimum
from scenarios.benchmark.definition import SCHEDULE, entrants, read_benchmark
from scenarios.benchmark.ranking import overall, trouble
from scenarios.benchmark.results import FILE, Result, compare, load, measured, save
from scenarios.sweep.store import Store

#: Two cells of half a minute, one of them with humans.
SMALL = """name = "small"
version = 1
profile = "fair"
scenario = { name = "three-way", label = "plain" }
density = 200
seeds = 2
demand_time = 30
horizon = 200

[[experiment]]
[[experiment]]
scenario = { name = "three-way", label = "humans" }
humans = 0.5
"""


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Store]:
    with Store(tmp_path_factory.mktemp("benchmark") / "s.sqlite") as opened:
        yield opened


@pytest.fixture(scope="module")
def result(store: Store, tmp_path_factory: pytest.TempPathFactory) -> Result:
    file = tmp_path_factory.mktemp("definition") / "small.toml"
    file.write_text(SMALL)
    benchmark = read_benchmark(file)
    named = entrants(["dim", "all-way-stop", "reservation"])
    made = measured(benchmark, named, store, 1, lambda *_: None)
    again = measured(benchmark, named, store, 1, lambda *_: None)
    pd.testing.assert_frame_equal(made.rows, again.rows)  # CPU times too: nothing was run
    return made


def test_every_controller_has_a_row_for_every_cell_and_seed(result: Result) -> None:
    names = [SCHEDULE, "dim", "all-way-stop", "reservation"]
    places = list(result.rows[["cell", "seed", "controller"]].itertuples(index=False, name=None))
    assert places == [(c, s, n) for c in ("plain", "humans") for s in (1, 2) for n in names]
    assert (result.head["controllers"], result.plain) == (names[1:], ["plain"])
    assert not [c for c in result.rows if c.startswith(("lanes_", "kinds_"))]


def test_one_that_cannot_serve_a_cell_says_so_in_its_row(result: Result) -> None:
    refused = result.rows[result.rows["error"].notna()]
    assert set(zip(refused["cell"], refused["controller"], strict=True)) == {
        ("humans", "reservation")
    }
    assert "humans send none" in trouble(refused)


def test_no_controller_is_below_the_least_delay_and_all_are_ranked(result: Result) -> None:
    good = result.rows[result.rows["error"].isna()]
    assert (good["delay_s"] >= good["least_delay_s"]).all()
    least = good.groupby(["cell", "seed"])["least_delay_s"]
    assert (least.nunique() == 1).all()
    assert good["above_least_percent"].tolist() == pytest.approx(
        (100.0 * (good["delay_s"] / good["least_delay_s"] - 1.0)).tolist()
    )
    assert set(overall(result.rows, result.plain)) == {"dim", "all-way-stop", "reservation"}


def test_where_the_least_delay_is_not_known_it_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> float:
        raise InputError("more than 0 states at once")

    monkeypatch.setattr(optimum, "_least", refuse)
    file = tmp_path / "small.toml"
    file.write_text(SMALL.replace("seeds = 2", "seeds = [5]"))
    with Store(tmp_path / "s.sqlite") as store:
        made = measured(read_benchmark(file), entrants(["dim"]), store, 1, lambda *_: None)
    assert [*made.head["no_least"]] == ["plain", "humans"]
    assert set(made.head["no_least"].values()) == {"more than 0 states at once"}
    assert made.rows["delay_s"].notna().all()
    assert overall(made.rows, made.plain) == {}


def test_a_file_holds_the_whole_result(result: Result, tmp_path: Path) -> None:
    save(result, tmp_path / FILE)
    for place in (tmp_path, tmp_path / FILE):
        again = load(place)
        assert again.head == result.head
        same = compare(result, again)
        assert (same.equal, same.common, same.changes) == (16, 16, ())
        assert (same.only_first, same.only_second) == (0, 0)
    text = (tmp_path / FILE).read_text()
    save(load(tmp_path), tmp_path / FILE)
    assert (tmp_path / FILE).read_text() == text


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"layout": 1, "rows": [], "columns": []}'])
def test_another_file_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "x.json").write_text(text)
    with pytest.raises(FileError, match=r"x\.json is not the result of a benchmark"):
        load(tmp_path / "x.json")


def changed(result: Result, **columns: object) -> Result:
    return dataclasses.replace(result, rows=result.rows.assign(**columns))


def test_times_of_decisions_are_not_compared(result: Result) -> None:
    assert compare(result, changed(result, median_decision_us=1.0, cpu_s=2.0)).equal == 16


def test_what_differs_is_told_by_cell_and_controller(result: Result) -> None:
    slower = result.rows["delay_s"].where(
        (result.rows["controller"] != "dim") | (result.rows["cell"] != "plain"),
        result.rows["delay_s"] + 0.25 * result.rows["seed"],
    )
    made = compare(result, changed(result, delay_s=slower))
    assert (made.equal, made.common) == (14, 16)
    (change,) = made.changes
    assert change[:3] == ("plain", "dim", ("delay_s",))
    assert change.difference is not None
    assert change.difference.mean == pytest.approx(0.375)
    assert change.chance == pytest.approx(0.2048, abs=1e-4)  # t = 3 with one degree of freedom


def test_rows_that_only_one_has_are_counted(result: Result) -> None:
    fewer = dataclasses.replace(result, rows=result.rows[result.rows["controller"] != "dim"])
    made = compare(result, fewer)
    assert (made.equal, made.common, made.only_first, made.only_second) == (12, 12, 4, 0)


@pytest.mark.parametrize(
    ("key", "value", "what"),
    [
        ("benchmark", "other", "benchmarks"),
        ("benchmark_version", 7, "versions of the benchmark"),
        ("digest", "0", "definitions of the benchmark"),
        ("quick", True, "lengths"),
    ],
)
def test_two_benchmarks_are_not_compared(
    result: Result, key: str, value: object, what: str
) -> None:
    other = dataclasses.replace(result, head={**result.head, key: value})
    with pytest.raises(InputError, match=f"two different {what}.* cannot be compared"):
        compare(result, other)
