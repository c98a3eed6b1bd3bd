"""Mixtures against humans alone, from rows made up for it."""

from __future__ import annotations

import pandas as pd
import pytest

from scenarios.studies.humans import STUDY, against_humans, verdict
from scenarios.studies.shared.effort import Effort
from scenarios.studies.shared.study import Results
from tests.builders import synthetic_row

EFFORT = Effort(seeds=3, horizon=600.0)


def results(lost: dict[float, float]) -> Results:
    """Rows at 250 veh/h/lane: each seed is a second slower, and a share loses its seconds more."""
    chosen = [p for p in STUDY.points if (p.density, p.series) == (250.0, "dim")]
    asked = [
        (point, {
            **synthetic_row(recipe), "complete_depart_delay_s": 1.0,
            "complete_time_loss_s": recipe.seed + lost.get(point.humans, -1.0),
        })
        for point, recipe in STUDY.runs(3, 600.0, chosen)
    ]  # fmt: skip
    return Results.of(STUDY, EFFORT, asked)


def test_mixtures_are_paired_with_humans_alone_by_seed() -> None:
    known = against_humans(results({1.0: 5.0, 0.3: 12.0}).good)
    assert len(known) == 10
    assert known["dim", 250.0, 0.3] == pytest.approx((7.0, 0.0, 3))
    assert known["dim", 250.0, 0.0] == pytest.approx((-6.0, 0.0, 3))


def test_the_verdict_names_the_slowest_mixture() -> None:
    said = verdict(results({1.0: 5.0, 0.3: 12.0, 0.4: 5.5}))
    assert "are 2 of 10 mixtures" in said
    assert "loses 7.0 ± 0.0 s more (DIM, 250 veh/h/lane, 30% humans)" in said
    assert "are 0 of 10" in verdict(results({1.0: 5.0}))


def test_without_two_seeds_nothing_is_said() -> None:
    rows = results({}).good
    assert against_humans(rows[rows["seed"] == 1]) == {}
    assert against_humans(pd.DataFrame(rows[rows["humans"] < 1.0])) == {}
