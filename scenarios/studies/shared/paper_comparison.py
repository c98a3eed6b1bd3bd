"""The paper's numbers beside ours, cell by cell, and the causes of the differences."""

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
from scenarios.controllers import label_of
from scenarios.paper import SERIES, SPLITS, reference
from scenarios.statistics import prediction_interval
from scenarios.studies.shared.study import Results
from scenarios.sweep.cells import saturated

if TYPE_CHECKING:
    import pandas as pd

COMPARED = (
    "series", "arms", "split", "density", "metric", "lane", "paper", "comparable", "seeds",
    "mean", "sd", "low", "high", "inside", "saturated",
)  # fmt: skip


def published() -> pd.DataFrame:
    """`scenarios.paper.reference` with columns `series`, our names, and `paper`, the value [s]."""
    table = reference()
    table["series"] = table["controller"].map(SERIES)
    return table.rename(columns={"value": "paper"})


def compare(rows: pd.DataFrame) -> pd.DataFrame:
    """Every published value beside the rows of a study of the paper's grid: columns `COMPARED`.

    `low` and `high` bound the 95 % prediction interval for one more run of ours, cut at 0, since no
    time is negative. `inside` says whether the paper's value lies in it; it is missing if there is
    only one value or all are equal. Without a run, `seeds` is 0 and the rest is missing.
    """
    import pandas as pd

    keys = ["series", "arms", "split", "density"]
    cells = dict(iter(rows.groupby(keys)))
    compared = []
    for row in sorted(published().to_dict("records"), key=_order):
        ours = cells.get(tuple(row[key] for key in keys))
        lane = "" if row["lane"] == "all" else f"lanes_{row['lane']}_"
        compared.append(row | _ours(ours, f"{lane}{row['metric']}", row["paper"]))
    return pd.DataFrame(compared)[list(COMPARED)]


def _order(row: Mapping[Any, Any]) -> tuple[object, ...]:
    """Sort key, in reading order: arms, inflow, controller, all lanes, lane, metric."""
    lane = "" if row["lane"] == "all" else row["lane"]
    places = SPLITS.index(row["split"]), list(SERIES.values()).index(row["series"])
    return row["arms"], *places, lane, row["metric"], row["density"]


def _ours(cell: pd.DataFrame | None, column: str, paper: float) -> dict[str, object]:
    values = [] if cell is None else cell[column].dropna().astype(float).tolist()
    if cell is None or not values:
        return {"seeds": 0, **dict.fromkeys(("mean", "sd", "low", "high"), math.nan),
                "inside": None, "saturated": None}  # fmt: skip
    sd = math.nan if len(values) == 1 else stdev(values)
    mean, half, _ = prediction_interval(values)
    low, high = mean - half, mean + half
    low = low if math.isnan(low) else max(low, 0.0)
    return {
        "seeds": len(values), "mean": mean, "sd": sd, "low": low, "high": high,
        "inside": low <= paper <= high if sd > 0.0 else None, "saturated": saturated(cell),
    }  # fmt: skip


class Score(NamedTuple):
    """How many of the paper's values lie in our 95 % prediction intervals, where there is one."""

    inside: int
    judged: int

    def __str__(self) -> str:
        return f"{self.inside} of {self.judged}"


def score(compared: pd.DataFrame, *, comparable: bool = True) -> Score:
    """The score of the published values that are comparable, or of all others."""
    chosen = (compared["comparable"] == "yes") == comparable
    judged = compared[chosen & compared["inside"].notna()]
    return Score(int(judged["inside"].astype(bool).sum()), len(judged))


def agreement(results: Results) -> str:
    """How many of the paper's values lie inside our intervals, in total and by controller."""
    name, effort = results.study.name, results.effort
    if results.good.empty:
        return f"- `{name}`: not run (`{effort.command(name)}`)."
    table = compare(results.good)
    by_series = [
        f"{label_of(str(series))} {score(rows)}"
        for series, rows in table.groupby("series", sort=False)
        if score(rows).judged
    ]
    return (
        f"- `{name}`: {effort.warning}{score(table)} comparable values of the paper lie inside our "
        f"95 % prediction interval; of those that are not comparable, "
        f"{score(table, comparable=False)}. Inside means that one more run of ours could well give "
        "the paper's value. Near saturation, our runs spread so widely that nearly every value is "
        f"inside.\n  By controller: {', '.join(by_series)}."
    )


class Discrepancy(NamedTuple):
    """A known cause of a difference between the paper and us."""

    number: int  # in the documented list of discrepancies
    study: str  # this and the next five: where it holds; empty means anywhere
    series: str
    arms: str
    split: str
    density: str
    metric: str
    cause: str  # in words

    def holds(self, study: str, row: Mapping[Any, Any]) -> bool:
        """Whether it holds for a study's row of `compare`."""
        where = {**row, "study": study}
        return all(getattr(self, key) in ("", str(where[key])) for key in self._fields[1:-1])


@lru_cache
def discrepancies() -> tuple[Discrepancy, ...]:
    """All known causes, in order, from the data file beside the reference numbers."""
    file = resources.files("scenarios") / "data" / "discrepancies.csv"
    with file.open(encoding="utf-8") as text:
        rows = list(csv.DictReader(text))
    return tuple(sorted(Discrepancy(int(row.pop("number")), **row) for row in rows))


@lru_cache
def labels() -> Mapping[str, str]:
    """Cause -> its number, with a letter if several share it: 3, 9a, 9b."""
    by_number: dict[int, dict[str, None]] = {}
    for known in discrepancies():
        by_number.setdefault(known.number, {})[known.cause] = None
    return {
        cause: f"{number}{ascii_lowercase[k] if len(causes) > 1 else ''}"
        for number, causes in by_number.items()
        for k, cause in enumerate(causes)
    }


def causes(study: str, row: Mapping[Any, Any]) -> tuple[Discrepancy, ...]:
    """Known causes of a difference in a row of `compare`, for a study of the paper's grid."""
    choice("study of the paper's grid", study, ("text", "as-run"))
    return tuple(known for known in discrepancies() if known.holds(study, row))
