"""The table of metrics: what is measured in a run, in which unit and by which equation.

A metric has one value per trip or one number per run. Trip values are averaged over the whole run
and over each group of trips, in two forms. SUMO's form, which the paper used, is the mean over the
trips that ended before the horizon. The complete form is the mean over all demanded trips: an
unfinished one counts with its waiting, loss and travel up to the horizon, and a vehicle that never
got onto the road counts with its departure delay.

Nothing before the end of the warm-up is measured: trips that were demanded, trajectories and
counts. Only collisions always count, so that no run hides one.

To add a metric, add an entry to `TABLE`. Callers can pass metrics of their own:

    def stops(run):
        ...

    run.summary(metrics=["waiting_time_s", Metric("stops", stops, per="trip")])
"""

from __future__ import annotations

import inspect
import math
import traceback
from collections.abc import Callable, Iterable
from dataclasses import replace
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from minisim.errors import InputError, MinisimError, choice, items, show
from minisim.parameters import Switch, checked, declared, parameters, switch, text, word
from minisim.results.trips import Floats, Trips, queue_growth

if TYPE_CHECKING:
    from minisim.results.run import Run

#: Names that no metric may have: keys of summaries and columns of sweeps.
RESERVED: Final = frozenset({
    "arms", "arrivals", "complete", "controller", "cpu_s", "density", "difference", "error",
    "failed", "growing", "horizon_s", "host", "kind", "kinds", "lane", "lanes", "manoeuvre",
    "movements", "pairs", "profile", "recipe", "runs", "scenario", "seed", "side", "spillback_s",
    "split", "too_short", "turns", "vehicle", "version", "warmup_s",
})  # fmt: skip

#: What trips can be grouped by -> the groups' key in a summary.
GROUPS: Final = {"lane": "lanes", "movement": "movements", "kind": "kinds", "type": "types"}

#: Suffixes of the columns with percentiles (numpy's linear method) and the maximum.
SPREAD: Final = ("p50", "p95", "max")

#: Prefixes and suffixes of columns made from metrics.
BEGINNINGS: Final = ("complete_", *(f"{key}_" for key in GROUPS.values()))
ENDINGS: Final = tuple(f"_{what}" for what in (*SPREAD, "ci95", "pi95"))


def _name(title: str, value: Any) -> Any:
    if not isinstance(value, str) or not value.isidentifier():
        raise InputError(f"{title} must be letters, digits and underscores, got {show(value)}")
    if value in RESERVED or value.startswith(BEGINNINGS) or value.endswith(ENDINGS):
        raise InputError(f"{title} must not be a column of runs, got {value!r}")
    return value


def _function(title: str, value: Any) -> Any:
    if not callable(value):
        raise InputError(f"{title} must be a function, got {show(value)}")
    return value


