"""Environments for learning, in the form of Gymnasium and PettingZoo (extra `gym`).

    import gymnasium
    import scenarios.environments  # makes them known to Gymnasium

    env = gymnasium.make("minisim/RightOfWay-v0", scenario=four_way(density=250, horizon=600))

docs/howto/environments.md has the observations, actions and rewards.
"""

from __future__ import annotations

from minisim.errors import MissingExtraError, extra

try:
    import gymnasium
    import pettingzoo  # noqa: F401
except ImportError as error:
    raise MissingExtraError(f"environments need {error.name}: {extra('gym')}") from error

from scenarios.environments.batch import RightOfWayBatch
from scenarios.environments.right_of_way import RightOfWayEnv
from scenarios.environments.signal import SignalEnv
from scenarios.environments.vehicles import VehiclesEnv

__all__ = ["RightOfWayBatch", "RightOfWayEnv", "SignalEnv", "VehiclesEnv"]

gymnasium.register(
    "minisim/RightOfWay-v0", entry_point="scenarios.environments:RightOfWayEnv",
    vector_entry_point="scenarios.environments:RightOfWayBatch",
)  # fmt: skip
gymnasium.register("minisim/Signal-v0", entry_point="scenarios.environments:SignalEnv")
