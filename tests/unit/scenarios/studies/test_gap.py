"""What the delay of DIM consists of: the parts add up, seed by seed."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from scenarios.optimum import LEAST, mean_delay
from scenarios.studies.gap import FREE, ORDER, PARTS, SERIES, STUDY, delays, seconds
from scenarios.studies.optimum import HARMLESS, DrainedPoint
from scenarios.studies.shared.effort import Effort
from tests.builders import synthetic_find

RESULTS = STUDY.collect(Effort(seeds=3), synthetic_find)


@pytest.mark.parametrize("name", PARTS)
def test_the_parts_of_a_controller_are_its_delay(name: str) -> None:
    """As a sum of series, and so in every run."""
    total: Counter[str] = Counter()
    for part in PARTS[name]:
        for series, times in part.weights.items():
            total[series] += times
    assert {series: times for series, times in total.items() if times} == {name: 1}
    table = delays(RESULTS.good)
    assert len(table) == 3 * 4 * 3
    added = sum(seconds(part, table) for part in PARTS[name])
    np.testing.assert_allclose(added, table[name], rtol=1e-12)
    assert {series for part in PARTS[name] for series in part.weights} <= {*SERIES, LEAST.name}


def test_each_label_is_one_cause() -> None:
    causes = {}
    for parts in PARTS.values():
        for part in parts:
            assert part.label == ORDER or (
                causes.setdefault(part.label, part.weights) == part.weights
            )


def test_rows_without_all_runs_are_left_out() -> None:
    rows = RESULTS.good
    assert delays(rows[rows["series"] != FREE]).empty
    late = rows.assign(delay_s=rows["delay_s"].where(rows["seed"] != 2))
    assert delays(late).index.unique("seed").tolist() == [1, 3]


def test_without_conflicts_vehicles_drive_through_each_other_in_the_zones_of_dim() -> None:
    found = []
    for name in (FREE, HARMLESS, "dim"):
        run = DrainedPoint(name, 4, 350.0).recipe(1, 240.0).run()
        assert bool(run.collisions) == (name != "dim")
        found.append(mean_delay(run) or 0.0)
    free, harmless, dim = found
    assert 1.0 < free < harmless - 1.0 < dim - 2.0
