"""Keys of a file of experiments, and their defaults."""

from __future__ import annotations

from typing import Any

#: Key that may have a list -> its default. Every combination is run.
AXES: dict[str, Any] = {
    "scenario": "four-way",
    "side": "left",
    "profile": "paper",
    "model": "poisson",
    "split": "balanced",
    "turns": "uniform",
    "density": 350.0,
    "unit": "veh",
    "fleet": None,
    "arrivals": None,
    "demand": None,
    "controller": "dim",
    "humans": 0.0,
    "latency": 0.0,
    "jitter": 0.0,
    "loss": 0.0,
    "seeds": 10,
}

#: Key with one value for a block -> its default.
SINGLE: dict[str, Any] = {
    "horizon": None, "demand_time": None, "warmup": 0.0, "min_headway": 1.5, "on_collision": "stop",
    "metrics": (), "start": None,
}  # fmt: skip

#: An example of a custom junction.
CUSTOM = '{ name = "custom", bearings = [0, 80, 190, 260] }'
