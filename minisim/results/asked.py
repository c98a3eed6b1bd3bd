"""What callers ask for when they ask for metrics: names, metrics, or functions of a run.

def stops(run):
    ...

run.summary(metrics=["waiting_time_s", Metric("stops", stops, per="trip")])
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from typing import Any

from minisim.errors import InputError, choice, items
from minisim.parameters import parameters
from minisim.results.metric import Metric
from minisim.results.metrics import METRICS

#: What stands for a metric: its name, a `Metric`, or a function (`metric_of`).
Asked = str | Metric | Callable[[Any], Any]


def metric_of(function: Callable[[Any], Any]) -> Metric:
    """The metric of a named function, whose attributes may set fields such as `unit`."""
    known = {it.name for it in parameters(Metric)} & vars(function).keys()
    return Metric(function.__name__, function, **{key: vars(function)[key] for key in known})


def listed(metrics: str | Iterable[Asked]) -> list[Asked]:
    """A sequence of metrics, or a text such as "trips, pets", as a list; else `InputError`."""
    if isinstance(metrics, str):
        return [name.strip() for name in metrics.split(",")]
    return items("metrics", metrics, "names and Metrics")


def asked_metrics(metrics: str | Iterable[Asked]) -> tuple[Metric, ...]:
    """The metrics asked for, once each.

    Raises `InputError` for anything but a sequence or a text, and for unknown or clashing names.
    """
    asked: dict[str, Metric] = {}
    for metric in listed(metrics):
        if inspect.isfunction(metric):
            metric = metric_of(metric)
        elif not isinstance(metric, Metric):
            metric = METRICS[choice("metric", metric, METRICS)]
        if METRICS.get(metric.name, metric) is not metric:
            raise InputError(f"there is already a metric {metric.name!r}; give yours another name")
        if asked.setdefault(metric.name, metric) != metric:
            raise InputError(f"two metrics are called {metric.name!r}")
    return tuple(asked.values())
