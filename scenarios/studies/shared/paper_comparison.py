"""The paper's numbers against ours, cell by cell, and the causes of what differs."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from functools import lru_cache
from importlib import resources
from statistics import stdev
from string import ascii_lowercase
from typing import TYPE_CHECKING, Any, NamedTuple

from minisim.errors import choice
from scenarios.paper import SERIES, SPLITS, reference
from scenarios.statistics import prediction_interval
from scenarios.sweep.cells import saturated

if TYPE_CHECKING:
    import pandas as pd

COMPARED = (
    "series", "arms", "split", "density", "metric", "lane", "paper", "comparable", "seeds",
    "mean", "sd", "low", "high", "inside", "saturated",
)  # fmt: skip


def published() -> pd.DataFrame:
    """`scenarios.paper.reference`, with our names: `series` and `paper` (the value [s])."""
    table = reference()
    table["series"] = table["controller"].map(SERIES)
    return table.rename(columns={"value": "paper"})


def compare(rows: pd.DataFrame) -> pd.DataFrame:
    """Every published value beside ours.

    Args:
        rows: of a study of the paper's grid (`Results.good`).

    Returns:
        One row a published value, columns `COMPARED`: `low` and `high` are the bounds of the 95 %
        prediction interval, within which one more run of ours would fall, cut at 0, below which
        no time is; `inside` whether the paper's value does, missing where there is one value or
        all are equal, which makes no interval; `seeds` is 0 where there is no run, and what
        follows is missing.
    """
    import pandas as pd

    keys = ["series", "arms", "split", "density"]
    cells = {key: cell for key, cell in rows[rows["error"].isna()].groupby(keys)}  # noqa: C416
    compared = []
    for row in sorted(published().to_dict("records"), key=_order):
        key = (row["series"], row["arms"], row["split"], float(row["density"]))
        ours = cells.get(key)
        row.update(**_ours(ours, column_of(row["metric"], row["lane"]), row["paper"]))
        compared.append(row)
    return pd.DataFrame(compared)[list(COMPARED)]


def _order(row: Mapping[Any, Any]) -> tuple[object, ...]:
    """As a reader looks for it: junction, inflow, controller, metric, all lanes before each."""
    lane = "" if row["lane"] == "all" else row["lane"]
    places = SPLITS.index(row["split"]), list(SERIES.values()).index(row["series"])
    return row["arms"], *places, lane, row["metric"], row["density"]


def column_of(metric: str, lane: str) -> str:
    """Column of a sweep for a metric of a lane, or of "all"."""
    return metric if lane == "all" else f"lanes_{lane}_{metric}"


def _ours(cell: pd.DataFrame | None, column: str, paper: float) -> dict[str, object]:
    values = [] if cell is None else cell[column].dropna().astype(float).tolist()
    if cell is None or not values:
        return {"seeds": 0, "mean": math.nan, "sd": math.nan, "low": math.nan, "high": math.nan,
                "inside": None, "saturated": None}  # fmt: skip
    one = len(values) == 1
    sd = math.nan if one else stdev(values)
    mean, half, _ = prediction_interval(values)
    low, high = mean - half, mean + half
    low = low if math.isnan(low) else max(low, 0.0)
    return {
        "seeds": len(values), "mean": mean, "sd": sd, "low": low, "high": high,
        "inside": bool(low <= paper <= high) if sd > 0.0 else None,
        "saturated": saturated(cell),
    }  # fmt: skip


class Score(NamedTuple):
    """How many of the paper's values our runs contain.

    Attributes:
        inside: values within the 95 % prediction interval of ours.
        judged: values for which there is one.
    """

    inside: int
    judged: int

    def __str__(self) -> str:
        return f"{self.inside} of {self.judged}"


def score(compared: pd.DataFrame, *, comparable: bool = True) -> Score:
    """Count the published values inside, among those that are comparable, or all the others."""
    chosen = (compared["comparable"] == "yes") == comparable
    judged = compared[chosen & compared["inside"].notna()]
    return Score(int(judged["inside"].astype(bool).sum()), len(judged))


class Discrepancy(NamedTuple):
    """A known cause of a difference between the paper and us.

    Attributes:
        number: in the list of discrepancies (docs).
        study, series, arms, split, density, metric: where it holds; empty is anywhere.
        cause: in words.
    """

    number: int
    study: str
    series: str
    arms: str
    split: str
    density: str
    metric: str
    cause: str

    def holds(self, study: str, row: Mapping[Any, Any]) -> bool:
        """Whether it holds for a study's row of `compare`."""
        wanted = {
            "series": self.series, "arms": self.arms, "split": self.split,
            "density": self.density, "metric": self.metric,
        }  # fmt: skip
        return self.study in ("", study) and all(
            not value or value == _text(row[key]) for key, value in wanted.items()
        )


@lru_cache
def discrepancies() -> tuple[Discrepancy, ...]:
    """All known causes, from the data file beside the reference numbers."""
    file = resources.files("scenarios") / "data" / "discrepancies.csv"
    with file.open(encoding="utf-8") as text:
        rows = list(csv.DictReader(text))
    return tuple(Discrepancy(int(row.pop("number")), **row) for row in rows)


@lru_cache
def labels() -> Mapping[str, str]:
    """Cause -> its number, with a letter where several have the same: 3, 9a, 9b."""
    by_number: dict[int, dict[str, None]] = {}
    for known in sorted(discrepancies()):
        by_number.setdefault(known.number, {})[known.cause] = None
    return {
        cause: f"{number}{ascii_lowercase[k] if len(causes) > 1 else ''}"
        for number, causes in by_number.items()
        for k, cause in enumerate(causes)
    }


def causes(study: str, row: Mapping[Any, Any]) -> tuple[Discrepancy, ...]:
    """The known causes of a difference in one row of `compare`.

    Raises:
        InputError: another study than the paper's.
    """
    choice("study of the paper's grid", study, ("text", "as-run"))
    return tuple(sorted(known for known in discrepancies() if known.holds(study, row)))


def _text(value: object) -> str:
    return f"{value:g}" if isinstance(value, int | float) else str(value)
