"""The table of metrics: what is measured in a run, in which unit and by which equation.

A metric has one value per trip, a series per lane or one number per run. Trip values are averaged
over the whole run and over each group of trips, in two forms. SUMO's form, which the paper used, is
the mean over the trips that ended before the horizon. The complete form is the mean over all
demanded trips: an unfinished one counts with its waiting, loss and travel up to the horizon, and a
vehicle that never got onto the road counts with its departure delay.

Nothing before the end of the warm-up is measured: trips that were demanded, trajectories and
counts. Only collisions always count, so that no run hides one.

To add a metric, add an entry to `TABLE`. Callers can pass their own (`minisim.results.asked`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from minisim.results import driving, exchange, fairness, queues
from minisim.results.metric import Metric
from minisim.results.trips import Floats, Trips, queue_growth

if TYPE_CHECKING:
    from minisim.results.run import Run


def _growth(trips: Trips) -> float:
    leave = np.where(trips.arrived, trips.arrival, math.inf)
    return queue_growth(trips.demand_time, leave, trips.end, trips.start)


def _throughput(trips: Trips) -> float | None:
    left = np.sort(trips.arrival[trips.arrived])
    if len(left) < 2 or trips.end <= left[0]:
        return None
    return float(3600.0 * (len(left) - 1) / (trips.end - left[0]))


def _grade(run: Run) -> int | None:
    from minisim.results.service import grade

    return grade(run)


def _close(name: str) -> Callable[[Run], Floats]:
    """The share of `minisim.results.safety` with this name, by trip."""

    def of(run: Run) -> Floats:
        from minisim.results import safety

        shares: Floats = getattr(safety, name)(run)
        return shares

    return of


def _tally(name: str) -> Callable[[Run], float | None]:
    return lambda run: run.counts.get(name)


def _safety(name: str) -> Callable[[Run], float | None]:
    return lambda run: run.safety[name]


_TRIPINFO = "(SUMO, Simulation/Output/TripInfo)"
_SSM = "(SUMO, Simulation/Output/SSM Device)"
_HORST = "(van der Horst 1990)"
_HBEFA = "Σ rate(v, a) dt, HBEFA 3.1 in SUMO (Krajzewicz et al. 2015; minisim.results.emissions)"

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
        "level_of_service", _grade, needs="run and trips", title="level of service", symbol="LOS",
        meaning="grade of the mean control delay, with unfinished trips: 1 for A to 6 for F",
        grades="ABCDEF",
        equation="signals: HCM 2016, exhibit 19-8; all others: exhibits 20-2 and 21-8",
    ),
    Metric(
        "throughput_vph", _throughput, "veh/h", needs="trips", title="throughput", symbol="q",
        meaning="vehicles that left after the first one, per hour from then to the end",
        equation="(k − 1)/(end − first arrival)",
    ),
    Metric(
        "saturation_headway_s", queues.saturation_headways, "s", "trip", "whole trajectories",
        title="saturation headway", symbol="h",
        meaning="between vehicles that leave a standing queue, from the fifth on",
        equation="entry into the junction − entry of the one ahead (HCM 2016, chapter 31)",
    ),
    Metric(
        "stops", driving.stops, "", "trip", "whole trajectories", title="stops",
        meaning="times that a vehicle came to a standstill",
        equation=f"v ≤ 0.1 m/s begins: waitingCount {_TRIPINFO}",
    ),
    Metric(
        "queue", queues.queue_lengths, "veh", "lane", "whole trajectories", title="queue",
        meaning="vehicles queued on the approach or before the road, over time; the whole run: in "
        "all lanes together",
        equation="v < 5 km/h for 1 s (SUMO, Simulation/Output/Lanearea Detectors), or waiting to "
        "enter",
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
        "worst_lane_s", fairness.worst_lane, "s", needs="trips", title="worst lane",
        meaning="longest mean waiting of a lane, with unfinished trips",
    ),
    Metric(
        "lane_gini", fairness.lane_gini, needs="trips", title="inequality of lanes", symbol="G",
        meaning="0 if the mean waiting is the same in all lanes",
        equation="Σᵢⱼ kᵢkⱼ|wᵢ − wⱼ|/(2 Σkᵢ Σkᵢwᵢ), k trips of a lane (Gini 1912)",
    ),
    Metric(
        "order_reversals", fairness.order_reversals, "", "trip", "trajectories",
        title="order reversals",
        meaning="vehicles on conflicting ways that came later than this one and went first",
        equation="slips (Larson 1987); comes: demand + way to the junction/limit, goes: enters it",
    ),
    Metric(
        "fuel_g", driving.fuel, "g", "trip", "whole trajectories", title="fuel",
        meaning="of cars, vans, buses and trucks; none for other types", equation=_HBEFA,
    ),
    Metric(
        "co2_g", driving.co2, "g", "trip", "whole trajectories", title="CO₂",
        meaning="carbon dioxide, likewise", equation=_HBEFA,
    ),
    Metric(
        "jerk_mps3", driving.jerk, "m/s³", "trip", "whole trajectories", title="jerk", symbol="j",
        meaning="largest change of a vehicle's acceleration in a second",
        equation="max |a(t) − a(t − 1 s)|/1 s, averaged as in ISO 15622:2018",
    ),
    Metric(
        "hard_brakings", driving.hard_brakings, "", "trip", "whole trajectories",
        title="hard brakings", meaning="times that a vehicle braked harder than is comfortable",
        equation="a < −3.4 m/s² begins (AASHTO 2018, section 3.2.2)",
    ),
    Metric(
        "decisions", lambda run: run.exchange.get("decisions"), title="decisions",
        meaning="times that the controller was asked",
    ),
    *(
        Metric(
            name, exchange.decision_time(percentile), "µs", needs="decisions", title=title,
            meaning=f"CPU time of a decision, {title.split()[0]}; differs from run to run",
        )
        for name, percentile, title in (
            ("median_decision_us", 50.0, "median decision"),
            ("p99_decision_us", 99.0, "p99 decision"),
        )
    ),
    Metric(
        "messages", exchange.messages, title="messages",
        meaning="between vehicles and controller; DIM and signals send none",
        equation="vehicles in all views + commands to vehicles; or as in minisim.link, lost or not",
    ),
    Metric(
        "message_bytes", exchange.message_bytes, "B", title="messages",
        meaning="the same in bytes", equation="190 each (3GPP TR 36.885), or as declared",
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
            name, _close(name), "", "trip", "trajectories", title=title, meaning=meaning,
            equation=equation,
        )
        for name, title, meaning, equation in (
            ("short_ttc", "TTC < 1.5 s", "share of vehicles that were so near to a collision",
             f"as the follower or the second to cross, {_HORST}"),
            ("short_pet", "PET < 1 s", "share of vehicles that entered an area so soon after "
             "another", f"as the second {_HORST}"),
            ("high_drac", "DRAC > 3.4 m/s²", "share of vehicles that had to brake so hard",
             "as the follower (AASHTO 2018, section 3.2.2; Archer 2005 has 3.35)"),
        )
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

#: Names of the metrics of `minisim.results.safety`, which `minisim run` always shows.
SAFETY: Final = (
    "min_ttc_s", "min_pet_s", "max_drac_mps2", "max_braking_mps2", "pets", *PETS,
)  # fmt: skip


def heading(column: str) -> str:
    """Heading of a column of a sweep, such as "waiting, with unfinished [s]"."""
    metric = METRICS.get(column.removeprefix("complete_"))
    if metric is not None and column.startswith("complete_"):
        metric = replace(metric, title=f"{metric.title}, with unfinished")
    return column if metric is None else metric.heading
