"""From which loss and latency of messages on DIM has less delay."""

from __future__ import annotations

import pandas as pd
import pytest

from minisim.link import Linked
from scenarios.studies.messages import DENSITIES, HORIZON, STUDY, TALKING, MessagePoint, wins


def row(point: MessagePoint, seed: int, delay: float) -> dict[str, object]:
    delays = {"complete_time_loss_s": delay - 1.0, "complete_depart_delay_s": 1.0}
    return {**point._asdict(), **delays, "seed": seed, "arrivals": seed, "error": None}


def test_where_dim_wins_by_hand() -> None:
    """V2I-C's delay is 2 s + 10 s · loss, or 2 s + 1 s per second of latency; DIM's is 5 s."""
    rows = []
    for seed, noise in ((1, -0.1), (2, 0.1)):
        rows += [row(MessagePoint("dim", 150.0), seed, 5.0)]
        for latency, loss in ((0.0, 0.0), (0.0, 0.1), (0.0, 0.5), (1.0, 0.0), (2.0, 0.0)):
            failing = MessagePoint("v2ic", 150.0, latency, loss)
            rows.append(row(failing, seed, 2.0 + 10.0 * loss + latency + noise))
    known = wins(pd.DataFrame(rows))
    assert {*known} == {(what, "dim", "v2ic", 150.0) for what in ("loss [%]", "latency [ms]")}
    loss, latency = known.values()
    assert loss.density == pytest.approx(30.0)
    assert loss.low < 30.0 < loss.high
    assert latency.point == "never"


def test_only_rivals_have_messages_that_fail() -> None:
    for point in STUDY.points:
        failing = point.latency or point.loss  # type: ignore[attr-defined]
        recipe = point.recipe(1)
        assert isinstance(recipe.driven, Linked) == bool(failing)
        assert point.series in TALKING or not failing
        assert point.density in DENSITIES
    assert {recipe.scenario.horizon for _, recipe in STUDY.runs(1)} == {HORIZON}
