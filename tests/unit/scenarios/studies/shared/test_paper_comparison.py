"""The paper's values against ours, and the causes of what differs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
import pytest

from minisim.errors import InputError
from scenarios.recipe import Recipe
from scenarios.studies import study_named
from scenarios.studies.shared.effort import Effort
from scenarios.studies.shared.paper_comparison import (
    causes,
    compare,
    discrepancies,
    labels,
    published,
    score,
)
from tests.builders import free_flow, synthetic_find, synthetic_row


def rows_of(study: str) -> pd.DataFrame:
    return study_named(study).collect(Effort(seeds=3), synthetic_find).good


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

    table = compare(study_named("as-run").collect(Effort(seeds=2), still).good)
    chosen = (table["metric"] == "waiting_time_s") & (table["lane"] == "all")
    assert table[chosen]["inside"].isna().all()
    assert table[~chosen]["inside"].notna().all()


def test_causes_that_share_a_number_have_letters() -> None:
    assert len(set(labels().values())) == len(labels())
    assert {"3", "9a", "9b", "9c"} <= set(labels().values())


def test_causes_of_what_is_not_comparable() -> None:
    """Every value that cannot be compared has a named cause (discrepancies 9 to 13)."""
    for row in published().to_dict("records"):
        named = {known.number for known in causes("text", row)}
        assert (row["comparable"] == "yes") or named & {9, 10, 11, 12, 13}, row
    assert len({known.number for known in discrepancies()}) >= 8
    with pytest.raises(InputError):
        causes("fair", {})
