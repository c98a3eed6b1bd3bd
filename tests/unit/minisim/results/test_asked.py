"""What callers may ask for."""

from __future__ import annotations

from typing import Any

import pytest

from minisim.errors import InputError
from minisim.results.asked import asked_metrics, metric_of
from minisim.results.metric import Metric
from minisim.results.metrics import METRICS


def test_metrics_are_asked_for_by_name_or_as_they_are_once_each() -> None:
    own = Metric("m", len)
    wanted = (METRICS["trips"], own)
    assert asked_metrics(["trips", own, "trips"]) == wanted
    assert asked_metrics("trips, trips") == wanted[:1]


def test_the_attributes_of_a_function_are_those_of_its_metric() -> None:
    def delays(trips: Any) -> Any:
        return trips.depart_delay

    delays.unit, delays.per, delays.needs = "s", "trip", "trips"  # type: ignore[attr-defined]
    wanted = Metric("delays", delays, "s", per="trip", needs="trips")
    assert metric_of(delays) == wanted
    assert asked_metrics([delays]) == (wanted,)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (["min_tcc_s"], "unknown metric 'min_tcc_s'.*did you mean 'min_ttc_s'"),
        ([5], "unknown metric 5"),
        ("trip", "unknown metric 'trip'.*did you mean 'trips'"),
        (5, "metrics must be a sequence of names and Metrics, got 5"),
        ([Metric("travel_time_s", len)], "already a metric 'travel_time_s'; give yours another"),
        ([Metric("m", len), Metric("m", sum)], "two metrics are called 'm'"),
    ],
)
def test_what_cannot_be_asked_for_is_refused(asked: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        asked_metrics(asked)
