"""Level of service: of a run, and over a day by the interval in which vehicles came."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from minisim.clock import time_of_day
from minisim.errors import choice, number
from minisim.results.metrics import METRICS
from minisim.results.run import Run

if TYPE_CHECKING:
    import pandas as pd

#: Longest mean control delay of the levels A … E [s]; beyond is F. Highway Capacity Manual, 6th
#: ed. (2016): exhibit 19-8 for signalised junctions; 20-2 and 21-8 for two-way and all-way stops.
#: The manual also gives an F to demand over capacity; a run has no capacity, and its delay grows.
LEVELS: Final = {
    "signalised": (10.0, 20.0, 35.0, 55.0, 80.0),
    "unsignalised": (10.0, 15.0, 25.0, 35.0, 50.0),
}


def level_of_service(delay: float, kind: str = "unsignalised") -> str:
    """The level A … F of a mean control delay [s]; "" for NaN; raises `InputError`."""
    limits = LEVELS[choice("kind of junction", kind, LEVELS)]
    return "" if math.isnan(delay) else "ABCDEF"[int(np.searchsorted(limits, delay))]


def kind_of_junction(run: Run) -> str:
    """ "signalised" if the controller has `lights` or opened lanes; else "unsignalised"."""
    lights = getattr(run.controller, "lights", False) or run.exchange.get("Open")
    return "signalised" if lights else "unsignalised"


def grade(run: Run) -> int | None:
    """Level of service of all trips of a run, unfinished ones too: 1 for A … 6 for F, or None."""
    trips = run.columns
    if not len(trips.lane):
        return None
    delay = float(METRICS["control_delay_s"].values(trips, len(trips.lane)).mean())
    return 1 + METRICS["level_of_service"].grades.index(
        level_of_service(delay, kind_of_junction(run))
    )


def service(run: Run, interval: float = 900.0, kind: str = "") -> pd.DataFrame:
    """Waiting and delay of the vehicles that came in each interval of a run, after its warm-up.

    Args:
        run: whose trips are counted.
        interval: length of an interval [s].
        kind: of the junction, for the level of service: "signalised" or "unsignalised"; by default
            what it is (`kind_of_junction`).

    Returns:
        A row per interval: `start_s` in the run; `time`, the time of day if the demand has one;
        `trips`, how many came; `served`, how many of these arrived before the end; `waiting_time_s`
        and `control_delay_s`, means over all that came, with what unfinished trips had by the end,
        NaN if none came; `los`, the level of service. Control delay is time loss plus departure
        delay: what the junction costs against driving on at the limit.

    Raises:
        InputError: an `interval` outside 1 … 10⁶ s, or an unknown `kind`.
    """
    import pandas as pd

    interval = number("interval [s]", interval, low=1, high=1e6)
    trips, begin = run.counted.columns, float(run.scenario.warmup)
    edges = np.arange(begin, trips.end, interval)
    of = np.searchsorted(edges, trips.demand_time, side="right") - 1
    midnight = getattr(getattr(run.scenario, "demand", None), "start", 0.0)
    delay = METRICS["control_delay_s"].values(trips, len(of))

    def total(values: object = None) -> np.ndarray:
        return np.bincount(of, weights=values, minlength=len(edges))  # type: ignore[arg-type]

    came = total()
    with np.errstate(invalid="ignore"):
        waiting, mean = total(trips.waiting_time) / came, total(delay) / came
    return pd.DataFrame({
        "start_s": edges, "time": [time_of_day(midnight + edge) for edge in edges],
        "trips": came.astype(int), "served": total(trips.arrived).astype(int),
        "waiting_time_s": waiting, "control_delay_s": mean,
        "los": [level_of_service(one, kind or kind_of_junction(run)) for one in mean],
    })  # fmt: skip
