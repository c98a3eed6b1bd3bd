"""What DIM is compared with: controllers that need infrastructure or a fixed rule."""

from baselines.actuated import Actuated
from baselines.adaptive import Adaptive
from baselines.all_way_stop import AllWayStop
from baselines.fixed_time import FixedTime
from baselines.longest_queue import LongestQueue
from baselines.reservation import Reservation
from baselines.v2i import V2IC
from baselines.v2i_as_run import V2ICAsRun
from baselines.webster import SignalTiming, webster, webster_delay

__all__ = [
    "V2IC",
    "Actuated",
    "Adaptive",
    "AllWayStop",
    "FixedTime",
    "LongestQueue",
    "Reservation",
    "SignalTiming",
    "V2ICAsRun",
    "webster",
    "webster_delay",
]
