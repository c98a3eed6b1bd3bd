"""Decentralised intersection management: vehicles that decide alone and reach the same answer."""

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
