"""What DIM is compared with: controllers that need infrastructure or a fixed rule."""

from baselines.all_way_stop import AllWayStop
from baselines.platoons import Platoons
from baselines.reservation import Reservation
from baselines.signals.actuated import Actuated
from baselines.signals.adaptive import Adaptive
from baselines.signals.fixed_time import FixedTime
from baselines.signals.max_pressure import MaxPressure
from baselines.signals.webster import SignalTiming, webster, webster_delay
from baselines.slots import Slots
from baselines.v2ic import V2IC
from baselines.v2ic_as_run import V2ICAsRun

__all__ = [
    "V2IC",
    "Actuated",
    "Adaptive",
    "AllWayStop",
    "FixedTime",
    "MaxPressure",
    "Platoons",
    "Reservation",
    "SignalTiming",
    "Slots",
    "V2ICAsRun",
    "webster",
    "webster_delay",
]
