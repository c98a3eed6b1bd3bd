"""What DIM is compared with: controllers that need infrastructure or a fixed rule."""

from baselines.adaptive import Adaptive
from baselines.all_way_stop import AllWayStop
from baselines.fixed_time import FixedTime
from baselines.longest_queue import LongestQueue
from baselines.webster import SignalTiming, webster, webster_delay

__all__ = [
    "Adaptive",
    "AllWayStop",
    "FixedTime",
    "LongestQueue",
    "SignalTiming",
    "webster",
    "webster_delay",
]