@declared
class Metric:
    """One metric: its column, its meaning and the function that measures it.

    The function takes the `Trips` if `needs` is "trips", otherwise the `Run`, both without the
    warm-up (`Run.counted`). A number that needs only trips also has a value per group of trips.
    """

    name: str = checked("the column", _name, "identifier", label="name of a metric")
    of: Callable[[Any], Any] = checked(
        "measures it: returns an array with one value per trip (NaN for none), or one number "
        "(None for none)",
        _function, "function", label="function of a metric",
    )  # fmt: skip
    unit: str = text("such as s", empty=True, default="")
    per: str = word("what has a value", ("trip", "run"), default="run")
    needs: str = word("measured from", ("trips", "run", "trajectories", "counts"), default="run")
    phase: str = word(
        "of a trip, in which a value accumulates: on the road, or before insertion",
        ("drive", "queue"), default="drive",
    )  # fmt: skip
    title: str = text("for headings and axes; empty means its name", empty=True, default="")
    symbol: str = text("in equations", empty=True, default="")
    meaning: str = text("in one line", empty=True, default="")
    equation: str = text("with its source", empty=True, default="")
    usual: Switch = switch("whether every summary has it", default=False)

    @property
    def grouped(self) -> bool:
        """Whether each lane, movement and kind has a value of its own."""
        return self.per == "trip" or self.needs == "trips"

    @property
    def heading(self) -> str:
        """Title and unit, such as "waiting [s]"."""
        return f"{self.title or self.name} [{self.unit}]".removesuffix(" []")

    def values(self, subject: Run | Trips, count: int) -> Floats:
        """One value per trip, shape (count,), NaN for none; otherwise `InputError`."""
        given = self._measured(subject)
        values = np.asarray(given)
        if values.shape != (count,) or values.dtype.kind not in "biuf" or np.isinf(values).any():
            raise InputError(
                f"metric {self.name!r} must give one finite number per trip, an array of shape "
                f"({count},), got {show(given)}"
            )
        return np.asarray(values, dtype=float)

    def number(self, subject: Run | Trips) -> float | int | None:
        """One number, or None if there is none; raises `InputError` for anything else."""
        given = self._measured(subject)
        if given is None:
            return None
        if not isinstance(given, Real | np.bool_) or math.isinf(given):
            hint = '; per="trip" takes an array' if isinstance(given, np.ndarray) else ""
            raise InputError(
                f"metric {self.name!r} must give one finite number or None, got {show(given)}{hint}"
            )
        if isinstance(given, Integral | np.bool_):
            return int(given)
        return None if math.isnan(given) else float(given)

    def _measured(self, subject: Run | Trips) -> Any:
        try:
            return self.of(subject)
        except (Exception, SystemExit) as error:  # a caller's function may raise anything
            frames = traceback.extract_tb(error.__traceback__)[1:2]
            place = "".join(f" ({Path(it.filename).name}, line {it.lineno})" for it in frames)
            what = f" raised {type(error).__name__}: {error}{place}"
            if isinstance(error, MinisimError):
                what = f": {error}"
            raise InputError(f"metric {self.name!r}{what}") from error


def _growth(trips: Trips) -> float:
    leave = np.where(trips.arrived, trips.arrival, math.inf)
    return queue_growth(trips.demand_time, leave, trips.end, trips.start)


def _tally(name: str) -> Callable[[Run], float | None]:
    return lambda run: run.counts.get(name)


def _safety(name: str) -> Callable[[Run], float | None]:
    return lambda run: run.safety[name]


_TRIPINFO = "(SUMO, Simulation/Output/TripInfo)"
_SSM = "(SUMO, Simulation/Output/SSM Device)"

#: Metric that counts short encroachments -> the time that they are shorter than [s].
PETS: Final = {"pets_below_1_s": 1.0, "pets_below_1_5_s": 1.5, "pets_below_2_s": 2.0}

