"""Environments for learning, in the form of Gymnasium and PettingZoo (extra `gym`).

    import gymnasium

    env = gymnasium.make("minisim/RightOfWay-v0", scenario=four_way(density=250, horizon=600))

docs/environments.md has the observations, actions and rewards.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenarios.environments.right_of_way import RightOfWayEnv
    from scenarios.environments.signal import SignalEnv
    from scenarios.environments.vehicles import VehiclesEnv

__all__ = ["RightOfWayEnv", "SignalEnv", "VehiclesEnv", "register"]

_HOMES = {"RightOfWayEnv": "right_of_way", "SignalEnv": "signal", "VehiclesEnv": "vehicles"}


def register() -> None:
    """Make the environments known to `gymnasium.make`; Gymnasium calls it when it is imported."""
    from gymnasium.envs import registration

    for name in ("RightOfWay", "Signal"):
        home = f"scenarios.environments.{_HOMES[f'{name}Env']}:{name}Env"
        if f"minisim/{name}-v0" not in registration.registry:
            registration.register(f"minisim/{name}-v0", entry_point=home)


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'scenarios.environments' has no attribute {name!r}")
    return getattr(importlib.import_module(f"scenarios.environments.{_HOMES[name]}"), name)
