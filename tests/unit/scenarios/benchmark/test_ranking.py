import math

import numpy as np
import pandas as pd
import pytest

from scenarios.benchmark.ranking import by_cell, chance, overall, ranked, scores, trouble

#: Hours of sleep gained by one drug less those by another, ten patients (Student 1908, table 1).
SLEEP = [1.2, 2.4, 1.3, 1.3, 0.0, 1.0, 1.8, 0.8, 4.6, 1.4]


def test_the_chance_is_that_of_students_own_example() -> None:
    """t = 4.062 with 9 degrees of freedom: p = 0.00283."""
    assert chance(SLEEP) == pytest.approx(0.002833, abs=1e-6)
    assert chance([-x for x in SLEEP]) == chance(SLEEP)


def test_equal_differences_leave_no_doubt() -> None:
    assert chance([0.0, 0.0]) == 1.0
    assert chance([1.0, 1.0]) == 0.0


def by_seed(*values: float) -> dict[int, float]:
    return dict(enumerate(values, start=1))


def test_ranks_are_certain_as_far_as_pairs_differ_on_common_seeds() -> None:
    """Arrivals make seeds differ by far more than controllers do, but all alike."""
    rain = np.array([0.0, 50.0, 10.0, 90.0, 30.0])
    noise = np.array([0.1, -0.1, 0.2, 0.0, -0.2])
    standings = ranked({
        "slow": by_seed(*(9.0 + rain)),
        "fast": by_seed(*(1.0 + rain + noise)),
        "like fast": by_seed(*(1.01 + rain - noise)),
    })  # fmt: skip
    assert [(name, it.words) for name, it in standings.items()] == [
        ("fast", "1 (1–2)"), ("like fast", "2 (1–2)"), ("slow", "3"),
    ]  # fmt: skip
    assert standings["slow"].mean.mean == pytest.approx(9.0 + rain.mean())


def test_one_seed_decides_nothing() -> None:
    standings = ranked({"a": by_seed(1.0), "b": by_seed(2.0)})
    assert [it.words for it in standings.values()] == ["1 (1–2)", "2 (1–2)"]


def test_wrong_verdicts_are_as_rare_as_promised() -> None:
    """Of 150 rankings of five equals, 5 % or fewer name a better one: over 14 in 1 % of cases."""
    rng, wrong = np.random.default_rng(4), 0
    for _ in range(150):
        values = {name: by_seed(*rng.normal(size=6)) for name in "abcde"}
        wrong += any((it.best, it.worst) != (1, 5) for it in ranked(values).values())
    assert wrong <= 14


def rows(**delays: dict[str, list[float]]) -> pd.DataFrame:
    """Runs by controller and cell, one value per seed; each cell's least delay is 1 s."""
    return pd.DataFrame([
        {
            "cell": cell, "controller": name, "seed": seed, "delay_s": delay, "least_delay_s": 1.0,
            "error": None, "collisions": 0, "unfinished": 0,
        }
        for name, cells in delays.items()
        for cell, values in cells.items()
        for seed, delay in enumerate(values, start=1)
    ])  # fmt: skip


def test_the_overall_rank_does_not_depend_on_the_units_of_cells() -> None:
    table = rows(
        one={"x": [2.0, 2.2], "y": [8.0, 9.0]}, other={"x": [3.0, 3.1], "y": [7.0, 7.7]},
        schedule={"x": [1.1, 1.2], "y": [1.3, 1.4]},
    )  # fmt: skip
    first = overall(table, ["x", "y"])
    assert set(first) == {"one", "other"}
    assert scores(table, ["x", "y"])["one"][1] == pytest.approx(math.log(16.0) / 2.0)
    there = table["cell"] == "y"
    table.loc[there, ["delay_s", "least_delay_s"]] *= 60.0
    for name, it in overall(table, ["x", "y"]).items():
        assert it.mean.mean == pytest.approx(first[name].mean.mean)


def test_without_a_least_delay_a_cell_does_not_count() -> None:
    table = rows(one={"x": [2.0, 2.0], "y": [9.0, 9.0]})
    table.loc[table["cell"] == "y", "least_delay_s"] = np.nan
    assert scores(table, ["x", "y"])["one"][1] == pytest.approx(math.log(2.0))


@pytest.mark.parametrize(
    ("column", "value", "why"),
    [
        ("error", "it cannot serve this", "it cannot serve this"),
        ("collisions", 2, "2 collisions"),
        ("unfinished", 3, "3 vehicles not served"),
    ],
)
def test_a_controller_with_trouble_has_no_rank(column: str, value: object, why: str) -> None:
    table = rows(one={"x": [2.0, 2.2]}, other={"x": [3.0, 3.1]}).astype({"error": object})
    table.loc[0, column] = value
    assert trouble(table[table["controller"] == "one"]) == why
    assert [*by_cell(table)["x"]] == ["other"]
    assert [*overall(table, ["x"])] == ["other"]
