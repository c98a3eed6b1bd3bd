"""What DIM is compared with: controllers that need infrastructure or a fixed rule."""

from minisim.lazy import TYPE_CHECKING, loader

if TYPE_CHECKING:
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

__getattr__ = loader(__name__, {
    "baselines.all_way_stop": "AllWayStop",
    "baselines.platoons": "Platoons",
    "baselines.reservation": "Reservation",
    "baselines.signals.actuated": "Actuated",
    "baselines.signals.adaptive": "Adaptive",
    "baselines.signals.fixed_time": "FixedTime",
    "baselines.signals.max_pressure": "MaxPressure",
    "baselines.signals.webster": "SignalTiming webster webster_delay",
    "baselines.slots": "Slots",
    "baselines.v2ic": "V2IC",
    "baselines.v2ic_as_run": "V2ICAsRun",
})  # fmt: skip

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
