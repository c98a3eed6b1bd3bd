"""Decentralised intersection management: vehicles that decide alone and reach the same answer."""

from minisim.lazy import TYPE_CHECKING, loader

if TYPE_CHECKING:
    from dim.as_run import AsRunDim
    from dim.controller import Dim
    from dim.decision import DecisionTable, Explanation, decide, explain
    from dim.harmony import HarmonyMatrix
    from dim.humans.drivers import Humans
    from dim.humans.mixed import Mixed
    from dim.monitor import Monitor
    from dim.perception import ExactPerception, Perception
    from dim.senses.noise import NoisyPerception
    from dim.zones import Zones

__getattr__ = loader(__name__, {
    "dim.as_run": "AsRunDim",
    "dim.controller": "Dim",
    "dim.decision": "DecisionTable Explanation decide explain",
    "dim.harmony": "HarmonyMatrix",
    "dim.humans.drivers": "Humans",
    "dim.humans.mixed": "Mixed",
    "dim.monitor": "Monitor",
    "dim.perception": "ExactPerception Perception",
    "dim.senses.noise": "NoisyPerception",
    "dim.zones": "Zones",
})  # fmt: skip

__all__ = [
    "AsRunDim",
    "DecisionTable",
    "Dim",
    "ExactPerception",
    "Explanation",
    "HarmonyMatrix",
    "Humans",
    "Mixed",
    "Monitor",
    "NoisyPerception",
    "Perception",
    "Zones",
    "decide",
    "explain",
]
