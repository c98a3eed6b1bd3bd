"""Rows as a sweep gives them, from formulas: results without a simulation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from dim import NoisyPerception
from dim.tally import Tallied
from minisim.geometry import ARM_NAMES
from scenarios.sweep.experiment import Experiment

#: Label -> waiting at low demand [s] and capacity on four arms [veh/h/lane].
CURVES = {
    "dim": (0.6, 380.0), "dim-harmonious": (0.4, 520.0),
    "dim-rotating": (0.6, 380.0), "dim-waiting": (0.6, 380.0),
    "fixed-time": (8.0, 400.0), "adaptive": (5.0, 450.0), "v2ic": (0.1, 480.0),
    "all-way-stop": (1.5, 550.0),
    "reservation": (0.3, 600.0), "longest-queue": (4.0, 460.0),
}  # fmt: skip


def capacity_of(label: str, arms: int) -> float:
    """The capacity that is built into the rows [veh/h/lane]."""
    return CURVES[label][1] * 4.0 / arms


def synthetic_row(experiment: Experiment) -> dict[str, Any]:
    """A queue of the M/M/1 kind, with a little noise from the seed."""
    arms, density = experiment.scenario.intersection.n, experiment.scenario.density
    horizon = experiment.scenario.horizon
    # The studies of perception name what errs, not a series; that of humans their share.
    label, _, share = (experiment.label or "dim").partition("-humans-")
    base = CURVES[label][0] * (1.0 + 5.0 * float(share or 0.0))
    load = density / capacity_of(label, arms)
    wobble = 1.0 + 0.1 * math.sin(7.0 * experiment.seed)
    waiting = wobble * base / max(1.0 - load, 0.02)
    trips = int(density * arms * horizon / 3600.0)
    excess = max(0.0, 1.0 - 1.0 / load) * trips / 2.0
    lanes = {
        f"lanes_{lane}_{key}": value
        for i, lane in enumerate(ARM_NAMES[:arms])
        for key, value in {
            "trips": trips // arms,
            "queue_growth": excess / arms,
            "waiting_time_s": waiting * (i + 1) / arms,
            "complete_waiting_time_s": waiting * (i + 1) / arms,
        }.items()
    }
    times = {
        "waiting_time_s": waiting,
        "travel_time_s": 70.0 + 1.5 * waiting,
        "time_loss_s": 3.0 + 1.5 * waiting,
        "depart_delay_s": 10.0 * max(load - 1.0, 0.0),
    }
    groups = ("human", "automated") if share else ()
    return {
        **{
            f"{group}_complete_{key}": (k + 1.0) * value if float(share) + k < 2.0 else None
            for k, group in enumerate(groups)
            for key, value in times.items()
        },
        **experiment.identity(), "trips": trips, "unfinished": 9, "collisions": 0, **times,
        **{f"complete_{key}": value for key, value in times.items()},
        **lanes, **tally(experiment, trips), "queue_growth": excess, "growing": excess > 0.0,
        "arrivals": "same", "cpu_s": 0.1, "version": "test", "error": None,
    }  # fmt: skip


def tally(experiment: Experiment, trips: int) -> dict[str, float]:
    """Counts of `dim.tally`, in proportion to the intent errors; nothing where nobody errs."""
    controller = experiment.controller
    if not isinstance(controller, Tallied):
        return {}
    perception = controller.dim.perception
    assert isinstance(perception, NoisyPerception)
    errors = max(perception.intent_error, *perception.unsignalled)
    return {
        "collisions": int(errors * 40), "crossings": trips - 9, "false_grants": int(errors * 300),
        "disagreement_s": 400.0 * errors, "deadlock_s": 0.0 if perception.shared else 50.0,
    }  # fmt: skip


def synthetic_find(experiments: Sequence[Experiment]) -> list[Mapping[str, Any] | None]:
    """A store that holds everything."""
    return [synthetic_row(experiment) for experiment in experiments]