#: All our own metrics, in the order in which tables list them.
TABLE: Final = (
    Metric(
        "trips", lambda trips: len(trips.demand_time), needs="trips", title="trips", symbol="k",
        meaning="vehicles demanded before the end, after the warm-up", usual=True,
    ),
    Metric(
        "unfinished", lambda trips: int(np.count_nonzero(~trips.arrived)), needs="trips",
        title="unfinished", meaning="those that had not arrived at the end", usual=True,
    ),
    Metric(
        "waiting_time_s", lambda trips: trips.waiting_time, "s", "trip", "trips",
        title="waiting", symbol="w", meaning="time at a standstill",
        equation=f"Σ dt where v ≤ 0.1 m/s {_TRIPINFO}", usual=True,
    ),
    Metric(
        "travel_time_s", lambda trips: trips.travel_time, "s", "trip", "trips",
        title="travel", symbol="T", meaning="from insertion to leaving",
        equation=f"arrival − depart {_TRIPINFO}", usual=True,
    ),
    Metric(
        "time_loss_s", lambda trips: trips.time_loss, "s", "trip", "trips",
        title="time loss", symbol="L", meaning="time lost by driving below the limit",
        equation=f"Σ (1 − v/v_allowed) dt, v_allowed the limit at the vehicle {_TRIPINFO}",
        usual=True,
    ),
    Metric(
        "depart_delay_s", lambda trips: trips.depart_delay, "s", "trip", "trips", "queue",
        title="departure delay", symbol="D", meaning="from demand to insertion",
        equation=f"depart − demand {_TRIPINFO}", usual=True,
    ),
    Metric(
        "control_delay_s", lambda trips: trips.time_loss + trips.depart_delay, "s", "trip", "trips",
        "queue", title="control delay", symbol="d",
        meaning="what the junction costs against driving on at the limit",
        equation="time loss + departure delay; by it HCM 2016 grades the level of service",
    ),
    Metric(
        "collisions", lambda run: len(run.collisions), title="collisions",
        meaning="pairs of vehicles that touched", usual=True,
    ),
    Metric(
        "queue_growth", _growth, needs="trips", title="queue growth", symbol="ΔN",
        meaning="more vehicles in the last quarter than in the second",
        equation="N̄(4th quarter) − N̄(2nd quarter), N from demand to arrival (ours)",
    ),
    Metric(
        "min_ttc_s", _safety("min_ttc_s"), "s", needs="trajectories", title="minimum TTC",
        symbol="TTC", meaning="shortest time to collision, following and crossing",
        equation=f"gap/Δv while closing (Hayward 1972) {_SSM}",
    ),
    Metric(
        "min_pet_s", _safety("min_pet_s"), "s", needs="trajectories", title="minimum PET",
        symbol="PET", meaning="shortest time between two vehicles in a conflict area",
        equation=f"entry of the second − exit of the first {_SSM}",
    ),
    Metric(
        "max_drac_mps2", _safety("max_drac_mps2"), "m/s²", needs="trajectories",
        title="maximum DRAC", symbol="DRAC", meaning="deceleration that avoids a collision",
        equation=f"Δv²/(2·gap) while closing {_SSM}",
    ),
    Metric(
        "max_braking_mps2", _safety("max_braking_mps2"), "m/s²", needs="trajectories",
        title="hardest braking", symbol="b", meaning="largest deceleration of a vehicle",
        equation="max(−a)",
    ),
    Metric(
        "pets", _safety("pets"), needs="trajectories", title="encroachments",
        meaning="pairs of vehicles one after the other through a conflict area",
    ),
    *(
        Metric(
            name, _safety(name), needs="trajectories", title=f"PET below {limit:g} s",
            meaning=f"encroachments shorter than {limit:g} s",
        )
        for name, limit in PETS.items()
    ),
    *(
        Metric(
            name, _tally(name), "s" * name.endswith("_s"), needs="counts", meaning=meaning,
            title=name.removesuffix("_s").replace("_", " "),
        )
        for name, meaning in (
            ("crossings", "vehicles that entered the junction, where perception errs"),
            ("false_grants", "rights of way that the true view would not have given"),
            ("disagreement_s", "time in which vehicles had chosen different cliques"),
            ("deadlock_s", "time in which vehicles stood and none had the right of way"),
        )
    ),
)  # fmt: skip

METRICS: Final = {metric.name: metric for metric in TABLE}

#: The metrics in every summary.
USUAL: Final = tuple(metric for metric in TABLE if metric.usual)

#: Names of the usual metrics with one value per trip: columns of trip tables, and means.
MEANS: Final = tuple(metric.name for metric in USUAL if metric.per == "trip")

#: Names of the metrics of `minisim.results.safety`.
SAFETY: Final = tuple(metric.name for metric in TABLE if metric.needs == "trajectories")

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


def heading(column: str) -> str:
    """Heading of a column of a sweep, such as "waiting, with unfinished [s]"."""
    metric = METRICS.get(column.removeprefix("complete_"))
    if metric is not None and column.startswith("complete_"):
        metric = replace(metric, title=f"{metric.title}, with unfinished")
    return column if metric is None else metric.heading
